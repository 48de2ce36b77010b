//! What nobody can know of while something else is wrong: a problem that is not found then is not over.

use crate::kind::Kind;
use crate::problem::{Place, Problem};
use taxel_skin::Layout;

/// Whether a problem of `by` leaves it unknown how it stands with another one.
pub(crate) fn hides(by: &Problem, of: &Problem, layout: &Layout) -> bool {
    if by.is_same(of) {
        return false;
    }
    match by.kind {
        Kind::LinkAbsent | Kind::LinkDown | Kind::RecordingEnded | Kind::BusOff | Kind::BusSilent => {
            hides_of_bus(by, of, layout)
        }
        Kind::BoardUnheard | Kind::BoardSilent => hides_of_board(by, of),
        Kind::BoardMalformed => hides_of_board(by, of) || hides_of_unread_bus(by, of, layout),
        Kind::BoardOnOtherBus | Kind::BusesSwapped => hides_where_it_should_be(by, of, layout),
        _ => hides_of_joints(by, of),
    }
}

/// What is not heard while a bus is lost, or nothing comes over it.
fn hides_of_bus(by: &Problem, of: &Problem, layout: &Layout) -> bool {
    if by.place == Place::Joints {
        return matches!(
            of.kind,
            Kind::HandSilent | Kind::FingerSilent | Kind::HandError | Kind::JointStale
        );
    }
    let is_of_boards = matches!(
        of.kind,
        Kind::BoardSilent
            | Kind::BoardUnheard
            | Kind::BoardMalformed
            | Kind::TwoBoards
            | Kind::TaxelsOutOfUse
    );
    let is_of_link = match by.kind {
        Kind::BusSilent => false,
        Kind::BusOff => matches!(of.kind, Kind::BusSilent | Kind::BoardUnsteady),
        _ => matches!(
            of.kind,
            Kind::BusSilent
                | Kind::BoardUnsteady
                | Kind::BusOff
                | Kind::Flapping
                | Kind::ErrorPassive
                | Kind::ErrorWarning
                | Kind::NoAcknowledge
                | Kind::CannotSend
        ),
    };
    (is_of_boards || is_of_link) && by.bus(layout) == of.bus(layout)
}

/// A board that is silent sends nothing that could be read, and one whose frames cannot be read has not recovered.
fn hides_of_board(by: &Problem, of: &Problem) -> bool {
    let is_of_same = by.modules.iter().any(|module| of.modules.contains(module));
    let is_malformed = by.kind == Kind::BoardMalformed;
    is_of_same
        && match of.kind {
            Kind::BoardMalformed | Kind::TaxelsOutOfUse => true,
            Kind::BoardUnheard | Kind::BoardSilent => is_malformed,
            _ => false,
        }
}

/// A bus from which nothing comes that could be read does not speak again.
fn hides_of_unread_bus(by: &Problem, of: &Problem, layout: &Layout) -> bool {
    let bus = of.bus(layout);
    let mut here = (0..layout.wiring.len()).filter(|m| Some(usize::from(layout.wiring[*m].bus)) == bus);
    of.kind == Kind::BusSilent && by.bus(layout) == bus && here.all(|module| by.modules.contains(&module))
}

/// A board that speaks on another bus is as silent as before on its own.
fn hides_where_it_should_be(by: &Problem, of: &Problem, layout: &Layout) -> bool {
    let is_quiet = matches!(of.kind, Kind::BoardSilent | Kind::BoardUnheard | Kind::BusSilent);
    let is_its_own = match by.place {
        Place::Stranger(bus, other) => {
            let buses = [Some(bus), Some((other & 0xFF) as usize)];
            buses.contains(&of.bus(layout))
        }
        _ => by.modules.iter().any(|module| of.modules.contains(module)),
    };
    is_quiet && is_its_own
}

/// What is not known of joints whose port is away or that do not answer, and what something worse is told instead of.
fn hides_of_joints(by: &Problem, of: &Problem) -> bool {
    let is_of_servo = matches!(
        of.kind,
        Kind::ServoSilent
            | Kind::ServoLate
            | Kind::ServoDamaged
            | Kind::TwoServos
            | Kind::ServoRefuses
            | Kind::JointStale
    );
    let is_of_lines = matches!(
        of.kind,
        Kind::AnalogueMalformed | Kind::PotentiometerLost | Kind::JointStale
    );
    let is_same_joint = by.place == of.place;
    match by.kind {
        Kind::SerialAbsent | Kind::SerialStuck => {
            is_of_servo
                || matches!(
                    of.kind,
                    Kind::ServosSilent | Kind::SerialShared | Kind::SerialStuck | Kind::AdapterLatency
                )
        }
        Kind::SerialShared => is_of_servo || of.kind == Kind::ServosSilent,
        Kind::ServosSilent => is_of_servo,
        Kind::ServoSilent => is_same_joint && is_of_servo,
        Kind::ServoLate | Kind::ServoDamaged if by.place == Place::Joints => {
            of.kind == by.kind || of.kind == Kind::JointStale
        }
        Kind::ServoLate
        | Kind::ServoDamaged
        | Kind::TwoServos
        | Kind::ServoRefuses
        | Kind::PotentiometerLost => is_same_joint && of.kind == Kind::JointStale,
        Kind::AnalogueAbsent => is_of_lines || of.kind == Kind::AnalogueSilent,
        Kind::AnalogueSilent => is_of_lines,
        Kind::ArrayLate => of.kind == Kind::JointStale,
        Kind::HandSilent => matches!(of.kind, Kind::FingerSilent | Kind::HandError | Kind::JointStale),
        _ => false,
    }
}
