//! Touches of one motion: from a recording cut by marks or contact, or from a scene.

use super::counts::{above_baseline, values};
use super::labels;
use super::values::Values;
use super::whole;
use crate::recordings::assumed;
use crate::recordings::implausible_times;
use crate::recordings::marks_file;
use anyhow::{Context, anyhow, bail, ensure};
use std::path::{Path, PathBuf};
use taxel_can::Received;
use taxel_engine::{Engine, Frames, TickMode};
use taxel_hand::{plural, shell_word};
use taxel_playback::{recorded, stand_in};
use taxel_record::{FileKind, ReadOptions, RecordError, Recording};
use taxel_sequence::{
    Aligned, Alignment, Cut, Mark, Motion, SequenceError, Touch, align, cut_by_contact, sure_step,
};
use taxel_sim::{Palpation, Scene, Simulator, with_stand_in_boards};
use taxel_skin::Layout;
use taxeld::Config;

/// Touches of one motion and what is known of each.
#[derive(Debug, Clone)]
pub(crate) struct Set {
    /// What was touched, and how.
    pub(crate) name: String,
    pub(crate) phantom: String,
    pub(crate) motion: Option<Motion>,
    pub(crate) touches: Vec<Touch>,
    /// The class of each touch; empty where it is not known.
    pub(crate) labels: Vec<String>,
    /// Time between frames, s, where touches are aligned by time.
    pub(super) period_s: f64,
    /// How long the probe rested on each step, ms, where it made more than one image of it.
    pub(crate) rest_ms: Option<f64>,
    /// Frames of files behind the last step of every motion that is cut out of them.
    pub(super) beyond: usize,
    /// What the values of its touches are.
    pub(super) values_are: Values,
    /// The layout of the hand, where it is known.
    pub(super) layout: Option<String>,
}

/// Without `--step`, steps are at most this many times the time between frames. Frames of a live hand come late by less; more
/// is a hole in the recording, which is not stepped over unasked.
const MOST_TIMES: f64 = 4.0;

impl Set {
    /// The touches side by side: at `step`, or else at the motion's, or at the time between frames. Where frames came late,
    /// so that a touch lacks a step of that, at the smallest multiple of it that every touch has; that is said.
    pub(crate) fn align(&self, step: Option<f64>) -> anyhow::Result<Aligned> {
        let along = self.along();
        let usual = self.motion.map_or(self.period_s, |motion| motion.step());
        let lacking = match align(&self.touches, along, step.unwrap_or(usual)) {
            Err(lacking @ SequenceError::StepMissing { .. }) => lacking,
            aligned => return aligned.with_context(|| self.name.clone()),
        };
        let sure = in_billionths(sure_step(&self.touches, along, usual)?);
        if step.is_none() && along == Alignment::Time && sure <= MOST_TIMES * usual + 1e-9 {
            remark!(
                "taxel: {}: frames came late, so touches are put side by side in steps of {sure} s, not in those of {usual} s \
                 from frame to frame; --step S takes others",
                self.name
            );
            return align(&self.touches, along, sure).with_context(|| self.name.clone());
        }
        let name = &self.name;
        Err(anyhow!(
            "{name}: {lacking}: --step {sure} is wide enough for all of its touches"
        ))
    }

    /// What steps are counted along.
    fn along(&self) -> Alignment {
        self.motion.map_or(Alignment::Time, |motion| motion.along())
    }

    /// Only the last so many mm of a motion straight down; of one that turns, all. What is above is left out of each touch.
    ///
    /// # Errors
    /// Where depths of frames are not known.
    pub(super) fn last_mm(mut self, window: Option<f64>) -> anyhow::Result<Self> {
        let Some(window) = window else {
            return Ok(self);
        };
        let Some(motion) = self.motion else {
            bail!(
                "{}: --window {window} is of mm, and how deep each frame was is not known: say --depth, or in a manifest depth",
                self.name
            );
        };
        if motion.is_rotary() {
            return Ok(self);
        }
        let from = motion.depth_mm - window + 1e-9;
        for touch in &mut self.touches {
            let before = touch.at.partition_point(|at| *at <= from);
            touch.at.drain(..before);
            touch.values.drain(..before * touch.taxels);
        }
        Ok(self)
    }

    /// That so many frames are left out, and for which touch.
    pub(super) fn frames_left_out(&self, frames: usize) -> Option<String> {
        let way = |touch: &Touch| {
            let [least, most] = [f64::min, f64::max].map(|of| touch.at.iter().copied().reduce(of));
            most.unwrap_or_default() - least.unwrap_or_default()
        };
        let shortest = self.touches.iter().min_by(|a, b| way(a).total_cmp(&way(b)));
        let shortest = shortest.filter(|_| frames > 0)?;
        let unit = self.along().unit();
        Some(format!(
            "{frames} frames outside the steps that all touches have are left out; the shortest, {}, has {} in {} {unit}",
            shortest.name,
            plural(shortest.at.len(), "frame"),
            (1e3 * way(shortest)).round() / 1e3
        ))
    }

    /// The classes in the order of their first touches, and the number of that of each touch; `None` where a touch has
    /// none.
    pub(crate) fn classes(&self) -> Option<(Vec<String>, Vec<usize>)> {
        if self.labels.iter().any(String::is_empty) {
            return None;
        }
        let mut names: Vec<String> = Vec::new();
        let mut number = |label: &String| match names.iter().position(|name| name == label) {
            Some(number) => number,
            None => {
                names.push(label.clone());
                names.len() - 1
            }
        };
        let numbers = self.labels.iter().map(&mut number).collect();
        Some((names, numbers))
    }
}

/// Rounded up to what can be read and typed again.
fn in_billionths(step: f64) -> f64 {
    (step * 1e9 - 1e-3).ceil() / 1e9
}

/// How a recording is cut into touches.
#[derive(Debug, Clone, Default)]
pub(crate) struct Cutting {
    pub(crate) marks: Option<PathBuf>,
    pub(crate) until: String,
    pub(crate) contact: Option<f64>,
    pub(crate) least: usize,
}

/// The touches of a recording.
pub(crate) fn of_recording(
    path: &Path,
    options: &ReadOptions,
    cutting: &Cutting,
    motion: Option<Motion>,
) -> anyhow::Result<Set> {
    let (recording, marks) = match FileKind::of(path) {
        Some(FileKind::Mcap) => recorded::read_frames_and_marks(path)?,
        _ => (open(path, options)?, Vec::new()),
    };
    let is_timed = motion.is_none() || cutting.marks.is_some();
    for sentence in taken_for(&recording, options, is_timed) {
        remark!("taxel: {}: {sentence}", recording.name());
    }
    let (taxels, values) = values(&recording);
    let times: Vec<u64> = (0..recording.len()).map(|frame| recording.t_ns(frame)).collect();
    let mut cuts = match (&cutting.marks, cutting.contact) {
        (Some(file), _) => {
            let marks = marks_file::read(file)?;
            let counted = marks_file::counted_from_first(&marks, &times, &cutting.until);
            if let Some((_, told)) = &counted {
                remark!("taxel: {}: {told}", recording.name());
            }
            let marks = counted.map_or(marks, |(marks, _)| marks);
            whole::of_marks(&times, &marks, &cutting.until, recording.name(), motion)
        }
        (None, Some(threshold)) => {
            let above = above_baseline(&values, taxels, recording.has_counts(), 0);
            let cuts = cut_by_contact(&above, &times, threshold, cutting.least);
            match whole::of_contact(cuts, &recording, motion, cutting.least) {
                none if none.is_empty() => Err(SequenceError::NoTouch),
                cuts => Ok(cuts),
            }
        }
        (None, None) if !marks.is_empty() => {
            whole::of_marks(&times, &marks, &cutting.until, recording.name(), motion)
        }
        (None, None) => bail!(
            "{}: where does a touch begin? --marks FILE says it by marks, --contact COUNTS by contact; or give a manifest",
            path.display()
        ),
    }
    .with_context(|| path.display().to_string())?;
    cuts.iter_mut()
        .for_each(|cut| cut.mark = cut.mark.trim().to_owned());
    let of_cut = |(number, cut): (usize, &Cut)| {
        let name = if cut.mark.is_empty() {
            number.to_string()
        } else {
            format!("{number} ({})", cut.mark)
        };
        let at = places(motion, &name, &times, cut.frames.clone())?;
        let above = above_baseline(&values, taxels, recording.has_counts(), cut.frames.start);
        Ok(Touch {
            name,
            at,
            taxels,
            values: above[cut.frames.start * taxels..cut.frames.end * taxels].to_vec(),
        })
    };
    let touches = cuts.iter().enumerate().map(of_cut).collect::<anyhow::Result<_>>();
    let labels: Vec<String> = cuts.iter().map(|cut| label_of(&cut.mark).to_owned()).collect();
    if let Some(told) = labels::alike(&labels) {
        remark!("taxel: {}: {told}", recording.name());
    }
    Ok(Set {
        name: stand_in::as_named(recording.name().to_owned()),
        phantom: String::new(),
        motion,
        touches: touches.with_context(|| path.display().to_string())?,
        labels,
        period_s: recording.period_ns() as f64 / 1e9,
        rest_ms: None,
        beyond: 0,
        values_are: Values::of(&recording),
        layout: recording.layout().map(str::to_owned),
    })
}

/// What a recording is taken for where it does not say so, but for its times where these do not matter.
pub(super) fn taken_for(
    recording: &Recording,
    options: &ReadOptions,
    is_timed: bool,
) -> impl Iterator<Item = String> + use<> {
    let units = "where it is not, call it t_ms, t_us or t_ns";
    let clock = implausible_times::told(recording).filter(|_| is_timed);
    let of_times = assumed::of_times(recording, options, units).filter(|_| is_timed);
    assumed::of_columns(recording).chain(of_times).chain(clock)
}

/// Opens frames; of CAN traffic, says how they are made of it.
pub(super) fn open(path: &Path, options: &ReadOptions) -> anyhow::Result<Recording> {
    match FileKind::of(path) {
        Some(FileKind::Log) => bail!(
            "{}: a candump .log holds CAN traffic, not tactile frames; `taxel convert {} {}` makes frames of it, with --config \
             FILE those of your hand",
            path.display(),
            shell_word(path.display()),
            shell_word(path.with_extension("npz").display())
        ),
        Some(FileKind::Mcap) => recorded::read_frames(path),
        _ => Recording::open(path, options).map_err(|error| match error {
            RecordError::NotFinite { .. } => anyhow::anyhow!(
                "{error}, and touches are compared in all taxels. Where it stands for no reading, write the one before it; take \
                 a taxel without any out of every file"
            ),
            _ => error.into(),
        }),
    }
}

/// The class that a mark names: its last word, where there are several, as in `touch 5 SS`.
pub(crate) fn label_of(mark: &str) -> &str {
    mark.rsplit_once(' ').map_or("", |(_, label)| label)
}

/// Where on a motion each frame of a touch was taken. With a motion there is a frame for each of its steps; without,
/// places are times since the first.
pub(super) fn places(
    motion: Option<Motion>,
    name: &str,
    times: &[u64],
    frames: std::ops::Range<usize>,
) -> anyhow::Result<Vec<f64>> {
    let Some(motion) = motion else {
        let first = times[frames.start];
        return Ok(times[frames].iter().map(|t| (t - first) as f64 / 1e9).collect());
    };
    ensure!(
        frames.len() == motion.steps(),
        "touch {name} has {} frames, and the motion {motion} has {} steps, a frame each; say --depth and --radius as they \
         were, or leave them out to align by time",
        frames.len(),
        motion.steps()
    );
    Ok((0..frames.len()).map(|n| motion.at(n)).collect())
}

/// Simulated at once.
const CHUNK_NS: u64 = 100_000_000;
/// The probe moves at the beginning of a step; what arrives so soon after was felt before.
const MOVING_NS: u64 = 10_000_000;

/// The touches of a phantom: its boards' CAN traffic through the engine, cut by the scene's marks.
pub(crate) fn of_scene(name: &str, motion: Option<Motion>) -> anyhow::Result<Set> {
    let mut scene = Scene::resolve(name)?;
    if let Some(motion) = motion {
        scene = scene.with_motion(motion);
    }
    let Some(palpation) = scene.palpation() else {
        bail!("the scene {name} has no [palpation]; phantom-1 and phantom-2 have");
    };
    let layout = with_stand_in_boards(&Layout::resolve(scene.layout())?)?;
    let mut config = Config::new(layout.clone(), Vec::new());
    config.tick.mode = TickMode::Sweep;
    let mut engine = Engine::new(&config.engine(false)?, 0)?;
    let mut simulator = Simulator::new(&scene, &layout, scene.seed())?;
    simulator.start_all();
    let mut cutter = Cutter::new(palpation, layout.taxels.len());
    let mut received: Vec<(u8, Received)> = Vec::new();
    for from_ns in (0..scene.length_ns()).step_by(CHUNK_NS as usize) {
        simulator.advance((from_ns + CHUNK_NS).min(scene.length_ns()), &mut received);
        for (bus, frame) in received.drain(..) {
            engine.handle_frame(bus, &frame);
            engine.drain(&mut |frames| cutter.take(frames));
        }
    }
    let motion = palpation.motion();
    Ok(Set {
        name: format!("{name} {motion}"),
        phantom: name.to_owned(),
        motion: Some(motion),
        touches: cutter.touches,
        labels: palpation.classes().into_iter().map(str::to_owned).collect(),
        period_s: 0.05,
        rest_ms: Some(palpation.step_ns() as f64 / 1e6),
        beyond: 0,
        values_are: Values::Z,
        layout: Some(layout.name.clone()),
    })
}

/// Frames of the engine to touches, by marks.
struct Cutter {
    marks: Vec<Mark>,
    motion: Motion,
    step_ns: u64,
    /// Of the touch at work.
    baseline: Vec<f64>,
    touches: Vec<Touch>,
}

impl Cutter {
    fn new(palpation: &Palpation, taxels: usize) -> Self {
        let marks = palpation.marks();
        let touches = marks.iter().filter(|mark| mark.text != "away").map(|mark| Touch {
            name: mark.text.clone(),
            at: Vec::new(),
            taxels,
            values: Vec::new(),
        });
        Self {
            touches: touches.collect(),
            marks,
            motion: palpation.motion(),
            step_ns: palpation.step_ns(),
            baseline: Vec::new(),
        }
    }

    fn take(&mut self, frames: &Frames) {
        let t_ns = frames.tactile.t_ns;
        // Marks alternate: a touch, away.
        let passed = self.marks.partition_point(|mark| mark.t_ns <= t_ns);
        if passed % 2 == 0 {
            self.baseline.clear();
            return;
        }
        let since_ns = t_ns - self.marks[passed - 1].t_ns;
        if self.baseline.is_empty() {
            self.baseline
                .extend(frames.baseline.iter().map(|xyz| f64::from(xyz[2])));
        }
        if since_ns % self.step_ns < MOVING_NS {
            return;
        }
        let touch = &mut self.touches[passed / 2];
        touch.at.push(self.motion.at((since_ns / self.step_ns) as usize));
        let counts = frames.tactile.counts.iter().zip(&self.baseline);
        touch
            .values
            .extend(counts.map(|(count, baseline)| f64::from(count[2]) - baseline));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_taxel_without_a_value_keeps_its_last_and_before_that_its_first() {
        let (first, last) = (Some([1, 2, 3]), Some([4, 5, 6]));
        let counts = vec![None, None, first, None, None, None, last, None];
        let recording = Recording::of_counts("a".into(), 2, counts, vec![0, 1, 2, 3], Vec::new()).unwrap();
        let (each, values) = values(&recording);
        let of_first: Vec<f64> = values
            .chunks_exact(each)
            .flat_map(|frame| frame[..3].to_vec())
            .collect();
        assert_eq!(of_first, [1., 2., 3., 1., 2., 3., 1., 2., 3., 4., 5., 6.]);
        assert!(values.chunks_exact(each).all(|frame| frame[3..] == [0.0; 3]));
    }

    #[test]
    fn a_window_keeps_the_last_of_a_motion_down_and_all_of_one_that_turns() {
        let set = |motion: Option<Motion>| {
            let at: Vec<f64> = (0..13)
                .map(|n| motion.map_or(0.0, |motion| motion.at(n)))
                .collect();
            Set {
                name: String::new(),
                phantom: String::new(),
                motion,
                touches: vec![Touch {
                    name: String::new(),
                    values: at.iter().flat_map(|at| [*at, -at]).collect(),
                    at,
                    taxels: 2,
                }],
                labels: vec![String::new()],
                period_s: 0.0,
                rest_ms: None,
                beyond: 0,
                values_are: Values::Z,
                layout: None,
            }
        };
        let down = Motion::new(6.5, 0.0).ok();
        let touch = set(down).last_mm(Some(1.0)).unwrap().touches.remove(0);
        assert_eq!(
            (touch.at, touch.values),
            (vec![6.0, 6.5], vec![6.0, -6.0, 6.5, -6.5])
        );
        for (motion, window) in [
            (down, Some(40.0)),
            (down, None),
            (Motion::new(6.5, 10.0).ok(), Some(1.0)),
        ] {
            assert_eq!(set(motion).last_mm(window).unwrap().touches[0].at.len(), 13);
        }
        let unknown = set(None).last_mm(Some(1.0)).unwrap_err().to_string();
        assert!(unknown.contains("--window 1 is of mm"), "{unknown}");
    }

    #[test]
    fn a_mark_names_a_class_after_its_place() {
        assert_eq!(
            (label_of("touch 5 SS"), label_of("touch"), label_of("")),
            ("SS", "", "")
        );
    }
}
