//! What servos are told: which commands are taken, and in which order they wait.

use super::Bus;
use crate::dynamixel::bus::outcomes::Outcomes;
use crate::dynamixel::bus::servo::{FACTORY_RETURN_DELAY_NS, ServoState};
use crate::dynamixel::bus::wire_ns;
use crate::dynamixel::bus::writes::{
    QUEUE, WRITES_PER_COMMAND, Write, WriteCommand, WriteError, WriteRefused, Written,
};
use crate::dynamixel::registers::address;

/// Least and most time in which motors are told at the end to be off; after it their watchdogs stop them.
const RELEASE_NS: u64 = 500_000_000;
const LONGEST_RELEASE_NS: u64 = 2_000_000_000;
/// Bytes on the wire of telling one servo to be off, of asking it, and of its answer.
const OFF_BYTES: usize = 48;

impl Bus {
    /// Has a servo told something, after the next cycle's positions; that its motor is switched off goes before them.
    pub fn command(&mut self, servo: usize, command: WriteCommand) -> Result<(), WriteRefused> {
        self.numbered_command(0, servo, command)
    }

    /// The same; [`Bus::outcome`] tells under this number, unless it is 0, what became of it, and [`ServoState::motor_off`] of
    /// one that switches the motor off.
    pub fn numbered_command(
        &mut self,
        number: u64,
        servo: usize,
        command: WriteCommand,
    ) -> Result<(), WriteRefused> {
        self.check(servo, command)?;
        if command == WriteCommand::Torque(false) {
            self.switch_off(number, servo);
            return Ok(());
        }
        self.has_room(match command {
            WriteCommand::GoalPwm(_) => 1,
            _ => WRITES_PER_COMMAND,
        })?;
        self.queue(number, servo, command);
        Ok(())
    }

    /// Takes commands as they have come: a number, a servo by its index, and what it is told. Those with one number are goals
    /// that are given together ([`Bus::command_together`]). What is refused is done with, and its result says why.
    pub fn take(&mut self, commands: &[(u64, usize, WriteCommand)]) {
        for same in commands.chunk_by(|a, b| a.0 == b.0) {
            let goals = same.iter().filter_map(|(_, servo, command)| match command {
                WriteCommand::GoalPwm(counts) => Some((*servo, *counts)),
                _ => None,
            });
            let taken = match same {
                [(number, servo, command)] => self.numbered_command(*number, *servo, *command),
                _ => self.take_together(same[0].0, goals),
            };
            let Err(refused) = taken else {
                continue;
            };
            for (number, servo, _) in same {
                self.note(*servo, *number, Err(WriteError::NotTaken(refused)));
            }
        }
    }

    /// Refuses so many more writes than can wait.
    pub(super) fn has_room(&self, writes: usize) -> Result<(), WriteRefused> {
        match self.writes.len() {
            waiting if waiting + writes > QUEUE => Err(WriteRefused::QueueFull(waiting)),
            _ => Ok(()),
        }
    }

    /// Puts what a servo is to be told behind all else.
    pub(super) fn queue(&mut self, number: u64, servo: usize, command: WriteCommand) {
        let writes = Write::of(servo, command, self.watchdog_steps, number);
        self.writes.extend(writes);
    }

    /// Refuses what may not be told to a servo now.
    pub(super) fn check(&self, servo: usize, command: WriteCommand) -> Result<(), WriteRefused> {
        if !self.allow_writes {
            return Err(WriteRefused::ReadOnly);
        }
        command.check(servo, self.servos.len())?;
        let may_turn = !matches!(command, WriteCommand::Torque(false) | WriteCommand::GoalPwm(0));
        if may_turn && self.servos[servo].is_shared(self.begun_ns) {
            return Err(WriteRefused::TwoServos(servo));
        }
        match command {
            WriteCommand::GoalPwm(_) if !self.will_run(servo) => Err(self.motor_off(servo)),
            _ => Ok(()),
        }
    }

    /// Whether a motor that was switched on here may be on once its servo has been told all that waits.
    pub(super) fn will_run(&self, servo: usize) -> bool {
        let mut torque = (self.writes.iter().rev())
            .filter(|write| write.servo == servo && write.address == address::TORQUE_ENABLE);
        (torque.next()).map_or(self.servos[servo].runs(), Write::is_motor_on)
    }

    /// Has a motor switched off before anything else is written or read, unless it was told so and nothing since by which it
    /// may run. What else that servo was to be told is forgotten.
    pub(super) fn switch_off(&mut self, number: u64, servo: usize) {
        // What is out stays at the front until it is answered.
        let out = self.writes_out();
        self.servos[servo].is_to_be_off = true;
        self.servos[servo].state.motor_off.newest = number;
        self.servos[servo].state.motor_lost = None;
        let mut i = out;
        let mut told = self.writes.iter().take(out);
        let is_told_more = told.any(|write| write.servo == servo && !write.urgent);
        // At the end nothing else is done that it would have to wait for.
        let is_repeat = self.servos[servo].is_told_off && !is_told_more && !self.ends;
        while let Some(write) = self.writes.get(i).copied() {
            if write.servo == servo && !(is_repeat && write.urgent) {
                self.writes.remove(i);
                self.note(servo, write.number, Err(WriteError::SwitchedOff));
                self.refuse_others(&write, WriteRefused::MotorOff(servo));
                i = out;
            } else {
                i += 1;
            }
        }
        let mut told = self.writes.iter_mut();
        if let Some(write) = told.find(|write| write.servo == servo && write.switches_off()) {
            // It is being told so, and asked.
            write.number = number;
        } else if is_repeat {
            self.servos[servo].is_asked_off_again = true;
        } else {
            self.insert_first_off(servo, out);
            self.offs_untold = true;
        }
    }

    /// Puts what switches a motor off behind what is out, and behind that which has others switched off for the first time.
    pub(super) fn insert_first_off(&mut self, servo: usize, out: usize) {
        // One that is silent holds up none of those behind it where it is the last.
        let rests = self.servos[servo].rests();
        let goes_before = |write: &Write| {
            write.switches_off() && write.tries == 0 && (rests || !self.servos[write.servo].rests())
        };
        let before = (self.writes.iter().skip(out)).take_while(|write| goes_before(write));
        self.insert_off(servo, out + before.count());
    }

    /// Puts what switches a motor off into the queue.
    pub(super) fn insert_off(&mut self, servo: usize, at: usize) {
        self.servos[servo].is_asked_off_again = false;
        let number = self.servos[servo].state.motor_off.newest;
        let mut off = Write::of(servo, WriteCommand::Torque(false), self.watchdog_steps, number);
        if let Some(off) = off.next() {
            self.writes.insert(at, off);
        }
    }

    /// Motors are about to be switched off: what is out has no more time than usual.
    pub(crate) fn hurry(&mut self) {
        self.offs_untold = true;
    }

    /// Has every motor switched off that was switched on with [`Bus::command`], or of which nobody knows whether it is off, and
    /// does nothing else any more; one that was still to be switched on stays off, also where a cycle was left before its end.
    /// Where a motor is off already, or another program's by now, its watchdog is cleared if it is still as it was armed. Returns
    /// for how long they are told so, nanoseconds: half a second or, where that is longer, as long as they may take to confirm it
    /// one after the other, by what their answers took so far; two seconds at most.
    pub fn release_motors(&mut self) -> u64 {
        if std::mem::take(&mut self.pass_active) && self.pass.sent_ns.is_some() {
            self.leave_request();
        }
        self.ends = true;
        for servo in 0..self.servos.len() {
            if self.will_run(servo) || self.servos[servo].is_owed_off() {
                self.switch_off(self.servos[servo].state.motor_off.newest, servo);
            } else {
                self.owe_disarming(servo);
            }
        }
        let offs = self.writes.iter().filter(|write| write.switches_off());
        let wire_ns = wire_ns(OFF_BYTES, self.baud) + FACTORY_RETURN_DELAY_NS;
        let take_ns = offs.map(|off| wire_ns + self.off_margin_ns(off)).sum();
        self.release_ns = RELEASE_NS.max(take_ns).min(LONGEST_RELEASE_NS);
        self.release_until_ns = None;
        self.release_ns
    }

    /// Whether motors are still to be told so: until all have confirmed it, and no longer than for the time that
    /// [`Bus::release_motors`] returned. That begins with the first packet, so that one is sent, however late.
    pub fn is_releasing(&self, now_ns: u64) -> bool {
        self.has_writes() && self.release_until_ns.is_none_or(|until_ns| now_ns < until_ns)
    }

    /// Tells what became of a command. One of several writes that fails is a command that failed.
    pub(crate) fn note(&mut self, servo: usize, number: u64, result: Result<(), WriteError>) {
        let Some(ServoState { motor_off, .. }) = self.servos.get_mut(servo).map(|servo| &mut servo.state)
        else {
            return;
        };
        self.has_outcomes = true;
        let done = Written { number, result };
        if number == motor_off.newest {
            motor_off.written = Some(done);
        } else if number != 0 {
            self.outcomes.push(servo, done);
        }
    }

    /// What became of the command of this number to this servo; `None` where it is not done with, or was so long ago. One that
    /// switches a motor off is not among them.
    pub fn outcome(&self, servo: usize, number: u64) -> Option<Result<(), WriteError>> {
        self.outcomes.of(servo, number)
    }

    /// Whether any are done with that were not taken over yet.
    pub(crate) fn has_outcomes(&self) -> bool {
        self.has_outcomes
    }

    /// Those of the commands that are done with, to be taken over by who keeps them; what became of those that switch motors off
    /// is in [`ServoState::motor_off`].
    pub(crate) fn take_outcomes(&mut self) -> &mut Outcomes {
        self.has_outcomes = false;
        &mut self.outcomes
    }
}
