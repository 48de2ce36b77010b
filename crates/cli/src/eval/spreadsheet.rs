//! Reports for spreadsheets.

use serde_json::Value;
use taxel_eval::EvalReport;

/// A header, then one line per report and method.
pub(super) fn csv<'a>(reports: impl Iterator<Item = &'a EvalReport>) -> anyhow::Result<String> {
    let mut text = String::new();
    for report in reports {
        let mut of_report = Vec::new();
        for (key, value) in serde_json::to_value(report)?.as_object().into_iter().flatten() {
            // Not every report has a truth, and a table needs the same columns throughout.
            if key != "methods" && key != "contact_truth" {
                flatten(key, value, &mut of_report);
            }
        }
        for method in &report.methods {
            let mut cells = of_report.clone();
            flatten("", &serde_json::to_value(method)?, &mut cells);
            if text.is_empty() {
                let keys: Vec<&str> = cells.iter().map(|(key, _)| key.as_str()).collect();
                text += &(keys.join(",") + "\n");
            }
            let values: Vec<String> = cells.into_iter().map(|(_, value)| value).collect();
            text += &(values.join(",") + "\n");
        }
    }
    Ok(text)
}

/// Appends the leaves of a value with their paths.
fn flatten(key: &str, value: &Value, cells: &mut Vec<(String, String)>) {
    match value {
        Value::Object(fields) => {
            for (inner, value) in fields {
                let path = if key.is_empty() {
                    inner.clone()
                } else {
                    format!("{key}_{inner}")
                };
                flatten(&path, value, cells);
            }
        }
        Value::String(text) => cells.push((key.into(), format!("\"{}\"", text.replace('"', "\"\"")))),
        Value::Null => cells.push((key.into(), String::new())),
        other => cells.push((key.into(), other.to_string())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn leaves_are_named_by_their_paths_and_text_is_quoted() {
        let value = serde_json::json!({"name": "a \"b\", c", "times": {"p50": 1.5}, "none": null});
        let mut cells = Vec::new();
        flatten("", &value, &mut cells);
        cells.sort();
        let want = [("name", "\"a \"\"b\"\", c\""), ("none", ""), ("times_p50", "1.5")];
        assert_eq!(cells, want.map(|(k, v)| (k.to_string(), v.to_string())));
    }
}
