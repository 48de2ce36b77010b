//! The slow lane: what is asked of one servo at a time, between two cycles.

use super::servo::{Servo, ServoIdentity};
use crate::dynamixel::registers::{HardwareError, WATCHDOG_TRIPPED, address, volts};

/// What is asked. Each has a length that nothing else has, so that an answer says what it answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Task {
    /// Addresses 0 to 10: model, firmware, baud rate, return delay, drive mode.
    Identity,
    /// Addresses 64 to 70: torque enable to hardware error.
    State,
    /// Address 98: whether its bus watchdog has stopped a motor that is on.
    Watchdog,
    /// Addresses 64 to 98, torque enable to bus watchdog: whether its motor was left on, where nothing longer may be asked.
    LeftOn,
    /// Addresses 144 to 146: voltage and temperature.
    Power,
}

/// What every servo is asked in turn. Motors that are on are asked besides, ahead of all this (`cycle/checks.rs`).
const ROUND: [Task; 2] = [Task::State, Task::Power];

/// Each servo's state and power are asked about once in this time.
const PERIOD_NS: u64 = 1_000_000_000;
/// Between two questions out of turn (identity, alert).
const URGENT_GAP_NS: u64 = 10_000_000;

/// From Torque Enable to Bus Watchdog.
const LEFT_ON_BYTES: u16 = address::BUS_WATCHDOG - address::TORQUE_ENABLE + 1;

impl Task {
    /// Address and number of bytes.
    pub(crate) fn span(self) -> (u16, u16) {
        match self {
            Task::Identity => (address::MODEL_NUMBER, 11),
            Task::State => (address::TORQUE_ENABLE, 7),
            Task::Watchdog => (address::BUS_WATCHDOG, 1),
            Task::LeftOn => (address::TORQUE_ENABLE, LEFT_ON_BYTES),
            Task::Power => (address::PRESENT_INPUT_VOLTAGE, 3),
        }
    }

    /// Takes the answer; `false` if it does not have the task's length, or has several tasks'.
    pub(crate) fn take(self, servo: &mut Servo, data: &[u8]) -> bool {
        let state = &mut servo.state;
        match (self, data) {
            (Task::Identity, [m0, m1, _, _, _, _, firmware, _, baud, delay, mode]) => {
                state.identity = Some(ServoIdentity {
                    model_number: u16::from_le_bytes([*m0, *m1]),
                    firmware: *firmware,
                    baud_register: *baud,
                    return_delay_us: 2 * u16::from(*delay),
                    drive_mode: *mode,
                });
            }
            (Task::State, [torque, _, _, _, _, _, error]) => {
                state.torque_enabled = Some(*torque != 0);
                if *torque == 0 {
                    // It is not asked any more.
                    state.watchdog_tripped = None;
                }
                state.hardware_error = Some(HardwareError(*error));
            }
            (Task::Watchdog, [steps]) => state.watchdog_tripped = Some(*steps == WATCHDOG_TRIPPED),
            (Task::Power, [v0, v1, celsius]) => {
                state.voltage_v = Some(volts(u16::from_le_bytes([*v0, *v1])));
                state.temperature_c = Some(*celsius);
            }
            _ => return false,
        }
        true
    }
}

/// Whose turn it is.
#[derive(Debug, Clone, Default)]
pub(crate) struct SlowLane {
    turn: usize,
    turn_ns: u64,
    /// Whether the last question was out of turn; then a turn that is due comes first.
    was_urgent: bool,
    urgent_ns: u64,
    urgent_turn: usize,
}

impl SlowLane {
    /// The next question, if one is due; only servos that answer are asked.
    pub(crate) fn next(&mut self, servos: &[Servo], now_ns: u64) -> Option<(usize, Task)> {
        let n = servos.len();
        let is_turn = now_ns >= self.turn_ns;
        let waits = std::mem::take(&mut self.was_urgent) && is_turn;
        if now_ns >= self.urgent_ns && !waits {
            for step in 0..n {
                let i = (self.urgent_turn + step) % n;
                if let Some(task) = urgent(&servos[i]) {
                    self.urgent_turn = i + 1;
                    self.urgent_ns = now_ns + URGENT_GAP_NS;
                    self.was_urgent = true;
                    return Some((i, task));
                }
            }
        }
        if !is_turn {
            return None;
        }
        let turns = ROUND.len() * n;
        self.turn_ns = now_ns + PERIOD_NS / (turns as u64).max(1);
        self.turn = (self.turn + 1) % turns;
        let (i, task) = (self.turn / ROUND.len(), ROUND[self.turn % ROUND.len()]);
        servos[i].state.alive.then_some((i, task))
    }
}

/// What a servo has to be asked before its turn.
fn urgent(servo: &Servo) -> Option<Task> {
    if !servo.state.alive {
        return None;
    }
    if servo.state.identity.is_none() {
        return Some(Task::Identity);
    }
    let unexplained = servo.state.alert && servo.state.hardware_error.is_none_or(HardwareError::is_none);
    unexplained.then_some(Task::State)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn servos(n: u8) -> Vec<Servo> {
        (1..=n)
            .map(|id| {
                let mut s = Servo::new(id);
                s.answered(0);
                s
            })
            .collect()
    }

    #[test]
    fn identity_comes_first_then_everything_once_a_second() {
        let mut servos = servos(3);
        let mut lane = SlowLane::default();
        let mut asked = Vec::new();
        for ms in 0..2_000_u64 {
            if let Some((i, task)) = lane.next(&servos, ms * 1_000_000) {
                let (_, bytes) = task.span();
                assert!(task.take(&mut servos[i], &vec![0; usize::from(bytes)]));
                asked.push((i, task));
            }
        }
        let count = |task| asked.iter().filter(|(_, t)| *t == task).count();
        assert_eq!(count(Task::Identity), 3);
        for i in 0..3 {
            for task in ROUND {
                let n = asked.iter().filter(|a| **a == (i, task)).count();
                assert!((1..=3).contains(&n), "servo {i}: {task:?} {n} times");
            }
        }
        assert!(asked.len() < 20);
    }

    #[test]
    fn an_alert_is_looked_into_at_once_and_the_dead_are_not_asked() {
        let mut servos = servos(2);
        for s in &mut servos {
            assert!(Task::Identity.take(s, &[0; 11]));
        }
        let mut lane = SlowLane::default();
        while lane.next(&servos, 0).is_some() {}
        servos[1].state.alert = true;
        assert_eq!(lane.next(&servos, 20_000_000), Some((1, Task::State)));
        assert!(Task::State.take(&mut servos[1], &[1, 0, 0, 0, 0, 0, 0x20]));
        assert_eq!(servos[1].state.hardware_error, Some(HardwareError(0x20)));
        assert_eq!(servos[1].state.torque_enabled, Some(true));
        assert_eq!(lane.next(&servos, 40_000_000), None);
        for s in &mut servos {
            s.state.alive = false;
            s.state.identity = None;
        }
        assert!((0..100).all(|s| lane.next(&servos, s * 1_000_000_000).is_none()));
    }

    #[test]
    fn a_question_out_of_turn_that_is_never_explained_keeps_no_other_waiting() {
        let mut servos = servos(3);
        for servo in &mut servos {
            assert!(Task::Identity.take(servo, &[0; 11]));
        }
        servos[0].state.alert = true;
        let mut lane = SlowLane::default();
        let asked: Vec<_> = (0..200)
            .filter_map(|n| lane.next(&servos, n * 10_000_000))
            .collect();
        for question in [
            (0, Task::State),
            (1, Task::State),
            (2, Task::State),
            (2, Task::Power),
        ] {
            assert!(asked.contains(&question), "{question:?}");
        }
    }

    #[test]
    fn an_answer_of_another_length_is_not_taken() {
        let mut servo = Servo::new(1);
        assert!(!Task::Power.take(&mut servo, &[0; 7]));
        assert!(!Task::State.take(&mut servo, &[]));
        assert!(!Task::Identity.take(&mut servo, &[0; 12]));
        assert_eq!(servo.state.voltage_v, None);
    }
}
