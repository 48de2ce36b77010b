//! One simulated servo: what it answers to an instruction.

use super::fault::ServoFault;
use super::load::Load;
use super::motion::{Drive, Motion};
use super::table::ControlTable;
use std::sync::Arc;
use taxel_joints::protocol2::{Instruction, StatusError};
use taxel_joints::registers::{WATCHDOG_TRIPPED, address, baud_of};

/// A servo to be built.
#[derive(Debug, Clone)]
pub struct ServoBuild {
    /// Id, 0 to 252.
    pub id: u8,
    /// How it is moved while its motor is off.
    pub motion: Motion,
    /// Return Delay Time in steps of 2 us, 0 to 254; 250 from the factory.
    pub return_delay: u8,
    /// Whether its firmware knows the fast reads.
    pub fast: bool,
    /// What holds against its motor in PWM mode, and opens it when it is off; `None`: nothing, so that it turns for
    /// ever.
    pub load: Option<Arc<dyn Load>>,
}

impl ServoBuild {
    /// A servo that answers at once, knows the fast reads, and stays at `2048 + 10 * id`.
    pub fn new(id: u8) -> Self {
        Self {
            id,
            motion: Motion::Still(2048 + 10 * i32::from(id)),
            return_delay: 0,
            fast: true,
            load: None,
        }
    }
}

/// One simulated servo.
#[derive(Debug, Clone)]
pub struct SimServo {
    table: ControlTable,
    build: ServoBuild,
    drive: Drive,
    /// What it does wrong, and at every how many answers.
    pub(crate) fault: Option<(ServoFault, u32)>,
    pub(crate) answers: u32,
    heard_ns: u64,
    /// When its bus watchdog stopped it last.
    stopped_ns: Option<u64>,
    /// Whether no time passes for its bus watchdog.
    is_watchdog_held: bool,
    /// What a registered write has for Action to carry out: an address and its bytes.
    registered: Option<(u16, Vec<u8>)>,
    /// Pulses that Clear has taken off its position.
    cleared: f64,
    /// Silent until then: it restarts.
    up_ns: u64,
}

/// A step of Bus Watchdog.
const WATCHDOG_STEP_NS: u64 = 20_000_000;
/// What Clear has to say so that the revolutions are forgotten.
const CLEAR_REVOLUTIONS: [u8; 5] = [0x01, 0x44, 0x58, 0x4C, 0x22];
const PULSES_PER_TURN: f64 = 4096.0;
/// How long a restart takes.
const RESTART_NS: u64 = 100_000_000;
/// Pulses per second of one count of velocity: 0.229 revolutions per minute.
const PULSES_PER_COUNT: f64 = 0.229 / 60.0 * 4096.0;
/// Operating Mode in which Goal PWM turns the motor.
const PWM_MODE: i32 = 16;
/// Goal PWM at full PWM, counts.
const FULL_PWM: f64 = 885.0;
/// Speed at full PWM, counts of velocity.
const NO_LOAD_COUNTS: f64 = 330.0;
/// Whether a restart leaves torque on (bit 0).
const STARTUP_CONFIGURATION: u16 = 60;
const REGISTERED_INSTRUCTION: u16 = 69;
const PROFILE_VELOCITY: u16 = 112;
const VELOCITY_LIMIT: u16 = 44;

/// What a servo answers: its ERR byte and data.
pub(crate) type Reply = (u8, Vec<u8>);

impl SimServo {
    pub(crate) fn new(build: ServoBuild, baud: u32) -> Self {
        let mut table = ControlTable::new(build.id);
        table.put(address::RETURN_DELAY_TIME, 1, i32::from(build.return_delay));
        if let Some(value) = (0..=u8::MAX).find(|value| baud_of(*value) == Some(baud)) {
            table.put(address::BAUD_RATE, 1, i32::from(value));
        }
        Self {
            table,
            build,
            drive: Drive::Off,
            fault: None,
            answers: 0,
            heard_ns: 0,
            stopped_ns: None,
            is_watchdog_held: false,
            registered: None,
            cleared: 0.0,
            up_ns: 0,
        }
    }

    /// Its id; a write to address 7 changes it.
    pub fn id(&self) -> u8 {
        self.table.get(address::ID, 1) as u8
    }

    /// Position at a time, pulses, not rounded: the truth that a reading is held against.
    pub fn position(&self, t_ns: u64) -> f64 {
        match (self.drive, self.trips_ns()) {
            (Drive::Off, _) => self.build.motion.position(t_ns) - self.cleared,
            (drive, Some(at_ns)) => drive.position(t_ns.min(at_ns), &self.build.motion),
            (drive, None) => drive.position(t_ns, &self.build.motion),
        }
    }

    /// When its bus watchdog last stopped it, nanoseconds.
    pub fn stopped_ns(&self) -> Option<u64> {
        self.stopped_ns
    }

    /// A register's value, as it stands in the table.
    pub fn register(&self, at: u16, size: u8) -> i32 {
        self.table.get(at, size)
    }

    /// Sets Hardware Error Status; any bit raises the alert in every answer.
    pub fn set_hardware_error(&mut self, bits: u8) {
        self.table.put(address::HARDWARE_ERROR_STATUS, 1, i32::from(bits));
    }

    /// Sets Operating Mode, which no host may while torque is on.
    pub fn set_operating_mode(&mut self, mode: u8) {
        self.table.put(address::OPERATING_MODE, 1, i32::from(mode));
    }

    pub(crate) fn return_delay_ns(&self) -> u64 {
        2_000 * self.table.get(address::RETURN_DELAY_TIME, 1) as u64
    }

    pub(crate) fn knows_fast(&self) -> bool {
        self.build.fast
    }

    /// Whether it is up, and not restarting.
    pub(crate) fn is_up(&self, t_ns: u64) -> bool {
        t_ns >= self.up_ns
    }

    /// From now on no time passes for its bus watchdog.
    pub(crate) fn hold_watchdog(&mut self) {
        self.is_watchdog_held = true;
    }

    /// Time passes again for its bus watchdog, from `now_ns`.
    pub(crate) fn run_watchdog(&mut self, now_ns: u64) {
        self.is_watchdog_held = false;
        self.heard_ns = self.heard_ns.max(now_ns);
    }

    /// When its bus watchdog stops it if nobody speaks until then; `None` where it is not armed, or held.
    fn trips_ns(&self) -> Option<u64> {
        let steps = self.table.get(address::BUS_WATCHDOG, 1);
        (!self.is_watchdog_held && (1..=127).contains(&steps))
            .then(|| self.heard_ns + steps as u64 * WATCHDOG_STEP_NS)
    }

    /// Time has come to `t_ns`: the bus watchdog stops the motor where nobody has spoken for too long.
    pub(crate) fn handle_time(&mut self, t_ns: u64) {
        if let Some(at_ns) = self.trips_ns().filter(|at_ns| *at_ns < t_ns) {
            self.stop_at(at_ns);
            self.table
                .put(address::BUS_WATCHDOG, 1, i32::from(WATCHDOG_TRIPPED));
            self.stopped_ns = Some(at_ns);
            self.refresh(t_ns);
        }
    }

    /// Some instruction went over the bus, which is what the bus watchdog watches for.
    pub(crate) fn handle_traffic(&mut self, t_ns: u64) {
        self.handle_time(t_ns);
        self.heard_ns = t_ns;
    }

    /// What it answers to an instruction for it alone; `None` if it says nothing.
    pub(crate) fn handle_request(
        &mut self,
        instruction: u8,
        parameters: &[u8],
        broadcast: bool,
        t_ns: u64,
    ) -> Option<Reply> {
        let level = self.table.get(address::STATUS_RETURN_LEVEL, 1);
        let word = |i: usize| Some(u16::from_le_bytes([*parameters.get(i)?, *parameters.get(i + 1)?]));
        let (least_level, result) = match Instruction::from_byte(instruction) {
            Some(Instruction::Ping) => {
                let [lo, hi] = (self.table.get(address::MODEL_NUMBER, 2) as u16).to_le_bytes();
                let firmware = self.table.get(address::FIRMWARE_VERSION, 1) as u8;
                return Some((self.error_byte(None), vec![lo, hi, firmware]));
            }
            Some(Instruction::Read) => match (word(0), word(2)) {
                (Some(at), Some(length)) if parameters.len() == 4 => (1, self.read(at, length, t_ns)),
                _ => (1, Err(StatusError::DataLength)),
            },
            Some(Instruction::Write) => match word(0) {
                Some(at) => (2, self.write(at, &parameters[2..], t_ns).map(|()| Vec::new())),
                None => (2, Err(StatusError::DataLength)),
            },
            Some(Instruction::RegWrite) => match word(0) {
                Some(at) => (2, self.register_write(at, &parameters[2..])),
                None => (2, Err(StatusError::DataLength)),
            },
            Some(Instruction::Action) => (2, self.carry_out_registered(t_ns)),
            Some(Instruction::Clear) => (2, self.clear(parameters, t_ns)),
            Some(Instruction::Reboot) => {
                let error = self.error_byte(None);
                self.table.restart();
                (self.registered, self.cleared) = (None, 0.0);
                self.release(t_ns);
                self.up_ns = t_ns + RESTART_NS;
                if self.table.get(STARTUP_CONFIGURATION, 1) & 1 != 0 {
                    // With all the PWM that its limit allows, and no watchdog.
                    let _ = self.write(address::TORQUE_ENABLE, &[1], self.up_ns);
                }
                return (level >= 2 && !broadcast).then_some((error, Vec::new()));
            }
            _ => (2, Err(StatusError::Instruction)),
        };
        let answers = level >= least_level && !broadcast;
        answers.then(|| match result {
            Ok(data) => (self.error_byte(None), data),
            Err(error) => (self.error_byte(Some(error)), Vec::new()),
        })
    }

    /// Its answer to a request that came damaged.
    pub(crate) fn complain_of_crc(&self) -> Reply {
        (self.error_byte(Some(StatusError::Crc)), Vec::new())
    }

    /// Bytes of the table as they are at a time.
    pub(crate) fn read(&mut self, at: u16, length: u16, t_ns: u64) -> Result<Vec<u8>, StatusError> {
        self.refresh(t_ns);
        self.table.read(at, length)
    }

    /// Its part of a sync, bulk or fast read; `None` if its status return level forbids it to answer.
    pub(crate) fn share(&mut self, at: u16, length: u16, t_ns: u64) -> Option<Reply> {
        if self.table.get(address::STATUS_RETURN_LEVEL, 1) < 1 {
            return None;
        }
        Some(match self.read(at, length, t_ns) {
            Ok(data) => (self.error_byte(None), data),
            Err(error) => (self.error_byte(Some(error)), Vec::new()),
        })
    }

    pub(crate) fn write(&mut self, at: u16, data: &[u8], t_ns: u64) -> Result<(), StatusError> {
        let torque = self.table.get(address::TORQUE_ENABLE, 1);
        self.table.write(at, data)?;
        let now_torque = self.table.get(address::TORQUE_ENABLE, 1);
        let span = usize::from(at)..usize::from(at) + data.len();
        let touches = |register: u16, size: usize| {
            let r = usize::from(register);
            span.start < r + size && r < span.end
        };
        let new_goal = touches(address::GOAL_POSITION, 4) || touches(address::GOAL_PWM, 2);
        if now_torque == 0 {
            if torque != 0 {
                self.release(t_ns);
            }
        } else if torque == 0 {
            // It holds where it is.
            let here = self.position(t_ns);
            self.table.put(address::GOAL_POSITION, 4, here.round() as i32);
            self.drive(t_ns);
        } else if new_goal {
            self.drive(t_ns);
        }
        Ok(())
    }

    /// Keeps a write for Action. One that is refused is refused now, and the one before it stays.
    fn register_write(&mut self, at: u16, data: &[u8]) -> Result<Vec<u8>, StatusError> {
        self.table.clone().write(at, data)?;
        self.registered = Some((at, data.to_vec()));
        self.table.put(REGISTERED_INSTRUCTION, 1, 1);
        Ok(Vec::new())
    }

    /// Does what was registered; where nothing is, nothing.
    fn carry_out_registered(&mut self, t_ns: u64) -> Result<Vec<u8>, StatusError> {
        self.table.put(REGISTERED_INSTRUCTION, 1, 0);
        match self.registered.take() {
            Some((at, data)) => self.write(at, &data, t_ns).map(|()| Vec::new()),
            None => Ok(Vec::new()),
        }
    }

    /// Forgets the revolutions: its position is within the first one again. Not while it moves.
    fn clear(&mut self, parameters: &[u8], t_ns: u64) -> Result<Vec<u8>, StatusError> {
        if parameters != CLEAR_REVOLUTIONS {
            return Err(StatusError::DataRange);
        }
        self.refresh(t_ns);
        if self.table.get(address::PRESENT_VELOCITY, 4) != 0 {
            return Err(StatusError::ResultFail);
        }
        let before = self.position(t_ns);
        let here = before.rem_euclid(PULSES_PER_TURN);
        match &mut self.drive {
            Drive::Off => self.cleared += before - here,
            Drive::On { from, goal, .. } => {
                (*from, *goal) = (here, goal.map(|_| here));
                self.table.put(address::GOAL_POSITION, 4, here.round() as i32);
            }
        }
        Ok(Vec::new())
    }

    /// Sets off from where it is now, as its goal and mode say; it stands while its watchdog has it stopped.
    fn drive(&mut self, t_ns: u64) {
        let from = self.position(t_ns);
        if self.has_tripped() {
            let load = self.build.load.as_ref();
            self.drive = Drive::On {
                from,
                since_ns: t_ns,
                goal: Some(load.map_or(from, |load| load.rest(from, 0.0))),
                speed: NO_LOAD_COUNTS * PULSES_PER_COUNT,
            };
            return;
        }
        let pwm_mode = self.table.get(address::OPERATING_MODE, 1) == PWM_MODE;
        let pwm = f64::from(self.table.get(address::GOAL_PWM, 2));
        let (goal, counts) = if let Some(load) = self.build.load.as_ref().filter(|_| pwm_mode) {
            (Some(load.rest(from, pwm)), NO_LOAD_COUNTS)
        } else if pwm_mode {
            (None, pwm / FULL_PWM * NO_LOAD_COUNTS)
        } else {
            let profile = self.table.get(PROFILE_VELOCITY, 4);
            let limit = self.table.get(VELOCITY_LIMIT, 4);
            let counts = if profile == 0 { limit } else { profile.min(limit) };
            (
                Some(f64::from(self.table.get(address::GOAL_POSITION, 4))),
                f64::from(counts),
            )
        };
        self.drive = Drive::On {
            from,
            since_ns: t_ns,
            goal,
            speed: counts * PULSES_PER_COUNT,
        };
    }

    /// The motor gives nothing any more: what holds against it moves it, where something does.
    fn release(&mut self, t_ns: u64) {
        let from = self.position(t_ns);
        self.drive = match &self.build.load {
            None => Drive::Off,
            Some(load) => Drive::On {
                from,
                since_ns: t_ns,
                goal: Some(load.rest(from, 0.0)),
                speed: NO_LOAD_COUNTS * PULSES_PER_COUNT,
            },
        };
    }

    fn stop_at(&mut self, t_ns: u64) {
        if self.build.load.is_some() {
            self.release(t_ns);
        } else if let Drive::On { .. } = self.drive {
            let here = self.position(t_ns);
            self.drive = Drive::On {
                from: here,
                since_ns: t_ns,
                goal: Some(here),
                speed: 0.0,
            };
        }
    }

    /// Whether its bus watchdog has stopped it, and has not been cleared since.
    fn has_tripped(&self) -> bool {
        self.table.get(address::BUS_WATCHDOG, 1) == i32::from(WATCHDOG_TRIPPED)
    }

    /// What the motor is given though it stands, counts.
    fn pwm_under_load(&self) -> f64 {
        let on = self.table.get(address::TORQUE_ENABLE, 1) != 0;
        let stopped = self.has_tripped();
        let pwm_mode = self.table.get(address::OPERATING_MODE, 1) == PWM_MODE;
        match on && pwm_mode && !stopped {
            true => f64::from(self.table.get(address::GOAL_PWM, 2)),
            false => 0.0,
        }
    }

    /// Brings the measured registers up to date.
    fn refresh(&mut self, t_ns: u64) {
        let position = self.position(t_ns);
        let velocity = self.drive.velocity(t_ns, &self.build.motion) / PULSES_PER_COUNT;
        let pwm = match self.build.load {
            Some(_) => self.pwm_under_load(),
            None => velocity / NO_LOAD_COUNTS * FULL_PWM,
        };
        let table = &mut self.table;
        table.put(address::REALTIME_TICK, 2, (t_ns / 1_000_000 % 32_768) as i32);
        table.put(122, 1, i32::from(velocity.abs() >= 10.0));
        table.put(address::PRESENT_PWM, 2, pwm.round() as i32);
        table.put(address::PRESENT_CURRENT, 2, velocity.round() as i32 / 4);
        table.put(address::PRESENT_VELOCITY, 4, velocity.round() as i32);
        table.put(address::PRESENT_POSITION, 4, position.round() as i32);
        table.put(136, 4, velocity.round() as i32);
        table.put(140, 4, position.round() as i32);
        table.put(address::PRESENT_INPUT_VOLTAGE, 2, 120);
        table.put(address::PRESENT_TEMPERATURE, 1, 30 + i32::from(self.build.id % 8));
    }

    fn error_byte(&self, error: Option<StatusError>) -> u8 {
        let alert = self.table.get(address::HARDWARE_ERROR_STATUS, 1) != 0;
        let number = match error {
            None => 0,
            Some(StatusError::ResultFail) => 1,
            Some(StatusError::Instruction) => 2,
            Some(StatusError::Crc) => 3,
            Some(StatusError::DataRange) => 4,
            Some(StatusError::DataLength) => 5,
            Some(StatusError::DataLimit) => 6,
            Some(StatusError::Access) => 7,
            Some(StatusError::Unknown(n)) => n,
        };
        number | u8::from(alert) << 7
    }

    /// The fault of the next answer, if it has one.
    pub(crate) fn next_fault(&mut self) -> Option<ServoFault> {
        let (fault, every) = self.fault?;
        self.answers += 1;
        self.answers.is_multiple_of(every.max(1)).then_some(fault)
    }
}
