//! What a uSkin board on an MTB is sent: a start, and each start makes one sweep.

use crate::protocol::commands::{BoardCommand, Sequences, Step};
use crate::protocol::mtb::MtbCommand;

/// Least time between two commands to a uSkin board.
const GAP_NS: u64 = 2_000_000;

pub(super) fn sequences(address: u8) -> Sequences {
    let step = |command| Step {
        command: BoardCommand::Mtb(command),
        pause_ns: GAP_NS,
    };
    let go = step(MtbCommand::start(address));
    Sequences {
        start: vec![go],
        wake: vec![go],
        ask: Vec::new(),
        grace_ns: 0,
        stop: vec![step(MtbCommand::stop(address))],
        gap_ns: GAP_NS,
        silence_ns: 0,
        triggered: true,
    }
}
