//! One servo that is told to start by two at once, where the first is in vain: what the servo does and what is believed of it
//! are the same.

use crate::writes::{register, watched, write_of};
use crate::{MS, World};
use taxel_joints::bus::{WriteCommand, WriteError, WriteRefused};
use taxel_sim::servo::ServoFault;

const START: WriteCommand = WriteCommand::Start(40);
const OFF: WriteCommand = WriteCommand::Torque(false);
const GOAL: WriteCommand = WriteCommand::GoalPwm(90);
/// Of which a start consists.
const WRITES: usize = 5;

/// How often a servo was told something and asked behind it what it holds.
fn writes(w: &World) -> usize {
    let pairs = w.requests.windows(2);
    pairs.filter(|pair| write_of(&pair[0]).is_some()).count()
}

/// Two starts, with a command between where one is given. Behind so many writes the servo has a fault, until the first start
/// is given up.
fn started_twice(before: usize, fault: Option<ServoFault>, between: Option<WriteCommand>) -> World {
    let mut w = watched(2, 2540);
    w.cycles(3);
    w.bus.numbered_command(1, 0, START).unwrap();
    w.bus.begin(w.now_ns);
    while writes(&w) < before && w.turn() {}
    // Without a fault what it is told is lost, and not its answers alone.
    match fault {
        Some(fault) => w.fault(1, fault),
        None => w.cut = true,
    }
    for (number, command) in (2..).zip(between) {
        w.bus.numbered_command(number, 0, command).unwrap();
    }
    w.bus.numbered_command(3, 0, START).unwrap();
    // A refusal is an answer, and one write is refused; a silence ends after a few cycles.
    let is_over = |w: &World| match fault {
        Some(ServoFault::Refuse { .. }) => writes(w) > before,
        _ => w.bus.counters().writes_failed > 0,
    };
    for _ in 0..10 {
        while !is_over(&w) && w.turn() {}
        if is_over(&w) {
            break;
        }
        w.now_ns += 5 * MS;
        w.bus.begin(w.now_ns);
    }
    assert!(is_over(&w));
    w.servos.set_fault(1, None, 1);
    w.cut = false;
    while w.turn() {}
    w.cycles(200);
    w
}

#[test]
fn a_motor_that_the_second_of_two_starts_has_switched_on_is_known_to_be_and_is_off_at_the_end() {
    let faults = [
        Some(ServoFault::Refuse { number: 4 }),
        Some(ServoFault::Silent),
        Some(ServoFault::BadCrc),
        None,
    ];
    for before in 0..WRITES {
        for fault in faults {
            for between in [None, Some(OFF)] {
                let what = format!("{fault:?} behind write {before}, {between:?} between");
                let mut w = started_twice(before, fault, between);
                let is_on = register(&w, 1, 64, 1) == 1;
                let expected = match is_on {
                    true => Ok(()),
                    false => Err(WriteRefused::MotorOff(0)),
                };
                assert_eq!(w.bus.command(0, GOAL), expected, "{what}");
                assert!(!w.bus.servo(0).unwrap().motor_off.unconfirmed, "{what}");
                w.bus.release_motors();
                w.cycles(3);
                assert_eq!(register(&w, 1, 64, 1), 0, "{what}");
            }
        }
    }
}

#[test]
fn a_start_goes_on_behind_one_that_its_servo_refuses() {
    for before in 0..WRITES {
        let w = started_twice(before, Some(ServoFault::Refuse { number: 4 }), None);
        let refused = w.bus.outcome(0, 1).unwrap();
        assert!(
            matches!(refused, Err(WriteError::Servo(_))),
            "behind write {before}: {refused:?}"
        );
        assert_eq!(w.bus.outcome(0, 3), Some(Ok(())), "behind write {before}");
        assert_eq!([64, 98].map(|at| register(&w, 1, at, 1)), [1, 127]);
    }
}

#[test]
fn a_motor_whose_start_was_not_answered_is_switched_off_and_given_no_goal() {
    // Its start is obeyed, and the answer lost; or the start is lost itself.
    for cut in [false, true] {
        let mut w = watched(1, 2540);
        w.cycles(3);
        w.bus.numbered_command(1, 0, START).unwrap();
        w.bus.begin(w.now_ns);
        while writes(&w) < WRITES - 1 && w.turn() {}
        w.cut = cut;
        if !cut {
            w.fault(1, ServoFault::Silent);
        }
        w.bus.numbered_command(2, 0, GOAL).unwrap();
        while w.turn() {}
        while w.bus.outcome(0, 1).is_none() {
            w.cycle(5 * MS);
        }
        assert_eq!(w.bus.outcome(0, 1), Some(Err(WriteError::Silent)));
        let off = WriteRefused::MotorOff(0);
        assert_eq!(w.bus.outcome(0, 2), Some(Err(WriteError::NotTaken(off))));
        assert_eq!(w.bus.command(0, GOAL), Err(off), "cut {cut}");
        assert!(w.bus.servo(0).unwrap().motor_off.unconfirmed, "nobody knows");
        w.servos.set_fault(1, None, 1);
        w.cut = false;
        w.cycles(200);
        assert_eq!([64, 98].map(|at| register(&w, 1, at, 1)), [0, 0], "cut {cut}");
        assert!(!w.bus.servo(0).unwrap().motor_off.unconfirmed && !w.bus.has_writes());
    }
}

#[test]
fn a_motor_whose_start_was_obeyed_and_is_refused_when_it_is_sent_again_is_switched_off() {
    let mut w = watched(1, 2540);
    w.cycles(3);
    w.bus.command(0, START).unwrap();
    w.bus.begin(w.now_ns);
    while writes(&w) < WRITES - 1 && w.turn() {}
    w.fault(1, ServoFault::Silent);
    while w.turn() {}
    assert_eq!(register(&w, 1, 64, 1), 1);
    w.fault(1, ServoFault::Refuse { number: 4 });
    w.cycles(1);
    w.servos.set_fault(1, None, 1);
    w.cycles(20);
    assert_eq!([64, 98].map(|at| register(&w, 1, at, 1)), [0, 0]);
    assert!(!w.bus.has_writes());
}

#[test]
fn a_motor_that_never_ran_is_not_told_to_be_off_where_its_servo_is_silent() {
    for starts in 1..=3 {
        let mut w = watched(2, 2540);
        w.fault(1, ServoFault::Silent);
        w.cycles(3);
        for number in 1..=starts {
            w.bus.numbered_command(number, 0, START).unwrap();
        }
        w.cycles(20);
        assert!(!w.bus.servo(0).unwrap().motor_off.unconfirmed, "{starts}");
        assert!(!w.bus.has_writes(), "{starts}");
    }
}

#[test]
fn a_motor_whose_first_goal_is_given_up_for_its_watchdog_is_not_switched_on_without_it() {
    let mut w = watched(1, 2540);
    w.cycles(3);
    w.bus.numbered_command(1, 0, START).unwrap();
    w.bus.begin(w.now_ns);
    while writes(&w) < WRITES - 2 && w.turn() {}
    assert!(w.turn(), "its watchdog is armed");
    // It may restart then, and nobody can read what it says of its watchdog.
    w.fault(1, ServoFault::BadCrc);
    while w.turn() {}
    w.now_ns += 60 * MS;
    while w.bus.counters().writes_failed == 0 {
        w.cycle(5 * MS);
    }
    w.servos.set_fault(1, None, 1);
    w.cycles(200);
    assert!(!w.requests.iter().any(|r| write_of(r) == Some((1, 64, 1))));
    assert_eq!(register(&w, 1, 64, 1), 0);
    assert_eq!(w.bus.command(0, GOAL), Err(WriteRefused::MotorOff(0)));
}

#[test]
fn a_start_that_a_servo_does_not_take_is_told_by_what_it_does_not_take() {
    let of = |at: u8| {
        let mut w = watched(2, 2540);
        w.cycles(3);
        w.bus.numbered_command(1, 0, START).unwrap();
        w.lost = Box::new(move |request| {
            write_of(request).is_some_and(|(_, address, value)| address == at && value != 0)
        });
        w.cycles(20);
        assert_eq!(register(&w, 1, 64, 1), 0);
        w.bus.outcome(0, 1)
    };
    // As firmware before 38, which has no bus watchdog.
    assert_eq!(of(98), Some(Err(WriteError::NoWatchdog)));
    assert_eq!(of(100), Some(Err(WriteError::NotHeld)));
    // As after an overload.
    assert_eq!(of(64), Some(Err(WriteError::StillOff)));
}

#[test]
fn a_watchdog_that_was_armed_for_a_start_that_failed_is_cleared_at_the_end_at_the_latest() {
    // Its first goal is not taken, or nothing is heard of it any more.
    for is_heard in [true, false] {
        let mut w = watched(2, 2540);
        w.cycles(3);
        w.bus.numbered_command(1, 0, START).unwrap();
        w.bus.begin(w.now_ns);
        while writes(&w) < 3 {
            assert!(w.turn());
        }
        match is_heard {
            true => w.lost = Box::new(|request| write_of(request).is_some_and(|(_, at, _)| at == 100)),
            false => w.cut = true,
        }
        while w.turn() {}
        w.cycles(8);
        let expected = if is_heard {
            WriteError::NotHeld
        } else {
            WriteError::Silent
        };
        assert_eq!(w.bus.outcome(0, 1), Some(Err(expected)));
        let torque_and_watchdog = |w: &World| [64, 98].map(|at| register(w, 1, at, 1));
        assert_eq!(torque_and_watchdog(&w), [0, if is_heard { 0 } else { 127 }]);
        assert!(
            !w.bus.servo(0).unwrap().motor_off.unconfirmed,
            "it is known to be off"
        );
        w.cut = false;
        w.bus.release_motors();
        w.cycles(3);
        assert_eq!(torque_and_watchdog(&w), [0, 0], "{expected}");
        assert!(!w.bus.has_writes(), "{expected}");
    }
}
