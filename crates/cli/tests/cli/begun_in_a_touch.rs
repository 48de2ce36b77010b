//! Recordings that begin in a touch, as parts of a split one do, and those around a trigger.

use crate::{fails, succeeds};
use ndarray::Array1;
use ndarray_npy::NpzReader;
use std::fs::File;
use std::ops::Range;
use taxel_hand::{ForceFrame, Freshness, Profile, TactileFrame};
use taxel_recorder::{Entry, Preamble, RecordingWriter, Topic, frame_message, text_message};
use taxel_skin::Layout;
use taxel_wire::{Clock, Header, Hello, HelloRate, RawView, encode_raw_payload};
use tempfile::TempDir;

/// Two seconds of a module of which three taxels are pressed all the time, as a daemon felt them that was started before.
fn record(dir: &TempDir, has_baselines: bool) {
    record_frames(dir, "part.mcap", 0..200, has_baselines);
}

/// These of its frames, 10 ms each.
pub(crate) fn record_frames(dir: &TempDir, name: &str, frames: Range<u64>, has_baselines: bool) {
    let layout = Layout::builtin("uskin-module").unwrap();
    let file = File::create(dir.path().join(name)).unwrap();
    let mut writer = RecordingWriter::begin(file, &Preamble::default(), 0).unwrap();
    let mut put = |topic, wall_ns, data| writer.put(&Entry { topic, wall_ns, data }).unwrap();
    let (mode, hz) = ("sweep".into(), None);
    let rate = HelloRate { mode, hz };
    let hello = Hello::new(
        "taxeld",
        &layout.geometry,
        &Profile::default(),
        rate,
        Clock::Monotonic,
    );
    let hello = String::from_utf8(hello.to_json()).unwrap();
    put(Topic::Hello, 1_000_000_000, text_message(&hello));
    let (mut tactile, mut force) = (TactileFrame::new(16), ForceFrame::new(16));
    tactile.age_ns.fill(0);
    tactile.freshness.fill(Freshness::Fresh);
    force.threshold = 150.0;
    let baselines = [[30_000.0, 30_000.5, 9_000.0]; 16];
    let mut payload = Vec::new();
    for n in frames {
        let t_ns = 1_000_000_000 + n * 10_000_000;
        (tactile.seq, tactile.t_ns) = (n, t_ns);
        for taxel in 0..16 {
            let is_pressed = taxel % 5 == 1;
            let press = if is_pressed { 900 } else { 0 };
            tactile.counts[taxel] = [30_000 + (n % 2) as u16, 30_000, 9_000 + press];
            (force.contact[taxel], force.force[taxel]) = (is_pressed, f64::from(press));
        }
        let baselines = has_baselines.then_some(&baselines[..]);
        encode_raw_payload(&tactile, &force, baselines, &mut payload).unwrap();
        let header = Header {
            t_ns,
            ..Header::of_frame(&tactile, &force, payload.len())
        };
        put(
            Topic::Frames,
            t_ns,
            frame_message(&header, &RawView::decode(&payload).unwrap()),
        );
    }
    writer.finish().unwrap();
}

fn contacts(dir: &TempDir, input: &str, options: &[&str]) -> (Vec<u16>, String) {
    let command = ["compress", input, "--out", "images.npz"];
    let (_, err) = succeeds(dir, &[&command[..], options].concat());
    let mut images = NpzReader::new(File::open(dir.path().join("images.npz")).unwrap()).unwrap();
    let contacts: Array1<u16> = images.by_name("contacts").unwrap();
    (contacts.to_vec(), err)
}

#[test]
fn images_made_anew_go_on_from_what_the_daemon_had_calibrated() {
    let dir = TempDir::new().unwrap();
    record(&dir, true);
    let (contacts, err) = contacts(&dir, "part.mcap", &[]);
    assert_eq!(contacts, [3; 200]);
    assert!(!err.contains("untouched"), "{err}");
}

#[test]
fn where_they_are_calibrated_anew_in_a_touch_it_is_said() {
    let dir = TempDir::new().unwrap();
    // The paper's forces are squared: the recorded threshold is none of theirs.
    for (has_baselines, options) in [(false, &[][..]), (true, &["--conditioning", "paper"])] {
        record(&dir, has_baselines);
        let (_, err) = contacts(&dir, "part.mcap", options);
        let wanted = "taxel: part.mcap: its first 1500 ms are taken for an untouched hand, but 3 taxels were in contact;";
        assert!(err.contains(wanted), "{options:?}: {err}");
    }
}

#[test]
fn the_parts_of_a_recording_are_read_as_one_by_the_name_that_they_were_recorded_with() {
    let dir = TempDir::new().unwrap();
    for (number, first) in (0..4).zip((0..200).step_by(50)) {
        record_frames(
            &dir,
            &format!("day-{:04}.mcap", number + 1),
            first..first + 50,
            true,
        );
    }
    let (contacts, err) = contacts(&dir, "day.mcap", &[]);
    assert_eq!(contacts, [3; 200]);
    assert!(
        err.contains("taxel: day.mcap: read of its parts, day-0001.mcap to day-0004.mcap"),
        "{err}"
    );
    succeeds(&dir, &["convert", "day.mcap", "day.npz"]);
    let mut frames = NpzReader::new(File::open(dir.path().join("day.npz")).unwrap()).unwrap();
    let times: Array1<u64> = frames.by_name("t_ns").unwrap();
    assert_eq!(
        times.to_vec(),
        (0..200).map(|n| n * 10_000_000).collect::<Vec<_>>()
    );
    let part = dir.path().join("day-0002.mcap");
    let whole = std::fs::read(&part).unwrap();
    std::fs::write(&part, &whole[..whole.len() / 2]).unwrap();
    let (_, err) = succeeds(&dir, &["convert", "day.mcap", "torn.npz"]);
    assert!(err.contains("taxel: day.mcap: day-0002.mcap: torn off"), "{err}");
    let err = fails(&dir, &["convert", "day.mcap", "day-0003.mcap"], 1);
    assert!(
        err.contains("the output would overwrite the input day-0003.mcap"),
        "{err}"
    );
}
