//! Options that say nothing about the input: refused, and not passed over.

use crate::eval_task::objects;
use crate::{fails, succeeds};
use tempfile::TempDir;

#[test]
fn an_option_that_says_nothing_about_the_input_is_refused() {
    let dir = TempDir::new().unwrap();
    succeeds(&dir, &["sim", "tap", "--to", "log:tap.log", "--seconds", "1"]);
    objects(&dir.path().join("lab.npz"));
    for (code, words, option) in [
        (1, "eval sim:tap --threshold 10", "--threshold"),
        (1, "eval sim:tap --release 5", "--release"),
        (1, "eval sim:tap --interface can0=can1", "--interface"),
        (1, "eval lab.npz --task --release 0.1", "--release"),
        (1, "eval lab.npz --task --conditioning paper", "--conditioning"),
        (1, "eval lab.npz --task --interface a=b", "--interface"),
        (
            1,
            "categorize sim:phantom-1 --classes 3 --contact 50",
            "--contact",
        ),
        (
            1,
            "categorize sim:phantom-1 --classes 3 --marks none.csv",
            "--marks",
        ),
        (1, "categorize sim:phantom-1 --classes 3 --until x", "--until"),
        (1, "categorize sim:phantom-1 --classes 3 --array x", "--array"),
        (2, "categorize sim:phantom-1 --classes 3 --step inf", "is no step"),
        (
            2,
            "categorize sim:phantom-1 --classes 3 --step 1e-300",
            "is no step",
        ),
        (1, "convert tap.log o.mcap --threshold 10", "--threshold"),
        (1, "convert tap.log o.mcap --release 5", "--release"),
        (1, "convert tap.log o.mcap --conditioning paper", "--conditioning"),
        (1, "convert tap.log o.mcap --levels 3", "--levels"),
        (1, "convert tap.log o.npz --actuators 3", "--actuators"),
        (2, "sim tap --to log:o.log --place 40", "--place"),
    ] {
        let error = fails(&dir, &words.split(' ').collect::<Vec<_>>(), code);
        assert!(error.contains(option), "{words}: {error}");
    }
    for made in ["o.mcap", "o.npz", "o.log"] {
        assert!(!dir.path().join(made).exists(), "{made}");
    }
}
