//! What is known of one servo, and how often it is asked.

use super::writes::{MotorLost, Write, Written};
use crate::dynamixel::protocol2::{StatusByte, StatusError};
use crate::dynamixel::registers::{HardwareError, Model, address};

/// How often each thing happened to one servo.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct ServoCounters {
    /// Readings.
    pub ok: u64,
    /// Asked and silent.
    pub timeouts: u64,
    /// Answers with a wrong CRC.
    pub bad_crc: u64,
    /// Readings, refused ones too, with the alert bit.
    pub alerts: u64,
    /// Answers that came after their deadline.
    pub late: u64,
    /// Second answers to one request: two servos have one id. The angle of neither is a reading.
    pub double: u64,
    /// Answers with an error number.
    pub refused: u64,
    /// Cycles in which it was not asked because it had been silent.
    pub rested: u64,
}

/// What a servo says it is (addresses 0 to 10).
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct ServoIdentity {
    /// Model Number.
    pub model_number: u16,
    /// Firmware Version.
    pub firmware: u8,
    /// Baud Rate, as the register has it ([`crate::dynamixel::registers::baud_of`]).
    pub baud_register: u8,
    /// Return Delay Time, microseconds. More than a few make a cycle long.
    pub return_delay_us: u16,
    /// Drive Mode.
    pub drive_mode: u8,
}

/// What is known of one servo beside its readings.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub struct ServoState {
    /// What happened so far.
    pub counters: ServoCounters,
    /// What it says it is; `None` until it was asked.
    pub identity: Option<ServoIdentity>,
    /// Whether its motor holds (Torque Enable): as the newest confirmed write has it, or it said since; `None` before both.
    pub torque_enabled: Option<bool>,
    /// Whether it was told here to switch its motor on, and has not said since that it is off. What it was told may be lost,
    /// or its answer.
    pub may_run: bool,
    /// Whether its bus watchdog has stopped its motor (Bus Watchdog): as it said when it was asked last, while its motor was
    /// on, or as the newest confirmed write has it; `None` before both.
    pub watchdog_tripped: Option<bool>,
    /// Hardware Error Status; `None` until it was asked.
    pub hardware_error: Option<HardwareError>,
    /// Input voltage, volts; `None` until it was asked.
    pub voltage_v: Option<f64>,
    /// Temperature, degrees Celsius; `None` until it was asked.
    pub temperature_c: Option<u8>,
    /// Whether it answered when it was last asked.
    pub alive: bool,
    /// Whether its newest answer had the alert bit: it reports a hardware error.
    pub alert: bool,
    /// Why it refused its newest reading; `None` where it gave one.
    pub refusal: Option<StatusError>,
    /// What became of commands to switch its motor off.
    pub motor_off: MotorOff,
    /// How its motor was lost that was switched on here or left on; `None` where none was, or since it was switched on anew or
    /// somebody asked for it to be off.
    pub motor_lost: Option<MotorLost>,
    /// How often its watchdog was cleared behind the opening of the port, since somebody had left it armed, or tripped, though
    /// the motor was off.
    pub watchdogs_cleared: u64,
}

/// Commands to switch a motor off.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub struct MotorOff {
    /// Number of the newest that was taken; 0 before any.
    pub newest: u64,
    /// What became of the newest that is done with.
    pub written: Option<Written>,
    /// Whether one was in vain, so that nobody knows whether the motor is off: it is told again until it confirms that.
    pub unconfirmed: bool,
}

impl ServoState {
    /// Whether its motor is on, as far as Torque Enable goes, and was stopped by its bus watchdog: it holds nothing and
    /// refuses goals until its torque is enabled anew.
    pub fn is_stopped(&self) -> bool {
        self.torque_enabled == Some(true) && self.watchdog_tripped == Some(true)
    }

    /// The hardware error that its newest answer, to whatever it was, reports; none of its names where it has not said yet
    /// which one. `None` where all is well.
    pub fn reported_error(&self) -> Option<HardwareError> {
        self.alert.then(|| self.hardware_error.unwrap_or_default())
    }
}

impl ServoIdentity {
    /// The model; `None` for a number that is not in [`Model::of`].
    pub fn model(&self) -> Option<&'static Model> {
        Model::of(self.model_number)
    }
}

/// After so many requests in a row without answer a servo is asked less often.
const PATIENCE: u32 = 2;
/// First and longest pause before a silent servo is asked again, nanoseconds.
const FIRST_REST_NS: u64 = 50_000_000;
const LONGEST_REST_NS: u64 = 500_000_000;
/// A servo is asked so often whether its motor was left on; one that never says so is asked for its position alone then.
const LEFT_ON_ASKS: u8 = 10;
/// Return Delay Time from the factory, until the servo has told its own.
pub(crate) const FACTORY_RETURN_DELAY_NS: u64 = 500_000;
/// After so many requests in a row that were answered in time, a servo owes no answer to an earlier one.
const OWES_NOTHING: u8 = 16;
/// Over about so many answers the time that they take is averaged.
const ANSWERS: u64 = 8;
/// Two second answers within this time are of two servos with one id, for as long behind the newer one. Where all servos
/// answer in one packet, each is asked alone about twice a second.
const SHARED_NS: u64 = 2_000_000_000;

/// When something that was in vain is tried again: each time twice as late, within limits.
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct Rest {
    pause_ns: u64,
    /// When; `None` for at once.
    pub(crate) until_ns: Option<u64>,
}

impl Rest {
    fn begin(&mut self, now_ns: u64) {
        self.pause_ns = (2 * self.pause_ns).clamp(FIRST_REST_NS, LONGEST_REST_NS);
        self.until_ns = Some(now_ns + self.pause_ns);
    }
}

/// No servo restarts within this time, nanoseconds. One that was not heard for longer may have, and has forgotten then
/// that its watchdog was armed.
const SHORTEST_RESTART_NS: u64 = 50_000_000;

/// So often a motor that is on is asked in a round whether it still is, and so often for its watchdog, until it says so.
const CHECK_ASKS: u8 = 3;

/// One servo of the bus.
#[derive(Debug, Clone)]
pub(crate) struct Servo {
    pub(crate) id: u8,
    pub(crate) state: ServoState,
    /// Whether it was told here to switch its motor off, and not on since.
    pub(crate) is_to_be_off: bool,
    /// Whether it was sent that since, and nothing by which its motor may run.
    pub(crate) is_told_off: bool,
    /// Whether it is to be sent that once more, since somebody has asked for it again.
    pub(crate) is_asked_off_again: bool,
    /// Whether it was told here to arm its watchdog, and has not said since that it is cleared; `None` where nobody knows what it
    /// was told before.
    pub(crate) is_armed: Option<bool>,
    /// How often it is still asked at the end whether its watchdog is as it was armed, though its motor is not on here.
    pub(crate) disarm_asks: u32,
    /// Whether the watchdog of a motor that was switched on here is as it was armed, or has stopped the motor: the servo has said
    /// so since it could have restarted last.
    pub(crate) is_watch_known: bool,
    /// How often it is still asked for each of what a motor that is on is asked (`cycle/checks.rs`).
    pub(crate) check_asks: [u8; 2],
    /// How often it is still asked, until it says so, whether its motor was left on before the port was opened.
    pub(crate) left_on_asks: u8,
    /// In which cycle it has said that its watchdog was left armed though its motor is off, until that is cleared; and whether it
    /// is being cleared and was left so by somebody else.
    pub(crate) left_armed_cycle: Option<u64>,
    pub(crate) has_left_watchdog: bool,
    /// Bytes that it told in its answer, good or not, to the newest request that is over; `None` where none came.
    told_bytes: Option<usize>,
    /// Requests to it that no answer came to in time: so many answers may still come, and then all at once.
    owed: u8,
    /// Requests in a row that were answered in time.
    answered_in_a_row: u8,
    /// How long its answers take beyond their time on the wire, nanoseconds, on average.
    pub(crate) usual_ns: u64,
    /// Its next angle is not taken: two servos have its id.
    pub(crate) withhold: bool,
    /// When the newest two second answers came, the newer first, nanoseconds.
    double_ns: [Option<u64>; 2],
    /// When something of it came last in a cycle, nanoseconds.
    heard_ns: u64,
    pub(crate) silent_in_a_row: u32,
    /// When it is asked again; it is asked in every cycle where it does not rest.
    pub(crate) rest: Rest,
    /// When its motor is told again to be off.
    off: Rest,
}

impl Servo {
    pub(crate) fn new(id: u8) -> Self {
        Self {
            id,
            state: ServoState::default(),
            is_to_be_off: false,
            is_told_off: false,
            is_asked_off_again: false,
            is_armed: None,
            disarm_asks: 0,
            is_watch_known: false,
            check_asks: [0; 2],
            left_on_asks: 0,
            left_armed_cycle: None,
            has_left_watchdog: false,
            told_bytes: None,
            owed: 0,
            answered_in_a_row: 0,
            usual_ns: 0,
            withhold: false,
            double_ns: [None; 2],
            heard_ns: 0,
            silent_in_a_row: 0,
            rest: Rest::default(),
            off: Rest::default(),
        }
    }

    /// A request had a second answer.
    pub(crate) fn was_double(&mut self, now_ns: u64) {
        self.state.counters.double += 1;
        self.withhold = true;
        self.double_ns = [Some(now_ns), self.double_ns[0]];
    }

    /// Whether two servos have its id. One second answer may be a duplicate that came of elsewhere; two in a short time are
    /// of no other cause.
    pub(crate) fn is_shared(&self, now_ns: u64) -> bool {
        let [Some(newer_ns), Some(older_ns)] = self.double_ns else {
            return false;
        };
        let ago = |t_ns: u64| now_ns.saturating_sub(t_ns);
        ago(newer_ns) <= SHARED_NS && newer_ns.saturating_sub(older_ns) <= SHARED_NS
    }

    /// Whether a request since the opening of the port has had a second answer.
    pub(crate) fn may_be_shared(&self) -> bool {
        self.double_ns[0].is_some()
    }

    /// Forgets what the port held: it has been opened anew. Where motors may be switched off, it is asked whether its own was
    /// left on.
    pub(crate) fn port_opened(&mut self, allow_writes: bool) {
        self.left_on_asks = if allow_writes { LEFT_ON_ASKS } else { 0 };
        (self.left_armed_cycle, self.has_left_watchdog) = (None, false);
        (self.told_bytes, self.owed, self.usual_ns) = (None, 0, 0);
        (self.withhold, self.double_ns) = (false, [None; 2]);
        self.is_told_off = false;
        // Another servo may have its place.
        self.state.identity = None;
        // Another program may have armed it meanwhile.
        self.is_armed = self.is_armed.filter(|is_armed| *is_armed);
    }

    /// How long it waits before it answers.
    pub(crate) fn return_delay_ns(&self) -> u64 {
        self.state
            .identity
            .map_or(FACTORY_RETURN_DELAY_NS, |i| u64::from(i.return_delay_us) * 1000)
    }

    pub(crate) fn current_unit_a(&self) -> Option<f64> {
        self.state.identity?.model()?.current_unit_a()
    }

    /// It has said that a register has the value that it was told. It is shown from now on: what it said before was asked before.
    pub(crate) fn confirmed(&mut self, register: u16, value: u8) {
        match register {
            address::TORQUE_ENABLE => {
                self.state.torque_enabled = Some(value != 0);
                if value == 0 {
                    self.state.may_run = false;
                    self.state.motor_off.unconfirmed = false;
                    self.off = Rest::default();
                } else {
                    self.state.motor_lost = None;
                }
            }
            address::BUS_WATCHDOG => {
                self.state.watchdog_tripped = Some(false);
                self.is_armed = Some(value != 0);
                self.state.watchdogs_cleared += u64::from(std::mem::take(&mut self.has_left_watchdog));
                self.is_watch_known = value != 0;
            }
            _ => {}
        }
    }

    /// Something of it came, good or not.
    pub(crate) fn answered(&mut self, now_ns: u64) {
        self.is_watch_known &= !self.may_have_restarted(now_ns);
        if !self.state.alive || self.silent_in_a_row > 0 {
            self.check_soon();
        }
        self.heard_ns = now_ns;
        if !self.state.alive && self.silent_in_a_row > 0 {
            // Restarted, or another servo in its place.
            self.state.identity = None;
            self.is_told_off = false;
        }
        if self.silent_in_a_row > 0 {
            self.off = Rest::default();
        }
        self.state.alive = true;
        self.silent_in_a_row = 0;
        self.rest = Rest::default();
    }

    /// The newest request is over, and it told so many bytes, or nothing, which it may owe. What it owes comes all at once: once
    /// it has answered some in a row, the rest is lost, as of a servo that had no power, and two with its id show.
    pub(crate) fn has_told(&mut self, bytes: Option<usize>, is_owed: bool) {
        self.told_bytes = bytes;
        self.owed = self.owed.saturating_add(is_owed.into());
        self.answered_in_a_row = match bytes {
            Some(_) => self.answered_in_a_row.saturating_add(1),
            None => 0,
        };
        if self.answered_in_a_row >= OWES_NOTHING {
            self.owed = 0;
        }
    }

    /// Bytes that it told in its answer to the newest request that is over, where it owes none to any: another answer of as
    /// many is a second one to the same request.
    pub(crate) fn told_bytes(&self) -> Option<usize> {
        self.told_bytes.filter(|_| self.owed == 0)
    }

    /// An answer to an earlier request came.
    pub(crate) fn was_late(&mut self, now_ns: u64) {
        self.owed = self.owed.saturating_sub(1);
        self.lives(now_ns);
    }

    /// Something of it came that is no reading: its pause is short, and its next answer is given time.
    pub(crate) fn lives(&mut self, now_ns: u64) {
        self.silent_in_a_row = self.silent_in_a_row.min(PATIENCE - 1);
        self.rest = Rest {
            pause_ns: 0,
            until_ns: self.rest.until_ns.map(|t| t.min(now_ns + FIRST_REST_NS)),
        };
    }

    /// An answer in time took so long beyond its time on the wire.
    pub(crate) fn took(&mut self, ns: u64) {
        self.usual_ns = self.usual_ns - self.usual_ns / ANSWERS + ns / ANSWERS;
    }

    /// An answer's first byte. What went wrong with the instruction is in the same byte as the alert, and hides none.
    pub(crate) fn take_status(&mut self, status: StatusByte) {
        self.state.alert = status.alert();
        if !status.alert() {
            self.state.hardware_error = self.state.hardware_error.map(|_| HardwareError::default());
        }
    }

    /// Whether it has been silent for so long that nobody waits for it.
    pub(crate) fn rests(&self) -> bool {
        self.silent_in_a_row >= PATIENCE
    }

    fn may_have_restarted(&self, now_ns: u64) -> bool {
        now_ns.saturating_sub(self.heard_ns) >= SHORTEST_RESTART_NS
    }

    /// It was asked and said nothing, for sure.
    pub(crate) fn was_silent(&mut self, now_ns: u64) {
        self.is_watch_known &= !self.may_have_restarted(now_ns);
        self.state.counters.timeouts += 1;
        self.silent_in_a_row += 1;
        if self.rests() {
            self.state.alive = false;
            self.rest.begin(now_ns);
        }
    }

    /// Whether its motor may run here, and nobody wants it off.
    pub(crate) fn runs(&self) -> bool {
        self.state.may_run && !self.state.motor_off.unconfirmed
    }

    /// It is asked as soon as may be whether its motor is on and under its watchdog.
    pub(crate) fn check_soon(&mut self) {
        self.check_asks = [CHECK_ASKS; 2];
    }

    /// Whether it is still to say whether its motor was left on. One that rests is not waited for.
    pub(crate) fn is_to_say_left_on(&self) -> bool {
        self.left_on_asks > 0 && !self.rests()
    }

    /// Whether its watchdog may stop a motor that was switched on here, or is about to be: nothing may keep the bus for longer
    /// than the usual question.
    pub(crate) fn is_watched(&self) -> bool {
        self.state.may_run || self.is_armed == Some(true)
    }

    /// Its motor is to be off, and it may not have heard that: it is told so, until it confirms that, as soon as may be.
    pub(crate) fn owe_off(&mut self) {
        self.state.motor_off.unconfirmed = true;
        self.off = Rest::default();
    }

    /// It was told to switch its motor off, in vain: it is told again after a while, which is short where it answers.
    pub(crate) fn off_failed(&mut self, is_heard: bool, now_ns: u64) {
        if is_heard {
            self.off = Rest::default();
        }
        self.state.motor_off.unconfirmed = true;
        self.off.begin(now_ns);
    }

    /// It is being told this, as others may be in the same packet. From here on it may be obeyed, whatever becomes of the port.
    pub(crate) fn is_being_told(&mut self, write: &Write) {
        if write.is_motor_on() {
            self.state.may_run = true;
            (self.is_to_be_off, self.is_told_off) = (false, false);
        }
        self.is_told_off |= write.switches_off();
        if write.is_arming() {
            self.is_armed = Some(true);
        }
    }

    /// Whether it is to be told that its motor is to be off.
    pub(crate) fn is_owed_off(&self) -> bool {
        self.state.motor_off.unconfirmed || self.is_asked_off_again
    }

    /// Whether its motor is to be told again now to be off.
    pub(crate) fn is_off_due(&self, now_ns: u64) -> bool {
        self.state.motor_off.unconfirmed && self.off.until_ns.is_none_or(|t| t <= now_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_silent_servo_is_asked_less_and_less_but_within_half_a_second() {
        let mut servo = Servo::new(1);
        servo.was_silent(0);
        assert_eq!(servo.rest.until_ns, None);
        let rests: Vec<u64> = (0..6)
            .map(|_| {
                servo.was_silent(1_000);
                (servo.rest.until_ns.unwrap() - 1_000) / 1_000_000
            })
            .collect();
        assert_eq!(rests, [50, 100, 200, 400, 500, 500]);
        servo.was_late(2_000);
        assert_eq!(servo.rest.until_ns, Some(2_000 + FIRST_REST_NS), "it lives");
        servo.answered(0);
        assert_eq!(servo.rest.until_ns, None);
        servo.was_silent(0);
        assert_eq!(servo.rest.until_ns, None, "patience is full again");
    }

    #[test]
    fn a_servo_that_comes_back_is_asked_who_it_is() {
        let mut servo = Servo::new(1);
        servo.answered(0);
        servo.state.identity = Some(ServoIdentity {
            model_number: 1030,
            firmware: 46,
            baud_register: 3,
            return_delay_us: 0,
            drive_mode: 0,
        });
        servo.was_silent(0);
        servo.answered(0);
        assert!(servo.state.identity.is_some(), "one answer missed is no restart");
        servo.was_silent(0);
        servo.was_silent(0);
        assert_eq!(servo.return_delay_ns(), 0);
        servo.answered(0);
        assert!(servo.state.identity.is_none());
        assert_eq!(servo.return_delay_ns(), 500_000);
    }
}
