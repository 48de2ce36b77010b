//! The line of a manifest that names its columns.

use anyhow::bail;
use std::fs::File;
use std::io::Read;
use std::path::Path;
use taxel_hand::did_you_mean;
use taxel_record::FileKind;

/// What the columns of a manifest may be.
const COLUMNS: [&str; 8] = [
    "file", "label", "area", "time", "phantom", "motion", "depth", "radius",
];

/// Bytes in which the line that names the columns is looked for: a recording may be large.
const HEAD: u64 = 1 << 16;

/// Whether a file is a .csv whose first line names a column `file`.
///
/// # Errors
/// Where the first line is one of a manifest already, for want of the names.
pub(crate) fn is_manifest(path: &Path) -> anyhow::Result<bool> {
    let is_csv = FileKind::of(path) == Some(FileKind::Csv);
    match first_lines(path).ok().filter(|_| is_csv) {
        Some(head) => names_files(path, &head),
        None => Ok(false),
    }
}

fn is_recording(name: &&String) -> bool {
    name.starts_with("sim:") || name.contains(".npz:") || FileKind::of(Path::new(name)).is_some()
}

/// Whether one of its columns is called `file`.
///
/// # Errors
/// As [`is_manifest`].
pub(super) fn names_files(path: &Path, head: &Head) -> anyhow::Result<bool> {
    let Head { names, second, .. } = head;
    if let Some(file) = names.iter().find(is_recording) {
        bail!(
            "{}: its first line names the recording {file:?}; a manifest begins with the names of its columns, such \
             as file,label",
            path.display()
        );
    }
    let has_files = names.iter().any(|name| name == "file");
    match second.iter().find(is_recording) {
        Some(file) if !has_files => bail!(
            "{}: it names the recording {file:?} in a column that is not called file; a manifest may have the columns {}",
            path.display(),
            COLUMNS.join(", ")
        ),
        _ => Ok(has_files),
    }
}

/// The cells of the line that names the columns and of the next, and what separates them.
pub(super) struct Head {
    names: Vec<String>,
    second: Vec<String>,
    pub(super) delimiter: u8,
}

pub(super) fn first_lines(path: &Path) -> anyhow::Result<Head> {
    let mut head = Vec::new();
    File::open(path)?.take(HEAD).read_to_end(&mut head)?;
    let text = String::from_utf8_lossy(&head);
    let lines = text.trim_start_matches('\u{feff}').lines();
    let mut lines = lines.filter(|line| !line.is_empty() && !line.starts_with('#'));
    let line = lines.next().unwrap_or_default();
    let delimiter = b";,\t".iter().find(|byte| line.as_bytes().contains(byte));
    let delimiter = *delimiter.unwrap_or(&b',');
    let mut reader = csv::ReaderBuilder::new();
    reader
        .trim(csv::Trim::All)
        .has_headers(false)
        .delimiter(delimiter);
    let cells = |line: &str| -> anyhow::Result<Vec<String>> {
        let mut records = reader.from_reader(line.as_bytes()).into_records();
        let cells = records.next().transpose()?.unwrap_or_default();
        Ok(cells.iter().map(str::to_owned).collect())
    };
    Ok(Head {
        names: cells(line)?,
        second: cells(lines.next().unwrap_or_default())?,
        delimiter,
    })
}

/// Refuses a column that no manifest has.
pub(super) fn refuse_unknown_columns(path: &Path, head: &Head) -> anyhow::Result<()> {
    if let Some(other) = head.names.iter().find(|name| !COLUMNS.contains(&name.as_str())) {
        let meant = match other.as_str() {
            "class" => "; did you mean `label`?".into(),
            _ => did_you_mean(other, COLUMNS),
        };
        let may_have = if meant.is_empty() {
            "; a manifest"
        } else {
            " A manifest"
        };
        bail!(
            "{}: unknown column `{other}`{meant}{may_have} may have the columns {}",
            path.display(),
            COLUMNS.join(", ")
        );
    }
    Ok(())
}
