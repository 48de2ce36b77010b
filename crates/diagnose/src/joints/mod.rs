//! What is wrong with the joints, and what is to be said of them while all is well.

mod allegro;
mod analogue;
mod angles_used;
mod patience;
mod port;
mod reporter;
mod servo_state;
mod servos;
#[cfg(test)]
pub(crate) mod test_views;

pub use allegro::{motor_error, silent_fingers};
pub use analogue::{absent_potentiometers, potentiometer_state, silent_potentiometers, unread_lines};
pub(crate) use angles_used::AnglesUsed;
pub(crate) use patience::Patience;
pub use reporter::JointsReporter;
pub use servo_state::{servo_state, unknown_model};
pub use servos::{missing_servos, servo_name, silent_servo, slow_adapter, two_servos};

use crate::joints_view::{JointsView, SourceView};
use crate::kind::Kind;
use crate::problem::{Place, Problem};
use crate::view::Look;
use servos::Servos;
use taxel_joints::bus::ServoCounters;
use taxel_joints::{AnalogueCounters, JointsConfig};

/// How often each thing happened to servos, at one look.
#[derive(Debug, Default, Clone)]
pub(crate) struct JointsReadings {
    servos: Vec<ServoCounters>,
    late_fast: u64,
    analogue: AnalogueCounters,
}

impl JointsReadings {
    pub(crate) fn of(view: Option<&JointsView>) -> Self {
        let servos = view.and_then(|view| view.servos.as_ref());
        let analogue = view.and_then(|view| view.analogue.as_ref());
        Self {
            servos: servos.map_or_else(Vec::new, |(snapshot, _)| {
                snapshot.servos.iter().map(|s| s.counters).collect()
            }),
            late_fast: servos.map_or(0, |(snapshot, _)| snapshot.counters.late_fast),
            analogue: analogue.map_or_else(AnalogueCounters::default, |analogue| analogue.counters),
        }
    }
}

/// What joints are judged by.
pub(crate) struct Judge<'a> {
    pub(crate) config: &'a JointsConfig,
    pub(crate) view: &'a JointsView,
    pub(crate) before: &'a JointsReadings,
    pub(crate) look: &'a Look<'a>,
    /// The problem of this kind and place that there was at the last look.
    pub(crate) had: &'a dyn Fn(Kind, Place) -> Option<&'a Problem>,
}

impl Judge<'_> {
    pub(crate) fn judge(&self, patience: &mut Patience, used: &mut AnglesUsed, found: &mut Vec<Problem>) {
        if found.iter().any(|p| p.kind == Kind::ArrayLate) {
            // Angles of the frames' instant are asked for, which may be older than any that is kept.
            patience.all_explained();
        }
        let unknown = patience.unknown(self.view);
        match self.view.of(self.config) {
            Some(SourceView::Servos {
                config,
                snapshot,
                port,
            }) => {
                let servos = Servos {
                    config,
                    snapshot,
                    port,
                    unknown: &unknown,
                };
                self.servos(servos, patience, found);
            }
            Some(SourceView::Hand(hand)) => {
                used.add(&self.view.tick.angles);
                self.hand(hand, patience, found);
                found.extend(used.problem(hand));
            }
            None => {}
        }
        if let (Some(config), Some(snapshot)) = (&self.config.analogue, &self.view.analogue) {
            self.potentiometers(config, snapshot, found);
        }
    }
}

fn of_joints(kind: Kind, place: Place, found: String, advice: impl Into<String>, over: String) -> Problem {
    Problem::new(
        kind,
        place,
        format!("joints: {found}"),
        advice,
        format!("joints: {over}"),
    )
}
