//! The hand of a recording, played in its own time.

use super::{Sheet, Source, lock, look, summary};
use crate::recordings::input::Input;
use crate::recordings::movement;
use crate::recordings::offline::OfflineArgs;
use crate::terminal;
use anyhow::{Context, bail};
use std::sync::{Arc, Condvar, Mutex, MutexGuard};
use std::time::{Duration, Instant};
use taxel_diagnose::{Kind, Severity};
use taxel_engine::Display;
use taxel_hand::{ForceFrame, Freshness, TactileFrame, TactileImage};
use taxel_playback::interrupt::Interrupt;
use taxel_playback::remarks::Remarks;
use taxel_skin::Movement;
use taxel_view::{Action, Heading, Screen, Seen};
use taxel_wire::status::ProblemStatus;
use taxel_wire::{Clock, Header, Hello, HelloRate, ImageView, RawView};
use taxel_wire::{encode_image_payload, encode_raw_payload};

/// The fastest and slowest that a recording is played, times its own speed.
const SPEEDS: (f64, f64) = (1.0 / 64.0, 64.0);

/// A recording that is played on a thread of its own.
struct Player {
    name: String,
    seen: Mutex<Seen>,
    pace: Mutex<Pace>,
    changed: Condvar,
}

/// How it is played.
#[derive(Debug, Clone)]
struct Pace {
    halted: bool,
    speed: f64,
    /// Where the times that people are told begin: at the first image of an array or table, whose clock may be any; at the
    /// first frame of traffic, whose times begin there.
    began_ns: u64,
    /// Nothing before this time of the recording is waited for.
    skip_to_ns: u64,
    /// Nothing so long after the beginning is shown.
    most_ns: u64,
    /// A time of the recording, and when it was shown.
    anchor: Option<(u64, Instant)>,
    /// Whether a frame has come.
    has_begun: bool,
    again: bool,
    at_end: bool,
    over: bool,
    failure: Option<String>,
}

impl Default for Pace {
    fn default() -> Self {
        Self {
            halted: false,
            speed: 1.0,
            began_ns: 0,
            skip_to_ns: 0,
            most_ns: u64::MAX,
            anchor: None,
            has_begun: false,
            again: false,
            at_end: false,
            over: false,
            failure: None,
        }
    }
}

pub(super) fn run(
    recording: &OfflineArgs,
    limit: Option<Duration>,
    sheet: Option<&Sheet<'_>>,
    as_json: bool,
) -> anyhow::Result<()> {
    let interrupt = Interrupt::install()?;
    let player = Arc::new(Player {
        name: recording.input.name(),
        seen: Mutex::new(Seen::new()),
        pace: Mutex::new(Pace::default()),
        changed: Condvar::new(),
    });
    if sheet.is_some() || as_json || !terminal::can_draw() {
        // As fast as it can be read.
        player.change(|pace| {
            pace.skip_to_ns = u64::MAX;
            pace.most_ns = limit.map_or(u64::MAX, |limit| limit.as_nanos() as u64);
        });
        let outcome = player.play(recording);
        if !player.pace().over {
            outcome?;
        }
        let began_ns = player.pace().began_ns;
        return match sheet {
            Some(sheet) => sheet.draw(&player.seen, &*player, &Screen::of_recording()),
            None => summary::print(&lock(&player.seen), &player.name, (began_ns, None), as_json),
        };
    }
    // What keeps the file from being read is said before the terminal is taken.
    let remarks = Remarks::gather();
    recording.configure(&recording.open_whole()?)?;
    let thread = {
        let (player, recording) = (player.clone(), recording.clone());
        std::thread::Builder::new()
            .name("player".into())
            .spawn(move || player.repeat(&recording))?
    };
    let screen = Screen::of_recording();
    let deadline = limit.map(|limit| Instant::now() + limit);
    let outcome = look(&player.seen, &*player, screen, &interrupt, deadline, remarks);
    player.change(|pace| pace.over = true);
    let _ = thread.join();
    outcome?;
    match player.pace().failure.take() {
        Some(failure) => bail!("{failure}"),
        None => Ok(()),
    }
}

impl Player {
    fn pace(&self) -> MutexGuard<'_, Pace> {
        lock(&self.pace)
    }

    fn change(&self, change: impl FnOnce(&mut Pace)) {
        let mut pace = self.pace();
        change(&mut pace);
        pace.anchor = None;
        self.changed.notify_all();
    }

    /// Plays it, and again where that is asked for, until the view is over.
    fn repeat(&self, recording: &OfflineArgs) {
        loop {
            self.change(|pace| (pace.again, pace.at_end) = (false, false));
            let outcome = self.play(recording);
            let mut pace = self.pace();
            if let Err(error) = outcome
                && !(pace.over || pace.again)
            {
                pace.failure = Some(format!("{error:#}"));
                // A hand that nothing is known of is nothing to look at.
                pace.over = !pace.has_begun;
            }
            pace.at_end = true;
            while !pace.again && !pace.over {
                pace = self.changed.wait(pace).unwrap_or_else(|e| e.into_inner());
            }
            if pace.over {
                return;
            }
        }
    }

    fn play(&self, recording: &OfflineArgs) -> anyhow::Result<()> {
        let input = recording.open_whole()?;
        let config = recording.configure(&input)?;
        let rate = HelloRate {
            mode: "recording".into(),
            hz: None,
        };
        let geometry = &config.layout.geometry;
        let hello = Hello::new(&self.name, geometry, &config.profile, rate, Clock::Recording);
        let of_magnitudes = matches!(&input, Input::Frames(recording) if !recording.has_counts());
        let hello = Hello {
            joints: recording.joint_names(&input, &config),
            force_unit: if of_magnitudes { "" } else { config.force_unit() }.into(),
            ..hello
        };
        {
            let mut seen = lock(&self.seen);
            seen.see_hello(&hello, 0);
            seen.set_problem(None, 0);
        }
        let mut moved = Movement::None;
        let mut payload = Vec::new();
        let mut counts = TactileFrame::new(geometry.len());
        counts.freshness.fill(Freshness::Fresh);
        counts.age_ns.fill(0);
        let mut display = Display::new(config.profile.clone(), None, geometry)?;
        let mut has_begun = !matches!(input, Input::Frames(_));
        recording.run(&input, &config, &mut |felt| {
            let force = felt.force;
            if !std::mem::replace(&mut has_begun, true) {
                self.pace().began_ns = force.t_ns;
            }
            self.wait_until(force.t_ns)?;
            if let Some(measured) = felt.measured.filter(|measured| measured.moved != moved) {
                moved = measured.moved;
                let told = movement::told(moved, force.threshold, &config);
                lock(&self.seen).set_problem(told.map(baseline_moved), force.t_ns);
            }
            let image = display.image_of(force, felt.joints);
            match felt.measured {
                Some(measured) => self.see(
                    measured.tactile,
                    Some(measured.baseline),
                    force,
                    image,
                    &mut payload,
                ),
                None => {
                    (counts.seq, counts.t_ns) = (force.seq, force.t_ns);
                    self.see(&counts, None, force, image, &mut payload)
                }
            }
        })
    }

    fn see(
        &self,
        tactile: &TactileFrame,
        baseline: Option<&[[f32; 3]]>,
        force: &ForceFrame,
        image: &TactileImage,
        payload: &mut Vec<u8>,
    ) -> anyhow::Result<()> {
        let mut seen = lock(&self.seen);
        encode_image_payload(image, payload)?;
        let header = Header::of_image(image, payload.len());
        let view = ImageView::decode(payload).context("an image made here")?;
        seen.see_image(&header, &view, force.t_ns);
        encode_raw_payload(tactile, force, baseline, payload)?;
        let view = RawView::decode(payload).context("a raw frame made here")?;
        seen.see_raw(&Header::of_frame(tactile, force, payload.len()), &view);
        Ok(())
    }

    /// Waits until this time of the recording is due.
    fn wait_until(&self, t_ns: u64) -> anyhow::Result<()> {
        let mut pace = self.pace();
        pace.has_begun = true;
        loop {
            pace.over |= t_ns.saturating_sub(pace.began_ns) > pace.most_ns;
            if pace.over || pace.again {
                bail!("stopped");
            }
            if t_ns < pace.skip_to_ns {
                pace.anchor = None;
                return Ok(());
            }
            let wait = match (pace.halted, pace.anchor) {
                (true, _) => Duration::from_secs(1),
                (false, None) => {
                    pace.anchor = Some((t_ns, Instant::now()));
                    return Ok(());
                }
                (false, Some((from_ns, at))) => {
                    let ahead_s = t_ns.saturating_sub(from_ns) as f64 / 1e9 / pace.speed;
                    (at + Duration::from_secs_f64(ahead_s)).saturating_duration_since(Instant::now())
                }
            };
            if wait.is_zero() {
                return Ok(());
            }
            let woken = self.changed.wait_timeout(pace, wait);
            pace = woken.unwrap_or_else(|e| e.into_inner()).0;
        }
    }
}

/// The problem of a hand that moved while it was calibrated, as its daemon would have it.
fn baseline_moved(sentence: String) -> ProblemStatus {
    let kind = Kind::BaselineMoved;
    ProblemStatus {
        kind: kind.name().into(),
        severe: kind.severity() == Severity::Error,
        sentence,
        ..ProblemStatus::default()
    }
}

impl Source for Player {
    fn heading(&self, seen: &Seen) -> Heading {
        let pace = self.pace();
        let layout = seen.hello().map_or("", |hello| hello.layout.as_str());
        let about = match (pace.at_end, pace.halted, pace.speed) {
            (true, ..) if pace.failure.is_some() => pace.failure.clone().unwrap_or_default(),
            (true, ..) => "the end; 0 plays it again".into(),
            (_, true, _) => "halted; p goes on".into(),
            (_, _, 1.0) => layout.into(),
            (_, _, speed) => format!("{speed} times its own speed"),
        };
        Heading {
            name: self.name.clone(),
            detail: format!("{:.1} s", seen.t_ns().saturating_sub(pace.began_ns) as f64 / 1e9),
            about,
        }
    }

    fn now_ns(&self, seen: &Seen) -> u64 {
        seen.t_ns()
    }

    fn is_over(&self) -> bool {
        self.pace().over
    }

    fn act(&self, action: Action) -> Option<String> {
        let t_ns = lock(&self.seen).t_ns();
        self.change(|pace| match action {
            Action::Halt => pace.halted = !pace.halted,
            Action::Skip(seconds) => pace.skip_to_ns = t_ns + (seconds * 1e9) as u64,
            Action::Again => (pace.again, pace.halted, pace.skip_to_ns) = (true, false, 0),
            Action::Speed(times) => pace.speed = (pace.speed * times).clamp(SPEEDS.0, SPEEDS.1),
            _ => {}
        });
        None
    }
}
