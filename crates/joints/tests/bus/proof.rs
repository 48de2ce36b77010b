//! What is said of a motor is so, whatever is lost on the way and however late answers come.

use crate::writes::{register, start, watched, write_of};
use crate::{MS, World};
use taxel_joints::bus::WriteCommand;
use taxel_sim::servo::ServoFault;

const OFF: WriteCommand = WriteCommand::Torque(false);

fn late(w: &mut World, by_ns: u64) {
    w.fault(1, ServoFault::Late { by_ns });
}

fn is_unconfirmed(w: &World) -> bool {
    w.bus.servo(0).unwrap().motor_off.unconfirmed
}

fn is_off(w: &World) -> bool {
    register(w, 1, 64, 1) == 0
}

/// Random bits of their own for each seed, stream and number.
pub(crate) fn bits(seed: u64, stream: u64, number: u64) -> u64 {
    let mut x = (seed << 40 | stream << 32 | number).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    x = (x ^ x >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x = (x ^ x >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ x >> 31
}

/// That its motor is off is said only where it is so, and it never runs without a watchdog.
#[track_caller]
fn check(w: &World, off: u64, what: &str) {
    let said = w.bus.servo(0).unwrap().motor_off;
    let is_said = !said.unconfirmed
        && (said.written).is_some_and(|written| (written.number, written.result) == (off, Ok(())));
    assert!(!is_said || is_off(w), "{what}: it is said to be off, and is on");
    assert!(
        is_off(w) || register(w, 1, 98, 1) != 0,
        "{what}: it runs without a watchdog"
    );
}

#[test]
fn no_late_answer_to_an_earlier_request_says_that_a_motor_is_off() {
    for late_us in (500..60_000).step_by(700) {
        for lost in [1, 2, 5, usize::MAX] {
            let what = format!("{late_us} us late, {lost} lost");
            let mut w = watched(1, 2540);
            start(&mut w, [0]);
            w.cycles(5);
            let mut told = 0;
            w.lost = Box::new(move |request| {
                let is_off = write_of(request) == Some((1, 64, 0));
                told += usize::from(is_off);
                is_off && told <= lost
            });
            // Goals whose answers are late are under way when the motor is to be off.
            late(&mut w, 1000 * late_us);
            for number in 1..=3 {
                let goal = WriteCommand::GoalPwm(number as i16);
                w.bus.numbered_command(number, 0, goal).unwrap();
                w.cycles(1);
            }
            w.bus.numbered_command(9, 0, OFF).unwrap();
            for cycle in 0..60 {
                if cycle == 5 {
                    w.servos.set_fault(1, None, 1);
                }
                w.bus.begin(w.now_ns);
                while w.turn() {
                    check(&w, 9, &what);
                }
                w.now_ns += 5 * MS;
            }
            assert_eq!(is_unconfirmed(&w), lost == usize::MAX, "{what}");
            assert_eq!(is_off(&w), !is_unconfirmed(&w), "{what}");
            let disarmed = register(&w, 1, 98, 1) == 0;
            assert_eq!(disarmed, is_off(&w), "{what}");
        }
    }
}

#[test]
fn what_is_said_of_a_motor_is_so_on_a_bus_that_loses_requests_and_answers_when_it_likes() {
    for seed in 0..300 {
        let mut draws = 0;
        let mut draw = move |of: u64| {
            draws += 1;
            bits(seed, 5, draws) % of
        };
        let mut w = watched(1, 2540);
        w.cycles(5);
        let mut drops = 0;
        w.lost = Box::new(move |_| {
            drops += 1;
            bits(seed, 6, drops) % 100 < 15
        });
        let what = format!("seed {seed}");
        // The newest command, whether it has been answered, and the goal it gives.
        let (mut number, mut goal, mut off) = (0, None, 0);
        for _ in 0..400 {
            if draw(4) == 0 {
                number += 1;
                let counts = 1 + (number % 300) as i16;
                let command = match draw(4) {
                    0 => OFF,
                    1 => WriteCommand::Start(counts),
                    _ => WriteCommand::GoalPwm(counts),
                };
                let is_taken = w.bus.numbered_command(number, 0, command).is_ok();
                match command {
                    OFF => (goal, off) = (None, number),
                    _ if is_taken => {
                        goal = Some((number, counts));
                        off = if command == WriteCommand::Start(counts) {
                            0
                        } else {
                            off
                        };
                    }
                    _ => {}
                }
            }
            w.bus.begin(w.now_ns);
            loop {
                late(&mut w, draw(20_000) * 1000);
                if !w.turn() {
                    break;
                }
                check(&w, if off == 0 { u64::MAX } else { off }, &what);
                assert!(
                    is_off(&w) || register(&w, 1, 100, 2) != 885,
                    "{what}: all its PWM"
                );
                let newest = goal.and_then(|(number, counts)| Some((w.bus.outcome(0, number)?, counts)));
                if let Some((Ok(()), counts)) = newest {
                    assert_eq!(register(&w, 1, 100, 2), i32::from(counts), "{what}");
                    assert!(!is_off(&w), "{what}: it is said to be on, and is off");
                }
            }
            w.now_ns += 5 * MS;
        }
        w.bus.numbered_command(9_999, 0, OFF).unwrap();
        w.cycles(10);
        w.lost = Box::new(|_| false);
        w.servos.set_fault(1, None, 1);
        w.cycles(150);
        check(&w, 9_999, &what);
        assert!(!is_unconfirmed(&w) && is_off(&w) && !w.bus.has_writes(), "{what}");
    }
}

#[test]
fn a_motor_that_is_to_be_off_and_says_that_it_is_on_is_told_again() {
    // Its servo restarts with its motor on, or another program switches it on.
    let mut w = watched(2, 2540);
    start(&mut w, [0, 1]);
    w.bus.numbered_command(9, 0, OFF).unwrap();
    w.cycles(3);
    assert!(is_off(&w));
    let on = taxel_joints::protocol2::Encoder::default()
        .write(1, 64, &[1])
        .unwrap()
        .to_vec();
    w.servos.receive(&on, w.now_ns);
    w.servos.take_due(u64::MAX, &mut Vec::new());
    let end_ns = w.now_ns + 1_100 * MS;
    w.lost = Box::new(|request| write_of(request) == Some((1, 64, 0)));
    while w.now_ns < end_ns {
        w.cycles(1);
    }
    assert!(is_unconfirmed(&w) && !is_off(&w));
    w.lost = Box::new(|_| false);
    w.cycles(20);
    assert!(!is_unconfirmed(&w) && is_off(&w));
    assert_eq!(register(&w, 2, 64, 1), 1, "nobody has told that one");
    // One that was switched on here since is to be on.
    start(&mut w, [0]);
    w.cycles(300);
    assert!(!is_unconfirmed(&w) && !is_off(&w));
}

#[test]
fn an_answer_that_comes_twice_is_none_to_the_next_question() {
    let mut w = watched(2, 2540);
    w.cycles(5);
    for number in (1..40).step_by(3) {
        let commands = [WriteCommand::Start(40), WriteCommand::GoalPwm(50), OFF];
        for (number, command) in (number..).zip(commands) {
            // No servo that answers twice is told to turn, so it begins to do so behind that.
            w.servos.set_fault(1, None, 1);
            w.now_ns += 2_100 * MS;
            w.cycles(2);
            w.bus.numbered_command(number, 0, command).unwrap();
            w.fault(1, ServoFault::Twice);
            w.bus.begin(w.now_ns);
            while w.turn() {
                check(&w, number, "twice");
            }
            w.cycles(1);
            if command != OFF {
                assert_eq!(w.bus.outcome(0, number), Some(Ok(())), "{command:?}");
            }
        }
        assert!(is_off(&w) && !is_unconfirmed(&w));
    }
    assert_eq!(w.bus.counters().writes_failed, 0);
}
