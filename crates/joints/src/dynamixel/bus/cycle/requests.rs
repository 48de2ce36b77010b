//! Which request comes next, and what follows from a request that is over.

use super::{
    Bus, FAST_AGAIN_NS, FAST_TRIES, FastState, LEADS, LEFT_ON_BYTES, LEFT_ON_LEAD, OFFS_NS, PASSES,
    SLOW_SHARE, SUSPICION_NS,
};
use crate::dynamixel::bus::pass::{Answer, Kind};
use crate::dynamixel::bus::reading::PRESENT_BYTES;
use crate::dynamixel::bus::servo::Servo;
use crate::dynamixel::bus::slow::Task;
use crate::dynamixel::bus::writes::{Write, WriteError, WriteRefused};
use crate::dynamixel::protocol2::STATUS_OVERHEAD;
use crate::dynamixel::registers::address;
use crate::error::MAX_JOINTS;

impl Bus {
    /// Servos that are to say whether their motors were left on are asked for that with their positions, before the others. Not
    /// where a motor runs that was switched on here: the longer question would keep the bus, and might have its watchdog stop it.
    pub(super) fn let_left_on_pass(&mut self) {
        let servos = &self.servos;
        let is_to_say = |i: &usize| servos[*i].is_to_say_left_on();
        if servos.iter().any(Servo::is_watched) || !self.pass.order.iter().any(is_to_say) {
            return;
        }
        let others = self.pass.order.iter().filter(|i| !is_to_say(i));
        self.behind.extend(others);
        self.pass.order.retain(is_to_say);
    }

    /// Prepares a request for the positions of the servos in `pass.order`.
    pub(super) fn ask_positions(&mut self, kind: Kind, now_ns: u64) {
        if self
            .suspicious_ns
            .is_some_and(|t| now_ns.saturating_sub(t) > SUSPICION_NS)
        {
            self.suspicious_ns = None;
            self.lead = 0;
        }
        let asks_left_on = (self.pass.order.iter()).all(|i| self.servos[*i].is_to_say_left_on())
            && !self.servos.iter().any(Servo::is_watched);
        let (kind, lead) = match asks_left_on {
            true => (Kind::Plain, self.lead + LEFT_ON_LEAD),
            false => (kind, self.lead),
        };
        let length = PRESENT_BYTES as u16 + lead;
        let at = address::PRESENT_PWM - lead;
        self.pass.begin(kind, at, length);
        self.passes += 1;
        let mut ids = [0_u8; 256];
        for (id, servo) in ids.iter_mut().zip(&self.pass.order) {
            *id = self.servos[*servo].id;
        }
        let ids = &ids[..self.pass.order.len()];
        let packet = if kind == Kind::Fast {
            self.encoder.fast_sync_read(at, length, ids)
        } else {
            self.encoder.sync_read(at, length, ids)
        };
        load(&mut self.request, packet);
        self.activate();
    }

    /// Decides what comes after the pass that ended; `false` if the cycle is over.
    pub(super) fn next_request(&mut self, now_ns: u64) -> bool {
        self.end_repeats(now_ns);
        if self.again.is_empty() && !self.behind.is_empty() {
            self.again.append(&mut self.behind);
            self.passes = 0;
        }
        if !self.writes_done && !self.offs_done {
            self.switch_off_again(now_ns);
            self.repeat_offs(now_ns);
            self.disarm_left();
        }
        let write = (self.writes.front().copied())
            .filter(|write| !self.is_done_with(write) || self.is_first_off(write, now_ns));
        if let Some(write) = write.filter(|write| write.urgent || self.again.is_empty()) {
            self.offs_untold = false;
            if !self.ask_watchdogs() {
                self.tell(write);
            }
            return true;
        }
        if !self.again.is_empty() {
            self.pass.order.clear();
            self.pass.order.append(&mut self.again);
            self.ask_positions(Kind::Plain, now_ns);
            return true;
        }
        if self.ends && self.ask_armed() {
            return true;
        }
        if !std::mem::replace(&mut self.left_on_done, true) && self.ask_left_on() {
            return true;
        }
        if self.ask_check(now_ns) {
            return true;
        }
        if self.slow_done {
            return false;
        }
        self.slow_done = true;
        // On a slow bus the questions come less often, so that they take a small part of its time.
        let busy_ns = now_ns.saturating_sub(self.begun_ns);
        if now_ns.saturating_sub(self.slow_ns) < SLOW_SHARE * busy_ns {
            return false;
        }
        let Some((servo, task)) = self.lane.next(&self.servos, now_ns) else {
            return false;
        };
        self.slow_ns = now_ns;
        self.ask_one(servo, task);
        true
    }

    fn ask_one(&mut self, servo: usize, task: Task) {
        self.pass.order.clear();
        self.pass.order.push(servo);
        self.ask(Kind::Slow(task), task);
    }

    /// Prepares a question to the servos in `pass.order`, of which there are some.
    pub(super) fn ask(&mut self, kind: Kind, task: Task) {
        let (at, length) = task.span();
        let mut ids = [0; MAX_JOINTS];
        for (id, servo) in ids.iter_mut().zip(&self.pass.order) {
            *id = self.servos[*servo].id;
        }
        let packet = match self.pass.order.len() {
            1 => Some(self.encoder.read(ids[0], at, length)),
            count => self.encoder.sync_read(at, length, &ids[..count]),
        };
        load(&mut self.request, packet);
        self.pass.begin(kind, at, length);
        self.activate();
    }

    /// Where a motor runs that was switched on here, asks one of the others whether its own was left on, in turn: that question
    /// and its answer are shorter than the usual question to two servos.
    fn ask_left_on(&mut self) -> bool {
        if !self.servos.iter().any(Servo::is_watched) {
            return false;
        }
        let is_to_say = |i: &usize| {
            let servo = &self.servos[*i];
            servo.is_to_say_left_on() && servo.state.alive && !servo.state.may_run
        };
        let to_say = (0..self.servos.len()).filter(is_to_say);
        let Some(servo) = to_say.max_by_key(|i| self.servos[*i].left_on_asks) else {
            return false;
        };
        self.ask_one(servo, Task::LeftOn);
        true
    }

    /// Whether it switches a motor off, and nobody was waited for in vain for it: it is in this cycle, whoever was not heard in it,
    /// but not for so long that the others are not read.
    pub(super) fn is_first_off(&self, write: &Write, now_ns: u64) -> bool {
        write.urgent && write.tries == 0 && now_ns.saturating_sub(self.begun_ns) < OFFS_NS
    }

    /// Whether no more like it are sent in this cycle.
    fn is_done_with(&self, write: &Write) -> bool {
        self.writes_done || write.urgent && self.offs_done
    }

    /// No more like it are sent in this cycle.
    pub(super) fn be_done_with(&mut self, write: &Write) {
        match write.urgent {
            true => self.offs_done = true,
            false => self.writes_done = true,
        }
    }

    /// Where nothing else is urgent, has motors told again to be off, in one packet, of which nobody knows whether they are.
    fn switch_off_again(&mut self, now_ns: u64) {
        if self.has_urgent() {
            return;
        }
        for servo in 0..self.servos.len() {
            if self.servos[servo].is_off_due(now_ns) && !self.is_being_started(servo) {
                self.insert_first_off(servo, 0);
            }
        }
    }

    /// Whether a start waits that begins with switching the motor off.
    pub(super) fn is_being_started(&self, servo: usize) -> bool {
        let mut writes = self.writes.iter();
        writes.any(|write| write.servo == servo && write.is_motor_off())
    }

    pub(super) fn activate(&mut self) {
        self.pass.request_bytes = self.request.len();
        self.pass_active = true;
    }

    /// Draws the conclusions of a pass that is complete or past its deadline.
    pub(super) fn end_pass(&mut self, now_ns: u64) {
        self.pass_active = false;
        if self.pass.kind == Kind::Told {
            return self.read_back();
        }
        for (servo, answer) in self.pass.order.iter().zip(&self.pass.answers) {
            let came = *answer != Answer::Awaited;
            let bytes = came.then_some(usize::from(self.pass.data_bytes));
            // A servo answers a fast sync read with its part of one packet, which is late as a whole.
            self.servos[*servo].has_told(bytes, !came && self.pass.kind != Kind::Fast);
        }
        let unanswered = self.pass.answers.contains(&Answer::Awaited);
        if unanswered || self.pass.refused.is_some() {
            // An answer may still come, as an error number is one to whatever was asked: the next requests ask for another length.
            self.suspicious_ns = Some(now_ns);
            self.lead = (self.lead + 1) % LEADS;
        }
        match self.pass.kind {
            Kind::Watchdog => self.end_watchdogs(),
            Kind::ReadBack if self.pass.order.len() == 1 => self.end_write(now_ns),
            Kind::ReadBack if self.pass.told == 0 => {}
            Kind::ReadBack if self.writes.front().is_some_and(|write| write.urgent) => self.end_offs(now_ns),
            Kind::ReadBack => self.end_together(),
            Kind::Told => {}
            Kind::Slow(task) => self.end_slow(task, unanswered && !self.pass.left),
            Kind::Plain => self.end_plain(now_ns),
            Kind::Fast => self.end_fast(unanswered, now_ns),
        }
    }

    fn end_slow(&mut self, task: Task, is_silent: bool) {
        self.counters.slow_unanswered += u64::from(is_silent);
        if self.ends {
            self.end_armed();
        } else if task == Task::LeftOn && !self.pass.left {
            let servo = &mut self.servos[self.pass.order[0]];
            servo.left_on_asks = servo.left_on_asks.saturating_sub(1);
        } else {
            self.end_check(task);
        }
    }

    fn end_plain(&mut self, now_ns: u64) {
        self.again.clear();
        let was_asked_left_on = usize::from(self.pass.data_bytes) >= LEFT_ON_BYTES;
        for (position, i) in self.pass.order.iter().copied().enumerate() {
            let servo = &mut self.servos[i];
            match self.pass.answers[position] {
                Answer::Got => {}
                Answer::Damaged => servo.answered(now_ns),
                Answer::Awaited if self.pass.is_silent(position) => servo.was_silent(now_ns),
                Answer::Awaited => {
                    self.again.push(i);
                    continue;
                }
            }
            servo.left_on_asks -= u8::from(was_asked_left_on && servo.left_on_asks > 0);
        }
        if self.passes >= PASSES {
            self.again.clear();
        }
    }

    fn end_fast(&mut self, unanswered: bool, now_ns: u64) {
        let whole = self.pass.answers.iter().all(|a| *a == Answer::Got);
        if whole {
            self.fast_failures = 0;
            self.fast = FastState::On;
            self.fast_worked = true;
        } else if unanswered && !self.pass.left {
            self.fast_failures += 1;
            if self.pass.fast_refused || self.fast_failures >= FAST_TRIES {
                self.fast = FastState::NotSupported;
                // What has worked is known to all; a host that was held up may have missed it.
                self.fast_again_ns = self.fast_worked.then_some(now_ns + FAST_AGAIN_NS);
            }
        }
        // The first one missing comes last, where it holds up nobody.
        self.again.clear();
        let mut first = None;
        for (position, i) in self.pass.order.iter().copied().enumerate() {
            if self.pass.answers[position] != Answer::Awaited {
                continue;
            }
            if self.servos[i].rest.until_ns.is_some() && !self.pass.left {
                // It had been silent and was asked last: it still is.
                self.servos[i].was_silent(now_ns);
            } else if first.is_none() {
                first = Some(i);
            } else {
                self.again.push(i);
            }
        }
        self.again.extend(first);
    }

    /// What was out in vain is at the front again, and goes behind what has become urgent meanwhile. A motor that is to be
    /// off is told nothing else.
    pub(super) fn let_urgent_pass(&mut self) {
        let writes = self.writes.make_contiguous();
        let again = writes.iter().position(|write| write.urgent).unwrap_or(0);
        if again == 0 {
            return;
        }
        let urgent = writes[again..].iter().take_while(|write| write.urgent).count();
        writes[..again + urgent].rotate_left(again);
        for i in (urgent..urgent + again).rev() {
            let write = self.writes[i];
            let mut offs = self.writes.iter().take(urgent);
            if offs.any(|off| off.servo == write.servo) {
                self.writes.remove(i);
                self.note(write.servo, write.number, Err(WriteError::SwitchedOff));
            }
        }
    }

    /// A write goes behind those that follow and of which this says so; says whether there are any.
    pub(super) fn let_pass(&mut self, at: usize, passes: impl Fn(&Write) -> bool) -> bool {
        let passing = self.writes.iter().skip(at + 1).take_while(|write| passes(write));
        let count = passing.count();
        self.writes.make_contiguous()[at..=at + count].rotate_left(1);
        count > 0
    }

    /// A start has failed with this write. What is left of it is not told, nor are the goals behind it, and a motor that runs, or
    /// may by now, is switched off. One that is off needs no watchdog, and another program no motor that it stops.
    pub(super) fn call_off_start(&mut self, failed: &Write) {
        let mut is_own = !failed.last;
        let mut i = 0;
        while let Some(next) = self.writes.get(i).copied() {
            if next.servo != failed.servo {
                i += 1;
                continue;
            }
            // The rest of it, and the goals behind it: what comes then has the motor switched off first.
            if next.urgent || !is_own && !next.is_goal() {
                break;
            }
            is_own &= !next.last;
            self.refuse(i, WriteRefused::MotorOff(next.servo));
            i = 0;
        }
        let servo = &mut self.servos[failed.servo];
        if servo.state.may_run || servo.state.torque_enabled == Some(true) {
            servo.owe_off();
        } else if servo.is_armed == Some(true) {
            self.disarm(failed.servo);
        }
    }
}

pub(super) fn load(request: &mut Vec<u8>, packet: Option<&[u8]>) {
    request.clear();
    // At most 64 servos are asked, so every request fits in a packet.
    request.extend_from_slice(packet.unwrap_or_default());
}

const _: () = assert!(
    STATUS_OVERHEAD + PRESENT_BYTES == 23,
    "a status packet with the twelve bytes from Present PWM to Present Position"
);
