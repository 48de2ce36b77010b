//! Touches that a manifest names.

use super::counts::{above_baseline, values};
use super::labels;
use super::touches::{Set, of_scene, open, places, taken_for};
use super::values::Values;
use crate::recordings::own_clock::{CLOCK_S, LATE_NS, instant_ns};
use anyhow::{Context, anyhow, bail, ensure};
use csv::StringRecord;
use std::collections::{HashMap, HashSet};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use taxel_hand::{did_you_mean, plural};
use taxel_record::{FileKind, ReadOptions, Recording};
use taxel_sequence::{Motion, Touch};

/// A row of a manifest: one touch, or all touches of a scene. Columns may be empty; `file` may not.
#[derive(Debug, Clone, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    #[serde(default)]
    phantom: String,
    #[serde(default)]
    motion: String,
    depth: Option<f64>,
    radius: Option<f64>,
    #[serde(default)]
    area: String,
    #[serde(default)]
    label: String,
    /// A recording, `FILE:ARRAY` for one array of an npz, or `sim:SCENE`.
    file: String,
    /// Where in the file the touch begins, s; its whole length where it is empty.
    time: Option<f64>,
    /// Where no row of its file has a time, the steps of the longest motion that any of them has: frames behind these are of
    /// no touch.
    #[serde(skip)]
    longest: Option<usize>,
    /// When the next touch of its file begins, s.
    #[serde(skip)]
    next: Option<f64>,
}

impl Row {
    /// How the touch was made, where it is said.
    ///
    /// # Errors
    /// Where that, or when the touch begins, cannot be.
    fn motion(&self) -> anyhow::Result<Option<Motion>> {
        if let Some(time) = self.time.filter(|time| !CLOCK_S.contains(time)) {
            bail!(
                "time {time}; a touch begins at a number of seconds from 0 to {:.0}",
                CLOCK_S.end()
            );
        }
        let radius = self.radius.unwrap_or(0.0);
        let is_rotary = match self.motion.trim().to_lowercase().as_str() {
            "" => radius > 0.0,
            "vertical" => false,
            "rotary" => true,
            _ => bail!("motion {:?}; it is vertical or rotary", self.motion),
        };
        ensure!(
            is_rotary == (radius > 0.0),
            "a {} motion of radius {radius} mm; vertical is 0, rotary above it",
            self.motion
        );
        let motion = self.depth.map(|depth| Motion::new(depth, radius));
        Ok(motion.transpose()?)
    }
}

/// Touches that a manifest names: those of one scene, or rows of the same phantom and motion.
#[derive(Debug, Clone)]
pub(crate) struct Job {
    manifest: PathBuf,
    motion: Option<Motion>,
    /// What is said of its recordings.
    options: ReadOptions,
    /// With their line numbers.
    rows: Vec<(u64, Row)>,
}

/// What its columns may be.
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

fn names_files(path: &Path, head: &Head) -> anyhow::Result<bool> {
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
struct Head {
    names: Vec<String>,
    second: Vec<String>,
    delimiter: u8,
}

fn first_lines(path: &Path) -> anyhow::Result<Head> {
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
fn refuse_unknown_columns(path: &Path, head: &Head) -> anyhow::Result<()> {
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

impl Job {
    /// How the touches were made, where it is known.
    pub(crate) fn motion(&self) -> Option<Motion> {
        self.motion
    }

    /// What was touched; of a scene that does not say, its name.
    fn phantom(&self) -> &str {
        let (_, first) = &self.rows[0];
        match first.file.strip_prefix("sim:") {
            Some(scene) if first.phantom.is_empty() => scene,
            _ => &first.phantom,
        }
    }

    /// Reads or simulates the touches.
    pub(crate) fn read(&self) -> anyhow::Result<Set> {
        let (line, first) = &self.rows[0];
        let at = |line: &u64| format!("{}:{line}", self.manifest.display());
        if let Some(scene) = first.file.strip_prefix("sim:") {
            let mut set = of_scene(scene, self.motion).with_context(|| at(line))?;
            if !first.phantom.is_empty() {
                set.phantom.clone_from(&first.phantom);
            }
            return Ok(set);
        }
        let mut opened: Vec<(String, Recording)> = Vec::new();
        let mut told: Vec<String> = Vec::new();
        let mut set = Set {
            name: match self.motion {
                Some(motion) => format!("{} {motion}", first.phantom).trim().to_owned(),
                None => self.manifest.display().to_string(),
            },
            phantom: first.phantom.clone(),
            motion: self.motion,
            touches: Vec::new(),
            labels: Vec::new(),
            period_s: 0.0,
            rest_ms: None,
            beyond: 0,
            values_are: Values::Xyz,
            layout: None,
        };
        for (line, row) in &self.rows {
            if opened.last().is_none_or(|(name, _)| *name != row.file) {
                let (file, array) = match row.file.rsplit_once(".npz:") {
                    Some((stem, array)) => (format!("{stem}.npz"), Some(array.to_owned())),
                    None => (row.file.clone(), None),
                };
                let path = self.manifest.parent().unwrap_or(Path::new("")).join(file);
                let options = ReadOptions {
                    array,
                    ..self.options.clone()
                };
                let recording = open(&path, &options).with_context(|| at(line))?;
                opened = vec![(row.file.clone(), recording)];
            }
            let recording = &opened[0].1;
            let is_timed = self.motion.is_none() || row.time.is_some();
            for sentence in taken_for(recording, &self.options, is_timed) {
                // Said of the first of those of which it is true.
                if !told.contains(&sentence) {
                    remark!("taxel: {}: {sentence}", recording.name());
                    told.push(sentence);
                }
            }
            let touch = self.touch(row, recording).with_context(|| at(line))?;
            let beyond = row
                .longest
                .map_or(0, |longest| recording.len().saturating_sub(longest));
            // Once, and not again by each shallower motion.
            let is_longest = self.motion.map(Motion::steps) == row.longest;
            if let Some(motion) = self.motion
                && beyond > 0
                && is_longest
                && set.beyond == 0
            {
                remark!(
                    "taxel: {}: {} has {}, and the longest motion that is cut out of it {} steps, a frame each, the first of \
                     them at {} {}; those behind are left out, and so of other files",
                    at(line),
                    row.file,
                    plural(recording.len(), "frame"),
                    recording.len() - beyond,
                    motion.at(0),
                    motion.along().unit()
                );
            }
            set.beyond += beyond;
            set.period_s = set.period_s.max(recording.period_ns() as f64 / 1e9);
            set.values_are = Values::of(recording).or(set.values_are, set.touches.is_empty());
            let layout = recording.layout().map(str::to_owned);
            set.layout =
                layout.filter(|layout| set.touches.is_empty() || set.layout.as_ref() == Some(layout));
            set.touches.push(touch);
            set.labels.push(row.label.clone());
        }
        Ok(set)
    }

    fn touch(&self, row: &Row, recording: &Recording) -> anyhow::Result<Touch> {
        let (taxels, values) = values(recording);
        let times: Vec<u64> = (0..recording.len()).map(|frame| recording.t_ns(frame)).collect();
        let from_ns = instant_ns(row.time.unwrap_or(0.0));
        let first = times.partition_point(|t| *t < from_ns);
        let begins_late = row.time.is_some() && times[0] > from_ns + LATE_NS.max(recording.period_ns());
        ensure!(
            first < times.len() && !begins_late,
            "no frame at {} s: {} goes from {} s to {} s",
            row.time.unwrap_or(0.0),
            recording.name(),
            times[0] as f64 / 1e9,
            times[times.len() - 1] as f64 / 1e9
        );
        let end = match self.motion {
            Some(motion) => (first + motion.steps()).min(times.len()),
            None => match row.next {
                Some(next) => times.partition_point(|t| *t < instant_ns(next)).max(first + 1),
                None => times.len(),
            },
        };
        let name = match (row.area.as_str(), row.label.as_str()) {
            ("", "") => row.file.clone(),
            ("", label) => format!("{} ({label})", row.file),
            (area, label) => format!("{area} ({label})"),
        };
        Ok(Touch {
            at: places(self.motion, &name, &times, first..end)?,
            name,
            taxels,
            values: above_baseline(&values, taxels, recording.has_counts(), first)
                [first * taxels..end * taxels]
                .to_vec(),
        })
    }
}

#[cfg(test)]
mod tests;
