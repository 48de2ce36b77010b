//! Servos that a thread reads: what is known of them, and what they are told.

use super::servo_thread::Thread;
use super::shared_servos::{ServoSnapshot, Shared};
use crate::dynamixel::bus::{
    Bus, MotorOff, Outcomes, ServoState, WriteCommand, WriteError, WriteRefused, check_goals,
};
use crate::dynamixel::config::{DynamixelConfig, READINGS_KEPT};
use crate::dynamixel::registers::HardwareError;
use crate::serial::{
    PortState, PortStatus, ReadingThread, ReadingThreadError, StartError, history_since, lock,
};
use crate::synchrony::JointHistory;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};

/// Reads servos on a serial port in a thread of its own, for ever: a port that goes away is opened again.
///
/// Nothing here waits for the thread longer than it takes to copy a few hundred bytes, and nothing
/// allocates per cycle. Dropping it ends the thread, as [`ServoReader::stop`] does, and waits for that, but not for ever.
#[derive(Debug)]
pub struct ServoReader {
    shared: Arc<Mutex<Shared>>,
    /// Cycles whose readings are in the history. It grows while `shared` is locked.
    published: Arc<AtomicU64>,
    /// What the thread has done on the bus.
    steps: Arc<AtomicU64>,
    /// Whether a command waits that is not to wait for the end of the cycle.
    urgent: Arc<AtomicBool>,
    thread: ReadingThread,
    names: Vec<String>,
    allow_writes: bool,
}

/// Most commands that wait for the thread.
const COMMANDS: usize = 64;

impl ServoReader {
    /// Starts the thread. A port that is not there yet is no error: it is opened when it comes.
    pub fn start(config: &DynamixelConfig) -> Result<Self, StartError> {
        Self::start_with(config, || {})
    }

    /// The same, and the thread calls `first` before anything else: to take a real-time priority,
    /// for example.
    pub fn start_with(
        config: &DynamixelConfig,
        first: impl FnOnce() + Send + 'static,
    ) -> Result<Self, StartError> {
        config.check()?;
        let bus = Bus::new(config);
        let n = config.servo.len();
        let shared = Arc::new(Mutex::new(Shared {
            snapshot: ServoSnapshot {
                results: bus.results().to_vec(),
                servos: vec![ServoState::default(); n],
                counters: bus.counters(),
                fast: bus.fast_state(),
            },
            history: JointHistory::new(n, READINGS_KEPT),
            port: PortStatus::starting(config.path.clone()),
            commands: Vec::with_capacity(COMMANDS + 2 * n),
            numbers: 0,
            outcomes: Outcomes::new(),
        }));
        let urgent = Arc::new(AtomicBool::new(false));
        let stop = Arc::new(AtomicBool::new(false));
        let published = Arc::new(AtomicU64::new(0));
        let steps = Arc::new(AtomicU64::new(0));
        let thread = Thread {
            bus,
            path: config.path.clone(),
            baud: config.baud,
            margin_ns: config.answer_margin_ms.map(|ms| (ms * 1e6) as u64),
            period_ns: (1e9 / config.rate_hz) as u64,
            shared: shared.clone(),
            published: published.clone(),
            steps: steps.clone(),
            stop: stop.clone(),
            urgent: urgent.clone(),
            commands: Vec::with_capacity(COMMANDS + 2 * n),
        };
        Ok(Self {
            shared,
            published,
            steps,
            urgent,
            thread: ReadingThread::start("joints", stop, first, move || thread.run())?,
            names: config.joint_names(),
            allow_writes: config.allow_writes,
        })
    }

    /// Has the thread end, and does not wait: motors it has switched on are switched off, and nothing else is obeyed.
    pub fn stop(&self) {
        self.thread.stop();
    }

    /// Does so and waits until the thread has ended. It is not waited for for ever: a serial driver that does not return from a
    /// call keeps it.
    pub fn end(&self) -> Result<(), ReadingThreadError> {
        self.thread.end()
    }

    /// Grows with each request to the bus and each answer, and with each port that is tried: where it stands for longer than a
    /// request can take, the thread hangs, as in a serial driver that does not return.
    pub fn steps(&self) -> u64 {
        self.steps.load(Ordering::Relaxed)
    }

    /// Names of the joints, in the order of everything else.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// A copy of the newest cycle and of what is known of the servos.
    pub fn snapshot(&self) -> ServoSnapshot {
        lock(&self.shared).snapshot.clone()
    }

    /// Copies the readings that are kept, if there were cycles after the first `seen` of them.
    /// Returns how many cycles they are of, which is `seen` where nothing was copied. Never waits:
    /// while the thread is at its readings nothing is copied. Allocates nothing where `into` has
    /// the memory for them ([`crate::SourceConfig::readings_kept`]).
    pub fn try_history_since(&self, seen: u64, into: &mut JointHistory) -> u64 {
        history_since(
            &self.shared,
            &self.published,
            |shared| &shared.history,
            seen,
            into,
        )
    }

    /// What is known of the serial port.
    pub fn port(&self) -> PortStatus {
        PortStatus {
            abandoned: self.thread.has_panicked(),
            ..lock(&self.shared).port.clone()
        }
    }

    /// Has a servo told something after the next cycle; refused unless the configuration allows
    /// writing, and while the port is not open. Commands that wait when the port is lost are forgotten. Returns the
    /// number under which [`ServoReader::outcome`] tells what became of it.
    ///
    /// That a motor is switched off is never refused for want of room, and waits for nothing but the request that is
    /// out: it goes before other commands and readings, and what else that servo was to be told is forgotten. Only where its servo
    /// was told so before, and nothing since by which it may run, it takes turns with them. It is taken
    /// while a port is away that was open before, and until the servo confirms it, it is sent again and again
    /// ([`MotorOff::unconfirmed`]).
    pub fn command(&self, joint: usize, command: WriteCommand) -> Result<u64, WriteRefused> {
        if !self.allow_writes {
            return Err(WriteRefused::ReadOnly);
        }
        command.check(joint, self.names.len())?;
        if command == WriteCommand::Torque(false) {
            let mut shared = lock(&self.shared);
            if shared.port.opened == 0 {
                // Nothing was switched on.
                return Err(WriteRefused::NoPort);
            }
            shared.forget_commands(joint);
            shared.numbers += 1;
            let number = shared.numbers;
            shared.commands.insert(0, (number, joint, command));
            self.urgent.store(true, Ordering::Release);
            return Ok(number);
        }
        let mut shared = self.shared_while_open()?;
        if shared.commands.len() >= COMMANDS {
            return Err(WriteRefused::QueueFull(shared.commands.len()));
        }
        shared.numbers += 1;
        let number = shared.numbers;
        shared.commands.push((number, joint, command));
        Ok(number)
    }

    /// What is shared with the thread, where a command can reach the servos.
    fn shared_while_open(&self) -> Result<MutexGuard<'_, Shared>, WriteRefused> {
        let shared = lock(&self.shared);
        match shared.port.state {
            PortState::Open => Ok(shared),
            PortState::Starting | PortState::Away { .. } => Err(WriteRefused::NoPort),
        }
    }

    /// Gives several joints' servos a goal PWM (counts) in one packet, so that all take it at once; one number for all of
    /// them, under which [`ServoReader::outcome`] tells what became of each. All or none are given it.
    pub fn command_together(&self, goals: &[(usize, i16)]) -> Result<u64, WriteRefused> {
        if !self.allow_writes {
            return Err(WriteRefused::ReadOnly);
        }
        check_goals(goals.iter().copied(), self.names.len())?;
        let mut shared = self.shared_while_open()?;
        if shared.commands.len() >= COMMANDS {
            return Err(WriteRefused::QueueFull(shared.commands.len()));
        }
        shared.numbers += 1;
        let number = shared.numbers;
        let commands = (goals.iter()).map(|(joint, counts)| (number, *joint, WriteCommand::GoalPwm(*counts)));
        shared.commands.extend(commands);
        Ok(number)
    }

    /// What became of commands to switch a servo's motor off, once they have reached the bus.
    pub fn motor_off(&self, joint: usize) -> MotorOff {
        let shared = lock(&self.shared);
        let servo = shared.snapshot.servos.get(joint);
        servo.map_or_else(MotorOff::default, |servo| servo.motor_off)
    }

    /// The joints of which nobody knows whether their motors are off, though they are to be.
    pub fn motors_not_off(&self) -> Vec<usize> {
        self.joints_with(|servo| servo.motor_off.unconfirmed)
    }

    /// The joints whose motors are on, as their servos said last.
    pub fn motors_on(&self) -> Vec<usize> {
        self.joints_with(|servo| servo.torque_enabled == Some(true))
    }

    /// Whether a servo says that its motor is off, and was told nothing since that could switch it on. Of what it was told last
    /// this is known once there is an outcome.
    pub fn is_off(&self, joint: usize) -> bool {
        let is_off =
            |servo: &ServoState| servo.alive && !servo.may_run && servo.torque_enabled == Some(false);
        lock(&self.shared).snapshot.servos.get(joint).is_some_and(is_off)
    }

    fn joints_with(&self, holds: impl Fn(&ServoState) -> bool) -> Vec<usize> {
        let shared = lock(&self.shared);
        let servos = shared.snapshot.servos.iter().enumerate();
        servos
            .filter_map(|(joint, servo)| holds(servo).then_some(joint))
            .collect()
    }

    /// What hardware error a servo reports in its newest answer ([`ServoState::reported_error`]).
    pub fn reported_error(&self, joint: usize) -> Option<HardwareError> {
        lock(&self.shared).snapshot.servos.get(joint)?.reported_error()
    }

    /// What became of the command of this number to a joint's servo; `None` where it is not done with, or was so long ago.
    /// One that switches a motor off is not among them ([`ServoReader::motor_off`]).
    pub fn outcome(&self, joint: usize, number: u64) -> Option<Result<(), WriteError>> {
        lock(&self.shared).outcomes.of(joint, number)
    }
}
