//! Commands that messages tell people to type.

use crate::{fails, succeeds, words};
use ndarray::Array2;
use ndarray_npy::write_npy;
use taxel_recorder::{Entry, Preamble, RecordingWriter, Topic};
use tempfile::TempDir;

#[test]
fn paths_in_commands_are_quoted_where_a_shell_would_take_them_apart() {
    let dir = TempDir::new().unwrap();
    let path = |name: &str| dir.path().join(name);
    std::fs::write(path("my log.log"), "(1.0) can0 7FF#00\n").unwrap();
    let table = "timestamp,arbitration_id,extended,remote,error,dlc,data\n0,0x1,0,0,0,1,AA==\n";
    std::fs::write(path("my log.csv"), table).unwrap();
    std::fs::write(path("a (2).log"), "(1.0) can0 7FF#00\n").unwrap();
    for name in ["my log.trc", "it's.blf", "my log.csv.gz", "my log.txt"] {
        std::fs::write(path(name), "").unwrap();
    }
    let entry = |topic| Entry {
        topic,
        wall_ns: 1,
        data: Vec::new(),
    };
    let file = std::fs::File::create(path("my bag.mcap")).unwrap();
    let mut writer = RecordingWriter::begin(file, &Preamble::default(), 0).unwrap();
    writer.put(&entry(Topic::Hello)).unwrap();
    writer.finish().unwrap();
    let cases: [(&[&str], &str); 9] = [
        (
            &["compress", "my log.log", "--out", "o.npz"],
            "`taxel doctor --scan 'log:my log.log'`",
        ),
        (
            &["compress", "my log.trc", "--out", "o.npz"],
            "`can_logconvert 'my log.trc' 'my log.log'`",
        ),
        (
            &["compress", "it's.blf", "--out", "o.npz"],
            r"`can_logconvert 'it'\''s.blf' 'it'\''s.log'`",
        ),
        (
            &["compress", "my log.csv.gz", "--out", "o.npz"],
            "`zcat 'my log.csv.gz' | taxel COMMAND -`",
        ),
        (
            &["compress", "my log.txt", "--out", "o.npz"],
            "`taxel COMMAND - < 'my log.txt'`",
        ),
        (
            &["compress", "my log.csv", "--out", "o.npz"],
            "`can_logconvert 'my log.csv' 'my log.log'`",
        ),
        (
            &["categorize", "a (2).log", "--classes", "2"],
            "`taxel convert 'a (2).log' 'a (2).npz'`",
        ),
        (
            &["convert", "sim:tap", "my tap.mcap"],
            "`taxel sim tap --to 'log:my tap.log'`",
        ),
        (
            &["doctor", "--scan", "log:my bag.mcap"],
            "`taxel convert 'my bag.mcap' 'my bag.log'`",
        ),
    ];
    for (args, command) in cases {
        let err = fails(&dir, args, 1);
        assert!(err.contains(command), "{args:?}: {err}");
    }
}

#[test]
fn one_thing_is_not_told_in_the_plural() {
    let dir = TempDir::new().unwrap();
    write_npy(dir.path().join("one.npy"), &Array2::from_elem((1, 4), 9.0)).unwrap();
    let args = ["compress", "one.npy", "--layout", "grid:2x2", "--out", "o.npz"];
    let (_, err) = succeeds(&dir, &args);
    assert!(err.contains("o.npz: 1 image of 2x2, 1 with contact"), "{err}");
    let (out, _) = succeeds(
        &dir,
        &words("view one.npy --layout grid:2x2 --levels 1 --actuators 1"),
    );
    assert!(
        out.contains("4 taxels; method optimal, 1 level, 1 actuator\n"),
        "{out}"
    );
}
