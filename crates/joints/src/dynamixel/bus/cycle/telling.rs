//! What servos are told, in packets that nobody acknowledges, and what they say then that they hold.
//!
//! An acknowledgement says nothing of what it acknowledges: one of an earlier write that comes late would stand for one that
//! was lost on the way. So a servo is told something in a sync write, and asked behind it for the register. Several are given
//! goals in one packet, so that all take them at the same instant, and several motors switched off, so that none waits for
//! another servo's answer.

use super::requests::load;
use super::{Bus, LEADS, WRITE_TRIES};
use crate::dynamixel::bus::pass::{Answer, Kind};
use crate::dynamixel::bus::writes::{Write, WriteCommand, WriteError, WriteRefused, check_goals};
use crate::dynamixel::protocol2::{Assignment, StatusError};
use crate::dynamixel::registers::{WATCHDOG_TRIPPED, address};
use crate::error::MAX_JOINTS;

/// How many bytes are read of what servos hold, from Torque Enable or from Bus Watchdog to Goal PWM or beyond; no other question
/// has these lengths. As with angles the length changes where an answer may still come, so that none is taken for one to a later
/// question. Of the two they are taken in turn: an answer may come twice, as of two servos with one id.
const HELD_BYTES: [[u16; 2]; LEADS as usize] = [
    [4, 5],
    [6, 8],
    [9, 10],
    [20, 21],
    [22, 23],
    [24, 25],
    [26, 27],
    [28, 29],
];

/// So many times as long a servo has with each try to say that its motor is off, where others are to be off as well.
const OFF_PATIENCE: u64 = 8;

impl Bus {
    /// Gives several servos goals (counts) in one packet, after the next cycle's positions; all or none.
    pub fn command_together(&mut self, number: u64, goals: &[(usize, i16)]) -> Result<(), WriteRefused> {
        self.take_together(number, goals.iter().copied())
    }

    pub(super) fn take_together(
        &mut self,
        number: u64,
        goals: impl Iterator<Item = (usize, i16)> + Clone,
    ) -> Result<(), WriteRefused> {
        check_goals(goals.clone(), self.servos.len())?;
        for (servo, counts) in goals.clone() {
            self.check(servo, WriteCommand::GoalPwm(counts))?;
        }
        self.has_room(goals.clone().count())?;
        for (servo, counts) in goals {
            self.queue(number, servo, WriteCommand::GoalPwm(counts));
        }
        Ok(())
    }

    /// How many writes at the front are on their way to the servos.
    pub(super) fn writes_out(&self) -> usize {
        match self.pass.kind {
            Kind::Told | Kind::ReadBack if self.pass_active => self.pass.told,
            _ => 0,
        }
    }

    /// Prepares the packet with the write at the front, and with those behind it that are told together with it.
    pub(super) fn tell(&mut self, first: Write) {
        let mut told = [(0, [0; 2]); MAX_JOINTS];
        self.pass.order.clear();
        let same = self.writes.iter().take_while(|write| write.is_told_with(&first));
        let count = same.count().max(1);
        for (place, write) in told.iter_mut().zip(self.writes.iter_mut().take(count)) {
            write.is_sent = true;
            *place = (self.servos[write.servo].id, write.data);
            self.pass.order.push(write.servo);
        }
        let mut assignments = [Assignment { id: 0, data: &[] }; MAX_JOINTS];
        for (assignment, (id, data)) in assignments.iter_mut().zip(&told) {
            *assignment = Assignment {
                id: *id,
                data: &data[..first.len],
            };
        }
        let assignments = &assignments[..self.pass.order.len()];
        load(
            &mut self.request,
            self.encoder.sync_write(first.address, assignments),
        );
        for servo in &self.pass.order {
            self.servos[*servo].is_being_told(&first);
        }
        self.pass.begin(Kind::Told, first.address, 0);
        self.pass.told = self.pass.order.len();
        self.activate();
    }

    /// How long servos may take to say what they hold. Where one is to be off and others as well, they are given little more than
    /// their answers took so far, and with each try longer, so that those that answer do not wait for those that fell silent.
    pub(super) fn read_back_margin_ns(&self) -> u64 {
        let mut urgent = self.writes.iter().take_while(|write| write.urgent);
        match urgent.next() {
            Some(first) if urgent.any(|write| write.servo != first.servo) => {
                let out = self.writes.iter().take(self.pass.told);
                out.map(|write| self.off_margin_ns(write))
                    .max()
                    .unwrap_or(self.margin_ns)
            }
            _ => self.margin_ns,
        }
    }

    /// The same of one that is to be off among others.
    pub(super) fn off_margin_ns(&self, off: &Write) -> u64 {
        let more = OFF_PATIENCE.saturating_pow(off.tries);
        let usual_ns = self.resting_margin_ns.saturating_mul(more);
        (self.margin_ns).min(usual_ns.saturating_add(2 * self.servos[off.servo].usual_ns))
    }

    /// Asks those servos what they hold now.
    pub(super) fn read_back(&mut self) {
        let mut ids = [0; MAX_JOINTS];
        let count = self.pass.order.len();
        for (id, servo) in ids.iter_mut().zip(&self.pass.order) {
            *id = self.servos[*servo].id;
        }
        let before = self.pass.request_bytes;
        let at = match self.pass.address {
            address::TORQUE_ENABLE => address::TORQUE_ENABLE,
            _ => address::BUS_WATCHDOG,
        };
        self.held_turn ^= 1;
        let length = HELD_BYTES[usize::from(self.lead)][self.held_turn];
        let packet = self.encoder.sync_read(at, length, &ids[..count]);
        load(&mut self.request, packet);
        self.pass.begin(Kind::ReadBack, at, length);
        self.activate();
        // What they were told may still be on the wire.
        self.pass.request_bytes += before;
    }

    /// A servo says what it holds, or refuses to. Where several were told something, those that hold it wait for no other.
    pub(super) fn take_held(&mut self, position: usize, refused: Option<StatusError>, data: &[u8]) {
        let servo = self.pass.order[position];
        let mut out = self.writes.iter().take(self.pass.told);
        let Some(at) = out.position(|write| write.servo == servo) else {
            return self.take_held_again(servo, data);
        };
        // Of two servos with one id both have to.
        let is_denied = self.pass.held[position] == Some(false);
        let held = !is_denied && refused.is_none() && is_held(&self.writes[at], data);
        self.pass.held[position] = Some(held);
        if self.pass.order.len() == 1 {
            self.pass.refused = self.pass.refused.or(refused);
        } else if held {
            // Of two servos that are known to share an id, once both had their time.
            if !(self.writes[at].urgent && self.servos[servo].is_shared(self.begun_ns)) {
                self.end_held(at);
            }
        } else if !self.writes[at].urgent {
            self.end_goal(at, WriteError::NotHeld);
        }
    }

    /// A second answer with the id of one that holds what it was told: of two servos with one id both have to be off.
    fn take_held_again(&mut self, servo: usize, data: &[u8]) {
        let is_on = data.first().is_some_and(|torque| *torque != 0);
        if self.pass.address == address::TORQUE_ENABLE && is_on {
            self.writes.retain(|write| write.servo != servo || !write.urgent);
            self.still_on(servo);
        }
    }

    /// A servo holds what it was told.
    fn end_held(&mut self, at: usize) {
        let Some(write) = self.writes.remove(at) else {
            return;
        };
        self.pass.told -= 1;
        self.counters.writes_ok += 1;
        self.servos[write.servo].confirmed(write.address, write.data[0]);
        if write.last && !write.only_disarms() {
            self.note(write.servo, write.number, Ok(()));
        }
        let servo = &mut self.servos[write.servo];
        if write.is_motor_off() && std::mem::take(&mut servo.is_asked_off_again) {
            // By a start, which begins with it.
            let number = servo.state.motor_off.newest;
            self.note(write.servo, number, Ok(()));
        }
        if write.switches_off() && self.servos[write.servo].is_armed != Some(false) {
            self.disarm(write.servo);
        }
    }

    /// Has a servo's watchdog cleared, whose motor is off, behind all that are to be off. Of two with its id the other may be on,
    /// so that theirs stay armed.
    pub(super) fn disarm(&mut self, servo: usize) {
        let mut urgent = self.writes.iter().take_while(|write| write.urgent);
        let behind = urgent.clone().count();
        let is_told_more = urgent.any(|write| write.servo == servo);
        if !is_told_more && !self.servos[servo].is_shared(self.begun_ns) {
            self.writes.insert(behind, Write::disarming(servo));
        }
    }

    /// One of several has not taken its goal, or will not say so any more.
    fn end_goal(&mut self, at: usize, error: WriteError) {
        if let Some(write) = self.writes.remove(at) {
            self.pass.told -= 1;
            self.counters.writes_failed += 1;
            self.note(write.servo, write.number, Err(error));
        }
    }

    /// A servo has said whether it holds what it was told, or will not any more.
    pub(super) fn end_write(&mut self, now_ns: u64) {
        let Some(write) = self.writes.front().copied() else {
            return;
        };
        let error = match (self.pass.answers[0], self.pass.refused) {
            (Answer::Got, None) if self.pass.held[0] == Some(true) => return self.end_held(0),
            (Answer::Got, None) => write.not_held(),
            (Answer::Got, Some(error)) => WriteError::Servo(error),
            (Answer::Damaged, _) => WriteError::Damaged,
            (Answer::Awaited, _) if self.pass.left => {
                self.tell_again(0, now_ns);
                return;
            }
            (Answer::Awaited, _) => WriteError::Silent,
        };
        self.told_in_vain(0, error, now_ns);
    }

    /// Of several motors that are to be off, or watchdogs of such, all have said what they hold, or will not any more. Those that
    /// may only have waited for one that is silent are told again together, the others each by itself.
    pub(super) fn end_offs(&mut self, now_ns: u64) {
        let mut at = 0;
        for _ in 0..self.pass.told {
            let Some(write) = self.writes.get(at).copied() else {
                return;
            };
            let Some(position) = self.pass.position_of(write.servo) else {
                return;
            };
            let stays = match self.pass.answers[position] {
                Answer::Got if self.pass.held[position] == Some(true) => {
                    self.end_held(at);
                    false
                }
                Answer::Got => self.told_in_vain(at, write.not_held(), now_ns),
                Answer::Damaged => self.told_in_vain(at, WriteError::Damaged, now_ns),
                Answer::Awaited if self.pass.is_silent(position) => {
                    self.told_in_vain(at, WriteError::Silent, now_ns)
                }
                Answer::Awaited => self.tell_again(at, now_ns),
            };
            at += usize::from(stays);
        }
    }

    /// All have said what they hold, or will not any more. Those that were not heard are given their goals again in the next
    /// cycle: a busy host can miss an answer.
    pub(super) fn end_together(&mut self) {
        let mut tries = 0;
        for write in self.writes.iter_mut().take(self.pass.told) {
            write.tries += u32::from(!self.pass.left);
            tries = write.tries.max(tries);
        }
        if tries < WRITE_TRIES {
            self.writes_done = true;
            self.let_urgent_pass();
            return;
        }
        for position in 0..self.pass.order.len() {
            match self.pass.answers[position] {
                Answer::Got => {}
                Answer::Damaged => self.end_goal(0, WriteError::Damaged),
                Answer::Awaited => self.end_goal(0, WriteError::Silent),
            }
        }
    }

    /// A servo that may only have had no time to answer is told again with the others; watchdogs and goals wait for motors that
    /// are to be off. Says whether the write stays where it is.
    fn tell_again(&mut self, at: usize, now_ns: u64) -> bool {
        let write = self.writes[at];
        // In the next cycle, where the others would not be read in this one.
        if self.pass.left && !self.is_first_off(&write, now_ns) {
            self.be_done_with(&write);
        }
        if !write.urgent {
            self.let_urgent_pass();
            return false;
        }
        if !write.is_motor_off() {
            return !self.let_pass(at, |next| next.urgent);
        }
        write.tries == 0 || !self.let_pass(at, |next| next.switches_off() && next.tries == 0)
    }

    /// What a servo was told is told again, or has failed. Says whether it stays where it is.
    fn told_in_vain(&mut self, at: usize, error: WriteError, now_ns: u64) -> bool {
        let write = self.writes[at];
        let is_heard = !matches!(error, WriteError::Silent | WriteError::Damaged);
        // One that answers is told again at once, others in the next cycle.
        if !is_heard {
            self.be_done_with(&write);
        }
        let tries = write.tries + 1;
        self.writes[at].tries = tries;
        let again = tries < WRITE_TRIES && !matches!(error, WriteError::Servo(_));
        if again && self.servos[write.servo].state.alive {
            if !write.urgent {
                self.let_urgent_pass();
                return false;
            }
            let passes = |next: &Write| match is_heard {
                true => next.switches_off() && next.tries == 0,
                false => next.urgent,
            };
            return !self.let_pass(at, passes);
        }
        self.writes.remove(at);
        self.counters.writes_failed += 1;
        if write.only_disarms() {
            // The motor is off, so that its watchdog has nothing to stop.
            self.servos[write.servo].has_left_watchdog = false;
            return false;
        }
        self.note(write.servo, write.number, Err(error));
        if write.switches_off() {
            self.servos[write.servo].off_failed(is_heard, now_ns);
        } else if !write.is_goal() {
            if error == WriteError::StillOff {
                self.servos[write.servo].state.may_run = false;
            }
            self.call_off_start(&write);
        }
        false
    }
}

/// Whether these bytes, from Torque Enable or Bus Watchdog on, hold what was written.
fn is_held(write: &Write, data: &[u8]) -> bool {
    match (write.address, data) {
        (address::GOAL_PWM, [watchdog, _, goal @ ..]) => {
            *watchdog != WATCHDOG_TRIPPED && goal.starts_with(&write.data)
        }
        (_, [value, ..]) => *value == write.data[0],
        _ => false,
    }
}
