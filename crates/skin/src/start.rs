//! What each kind of board is sent to start, wake and stop it: short lists of frames with pauses.

use crate::protocol::cyskin::{CyskinPacket, CyskinSetup, cyskin_frames};
use crate::protocol::icub::IcubSetup;
use crate::protocol::mtb::MtbCommand;
use crate::{Layout, Module};
use taxel_can::CanFrame;

/// Least time between two commands to a uSkin board.
const USKIN_GAP_NS: u64 = 2_000_000;
/// Least time between two commands to an iCub board (protocols.md 1.4).
const ICUB_GAP_NS: u64 = 10_000_000;
/// Pause after the triangles of an iCub board were configured: they are calibrated.
const ICUB_CALIBRATION_NS: u64 = 500_000_000;
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
    /// From power-up to sending.
    pub(crate) start: Vec<Step>,
    /// For a board that was started and fell silent; tried once before it is started from the beginning, since
    /// configuration calibrates the skin and so loses what touches it.
    pub(crate) wake: Vec<Step>,
    pub(crate) stop: Vec<Step>,
    /// Least time between two commands that are not of one sequence.
    pub(crate) gap_ns: u64,
    /// The board's own reason to be silent for a while.
    pub(crate) silence_ns: u64,
    /// Whether each start makes one sweep.
    pub(crate) triggered: bool,
}

impl Sequences {
    /// Of the MTB of a module.
    pub(crate) fn of_mtb(layout: &Layout, module: &Module) -> Self {
        let address = module.board;
        let step = |command, pause_ns| Step {
            order: Order::Mtb(command),
            pause_ns,
        };
        let gap_ns = if module.icub.is_some() {
            ICUB_GAP_NS
        } else {
            USKIN_GAP_NS
        };
        let go = step(MtbCommand::tx_mode(address, false), gap_ns);
        let mut start = match &module.icub {
            Some(setup) => configuration(address, layout.triangles(module), setup)
                .into_iter()
                .map(|command| step(command, gap_ns))
                .collect(),
            None => Vec::new(),
        };
        if let Some(last) = start.last_mut() {
            last.pause_ns = ICUB_CALIBRATION_NS;
        }
        start.push(go);
        Self {
            start,
            wake: vec![go],
            stop: vec![step(MtbCommand::tx_mode(address, true), gap_ns)],
            gap_ns,
            silence_ns: module
                .icub
                .map_or(0, |setup| PERIODS * u64::from(setup.period_ms) * 1_000_000),
            triggered: module.icub.is_none(),
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
