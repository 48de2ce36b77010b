//! `taxel categorize --live MAP`: touch after touch into its category, beside a running daemon.

use super::counts::{FRAMES_BEFORE, Followed};
use super::map_file::MapFile;
use super::probe::Probe;
use super::values::Values;
use super::waiting_marks::WaitingMarks;
use crate::client::live_lines::{Lines, every_frame};
use crate::client::reconnect::with_daemon;
use crate::notices;
use anyhow::{anyhow, bail, ensure};
use serde::Serialize;
use std::collections::VecDeque;
use std::fmt;
use std::path::Path;
use taxel_hand::{Freshness, plural};
use taxel_palpation::Classifier;
use taxel_playback::newest_reading::NewestReading;
use taxel_sequence::{Aligned, Alignment, Motion, SequenceError, Touch};
use taxel_wire::{EventKind, Header, Hello, Kind, RawTaxel, RawView, Received, Subscriber};

/// Touches as they come: frames and marks in, categories out. No socket and no clock.
pub(crate) struct Live {
    /// What the map is of.
    pub(super) probe: Probe,
    grid: Aligned,
    motion: Option<Motion>,
    rest_ns: Option<u64>,
    labels: Vec<Option<String>>,
    classifier: Classifier,
    until: String,
    /// The newest frames, newest first, from which a touch of counts is counted; `None` where values are above the daemon's baseline.
    before: Option<VecDeque<Vec<f64>>>,
    /// The touch at work.
    touch: Option<AtWork>,
}

/// A touch that goes on: when it began, and its first and its newest frame.
struct AtWork {
    touch: Touch,
    start_ns: u64,
    first_ns: Option<u64>,
    end_ns: u64,
    /// Frames so far, of which those outside the map's steps are not kept.
    frames: usize,
    /// What its values are above, where that is not the daemon's baseline; nothing before its first frame, if that is the
    /// first of all.
    rest: Option<Vec<f64>>,
}

/// A touch and its category: the keys of a TOUCH message, and the mark that began it.
#[derive(Debug, Clone, Serialize, PartialEq)]
pub(crate) struct Categorised {
    pub(crate) category: usize,
    pub(crate) label: Option<String>,
    distances: Vec<f64>,
    pub(crate) confidence: f64,
    pub(crate) unknown: bool,
    start_ns: u64,
    end_ns: u64,
    pub(crate) mark: String,
    /// Where it is on the map.
    #[serde(skip)]
    pub(crate) place: Vec<f64>,
}

/// A touch that has no category, and why: the keys of one that has, as far as they can be told.
#[derive(Debug, Clone, Serialize, PartialEq)]
pub(crate) struct Untold {
    category: Option<usize>,
    label: Option<String>,
    unknown: bool,
    start_ns: u64,
    end_ns: u64,
    mark: String,
    error: String,
}

impl fmt::Display for Untold {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.error)
    }
}

impl Live {
    pub(super) fn new(map: MapFile, until: &str) -> anyhow::Result<Self> {
        let motion = map
            .motion
            .map(|[depth, radius]| Motion::new(depth, radius))
            .transpose()?;
        let is_of_counts = map.values_are == Some(Values::Xyz);
        Ok(Self {
            probe: Probe::of(&map),
            grid: Aligned {
                along: motion.map_or(Alignment::Time, Motion::along),
                first: map.first,
                step: map.step,
                steps: map.steps,
                taxels: map.values,
                left_out: 0,
                values: Vec::new(),
            },
            motion,
            rest_ns: map.rest_ms.map(|ms| (ms * 1e6) as u64).filter(|ns| *ns > 0),
            before: is_of_counts.then(VecDeque::new),
            labels: map.labels,
            classifier: map.classifier,
            until: until.to_owned(),
            touch: None,
        })
    }

    /// Takes a frame: counts as they are, where the map is of such, or above the daemon's baseline.
    fn handle_frame(&mut self, t_ns: u64, values: impl Iterator<Item = f64>) {
        let Some(before) = &mut self.before else {
            self.go_on(t_ns, values);
            return;
        };
        let mut frame: Vec<f64> = values.collect();
        before.truncate(FRAMES_BEFORE - 1);
        before.push_front(frame.clone());
        if let Some(touch) = &mut self.touch {
            let rest = touch.rest.get_or_insert_with(|| frame.clone());
            frame
                .iter_mut()
                .zip(rest)
                .for_each(|(value, rest)| *value -= *rest);
        }
        self.go_on(t_ns, frame.into_iter());
    }

    /// Takes what is above rest.
    fn go_on(&mut self, t_ns: u64, values: impl Iterator<Item = f64>) {
        let Some(AtWork {
            touch,
            start_ns,
            first_ns,
            end_ns,
            frames,
            rest: _,
        }) = &mut self.touch
        else {
            return;
        };
        let since_ns = t_ns.saturating_sub(*start_ns);
        // As in a recording, where a mark has no frame of its own.
        let since_first_ns = t_ns.saturating_sub(*first_ns.get_or_insert(t_ns));
        let at = match (self.motion, self.rest_ns) {
            // The probe moves at the beginning of a step.
            (Some(_), Some(rest_ns)) if since_ns % rest_ns < rest_ns / 10 => return,
            (Some(motion), Some(rest_ns)) => motion.at((since_ns / rest_ns) as usize),
            (Some(motion), None) => motion.at(*frames),
            (None, _) => since_first_ns as f64 / 1e9,
        };
        *frames += 1;
        *end_ns = t_ns;
        // A touch that nobody ends keeps no more than its steps can need.
        let Aligned {
            first, step, steps, ..
        } = self.grid;
        if (first - step..=first + step * steps as f64).contains(&at) {
            touch.at.push(at);
            touch.values.extend(values);
        }
    }

    /// Takes a mark: the touch that it ends, if it ends one; why that has no category, where it has none.
    fn handle_mark(&mut self, t_ns: u64, text: &str) -> Option<Result<Categorised, Untold>> {
        let ended = self.touch.take();
        if text != self.until {
            let touch = Touch {
                name: text.to_owned(),
                at: Vec::new(),
                taxels: self.grid.taxels,
                values: Vec::new(),
            };
            self.touch = Some(AtWork {
                touch,
                start_ns: t_ns,
                first_ns: None,
                end_ns: t_ns,
                frames: 0,
                rest: self.before.as_ref().and_then(mean),
            });
        }
        ended.map(|ended| {
            self.categorise(&ended).map_err(|error| Untold {
                category: None,
                label: None,
                unknown: true,
                start_ns: ended.start_ns,
                end_ns: ended.end_ns,
                mark: ended.touch.name,
                error: format!("{error:#}"),
            })
        })
    }

    fn categorise(&self, ended: &AtWork) -> anyhow::Result<Categorised> {
        let placed = self.grid.place(&ended.touch);
        let (features, _) = placed.map_err(|error| match error {
            SequenceError::StepMissing { .. } => {
                let step = self.grid.step;
                anyhow!("{error}: the map's is {step}, and `--save` makes another with --step")
            }
            error => error.into(),
        })?;
        ensure!(
            features.iter().all(|feature| feature.is_finite()),
            "taxels have no baseline in a part of this touch: it was being measured, as at a re-zero; touch again"
        );
        let found = self.classifier.classify(&features)?;
        Ok(Categorised {
            category: found.category,
            label: self.labels[found.category].clone(),
            distances: found.distances,
            confidence: found.confidence,
            unknown: found.unknown,
            start_ns: ended.start_ns,
            end_ns: ended.end_ns,
            mark: ended.touch.name.clone(),
            place: found.place,
        })
    }
}

/// What comes of the frames and marks of a daemon.
pub(crate) trait Listener {
    /// The hand, each time it is described.
    fn hello(&mut self, _: &Hello) -> anyhow::Result<()> {
        Ok(())
    }

    /// A touch, when the mark that ends it has come, or why it has no category. The mark's instant is `ended_ns` on the
    /// daemon's clock, and `newest` the number of the newest frame.
    fn touch(&mut self, touch: Result<Categorised, Untold>, ended_ns: u64, newest: u64)
    -> anyhow::Result<()>;

    /// Frames that this reader was too slow for, before frame `seq`, while something was touched.
    fn lost(&mut self, _frames: u32, _seq: u64) {}
}

/// The daemon that is followed.
pub(crate) struct Source<'a> {
    /// Its image socket; none for the one that runs here.
    pub(super) socket: Option<&'a Path>,
    /// Whether it is waited for.
    pub(super) reconnect: bool,
}

impl<'a> Source<'a> {
    /// Until it ends.
    pub(crate) fn of(socket: &'a Path) -> Self {
        Self {
            socket: Some(socket),
            reconnect: false,
        }
    }
}

/// Takes every frame and mark of a daemon, in order, until it ends, or of one after another.
pub(crate) fn follow(source: Source<'_>, mut live: Live, listener: &mut dyn Listener) -> anyhow::Result<()> {
    with_daemon(source.socket, source.reconnect, |subscriber, _| {
        live.touch = None;
        follow_one(subscriber, &mut live, listener)
    })
}

/// The mean of frames; `None` of none.
fn mean(frames: &VecDeque<Vec<f64>>) -> Option<Vec<f64>> {
    let mut mean = vec![0.0; frames.front()?.len()];
    for frame in frames {
        let share = |value: &f64| value / frames.len() as f64;
        mean.iter_mut()
            .zip(frame)
            .for_each(|(sum, value)| *sum += share(value));
    }
    Some(mean)
}

/// How far a taxel is above its baseline on each axis, also where it is pressed by more than half a turn.
fn above(baseline: [f32; 3], reading: &RawTaxel, taxel: &mut Followed) -> [f64; 3] {
    let is_new = taxel.is_new();
    if reading.freshness != Freshness::Missing {
        taxel.follow(reading.counts);
    }
    if is_new || !reading.contact {
        taxel.rest(baseline);
    }
    let at = taxel.at();
    std::array::from_fn(|axis| at[axis] - f64::from(baseline[axis]))
}

/// One daemon, as it is followed.
struct Following<'a> {
    live: &'a mut Live,
    listener: &'a mut dyn Listener,
    marks: WaitingMarks,
    newest_reading: NewestReading,
    /// The number of the newest frame.
    newest: u64,
    followed: Vec<Followed>,
}

fn follow_one(subscriber: Subscriber, live: &mut Live, listener: &mut dyn Listener) -> anyhow::Result<()> {
    let mut subscriber = every_frame(subscriber)?;
    let mut following = Following {
        live,
        listener,
        marks: WaitingMarks::default(),
        newest_reading: NewestReading::default(),
        newest: 0,
        followed: Vec::new(),
    };
    let ended = loop {
        let received = subscriber.next().map_err(anyhow::Error::from);
        if let Err(error) = received.and_then(|received| following.take(received)) {
            break error;
        }
    };
    following.take_marks(u64::MAX)?;
    Err(ended)
}

impl Following<'_> {
    fn take(&mut self, received: Received<'_>) -> anyhow::Result<()> {
        match received {
            Received::Hello(hello) => {
                if let Some(told) = self.live.probe.meets(&hello.layout, hello.taxels.len())? {
                    notices::warn(&format!("taxel: {told}"));
                }
                self.listener.hello(hello)
            }
            Received::Raw(header, raw) => self.take_frame(&header, &raw),
            Received::Event(header, event) if event.event == EventKind::Mark => {
                self.marks.wait(header.t_ns, &event.message);
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Takes the marks that are before a frame of this instant, and tells of the touches that they end.
    fn take_marks(&mut self, t_ns: u64) -> anyhow::Result<()> {
        while let Some((mark_ns, text)) = self.marks.next_before(t_ns) {
            if let Some(touch) = self.live.handle_mark(mark_ns, &text) {
                self.listener.touch(touch, mark_ns, self.newest)?;
            }
        }
        Ok(())
    }

    fn take_frame(&mut self, header: &Header, raw: &RawView<'_>) -> anyhow::Result<()> {
        self.marks.count_frame();
        self.take_marks(header.t_ns)?;
        let live = &mut *self.live;
        if header.skipped > 0 && live.touch.is_some() {
            self.listener.lost(header.skipped, header.seq);
        }
        self.newest = header.seq;
        let ages_us = raw.taxels().map(|taxel| taxel.age_us);
        if !self.newest_reading.advances(header.t_ns, ages_us) {
            return Ok(());
        }
        let one = live.grid.taxels == raw.taxels().len();
        if one {
            let has_three = raw.taxels().any(|taxel| taxel.counts[..2] != [0, 0]);
            if let Some(told) = live.probe.sees(has_three)? {
                notices::warn(&format!("taxel: {told}"));
            }
        }
        let Some(baselines) = raw.baselines() else {
            bail!("the daemon sends no baselines (it is of version 1.0, or the hand has too many taxels)");
        };
        if self.followed.len() != raw.taxels().len() {
            self.followed = vec![Followed::default(); raw.taxels().len()];
            live.before.iter_mut().for_each(VecDeque::clear);
        }
        let readings = raw.taxels().zip(baselines).zip(&mut self.followed);
        let is_above = live.before.is_none();
        let pressed = readings.map(|((reading, baseline), taxel)| {
            let above = above(baseline, &reading, taxel);
            if is_above { above } else { taxel.at() }
        });
        let values = pressed.flat_map(|xyz| xyz.into_iter().skip(if one { 2 } else { 0 }));
        live.handle_frame(header.t_ns, values);
        Ok(())
    }
}

/// Reads every frame of a daemon and writes a line for each touch; publishes it too, where there is a socket for that.
pub(super) fn run(map: &Path, source: Source<'_>, publish: Option<&Path>, until: &str) -> anyhow::Result<()> {
    let live = Live::new(MapFile::load(map)?, until)?;
    follow(source, live, &mut Lines::new(Kind::Touch, "touches", publish))
}

impl Listener for Lines<'_> {
    fn hello(&mut self, hello: &Hello) -> anyhow::Result<()> {
        Lines::hello(self, hello)
    }

    fn touch(
        &mut self,
        touch: Result<Categorised, Untold>,
        ended_ns: u64,
        newest: u64,
    ) -> anyhow::Result<()> {
        match touch {
            Ok(touch) => self.tell(&touch, ended_ns, Some((newest, touch.end_ns))),
            // A TOUCH message always has a category.
            Err(untold) => self.tell(&untold, ended_ns, None),
        }
    }

    fn lost(&mut self, frames: u32, seq: u64) {
        notices::warn(&format!(
            "taxel: {} lost before frame {seq}; this reader was slow",
            plural(frames, "frame")
        ));
    }
}

#[cfg(test)]
impl Categorised {
    /// A touch on a map of two components.
    pub(crate) fn sample(place: [f64; 2], category: usize, label: Option<&str>, mark: &str) -> Self {
        Self {
            category,
            label: label.map(Into::into),
            distances: vec![1.0, 2.0],
            confidence: 0.5,
            unknown: false,
            start_ns: 0,
            end_ns: 1,
            mark: mark.into(),
            place: place.into(),
        }
    }
}

#[cfg(test)]
mod tests;
