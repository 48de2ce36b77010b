//! Touches that a manifest names.

mod head;
mod job;
mod row;

use super::labels;
use crate::recordings::own_clock::instant_ns;
use anyhow::{Context, anyhow, ensure};
use csv::StringRecord;
use head::{first_lines, names_files, refuse_unknown_columns};
use row::Row;
use std::collections::{HashMap, HashSet};
use std::path::Path;
use taxel_hand::plural;
use taxel_record::ReadOptions;
use taxel_sequence::Motion;

pub(crate) use head::is_manifest;
pub(crate) use job::Job;

/// What a manifest names, in its order.
pub(crate) fn read_manifest(path: &Path, options: &ReadOptions) -> anyhow::Result<Vec<Job>> {
    let head = first_lines(path).with_context(|| path.display().to_string())?;
    ensure!(
        names_files(path, &head)?,
        "{}: a manifest has a column called file",
        path.display()
    );
    refuse_unknown_columns(path, &head)?;
    let text = std::fs::read(path).with_context(|| path.display().to_string())?;
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .delimiter(head.delimiter)
        .from_reader(text.as_slice());
    let headers = reader
        .headers()
        .with_context(|| path.display().to_string())?
        .clone();
    let mut jobs: Vec<Job> = Vec::new();
    for record in reader.records() {
        let record = record.with_context(|| path.display().to_string())?;
        let from = record.position().map_or(0, csv::Position::byte);
        let line = line_at(&text, from as usize);
        let at = || format!("{}:{line}", path.display());
        let record = match head.delimiter {
            b',' => record,
            _ => with_points(&record, &headers),
        };
        let row: Row = record.deserialize(Some(&headers)).map_err(|error| {
            let no_number = match error.kind() {
                csv::ErrorKind::Deserialize { err, .. } => err.field(),
                _ => None,
            };
            match no_number.and_then(|n| Some((headers.get(n as usize)?, record.get(n as usize)?))) {
                Some((column, cell)) => anyhow!("{}: {column} {cell:?} is not a number", at()),
                None => anyhow!("{}: {error}", at()),
            }
        })?;
        let motion = row.motion().with_context(at)?;
        let same = jobs.iter_mut().find(|job| {
            let of = &job.rows[0].1;
            job.motion == motion && of.phantom == row.phantom && !of.file.starts_with("sim:")
        });
        match same.filter(|_| !row.file.starts_with("sim:")) {
            Some(job) => job.rows.push((line, row)),
            None => jobs.push(Job {
                manifest: path.into(),
                motion,
                options: options.clone(),
                rows: vec![(line, row)],
            }),
        }
    }
    ensure!(!jobs.is_empty(), "{}: no touch in it", path.display());
    find_longest(&mut jobs);
    find_next(&mut jobs);
    let labels = jobs.iter().flat_map(|job| &job.rows).map(|(_, row)| &row.label);
    for told in labels::alike(labels).into_iter().chain(same_frames(&jobs)) {
        remark!("taxel: {}: {told}", path.display());
    }
    Ok(jobs)
}

/// The line of the record that is read from a byte on, counted from 1: the end of the line before may stand there still, and
/// empty lines and comments.
fn line_at(text: &[u8], from: usize) -> u64 {
    let (before, mut rest) = text.split_at(from.min(text.len()));
    let is_end = |byte: &&u8| **byte == b'\n';
    let mut line = 1 + before.iter().filter(is_end).count();
    while let [b'\n' | b'\r' | b'#', ..] = rest {
        let Some(end) = rest.iter().position(|byte| *byte == b'\n') else {
            break;
        };
        line += 1;
        rest = &rest[end + 1..];
    }
    line as u64
}

/// That touches of one phantom and motion are the same frames, where any are: the first two of them, and how many more.
fn same_frames(jobs: &[Job]) -> Option<String> {
    let mut pairs = Vec::new();
    for job in jobs {
        let mut seen: HashMap<(&str, u64), usize> = HashMap::new();
        for (touch, (_, row)) in job.rows.iter().enumerate() {
            let frames = (row.file.as_str(), instant_ns(row.time.unwrap_or(0.0)));
            let first = *seen.entry(frames).or_insert(touch);
            if first != touch {
                pairs.push((job, first, touch));
            }
        }
    }
    let (job, first, second) = *pairs.first()?;
    let file = &job.rows[first].1.file;
    let more = match pairs.len() - 1 {
        0 => String::new(),
        more => format!(", and so are {}", plural(more, "more pair")),
    };
    Some(format!(
        "touches {first} and {second} (from 0) are the same frames of {file}{more}; where touches are in one file, the column \
         time says where each begins"
    ))
}

/// How the touches of one of several jobs are chosen.
pub(crate) fn what_chooses(jobs: &[Job]) -> String {
    let phantoms: HashSet<&str> = jobs.iter().map(Job::phantom).collect();
    let mut motions: Vec<Motion> = Vec::new();
    for motion in jobs.iter().filter_map(|job| job.motion) {
        if !motions.contains(&motion) {
            motions.push(motion);
        }
    }
    let has_all_depths = jobs.iter().all(|job| job.motion.is_some());
    let mut kinds = Vec::new();
    let mut ways = Vec::new();
    if phantoms.len() > 1 {
        kinds.push(plural(phantoms.len(), "phantom"));
        ways.push("keep the lines of one phantom in a manifest of its own");
    }
    if motions.len() > 1 {
        kinds.push(plural(motions.len(), "motion"));
        ways.push("--depth and --radius choose a motion");
    }
    if !has_all_depths && !motions.is_empty() {
        kinds.push("lines without a depth".to_owned());
        ways.push("keep those without a depth in a manifest of their own");
    }
    if has_all_depths && !ways.is_empty() {
        ways.push("--sweep judges all");
    }
    if ways.is_empty() {
        // Scenes, each of which is all touches of a phantom.
        return format!(
            "touches of {}; keep each scene in a manifest of its own, apart from recordings",
            plural(jobs.len(), "source")
        );
    }
    format!("touches of {}; {}", kinds.join(" and "), ways.join(", "))
}

/// A row whose numbers have decimal points: where no comma separates cells, they may have commas.
fn with_points(record: &StringRecord, names: &StringRecord) -> StringRecord {
    let cells = record.iter().zip(names);
    cells
        .map(|(cell, name)| match name {
            "depth" | "radius" | "time" => cell.replace(',', "."),
            _ => cell.to_owned(),
        })
        .collect()
}

/// Fills in `longest` of each row: motions to several depths may be cut out of one file.
fn find_longest(jobs: &mut [Job]) {
    let mut of_file: HashMap<String, Option<usize>> = HashMap::new();
    for job in &*jobs {
        for (_, row) in &job.rows {
            let steps = job.motion.filter(|_| row.time.is_none()).map(Motion::steps);
            let longest = of_file.entry(row.file.clone()).or_insert(steps);
            *longest = longest.zip(steps).map(|(a, b)| a.max(b));
        }
    }
    for (_, row) in jobs.iter_mut().flat_map(|job| &mut job.rows) {
        row.longest = of_file[&row.file];
    }
}

/// Fills in `next` of each row: touches of one file, of whatever phantom and motion, follow one another.
fn find_next(jobs: &mut [Job]) {
    let mut of_file: HashMap<String, Vec<f64>> = HashMap::new();
    for (_, row) in jobs.iter().flat_map(|job| &job.rows) {
        let begins = of_file.entry(row.file.clone()).or_default();
        begins.push(row.time.unwrap_or(0.0));
    }
    of_file
        .values_mut()
        .for_each(|begins| begins.sort_by(f64::total_cmp));
    for (_, row) in jobs.iter_mut().flat_map(|job| &mut job.rows) {
        let begins = &of_file[&row.file];
        let before = begins.partition_point(|begin| *begin <= row.time.unwrap_or(0.0));
        row.next = begins.get(before).copied();
    }
}

#[cfg(test)]
mod tests;
