//! `taxel convert`, and MCAP recordings as inputs: the same frames and the same images whatever the file.

use crate::recorded_hands::put_hand;
use crate::{fails, succeeds};
use ndarray::{Array1, Array3};
use ndarray_npy::NpzReader;
use std::fs::File;
use std::io::BufReader;
use taxel_can::{CanFrame, LogReader, Received};
use taxel_recorder::{CanBlock, Entry, Preamble, RecordingWriter, Topic, event_message, event_name};
use taxel_wire::EventKind;
use tempfile::TempDir;

const SCENE: [&str; 6] = ["sim", "ball-grasp", "--to", "log:grasp.log", "--seconds", "4"];

fn read(dir: &TempDir, file: &str) -> Vec<u8> {
    std::fs::read(dir.path().join(file)).unwrap()
}

#[test]
fn traffic_comes_back_from_mcap_to_the_byte() {
    let dir = TempDir::new().unwrap();
    succeeds(&dir, &SCENE);
    // Frames of every kind, one before its time, and a name that no layout has.
    let odd = "(0000000004.000100) vcan9 1FFFFFFF#0102030405060708\n\
               (0000000004.000050) can0 123#R4\n\
               (0000000004.000200) can1 20000040#0000000000000000\n\
               (0000000004.000300) can1 7FF#\n";
    let path = dir.path().join("grasp.log");
    let log = [std::fs::read(&path).unwrap(), odd.into()].concat();
    std::fs::write(&path, &log).unwrap();
    let (_, err) = succeeds(&dir, &["convert", "grasp.log", "grasp.mcap"]);
    assert!(
        err.starts_with("grasp.mcap: ") && err.contains("CAN frames"),
        "{err}"
    );
    assert!(read(&dir, "grasp.mcap").len() * 2 < log.len());
    let (_, err) = succeeds(&dir, &["convert", "grasp.mcap", "again.log"]);
    assert!(!err.contains("taken along"), "{err}");
    let err = fails(&dir, &["convert", "grasp.mcap", "marks.csv", "--marks"], 1);
    assert!(
        err.contains("grasp.mcap: no tactile frames in it, from the first of which marks are counted"),
        "{err}"
    );
    assert!(read(&dir, "again.log") == log, "not the same traffic");
}

#[test]
fn what_is_no_traffic_stays_behind_and_is_counted() {
    let dir = TempDir::new().unwrap();
    for (name, has_can, left) in [
        ("hand.mcap", true, "1 mark and 30 frames"),
        ("frames.mcap", false, "1 mark"),
    ] {
        let path = dir.path().join(name);
        let mut writer =
            RecordingWriter::begin(File::create(&path).unwrap(), &Preamble::default(), 0).unwrap();
        let wall_ns = 1_000_000_000;
        put_hand(&mut writer, "uskin-module", wall_ns, 30);
        for kind in [EventKind::Mark, EventKind::Calibrated] {
            let (topic, data) = (Topic::Events, event_message(event_name(kind), "cup 3", wall_ns));
            writer.put(&Entry { topic, wall_ns, data }).unwrap();
        }
        if has_can {
            let frame = CanFrame::standard(0x710, &[0x80, 1, 2, 3, 4, 5, 6, 1]).unwrap();
            let mut block = CanBlock::default();
            assert!(block.push(0, &Received { t_ns: wall_ns, frame }));
            let (topic, data) = (Topic::Can, block.take(&["can0".to_owned()], &[0]));
            writer.put(&Entry { topic, wall_ns, data }).unwrap();
        }
        writer.finish().unwrap();
        for out in ["hand.log", "again.mcap"] {
            let (_, err) = succeeds(&dir, &["convert", name, out, "--layout", "uskin-module"]);
            let wanted = format!("{name}: not taken along: {left}; CAN traffic");
            assert!(err.contains(&wanted), "{err}");
        }
    }
}

#[test]
fn an_mcap_gives_the_images_of_the_log_bit_for_bit() {
    let dir = TempDir::new().unwrap();
    succeeds(&dir, &SCENE);
    succeeds(&dir, &["convert", "grasp.log", "grasp.mcap"]);
    for input in ["grasp.log", "grasp.mcap"] {
        let (_, err) = succeeds(&dir, &["compress", input, "--out", &format!("{input}.bin")]);
        assert!(err.contains("with contact"), "{err}");
        succeeds(
            &dir,
            &[
                "replay",
                input,
                "--to",
                &format!("log:{input}.replayed.log"),
                "--start",
                "1",
                "--end",
                "3",
            ],
        );
        let (out, _) = succeeds(
            &dir,
            &["eval", input, "--restarts", "1", "--passes", "1", "--json"],
        );
        std::fs::write(dir.path().join(format!("{input}.json")), out).unwrap();
    }
    for of in ["bin", "replayed.log"] {
        let [log, mcap] = ["log", "mcap"].map(|input| read(&dir, &format!("grasp.{input}.{of}")));
        assert!(!log.is_empty() && log == mcap, "not the same {of}");
    }
    // Times are measured anew; what they were measured on is the same.
    let [log, mcap] = ["log", "mcap"].map(|input| {
        let told: serde_json::Value =
            serde_json::from_slice(&read(&dir, &format!("grasp.{input}.json"))).unwrap();
        (
            told["frames"].clone(),
            told["contact_frames"].clone(),
            told["methods"][0]["force_sse_ratio_mean"].clone(),
        )
    });
    assert!(log.0.as_u64().unwrap() > 0 && log == mcap, "{log:?} {mcap:?}");
}

#[test]
fn buses_whose_frames_are_not_in_order_play_as_the_log_does() {
    let dir = TempDir::new().unwrap();
    succeeds(&dir, &SCENE);
    // Bus after bus within each tenth of a second, as a recorder would write that reads them one after the other.
    let log = String::from_utf8(read(&dir, "grasp.log")).unwrap();
    let key = |line: &str| {
        let (time, rest) = line.split_once(' ').unwrap();
        let seconds: f64 = time.trim_matches(['(', ')']).parse().unwrap();
        ((seconds * 10.0) as u64, rest.starts_with("can0"))
    };
    let mut lines: Vec<&str> = log.lines().collect();
    lines.sort_by_key(|line| key(line));
    std::fs::write(dir.path().join("shuffled.log"), lines.join("\n")).unwrap();
    succeeds(&dir, &["convert", "shuffled.log", "shuffled.mcap"]);
    for input in ["shuffled.log", "shuffled.mcap"] {
        succeeds(&dir, &["compress", input, "--out", &format!("{input}.bin")]);
    }
    assert!(
        read(&dir, "shuffled.log.bin") == read(&dir, "shuffled.mcap.bin"),
        "not the same images"
    );
}

#[test]
fn counts_come_out_as_npz_and_csv_and_are_read_again() {
    let dir = TempDir::new().unwrap();
    succeeds(&dir, &SCENE);
    succeeds(&dir, &["convert", "grasp.log", "grasp.mcap"]);
    let (_, err) = succeeds(&dir, &["convert", "grasp.mcap", "grasp.npz"]);
    assert!(
        err.contains("grasp.mcap: the hand is read off its CAN traffic every 33.3 ms, as a daemon does"),
        "{err}"
    );
    succeeds(&dir, &["convert", "grasp.log", "grasp.csv"]);
    let mut npz = NpzReader::new(File::open(dir.path().join("grasp.npz")).unwrap()).unwrap();
    let counts: Array3<u16> = npz.by_name("counts").unwrap();
    let times: Array1<u64> = npz.by_name("t_ns").unwrap();
    let csv = String::from_utf8(read(&dir, "grasp.csv")).unwrap();
    let frames = csv.lines().count() - 1;
    assert_eq!((counts.dim(), times.len()), ((frames, 240, 3), frames));
    let first: Vec<&str> = csv.lines().nth(1).unwrap().split(',').collect();
    assert_eq!(first[0], times[0].to_string());
    assert_eq!(first[1], counts[[0, 0, 0]].to_string());
    for input in ["grasp.npz", "grasp.csv"] {
        succeeds(&dir, &["compress", input, "--out", &format!("{input}.npy")]);
        let (_, err) = succeeds(&dir, &["convert", input, &format!("{input}.mcap")]);
        let told = format!(
            "its {frames} frames go as what boards send; who makes frames of that again samples it anew"
        );
        assert!(err.contains(&told), "{err}");
    }
    assert!(
        read(&dir, "grasp.npz.npy") == read(&dir, "grasp.csv.npy"),
        "not the same images"
    );
    succeeds(&dir, &["convert", "grasp.npz.mcap", "from_npz.log"]);
    succeeds(&dir, &["replay", "grasp.npz", "--to", "log:replayed.log"]);
    assert!(
        read(&dir, "from_npz.log") == read(&dir, "replayed.log"),
        "not the same traffic"
    );
}

#[test]
fn a_recording_that_was_torn_off_is_read_to_its_last_whole_chunk() {
    let dir = TempDir::new().unwrap();
    succeeds(&dir, &SCENE);
    succeeds(&dir, &["convert", "grasp.log", "grasp.mcap"]);
    let whole = read(&dir, "grasp.mcap");
    std::fs::write(dir.path().join("torn.mcap"), &whole[..whole.len() * 3 / 4]).unwrap();
    let (_, err) = succeeds(&dir, &["convert", "torn.mcap", "torn.log"]);
    assert!(err.contains("torn.mcap: torn off"), "{err}");
    let (torn, log) = (read(&dir, "torn.log"), read(&dir, "grasp.log"));
    assert!(!torn.is_empty() && torn.len() < log.len() && log.starts_with(&torn));
    let (_, err) = succeeds(&dir, &["compress", "torn.mcap", "--out", "torn.npy"]);
    assert!(
        err.contains("torn.mcap: torn off") && err.contains("images of 16x16"),
        "{err}"
    );
}

#[test]
fn damaged_bytes_cost_their_chunk_and_are_told() {
    let dir = TempDir::new().unwrap();
    succeeds(&dir, &SCENE);
    succeeds(&dir, &["convert", "grasp.log", "grasp.mcap"]);
    let mut damaged = read(&dir, "grasp.mcap");
    let middle = damaged.len() / 2;
    damaged[middle] ^= 1;
    std::fs::write(dir.path().join("damaged.mcap"), &damaged).unwrap();
    let (_, err) = succeeds(&dir, &["convert", "damaged.mcap", "damaged.log"]);
    assert!(
        err.contains("damaged.mcap: bytes ") && err.contains("are damaged"),
        "{err}"
    );
    let (_, err) = succeeds(&dir, &["replay", "damaged.mcap", "--to", "log:replayed.log"]);
    assert_eq!(err.matches("are damaged").count(), 1, "{err}");
    let [left, log] = ["damaged.log", "grasp.log"].map(|file| String::from_utf8(read(&dir, file)).unwrap());
    assert!(left.len() < log.len() && left.lines().last() == log.lines().last());
}

#[test]
fn a_recording_of_two_hands_is_read_as_the_first_of_them_and_says_how_to_read_the_other() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("hands.mcap");
    let mut writer = RecordingWriter::begin(File::create(&path).unwrap(), &Preamble::default(), 0).unwrap();
    put_hand(&mut writer, "allegro-uskin-15", 1_000_000_000, 30);
    put_hand(&mut writer, "uskin-module", 3_000_000_000, 20);
    writer.finish().unwrap();
    for out in ["hands.npz", "hands.csv"] {
        let (_, err) = succeeds(&dir, &["convert", "hands.mcap", out]);
        assert!(
            err.contains("hands.mcap: the daemon began anew after 30 frames"),
            "{err}"
        );
        assert!(err.contains("--start 3000000000"), "{err}");
        assert!(err.contains(&format!("{out}: 30 frames")), "{err}");
    }
}

#[test]
fn can_frames_of_two_hands_are_read_as_those_of_the_first() {
    let dir = TempDir::new().unwrap();
    succeeds(&dir, &["sim", "tap", "--to", "log:tap.log", "--seconds", "3"]);
    let path = dir.path().join("hands.mcap");
    let mut writer = RecordingWriter::begin(File::create(&path).unwrap(), &Preamble::default(), 0).unwrap();
    let names = ["can0".to_owned(), "can1".to_owned()];
    for (layout, from_ns) in [
        ("allegro-uskin-15", 1_000_000_000),
        ("uskin-module", 9_000_000_000),
    ] {
        put_hand(&mut writer, layout, from_ns, 1);
        let log = BufReader::new(File::open(dir.path().join("tap.log")).unwrap());
        let mut block = CanBlock::default();
        let mut put = |block: &mut CanBlock| {
            let (topic, wall_ns) = (Topic::Can, block.start_ns());
            let data = block.take(&names, &[0, 0]);
            writer.put(&Entry { topic, wall_ns, data }).unwrap();
        };
        for line in LogReader::new(log).map(Result::unwrap) {
            let bus = u8::from(*line.interface == *names[1]);
            let received = Received {
                t_ns: from_ns + line.t_ns,
                frame: line.frame,
            };
            if !block.push(bus, &received) {
                put(&mut block);
                assert!(block.push(bus, &received));
            }
        }
        put(&mut block);
    }
    writer.finish().unwrap();
    succeeds(&dir, &["compress", "tap.log", "--out", "tap.bin"]);
    let (_, err) = succeeds(&dir, &["compress", "hands.mcap", "--out", "hands.bin"]);
    assert!(
        err.contains("hands.mcap: the daemon began anew with another hand, uskin-module; read up to there")
            && err.contains("--start 9000000000"),
        "{err}"
    );
    assert!(
        read(&dir, "hands.bin") == read(&dir, "tap.bin"),
        "not the first hand"
    );
    // As traffic it is what it is.
    succeeds(&dir, &["convert", "hands.mcap", "hands.log"]);
    let lines = |file: &str| read(&dir, file).iter().filter(|byte| **byte == b'\n').count();
    assert_eq!(lines("hands.log"), 2 * lines("tap.log"));
}

#[test]
fn a_log_of_hundreds_of_interfaces_is_told_by_the_first_of_them() {
    let dir = TempDir::new().unwrap();
    let line = |n: usize| format!("({n}.000000) v{n} 300#0102030405060708\n");
    std::fs::write(
        dir.path().join("many.log"),
        (0..300).map(line).collect::<String>(),
    )
    .unwrap();
    let error = fails(&dir, &["compress", "many.log", "--out", "many.npz"], 1);
    assert!(
        error.contains("v11 and 288 more") && error.contains("--interface v0=can0"),
        "{error}"
    );
}

#[test]
fn what_cannot_be_converted_or_recorded_is_refused_with_what_to_do() {
    let dir = TempDir::new().unwrap();
    std::fs::write(dir.path().join("no.mcap"), "(1.0) can0 001#\n").unwrap();
    std::fs::write(dir.path().join("a.log"), "(1.0) can0 001#\n").unwrap();
    std::fs::write(dir.path().join("there.mcap"), "").unwrap();
    for (args, wanted) in [
        (&["convert", "no.mcap", "b.log"][..], "no.mcap: no MCAP file"),
        (&["convert", "a.log", "a.log"], "overwrite the input"),
        (
            &["convert", "sim:tap", "tap.mcap"],
            "`taxel sim tap --to log:tap.log`",
        ),
        (
            &["convert", "a.log", "a.npz"],
            "a.log: no reading can be had of it: 1 frame",
        ),
        (
            &["record", "a.mcap", "--socket", "none.sock"],
            "--can SOURCE names them, --no-can leaves them out",
        ),
        (
            &["record", "there.mcap", "--socket", "none.sock", "--no-can"],
            "a recording is not overwritten",
        ),
    ] {
        let err = fails(&dir, args, 1);
        assert!(err.contains(wanted), "taxel {args:?}: {err}");
    }
    for (args, wanted) in [
        (
            &["convert", "a.log", "a.blf"][..],
            "a.blf: a recording is written as .log, .mcap, .npz, .csv or .parquet",
        ),
        (
            &["record", "a.mcap", "--no-daemon", "--can", "log:a.log"],
            "is no bus",
        ),
        (
            &[
                "record",
                "a.mcap",
                "--no-daemon",
                "--can=left=can:a",
                "--can=left=can:b",
            ],
            "--can left=can:b: another bus is called left",
        ),
    ] {
        let err = fails(&dir, args, 2);
        assert!(err.contains(wanted), "taxel {args:?}: {err}");
    }
}
