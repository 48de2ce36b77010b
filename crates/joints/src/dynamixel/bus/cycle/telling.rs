//! What servos are told, in packets that nobody acknowledges, and what they say then that they hold.
//!
//! An acknowledgement says nothing of what it acknowledges: one of an earlier write that comes late would stand for one that
//! was lost on the way. So a servo is told something in a sync write, and asked behind it for the register. Several are given
//! goals in one packet, so that all take them at the same instant.

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
            Kind::Told | Kind::ReadBack if self.pass_active => self.pass.order.len(),
            _ => 0,
        }
    }

    /// Prepares the packet with the write at the front, and with the goals behind it that belong together with it.
    pub(super) fn tell(&mut self, first: Write) {
        let mut told = [(0, [0; 2]); MAX_JOINTS];
        self.pass.order.clear();
        let same = self.writes.iter().take_while(|write| {
            write.address == address::GOAL_PWM && write.number == first.number && first.number != 0
        });
        let count = same.clone().count().max(1);
        for (place, write) in told.iter_mut().zip(self.writes.iter().take(count)) {
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
        // From here on it may be obeyed, whatever becomes of the port.
        if first.is_motor_on() {
            self.servos[first.servo].switched_on();
        }
        self.pass.begin(Kind::Told, first.address, 0);
        self.activate();
    }

    /// Has all motors switched off in one packet that are newly to be off, where there are several: none of them waits for
    /// another's answer. `false` where there are not.
    pub(super) fn tell_offs(&mut self) -> bool {
        if !std::mem::take(&mut self.offs_untold) {
            return false;
        }
        let mut assignments = [Assignment { id: 0, data: &[0] }; MAX_JOINTS];
        let offs = (self.writes.iter()).filter(|write| write.switches_off() && write.tries == 0);
        let mut count = 0;
        for (assignment, off) in assignments.iter_mut().zip(offs) {
            assignment.id = self.servos[off.servo].id;
            count += 1;
        }
        if count < 2 {
            return false;
        }
        let at = address::TORQUE_ENABLE;
        load(
            &mut self.request,
            self.encoder.sync_write(at, &assignments[..count]),
        );
        self.pass.order.clear();
        self.pass.begin(Kind::Off, at, 0);
        self.activate();
        true
    }

    /// How long a servo may take to say what it holds. Where it is to be off and others as well, it is given little more than
    /// its answers took so far, and with each try longer, so that those that answer do not wait for those that fell silent.
    pub(super) fn read_back_margin_ns(&self) -> u64 {
        let mut urgent = self.writes.iter().take_while(|write| write.urgent);
        match urgent.next() {
            Some(first) if urgent.any(|write| write.servo != first.servo) => self.off_margin_ns(first),
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

    /// A servo says what it holds, or refuses to.
    pub(super) fn take_held(&mut self, position: usize, refused: Option<StatusError>, data: &[u8]) {
        let Some(write) = self.writes.get(position).copied() else {
            return;
        };
        let held = refused.is_none() && is_held(&write, data);
        if self.pass.order.len() == 1 {
            // Of two servos with one id both have to.
            self.pass.held = Some(held && self.pass.held != Some(false));
            self.pass.refused = self.pass.refused.or(refused);
            return;
        }
        let result = if held { Ok(()) } else { Err(WriteError::NotHeld) };
        self.end_goal(position, result);
    }

    /// A servo has said whether it holds what it was told, or will not any more.
    pub(super) fn end_write(&mut self, now_ns: u64) {
        let Some(write) = self.writes.pop_front() else {
            return;
        };
        let result = match (self.pass.answers[0], self.pass.refused) {
            (Answer::Got, None) if self.pass.held == Some(true) => Ok(()),
            (Answer::Got, None) if write.is_motor_off() => Err(WriteError::StillOn),
            (Answer::Got, None) => Err(WriteError::NotHeld),
            (Answer::Got, Some(error)) => Err(WriteError::Servo(error)),
            (Answer::Damaged, _) => Err(WriteError::Damaged),
            (Answer::Awaited, _) => Err(WriteError::Silent),
        };
        let is_heard = self.pass.answers[0] == Answer::Got;
        // One that answers is told again at once, others in the next cycle.
        self.writes_done |= !is_heard;
        if result.is_err() && self.pass.refused.is_none() {
            let tries = match write.urgent {
                true => write.tries + 1,
                false => self.write_tries + 1,
            };
            self.write_tries = tries;
            if tries < WRITE_TRIES && self.servos[write.servo].state.alive {
                self.writes.push_front(Write { tries, ..write });
                match write.urgent && !is_heard {
                    true => self.let_other_offs_pass(),
                    false => self.let_urgent_pass(),
                }
                return;
            }
        }
        self.write_tries = 0;
        if result.is_ok() {
            self.counters.writes_ok += 1;
            self.servos[write.servo].confirmed(write.address, write.data[0]);
            if write.last || write.switches_off() {
                self.note(write.servo, write.number, result);
            }
            let is_slow = self.servos[write.servo].usual_ns > self.resting_margin_ns;
            let next = self.writes.front().filter(|next| next.servo == write.servo);
            if is_slow && write.switches_off() && next.is_some() {
                // Its watchdog waits until the others have said that they are off.
                self.let_other_offs_pass();
            }
            return;
        }
        self.counters.writes_failed += 1;
        if write.urgent && !write.is_motor_off() {
            // The motor is off, so that its watchdog has nothing to stop.
            return;
        }
        self.note(write.servo, write.number, result);
        if write.switches_off() {
            self.servos[write.servo].off_failed(is_heard, now_ns);
            self.keep_watchdog(&write);
        } else if write.address == address::BUS_WATCHDOG || !write.last {
            self.call_off_torque(&write);
        } else if write.is_motor_on() && result == Err(WriteError::NotHeld) {
            // It says that its motor is off.
            self.servos[write.servo].state.may_run = false;
        }
    }

    fn end_goal(&mut self, at: usize, result: Result<(), WriteError>) {
        let write = self.writes[at];
        match result {
            Ok(()) => self.counters.writes_ok += 1,
            Err(_) => self.counters.writes_failed += 1,
        }
        self.note(write.servo, write.number, result);
    }

    /// All have said what they hold, or will not any more. Those that were not heard are given their goals again in the next
    /// cycle: a busy host can miss an answer.
    pub(super) fn end_together(&mut self) {
        let again = self.write_tries + 1 < WRITE_TRIES;
        let mut at = 0;
        for position in 0..self.pass.order.len() {
            let error = match self.pass.answers[position] {
                Answer::Got => None,
                Answer::Damaged => Some(WriteError::Damaged),
                Answer::Awaited => Some(WriteError::Silent),
            };
            match error {
                Some(_) if again => {
                    at += 1;
                    continue;
                }
                Some(error) => self.end_goal(at, Err(error)),
                None => {}
            }
            self.writes.remove(at);
        }
        self.writes_done = at > 0;
        self.write_tries = if at > 0 { self.write_tries + 1 } else { 0 };
        self.let_urgent_pass();
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
