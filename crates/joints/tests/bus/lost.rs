//! What a motor does whose commands were lost with the port, or came at the end.

use crate::restarts::{lost, meddle, torque_and_watchdog};
use crate::writes::{register, start, watched, writable, write_of};
use crate::{MS, World};
use taxel_joints::bus::{MotorLost, Step, WriteCommand, WriteRefused};
use taxel_joints::protocol2::Instruction;
use taxel_sim::servo::ServoFault;

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

/// Two motors, of which the first has gone off by itself, and that is known.
fn gone_off() -> World {
    let mut w = watched(2, 2540);
    start(&mut w, [0, 1]);
    meddle(&mut w, 1, Instruction::Write, &[64, 0, 0]);
    while lost(&w, 0).is_none() {
        w.cycles(1);
    }
    assert_eq!(lost(&w, 0), Some(MotorLost::GoneOff));
    assert_eq!(torque_and_watchdog(&w, 1), [0, 127]);
    w
}

#[test]
fn a_motor_that_another_program_has_by_now_is_not_switched_off_at_the_end() {
    // What the other has written to Bus Watchdog and Torque Enable, and what they are behind the end.
    for (written, end) in [
        (&[(98, 0), (64, 1)][..], [1, 0]),
        (&[(64, 1)], [1, 0]),
        (&[(98, 50), (64, 1)], [1, 50]),
        (&[(98, 50)], [0, 50]),
        (&[(98, 0)], [0, 0]),
        (&[], [0, 0]),
    ] {
        for cycles in [0, 1, 400] {
            let mut w = gone_off();
            for (at, value) in written {
                meddle(&mut w, 1, Instruction::Write, &[*at, 0, *value]);
            }
            w.cycles(cycles);
            w.bus.release_motors();
            w.requests.clear();
            w.cycles(3);
            let what = format!("{written:?}, {cycles} cycles later");
            assert_eq!(torque_and_watchdog(&w, 1), end, "{what}");
            assert_eq!(torque_and_watchdog(&w, 2), [0, 0], "{what}");
            let is_to_be_off = |r: &Vec<u8>| write_of(r) == Some((1, 64, 0));
            assert!(!w.requests.iter().any(is_to_be_off), "{what}");
            assert!(!w.bus.has_writes() && !w.bus.servo(0).unwrap().motor_off.unconfirmed);
        }
    }
}

#[test]
fn a_watchdog_that_has_stopped_another_programs_motor_is_not_cleared_at_the_end() {
    for torque in [0, 1] {
        let mut w = gone_off();
        meddle(&mut w, 1, Instruction::Write, &[64, 0, torque]);
        w.now_ns += 3000 * MS;
        w.servos.handle_time(w.now_ns);
        w.bus.release_motors();
        w.cycles(3);
        let left = if torque == 1 { 255 } else { 0 };
        assert_eq!(torque_and_watchdog(&w, 1), [i32::from(torque), left]);
        assert!(!w.bus.has_writes());
    }
}

#[test]
fn a_motor_that_is_known_to_be_off_is_not_waited_for_at_the_end() {
    for port_is_away in [false, true] {
        let mut w = gone_off();
        w.fault(1, ServoFault::Silent);
        w.cycles(100);
        w.bus.command(1, WriteCommand::Torque(false)).unwrap();
        w.cycles(3);
        if port_is_away {
            w.bus.port_lost();
        }
        w.bus.release_motors();
        match port_is_away {
            true => w.bus.port_lost(),
            false => {
                w.cycle(0);
            }
        }
        assert!(!w.bus.has_writes(), "away {port_is_away}");
        assert!(
            !w.bus.servo(0).unwrap().motor_off.unconfirmed,
            "away {port_is_away}"
        );
    }
}
