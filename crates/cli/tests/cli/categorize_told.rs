//! What `taxel categorize` says of touches that are none, or are there twice, and of manifests of which it takes a part.

use crate::categorize::recorded;
use crate::{fails, succeeds};
use serde_json::Value;

#[test]
fn contact_leaves_out_touches_that_the_recording_begins_or_ends_in() {
    let dir = recorded();
    let frames = std::fs::read_to_string(dir.path().join("frames.csv")).unwrap();
    let lines: Vec<&str> = frames.lines().collect();
    let args = [
        "categorize",
        "cut.csv",
        "--contact",
        "5",
        "--classes",
        "2",
        "--json",
    ];
    let first = "the touch that is in contact in the first frame is left out (7 frames)";
    let last = "the touch that is in contact in the last frame is left out (7 frames)";
    let short = "1 contact shorter than 5 frames is left out; --least N";
    let brushed = "0,0\n".repeat(5) + "9,9\n9,9\n" + &"0,0\n".repeat(5);
    // Each touch is 13 frames behind five still ones.
    for (kept, behind, touches, wanted) in [
        (0..113, "", 6, &[][..]),
        (11..113, "", 5, &[first]),
        (0..102, "", 5, &[last]),
        (11..102, "", 4, &[first, last]),
        (0..113, &*brushed, 6, &[short]),
    ] {
        let text = lines[kept.clone()].join("\n") + "\n" + behind;
        std::fs::write(dir.path().join("cut.csv"), text).unwrap();
        let (out, err) = succeeds(&dir, &args);
        let report: Value = serde_json::from_str(&out).unwrap();
        assert_eq!(report["touches"], touches, "{kept:?}: {err}");
        // Those that are left are whole.
        assert_eq!(report["features"], 26, "{kept:?}: {err}");
        for said in [first, last, short] {
            assert_eq!(err.contains(said), wanted.contains(&said), "{kept:?}: {err}");
        }
    }
    std::fs::write(dir.path().join("cut.csv"), lines[11..16].join("\n")).unwrap();
    let err = fails(&dir, &args, 1);
    assert!(
        err.contains("from the first frame to the last") && err.contains("there is no touch"),
        "{err}"
    );
}
