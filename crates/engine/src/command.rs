//! What an engine has sent on a bus.

use taxel_can::CanFrame;
use taxel_joints::JointCommand;

/// A frame to be sent on a bus: to a board of the skin, or to a source of joint angles.
#[derive(Debug, Clone, Copy)]
pub struct Command {
    /// Number of the bus.
    pub bus: u8,
    /// What to send.
    pub frame: CanFrame,
    origin: Origin,
}

/// Who is to be told if it could not be sent.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Origin {
    Board(taxel_skin::OutgoingCommand),
    Joint(JointCommand),
}

impl Command {
    pub(crate) fn of_board(command: taxel_skin::OutgoingCommand) -> Self {
        Self {
            bus: command.bus,
            frame: command.frame(),
            origin: Origin::Board(command),
        }
    }

    pub(crate) fn of_joint(command: JointCommand) -> Self {
        Self {
            bus: command.bus,
            frame: command.frame,
            origin: Origin::Joint(command),
        }
    }

    pub(crate) fn origin(&self) -> &Origin {
        &self.origin
    }
}
