//! The thread that reads servos, and what it shows.

use super::serial_bus::SerialBus;
use crate::dynamixel::bus::{
    Bus, BusCounters, FastState, JointReading, MotorOff, NoReading, Outcomes, ServoState, WriteCommand,
    WriteError, WriteRefused, Written, check_goals,
};
use crate::dynamixel::config::{DynamixelConfig, READINGS_KEPT};
use crate::dynamixel::registers::HardwareError;
use crate::serial::{
    PortError, PortState, PortStatus, ReadingThread, ReadingThreadError, StartError, history_since, lock,
};
use crate::synchrony::{JointHistory, JointMotion};
use nix::errno::Errno;
use nix::sys::prctl;
use nix::sys::time::TimeSpec;
use nix::time::{ClockId, ClockNanosleepFlags, clock_nanosleep};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;
use taxel_can::monotonic_ns;

/// Pause before a port is opened again, first and longest.
const FIRST_PAUSE: Duration = Duration::from_millis(50);
const LONGEST_PAUSE: Duration = Duration::from_millis(500);
/// How often a sleeping thread looks whether it shall end.
const LOOK_NS: u64 = 20_000_000;
/// How often the adapter's latency timer is looked at.
const LATENCY_NS: u64 = 1_000_000_000;
/// Between two cycles in which motors are told at the end to be off.
const RELEASE_PAUSE: Duration = Duration::from_millis(1);

/// The newest cycle and what is known of the servos, one entry per joint in the order of the configuration.
#[derive(Debug, Clone, PartialEq)]
pub struct ServoSnapshot {
    /// Readings of the newest cycle, or why there is none.
    pub results: Vec<Result<JointReading, NoReading>>,
    /// Counters, voltage, temperature and hardware error of each servo.
    pub servos: Vec<ServoState>,
    /// Counters of the bus.
    pub counters: BusCounters,
    /// Whether all servos answer in one packet.
    pub fast: FastState,
}

#[derive(Debug)]
struct Shared {
    snapshot: ServoSnapshot,
    history: JointHistory,
    port: PortStatus,
    /// Those that switch motors off come first.
    commands: Vec<(u64, usize, WriteCommand)>,
    /// Commands so far.
    numbers: u64,
    outcomes: Outcomes,
}

impl Shared {
    /// What else a servo was to be told is forgotten, since its motor is to be off.
    fn forget_commands(&mut self, joint: usize) {
        let outcomes = &mut self.outcomes;
        self.commands.retain(|(number, other, _)| {
            let result = Err(WriteError::SwitchedOff);
            if *other == joint {
                outcomes.push(
                    joint,
                    Written {
                        number: *number,
                        result,
                    },
                );
            }
            *other != joint
        });
    }

    /// Takes over what is known of the servos, and what became of what they were told.
    fn take_servos(&mut self, bus: &mut Bus) {
        for (i, state) in self.snapshot.servos.iter_mut().enumerate() {
            if let Some(servo) = bus.servo(i) {
                *state = *servo;
            }
        }
        self.outcomes.append(bus.take_outcomes());
    }
}

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

/// What an urgent command does while the thread sleeps.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Urgent {
    Wakes,
    /// The port is away.
    Waits,
}

struct Thread {
    bus: Bus,
    path: PathBuf,
    baud: u32,
    margin_ns: Option<u64>,
    period_ns: u64,
    shared: Arc<Mutex<Shared>>,
    published: Arc<AtomicU64>,
    steps: Arc<AtomicU64>,
    stop: Arc<AtomicBool>,
    urgent: Arc<AtomicBool>,
    commands: Vec<(u64, usize, WriteCommand)>,
}

impl Thread {
    fn run(mut self) {
        // Wake up on the microsecond, not within the 50 that a thread may oversleep by default.
        let _ = prctl::set_timerslack(1);
        let mut pause = FIRST_PAUSE;
        let mut lost = None;
        while !self.stopped() {
            match SerialBus::open_again(&self.path, self.baud, self.margin_ns, &mut self.bus, lost) {
                Ok(mut port) => {
                    pause = FIRST_PAUSE;
                    lock(&self.shared).port.opened(port.device(), port.latency());
                    if let Err(error) = self.cycles(&mut port) {
                        lost = port.terminal();
                        self.away(&error);
                    }
                }
                Err(error) => self.away(&error),
            }
            self.sleep_until(monotonic_ns() + pause.as_nanos() as u64, Urgent::Waits);
            pause = (2 * pause).min(LONGEST_PAUSE);
        }
        // A motor that could not be told to be off is one of which nobody knows whether it is.
        self.bus.release_motors();
        self.bus.port_lost();
        self.publish();
    }

    /// Cycle after cycle until the port is lost or the thread shall end.
    fn cycles(&mut self, port: &mut SerialBus) -> Result<(), PortError> {
        let mut next_ns = monotonic_ns();
        let mut latency_due_ns = next_ns + LATENCY_NS;
        while !self.stopped() {
            let done = self.cycle(port);
            lock(&self.shared).port.taken_ns = port.taken_ns();
            done?;
            self.publish();
            let now = monotonic_ns();
            if now >= latency_due_ns {
                latency_due_ns = now + LATENCY_NS;
                let latency = port.look_at_latency(&mut self.bus);
                lock(&self.shared).port.latency = Some(latency);
            }
            // A bus that is slower than its rate does not catch up.
            next_ns = (next_ns + self.period_ns).max(monotonic_ns());
            self.sleep_until(next_ns, Urgent::Wakes);
        }
        self.bus.release_motors();
        while self.bus.is_releasing(monotonic_ns()) {
            port.cycle_while(&mut self.bus, |bus| bus.is_releasing(monotonic_ns()))?;
            // Where every servo rests a cycle takes no time.
            std::thread::sleep(RELEASE_PAUSE);
        }
        Ok(())
    }

    /// One cycle; between its requests what became of commands is shown, and what is urgent is taken. It has no more of them once
    /// the thread shall end.
    fn cycle(&mut self, port: &mut SerialBus) -> Result<(), PortError> {
        let Self {
            bus,
            shared,
            stop,
            urgent,
            commands,
            steps,
            ..
        } = self;
        port.cycle_while(bus, |bus| {
            steps.fetch_add(1, Ordering::Relaxed);
            if bus.has_outcomes() {
                // Whoever waits for it does not wait for the rest of the cycle.
                lock(shared).take_servos(bus);
            }
            if urgent.swap(false, Ordering::Acquire) {
                // The rest waits for the end of the cycle, or it might have none.
                let mut shared = lock(shared);
                let is_urgent = |(_, _, command): &&_| *command == WriteCommand::Torque(false);
                let offs = shared.commands.iter().take_while(is_urgent).count();
                commands.extend(shared.commands.drain(..offs));
                drop(shared);
                bus.take(commands);
                commands.clear();
            }
            let stops = stop.load(Ordering::Relaxed);
            if stops {
                bus.hurry();
            }
            !stops
        })
    }

    fn publish(&mut self) {
        self.steps.fetch_add(1, Ordering::Relaxed);
        {
            let mut shared = lock(&self.shared);
            let shared = &mut *shared;
            std::mem::swap(&mut shared.commands, &mut self.commands);
            shared.snapshot.results.copy_from_slice(self.bus.results());
            shared.take_servos(&mut self.bus);
            shared.snapshot.counters = self.bus.counters();
            shared.snapshot.fast = self.bus.fast_state();
            for (joint, result) in self.bus.results().iter().enumerate() {
                if let Ok(reading) = result {
                    shared.history.push(joint, reading.t_ns, reading.angle_rad);
                    let motion = JointMotion {
                        velocity_rad_s: reading.velocity_rad_s as f32,
                        current_a: reading.current_a.map_or(f32::NAN, |current| current as f32),
                    };
                    shared.history.set_motion(joint, motion);
                }
            }
            self.published.fetch_add(1, Ordering::Release);
        }
        self.hand_over();
    }

    fn hand_over(&mut self) {
        self.bus.take(&self.commands);
        self.commands.clear();
    }

    /// The port is away: no command is taken any more, and of those that wait it is told that they are forgotten.
    fn away(&mut self, error: &PortError) {
        {
            let mut shared = lock(&self.shared);
            shared.port.lost(error);
            std::mem::swap(&mut shared.commands, &mut self.commands);
        }
        self.hand_over();
        self.bus.port_lost();
        self.publish();
    }

    fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    fn sleep_until(&self, until_ns: u64, urgent: Urgent) {
        let is_called = || urgent == Urgent::Wakes && self.urgent.load(Ordering::Relaxed);
        while !self.stopped() && !is_called() {
            let now = monotonic_ns();
            if now >= until_ns {
                return;
            }
            let t = until_ns.min(now + LOOK_NS);
            let spec = TimeSpec::new((t / 1_000_000_000) as i64, (t % 1_000_000_000) as i64);
            match clock_nanosleep(
                ClockId::CLOCK_MONOTONIC,
                ClockNanosleepFlags::TIMER_ABSTIME,
                &spec,
            ) {
                Ok(_) | Err(Errno::EINTR) => {}
                Err(_) => std::thread::sleep(Duration::from_nanos(t - now)),
            }
        }
    }
}
