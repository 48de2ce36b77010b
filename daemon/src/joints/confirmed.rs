//! Waiting until servos have confirmed what they were told.
//!
//! How long that takes follows from the bus: how wide its margin is, who is silent on it, and what else waits. So its thread is
//! waited for as long as it works, and whoever asked hears what became of it.

use super::Hold;
use std::time::Duration;
use taxel_joints::ServoReader;
use taxel_joints::bus::{WriteCommand, WriteError};
use tokio::time::{Instant, sleep};

/// A thread that has done nothing for so long hangs. No request takes longer: one to 64 silent servos at 9600 bit/s, with the
/// widest margin, is given up after 2.7 s.
const HANGS: Duration = Duration::from_secs(3);
/// How long who asks for something else behind it, which may be torque off, is kept from that; and who has a motor switched off
/// from being told that nobody knows yet whether it is.
const PATIENCE: Duration = Duration::from_secs(2);
const LOOK: Duration = Duration::from_millis(2);

/// Waits until a servo has confirmed the command of this number.
pub(super) async fn confirmed(
    servos: &ServoReader,
    hold: &Hold<'_>,
    joint: usize,
    command: WriteCommand,
    number: u64,
) -> Result<(), WriteError> {
    let is_off = command == WriteCommand::Torque(false);
    let look = || match is_off {
        // A newer one has taken its place.
        true => (servos.motor_off(joint).written)
            .filter(|off| off.number >= number)
            .map(|off| off.result),
        false => servos.outcome(joint, number),
    };
    let is_pressed = || is_off || hold.is_pressed();
    let done = looked_for(look, || servos.steps(), is_pressed).await;
    done.unwrap_or(Err(WriteError::Unconfirmed))
}

/// Waits until each of several servos has confirmed its goal, all of this number.
pub(super) async fn all_confirmed(
    servos: &ServoReader,
    hold: &Hold<'_>,
    goals: &[(usize, i16)],
    number: u64,
) -> Vec<Result<(), WriteError>> {
    let mut outcomes = vec![None; goals.len()];
    let look = || {
        for (outcome, (joint, _)) in outcomes.iter_mut().zip(goals) {
            *outcome = outcome.or_else(|| servos.outcome(*joint, number));
        }
        outcomes.iter().all(Option::is_some).then_some(())
    };
    looked_for(look, || servos.steps(), || hold.is_pressed()).await;
    let unconfirmed = Err(WriteError::Unconfirmed);
    (outcomes.into_iter())
        .map(|outcome| outcome.unwrap_or(unconfirmed))
        .collect()
}

/// Looks again and again until there is something: as long as `steps` grows, and no longer than [`PATIENCE`] once it is pressed.
async fn looked_for<T>(
    mut look: impl FnMut() -> Option<T>,
    steps: impl Fn() -> u64,
    is_pressed: impl Fn() -> bool,
) -> Option<T> {
    let begun = Instant::now();
    let (mut seen, mut seen_at) = (steps(), begun);
    loop {
        if let Some(found) = look() {
            return Some(found);
        }
        let now = Instant::now();
        let newest = steps();
        if newest != seen {
            (seen, seen_at) = (newest, now);
        }
        if now - seen_at >= HANGS || now - begun >= PATIENCE && is_pressed() {
            return None;
        }
        sleep(LOOK).await;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// When it ended and what it found: an answer comes after `answer_s`, the thread works for `works_s`, and whoever asked
    /// is pressed from `pressed_s` on.
    async fn outcome(answer_s: f64, works_s: f64, pressed_s: f64) -> (u64, bool) {
        let begun = Instant::now();
        let now_s = || begun.elapsed().as_secs_f64();
        let steps = || (now_s().min(works_s) * 10.0) as u64;
        let look = || (now_s() >= answer_s).then_some(());
        let found = looked_for(look, steps, || now_s() >= pressed_s).await;
        (now_s().round() as u64, found.is_some())
    }

    // The clock is the test's: it goes on where nothing else is to be done.
    #[tokio::test(start_paused = true)]
    async fn an_answer_is_waited_for_as_long_as_the_thread_works_unless_something_else_waits_behind_it() {
        let never = f64::INFINITY;
        for (answer_s, works_s, pressed_s, wanted) in [
            (0.0, never, never, (0, true)),
            (60.0, never, never, (60, true)),
            (1.0, 0.0, never, (1, true)),
            // It hangs from then on.
            (never, 20.0, never, (23, false)),
            (60.0, never, 0.0, (2, false)),
            (60.0, never, 7.0, (7, false)),
            (1.0, never, 0.0, (1, true)),
            // Torque off is answered no later than it was.
            (never, 0.0, 0.0, (2, false)),
        ] {
            let got = outcome(answer_s, works_s, pressed_s).await;
            assert_eq!(got, wanted, "{answer_s} {works_s} {pressed_s}");
        }
    }
}
