//! The little that is ever written to a servo, and only if the configuration allows it.

use crate::registers::address;

/// What a servo can be told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WriteCommand {
    /// Switch the motor on or off. Before it is switched on, the servo's bus watchdog is armed: a servo that hears
    /// nothing for the configured time stops its motor and refuses goals until torque is enabled anew.
    Torque(bool),
    /// Goal PWM (address 100), counts of 0.113 %, -885 to 885.
    GoalPwm(i16),
}

/// Why a command was not taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum WriteRefused {
    /// The configuration is read-only.
    #[error("joints are read-only; set joints.allow_writes = true to let torque and PWM be written")]
    ReadOnly,
    /// No servo of this index.
    #[error("there is no joint {0}")]
    NoSuchJoint(usize),
    /// Out of range.
    #[error("goal PWM {0} is outside -885 to 885")]
    Range(i16),
    /// Too many commands wait.
    #[error("{0} commands wait to be sent; the bus is slower than they come, or away")]
    QueueFull(usize),
}

impl WriteCommand {
    /// Refuses a joint that is not there and a value that cannot be.
    pub(crate) fn check(self, joint: usize, joints: usize) -> Result<(), WriteRefused> {
        if joint >= joints {
            return Err(WriteRefused::NoSuchJoint(joint));
        }
        match self {
            WriteCommand::GoalPwm(counts) if !(-PWM_COUNTS..=PWM_COUNTS).contains(&counts) => {
                Err(WriteRefused::Range(counts))
            }
            _ => Ok(()),
        }
    }
}

/// Goal PWM's largest count.
const PWM_COUNTS: i16 = 885;
/// Most writes that wait.
pub(crate) const QUEUE: usize = 256;

/// One write to one servo.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Write {
    pub(crate) servo: usize,
    pub(crate) address: u16,
    pub(crate) data: [u8; 2],
    pub(crate) len: usize,
}

impl Write {
    fn byte(servo: usize, address: u16, value: u8) -> Self {
        Self {
            servo,
            address,
            data: [value, 0],
            len: 1,
        }
    }

    /// The writes that a command takes, in order; a watchdog that has tripped is cleared before it is armed.
    pub(crate) fn of(servo: usize, command: WriteCommand, watchdog_steps: u8) -> impl Iterator<Item = Write> {
        let writes = match command {
            WriteCommand::Torque(true) => [
                Some(Self::byte(servo, address::BUS_WATCHDOG, 0)),
                Some(Self::byte(servo, address::BUS_WATCHDOG, watchdog_steps)),
                Some(Self::byte(servo, address::TORQUE_ENABLE, 1)),
            ],
            WriteCommand::Torque(false) => [
                Some(Self::byte(servo, address::TORQUE_ENABLE, 0)),
                Some(Self::byte(servo, address::BUS_WATCHDOG, 0)),
                None,
            ],
            WriteCommand::GoalPwm(counts) => [
                Some(Self {
                    servo,
                    address: address::GOAL_PWM,
                    data: counts.to_le_bytes(),
                    len: 2,
                }),
                None,
                None,
            ],
        };
        writes.into_iter().flatten()
    }
}
