//! What each kind of board is sent to start, wake and stop it: short lists of frames with pauses.

use crate::Wiring;
use crate::protocol::cyskin::{CyskinPacket, CyskinSetup, cyskin_frames};
use crate::protocol::icub::IcubSetup;
use crate::protocol::mtb::MtbCommand;
use taxel_can::CanFrame;

/// Least time between two commands to a uSkin board.
const USKIN_GAP_NS: u64 = 2_000_000;
/// Least time between two commands to an iCub board (protocols.md 1.4).
const ICUB_GAP_NS: u64 = 10_000_000;
/// Pause after the triangles of an iCub board were configured: they are calibrated.
const ICUB_CALIBRATION_NS: u64 = 500_000_000;
/// An iCub board is asked so often whether it is there while it is configured, until it answers. With the start at the
/// end of the pause that leaves room in its receive buffer of five (protocols.md 1.9).
const QUESTIONS: u64 = 3;
/// How long after its answer an iCub board is given to be heard by itself, beyond its period; and at most at all.
const GRACE_NS: u64 = 20_000_000;
const LONGEST_GRACE_NS: u64 = 100_000_000;
/// What is asked for in a question; every board answers, whatever its own version.
const CAN_PROTOCOL: [u8; 2] = [1, 0];
/// A board that was told to start is given at least so many of its periods to be heard.
const PERIODS: u64 = 3;
/// CySkin's usual period is 50 ms.
const CYSKIN_SILENCE_NS: u64 = 150_000_000;

/// What can be sent to a board. Neither variant can be a class-7 frame: an MTB command is of class 2 by construction,
/// and a hub's frames have extended ids, which no MTB takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Order {
    Mtb(MtbCommand),
    Hub(HubFrame),
}

/// A frame with an extended id.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct HubFrame(CanFrame);

impl Order {
    pub(crate) fn frame(&self) -> CanFrame {
        match self {
            Order::Mtb(command) => command.frame(),
            Order::Hub(HubFrame(frame)) => *frame,
        }
    }

    /// Whether it is for the MTB of this address.
    pub(crate) fn is_to(&self, address: u8) -> bool {
        matches!(self, Order::Mtb(command) if command.address() == address)
    }

    /// Whether it only asks who is there.
    pub(crate) fn is_question(&self) -> bool {
        matches!(self, Order::Mtb(command) if command.is_question())
    }
}

/// An order, and how long nothing else is sent to the board after it while the sequence goes on.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Step {
    pub(crate) order: Order,
    pub(crate) pause_ns: u64,
}

/// The sequences of one board.
#[derive(Debug, Clone)]
pub(crate) struct Sequences {
    /// From power-up to sending. Questions in it are left out once the board has answered.
    pub(crate) start: Vec<Step>,
    /// For a board that was started and fell silent; tried once before it is started from the beginning, since
    /// configuration calibrates the skin and so loses what touches it.
    pub(crate) wake: Vec<Step>,
    /// Whether a silent board is there at all; empty where it cannot be asked. Starting an iCub board takes more than half a
    /// second, so one without power would often come back in the middle of it and hear only its end.
    pub(crate) ask: Vec<Step>,
    /// How long after its answer it is configured anew, unless it is heard.
    pub(crate) grace_ns: u64,
    pub(crate) stop: Vec<Step>,
    /// Least time between two commands that are not of one sequence.
    pub(crate) gap_ns: u64,
    /// The board's own reason to be silent for a while.
    pub(crate) silence_ns: u64,
    /// Whether each start makes one sweep.
    pub(crate) triggered: bool,
}

impl Sequences {
    /// Of an MTB; an iCub's has these triangles, a bit each.
    pub(crate) fn of_mtb(wiring: &Wiring, triangles: u16) -> Self {
        let address = wiring.board;
        let step = |command, pause_ns| Step {
            order: Order::Mtb(command),
            pause_ns,
        };
        let gap_ns = if wiring.icub.is_some() {
            ICUB_GAP_NS
        } else {
            USKIN_GAP_NS
        };
        let go = step(MtbCommand::tx_mode(address, false), gap_ns);
        let ask = step(MtbCommand::firmware_version(address, CAN_PROTOCOL), gap_ns);
        let Some(setup) = &wiring.icub else {
            return Self {
                start: vec![go],
                wake: vec![go],
                ask: Vec::new(),
                grace_ns: 0,
                stop: vec![step(MtbCommand::tx_mode(address, true), gap_ns)],
                gap_ns,
                silence_ns: 0,
                triggered: true,
            };
        };
        let mut start = vec![ask];
        let commands = configuration(address, triangles, setup);
        start.extend(commands.into_iter().map(|command| step(command, gap_ns)));
        let part_ns = ICUB_CALIBRATION_NS / QUESTIONS;
        if let Some(last) = start.last_mut() {
            last.pause_ns = part_ns;
        }
        for _ in 2..QUESTIONS {
            start.push(Step {
                pause_ns: part_ns,
                ..ask
            });
        }
        let left_ns = ICUB_CALIBRATION_NS - (QUESTIONS - 1) * part_ns;
        start.push(Step {
            pause_ns: left_ns,
            ..ask
        });
        start.push(go);
        let period_ns = u64::from(setup.period_ms) * 1_000_000;
        Self {
            start,
            wake: vec![go, ask],
            ask: vec![ask],
            grace_ns: (period_ns + GRACE_NS).min(LONGEST_GRACE_NS),
            stop: vec![step(MtbCommand::tx_mode(address, true), gap_ns)],
            gap_ns,
            silence_ns: PERIODS * period_ns,
            triggered: false,
        }
    }

    /// Of a CySkin hub; as the layout file has them.
    pub(crate) fn of_hub(setup: &CyskinSetup, address: u32) -> Self {
        let steps = |packets: &[CyskinPacket]| -> Vec<Step> {
            packets
                .iter()
                .flat_map(|packet| {
                    let frames = cyskin_frames(setup, address, packet.command, &packet.data)
                        .expect("the layout file's packets were checked");
                    frames.into_iter().map(|frame| Step {
                        order: Order::Hub(HubFrame(frame)),
                        pause_ns: packet.pause_ms * 1_000_000,
                    })
                })
                .collect()
        };
        let start = steps(&setup.start);
        Self {
            wake: start.clone(),
            start,
            ask: Vec::new(),
            grace_ns: 0,
            stop: steps(&setup.stop),
            gap_ns: ICUB_GAP_NS,
            silence_ns: CYSKIN_SILENCE_NS,
            triggered: false,
        }
    }
}

/// The commands that configure an iCub board: the board, which switches all triangles off; all of them off once more,
/// as the official example does; then each run of triangles that the layout has (bits of `triangles`) on.
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
