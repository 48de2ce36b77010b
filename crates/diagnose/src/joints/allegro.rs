//! What is wrong with an Allegro hand: its bus, its fingers, its motors.

use super::servo_state::cures;
use super::{Judge, Patience, of_joints};
use crate::kind::Kind;
use crate::problem::{Place, Problem};
use taxel_can::{BusState, LinkState};
use taxel_joints::registers::HardwareError;
use taxel_joints::{
    ALLEGRO_FINGERS, ALLEGRO_JOINTS, AllegroSource, MOTOR_ERROR_NS, MotorError, SourceConfig,
};

/// The bits of an error that the hand's manual names. They have the meaning of those of a servo that reports one, which has
/// another bit besides.
const NAMED_BITS: u8 = 0x35;

impl Judge<'_> {
    pub(super) fn hand(&self, hand: &AllegroSource, patience: &mut Patience, found: &mut Vec<Problem>) {
        let view = self.view;
        let errors = view.tick.motor_errors.current(view.now_ns);
        found.extend(errors.map(|error| motor_error(hand, error)));
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

/// An Allegro hand reports an error of one of its motors.
pub fn motor_error(hand: &AllegroSource, error: MotorError) -> Problem {
    let MotorError { motor, bits, .. } = error;
    let joint = usize::from(motor);
    let (place, name) = match joint < ALLEGRO_JOINTS {
        true => (
            Place::Joint(joint),
            format!("motor {motor} ({})", hand.joint_names()[joint]),
        ),
        false => (Place::Joints, format!("motor {motor}, which no joint has")),
    };
    let named = HardwareError(bits & NAMED_BITS);
    let is_named = bits & !NAMED_BITS == 0;
    let what = match (named.is_none(), is_named) {
        (true, _) => "bits that its manual does not name".into(),
        (false, true) => named.to_string(),
        (false, false) => format!("{named}, and bits that its manual does not name"),
    };
    let seconds = MOTOR_ERROR_NS / 1_000_000_000;
    of_joints(
        Kind::HandError,
        place,
        format!(
            "the Allegro hand reports an error of {name}: {what} ({bits:#04x}). The lamp on its back is red"
        ),
        format!("{}, or switch the hand off and on", cures(named)),
        format!("the Allegro hand has reported no error of {name} for {seconds} s, or says that it is over"),
    )
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
