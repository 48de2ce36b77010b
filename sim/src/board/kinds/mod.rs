//! The list of the kinds of boards that are simulated.

mod cpm_finger;
mod cyskin;
mod icub;
mod pressure_array;
mod uskin;

use super::firmware::BoardSimulation;
use crate::levels::{Axis, Levels, Nature};
use taxel_skin::Protocol;

/// Each protocol that boards speak, with what is simulated of them.
const KINDS: &[(Protocol, &dyn BoardSimulation)] = &[
    (Protocol::USKIN_L1, &uskin::L1),
    (Protocol::USKIN_L2, &uskin::L2),
    (Protocol::USKIN_L3, &uskin::L3),
    (Protocol::ICUB_MTB3, &icub::MTB3),
    (Protocol::ICUB_MTB4, &icub::MTB4),
    (Protocol::CYSKIN, &cyskin::Cyskin),
    (Protocol::CPM_FINGER, &cpm_finger::CpmFinger),
    (Protocol::PRESSURE_ARRAY, &pressure_array::PressureArray),
];

/// Counts that a newton moves z of a CySkin-type sensor by. No source says; an assumption, as are
/// the levels below.
const COUNTS_PER_NEWTON: f64 = 2000.0;
/// Idle level and noise deviation of CySkin-type sensors.
const CAPACITANCE: Axis = Axis {
    idle: [20_000.0, 26_000.0],
    sd: [5.0, 12.0],
};

/// What CySkin-type sensors read, of one axis and 16 bits.
fn one_axis_nature(levels: Levels) -> Nature {
    Nature::of_one_axis(levels, CAPACITANCE, COUNTS_PER_NEWTON, 1.0)
}

/// The simulation of boards that speak a protocol; `None` for an array without a board.
pub(super) fn kind_of(protocol: Protocol) -> Option<&'static dyn BoardSimulation> {
    let kind = KINDS.iter().find(|(of, _)| *of == protocol);
    kind.map(|(_, kind)| *kind)
}

/// What the taxels of boards that speak a protocol read; `None` for an array without a board.
pub(crate) fn nature_of(protocol: Protocol, levels: Levels) -> Option<Nature> {
    kind_of(protocol).map(|kind| kind.nature(levels))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_board_that_is_read_is_simulated() {
        for protocol in Protocol::boards() {
            assert!(kind_of(protocol).is_some(), "{protocol:?}");
        }
    }
}
