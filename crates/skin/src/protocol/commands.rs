//! What boards can be sent to start, wake and stop them: short lists of commands with pauses.

use super::mtb::MtbCommand;
use taxel_can::CanFrame;

/// What a board is told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TxMode {
    /// Send sweeps: `20b#0700`, and before it whatever the board has to be told first.
    Start,
    /// Send nothing: `20b#0701`.
    Stop,
}

/// What can be sent to a board. Neither variant can be a class-7 frame: an MTB command is of class
/// 2 by construction, and a hub's frames have extended ids or are of class 5, which no MTB takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum BoardCommand {
    Mtb(MtbCommand),
    Hub(HubFrame),
}

/// A frame with an extended id, or a standard one from 0x500 to 0x5FF: a CySkin packet in one frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct HubFrame(CanFrame);

impl HubFrame {
    /// `None` for a frame with another standard id.
    pub(crate) fn new(frame: CanFrame) -> Option<Self> {
        let of_class_5 = frame.standard_id().is_some_and(|id| id & 0x700 == 0x500);
        (frame.is_extended() || of_class_5).then_some(Self(frame))
    }
}

impl BoardCommand {
    pub(crate) fn frame(&self) -> CanFrame {
        match self {
            BoardCommand::Mtb(command) => command.frame(),
            BoardCommand::Hub(HubFrame(frame)) => *frame,
        }
    }

    /// Whether it is for the MTB of this address.
    pub(crate) fn is_to(&self, address: u8) -> bool {
        matches!(self, BoardCommand::Mtb(command) if command.address() == address)
    }

    /// Whether it only asks who is there.
    pub(crate) fn is_question(&self) -> bool {
        matches!(self, BoardCommand::Mtb(command) if command.is_question())
    }
}

/// A command, and how long nothing else is sent to the board after it while the sequence goes on.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Step {
    pub(crate) command: BoardCommand,
    pub(crate) pause_ns: u64,
}

/// The sequences of one board.
#[derive(Debug, Clone)]
pub(crate) struct Sequences {
    /// From power-up to sending. Questions in it are left out once the board has answered.
    pub(crate) start: Vec<Step>,
    /// For a board that was started and fell silent; tried once before it is started from the
    /// beginning, since configuration calibrates the skin and so loses what touches it.
    pub(crate) wake: Vec<Step>,
    /// Whether a silent board is there at all; empty where it cannot be asked. Starting an iCub
    /// board takes more than half a second, so one without power would often come back in the
    /// middle of it and hear only its end.
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
