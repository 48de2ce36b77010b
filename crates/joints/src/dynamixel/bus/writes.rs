//! The little that is ever written to a servo, and only if the configuration allows it.

use crate::dynamixel::protocol2::StatusError;
use crate::dynamixel::registers::address;

/// What a servo can be told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WriteCommand {
    /// Switch the motor on or off. Before it is switched on, it is switched off and the servo's bus watchdog is armed, so
    /// that no motor ever runs without one: a servo that hears nothing for the configured time stops its motor and refuses
    /// goals until torque is enabled anew.
    Torque(bool),
    /// The same as `Torque(true)` with this goal PWM, written before the motor is switched on: from the factory a servo
    /// in PWM mode would begin with all that its PWM Limit allows.
    Start(i16),
    /// Goal PWM (address 100), counts of 0.113 %, -885 to 885, in the servo's own direction; only
    /// of a motor that was switched on with `Torque`, so that its watchdog is armed.
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
    /// One joint twice in a command to several.
    #[error("it is named twice in one request")]
    Twice(usize),
    /// A goal for a motor that was not switched on here, whose watchdog is not armed therefore.
    #[error("its motor was not switched on here; enable its torque first, which arms its watchdog")]
    MotorOff(usize),
    /// A goal for a motor that was switched on here and is so no longer.
    #[error("{lost}; enable its torque anew")]
    MotorLost {
        /// Which joint's.
        joint: usize,
        /// What happened to it.
        lost: MotorLost,
    },
    /// Two servos have answered with its id within the last seconds: both would turn. To switch its motor off, or to give it
    /// the goal 0, is not refused.
    #[error(
        "two servos answer with its id, and both would turn: unplug one and give it an id of its own; torque off goes to both"
    )]
    TwoServos(usize),
    /// The port is away, or not open yet.
    #[error("the port of the servos is not open; ask again once `taxel status` shows it connected")]
    NoPort,
    /// Too many commands wait.
    #[error("{0} commands wait to be sent; the bus is slower than they come, or away")]
    QueueFull(usize),
}

impl WriteRefused {
    /// Whether it is for another joint's motor that goals of several are refused.
    pub fn is_of_another(self, joint: usize) -> bool {
        match self {
            Self::MotorOff(other) | Self::TwoServos(other) | Self::MotorLost { joint: other, .. } => {
                other != joint
            }
            _ => false,
        }
    }
}

/// How a motor was lost that was switched on here, or by a daemon before.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum MotorLost {
    /// Its servo's bus watchdog (address 98) was no longer what it had been armed with, but 0 as behind a restart; so the
    /// motor is switched off.
    #[error("its servo has restarted and forgotten its bus watchdog, so that its motor is switched off")]
    Restarted,
    /// It was something else, which another program has written; so the motor is switched off.
    #[error(
        "another program has set its servo's bus watchdog to {watchdog} (address 98), where taxeld had {armed}, so that its motor is switched off"
    )]
    Meddled {
        /// What the servo says.
        watchdog: u8,
        /// What it was armed with.
        armed: u8,
    },
    /// Its Torque Enable (address 64) is 0, and nobody has asked for that here.
    #[error("its motor has gone off by itself, without being told to here")]
    GoneOff,
    /// It was on, under an armed bus watchdog, when the port was opened, and was not switched on here; so it is switched off,
    /// once.
    #[error(
        "its motor was left on by a taxeld that was killed, or by another program, so that it is switched off"
    )]
    LeftOn,
}

/// Why a servo did not do what it was told.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum WriteError {
    /// No answer.
    #[error("the servo does not answer: check its power and cable")]
    Silent,
    /// The answer had a wrong CRC, so that nobody knows what it said.
    #[error("the servo's answer came damaged: check its cable, and tell it again")]
    Damaged,
    /// It says no when it is asked what it holds.
    #[error("the servo refuses to say what it holds: {0}")]
    Servo(StatusError),
    /// It answers, and holds something else than it was told.
    #[error(
        "the servo has not taken it. A goal beyond its PWM Limit is refused, and any after its watchdog has stopped it until torque is enabled anew"
    )]
    NotHeld,
    /// It has no bus watchdog, or does not arm it: its motor stays off. X servos have it from firmware 38 on (ROBOTIS
    /// e-manual, Bus Watchdog).
    #[error(
        "the servo does not arm its bus watchdog, without which no motor is switched on here; X servos have one from firmware 38 on, DYNAMIXEL Wizard updates it"
    )]
    NoWatchdog,
    /// It was told to switch its motor on, and says that it is off.
    #[error(
        "the servo keeps its motor off, as after a hardware error (overload, heat) until it is rebooted: `taxel status` tells"
    )]
    StillOff,
    /// It was told to switch its motor off, and says that it is on.
    #[error("the servo says that its motor is still on")]
    StillOn,
    /// Not taken at all.
    #[error(transparent)]
    NotTaken(WriteRefused),
    /// Its motor was switched off since.
    #[error("its motor was switched off since, by another request")]
    SwitchedOff,
    /// The port was lost before all of it was confirmed. Some may have been sent.
    #[error("the port was lost before the servo confirmed it")]
    PortLost,
    /// Nobody knows yet.
    #[error(
        "it was not confirmed in time, and may still be done: the bus is slow, a servo on it is silent or its port hangs, as `taxel status` tells"
    )]
    Unconfirmed,
}

/// What became of a command to a servo.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Written {
    /// The number that [`crate::ServoReader::command`] gave it.
    pub number: u64,
    /// Whether the servo has confirmed all of it.
    pub result: Result<(), WriteError>,
}

impl WriteCommand {
    /// Full PWM in one direction, counts.
    pub const PWM_COUNTS: i16 = 885;

    /// Refuses a joint that is not there and a value that cannot be.
    pub(crate) fn check(self, joint: usize, joints: usize) -> Result<(), WriteRefused> {
        if joint >= joints {
            return Err(WriteRefused::NoSuchJoint(joint));
        }
        match self {
            WriteCommand::GoalPwm(counts) | WriteCommand::Start(counts)
                if !(-Self::PWM_COUNTS..=Self::PWM_COUNTS).contains(&counts) =>
            {
                Err(WriteRefused::Range(counts))
            }
            _ => Ok(()),
        }
    }
}

/// Refuses goals (counts) for several of so many joints of which one cannot be, or that name a joint twice.
pub fn check_goals(
    goals: impl Iterator<Item = (usize, i16)> + Clone,
    joints: usize,
) -> Result<(), WriteRefused> {
    for (i, (joint, counts)) in goals.clone().enumerate() {
        WriteCommand::GoalPwm(counts).check(joint, joints)?;
        if goals.clone().take(i).any(|(other, _)| other == joint) {
            return Err(WriteRefused::Twice(joint));
        }
    }
    Ok(())
}

/// Most writes that a command takes.
pub(crate) const WRITES_PER_COMMAND: usize = 5;
/// Most writes that wait.
pub(crate) const QUEUE: usize = 256;

/// One write to one servo.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Write {
    pub(crate) servo: usize,
    pub(crate) address: u16,
    pub(crate) data: [u8; 2],
    pub(crate) len: usize,
    /// Of which command it is, and whether that is done with it.
    pub(crate) number: u64,
    pub(crate) last: bool,
    /// Whether it goes before everything else.
    pub(crate) urgent: bool,
    /// Whether it was sent: from here on its servo may hold it.
    pub(crate) is_sent: bool,
    /// How often that was in vain.
    pub(crate) tries: u32,
}

impl Write {
    fn new<const N: usize>(servo: usize, address: u16, value: [u8; N]) -> Self {
        let mut data = [0; 2];
        data[..N].copy_from_slice(&value);
        Self {
            servo,
            address,
            data,
            len: N,
            number: 0,
            last: false,
            urgent: false,
            is_sent: false,
            tries: 0,
        }
    }

    /// Whether a motor may turn by it.
    pub(crate) fn moves(&self) -> bool {
        self.address == address::GOAL_PWM || self.is_motor_on()
    }

    /// Whether it switches a motor on.
    pub(crate) fn is_motor_on(&self) -> bool {
        self.address == address::TORQUE_ENABLE && self.data[0] != 0
    }

    /// Whether it arms a watchdog.
    pub(crate) fn is_arming(&self) -> bool {
        self.address == address::BUS_WATCHDOG && self.data[0] != 0
    }

    /// Whether it is a goal for a motor that is on, and not the first of a start.
    pub(crate) fn is_goal(&self) -> bool {
        self.address == address::GOAL_PWM && self.last
    }

    /// Whether it is told in one packet with `first`: goals that are given together, and what has several motors switched off,
    /// or clears their watchdogs, that was not in vain yet.
    pub(crate) fn is_told_with(&self, first: &Write) -> bool {
        let is_together = match self.urgent {
            true => self.tries == 0 && first.tries == 0,
            false => self.address == address::GOAL_PWM && self.number == first.number && self.number != 0,
        };
        is_together && self.address == first.address && self.urgent == first.urgent
    }

    /// Whether it switches a motor off.
    pub(crate) fn is_motor_off(&self) -> bool {
        self.address == address::TORQUE_ENABLE && self.data[0] == 0
    }

    /// Whether it is the one by which a motor that is to be off is switched off, and not the first of those that start one.
    pub(crate) fn switches_off(&self) -> bool {
        self.urgent && self.is_motor_off()
    }

    /// What is wrong where its servo answers and holds something else.
    pub(crate) fn not_held(&self) -> WriteError {
        match self.address {
            address::TORQUE_ENABLE if self.is_motor_off() => WriteError::StillOn,
            address::TORQUE_ENABLE => WriteError::StillOff,
            address::BUS_WATCHDOG => WriteError::NoWatchdog,
            _ => WriteError::NotHeld,
        }
    }

    /// Clears the watchdog of a motor that is off, or nobody's here.
    pub(crate) fn disarming(servo: usize) -> Self {
        Self {
            last: true,
            urgent: true,
            ..Self::new(servo, address::BUS_WATCHDOG, [0])
        }
    }

    /// Whether it does no more than that: nobody is told what becomes of it.
    pub(crate) fn only_disarms(&self) -> bool {
        self.urgent && !self.is_motor_off()
    }

    /// The writes that a command takes, in order. A watchdog that has tripped is cleared before it is armed, and meanwhile
    /// watches nothing; so the motor is off until then, whichever of the writes is the last that is sent.
    pub(crate) fn of(
        servo: usize,
        command: WriteCommand,
        watchdog_steps: u8,
        number: u64,
    ) -> impl Iterator<Item = Write> {
        let torque = |on: u8| Some(Self::new(servo, address::TORQUE_ENABLE, [on]));
        let watchdog = |steps: u8| Some(Self::new(servo, address::BUS_WATCHDOG, [steps]));
        let pwm = |counts: i16| Some(Self::new(servo, address::GOAL_PWM, counts.to_le_bytes()));
        let starting = |goal| [torque(0), watchdog(0), watchdog(watchdog_steps), goal, torque(1)];
        let writes: [_; WRITES_PER_COMMAND] = match command {
            WriteCommand::Torque(true) => starting(None),
            WriteCommand::Start(counts) => starting(pwm(counts)),
            // Its watchdog is cleared once it says that it is off.
            WriteCommand::Torque(false) => [torque(0), None, None, None, None],
            WriteCommand::GoalPwm(counts) => [pwm(counts), None, None, None, None],
        };
        let count = writes.iter().flatten().count();
        (writes.into_iter().flatten().enumerate()).map(move |(i, write)| Write {
            number,
            last: i + 1 == count,
            urgent: command == WriteCommand::Torque(false),
            ..write
        })
    }
}
