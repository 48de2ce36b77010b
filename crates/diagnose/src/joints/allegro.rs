//! What is wrong with an Allegro hand: its bus, its fingers.

use super::{Judge, Patience, of_joints};
use crate::kind::Kind;
use crate::problem::{Place, Problem};
use taxel_can::{BusState, LinkState};
use taxel_joints::{ALLEGRO_FINGERS, AllegroSource};

impl Judge<'_> {
    pub(super) fn hand(&self, hand: &AllegroSource, patience: &mut Patience, found: &mut Vec<Problem>) {
        let view = self.view;
        let off = view.source.bus_state == BusState::BusOff;
        if view.link != LinkState::Up || off {
            patience.away();
            // That of a skin's bus is told of the bus.
            if !self.look.setup.joints_share_bus {
                found.push(lost_bus(&hand.bus.to_string(), view.link));
            }
            return;
        }
        patience.begin(0, ALLEGRO_FINGERS.len(), view.now_ns);
        let silent =
            std::array::from_fn(|f| patience.is_silent(f, view.finger_speaks(f) == Some(true), view.now_ns));
        found.extend(silent_fingers(hand, silent));
    }
}

/// Fingers of an Allegro hand that send no angles; all of them are one problem.
pub fn silent_fingers(hand: &AllegroSource, silent: [bool; 4]) -> Vec<Problem> {
    let bus = &hand.bus;
    if silent.iter().all(|silent| *silent) {
        let own = hand.hand.as_ref().is_some_and(|hand| hand.own_bus);
        let advice = if own {
            "check its power, cable and version. It is started again every second"
        } else {
            "check its power and cable, `version`, and that the program that controls it runs: taxeld only listens"
        };
        return vec![of_joints(
            Kind::HandSilent,
            Place::Joints,
            format!("the Allegro hand on {bus} sends no angles"),
            advice,
            format!("the Allegro hand on {bus} sends its angles"),
        )];
    }
    let fingers = ALLEGRO_FINGERS.iter().zip(silent).enumerate();
    fingers
        .filter(|(_, (_, silent))| *silent)
        .map(|(finger, (name, _))| {
            of_joints(
                Kind::FingerSilent,
                Place::Joint(4 * finger),
                format!("the hand's {name} finger sends no angles, and others do"),
                "look at its connector inside the hand",
                format!("the hand's {name} finger sends its angles again"),
            )
        })
        .collect()
}

fn lost_bus(bus: &str, link: LinkState) -> Problem {
    let (kind, what, advice) = match link {
        LinkState::Absent => (
            Kind::LinkAbsent,
            "is not there",
            "plug its adapter in, or see `ip link`",
        ),
        LinkState::Down => (Kind::LinkDown, "is down", "`ip link set INTERFACE up`"),
        LinkState::Up => (
            Kind::BusOff,
            "is off after too many errors",
            "check wiring and termination, and set `restart-ms 100`",
        ),
    };
    of_joints(
        kind,
        Place::Joints,
        format!("the hand's bus {bus} {what}"),
        format!("{advice}. Images go on, with unknown joint angles"),
        format!("the hand's bus {bus} is up"),
    )
}
