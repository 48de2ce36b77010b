//! A motor that was switched on here and is no longer on, or no longer under the watchdog that was armed.

use crate::writes::{register, start, watched, write_of};
use crate::{MS, World};
use taxel_joints::bus::{MotorLost, WriteCommand, WriteError, WriteRefused};
use taxel_joints::protocol2::{Encoder, Instruction};
use taxel_sim::servo::ServoFault;

const ON: WriteCommand = WriteCommand::Torque(true);
const OFF: WriteCommand = WriteCommand::Torque(false);
const GOAL: WriteCommand = WriteCommand::GoalPwm(90);

/// Another host tells a servo something; what it answers is not heard here.
pub(crate) fn meddle(w: &mut World, id: u8, instruction: Instruction, parameters: &[u8]) {
    let mut encoder = Encoder::default();
    let packet = encoder
        .packet(id, instruction, parameters.iter().copied())
        .unwrap();
    w.servos.receive(packet, w.now_ns);
    w.servos.take_due(u64::MAX, &mut Vec::new());
}

/// A servo restarts; its motor is on behind it where its Startup Configuration (address 60) says so.
pub(crate) fn restart(w: &mut World, id: u8) {
    meddle(w, id, Instruction::Reboot, &[]);
}

pub(crate) fn starts_with_torque(w: &mut World, id: u8) {
    meddle(w, id, Instruction::Write, &[60, 0, 1]);
}

pub(crate) fn torque_and_watchdog(w: &World, id: u8) -> [i32; 2] {
    [64, 98].map(|at| register(w, id, at, 1))
}

pub(crate) fn lost(w: &World, servo: usize) -> Option<MotorLost> {
    w.bus.servo(servo).unwrap().motor_lost
}

pub(crate) fn refusal(servo: usize, lost: MotorLost) -> WriteRefused {
    WriteRefused::MotorLost { joint: servo, lost }
}

/// Whether a servo was given a goal or switched on since.
fn is_moved(w: &World, id: u8) -> bool {
    let written = |r: &Vec<u8>| {
        write_of(r).is_some_and(|(to, at, value)| to == id && (at == 100 || at == 64 && value == 1))
    };
    w.requests
        .iter()
        .any(|r| written(r) || r[7] == 0x83 && r[8] == 100)
}

#[test]
fn a_servo_that_restarts_with_its_motor_on_has_it_switched_off_as_soon_as_it_answers_again() {
    for watchdog_ms in [100, 2540] {
        let mut w = watched(2, watchdog_ms);
        starts_with_torque(&mut w, 1);
        w.cycles(100);
        start(&mut w, [0, 1]);
        restart(&mut w, 1);
        let readings = |w: &World| w.bus.servo(0).unwrap().counters.ok;
        let before = readings(&w);
        while readings(&w) == before {
            w.cycles(1);
        }
        // A question takes the end of one cycle, and the next is free for it within 10 ms.
        w.cycles(3);
        assert_eq!(torque_and_watchdog(&w, 1), [0, 0], "{watchdog_ms}");
        assert_eq!(lost(&w, 0), Some(MotorLost::Restarted));
        assert_eq!(w.bus.command(0, GOAL), Err(refusal(0, MotorLost::Restarted)));
        w.cycles(200);
        assert_eq!(
            lost(&w, 0),
            Some(MotorLost::Restarted),
            "it is told until somebody acts"
        );
        assert_eq!(lost(&w, 1), None);
        assert_eq!(torque_and_watchdog(&w, 2), [1, i32::from(watchdog_ms) / 20]);
        w.bus.command(0, ON).unwrap();
        w.bus.command(0, GOAL).unwrap();
        w.cycles(2);
        assert_eq!((lost(&w, 0), register(&w, 1, 100, 2)), (None, 90));
    }
}

#[test]
fn no_motor_is_given_a_goal_whose_servo_may_have_restarted_since_its_watchdog_was_known() {
    // Nobody saw it: the host stood still meanwhile. The goals were asked for before it was heard again.
    for together in [false, true] {
        let mut w = watched(3, 2540);
        starts_with_torque(&mut w, 2);
        w.cycles(100);
        start(&mut w, 0..3);
        w.requests.clear();
        restart(&mut w, 2);
        w.now_ns += 150 * MS;
        match together {
            true => w.bus.command_together(7, &[(0, 90), (1, 90), (2, 90)]).unwrap(),
            false => (0..3).for_each(|servo| w.bus.command(servo, GOAL).unwrap()),
        }
        w.cycles(2);
        let others = if together { 0 } else { 90 };
        assert_eq!(
            [1, 2, 3].map(|id| register(&w, id, 100, 2)),
            [others, 885, others],
            "{together}"
        );
        assert_eq!(torque_and_watchdog(&w, 2), [0, 0], "{together}");
        if together {
            let error = WriteError::NotTaken(refusal(1, MotorLost::Restarted));
            for servo in 0..3 {
                assert_eq!(w.bus.outcome(servo, 7), Some(Err(error)));
            }
            assert!(!is_moved(&w, 1), "all or none");
        }
    }
}

#[test]
fn a_servo_that_restarts_in_the_middle_of_its_start_is_not_switched_on() {
    // It restarts behind so many of the five writes; the host stands still meanwhile.
    for sent in 1..=5 {
        let mut w = watched(1, 2540);
        starts_with_torque(&mut w, 1);
        w.cycles(100);
        w.requests.clear();
        w.bus.command(0, WriteCommand::Start(40)).unwrap();
        let writes = |w: &World| w.requests.iter().filter(|r| write_of(r).is_some()).count();
        w.bus.begin(w.now_ns);
        while writes(&w) < sent && w.turn() {}
        restart(&mut w, 1);
        w.now_ns += 150 * MS;
        while w.turn() {}
        w.cycles(300);
        let end = torque_and_watchdog(&w, 1);
        assert!([[0, 0], [1, 127]].contains(&end), "behind write {sent}: {end:?}");
    }
}

#[test]
fn a_goal_waits_for_a_watchdog_whose_servo_does_not_tell_it_and_is_given_up_in_the_end() {
    for (fault, error) in [
        (ServoFault::Silent, WriteError::Silent),
        (ServoFault::BadCrc, WriteError::Damaged),
    ] {
        let mut w = watched(2, 2540);
        start(&mut w, [0, 1]);
        w.requests.clear();
        w.now_ns += 60 * MS;
        w.fault(1, fault);
        w.bus.command_together(7, &[(0, 90), (1, 90)]).unwrap();
        w.cycles(1);
        assert!(!is_moved(&w, 1) && !is_moved(&w, 2), "all or none");
        w.cycles(5);
        let written = |servo: usize| w.bus.outcome(servo, 7).unwrap();
        assert_eq!([written(0), written(1)], [Err(error), Ok(())]);
        assert_eq!([1, 2].map(|id| register(&w, id, 100, 2)), [0, 90]);
        assert!(!w.bus.has_writes());
        // It is heard again in time.
        w.servos.set_fault(1, None, 1);
        w.cycles(200);
        w.now_ns += 60 * MS;
        w.servos.set_fault(1, Some(fault), 2);
        w.bus.command(0, GOAL).unwrap();
        w.cycles(1);
        assert_eq!(register(&w, 1, 100, 2), 0, "{fault:?}");
        w.servos.set_fault(1, None, 1);
        w.cycles(1);
        assert_eq!(register(&w, 1, 100, 2), 90, "{fault:?}");
    }
}

#[test]
fn a_watchdog_that_another_program_has_written_is_seen_within_a_second_and_the_motor_is_switched_off() {
    for (watchdog, expected) in [
        (0, MotorLost::Restarted),
        (
            50,
            MotorLost::Meddled {
                watchdog: 50,
                armed: 127,
            },
        ),
    ] {
        let mut w = watched(2, 2540);
        start(&mut w, [0, 1]);
        meddle(&mut w, 1, Instruction::Write, &[98, 0, watchdog]);
        let since_ns = w.now_ns;
        while lost(&w, 0).is_none() {
            w.cycles(1);
            assert!(w.now_ns - since_ns < 1100 * MS, "it is not seen");
        }
        w.cycles(2);
        assert_eq!(lost(&w, 0), Some(expected));
        assert_eq!(torque_and_watchdog(&w, 1), [0, 0]);
        assert_eq!(torque_and_watchdog(&w, 2), [1, 127]);
    }
}

#[test]
fn a_motor_that_goes_off_by_itself_is_no_longer_taken_for_one_that_is_on() {
    let mut w = watched(2, 2540);
    start(&mut w, [0, 1]);
    meddle(&mut w, 1, Instruction::Write, &[64, 0, 0]);
    let since_ns = w.now_ns;
    while lost(&w, 0).is_none() {
        w.cycles(1);
        assert!(w.now_ns - since_ns < 1100 * MS, "it is not seen");
    }
    assert_eq!(lost(&w, 0), Some(MotorLost::GoneOff));
    for goals in [
        w.bus.command(0, GOAL),
        w.bus.command_together(7, &[(1, 9), (0, 9)]),
    ] {
        assert_eq!(goals, Err(refusal(0, MotorLost::GoneOff)));
    }
    assert_eq!(w.bus.command(1, GOAL), Ok(()));
    w.bus.command(0, OFF).unwrap();
    assert_eq!(lost(&w, 0), None, "somebody wants it off");
    assert_eq!(w.bus.command(0, GOAL), Err(WriteRefused::MotorOff(0)));
}

#[test]
fn an_overload_that_switches_a_motor_off_is_seen_at_once() {
    let mut w = watched(2, 2540);
    start(&mut w, [0, 1]);
    w.cycles(50);
    meddle(&mut w, 1, Instruction::Write, &[64, 0, 0]);
    w.servos.servo_mut(1).unwrap().set_hardware_error(0x20);
    w.cycles(4);
    assert_eq!(lost(&w, 0), Some(MotorLost::GoneOff));
}

#[test]
fn a_motor_that_is_switched_on_and_off_here_again_and_again_is_never_lost() {
    // At every place of the slow lane's round.
    for pause in 0..60 {
        let mut w = watched(2, 2540);
        w.cycles(100 + pause);
        for command in [ON, OFF, WriteCommand::Start(0), ON, GOAL, OFF, ON] {
            w.bus.command(0, command).unwrap();
            w.bus.begin(w.now_ns);
            while w.turn() {
                assert_eq!(lost(&w, 0), None, "{command:?}");
            }
            w.cycles(usize::from(pause % 7 == 0) * 40);
            assert_eq!(lost(&w, 0), None, "{command:?}");
        }
        assert_eq!(torque_and_watchdog(&w, 1), [1, 127]);
    }
}

#[test]
fn a_motor_whose_start_its_servo_refuses_is_not_on() {
    let mut w = watched(1, 2540);
    w.cycles(100);
    w.bus.command(0, ON).unwrap();
    w.bus.begin(w.now_ns);
    // A sync write is refused without a word; that it is not on is what the servo holds.
    w.lost = Box::new(|request| write_of(request) == Some((1, 64, 1)));
    while w.turn() {}
    assert!(w.requests.iter().any(|r| write_of(r) == Some((1, 64, 1))));
    assert_eq!(w.bus.command(0, GOAL), Err(WriteRefused::MotorOff(0)));
}

#[test]
fn a_goal_costs_no_question_as_long_as_the_servos_are_read_often() {
    let mut w = watched(2, 2540);
    start(&mut w, [0, 1]);
    w.cycles(100);
    let asks = |r: &&Vec<u8>| matches!(r[7], 0x02 | 0x82) && r[8..12] == [98, 0, 1, 0];
    let questions = |w: &World| w.requests.iter().filter(asks).count();
    let before = questions(&w);
    let from_ns = w.now_ns;
    for _ in 0..400 {
        w.bus.command(0, GOAL).unwrap();
        w.bus.command_together(7, &[(0, 9), (1, 9)]).unwrap();
        w.cycles(1);
    }
    let rounds = (w.now_ns - from_ns) / (700 * MS) + 1;
    assert!((questions(&w) - before) as u64 <= rounds);
}

#[test]
fn what_a_servo_refused_when_the_port_was_lost_is_held_against_no_goal_behind_it() {
    let mut w = watched(2, 2540);
    start(&mut w, [0, 1]);
    w.now_ns += 60 * MS;
    w.fault(1, ServoFault::Refuse { number: 7 });
    w.fault(2, ServoFault::Silent);
    w.bus.command_together(7, &[(0, 90), (1, 90)]).unwrap();
    w.bus.begin(w.now_ns);
    // The first has refused to tell its watchdog, and the second is awaited.
    let asked = |w: &World| {
        w.requests
            .last()
            .is_some_and(|r| r[7] == 0x82 && r[8..10] == [98, 0])
    };
    while !asked(&w) && w.turn() {}
    assert!(asked(&w) && w.turn() && w.turn());
    w.bus.port_lost();
    w.bus.port_opened();
    for id in [1, 2] {
        w.servos.set_fault(id, None, 1);
    }
    w.cycles(2);
    w.now_ns += 60 * MS;
    w.bus.command_together(8, &[(0, 90), (1, 90)]).unwrap();
    w.cut = true;
    w.cycles(1);
    w.cut = false;
    w.cycles(2);
    assert_eq!([0, 1].map(|servo| w.bus.outcome(servo, 8)), [Some(Ok(())); 2]);
    assert_eq!([1, 2].map(|id| register(&w, id, 100, 2)), [90, 90]);
}
