//! A recording onto buses, at the times at which it was recorded.

use super::pass::{Line, Pass};
use super::target::Targets;
use super::traffic::Traffic;
use crate::counts::array_frames::ArrayFrames;
use crate::counts::sweep::Sweeps;
use crate::interrupt::Interrupt;
use crate::progress::Progress;
use anyhow::bail;
use std::ops::Range;
use std::sync::mpsc::sync_channel;
use std::sync::{Mutex, PoisonError};
use std::thread::{self, Scope};
use std::time::{Duration, Instant};
use taxel_can::{ClockJumps, Received};
use taxel_hand::plural;

/// From the last frame of one pass to the first of the next, with --loop.
const PASS_GAP_NS: u64 = 1_000_000;

/// The least speed of a [`Player`]: at it a second takes eleven days.
pub const LEAST_SPEED: f64 = 1e-6;

/// Frames that are read at once, and how often before they are played.
const BATCH: usize = 1024;
const BATCHES: usize = 4;

/// What was played.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Played {
    /// CAN frames put somewhere.
    pub frames: u64,
    /// Error frames, and lines that hold no classic frame.
    pub left_out: u64,
    /// How often the recording was begun.
    pub passes: u64,
    /// How long that took.
    pub seconds: f64,
    /// The most that a frame was behind its time, milliseconds.
    pub late_ms: f64,
}

/// Sends a recording, pass after pass.
pub struct Player {
    speed: f64,
    looping: bool,
    window: Range<u64>,
    targets: Targets,
    interrupt: Interrupt,
    /// When time `window.start` of the present pass is due.
    begin: Instant,
    left_out: u64,
    latest: Duration,
}

impl Player {
    /// The speed is [`LEAST_SPEED`] or more, also without end; the window is of the recording, nanoseconds from its beginning.
    pub fn new(speed: f64, looping: bool, window: Range<u64>, targets: Targets) -> anyhow::Result<Self> {
        if looping && targets.are_log_files() {
            bail!("--loop into a log would fill the disk; leave it out");
        }
        if speed.is_finite() && speed != 1.0 && targets.are_logs() {
            remark!("taxel: --speed {speed}: a log is written at once, with the times of the recording");
        }
        Ok(Self {
            speed,
            looping,
            window,
            targets,
            interrupt: Interrupt::install()?,
            begin: Instant::now(),
            left_out: 0,
            latest: Duration::ZERO,
        })
    }

    /// Plays the CAN traffic of a recording: of the interfaces of these names, or of all.
    pub fn play_traffic(self, traffic: &Traffic, names: Option<&[String]>) -> anyhow::Result<Played> {
        let jumps = Mutex::default();
        // Where it is played again and again, or not to its end, its size tells nothing.
        let to_the_end = !self.looping && self.window.end == u64::MAX;
        let bytes = Some(traffic.bytes()).filter(|bytes| to_the_end && *bytes > 0);
        let played =
            thread::scope(|scope| self.play(bytes, || ahead(scope, Pass::open(traffic, names, &jumps)?)))?;
        let jumps: ClockJumps = jumps.into_inner().unwrap_or_else(PoisonError::into_inner);
        if jumps.count() > 0 {
            remark!("taxel: {}: {jumps}", traffic.path().display());
        }
        Ok(played)
    }

    /// Plays what boards would have sent.
    pub fn play_sweeps(self, sweeps: &Sweeps<'_>) -> anyhow::Result<Played> {
        self.play(None, || Ok(sweeps.frames().map(line)))
    }

    /// Plays the frames of pressure arrays.
    pub fn play_arrays(self, frames: &ArrayFrames<'_>) -> anyhow::Result<Played> {
        self.play(None, || Ok(frames.frames().map(line)))
    }

    /// Plays pass after pass, of a file of this many bytes where that is known.
    fn play<I>(mut self, bytes: Option<u64>, pass: impl Fn() -> anyhow::Result<I>) -> anyhow::Result<Played>
    where
        I: Iterator<Item = anyhow::Result<Line>>,
    {
        let began = Instant::now();
        let progress = match bytes {
            Some(bytes) => (Progress::bytes(bytes), Progress::none()),
            None => (Progress::none(), Progress::counting("CAN frames")),
        };
        let mut passes = 0u64;
        self.begin = began;
        loop {
            let length_ns = self.pass(pass()?, &progress)?;
            passes += 1;
            if !self.looping || self.interrupt.is_set() {
                break;
            }
            match length_ns {
                Some(length_ns) => self.begin = self.due(length_ns + PASS_GAP_NS),
                None => break,
            }
        }
        drop(progress);
        if self.interrupt.is_set() {
            self.targets.give_up_logs()?;
        } else if self.targets.sent() + self.targets.failed() == 0 {
            bail!("nothing was sent: there is no frame between --start and --end");
        }
        self.targets.finish()?;
        let took = began.elapsed();
        self.report(passes, took);
        self.targets.check()?;
        Ok(Played {
            frames: self.targets.sent(),
            left_out: self.left_out,
            passes,
            seconds: took.as_secs_f64(),
            late_ms: self.latest.as_secs_f64() * 1e3,
        })
    }

    /// Sends the recording once, and shows how far it is read and sent; returns how long the played part of it is, nothing if
    /// there is none.
    fn pass(
        &mut self,
        lines: impl Iterator<Item = anyhow::Result<Line>>,
        (read, sent): &(Progress, Progress),
    ) -> anyhow::Result<Option<u64>> {
        let waits = !self.targets.are_logs();
        let mut length_ns = None;
        for line in lines {
            let (name, received) = match line? {
                Line::Frame(name, received) => (name, received),
                Line::Interface(name) => {
                    self.targets.add_name(&name);
                    continue;
                }
                Line::Other => {
                    self.left_out += 1;
                    continue;
                }
                Line::Read(bytes) => {
                    read.advance_to(bytes);
                    continue;
                }
            };
            if received.t_ns < self.window.start {
                continue;
            }
            if received.t_ns >= self.window.end || self.interrupt.is_set() {
                break;
            }
            if length_ns.is_none() {
                // What is passed over takes no time.
                read.time_anew();
            }
            let since_start = received.t_ns - self.window.start;
            length_ns = Some(since_start);
            if waits {
                let due = self.due(since_start);
                if !self.interrupt.sleep_until(due) {
                    break;
                }
                if self.speed.is_finite() {
                    self.latest = self.latest.max(due.elapsed());
                }
            }
            self.targets.send(name, received.t_ns, &received.frame)?;
            sent.advance(1);
        }
        Ok(length_ns)
    }

    /// When a frame is due that comes so much later than the pass begins.
    fn due(&self, since_start_ns: u64) -> Instant {
        self.begin + Duration::from_secs_f64(since_start_ns as f64 / 1e9 / self.speed)
    }

    fn report(&self, passes: u64, took: Duration) {
        let Self {
            targets,
            left_out,
            latest,
            ..
        } = self;
        let mut text = format!(
            "{} sent in {:.1} s",
            plural(targets.sent(), "frame"),
            took.as_secs_f64()
        );
        if passes > 1 {
            text += &format!(", {passes} passes");
        }
        if targets.failed() > 0 {
            text += &format!(", {} failed", targets.failed());
        }
        if *left_out > 0 {
            text += &format!(", {left_out} left out (error frames, or not classic CAN)");
        }
        if *latest > Duration::ZERO {
            text += &format!(", at most {:.1} ms late", latest.as_secs_f64() * 1e3);
        }
        say!("{text}");
    }
}

/// Has a thread of its own read what is played, so that neither waits for the other.
fn ahead<'scope, T: Send + 'scope, I: Iterator<Item = T> + Send + 'scope>(
    scope: &'scope Scope<'scope, '_>,
    mut items: I,
) -> anyhow::Result<impl Iterator<Item = T> + use<'scope, T, I>> {
    let (sender, batches) = sync_channel(BATCHES);
    thread::Builder::new()
        .name("recording".into())
        .spawn_scoped(scope, move || {
            loop {
                let batch: Vec<T> = items.by_ref().take(BATCH).collect();
                if batch.is_empty() || sender.send(batch).is_err() {
                    return;
                }
            }
        })?;
    Ok(batches.into_iter().flatten())
}

fn line((bus, received): (u8, Received)) -> anyhow::Result<Line> {
    Ok(Line::Frame(usize::from(bus), received))
}
