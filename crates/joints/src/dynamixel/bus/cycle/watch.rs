//! Motors that were switched on here: whether they still are, and under the watchdog that was armed. And those that a daemon
//! before has left on.
//!
//! A servo that restarts forgets its watchdog, and may come back with its motor on (Startup Configuration, address 60). So
//! none is given a goal that may have restarted since its watchdog was known.

use super::{Bus, WRITE_TRIES};
use crate::dynamixel::bus::pass::{Answer, Kind};
use crate::dynamixel::bus::slow::Task;
use crate::dynamixel::bus::writes::{MotorLost, Write, WriteError, WriteRefused};
use crate::dynamixel::registers::{WATCHDOG_TRIPPED, address};

impl Bus {
    /// Why a motor that is off is given no goal.
    pub(super) fn motor_off(&self, joint: usize) -> WriteRefused {
        match self.servos[joint].state.motor_lost {
            Some(lost) => WriteRefused::MotorLost { joint, lost },
            None => WriteRefused::MotorOff(joint),
        }
    }

    /// Behind the opening of a port a servo has told all from Torque Enable to Bus Watchdog, or beyond. A motor that is on, though
    /// nobody has switched it on since, was left on: where its watchdog is armed, whoever armed it relies on that to stop it, and
    /// it does not, since reading feeds it. One that is on without a watchdog is another program's. One that is off under a
    /// watchdog was left so between the two, and the watchdog alone is cleared.
    pub(super) fn take_left_on(&mut self, servo: usize, data: &[u8]) {
        if std::mem::take(&mut self.servos[servo].left_on_asks) == 0 {
            return;
        }
        let is_ours = self.servos[servo].state.may_run || self.servos[servo].is_to_be_off;
        self.take_told(servo, Task::State, told(Task::State, data));
        if self.servos[servo].state.torque_enabled != Some(true) {
            if !is_ours && matches!(told(Task::Watchdog, data), [1..=127 | WATCHDOG_TRIPPED]) {
                self.servos[servo].left_armed_cycle = Some(self.counters.cycles);
            }
            return;
        }
        self.take_told(servo, Task::Watchdog, told(Task::Watchdog, data));
        let is_armed = matches!(told(Task::Watchdog, data), [1..=127]);
        if is_armed && !is_ours {
            self.lose_motor(servo, MotorLost::LeftOn);
        }
    }

    /// Has those watchdogs cleared, behind all that are to be off: whoever drives such a motor next without knowing of it has its
    /// goals refused. Not where somebody here starts the motor, which begins with that. And only in a later cycle: if there is
    /// another servo with this id, whose motor may be on, its answer has come by then.
    pub(super) fn disarm_left(&mut self) {
        for servo in 0..self.servos.len() {
            let is_told_more = self.writes.iter().any(|write| write.servo == servo);
            let left = &mut self.servos[servo];
            if left
                .left_armed_cycle
                .take_if(|cycle| *cycle < self.counters.cycles)
                .is_none()
                || is_told_more
                || self.ends
                || left.may_be_shared()
                || left.is_owed_off()
                || left.state.may_run
                || left.state.torque_enabled != Some(false)
            {
                continue;
            }
            // One that was armed here, before the port was lost, is nobody else's.
            left.has_left_watchdog = left.is_armed != Some(true);
            self.disarm(servo);
        }
    }

    /// At the end a watchdog is cleared that was armed here for a motor that is off by now, or another program's: it would stop
    /// that one's. Of two servos with one id either may be on.
    pub(super) fn owe_disarming(&mut self, servo: usize) {
        let is_told_more = self.writes.iter().any(|write| write.servo == servo);
        let servo = &mut self.servos[servo];
        if servo.is_armed == Some(true) && !is_told_more && !servo.is_shared(self.begun_ns) {
            servo.disarm_asks = WRITE_TRIES;
        }
    }

    /// Asks those servos what is armed and what is on by now, once nothing else is to be told; `false` where there are none.
    pub(super) fn ask_armed(&mut self) -> bool {
        let owed = |i: &usize| self.servos[*i].disarm_asks > 0;
        let servos = 0..self.servos.len();
        self.pass.order.clear();
        self.pass.order.extend(servos.filter(owed));
        if self.pass.order.is_empty() || !self.writes.is_empty() {
            return false;
        }
        // Nobody waits for one that rests.
        let servos = &self.servos;
        self.pass.order.sort_unstable_by_key(|i| (servos[*i].rests(), *i));
        self.offs_untold = false;
        self.ask(Kind::Slow(Task::LeftOn), Task::LeftOn);
        true
    }

    /// Such a servo says so. Its watchdog is left alone where it is another one's by now; and one that has stopped a motor which
    /// is on would let it turn again.
    pub(super) fn take_armed(&mut self, servo: usize, data: &[u8]) {
        let asks = std::mem::take(&mut self.servos[servo].disarm_asks);
        let is_on = told(Task::State, data)[0] != 0;
        let is_ours = match told(Task::Watchdog, data) {
            [WATCHDOG_TRIPPED] => !is_on,
            [steps] => *steps == self.watchdog_steps,
            _ => false,
        };
        if asks > 0 && is_ours {
            self.disarm(servo);
        }
    }

    /// Those servos have said so, or will not any more. Those that may only have waited for a silent one are asked again.
    pub(super) fn end_armed(&mut self) {
        for (position, i) in self.pass.order.iter().copied().enumerate() {
            let servo = &mut self.servos[i];
            match self.pass.answers[position] {
                Answer::Awaited if !self.pass.left && !self.pass.is_silent(position) => {}
                Answer::Awaited if !servo.state.alive => servo.disarm_asks = 0,
                _ => servo.disarm_asks = servo.disarm_asks.saturating_sub(1),
            }
        }
    }

    /// A servo has told something between two cycles: of a motor that was switched on here, it may be that it is lost.
    pub(super) fn take_told(&mut self, servo: usize, task: Task, data: &[u8]) {
        let was_on = self.servos[servo].state.torque_enabled == Some(true);
        if !task.take(&mut self.servos[servo], data) {
            return;
        }
        match (task, data) {
            (Task::State, [0, ..]) if self.is_settled(servo) && self.servos[servo].runs() => {
                match was_on {
                    true => self.lose_motor(servo, MotorLost::GoneOff),
                    // That it was not switched on was told to whoever wanted it.
                    false => self.servos[servo].state.may_run = false,
                }
            }
            (Task::State, [torque, ..])
                if *torque != 0 && self.servos[servo].is_to_be_off && self.is_settled(servo) =>
            {
                self.still_on(servo);
            }
            // Another program has switched it on again.
            (Task::State, [1..=u8::MAX, ..]) if !self.servos[servo].state.motor_off.unconfirmed => {
                self.servos[servo].state.motor_lost = None;
            }
            (Task::Watchdog, [watchdog]) if self.is_armed(servo) => {
                let armed = self.watchdog_steps;
                match *watchdog {
                    WATCHDOG_TRIPPED => self.servos[servo].is_watch_known = true,
                    steps if steps == armed => self.servos[servo].is_watch_known = true,
                    0 => self.lose_motor(servo, MotorLost::Restarted),
                    watchdog => self.lose_motor(servo, MotorLost::Meddled { watchdog, armed }),
                }
            }
            // Its servo has restarted, or another program has cleared it.
            (Task::Watchdog, [0]) => self.servos[servo].is_armed = Some(false),
            _ => {}
        }
    }

    /// A servo that is to be off says that its motor is on.
    pub(super) fn still_on(&mut self, servo: usize) {
        let number = self.servos[servo].state.motor_off.newest;
        self.note(servo, number, Err(WriteError::StillOn));
        self.servos[servo].owe_off();
    }

    /// Whether a servo is still to be told nothing but goals.
    fn is_settled(&self, servo: usize) -> bool {
        let mut own = self.writes.iter().filter(|write| write.servo == servo);
        own.all(Write::is_goal)
    }

    /// Whether a servo's watchdog is to be armed by now, though it is still to be told something.
    fn is_armed(&self, servo: usize) -> bool {
        let mut own = self.writes.iter().filter(|write| write.servo == servo);
        match own.find(|write| write.address != address::GOAL_PWM) {
            None => self.servos[servo].runs(),
            Some(write) if write.is_motor_off() => self.servos[servo].runs() && !write.urgent,
            // It is armed before the motor is switched on.
            Some(write) => write.address == address::TORQUE_ENABLE,
        }
    }

    /// A motor is on no longer, or without the watchdog that was armed, or nobody's here: it is given no goal, and in the latter case switched
    /// off until it confirms that.
    fn lose_motor(&mut self, servo: usize, lost: MotorLost) {
        let refused = WriteRefused::MotorLost { joint: servo, lost };
        while let Some(at) = self.writes.iter().position(|write| write.servo == servo) {
            if !self.writes[at].moves() {
                // It is about to be started anew, which begins with switching it off.
                return;
            }
            self.refuse(at, refused);
        }
        self.servos[servo].state.motor_lost = Some(lost);
        let servo = &mut self.servos[servo];
        match lost {
            MotorLost::GoneOff => servo.state.may_run = false,
            // Once: where it is on again later, another program wants it so.
            MotorLost::LeftOn => servo.owe_off(),
            MotorLost::Restarted | MotorLost::Meddled { .. } => {
                servo.is_to_be_off = true;
                servo.owe_off();
            }
        }
    }

    /// Takes a write out of the queue, and with it those that are to be done together with it or not at all.
    pub(super) fn refuse(&mut self, at: usize, refused: WriteRefused) {
        if let Some(write) = self.writes.remove(at) {
            self.counters.writes_failed += 1;
            self.note(write.servo, write.number, Err(WriteError::NotTaken(refused)));
            self.refuse_others(&write, refused);
        }
    }

    /// Takes those goals out of the queue that were to be given together with this one. Once one was sent, all were.
    pub(super) fn refuse_others(&mut self, of: &Write, refused: WriteRefused) {
        if of.number == 0 || of.is_sent || !of.is_goal() {
            return;
        }
        let is_other = |write: &Write| write.number == of.number && write.is_goal();
        while let Some(at) = self.writes.iter().position(is_other) {
            if let Some(write) = self.writes.remove(at) {
                self.counters.writes_failed += 1;
                self.note(write.servo, write.number, Err(WriteError::NotTaken(refused)));
            }
        }
    }

    /// Asks those servos for their watchdogs whose motors are to be told next to move, and which may have restarted; `false`
    /// where none may have.
    pub(super) fn ask_watchdogs(&mut self) -> bool {
        let Some(first) = self.writes.front().copied() else {
            return false;
        };
        self.pass.order.clear();
        let alike = (self.writes.iter()).take_while(|write| {
            write.number == first.number && write.address == first.address && write.moves()
        });
        for write in alike {
            if !self.servos[write.servo].is_watch_known && !self.pass.order.contains(&write.servo) {
                self.pass.order.push(write.servo);
            }
        }
        if self.pass.order.is_empty() {
            return false;
        }
        self.ask(Kind::Watchdog, Task::Watchdog);
        true
    }

    /// Those servos have told their watchdogs, or will not any more. As long as one has not that may still do so, nobody is
    /// told to move of those who are to do it together; then those who have.
    pub(super) fn end_watchdogs(&mut self) {
        let refused = self.pass.refused;
        let is_open = |bus: &Self, servo: usize| {
            let next = bus.writes.iter().find(|write| write.servo == servo);
            !bus.servos[servo].is_watch_known && next.is_some_and(Write::moves)
        };
        let (mut tries, mut any_lives) = (0, false);
        for position in 0..self.pass.order.len() {
            let servo = self.pass.order[position];
            if !is_open(self, servo) {
                continue;
            }
            any_lives |= self.servos[servo].state.alive;
            if let Some(next) = self.writes.iter_mut().find(|write| write.servo == servo) {
                next.tries += 1;
                tries = next.tries.max(tries);
            }
        }
        if tries == 0 {
            return;
        }
        if refused.is_none() && any_lives && tries < WRITE_TRIES {
            self.writes_done = !self.writes.front().is_some_and(|write| write.urgent);
            return;
        }
        for position in 0..self.pass.order.len() {
            let servo = self.pass.order[position];
            if !is_open(self, servo) {
                continue;
            }
            let error = match (self.pass.answers[position], refused) {
                (Answer::Awaited, _) => WriteError::Silent,
                (Answer::Got, Some(error)) => WriteError::Servo(error),
                (Answer::Got, None) | (Answer::Damaged, _) => WriteError::Damaged,
            };
            self.refuse_move(servo, error);
        }
    }

    /// A motor is not told to move whose watchdog nobody knows, nor switched on without the goal that it was to begin with.
    fn refuse_move(&mut self, servo: usize, error: WriteError) {
        let Some(at) = self.writes.iter().position(|write| write.servo == servo) else {
            return;
        };
        if let Some(write) = self.writes.remove(at) {
            self.counters.writes_failed += 1;
            self.note(servo, write.number, Err(error));
            if !write.is_goal() {
                self.call_off_start(&write);
            }
        }
    }
}

/// What answers a task, among all from Torque Enable on.
fn told(task: Task, data: &[u8]) -> &[u8] {
    let (at, length) = task.span();
    &data[usize::from(at - address::TORQUE_ENABLE)..][..usize::from(length)]
}
