//! Several motors that are to be off at once: they are told so in one packet, and asked for it in one.

use crate::proof::bits;
use crate::writes::{register, start, watched};
use crate::{MS, World};
use std::ops::Range;
use taxel_joints::bus::{Step, WriteCommand, WriteError};
use taxel_sim::servo::{AfterSilence, ServoFault};

const OFF: WriteCommand = WriteCommand::Torque(false);
const TORQUE: u8 = 64;
const WATCHDOG: u8 = 98;

/// Motors that are on, of servos whose answers all take so long.
pub(crate) fn slow(n: u8, late_ns: u64) -> World {
    let mut w = watched(n, 2540);
    w.bus.set_margins_ns(2 * late_ns + 30 * MS, 4 * MS);
    for id in 1..=n {
        w.fault(id, ServoFault::Late { by_ns: late_ns });
    }
    w.cycles(30);
    start(&mut w, 0..usize::from(n));
    w
}

pub(crate) fn switch_off(w: &mut World, servos: Range<usize>) {
    for servo in servos {
        w.bus.command(servo, OFF).unwrap();
    }
}

pub(crate) fn says_off(w: &World, servo: usize) -> bool {
    w.bus.servo(servo).unwrap().torque_enabled == Some(false)
}

/// Goes on, cycle after cycle, until this is so, for so long at most.
#[track_caller]
pub(crate) fn until(w: &mut World, within_ns: u64, what: &str, done: impl Fn(&World) -> bool) {
    let end_ns = w.now_ns + within_ns;
    while !done(w) {
        w.go_on(u64::MAX);
        assert!(w.now_ns <= end_ns, "{what}: not within {} ms", within_ns / MS);
    }
}

/// Instruction and address of each request.
pub(crate) fn asked(w: &World) -> Vec<(u8, u8)> {
    w.requests
        .iter()
        .map(|request| (request[7], request[8]))
        .collect()
}

#[test]
fn of_healthy_servos_behind_a_slow_adapter_it_is_known_after_one_answer_that_all_are_off() {
    for (n, late_ms) in [(6, 15), (6, 60), (6, 100), (10, 100), (16, 30), (16, 60)] {
        for (at_the_end, while_reading) in [(false, false), (false, true), (true, false), (true, true)] {
            let what =
                format!("{n} of {late_ms} ms, at the end: {at_the_end}, while reading: {while_reading}");
            let all = usize::from(n);
            let mut w = slow(n, late_ms * MS);
            let counted = |w: &World| {
                let late = (0..all).map(|servo| w.bus.servo(servo).unwrap().counters.late);
                late.sum::<u64>() + w.bus.counters().late_fast
            };
            let before = counted(&w);
            if while_reading {
                w.bus.begin(w.now_ns);
                assert!(w.turn(), "{what}");
            }
            w.requests.clear();
            if at_the_end {
                w.bus.release_motors();
            } else {
                switch_off(&mut w, 0..all);
            }
            if !while_reading {
                w.bus.begin(w.now_ns);
            }
            let on_the_wire = 20 * MS;
            until(&mut w, late_ms * MS + on_the_wire, &what, |w| {
                (0..all).all(|servo| says_off(w, servo))
            });
            assert_eq!(asked(&w), [(0x83, TORQUE), (0x82, TORQUE)], "{what}");
            let disarmed = |w: &World| (1..=n).all(|id| register(w, id, WATCHDOG.into(), 1) == 0);
            assert!(!disarmed(&w), "{what}");
            w.requests.clear();
            until(&mut w, late_ms * MS + on_the_wire, &what, disarmed);
            assert_eq!(asked(&w)[..1], [(0x83, WATCHDOG)], "{what}");
            w.cycles(30);
            assert!(!w.bus.has_writes(), "{what}");
            assert_eq!(counted(&w), before, "{what}");
        }
    }
}

#[test]
fn one_whose_answer_is_missing_or_damaged_costs_the_others_nothing() {
    const LATE_NS: u64 = 60 * MS;
    for fault in [
        ServoFault::Silent,
        ServoFault::BadCrc,
        ServoFault::Refuse { number: 7 },
    ] {
        for bad in [1, 3, 6] {
            let what = format!("{fault:?} of servo {bad}");
            let mut w = slow(6, LATE_NS);
            w.fault(bad, fault);
            switch_off(&mut w, 0..6);
            w.bus.begin(w.now_ns);
            let bad = usize::from(bad) - 1;
            until(&mut w, LATE_NS + 20 * MS, &what, |w| {
                (0..6).all(|servo| servo == bad || says_off(w, servo))
            });
            w.servos.set_fault(bad as u8 + 1, None, 1);
            w.cycles(30);
            assert!(says_off(&w, bad) && !w.bus.has_writes(), "{what}");
        }
    }
}

#[test]
fn those_that_wait_for_one_that_is_silent_are_asked_again_without_it() {
    for (silent, rests) in [
        (1, false),
        (3, false),
        (6, false),
        (1, true),
        (3, true),
        (6, true),
    ] {
        let what = format!("servo {silent}, which rests: {rests}");
        let mut w = watched(6, 2540);
        w.servos.set_after_silence(AfterSilence::Stop);
        start(&mut w, 0..6);
        w.fault(silent, ServoFault::Silent);
        match rests {
            true => drop(w.cycles(10)),
            false => w.bus.set_margins_ns(450 * MS, 4 * MS),
        }
        switch_off(&mut w, 0..6);
        w.bus.begin(w.now_ns);
        w.requests.clear();
        until(&mut w, 15 * MS, &what, |w| {
            (0..6).all(|servo| servo + 1 == usize::from(silent) || says_off(w, servo))
        });
        // One that rests is asked last, and holds up nobody.
        if rests {
            assert_eq!(asked(&w), [(0x83, TORQUE), (0x82, TORQUE)], "{what}");
        }
    }
}

#[test]
fn those_that_are_to_be_off_one_shortly_after_the_other_are_asked_together() {
    const LATE_NS: u64 = 60 * MS;
    let mut w = slow(6, LATE_NS);
    w.bus.begin(w.now_ns);
    let from_ns = w.now_ns;
    switch_off(&mut w, 0..1);
    until(&mut w, 20 * MS, "told", |w| register(w, 1, 64, 1) == 0);
    w.now_ns += 10 * MS;
    switch_off(&mut w, 1..3);
    until(&mut w, 20 * MS, "told", |w| register(w, 3, 64, 1) == 0);
    w.now_ns += 10 * MS;
    switch_off(&mut w, 3..6);
    let left_ns = from_ns + LATE_NS + 40 * MS - w.now_ns;
    until(&mut w, left_ns, "all", |w| (0..6).all(|servo| says_off(w, servo)));
}

#[test]
fn who_has_one_that_is_silent_switched_off_again_and_again_keeps_no_other_waiting() {
    const LATE_NS: u64 = 60 * MS;
    let mut w = slow(2, LATE_NS);
    w.fault(1, ServoFault::Silent);
    switch_off(&mut w, 0..2);
    w.bus.begin(w.now_ns);
    let from_ns = w.now_ns;
    for number in 1.. {
        w.bus.numbered_command(number, 0, OFF).unwrap();
        assert!(w.turn_to(w.now_ns + 10 * MS));
        if says_off(&w, 1) {
            break;
        }
        assert!(w.now_ns < from_ns + LATE_NS + 10 * MS);
    }
    // What is said of the newest is that it is silent.
    let newest = w.bus.servo(0).unwrap().motor_off.newest;
    until(&mut w, 1_000 * MS, "told", |w| {
        let off = w.bus.servo(0).unwrap().motor_off.written;
        off.is_some_and(|off| (off.number, off.result) == (newest, Err(WriteError::Silent)))
    });
}

#[test]
fn healthy_servos_that_are_left_again_and_again_for_others_to_be_off_are_not_silent() {
    for late_ms in [20, 60] {
        for every_ms in [3, 10, 20, 50] {
            let what = format!("{late_ms} ms, one each {every_ms} ms");
            let mut w = slow(6, late_ms * MS);
            let counted = |w: &World| {
                let timeouts = (0..6).map(|servo| w.bus.servo(servo).unwrap().counters.timeouts);
                (timeouts.sum::<u64>(), w.bus.counters().writes_failed)
            };
            let before = counted(&w);
            let (mut due_ns, end_ns) = (w.now_ns, w.now_ns + 3_000 * MS);
            w.bus.begin(w.now_ns);
            for number in 1.. {
                while w.now_ns < due_ns {
                    w.go_on(due_ns);
                    assert!((0..6).all(|servo| w.bus.servo(servo).unwrap().alive), "{what}");
                }
                if w.now_ns >= end_ns {
                    break;
                }
                w.bus.numbered_command(number, number as usize % 6, OFF).unwrap();
                due_ns += every_ms * MS;
            }
            assert_eq!(counted(&w), before, "{what}");
            w.cycles(30);
            assert!(
                (0..6).all(|servo| says_off(&w, servo)) && !w.bus.has_writes(),
                "{what}"
            );
        }
    }
}

#[test]
fn watchdogs_that_offs_overtake_are_cleared_behind_them_in_one_packet() {
    let mut w = slow(3, 20 * MS);
    for servo in 0..3 {
        w.bus.command(servo, OFF).unwrap();
        if servo == 0 {
            w.bus.begin(w.now_ns);
        }
        until(&mut w, 30 * MS, "off", |w| says_off(w, servo));
    }
    w.requests.clear();
    w.cycles(1);
    let cleared = w.requests.iter().filter(|r| (r[7], r[8]) == (0x83, WATCHDOG));
    assert_eq!(cleared.map(|r| r.len()).collect::<Vec<_>>(), [14 + 2 * 3]);
    assert!((1..=3).all(|id| register(&w, id, WATCHDOG.into(), 1) == 0));
}

/// Motors that were told to be off by commands of the number 7; what they answer is for who has this to say.
fn told_and_asked(n: u8) -> World {
    let mut w = watched(n, 2540);
    start(&mut w, 0..usize::from(n));
    tell_and_ask(&mut w, n);
    w
}

fn tell_and_ask(w: &mut World, n: u8) {
    for servo in 0..usize::from(n) {
        w.bus.numbered_command(7, servo, OFF).unwrap();
    }
    w.bus.begin(w.now_ns);
    while w.requests.last().is_none_or(|r| (r[7], r[8]) != (0x82, TORQUE)) {
        assert!(w.turn());
    }
    w.servos.hang_up();
}

/// Servo 1 is told once more to be off, and only then that its watchdog is cleared.
#[track_caller]
fn is_told_again(w: &mut World) {
    w.requests.clear();
    w.cycles(10);
    let told = |at: u8| {
        let is_told = |r: &Vec<u8>| (r[7], r[8]) == (0x83, at) && r[12..].chunks(2).any(|to| to[0] == 1);
        w.requests.iter().position(is_told)
    };
    assert!(told(TORQUE).unwrap() < told(WATCHDOG).unwrap());
}

#[test]
fn of_two_servos_with_one_id_both_have_to_be_off() {
    let mut w = told_and_asked(2);
    for torque in [0, 1] {
        w.say_torque(1, torque);
    }
    let off = w.bus.servo(0).unwrap().motor_off;
    let result = off.written.map(|written| written.result);
    assert_eq!((result, off.unconfirmed), (Some(Err(WriteError::StillOn)), true));
    is_told_again(&mut w);
    assert!(says_off(&w, 0) && !w.bus.has_writes());
}

#[test]
fn of_two_servos_with_one_id_the_first_that_says_it_is_on_is_not_outdone_by_the_other() {
    let mut w = told_and_asked(3);
    for (id, torque) in [(1, 1), (1, 0), (2, 0), (3, 0)] {
        w.say_torque(id, torque);
    }
    let is_done = |w: &World, servo| {
        let done = w.bus.servo(servo).unwrap().motor_off.written;
        done.is_some_and(|done| (done.number, done.result) == (7, Ok(())))
    };
    assert_eq!([0, 1, 2].map(|servo| is_done(&w, servo)), [false, true, true]);
    is_told_again(&mut w);
    assert!(is_done(&w, 0) && says_off(&w, 0) && !w.bus.has_writes());
}

#[test]
fn of_two_servos_that_are_known_to_share_an_id_it_is_said_that_they_are_off_once_both_had_their_time() {
    for n in [1, 3] {
        for second in [None, Some(0), Some(1)] {
            let what = format!("{n}, the second says {second:?}");
            let mut w = watched(n, 2540);
            start(&mut w, 0..usize::from(n));
            w.fault(1, ServoFault::Twice);
            w.cycles(300);
            w.servos.set_fault(1, None, 1);
            tell_and_ask(&mut w, n);
            (1..=n).for_each(|id| w.say_torque(id, 0));
            let is_said = |w: &World| {
                let off = w.bus.servo(0).unwrap().motor_off.written;
                off.is_some_and(|off| (off.number, off.result) == (7, Ok(())))
            };
            assert!(matches!(w.bus.step(w.now_ns), Step::Wait { .. }), "{what}");
            assert!(!is_said(&w), "{what}");
            second.into_iter().for_each(|torque| w.say_torque(1, torque));
            w.requests.clear();
            while !is_said(&w) {
                assert!(w.turn(), "{what}");
            }
            let told = w.requests.iter().filter(|r| (r[7], r[8]) == (0x83, TORQUE));
            assert_eq!(told.count(), usize::from(second == Some(1)), "{what}: told again");
        }
    }
}

#[test]
fn no_watchdog_of_two_servos_with_one_id_is_cleared_wherever_they_are_asked() {
    for shared in 1..=3 {
        let mut w = watched(3, 2540);
        start(&mut w, 0..3);
        w.fault(shared, ServoFault::Twice);
        w.cycles(300);
        switch_off(&mut w, 0..3);
        w.cycles(10);
        assert!(!w.bus.has_writes(), "{shared}");
        for id in 1..=3 {
            let of = (
                register(&w, id, TORQUE.into(), 1),
                register(&w, id, WATCHDOG.into(), 1),
            );
            assert_eq!(of, (0, if id == shared { 127 } else { 0 }), "{shared}: {id}");
        }
    }
}

#[test]
fn no_motor_of_several_is_said_to_be_off_that_is_on_nor_runs_without_a_watchdog() {
    const N: u8 = 4;
    for seed in 0..200 {
        let what = format!("seed {seed}");
        let mut draws = 0;
        let mut draw = move |of: u64| {
            draws += 1;
            bits(seed, 7, draws) % of
        };
        let mut w = watched(N, 2540);
        w.cycles(5);
        if draw(2) == 0 {
            w.servos.set_after_silence(AfterSilence::Stop);
        }
        let mut drops = 0;
        w.lost = Box::new(move |_| {
            drops += 1;
            bits(seed, 8, drops) % 100 < 10
        });
        // The newest command to switch each off, unless it was started since.
        let mut off = [None; N as usize];
        let check = |w: &World, off: &[Option<u64>; N as usize]| {
            for (servo, id) in (0..).zip(1..=N) {
                let state = w.bus.servo(servo).unwrap();
                let is_off = register(w, id, 64, 1) == 0;
                let said = state.motor_off.written.filter(|written| written.result.is_ok());
                let is_said = off[servo].is_some_and(|number| said.is_some_and(|s| s.number == number));
                assert!(
                    is_off || state.motor_off.unconfirmed || !is_said,
                    "{what}: servo {id}"
                );
                assert!(
                    is_off || register(w, id, 98, 1) != 0,
                    "{what}: no watchdog at servo {id}"
                );
            }
        };
        for number in 1..150 {
            match draw(4) {
                0 => {
                    for (servo, newest) in off.iter_mut().enumerate() {
                        if draw(4) > 0 {
                            w.bus.numbered_command(number, servo, OFF).unwrap();
                            *newest = Some(number);
                        }
                    }
                }
                1 => {
                    let servo = draw(N.into()) as usize;
                    if w.bus
                        .numbered_command(number, servo, WriteCommand::Start(9))
                        .is_ok()
                    {
                        off[servo] = None;
                    }
                }
                _ => {}
            }
            w.bus.begin(w.now_ns);
            loop {
                let id = 1 + draw(N.into()) as u8;
                match draw(4) {
                    0 => w.fault(id, ServoFault::Silent),
                    1 => w.fault(id, ServoFault::BadCrc),
                    2 => w.fault(
                        id,
                        ServoFault::Late {
                            by_ns: draw(20_000) * 1000,
                        },
                    ),
                    _ => assert!(w.servos.set_fault(id, None, 1)),
                }
                if !w.turn() {
                    break;
                }
                check(&w, &off);
                let asked = w.requests.last().filter(|r| r[7] == 0x82);
                let ids = asked.map_or(&[][..], |r| &r[12..r.len() - 2]);
                assert!(
                    (1..ids.len()).all(|i| !ids[..i].contains(&ids[i])),
                    "{what}: {ids:?}"
                );
            }
            w.now_ns += 5 * MS;
        }
        for servo in 0..usize::from(N) {
            w.bus.numbered_command(999, servo, OFF).unwrap();
        }
        w.lost = Box::new(|_| false);
        for id in 1..=N {
            w.servos.set_fault(id, None, 1);
        }
        w.cycles(200);
        check(&w, &[Some(999); N as usize]);
        assert!((0..usize::from(N)).all(|servo| says_off(&w, servo)), "{what}");
        assert!(!w.bus.has_writes(), "{what}");
    }
}
