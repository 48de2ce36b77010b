//! What `taxel forearm` says of a session before it makes anything of it.

use crate::{fails, succeeds};
use serde_json::Value;
use std::fs;
use std::path::Path;
use taxel_forearm::{Session, Trial};
use tempfile::TempDir;

/// Simulated squeezes at 13 places, two at each.
fn simulated(dir: &TempDir) -> Session {
    succeeds(
        dir,
        &["forearm", "simulate", "--out", "all.npz", "--repetitions", "2"],
    );
    let mut session = Session::open(&dir.path().join("all.npz")).unwrap();
    session
        .trials
        .iter_mut()
        .for_each(|trial| trial.squeeze.tactile = None);
    session
}

/// Writes squeezes as a folder of the publication's files.
fn write(folder: &Path, trials: &[Trial]) {
    for trial in trials {
        let place = (trial.location_percent * 0.12).round() as usize;
        let of_place = folder.join(place.to_string());
        fs::create_dir_all(&of_place).unwrap();
        let name = format!("distance{place}_{}.mat", trial.number());
        fs::write(of_place.join(name), trial.squeeze.to_mat()).unwrap();
    }
}

#[test]
fn a_backup_in_the_folder_is_told_and_not_trained_on_and_two_arms_are_no_session() {
    let dir = TempDir::new().unwrap();
    let session = simulated(&dir);
    write(&dir.path().join("arm"), &session.trials);
    write(&dir.path().join("arm/backup"), &session.trials);
    let train = ["forearm", "train", "arm", "--out", "arm.model"];
    let (out, said) = succeeds(&dir, &train);
    assert!(out.contains("trained on 26 squeezes at 13 places"), "{out}");
    assert!(
        said.contains("arm: 26 .mat files of the folder are no part of this session")
            && said.contains("as arm/backup/0/distance0_1.mat"),
        "{said}"
    );
    fs::remove_dir_all(dir.path().join("arm/backup")).unwrap();
    let (_, said) = succeeds(&dir, &train);
    assert_eq!(said, "");
    for name in ["anna", "ben"] {
        write(&dir.path().join("data").join(name), &session.trials);
    }
    let error = fails(&dir, &["forearm", "train", "data", "--out", "arm.model"], 1);
    assert!(
        error.contains("there are squeezes in data/anna and in data/ben") && error.contains("name one"),
        "{error}"
    );
}

#[test]
fn places_of_ones_own_are_told_in_percent_and_a_copied_squeeze_is_named() {
    let dir = TempDir::new().unwrap();
    let mut session = simulated(&dir);
    session.trials.retain(|trial| trial.location_percent < 42.0);
    write(&dir.path().join("six"), &session.trials);
    let train = ["forearm", "train", "six", "--out", "six.model"];
    let (out, said) = succeeds(&dir, &train);
    assert!(
        out.contains("at 6 places\n")
            && out.contains("places are from 0.0 to 41.7 % of the forearm; the elbow, 100 %, is place 12"),
        "{out}"
    );
    assert_eq!(said, "");
    let (out, _) = succeeds(&dir, &[&train[..], &["--json"]].concat());
    let told: Value = serde_json::from_str(&out).unwrap();
    let of = |key: &str| told[key].as_f64().unwrap();
    assert!(
        of("from_percent") == 0.0 && (of("to_percent") - 41.667).abs() < 0.001,
        "{told}"
    );
    let (out, _) = succeeds(&dir, &["forearm", "train", "all.npz", "--out", "all.model"]);
    assert!(
        out.contains("places are from 0.0 to 100.0 % of the forearm\n"),
        "{out}"
    );
    session.trials[3].squeeze = session.trials[10].squeeze.clone();
    write(&dir.path().join("six"), &session.trials);
    let (_, said) = succeeds(&dir, &train);
    assert!(
        said.contains("six: squeeze 2 at 8.3 % and squeeze 1 at 41.7 % are the same in all samples"),
        "{said}"
    );
}
