//! Problems of the port of servos, and what of them is told then.

use super::joints::JointsBench;
use super::*;
use crate::joints::test_views::{away, open, servo};
use crate::{Place, Severity};
use taxel_joints::JointSource;
use taxel_joints::bus::{MotorLost, ServoIdentity};
use taxel_joints::registers::HardwareError;

#[test]
fn a_motor_that_may_be_on_is_told_while_the_port_is_away() {
    let mut bench = JointsBench::answering(2);
    bench.pass(300, |view| {
        away(view);
        servo(view, 0).motor_off.unconfirmed = true;
    });
    assert_eq!(bench.bench.kinds(), ["motor-not-off", "serial-absent"]);
}

#[test]
fn an_adapter_that_is_unplugged_is_one_problem_and_its_servos_are_none() {
    let mut bench = JointsBench::answering(3);
    bench.pass(3000, away);
    bench.said(&[&["/dev/servos is gone, unplugged", "No such file", "images go on"]]);
    assert_eq!(bench.bench.kinds(), ["serial-absent"]);
    let problem = &bench.bench.problems.current()[0].problem;
    assert_eq!(
        (problem.bus(&bench.bench.layout), problem.place),
        (None, Place::Joints)
    );
    assert_eq!(problem.severity(), Severity::Error);

    open(&mut bench.view, "/dev/ttyUSB1", 1);
    bench.pass(900, |_| {});
    bench.said(&[&["/dev/servos is there", "after 3.0 s"]]);
    bench.pass(500, |_| {});
    bench.said(&[&[
        "no servo answers",
        "baud = 1000000",
        "taxel doctor --joints dynamixel:/dev/servos --ids 1-16`",
    ]]);
    bench.pass(500, |view| {
        (0..3).for_each(|joint| servo(view, joint).alive = true)
    });
    bench.said(&[&["servos answer"]]);
}

#[test]
fn a_thread_that_ends_no_cycle_is_told_and_puts_right_nothing_that_it_last_knew() {
    let mut bench = JointsBench::answering(2);
    let hang = |view: &mut JointsView| {
        view.servos.as_mut().unwrap().0.counters.cycles = 1;
        servo(view, 0).temperature_c = Some(75);
    };
    bench.pass(1900, hang);
    bench.said(&[&["servo 1 has 75 degrees"]]);
    bench.pass(1000, |view| {
        hang(view);
        view.tick.angles.fill(f32::NAN);
    });
    assert_eq!(bench.bench.kinds(), ["servo-hot", "serial-stuck"]);
    bench.said(&[&[
        "has waited for /dev/servos for 2.1 s",
        "watchdogs",
        "unplug the adapter",
    ]]);
    bench.pass(200, |view| servo(view, 0).temperature_c = Some(40));
    bench.said(&[&["cooled down"], &["/dev/servos is read again"]]);
}

#[test]
fn a_cycle_that_waits_for_answers_as_it_was_told_to_does_not_hang() {
    let mut bench = JointsBench::answering(2);
    let JointSource::Dynamixel(config) = &mut bench.bench.joints.as_mut().unwrap().source else {
        panic!("no servos");
    };
    config.answer_margin_ms = Some(500.0);
    let waits = |view: &mut JointsView| view.servos.as_mut().unwrap().0.counters.cycles = 1;
    bench.pass(4900, waits);
    bench.said(&[]);
    bench.pass(500, waits);
    assert_eq!(bench.bench.kinds(), ["serial-stuck"]);
}

#[test]
fn another_program_that_takes_answers_explains_those_that_are_missing() {
    let mut bench = JointsBench::answering(3);
    bench.pass(2000, |view| {
        view.servos.as_mut().unwrap().1.taken_ns = Some(view.now_ns);
        (0..3).for_each(|joint| servo(view, joint).alive = false);
        servo(view, 1).counters.bad_crc += 5;
        servo(view, 2).counters.late += 5;
        view.tick.angles.fill(f32::NAN);
        servo(view, 0).temperature_c = Some(75);
    });
    assert_eq!(bench.bench.kinds(), ["servo-hot", "serial-shared"]);
    let told: Vec<&str> = bench.bench.said.iter().map(sentence).collect();
    assert!(told[1].contains("another program reads /dev/servos"), "{told:?}");
    assert!(told[1].contains("`fuser -v /dev/servos`"), "{told:?}");
    bench.bench.said.clear();
    bench.pass(5000, |view| {
        (0..3).for_each(|joint| servo(view, joint).alive = true);
        view.tick.angles.fill(0.0);
    });
    bench.said(&[&["no other program reads /dev/servos any more"]]);
}

/// Angles come a tick later than the servos' answers.
#[test]
fn an_angle_is_not_stale_for_the_time_that_the_adapter_was_away() {
    let mut bench = JointsBench::answering(2);
    bench.pass(3000, |view| {
        away(view);
        view.tick.angles.fill(f32::NAN);
    });
    bench.said(&[&["is gone, unplugged"]]);
    open(&mut bench.view, "/dev/ttyUSB1", 1);
    let answer = |view: &mut JointsView| (0..2).for_each(|joint| servo(view, joint).alive = true);
    bench.pass(200, answer);
    bench.said(&[&["is there"]]);
    bench.pass(2000, |view| {
        answer(view);
        view.tick.angles.fill(0.5);
    });
    bench.said(&[]);
}

#[test]
fn a_thread_that_has_died_is_told_as_that() {
    let mut bench = JointsBench::answering(2);
    bench.pass(5000, |view| {
        let (snapshot, port) = view.servos.as_mut().unwrap();
        snapshot.counters.cycles = 1;
        port.abandoned = true;
        view.tick.angles.fill(f32::NAN);
    });
    bench.said(&[&[
        "has died of a fault of taxeld",
        "/dev/servos is not read",
        "restart taxeld",
    ]]);
    assert_eq!(bench.bench.kinds(), ["serial-stuck"]);
}

/// Nobody has put right what they said last, and it is not told anew when they can be asked again.
#[test]
fn what_servos_said_of_themselves_stays_while_nobody_can_ask_them() {
    type Change = fn(&mut JointsView);
    let unplugged: Change = away;
    let hangs: Change = |view| view.servos.as_mut().unwrap().0.counters.cycles = 1;
    let dies: Change = |view| view.servos.as_mut().unwrap().1.abandoned = true;
    for (change, port) in [
        (unplugged, "serial-absent"),
        (hangs, "serial-stuck"),
        (dies, "serial-stuck"),
    ] {
        let mut bench = JointsBench::answering(4);
        bench.pass(1000, |view| {
            servo(view, 0).motor_lost = Some(MotorLost::GoneOff);
            (servo(view, 1).torque_enabled, servo(view, 1).watchdog_tripped) = (Some(true), Some(true));
            servo(view, 2).hardware_error = Some(HardwareError(0x20));
            servo(view, 3).identity = Some(ServoIdentity {
                model_number: 51_200,
                ..ServoIdentity::default()
            });
        });
        let own = ["motor-lost", "motor-stopped", "servo-error", "servo-model"];
        assert_eq!(bench.bench.kinds(), own);
        bench.bench.said.clear();
        bench.pass(3000, change);
        assert_eq!(bench.bench.kinds(), [&own[..], &[port]].concat());
        assert_eq!(bench.bench.said.len(), 1, "{:#?}", bench.bench.said);
        bench.bench.said.clear();
        open(&mut bench.view, "/dev/ttyUSB1", 1);
        bench.pass(2000, |view| {
            view.servos.as_mut().unwrap().1.abandoned = false;
            (0..4).for_each(|joint| servo(view, joint).alive = true);
        });
        assert_eq!(bench.bench.kinds(), own);
        assert_eq!(bench.bench.said.len(), 1, "{:#?}", bench.bench.said);
    }
}

/// A servo that was silent is asked anew who it is.
#[test]
fn a_model_that_is_not_known_is_a_problem_until_the_servo_says_another() {
    let mut bench = JointsBench::answering(2);
    let is = |view: &mut JointsView, model: Option<u16>| {
        servo(view, 1).identity = model.map(|model_number| ServoIdentity {
            model_number,
            ..ServoIdentity::default()
        });
    };
    bench.pass(1000, |view| is(view, Some(51_200)));
    bench.said(&[&["the model number 51200 of servo 2 is not known"]]);
    bench.pass(1000, |view| is(view, None));
    bench.pass(1000, |view| is(view, Some(51_200)));
    bench.said(&[]);
    bench.pass(100, |view| is(view, None));
    bench.pass(100, |view| is(view, Some(1030)));
    bench.said(&[&["servo 2 is of a known model"]]);
}
