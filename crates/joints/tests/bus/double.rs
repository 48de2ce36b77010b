//! Two servos with one id: each request has two answers.

use crate::writes::{register, start, writable};
use crate::{MS, World, still};
use std::cell::RefCell;
use std::rc::Rc;
use taxel_joints::FastSyncRead;
use taxel_joints::bus::{NoReading, WriteCommand, WriteError, WriteRefused};
use taxel_joints::protocol2::crc16;
use taxel_sim::servo::ServoFault;

#[test]
fn of_two_servos_with_one_id_no_angle_is_taken_and_their_answers_are_neither_readings_nor_late() {
    // The first, one between others, the last, and one that is alone on its bus: where the second answer comes while others
    // are awaited, and where it comes when the request is over.
    // How long a cycle rests, against the 230 us of an answer: the second comes into the next request, or before it.
    let any: &[u64] = &[0, 100_000, 5 * MS];
    for (servos, id, pauses_ns) in [(4, 1, any), (4, 2, any), (4, 4, any), (1, 1, &[300_000, 5 * MS])] {
        for pause_ns in pauses_ns.iter().copied() {
            for piece in [7, usize::MAX] {
                let what = format!("{id} of {servos}, {pause_ns} ns, {piece}");
                let mut w = World::of(servos, FastSyncRead::Off);
                w.piece = piece;
                (0..100).for_each(|_| drop(w.cycle(pause_ns)));
                let of = usize::from(id) - 1;
                let before = w.bus.servo(of).unwrap().counters;
                w.fault(id, ServoFault::Twice);
                // It is the second answer that gives them away: the first cycle may be over by then.
                w.cycle(pause_ns);
                for n in 0..100 {
                    let results = w.cycle(pause_ns);
                    for (other, result) in (1..).zip(&results) {
                        let wanted = if other == id {
                            Err(NoReading::Double)
                        } else {
                            Ok(still(other))
                        };
                        assert_eq!(*result, wanted, "{what}: servo {other}, cycle {n}");
                    }
                }
                let after = w.bus.servo(of).unwrap().counters;
                assert!(after.ok - before.ok <= 1, "{what}: {after:?}");
                assert_eq!((after.late, after.timeouts), (0, 0), "{what}");
                // Those to the slow lane's questions too.
                assert!((99..=130).contains(&after.double), "{what}: {after:?}");

                w.servos.set_fault(id, None, 1);
                (0..2).for_each(|_| drop(w.cycle(pause_ns)));
                assert_eq!(w.cycle(pause_ns)[of], Ok(still(id)), "{what}: it is alone again");
                for other in (0..usize::from(servos)).filter(|other| *other != of) {
                    let counters = w.bus.servo(other).unwrap().counters;
                    assert_eq!((counters.double, counters.late), (0, 0), "{what}: servo {other}");
                }
            }
        }
    }
}

#[test]
fn answers_that_a_stalled_adapter_brings_all_at_once_are_late_and_not_of_two_servos_with_one_id() {
    let mut late = 0;
    for (servos, fast) in [
        (1, FastSyncRead::Off),
        (4, FastSyncRead::Off),
        (16, FastSyncRead::On),
    ] {
        for cycles in [1, 2, 3, 5, 8, 13, 21, 34, 55, 89, 144, 233] {
            for pause_ns in [100_000, 5 * MS, 10 * MS] {
                let what = format!("{servos} servos, {cycles} cycles of {pause_ns} ns");
                let mut w = World::of(servos, fast);
                (0..100).for_each(|_| drop(w.cycle(pause_ns)));
                let held = Rc::new(RefCell::new(Vec::new()));
                let to = held.clone();
                w.lost = Box::new(move |request| {
                    to.borrow_mut().extend_from_slice(request);
                    true
                });
                (0..cycles).for_each(|_| drop(w.cycle(pause_ns)));
                w.lost = Box::new(|_| false);
                w.servos.receive(&held.take(), w.now_ns);
                (0..400).for_each(|_| drop(w.cycle(pause_ns)));
                let counters = |i: u8| w.bus.servo(i.into()).unwrap().counters;
                for i in 0..servos {
                    assert_eq!(
                        counters(i).double,
                        0,
                        "{what}: servo {}, {:?}",
                        i + 1,
                        counters(i)
                    );
                }
                late += (0..servos).map(|i| counters(i).late).sum::<u64>();

                if fast == FastSyncRead::Off {
                    // Two servos with one id bring more answers than were ever asked for, whatever was owed.
                    w.fault(1, ServoFault::Twice);
                    (0..400).for_each(|_| drop(w.cycle(pause_ns)));
                    let double = w.bus.servo(0).unwrap().counters.double;
                    assert!(double > 100, "{what}: {double}");
                }
            }
        }
    }
    assert!(late > 100, "{late}");
}

#[test]
fn answers_that_never_come_hide_no_two_servos_with_one_id() {
    // Both had no power until now, or one answer in twenty is lost.
    for (what, cycles) in [("no power", 2000), ("a bad cable", 200)] {
        let mut w = World::of(2, FastSyncRead::Off);
        w.cycles(10);
        if what == "no power" {
            w.fault(1, ServoFault::Silent);
            w.cycles(cycles);
        } else {
            for _ in 0..cycles {
                w.fault(1, ServoFault::Silent);
                w.cycle(0);
                w.servos.set_fault(1, None, 1);
                w.cycles(19);
            }
        }
        let before = w.bus.servo(0).unwrap().counters.double;
        w.fault(1, ServoFault::Twice);
        (0..200).for_each(|_| drop(w.cycle(5 * MS)));
        let double = w.bus.servo(0).unwrap().counters.double - before;
        assert!(double > 150, "{what}: {double}");
    }
}

#[test]
fn two_servos_that_spoil_each_other_in_one_packet_are_found_by_what_they_are_asked_alone() {
    for (fault, double) in [(ServoFault::Twice, true), (ServoFault::BadCrc, false)] {
        let mut w = World::of(4, FastSyncRead::On);
        w.cycles(100);
        w.fault(2, fault);
        for results in w.cycles(400) {
            assert_eq!(results[1], Err(NoReading::BadCrc), "{fault:?}");
            assert_eq!(results[2], Ok(still(3)), "{fault:?}");
        }
        let counters = w.bus.servo(1).unwrap().counters;
        assert_eq!((counters.double > 2, counters.late), (double, 0), "{fault:?}");
        // Where only one of the two knows the instruction, it alone is in the packet.
        w.servos.set_fault(2, None, 1);
        let wanted = if double {
            Err(NoReading::Double)
        } else {
            Ok(still(2))
        };
        for results in w.cycles(100) {
            assert_eq!(results[1], wanted, "{fault:?}");
        }
        let alone_ns = w.now_ns;
        while w.cycle(MS)[1] != Ok(still(2)) {
            assert!(w.now_ns - alone_ns < 3_000 * MS, "it is alone");
        }
    }
}

#[test]
fn a_refusal_that_comes_before_its_turn_is_no_reading_that_is_taken_back() {
    let mut w = World::of(2, FastSyncRead::Off);
    w.cycles(10);
    w.fault(2, ServoFault::Silent);
    w.cycle(0);
    w.servos.set_fault(2, None, 1);
    let readings = |w: &World| w.bus.servo(1).unwrap().counters.ok;
    let before = readings(&w);

    // Servo 2 was silent, and what comes now before servo 1 has answered was meant for the request before.
    w.bus.begin(w.now_ns);
    assert!(w.turn());
    let mut refusal = vec![0xFF, 0xFF, 0xFD, 0x00, 2, 4, 0, 0x55, 1];
    refusal.extend(crc16(0, &refusal).to_le_bytes());
    w.bus.space()[..refusal.len()].copy_from_slice(&refusal);
    w.bus.take_bytes(refusal.len(), w.now_ns);
    while w.turn() {}

    let servo = w.bus.servo(1).unwrap().counters;
    assert_eq!((servo.late, servo.refused), (1, 1), "{servo:?}");
    assert_eq!(w.bus.results()[1].map(|r| r.position), Ok(still(2)));
    assert_eq!(readings(&w), before + 1);
}

#[test]
fn no_motor_of_two_servos_with_one_id_is_switched_on_or_given_a_goal_but_it_is_switched_off() {
    let mut w = writable(3);
    start(&mut w, [1]);
    w.bus.command(1, WriteCommand::GoalPwm(200)).unwrap();
    w.cycles(2);
    w.fault(2, ServoFault::Twice);
    w.cycles(300);
    let shared = Err(WriteRefused::TwoServos(1));
    for command in [
        WriteCommand::Torque(true),
        WriteCommand::Start(0),
        WriteCommand::Start(100),
        WriteCommand::GoalPwm(100),
    ] {
        assert_eq!(w.bus.command(1, command), shared, "{command:?}");
    }
    // Goals of several are given to all or none.
    start(&mut w, [0]);
    assert_eq!(w.bus.command_together(7, &[(0, 50), (1, 60)]), shared);
    w.bus.take(&[
        (8, 0, WriteCommand::GoalPwm(50)),
        (8, 1, WriteCommand::GoalPwm(60)),
    ]);
    assert_eq!(
        w.bus.outcome(1, 8),
        Some(Err(WriteError::NotTaken(WriteRefused::TwoServos(1))))
    );
    w.cycles(2);
    assert_eq!([1, 2].map(|id| register(&w, id, 100, 2)), [0, 200]);
    // Those that stop both are not refused.
    w.bus.command(1, WriteCommand::GoalPwm(0)).unwrap();
    w.cycles(2);
    assert_eq!(register(&w, 2, 100, 2), 0);
    w.bus.command(1, WriteCommand::Torque(false)).unwrap();
    w.cycles(2);
    assert_eq!(register(&w, 2, 64, 1), 0);

    w.servos.set_fault(2, None, 1);
    w.cycles(100);
    assert_eq!(
        w.bus.command(1, WriteCommand::Start(0)),
        shared,
        "it may be looked for"
    );
    w.cycles(400);
    start(&mut w, [1]);
    assert_eq!(register(&w, 2, 64, 1), 1);
}

#[test]
fn one_second_answer_refuses_no_goal() {
    let mut w = writable(2);
    w.cycles(5);
    let double = |w: &World| w.bus.servo(1).unwrap().counters.double;
    for _ in 0..3 {
        let before = double(&w);
        w.fault(2, ServoFault::Twice);
        while double(&w) == before {
            w.cycle(5 * MS);
        }
        w.servos.set_fault(2, None, 1);
        assert_eq!(w.bus.command(1, WriteCommand::Start(0)), Ok(()));
        w.cycles(600);
    }
}
