//! How an iCub board is configured and started (docs/protocols.md, "MTB commands").

use super::setup::IcubSetup;
use crate::protocol::commands::{BoardCommand, Sequences, Step};
use crate::protocol::mtb::MtbCommand;

/// Least time between two commands to an iCub board (docs/protocols.md, "MTB commands").
const GAP_NS: u64 = 10_000_000;
/// Pause after the triangles of an iCub board were configured: they are calibrated.
const CALIBRATION_NS: u64 = ICUB_CALIBRATION_MS * 1_000_000;
/// The same in milliseconds.
pub const ICUB_CALIBRATION_MS: u64 = 500;
/// While it is configured, a board is asked this often whether it is there, until it answers. With
/// the start at the end of the pause that leaves room in its receive buffer of five
/// (docs/protocols.md, "MTB3 firmware").
const QUESTIONS: u64 = 3;
/// How long after its answer a board is given to be heard by itself, beyond its period; and at most at all.
const GRACE_NS: u64 = 20_000_000;
const LONGEST_GRACE_NS: u64 = 100_000_000;
/// What is asked for in a question; every board answers, whatever its own version.
const CAN_PROTOCOL: [u8; 2] = [1, 0];
/// A board that was told to start is given at least this many of its periods to be heard.
const PERIODS: u64 = 3;

/// What a board with these triangles, a bit each, is sent.
pub(super) fn sequences(address: u8, setup: &IcubSetup, triangles: u16) -> Sequences {
    let step = |command, pause_ns| Step {
        command: BoardCommand::Mtb(command),
        pause_ns,
    };
    let go = step(MtbCommand::start(address), GAP_NS);
    let ask = step(MtbCommand::firmware_version(address, CAN_PROTOCOL), GAP_NS);
    let mut start = vec![ask];
    let commands = configuration(address, triangles, setup);
    start.extend(commands.into_iter().map(|command| step(command, GAP_NS)));
    let part_ns = CALIBRATION_NS / QUESTIONS;
    if let Some(last) = start.last_mut() {
        last.pause_ns = part_ns;
    }
    for _ in 2..QUESTIONS {
        start.push(Step {
            pause_ns: part_ns,
            ..ask
        });
    }
    let left_ns = CALIBRATION_NS - (QUESTIONS - 1) * part_ns;
    start.push(Step {
        pause_ns: left_ns,
        ..ask
    });
    start.push(go);
    let period_ns = u64::from(setup.period_ms) * 1_000_000;
    Sequences {
        start,
        wake: vec![go, ask],
        ask: vec![ask],
        grace_ns: (period_ns + GRACE_NS).min(LONGEST_GRACE_NS),
        stop: vec![step(MtbCommand::stop(address), GAP_NS)],
        gap_ns: GAP_NS,
        silence_ns: PERIODS * period_ns,
        triggered: false,
    }
}

/// The commands that configure an iCub board of which nothing is known: the values of [`IcubSetup::default`], and all
/// sixteen triangles on. [`ICUB_CALIBRATION_MS`] later it can be started.
pub fn icub_configuration(address: u8) -> Vec<MtbCommand> {
    configuration(address, u16::MAX, &IcubSetup::default())
}

/// The commands that configure an iCub board: the board, which switches all triangles off; all of
/// them off once more, as the official example does; then each run of triangles that the layout has
/// (bits of `triangles`) on.
///
/// Configuring triangles stops transmission, so what follows must end with a start.
fn configuration(address: u8, triangles: u16, setup: &IcubSetup) -> Vec<MtbCommand> {
    let mut commands = vec![
        MtbCommand::board_config(address, setup),
        MtbCommand::triangle_config(address, [0, 15], false, setup),
    ];
    let has = |triangle: u8| triangle < 16 && triangles >> triangle & 1 == 1;
    let mut triangle = 0;
    while triangle < 16 {
        if !has(triangle) {
            triangle += 1;
            continue;
        }
        let first = triangle;
        while has(triangle) {
            triangle += 1;
        }
        commands.push(MtbCommand::triangle_config(
            address,
            [first, triangle - 1],
            true,
            setup,
        ));
    }
    commands
}
