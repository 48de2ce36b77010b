//! What a motor does whose commands were lost with the port, or came at the end.

use crate::World;
use crate::writes::{register, start, watched, writable, write_of};
use taxel_joints::bus::{Step, WriteCommand, WriteRefused};

#[test]
fn a_motor_whose_start_was_lost_with_the_port_is_off_when_that_is_back() {
    for command in [WriteCommand::Torque(true), WriteCommand::Start(40)] {
        let whole = if command == WriteCommand::Start(40) { 5 } else { 4 };
        for sent in 0..=whole {
            let mut w = writable(2);
            w.cycles(2);
            w.bus.command(0, command).unwrap();
            let writes = |w: &World| w.requests.iter().filter(|r| write_of(r).is_some()).count();
            w.bus.begin(w.now_ns);
            while writes(&w) < sent && w.turn() {}
            assert_eq!(writes(&w), sent);
            w.bus.port_lost();
            let what = format!("{command:?} lost behind write {sent}");
            // The last write has been obeyed though nobody heard its answer.
            assert_eq!(register(&w, 1, 64, 1), i32::from(sent == whole), "{what}");
            w.bus.port_opened();
            let goal = w.bus.command(0, WriteCommand::GoalPwm(1));
            assert_eq!(goal, Err(WriteRefused::MotorOff(0)), "{what}");
            w.cycles(3);
            assert_eq!(register(&w, 1, 64, 1), 0, "{what}");
        }
    }
}

#[test]
fn a_motor_that_was_to_be_switched_off_when_the_port_was_lost_is_switched_off_at_the_end() {
    for ordered in 1..=2 {
        let mut w = writable(2);
        start(&mut w, [0]);
        for _ in 0..ordered {
            w.bus.command(0, WriteCommand::Torque(false)).unwrap();
        }
        w.bus.port_lost();
        w.bus.port_opened();
        assert_eq!(register(&w, 1, 64, 1), 1, "it never heard of it");
        w.bus.release_motors();
        w.cycles(200);
        assert_eq!(register(&w, 1, 64, 1), 0, "ordered off {ordered} times");
    }
}

#[test]
fn a_motor_that_was_still_to_be_switched_on_at_the_end_is_not() {
    // Of the four writes that switch it on, so many are out by then.
    for sent in 0..4 {
        let mut w = writable(2);
        w.cycles(2);
        w.bus.command(0, WriteCommand::Torque(true)).unwrap();
        let writes = |w: &World| w.requests.iter().filter(|r| write_of(r).is_some()).count();
        w.bus.begin(w.now_ns);
        while writes(&w) < sent && w.turn() {}
        w.bus.release_motors();
        while w.turn() {}
        w.cycles(2);
        assert!(!w.bus.has_writes());
        assert!(
            !w.requests.iter().any(|r| write_of(r) == Some((1, 64, 1))),
            "{sent}"
        );
        assert_eq!([98, 64].map(|at| register(&w, 1, at, 1)), [0, 0], "{sent}");
    }
}

#[test]
fn a_motor_whose_start_was_called_off_before_it_was_sent_is_not_taken_for_one_that_runs() {
    let mut w = writable(1);
    w.cycles(2);
    w.bus.command(0, WriteCommand::Torque(true)).unwrap();
    w.bus.command(0, WriteCommand::Torque(false)).unwrap();
    w.bus.port_lost();
    assert_eq!(
        w.bus.command(0, WriteCommand::GoalPwm(1)),
        Err(WriteRefused::MotorOff(0))
    );
}

#[test]
fn a_port_that_comes_and_goes_while_a_motor_is_to_be_switched_off_leaves_no_questions_behind() {
    for servos in [2, 16, 64] {
        let mut w = watched(servos, 2540);
        start(&mut w, [0]);
        w.bus.port_lost();
        w.bus.command(0, WriteCommand::Torque(false)).unwrap();
        // Each time it goes at the first request, which tells the motor to be off.
        for _ in 0..20 {
            w.bus.port_opened();
            w.bus.begin(w.now_ns);
            assert_eq!(w.bus.step(w.now_ns), Step::Send);
            w.bus.port_lost();
        }
        w.bus.port_opened();
        w.requests.clear();
        w.cycles(20);
        assert_eq!(
            [64, 98].map(|at| register(&w, 1, at, 1)),
            [0, 0],
            "{servos} servos"
        );
        assert!(w.bus.results().iter().all(Result::is_ok), "{servos} servos");
        let asked = w.requests.iter().filter(|r| r[7] == 0x82).map(|r| r.len() - 14);
        assert!(
            asked.max().is_some_and(|most| most <= usize::from(servos)),
            "{servos} servos"
        );
    }
}
