//! Problems of servos that answer late, damaged, twice or not at all: which are of one and which of all, and when they are
//! over.

use super::joints::JointsBench;
use super::*;
use crate::Place;
use crate::joints::test_views::{open, servo, servos};

#[test]
fn answers_that_are_late_or_damaged_from_all_servos_are_one_problem() {
    type Change = fn(&mut JointsView, usize);
    let cases: [(&str, Change, &[&str]); 2] = [
        (
            "servo-late",
            |v, joint| servo(v, joint).counters.late += 1,
            &["most servos come after their deadline", "busy machine"],
        ),
        (
            "servo-damaged",
            |v, joint| servo(v, joint).counters.bad_crc += 1,
            &["most servos come damaged", "termination"],
        ),
    ];
    for (kind, change, words) in cases {
        let mut bench = JointsBench::answering(4);
        bench.pass(2000, |view| (0..4).for_each(|joint| change(view, joint)));
        bench.said(&[words]);
        assert_eq!(bench.bench.kinds(), [kind]);
        assert_eq!(bench.bench.problems.kinds(Place::Joints).len(), 1);
        bench.pass(1000, |view| {
            (0..4).for_each(|joint| servo(view, joint).counters.ok -= 1)
        });
        assert_eq!(bench.bench.kinds(), [kind], "nothing came");
        bench.pass(1000, |_| {});
        assert_eq!(bench.bench.kinds(), [""; 0]);
        // The cable breaks: three are silent, and the answers of the fourth are well.
        bench.pass(2000, |view| (0..4).for_each(|joint| change(view, joint)));
        bench.pass(2000, |view| {
            for joint in 0..3 {
                servo(view, joint).alive = false;
                view.tick.angles[joint] = f32::NAN;
            }
        });
        assert_eq!(bench.bench.kinds(), ["servo-silent"; 3]);
    }
    // A tenth of the answers late: a machine that was busy.
    let mut bench = JointsBench::answering(4);
    bench.pass(5000, |view| {
        servo(view, 1).counters.ok += 9;
        servo(view, 1).counters.late += 1;
    });
    bench.said(&[]);
}

#[test]
fn of_servos_that_all_answer_too_late_nobody_says_that_none_answers() {
    for (n, words) in [
        (2, "answers after its deadline"),
        (4, "most servos come after their deadline"),
    ] {
        let mut bench = JointsBench::answering(n);
        let pass = |bench: &mut JointsBench, late: u64| {
            bench.pass(3000, |view| {
                for joint in 0..n.into() {
                    servo(view, joint).alive = false;
                    servo(view, joint).counters.late += late;
                    view.tick.angles[joint] = f32::NAN;
                }
            });
        };
        pass(&mut bench, 1);
        bench.said(&[&[words, "`answer_margin_ms`", "taxel doctor"]]);
        assert!(bench.bench.kinds().iter().all(|kind| *kind == "servo-late"));
        pass(&mut bench, 0);
        assert_eq!(bench.bench.kinds(), ["servos-silent"]);
    }
}

#[test]
fn one_late_or_damaged_answer_is_no_problem_where_most_servos_had_one() {
    type Change = fn(&mut JointsView, usize);
    let cases: [(Change, &str, &str); 2] = [
        (
            |v, joint| servo(v, joint).counters.late += 1,
            "most servos come after",
            "the servos answer in time",
        ),
        (
            |v, joint| servo(v, joint).counters.bad_crc += 1,
            "most servos come damaged",
            "answers are whole",
        ),
    ];
    for (change, came, over) in cases {
        let mut bench = JointsBench::answering(4);
        bench.pass(1500, |view| (0..4).for_each(|joint| change(view, joint)));
        bench.said(&[&[came]]);
        // One of each in half a second keeps it up.
        let mut looks = 0;
        bench.pass(2000, |view| {
            looks += 1;
            (0..4)
                .filter(|_| looks % 5 == 0)
                .for_each(|joint| change(view, joint));
        });
        bench.said(&[]);
        // One of a servo comes while those of the others are forgotten.
        let mut looks = 0;
        bench.pass(1500, |view| {
            looks += 1;
            if looks == 3 {
                change(view, 1);
            }
        });
        bench.said(&[&[over]]);
        assert_eq!(bench.bench.kinds(), [""; 0]);
    }
}

#[test]
fn servos_that_are_late_and_in_time_again_at_the_same_look_are_told_together() {
    for (late, came, over) in [
        (
            2,
            "; the same of 1 more servo (servo 2). Look",
            "; the same of 1 more servo (servo 2) (after",
        ),
        (
            6,
            "; the same of 5 more servos (servo 2, servo 3, servo 4, ...). Look",
            "; the same of 5 more servos (servo 2, servo 3, servo 4, ...) (after",
        ),
    ] {
        let mut bench = JointsBench::answering(12);
        bench.pass(1500, |view| {
            (0..late).for_each(|joint| servo(view, joint).counters.late += 1);
        });
        bench.said(&[&["servo 1 answers after its deadline", came]]);
        assert_eq!(bench.bench.kinds(), vec!["servo-late"; late]);
        bench.pass(1000, |_| {});
        bench.said(&[&["servo 1 answers in time", over]]);
    }
}

#[test]
fn what_is_at_the_edge_does_not_come_and_go() {
    let mut bench = JointsBench::answering(2);
    let mut looks = 0;
    bench.pass(20_000, |view| {
        looks += 1;
        servo(view, 0).temperature_c = Some(if looks % 2 == 0 { 70 } else { 66 });
        // An answer in half a second late is none too many; and one keeps up what there is.
        servo(view, 1).counters.late += u64::from(looks % 4 == 0 || looks < 10);
    });
    assert_eq!(bench.bench.kinds(), ["servo-hot", "servo-late"]);
    assert_eq!(bench.bench.said.len(), 2, "{:#?}", bench.bench.said);
    let mut bench = JointsBench::answering(1);
    bench.pass(20_000, |view| {
        servo(view, 0).counters.late += u64::from(view.now_ns % (1000 * MS) == 0)
    });
    assert_eq!(bench.bench.said, [], "one in a second");
}

#[test]
fn what_is_wrong_with_answers_is_not_over_while_none_come() {
    type Change = fn(&mut JointsView);
    let cases: [(Change, &str); 4] = [
        (|v| servo(v, 1).counters.late += 3, "answers in time"),
        (|v| servo(v, 1).counters.bad_crc += 3, "are whole"),
        (|v| servo(v, 1).counters.double += 3, "one servo answers"),
        (|v| servo(v, 1).counters.refused += 3, "is read again"),
    ];
    for (change, over) in cases {
        let mut bench = JointsBench::answering(4);
        bench.pass(1000, change);
        let told = bench.bench.kinds();
        assert_eq!(told.len(), 1);
        bench.bench.said.clear();
        // A machine that is held up asks nothing for a while.
        bench.pass(3000, |view| servo(view, 1).counters.ok -= 1);
        assert_eq!((bench.bench.kinds(), bench.bench.said.len()), (told, 0), "{over}");
        bench.pass(1000, |_| {});
        bench.said(&[&[over]]);
    }
}

#[test]
fn two_servos_with_one_id_are_told_of_as_long_as_they_damage_each_other_and_that_is_not_told_beside() {
    let mut bench = JointsBench::answering(4);
    bench.pass(2000, |view| servo(view, 1).counters.bad_crc += 3);
    bench.said(&[&["damaged (CRC)"]]);
    // In one packet with others they damage each other; what they are asked alone, now and then, they answer twice.
    for _ in 0..5 {
        let mut looks = 0;
        bench.pass(1000, |view| {
            servo(view, 1).counters.bad_crc += 3;
            servo(view, 1).counters.double += u64::from(looks < 2);
            looks += 1;
        });
        assert_eq!(bench.bench.kinds(), ["two-servos-one-id"]);
    }
    bench.said(&[&["are whole"], &["2 servos answer with the id of servo 2"]]);
    bench.pass(1000, |_| {});
    bench.said(&[&["one servo answers with the id"]]);
}

#[test]
fn a_damaged_answer_now_and_then_is_no_sign_that_there_are_still_two_servos_with_one_id() {
    let mut bench = JointsBench::answering(4);
    bench.pass(1000, |view| servo(view, 1).counters.double += 3);
    bench.said(&[&["2 servos answer with the id of servo 2"]]);
    // One is unplugged, and the cable is as noisy as it was.
    bench.pass(3000, |view| {
        servo(view, 1).counters.ok += 10;
        servo(view, 1).counters.bad_crc += u64::from(view.now_ns % (500 * MS) == 0);
    });
    bench.said(&[&["one servo answers with the id"]]);
    assert_eq!(bench.bench.kinds(), [""; 0]);
}

#[test]
fn servos_that_all_come_back_are_told_alone_and_one_that_does_not_after_it_was_asked_again() {
    let mut bench = JointsBench::answering(4);
    bench.pass(3000, |view| {
        (0..4).for_each(|joint| {
            servo(view, joint).alive = false;
            view.tick.angles[joint] = f32::NAN;
        });
    });
    bench.said(&[&["no servo answers"]]);
    // Each is asked again twice a second, so that one after the other answers.
    let mut looks = 0;
    bench.pass(2000, |view| {
        looks += 1;
        for joint in (0..3).filter(|joint| 2 * joint < looks) {
            servo(view, joint).alive = true;
            view.tick.angles[joint] = 0.0;
        }
    });
    bench.said(&[
        &["servos answer"],
        &["servo 4 is silent; check its power and cable. "],
    ]);
    bench.pass(2000, |view| {
        (servo(view, 3).alive, view.tick.angles[3]) = (true, 0.0)
    });
    bench.said(&[&["servo 4 answers again"]]);
}

#[test]
fn a_servo_that_was_never_heard_is_given_time_and_then_other_advice() {
    let (config, mut view) = servos(2);
    open(&mut view, "/dev/ttyUSB0", 16);
    servo(&mut view, 0).alive = true;
    view.tick.angles[0] = 0.0;
    let mut bench = JointsBench::new((config, view));
    bench.pass(900, |_| {});
    bench.said(&[&["16 ms", "/sys/bus/usb-serial/devices/ttyUSB0/latency_timer"]]);
    bench.pass(500, |_| {});
    bench.said(&[&[
        "servo 2 is silent",
        "its id and its baud rate",
        "Status Return Level 2",
    ]]);
    bench.pass(500, |view| {
        let (_, port) = view.servos.as_mut().unwrap();
        port.latency.as_mut().unwrap().ftdi_timer_ms = Some(1);
    });
    bench.said(&[&["within 1 ms"]]);
}
