//! `taxel compress --learn-codebook`.

use crate::{fails, succeeds, words};
use ndarray::Array3;
use serde_json::Value;
use tempfile::TempDir;

#[test]
fn a_learned_codebook_is_a_configuration() {
    let dir = TempDir::new().unwrap();
    succeeds(
        &dir,
        &["sim", "ball-grasp", "--to", "log:grasp.log", "--seconds", "4"],
    );
    let learn = words("compress grasp.log --out a.npy --levels 4 --learn-codebook book.toml");
    succeeds(&dir, &learn);
    let book = std::fs::read_to_string(dir.path().join("book.toml")).unwrap();
    let settings = format!("[[bus]]\nsource = \"can:can0\"\n[[bus]]\nsource = \"can:can1\"\n{book}");
    std::fs::write(dir.path().join("taxeld.toml"), settings).unwrap();
    succeeds(
        &dir,
        &words("compress grasp.log --config taxeld.toml --out b.jsonl"),
    );
    let text = std::fs::read_to_string(dir.path().join("b.jsonl")).unwrap();
    let levels = |line: &str| serde_json::from_str::<Value>(line).unwrap()["levels"].clone();
    let constant: Vec<Value> = text
        .lines()
        .map(levels)
        .filter(|l| *l != serde_json::json!([]))
        .collect();
    assert!(constant.len() > 1);
    assert!(constant.iter().all(|l| *l == constant[0]), "{constant:?}");
}

#[test]
fn a_codebook_is_learned_whatever_gives_the_levels_of_the_configuration() {
    let dir = TempDir::new().unwrap();
    let forces = Array3::from_shape_fn((20, 4, 4), |(t, y, x)| (t * (1 + y) + x) as f32);
    ndarray_npy::write_npy(dir.path().join("press.npy"), &forces).unwrap();
    for (key, replaced) in [
        ("", "configuration."),
        (
            "codebook_learning = { forgetting = 0.01 }",
            "in place of codebook_learning.",
        ),
        ("codebook = [1.0, 20.0]", "in place of codebook."),
        (
            "level_steps = \"equal\"\nforce_min = 1.0\nforce_max = 80.0",
            "in place of level_steps.",
        ),
        (
            "level_steps = \"weber\"\njnd = 0.5\nforce_min = 1.0\nforce_max = 80.0",
            "in place of jnd and level_steps.",
        ),
    ] {
        std::fs::write(
            dir.path().join("hand.toml"),
            format!("layout = \"grid:4x4\"\n[profile]\n{key}\n"),
        )
        .unwrap();
        let learn = ["--learn-codebook", "book.toml", "--out", "a.npy"];
        succeeds(
            &dir,
            &[&["compress", "press.npy", "--config", "hand.toml"][..], &learn].concat(),
        );
        let book = std::fs::read_to_string(dir.path().join("book.toml")).unwrap();
        assert!(book.lines().next().unwrap().ends_with(replaced), "{key}: {book}");
        assert!(book.contains("codebook = ["), "{key}: {book}");
    }
}

#[test]
fn a_codebook_of_nothing_in_contact_is_none_and_leaves_no_file() {
    let dir = TempDir::new().unwrap();
    ndarray_npy::write_npy(dir.path().join("zero.npy"), &Array3::<f32>::zeros((20, 4, 4))).unwrap();
    for out in ["o.npy", "o.jsonl", "o.bin"] {
        let args = [
            "compress",
            "zero.npy",
            "--out",
            out,
            "--learn-codebook",
            "book.toml",
        ];
        let err = fails(&dir, &args, 1);
        assert!(err.contains("no codebook"), "{err}");
        assert!(
            !dir.path().join(out).exists() && !dir.path().join("book.toml").exists(),
            "{out}"
        );
    }
}
