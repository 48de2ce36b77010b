//! The bytes of a model: it comes back from them, and nothing else does.

use super::{model, squeeze};
use taxel_forearm::{Estimator, Model};

#[test]
fn a_model_comes_back_from_its_bytes_and_nothing_else_is_one() {
    let model = model();
    let bytes = model.to_bytes();
    let back = Model::from_bytes(&bytes).unwrap();
    let whole = squeeze(37.0, 0.0);
    let (one, other) = (model.estimate(&whole).unwrap(), back.estimate(&whole).unwrap());
    assert!((one.percent - other.percent).abs() < 1e-9);
    assert_eq!(back.trained_on.squeezes, 78);
    let text = String::from_utf8(bytes).unwrap();
    let refused = |text: &str, words: &str| {
        let error = Model::from_bytes(text.as_bytes()).unwrap_err().to_string();
        assert!(
            error.contains("no model as `taxel forearm train` writes it") && error.contains(words),
            "{error}"
        );
    };
    refused(
        &text.replacen("\"version\":6", "\"version\":5", 1),
        "of version 5, and 6 is read; train it again",
    );
    refused(
        &text.replacen("forearm model", "palm model", 1),
        "taxel palm model",
    );
    refused(
        &text.replacen("\"offset\":", "\"offset\":1", 1),
        "its checksum is wrong",
    );
    refused(&text[..text.len() / 2], "its checksum is wrong");
    // Every line is summed up.
    for (from, to) in [
        ("\"angles\":\"degrees\"", "\"angles\":\"radians\""),
        ("\"squeezes\":78", "\"squeezes\":13"),
        ("100.0],", "50.0],"),
    ] {
        assert!(text.contains(from), "{from}");
        refused(&text.replacen(from, to, 1), "its checksum is wrong");
    }
    refused("{}", "one line");
    refused("{}\n", "its first line");
}

#[test]
fn a_model_with_no_interval_or_lines_out_of_order_is_none() {
    let text = String::from_utf8(model().to_bytes()).unwrap();
    let (lines, _) = text.trim_end().rsplit_once('\n').unwrap();
    let width = lines.split("\"half_width_90\":").nth(1).unwrap();
    let width = width.split('}').next().unwrap();
    for (from, to) in [
        (format!("\"half_width_90\":{width}"), "\"half_width_90\":-5.0"),
        ("\"last\":0,".into(), "\"last\":7,"),
        ("\"last\":47,".into(), "\"last\":999,"),
    ] {
        assert!(lines.contains(&from), "{from}");
        let edited = lines.replacen(&from, to, 1) + "\n";
        let checksum = crc32fast::hash(edited.as_bytes());
        let edited = format!("{edited}{{\"checksum\":{checksum}}}\n");
        let error = Model::from_bytes(edited.as_bytes()).unwrap_err().to_string();
        assert!(error.contains("its parts do not fit each other"), "{to}: {error}");
    }
}
