//! The scene `forearm`: a gripper squeezes a simulated forearm at one place after another, and says where it holds.

mod view;

use super::Args;
use crate::errors::wrong_use;
use crate::forearm::simulate;
use crate::terminal::{self, Shown};
use anyhow::{Context, bail};
use ratatui::Frame;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use std::fmt::Write as _;
use std::time::Instant;
use taxel_forearm::{Estimate, Estimator, Model, Ramp, Squeeze, Trial};
use taxel_playback::interrupt::Interrupt;
use taxel_playback::remarks::Remarks;
use taxel_sim::forearm::SimulatedForearm;
use taxel_view::Palette;
use taxeld::stdout;

/// What the demo calls it.
pub(super) const SCENE: &str = "forearm";
/// Places that are trained on, as the publication does: every second one. The others are new to the estimator.
const TRAINED: [usize; 7] = [0, 2, 4, 6, 8, 10, 12];
/// Squeezes of a training at each of them.
const REPETITIONS: usize = 12;
/// In what order places are squeezed.
const ORDER: [usize; 13] = [6, 1, 10, 3, 12, 5, 8, 0, 11, 2, 9, 4, 7];
/// How long the last estimate of a squeeze stays, ms.
const STAYS_MS: f64 = 1500.0;
/// The simulated arm.
const SEED: u64 = 1;

/// A squeeze that is over.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Outcome {
    held_at: f64,
    is_new: bool,
    estimate: Option<Estimate>,
}

impl Outcome {
    fn off(&self) -> Option<f64> {
        self.estimate
            .map(|estimate| (estimate.percent - self.held_at).abs())
    }

    fn is_within(&self) -> bool {
        let within = |estimate: Estimate| self.off().is_some_and(|off| off <= estimate.half_width_90);
        self.estimate.is_some_and(within)
    }
}

/// The forearm, squeezed, with what is known of the squeeze by now.
struct Playing {
    forearm: SimulatedForearm,
    model: Model,
    trial: Trial,
    /// Squeezes before this one.
    number: usize,
    began_ms: f64,
    /// Samples of the squeeze by now.
    so_far: Squeeze,
    estimate: Option<Estimate>,
    /// Why there is none.
    trouble: Option<String>,
    outcomes: Vec<Outcome>,
}

impl Playing {
    /// Trains on simulated squeezes, and begins.
    fn start() -> anyhow::Result<Self> {
        let forearm = SimulatedForearm::new(SEED, Ramp::Data);
        let session = simulate::session(forearm, &TRAINED, REPETITIONS)?;
        Ok(Self {
            forearm,
            model: Model::train(&session).context("training on simulated squeezes")?,
            trial: squeeze(forearm, 0)?,
            number: 0,
            began_ms: 0.0,
            so_far: Squeeze::default(),
            estimate: None,
            trouble: None,
            outcomes: Vec::new(),
        })
    }

    /// What happened until this time of the demo: each sample is estimated from as it comes.
    fn advance(&mut self, now_ms: f64) -> anyhow::Result<()> {
        loop {
            let times = &self.trial.squeeze.time_ms;
            let (samples, end_ms) = (times.len(), times.last().copied().unwrap_or_default());
            let since_ms = now_ms - self.began_ms;
            let due = times.iter().filter(|time_ms| **time_ms <= since_ms).count();
            for sample in self.so_far.len()..due {
                self.so_far = self.trial.squeeze.prefix(sample + 1);
                match self.model.estimate(&self.so_far) {
                    Ok(estimate) => (self.estimate, self.trouble) = (Some(estimate), None),
                    Err(error) => (self.estimate, self.trouble) = (None, Some(error.to_string())),
                }
                if sample + 1 == samples {
                    self.outcomes.push(Outcome {
                        held_at: self.trial.location_percent,
                        is_new: self.is_new(),
                        estimate: self.estimate,
                    });
                }
            }
            if since_ms < end_ms + STAYS_MS {
                return Ok(());
            }
            self.number += 1;
            self.began_ms += end_ms + STAYS_MS;
            self.trial = squeeze(self.forearm, self.number)?;
            self.so_far = Squeeze::default();
            (self.estimate, self.trouble) = (None, None);
        }
    }

    /// Whether the estimator was never trained on this place.
    fn is_new(&self) -> bool {
        !self
            .model
            .trained_on
            .places
            .contains(&self.trial.location_percent)
    }

    /// Squeezes every place once.
    fn all_places(&mut self) -> anyhow::Result<()> {
        let mut now_ms = 0.0;
        while self.outcomes.len() < ORDER.len() {
            now_ms += 1000.0;
            self.advance(now_ms)?;
        }
        Ok(())
    }

    fn summary(&self) -> String {
        let mut text = format!(
            "forearm    simulated: what follows is no evidence about people\n\
             trained    on {} squeezes at {} places\n",
            self.model.trained_on.squeezes,
            self.model.trained_on.places.len()
        );
        for outcome in &self.outcomes {
            let what = if outcome.is_new { "new" } else { "trained on" };
            let said = match outcome.estimate {
                Some(e) => format!("{:5.1} % +-{:.1} ({})", e.percent, e.half_width_90, e.source),
                None => "none".into(),
            };
            let _ = writeln!(text, "squeeze    at {:5.1} %, {what:10} {said}", outcome.held_at);
        }
        if self.outcomes.is_empty() {
            return text;
        }
        let offs: Vec<f64> = self.outcomes.iter().filter_map(Outcome::off).collect();
        let within = self.outcomes.iter().filter(|outcome| outcome.is_within()).count();
        let _ = writeln!(
            text,
            "estimates  off by {:.1} % on average; {within} of {} within their 90 % interval",
            offs.iter().sum::<f64>() / offs.len().max(1) as f64,
            self.outcomes.len()
        );
        text
    }
}

/// The squeeze of a number: places in their order, again and again, each time another squeeze that was not trained on.
fn squeeze(forearm: SimulatedForearm, number: usize) -> anyhow::Result<Trial> {
    let round = number / ORDER.len();
    simulate::trial(forearm, ORDER[number % ORDER.len()], REPETITIONS + round)
}

/// What is drawn, and when it began.
struct Show {
    playing: Playing,
    began: Instant,
    palette: Palette,
    failure: Option<anyhow::Error>,
}

impl Shown for Show {
    fn draw(&mut self, frame: &mut Frame<'_>) -> bool {
        if let Err(error) = self.playing.advance(self.began.elapsed().as_secs_f64() * 1000.0) {
            self.failure = Some(error);
            return false;
        }
        let area = frame.area();
        view::draw(frame.buffer_mut(), area, &self.playing, self.palette);
        true
    }

    fn key(&mut self, key: KeyEvent) -> bool {
        let is_ctrl_c = key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL);
        let quits = is_ctrl_c || matches!(key.code, KeyCode::Char('q') | KeyCode::Esc);
        key.kind == KeyEventKind::Release || !quits
    }

    // There is no place for it; it is printed in the end.
    fn tell(&mut self, _: String) {}
}

/// Draws until `q`; headless squeezes every place once, without waiting for the time that takes.
pub(super) fn run(args: &Args, headless: bool) -> anyhow::Result<()> {
    for (option, is_given) in [
        ("--layout", args.layout.is_some()),
        ("--levels", args.levels.is_some()),
        ("--actuators", args.actuators.is_some()),
        ("--method", args.method.is_some()),
        ("--conditioning", args.conditioning.is_some()),
        ("--json", args.json),
    ] {
        if is_given {
            return Err(wrong_use(format!(
                "{option} is of hands and displays; the scene {SCENE} has neither"
            )));
        }
    }
    let interrupt = Interrupt::install()?;
    let mut playing = Playing::start()?;
    if headless {
        match args.seconds {
            Some(limit) => playing.advance(1000.0 * limit.as_secs_f64())?,
            None => playing.all_places()?,
        }
    } else {
        let began = Instant::now();
        let mut show = Show {
            playing,
            began,
            palette: Palette::of_terminal(),
            failure: None,
        };
        let deadline = args.seconds.map(|limit| began + limit);
        terminal::show(&mut show, &interrupt, deadline, Remarks::gather())?;
        if let Some(failure) = show.failure {
            return Err(failure);
        }
        playing = show.playing;
    }
    if playing.outcomes.is_empty() && headless {
        let end_ms = playing.trial.squeeze.time_ms.last().copied().unwrap_or_default();
        bail!(
            "no squeeze came to its end; give it --seconds {:.0} or more",
            (end_ms / 1000.0).ceil()
        );
    }
    stdout::print(&playing.summary())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_place_is_squeezed_once_and_the_place_is_told_while_it_is() {
        let mut playing = Playing::start().unwrap();
        playing.advance(6000.0).unwrap();
        assert!(
            playing.outcomes.is_empty() && playing.estimate.is_some(),
            "half way"
        );
        let length = playing.so_far.len();
        assert!((40..60).contains(&length), "{length}");
        playing.all_places().unwrap();
        let mut held: Vec<f64> = playing.outcomes.iter().map(|o| o.held_at).collect();
        held.sort_by(f64::total_cmp);
        held.dedup();
        assert_eq!(held.len(), 13);
        assert_eq!(playing.outcomes.iter().filter(|o| o.is_new).count(), 6);
        let summary = playing.summary();
        assert!(
            summary.contains("no evidence about people") && summary.contains("of 13 within"),
            "{summary}"
        );
    }
}
