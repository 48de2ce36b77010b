//! Goals of several servos in one packet, so that all take them at the same instant.
//!
//! Nobody answers a sync write; so the servos are asked behind it what they hold: Bus Watchdog and Goal PWM.

use super::requests::load;
use super::{Bus, WRITE_TRIES};
use crate::dynamixel::bus::pass::{Answer, Kind};
use crate::dynamixel::bus::writes::{WriteCommand, WriteError, WriteRefused, check_goals};
use crate::dynamixel::protocol2::Assignment;
use crate::dynamixel::registers::{WATCHDOG_TRIPPED, address};
use crate::error::MAX_JOINTS;

/// From Bus Watchdog to Goal PWM; no other question has this length.
const HELD_BYTES: u16 = address::GOAL_PWM + 2 - address::BUS_WATCHDOG;

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
            _ if !self.pass_active => 0,
            Kind::Write => 1,
            Kind::Together | Kind::ReadBack => self.pass.order.len(),
            Kind::Plain | Kind::Fast | Kind::Slow(_) | Kind::Watchdog => 0,
        }
    }

    /// Prepares the packet with the goals at the front that belong together; `false` where it is only one.
    pub(super) fn write_together(&mut self) -> bool {
        let Some(first) = self.writes.front().copied() else {
            return false;
        };
        let mut goals = [(0, [0; 2]); MAX_JOINTS];
        self.pass.order.clear();
        let same = (self.writes.iter())
            .take_while(|write| write.address == address::GOAL_PWM && write.number == first.number);
        for (goal, write) in goals.iter_mut().zip(same) {
            *goal = (self.servos[write.servo].id, write.data);
            self.pass.order.push(write.servo);
        }
        let count = self.pass.order.len();
        if first.number == 0 || count < 2 {
            return false;
        }
        let mut assignments = [Assignment { id: 0, data: &[] }; MAX_JOINTS];
        for (assignment, (id, data)) in assignments.iter_mut().zip(&goals[..count]) {
            *assignment = Assignment { id: *id, data };
        }
        load(
            &mut self.request,
            self.encoder.sync_write(address::GOAL_PWM, &assignments[..count]),
        );
        self.pass.begin(Kind::Together, address::GOAL_PWM, 0);
        self.activate();
        true
    }

    /// Asks those servos what they hold now.
    pub(super) fn read_goals_back(&mut self) {
        let mut ids = [0; MAX_JOINTS];
        let count = self.pass.order.len();
        for (id, servo) in ids.iter_mut().zip(&self.pass.order) {
            *id = self.servos[*servo].id;
        }
        let before = self.pass.request_bytes;
        let packet = self
            .encoder
            .sync_read(address::BUS_WATCHDOG, HELD_BYTES, &ids[..count]);
        load(&mut self.request, packet);
        self.pass.begin(Kind::ReadBack, address::BUS_WATCHDOG, HELD_BYTES);
        self.activate();
        // The goals may still be on the wire.
        self.pass.request_bytes += before;
    }

    /// A servo says what it holds.
    pub(super) fn take_goal(&mut self, position: usize, data: &[u8]) {
        let Some(write) = self.writes.get(position).copied() else {
            return;
        };
        let held = data.len() == usize::from(HELD_BYTES)
            && data[0] != WATCHDOG_TRIPPED
            && data[data.len() - 2..] == write.data;
        let result = if held { Ok(()) } else { Err(WriteError::NotHeld) };
        self.end_goal(position, result);
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
