//! A motor that a program before has left on: it is off before anything that is asked feeds its watchdog once more.

use crate::restarts::{lost, meddle, refusal, torque_and_watchdog};
use crate::writes::watched;
use crate::{MS, World};
use taxel_joints::DynamixelConfig;
use taxel_joints::bus::{MotorLost, WriteCommand};
use taxel_joints::protocol2::Instruction;
use taxel_sim::servo::{AfterSilence, ServoBuild, ServoFault};

const ON: WriteCommand = WriteCommand::Torque(true);
const GOAL: WriteCommand = WriteCommand::GoalPwm(90);

/// Somebody has armed a servo's watchdog and switched its motor on.
fn leave_on(w: &mut World, id: u8, watchdog: u8) {
    meddle(w, id, Instruction::Write, &[98, 0, watchdog]);
    meddle(w, id, Instruction::Write, &[64, 0, 1]);
}

/// Whether servos are asked from Torque Enable, or a little before it, to Present Position.
fn asks_left_on(request: &[u8]) -> bool {
    request[7] == 0x82 && request[8] <= 64 && request[10] >= 72
}

#[test]
fn all_motors_that_were_left_on_are_switched_off_in_one_packet_behind_the_first_question() {
    for n in [1, 16, 64] {
        let mut w = watched(n, 1000);
        (1..=n).for_each(|id| leave_on(&mut w, id, 50));
        w.bus.port_opened();
        w.bus.begin(w.now_ns);
        while w.requests.len() < 2 {
            assert!(w.turn(), "{n}");
        }
        assert!(asks_left_on(&w.requests[0]), "{n}");
        for (servo, id) in (0..).zip(1..=n) {
            assert_eq!(torque_and_watchdog(&w, id), [0, 50], "{n}: {id}");
            assert_eq!(lost(&w, servo), Some(MotorLost::LeftOn), "{n}: {id}");
        }
        while w.turn() {}
        w.cycles(1);
        let ends = (1..=n).map(|id| torque_and_watchdog(&w, id));
        assert!(ends.into_iter().all(|end| end == [0, 0]), "{n}");
        assert!(!w.bus.has_writes(), "{n}");
        assert!(
            w.bus.results().iter().all(Result::is_ok),
            "{n}: they are read, too"
        );
    }
}

#[test]
fn one_that_is_silent_keeps_no_other_on_that_was_left_on() {
    for silent in [1, 3] {
        for after in [AfterSilence::Answer, AfterSilence::Stop] {
            let what = format!("{silent}, {after:?}");
            let mut w = watched(4, 1000);
            w.servos.set_after_silence(after);
            (1..=4).for_each(|id| leave_on(&mut w, id, 50));
            w.fault(silent, ServoFault::Silent);
            w.bus.port_opened();
            w.bus.begin(w.now_ns);
            while w.turn() {}
            let others = (1..=4).filter(|id| *id != silent);
            assert!(
                others.into_iter().all(|id| torque_and_watchdog(&w, id)[0] == 0),
                "{what}"
            );
            // It is asked as soon as it answers, however late.
            w.cycles(1000);
            w.servos.set_fault(silent, None, 1);
            w.cycles(120);
            assert_eq!(torque_and_watchdog(&w, silent), [0, 0], "{what}");
            assert_eq!(
                lost(&w, usize::from(silent) - 1),
                Some(MotorLost::LeftOn),
                "{what}"
            );
        }
    }
}

#[test]
fn servos_are_asked_for_their_positions_alone_once_they_have_said_whether_they_were_left_on() {
    let mut w = watched(3, 1000);
    w.fault(2, ServoFault::Silent);
    w.bus.port_opened();
    w.cycles(2);
    w.requests.clear();
    w.cycles(200);
    assert!(!w.requests.iter().any(|r| asks_left_on(r)), "nobody waits for it");
    // One that refuses to say so is asked a few times.
    w.fault(2, ServoFault::Refuse { number: 7 });
    w.cycles(200);
    let asked = w.requests.iter().filter(|r| asks_left_on(r)).count();
    assert!((1..=10).contains(&asked), "{asked}");
}

#[test]
fn a_motor_that_somebody_has_switched_on_before_another_servo_came_was_not_left_on() {
    let mut w = watched(2, 1000);
    w.fault(2, ServoFault::Silent);
    w.bus.port_opened();
    w.cycles(100);
    leave_on(&mut w, 1, 50);
    w.servos.set_fault(2, None, 1);
    w.cycles(200);
    assert_eq!((torque_and_watchdog(&w, 1), lost(&w, 0)), ([1, 50], None));
}

#[test]
fn a_motor_that_a_daemon_before_has_left_on_is_switched_off() {
    let mut w = watched(3, 1000);
    // Of the first a daemon has armed the watchdog, of the second nobody has; that of the third has stopped it.
    for (id, watchdog) in [(1, 50), (2, 0), (3, 1)] {
        leave_on(&mut w, id, watchdog);
    }
    w.now_ns += 100 * MS;
    w.servos.take_due(w.now_ns, &mut Vec::new());
    w.bus.port_opened();
    w.cycles(1);
    let ends = [1, 2, 3].map(|id| torque_and_watchdog(&w, id));
    assert_eq!(ends, [[0, 0], [1, 0], [1, 255]]);
    assert_eq!(
        [0, 1, 2].map(|servo| lost(&w, servo)),
        [Some(MotorLost::LeftOn), None, None]
    );
    assert!(!w.bus.servo(0).unwrap().motor_off.unconfirmed);
    assert_eq!(w.bus.command(0, GOAL), Err(refusal(0, MotorLost::LeftOn)));
    w.cycles(300);
    assert_eq!(torque_and_watchdog(&w, 2), [1, 0]);
    w.bus.command(0, ON).unwrap();
    w.cycles(2);
    assert_eq!((torque_and_watchdog(&w, 1), lost(&w, 0)), ([1, 50], None));
}

/// Somebody has armed a servo's watchdog, and its motor is off: from the start, or since the watchdog has tripped.
fn leave_armed(w: &mut World, id: u8, has_tripped: bool) {
    match has_tripped {
        false => meddle(w, id, Instruction::Write, &[98, 0, 50]),
        true => {
            leave_on(w, id, 1);
            w.now_ns += 100 * MS;
            w.servos.take_due(w.now_ns, &mut Vec::new());
            meddle(w, id, Instruction::Write, &[64, 0, 0]);
        }
    }
}

fn cleared(w: &World, servo: usize) -> u64 {
    w.bus.servo(servo).unwrap().watchdogs_cleared
}

#[test]
fn the_watchdog_of_a_motor_that_is_off_is_cleared_once_behind_the_opening() {
    let mut w = watched(4, 1000);
    leave_armed(&mut w, 2, true);
    leave_armed(&mut w, 1, false);
    leave_on(&mut w, 4, 50);
    let before = [1, 2, 3, 4].map(|id| torque_and_watchdog(&w, id));
    assert_eq!(before, [[0, 50], [0, 255], [0, 0], [1, 50]]);
    w.bus.port_opened();
    w.requests.clear();
    w.bus.begin(w.now_ns);
    while w.requests.len() < 2 {
        assert!(w.turn());
    }
    let first = [1, 4].map(|id| torque_and_watchdog(&w, id));
    assert_eq!(first, [[0, 50], [0, 50]], "a motor that is on comes first");
    while w.turn() {}
    w.cycles(1);
    let ends = [1, 2, 3, 4].map(|id| torque_and_watchdog(&w, id));
    assert_eq!(ends, [[0, 0]; 4]);
    // That of the last is a part of switching it off.
    assert_eq!([0, 1, 2, 3].map(|servo| cleared(&w, servo)), [1, 1, 0, 0]);
    assert_eq!(lost(&w, 0), None);
    assert!(!w.bus.has_writes());
    // Whoever arms it later is left alone, also where the motor is off.
    w.requests.clear();
    leave_armed(&mut w, 1, false);
    leave_on(&mut w, 3, 50);
    w.cycles(500);
    assert_eq!([1, 3].map(|id| torque_and_watchdog(&w, id)), [[0, 50], [1, 50]]);
    assert!(
        !w.requests.iter().any(|r| r[7] == 0x83),
        "nobody is told anything"
    );
}

#[test]
fn a_watchdog_is_not_cleared_of_a_motor_that_is_started_here_nor_of_a_hand_that_is_only_read() {
    let mut w = watched(1, 1000);
    leave_armed(&mut w, 1, false);
    w.bus.port_opened();
    w.bus.begin(w.now_ns);
    assert!(w.turn() && asks_left_on(&w.requests[0]));
    w.bus.command(0, ON).unwrap();
    while w.turn() {}
    w.cycles(20);
    assert_eq!((torque_and_watchdog(&w, 1), cleared(&w, 0)), ([1, 50], 0));

    let mut w = World::new(&DynamixelConfig::new("none", [1]), [ServoBuild::new(1)]);
    leave_armed(&mut w, 1, false);
    w.bus.port_opened();
    w.cycles(20);
    assert_eq!((torque_and_watchdog(&w, 1), cleared(&w, 0)), ([0, 50], 0));
}

#[test]
fn no_watchdog_of_two_servos_with_one_id_is_cleared_behind_the_opening() {
    for (servos, shared) in [(1, 1), (3, 1), (3, 2), (3, 3)] {
        let mut w = watched(servos, 1000);
        (1..=servos).for_each(|id| leave_armed(&mut w, id, false));
        w.fault(shared, ServoFault::Twice);
        w.bus.port_opened();
        w.cycles(100);
        for id in 1..=servos {
            let watchdog = if id == shared { 50 } else { 0 };
            assert_eq!(torque_and_watchdog(&w, id), [0, watchdog], "{shared}: {id}");
        }
    }
}

#[test]
fn a_watchdog_of_a_servo_that_comes_later_is_cleared_beside_a_motor_that_runs() {
    let mut w = watched(3, 1000);
    w.fault(3, ServoFault::Silent);
    w.bus.port_opened();
    w.cycles(20);
    w.bus.command(0, ON).unwrap();
    w.cycles(20);
    leave_armed(&mut w, 3, false);
    w.servos.set_fault(3, None, 1);
    w.cycles(200);
    let ends = [1, 3].map(|id| torque_and_watchdog(&w, id));
    assert_eq!((ends, cleared(&w, 2)), ([[1, 50], [0, 0]], 1));
}

#[test]
fn a_watchdog_that_was_armed_here_before_the_port_was_lost_is_cleared_and_nobody_is_said_to_have_left_it() {
    let mut w = watched(1, 1000);
    w.bus.port_opened();
    w.cycles(2);
    w.bus.command(0, ON).unwrap();
    w.requests.clear();
    w.bus.begin(w.now_ns);
    while torque_and_watchdog(&w, 1) != [0, 50] {
        assert!(w.turn());
    }
    w.bus.port_lost();
    w.bus.port_opened();
    w.cycles(20);
    assert_eq!((torque_and_watchdog(&w, 1), cleared(&w, 0)), ([0, 0], 0));
}

#[test]
fn a_motor_that_was_left_on_is_switched_off_by_whichever_question_its_servo_answers_first() {
    let mut w = watched(1, 2540);
    leave_on(&mut w, 1, 127);
    w.bus.port_opened();
    let mut missed = 0;
    w.lost = Box::new(move |request| {
        let asks = asks_left_on(request);
        missed += u32::from(asks);
        asks && missed <= 5
    });
    w.cycles(60);
    assert_eq!(torque_and_watchdog(&w, 1), [0, 0]);
    assert_eq!(lost(&w, 0), Some(MotorLost::LeftOn));
}

#[test]
fn a_servo_that_never_says_whether_its_motor_was_left_on_says_who_it_is() {
    let mut w = watched(2, 1000);
    w.bus.port_opened();
    w.lost = Box::new(asks_left_on);
    w.cycles(200);
    assert!([0, 1].iter().all(|i| w.bus.servo(*i).unwrap().identity.is_some()));
}

#[test]
fn a_motor_that_is_switched_on_here_is_not_taken_for_one_that_was_left_on() {
    // Before its servo is asked, and while the port was away.
    let mut w = watched(2, 1000);
    leave_on(&mut w, 1, 50);
    w.bus.port_opened();
    w.bus.command(0, ON).unwrap();
    for opened_anew in [false, true] {
        if opened_anew {
            w.bus.port_lost();
            w.bus.port_opened();
        }
        w.cycles(100);
        assert_eq!(torque_and_watchdog(&w, 1), [1, 50], "{opened_anew}");
        assert_eq!(lost(&w, 0), None);
    }
    // Nor one that is asked to start while its servo answers.
    let mut w = watched(1, 1000);
    leave_on(&mut w, 1, 50);
    w.bus.port_opened();
    w.bus.begin(w.now_ns);
    assert!(w.turn() && asks_left_on(&w.requests[0]));
    w.bus.command(0, ON).unwrap();
    while w.turn() {}
    w.cycles(100);
    assert_eq!((torque_and_watchdog(&w, 1), lost(&w, 0)), ([1, 50], None));
}

#[test]
fn a_motor_that_was_left_on_and_that_another_program_switches_on_again_stays_on() {
    let mut w = watched(2, 1000);
    leave_on(&mut w, 1, 50);
    w.bus.port_opened();
    w.cycles(3);
    assert_eq!(
        (torque_and_watchdog(&w, 1), lost(&w, 0)),
        ([0, 0], Some(MotorLost::LeftOn))
    );
    leave_on(&mut w, 1, 50);
    w.requests.clear();
    w.cycles(500);
    assert_eq!(torque_and_watchdog(&w, 1), [1, 50], "it is another's");
    assert_eq!(lost(&w, 0), None, "it is not switched off");
    assert!(
        !w.requests.iter().any(|r| r[7] == 0x83),
        "nobody is told anything"
    );
    // What somebody has asked for here is another matter.
    w.bus.command(0, WriteCommand::Torque(false)).unwrap();
    w.cycles(3);
    leave_on(&mut w, 1, 50);
    w.cycles(300);
    assert_eq!(torque_and_watchdog(&w, 1)[0], 0);
}

/// Bytes on the wire of a question and all answers to it.
fn question_bytes(request: &[u8]) -> Option<usize> {
    let asked = match request[7] {
        0x02 => 1,
        0x82 => request.len() - 14,
        _ => return None,
    };
    Some(request.len() + asked * (usize::from(u16::from_le_bytes([request[10], request[11]])) + 11))
}

#[test]
fn no_question_to_a_servo_that_comes_later_keeps_the_bus_from_a_motor_that_runs() {
    // A bus on which the usual question takes a good part of the time after which a motor stops.
    for (servos, baud, watchdog_ms) in [(2, 9600, 200), (3, 9600, 260), (16, 57_600, 200), (16, 9600, 500)] {
        for port_was_away in [false, true] {
            let what = format!("{servos} at {baud}, port away {port_was_away}");
            let mut config = DynamixelConfig::new("none", 1..=servos);
            (config.allow_writes, config.watchdog_ms, config.baud) = (true, watchdog_ms, baud);
            let mut w = World::new(&config, (1..=servos).map(ServoBuild::new));
            w.fault(servos, ServoFault::Silent);
            w.bus.port_opened();
            w.cycles(20);
            w.bus.command(0, ON).unwrap();
            w.cycles(40);
            let runs = [1, i32::from(watchdog_ms) / 20];
            assert_eq!(torque_and_watchdog(&w, 1), runs, "{what}");
            leave_on(&mut w, servos, 100);
            w.servos.set_fault(servos, None, 1);
            w.requests.clear();
            if port_was_away {
                w.bus.port_lost();
                w.bus.port_opened();
            }
            w.cycles(60);
            assert_eq!(torque_and_watchdog(&w, 1), runs, "{what}");
            let longest = w.requests.iter().filter_map(|r| question_bytes(r)).max().unwrap();
            // Of all, with as many bytes before Present PWM as there may be.
            let usual = 14 + usize::from(servos) * (1 + 19 + 11);
            assert!(longest <= usual, "{what}: {longest}");
            // Its motor was left on all the same.
            assert_eq!(torque_and_watchdog(&w, servos), [0, 0], "{what}");
            let last = usize::from(servos) - 1;
            assert_eq!(lost(&w, last), Some(MotorLost::LeftOn), "{what}");
        }
    }
}

#[test]
fn a_servo_that_comes_later_is_asked_by_itself_whether_its_motor_was_left_on() {
    let mut w = watched(16, 1000);
    w.fault(5, ServoFault::Silent);
    w.bus.port_opened();
    w.cycles(100);
    leave_on(&mut w, 5, 50);
    w.servos.set_fault(5, None, 1);
    w.requests.clear();
    while w.bus.results()[4].is_err() {
        w.cycles(1);
    }
    w.cycle(5 * MS);
    assert_eq!(torque_and_watchdog(&w, 5), [0, 0]);
    assert!(w.bus.results().iter().all(Result::is_ok), "all are read");
    let asked: Vec<usize> = (w.requests.iter().filter(|r| asks_left_on(r)))
        .map(|r| r.len() - 14)
        .collect();
    assert_eq!(asked, [1]);
}
