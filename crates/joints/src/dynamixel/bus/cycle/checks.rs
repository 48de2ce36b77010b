//! Motors that are on: once a second their servos say whether they still are, and under which watchdog.
//!
//! Until then one that has restarted with its motor on, and has forgotten its watchdog, runs on. So nothing slower goes before
//! it, however full the bus is, and all are asked in one packet: shorter, there and back, than the usual question, and fed by it
//! as by that. A round is for all of them; those whose answers are missed are asked again in the next cycle.

use super::Bus;
use crate::dynamixel::bus::pass::{Answer, Kind};
use crate::dynamixel::bus::servo::Servo;
use crate::dynamixel::bus::slow::Task;

/// What they are asked for. First the watchdog, which tells a restart from a motor that has gone off.
const CHECKS: [Task; 2] = [Task::Watchdog, Task::State];

/// From one round to the next, nanoseconds; with the answers it is less than a second.
const ROUND_NS: u64 = 800_000_000;

/// When they are asked.
#[derive(Debug, Default)]
pub(super) struct Checks {
    /// Which question of this cycle is next.
    turn: usize,
    /// When the newest cycle had read all positions, and when the newest round began, nanoseconds.
    occasion_ns: u64,
    round_ns: u64,
}

impl Bus {
    /// A cycle begins.
    pub(super) fn begin_checks(&mut self) {
        self.checks.turn = if self.ends { CHECKS.len() } else { 0 };
    }

    /// Asks the next question of this cycle; `false` where none is left.
    pub(super) fn ask_check(&mut self, now_ns: u64) -> bool {
        if self.checks.turn == 0 {
            self.begin_round(now_ns);
        }
        while let Some(task) = CHECKS.get(self.checks.turn).copied() {
            let check = self.checks.turn;
            self.checks.turn += 1;
            let due = (0..self.servos.len()).filter(|i| is_due(&self.servos[*i], check));
            self.pass.order.clear();
            self.pass.order.extend(due);
            if !self.pass.order.is_empty() {
                self.ask(Kind::Slow(task), task);
                return true;
            }
        }
        false
    }

    /// Begins a round where in the next cycle, which comes as late as this one came, it would be too late.
    fn begin_round(&mut self, now_ns: u64) {
        let apart_ns = now_ns.saturating_sub(self.checks.occasion_ns);
        self.checks.occasion_ns = now_ns;
        if now_ns.saturating_sub(self.checks.round_ns) + apart_ns > ROUND_NS {
            self.checks.round_ns = now_ns;
            self.servos.iter_mut().for_each(|servo| servo.check_soon());
        }
    }

    /// Those servos have said so, or will not any more. Those that may only have waited for a silent one are asked again.
    pub(super) fn end_check(&mut self, task: Task) {
        let Some(check) = CHECKS.iter().position(|check| *check == task) else {
            return;
        };
        for (position, i) in self.pass.order.iter().copied().enumerate() {
            let asks = &mut self.servos[i].check_asks[check];
            match self.pass.answers[position] {
                Answer::Got => *asks = 0,
                Answer::Awaited if !self.pass.is_silent(position) => {}
                _ => *asks = asks.saturating_sub(1),
            }
        }
    }
}

/// Whether a servo is to say this now: of a motor that is on, and whether one is that is to be off. Nobody asks one that was
/// silent when it was asked last, before it answers.
fn is_due(servo: &Servo, check: usize) -> bool {
    let is_on = servo.state.torque_enabled == Some(true) || servo.state.may_run;
    let concerns = is_on || CHECKS[check] == Task::State && servo.is_to_be_off;
    servo.check_asks[check] > 0 && concerns && servo.state.alive && servo.silent_in_a_row == 0
}
