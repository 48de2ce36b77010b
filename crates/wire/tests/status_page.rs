//! `docs/status.md` is what the comments in the code say of each key of the status.
//!
//! `TAXEL_UPDATE=1 cargo test -p taxel-wire --test status_page` writes it anew.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use taxel_wire::Status;

/// A report as its macro has it.
#[derive(Debug, Default)]
struct Report {
    about: String,
    keys: Vec<Key>,
}

#[derive(Debug)]
struct Key {
    name: String,
    of: String,
    about: String,
    /// Its keys stand beside it.
    is_flat: bool,
}

/// The reports of a source by their names.
fn read(source: &str, reports: &mut BTreeMap<String, Report>) {
    let (mut about, mut is_flat, mut report) = (String::new(), false, None);
    for line in source.lines().map(str::trim) {
        if let Some(text) = line.strip_prefix("/// ") {
            about = format!("{about} {text}").trim().to_owned();
        } else if line.starts_with("#[") {
            is_flat |= line == "#[serde(flatten)]";
        } else if let (None, Some(name)) = (&report, line.strip_suffix(" {")) {
            if name.starts_with(char::is_uppercase) && !name.contains(' ') {
                reports.entry(name.into()).or_default().about = std::mem::take(&mut about);
                report = Some(name.to_owned());
            }
        } else if let (Some(report), Some((name, of))) = (&report, line.split_once(": ")) {
            reports.entry(report.clone()).or_default().keys.push(Key {
                name: name.into(),
                of: of.trim_end_matches(',').into(),
                about: std::mem::take(&mut about),
                is_flat: std::mem::take(&mut is_flat),
            });
        } else {
            about.clear();
            report = None;
        }
    }
}

/// The reports from one on, each with where it stands in the status, in the order in which they come.
fn walk(reports: &BTreeMap<String, Report>, name: &str, path: &str, places: &mut Vec<(String, Vec<String>)>) {
    match places.iter_mut().find(|(known, _)| known == name) {
        Some((_, paths)) => paths.push(path.into()),
        None => places.push((name.into(), vec![path.into()])),
    }
    for key in &reports[name].keys {
        let below = key.of.trim_start_matches(|c| c != '<').trim_matches(['<', '>']);
        let of = if below.is_empty() { &key.of } else { below };
        if reports.contains_key(of) {
            let list = if key.of.starts_with("Vec<") { "[]" } else { "" };
            let dot = if path.is_empty() { "" } else { "." };
            let place = match key.is_flat {
                true => path.into(),
                false => format!("{path}{dot}{}{list}", key.name),
            };
            walk(reports, of, &place, places);
        }
    }
}

#[test]
fn the_page_is_what_the_code_says() {
    let mut reports = BTreeMap::new();
    for source in [
        include_str!("../src/status/mod.rs"),
        include_str!("../src/status/buses.rs"),
        include_str!("../src/status/images.rs"),
        include_str!("../src/status/joints.rs"),
        include_str!("../src/status/conditioning.rs"),
    ] {
        let (_, source) = source.split_once("report! {\n").unwrap();
        read(source, &mut reports);
    }
    let sent = serde_json::to_value(Status::default()).unwrap();
    let sent: Vec<&String> = sent.as_object().unwrap().keys().collect();
    let mut known: Vec<&String> = reports["Status"].keys.iter().map(|key| &key.name).collect();
    known.sort_unstable();
    assert_eq!(known, sent);

    let mut places = Vec::new();
    walk(&reports, "Status", "", &mut places);
    assert_eq!(places.len(), reports.len());
    let mut page = String::from(include_str!("status_page.md"));
    for (name, paths) in &places {
        let report = &reports[name];
        let title = match paths[0].as_str() {
            "" => "All of it".into(),
            _ => format!("`{}`", paths.join("`, `")),
        };
        // What stands beside the keys of another is told from them by what it is.
        let title = match page.contains(&format!("\n## {title}\n")) {
            true => format!(
                "{title}, {}",
                report.about.trim_end_matches('.').replacen("What", "what", 1)
            ),
            false => title,
        };
        let _ = write!(
            page,
            "\n## {title}\n\n{}\n\n| key | meaning |\n|---|---|\n",
            report.about
        );
        for key in report.keys.iter().filter(|key| !key.is_flat) {
            assert!(!key.about.is_empty(), "{name}.{}", key.name);
            let _ = writeln!(page, "| `{}` | {} |", key.name, key.about.replace('|', "\\|"));
        }
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/status.md");
    if std::env::var_os("TAXEL_UPDATE").is_some() {
        std::fs::write(&path, &page).unwrap();
    }
    let written = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        written == page,
        "docs/status.md is not what the code says; TAXEL_UPDATE=1 writes it anew"
    );
}
