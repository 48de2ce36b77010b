//! What is taken and what is refused while more waits to be sent than the bus can send.

use crate::World;
use crate::writes::{register, start, writable};
use taxel_joints::bus::{WriteCommand, WriteError, WriteRefused};
use taxel_sim::servo::ServoFault;

/// Goals for the first servo until so many writes wait.
fn fill(w: &mut World, waiting: usize) {
    for _ in 0..waiting {
        w.bus.command(0, WriteCommand::GoalPwm(1)).unwrap();
    }
}

#[test]
fn however_much_waits_every_motor_that_is_to_be_off_is_switched_off() {
    let mut w = writable(16);
    start(&mut w, 0..16);
    w.fault(1, ServoFault::Silent);
    fill(&mut w, 256);
    let refused = w.bus.command(0, WriteCommand::GoalPwm(1));
    assert_eq!(refused, Err(WriteRefused::QueueFull(256)));
    let offs: Vec<_> = (1..16)
        .map(|servo| (servo as u64, servo, WriteCommand::Torque(false)))
        .collect();
    w.bus.take(&offs);
    w.cycles(1);
    for servo in 1..16 {
        let off = w.bus.servo(servo).unwrap().motor_off.written.unwrap();
        assert_eq!((off.number, off.result), (servo as u64, Ok(())));
        assert_eq!(register(&w, servo as u8 + 1, 64, 1), 0, "{servo}");
    }
}

#[test]
fn goals_that_are_given_together_are_all_taken_or_none_where_little_room_is_left() {
    for (waiting, together, is_taken) in [(253, 3, true), (254, 3, false), (256, 2, false)] {
        let mut w = writable(4);
        start(&mut w, 0..4);
        fill(&mut w, waiting);
        let goals: Vec<_> = (1..=together)
            .map(|servo| (7, servo, WriteCommand::GoalPwm(90)))
            .collect();
        w.bus.take(&goals);
        w.cycles(30);
        let full = WriteError::NotTaken(WriteRefused::QueueFull(waiting));
        for servo in 1..=together {
            let expected = if is_taken { Ok(()) } else { Err(full) };
            assert_eq!(w.bus.outcome(servo, 7), Some(expected), "{waiting}");
            let goal = register(&w, servo as u8 + 1, 100, 2);
            assert_eq!(goal, if is_taken { 90 } else { 0 }, "{waiting}");
        }
    }
}
