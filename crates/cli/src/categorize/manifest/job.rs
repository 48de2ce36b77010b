//! The touches of a manifest that belong together, read.

use super::row::Row;
use crate::categorize::counts::{above_baseline, values};
use crate::categorize::touches::{Set, of_scene, open, places, taken_for};
use crate::categorize::values::Values;
use crate::recordings::own_clock::{LATE_NS, instant_ns};
use anyhow::{Context, ensure};
use std::path::{Path, PathBuf};
use taxel_hand::plural;
use taxel_record::{ReadOptions, Recording};
use taxel_sequence::{Motion, Touch};

/// Touches that a manifest names: those of one scene, or rows of the same phantom and motion.
#[derive(Debug, Clone)]
pub(crate) struct Job {
    pub(super) manifest: PathBuf,
    pub(super) motion: Option<Motion>,
    /// What is said of its recordings.
    pub(super) options: ReadOptions,
    /// With their line numbers.
    pub(super) rows: Vec<(u64, Row)>,
}

impl Job {
    /// How the touches were made, where it is known.
    pub(crate) fn motion(&self) -> Option<Motion> {
        self.motion
    }

    /// What was touched; of a scene that does not say, its name.
    pub(super) fn phantom(&self) -> &str {
        let (_, first) = &self.rows[0];
        match first.file.strip_prefix("sim:") {
            Some(scene) if first.phantom.is_empty() => scene,
            _ => &first.phantom,
        }
    }

    /// Reads or simulates the touches.
    pub(crate) fn read(&self) -> anyhow::Result<Set> {
        let (line, first) = &self.rows[0];
        if let Some(scene) = first.file.strip_prefix("sim:") {
            let mut set = of_scene(scene, self.motion).with_context(|| self.at(*line))?;
            if !first.phantom.is_empty() {
                set.phantom.clone_from(&first.phantom);
            }
            return Ok(set);
        }
        let mut opened: Option<(&str, Recording)> = None;
        let mut told: Vec<String> = Vec::new();
        let mut set = self.empty_set();
        for (line, row) in &self.rows {
            let recording = match opened.take() {
                Some((file, recording)) if file == row.file => recording,
                _ => self.open(row).with_context(|| self.at(*line))?,
            };
            self.tell_once(row, &recording, &mut told);
            let touch = self.touch(row, &recording).with_context(|| self.at(*line))?;
            let beyond = row
                .longest
                .map_or(0, |longest| recording.len().saturating_sub(longest));
            if beyond > 0 && set.beyond == 0 {
                self.tell_beyond(*line, row, &recording, beyond);
            }
            set.beyond += beyond;
            set.period_s = set.period_s.max(recording.period_ns() as f64 / 1e9);
            let is_first = set.touches.is_empty();
            set.values_are = Values::of(&recording).or(set.values_are, is_first);
            let layout = recording.layout().map(str::to_owned);
            set.layout = layout.filter(|layout| is_first || set.layout.as_ref() == Some(layout));
            set.touches.push(touch);
            set.labels.push(row.label.clone());
            opened = Some((&row.file, recording));
        }
        Ok(set)
    }

    /// The place of a row, for messages.
    fn at(&self, line: u64) -> String {
        format!("{}:{line}", self.manifest.display())
    }

    fn empty_set(&self) -> Set {
        let phantom = self.rows[0].1.phantom.clone();
        Set {
            name: match self.motion {
                Some(motion) => format!("{phantom} {motion}").trim().to_owned(),
                None => self.manifest.display().to_string(),
            },
            phantom,
            motion: self.motion,
            touches: Vec::new(),
            labels: Vec::new(),
            period_s: 0.0,
            rest_ms: None,
            beyond: 0,
            values_are: Values::Xyz,
            layout: None,
        }
    }

    /// Opens the recording of a row, which stands in the manifest's folder.
    fn open(&self, row: &Row) -> anyhow::Result<Recording> {
        let (file, array) = match row.file.rsplit_once(".npz:") {
            Some((stem, array)) => (format!("{stem}.npz"), Some(array.to_owned())),
            None => (row.file.clone(), None),
        };
        let path = self.manifest.parent().unwrap_or(Path::new("")).join(file);
        let options = ReadOptions {
            array,
            ..self.options.clone()
        };
        open(&path, &options)
    }

    /// Says what a recording is taken for, but for what was `told` of another.
    fn tell_once(&self, row: &Row, recording: &Recording, told: &mut Vec<String>) {
        let is_timed = self.motion.is_none() || row.time.is_some();
        for sentence in taken_for(recording, &self.options, is_timed) {
            if !told.contains(&sentence) {
                remark!("taxel: {}: {sentence}", recording.name());
                told.push(sentence);
            }
        }
    }

    /// Says that the last frames of a recording, `beyond` of them, are behind the longest motion that is cut out of it. Each
    /// shallower motion of the same recording says nothing.
    fn tell_beyond(&self, line: u64, row: &Row, recording: &Recording, beyond: usize) {
        let Some(motion) = self.motion.filter(|motion| Some(motion.steps()) == row.longest) else {
            return;
        };
        remark!(
            "taxel: {}: {} has {}, and the longest motion that is cut out of it {} steps, a frame each, the first of \
             them at {} {}; those behind are left out, and so of other files",
            self.at(line),
            row.file,
            plural(recording.len(), "frame"),
            recording.len() - beyond,
            motion.at(0),
            motion.along().unit()
        );
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
