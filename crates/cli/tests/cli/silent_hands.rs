//! Recordings of a hand that is silent, at first, for a while or from end to end.

use crate::recorded_hands::put_hand_with_silence;
use crate::{fails, succeeds};
use ndarray::{Array1, Array2};
use ndarray_npy::NpzReader;
use std::fs::File;
use taxel_recorder::{Entry, Preamble, RecordingWriter, Topic, event_message, event_name};
use taxel_skin::Layout;
use taxel_wire::EventKind;
use tempfile::TempDir;

#[test]
fn frames_of_a_silent_hand_are_there_with_their_times_but_for_those_before_it_speaks() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("gap.mcap");
    let mut writer = RecordingWriter::begin(File::create(&path).unwrap(), &Preamble::default(), 0).unwrap();
    put_hand_with_silence(
        &mut writer,
        &Layout::builtin("uskin-module").unwrap(),
        1_000_000_000,
        12,
        |n| n < 2 || (5..8).contains(&n) || n == 11,
    );
    writer.finish().unwrap();
    let wanted: Vec<bool> = (2..12).map(|n| (5..8).contains(&n) || n == 11).collect();
    let times: Vec<u64> = (0..10).map(|n| n * 10_000_000).collect();
    let npz = |file: &str| NpzReader::new(File::open(dir.path().join(file)).unwrap()).unwrap();
    // Of the recording, and of every file that was made of it.
    for (from, to) in [
        ("gap.mcap", "gap.csv"),
        ("gap.csv", "gap.npz"),
        ("gap.npz", "again.npz"),
    ] {
        let (_, err) = succeeds(&dir, &["convert", from, to, "--layout", "uskin-module"]);
        assert!(err.contains(&format!("{to}: 10 frames")), "{err}");
        let said = "gap.mcap: 2 frames are left out, before the first in which a taxel has a value\n";
        assert_eq!(err.contains(said), from == "gap.mcap", "{err}");
        if to.ends_with(".npz") {
            let without: Array2<bool> = npz(to).by_name("without_value").unwrap();
            let silent = without
                .outer_iter()
                .map(|frame| frame.iter().all(|without| *without));
            assert_eq!(silent.collect::<Vec<_>>(), wanted, "{to}");
            let made: Array1<u64> = npz(to).by_name("t_ns").unwrap();
            assert_eq!(made.to_vec(), times, "{to}");
        }
    }
    let text = std::fs::read_to_string(dir.path().join("gap.csv")).unwrap();
    let is_empty = |line: &str| line.ends_with(&",".repeat(48));
    assert_eq!(text.lines().skip(1).map(is_empty).collect::<Vec<_>>(), wanted);
    // An image for each of them, too, and the frames that they are made of.
    for input in ["gap.mcap", "gap.csv", "gap.npz"] {
        let out = ["--out", "images.npz", "--frames", "frames.csv"];
        succeeds(
            &dir,
            &[&["compress", input, "--layout", "uskin-module"][..], &out].concat(),
        );
        let missing: Array1<u16> = npz("images.npz").by_name("missing").unwrap();
        let silent = missing.iter().map(|missing| *missing == 16);
        assert_eq!(silent.collect::<Vec<_>>(), wanted, "{input}");
        let frames = std::fs::read_to_string(dir.path().join("frames.csv")).unwrap();
        assert_eq!(frames.lines().skip(1).map(is_empty).collect::<Vec<_>>(), wanted);
    }
}

#[test]
fn what_has_no_frame_to_give_says_whether_it_was_silent_or_is_damaged() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("hand.mcap");
    let hand = Layout::builtin("uskin-module").unwrap();
    let record = || {
        let mut writer =
            RecordingWriter::begin(File::create(&path).unwrap(), &Preamble::default(), 0).unwrap();
        put_hand_with_silence(&mut writer, &hand, 1_000_000_000, 20, |_| true);
        writer.finish().unwrap();
    };
    let readers: [&[&str]; 3] = [
        &["compress", "hand.mcap", "--out", "images.npz"],
        &["convert", "hand.mcap", "hand.npz"],
        &["convert", "hand.mcap", "marks.csv", "--marks"],
    ];
    record();
    for args in readers {
        let err = fails(&dir, args, 1);
        let said = "hand.mcap: no taxel has a value in any of its 20 frames: the hand was silent\n";
        assert!(err.contains(said), "{err}");
    }
    let mut bytes = std::fs::read(&path).unwrap();
    bytes[600] ^= 1;
    std::fs::write(&path, bytes).unwrap();
    for args in readers {
        let err = fails(&dir, args, 1);
        assert!(
            err.contains("are damaged") && err.contains("hand.mcap: nothing of it could be read\n"),
            "{err}"
        );
    }
}

#[test]
fn of_the_marks_made_before_a_hand_speaks_the_last_holds_from_its_first_frame_on() {
    let began_ns = 1_000_000_000;
    for (early, said, wanted) in [
        (&[][..], None, "0.05,touch 2\n"),
        (
            &["touch 1"],
            Some("the mark \"touch 1\" was made before the first frame; it is taken to be made with it\n"),
            "0,touch 1\n0.05,touch 2\n",
        ),
        (
            &["one", "two", "touch 1"],
            Some(
                "3 marks were made before the first frame; the last, \"touch 1\", is taken to be made with it, and the others",
            ),
            "0,touch 1\n0.05,touch 2\n",
        ),
    ] {
        let dir = TempDir::new().unwrap();
        let path = dir.path().join("early.mcap");
        let mut writer =
            RecordingWriter::begin(File::create(&path).unwrap(), &Preamble::default(), 0).unwrap();
        // The hand is silent in its first five frames.
        let early = early
            .iter()
            .zip(1..)
            .map(|(text, n)| (*text, began_ns + n * 10_000_000));
        for (text, wall_ns) in early.chain([("touch 2", began_ns + 100_000_000)]) {
            let (topic, data) = (
                Topic::Events,
                event_message(event_name(EventKind::Mark), text, wall_ns),
            );
            writer.put(&Entry { topic, wall_ns, data }).unwrap();
        }
        put_hand_with_silence(
            &mut writer,
            &Layout::builtin("uskin-module").unwrap(),
            began_ns,
            20,
            |n| n < 5,
        );
        writer.finish().unwrap();
        let (_, err) = succeeds(&dir, &["convert", "early.mcap", "marks.csv", "--marks"]);
        match said {
            Some(said) => assert!(err.contains(said), "{err}"),
            None => assert!(!err.contains("before the first frame"), "{err}"),
        }
        let count = wanted.lines().count();
        let counted = format!("marks.csv: {count} mark{}\n", if count == 1 { "" } else { "s" });
        assert!(err.contains(&counted), "{err}");
        let text = std::fs::read_to_string(dir.path().join("marks.csv")).unwrap();
        assert_eq!(text, format!("t_s,text\n{wanted}"));
    }
}
