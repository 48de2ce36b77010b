//! Motors that somebody has switched off again and again, though they are: what that costs others.

use crate::offs::{asked, says_off, slow, switch_off, until};
use crate::writes::{register, start, watched, write_of};
use crate::{MS, World};
use taxel_joints::bus::{MotorOff, WriteCommand, WriteError};
use taxel_joints::protocol2::Encoder;
use taxel_sim::servo::ServoFault;

const OFF: WriteCommand = WriteCommand::Torque(false);
const TORQUE: u8 = 64;
const WATCHDOG: u8 = 98;

fn off(w: &World, servo: usize) -> MotorOff {
    w.bus.servo(servo).unwrap().motor_off
}

/// What became of the newest command to switch a motor off; `None` where it is not done with.
fn newest(w: &World, servo: usize) -> Option<Result<(), WriteError>> {
    let off = off(w, servo);
    let written = off.written.filter(|written| written.number == off.newest);
    written.map(|written| written.result)
}

/// When somebody who has a motor switched off without end asks for it again.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Again {
    /// As soon as it is confirmed, or was in vain.
    Answered,
    /// All the time, as several do.
    Always,
}

/// Several who have motors switched off again and again, as long as the test goes on.
struct Flood {
    servos: Vec<usize>,
    again: Again,
    number: u64,
    asked_ns: Vec<u64>,
    turns: u32,
    /// The longest that one has waited.
    waited_ns: u64,
}

impl Flood {
    fn new(w: &World, servos: impl IntoIterator<Item = usize>, again: Again) -> Self {
        let servos: Vec<usize> = servos.into_iter().collect();
        let asked_ns = vec![w.now_ns; servos.len()];
        Self {
            servos,
            again,
            number: 1_000_000,
            asked_ns,
            turns: 0,
            waited_ns: 0,
        }
    }

    /// Asks for what is to be asked for, and goes on by one turn; says whether a cycle is over with it.
    fn go_on(&mut self, w: &mut World) -> bool {
        self.turns += 1;
        assert!(self.turns < 100_000, "what is waited for never comes");
        for (servo, asked_ns) in self.servos.iter().zip(&mut self.asked_ns) {
            let is_done = newest(w, *servo).is_some();
            self.waited_ns = self.waited_ns.max(w.now_ns - *asked_ns);
            if is_done {
                *asked_ns = w.now_ns;
            }
            if is_done || self.again == Again::Always {
                self.number += 1;
                w.bus.numbered_command(self.number, *servo, OFF).unwrap();
            }
        }
        w.go_on(w.now_ns + 10 * MS)
    }
}

/// Three motors that are off and three that are on, of servos whose answers all take so long.
fn three_of_six(late_ns: u64) -> World {
    let mut w = slow(6, late_ns);
    switch_off(&mut w, 0..3);
    w.cycles(10);
    assert!((0..3).all(|servo| says_off(&w, servo)) && !w.bus.has_writes());
    w.requests.clear();
    w
}

/// What others have of four seconds: so many readings of one servo, and goals that are confirmed one behind the other, at most
/// one in each cycle.
fn four_seconds(w: &mut World, mut flood: Flood) -> (u64, u64, Flood) {
    let readings = |w: &World| w.bus.servo(5).unwrap().counters.ok;
    let (before, end_ns) = (readings(w), w.now_ns + 4_000 * MS);
    let mut goals = 0;
    w.bus.begin(w.now_ns);
    w.bus.numbered_command(1, 3, WriteCommand::GoalPwm(1)).unwrap();
    while w.now_ns < end_ns {
        let is_over = flood.go_on(w);
        if let Some(result) = w.bus.outcome(3, goals + 1).filter(|_| is_over) {
            assert_eq!(result, Ok(()));
            goals += 1;
            w.bus
                .numbered_command(goals + 1, 3, WriteCommand::GoalPwm(1))
                .unwrap();
        }
    }
    (readings(w) - before, goals, flood)
}

#[test]
fn who_has_motors_switched_off_that_are_off_without_end_leaves_the_others_most_of_the_time() {
    for late_ms in [0, 5, 60] {
        let mut w = three_of_six(late_ms * MS);
        let nobody = Flood::new(&w, [], Again::Answered);
        let (readings, goals, _) = four_seconds(&mut w, nobody);
        for again in [Again::Answered, Again::Always] {
            for n in [1, 3] {
                let what = format!("{late_ms} ms, {n} {again:?}");
                let mut w = three_of_six(late_ms * MS);
                let flood = Flood::new(&w, 0..n, again);
                let (read, given, flood) = four_seconds(&mut w, flood);
                assert!(read > readings * 6 / 10, "{what}: {read} of {readings} readings");
                assert!(given > goals * 6 / 10, "{what}: {given} of {goals} goals");
                // Nor do they wait for long themselves.
                let most_ns = (6 * late_ms + 20) * MS;
                assert!(flood.waited_ns < most_ns, "{what}: {} ns", flood.waited_ns);
                let asks = |r: &Vec<u8>| r[7] == 0x82 && r[8..12] == [WATCHDOG, 0, 1, 0];
                assert!(w.requests.iter().any(asks), "{what}: watchdogs are looked at");
            }
        }
    }
}

#[test]
fn all_motors_that_are_to_be_off_once_more_are_told_in_one_packet_each_once() {
    let mut w = three_of_six(60 * MS);
    let mut flood = Flood::new(&w, 0..3, Again::Always);
    let end_ns = w.now_ns + 5_000 * MS;
    w.bus.begin(w.now_ns);
    while w.now_ns < end_ns {
        flood.go_on(&mut w);
    }
    let told = w.requests.iter().filter(|r| (r[7], r[8]) == (0x83, TORQUE));
    let ids: Vec<Vec<u8>> = told
        .map(|r| r[12..r.len() - 2].chunks(2).map(|to| to[0]).collect())
        .collect();
    // The first is told before the others are asked for.
    assert!(
        ids.len() > 10 && ids[1..].iter().all(|ids| ids[..] == [1, 2, 3]),
        "{ids:?}"
    );
    // Their watchdogs were cleared before.
    assert!(!asked(&w).contains(&(0x83, WATCHDOG)));
}

#[test]
fn a_motor_that_is_off_is_told_so_at_once_where_nobody_else_has_asked_for_that() {
    let mut w = three_of_six(60 * MS);
    for number in 1..=3 {
        w.now_ns += 1_000 * MS;
        w.requests.clear();
        w.bus.numbered_command(number, 0, OFF).unwrap();
        assert!(w.bus.has_writes());
        w.cycles(1);
        assert_eq!(asked(&w)[..2], [(0x83, TORQUE), (0x82, TORQUE)]);
        assert_eq!((w.requests[2][7], newest(&w, 0)), (0x82, Some(Ok(()))));
    }
}

#[test]
fn a_motor_that_is_on_is_off_at_once_whoever_has_others_switched_off_that_are() {
    for turns in 1..60 {
        let mut w = three_of_six(60 * MS);
        let mut flood = Flood::new(&w, 0..3, Again::Always);
        w.bus.begin(w.now_ns);
        for _ in 0..turns {
            flood.go_on(&mut w);
        }
        w.bus.numbered_command(7, 4, OFF).unwrap();
        let end_ns = w.now_ns + 20 * MS;
        while register(&w, 5, TORQUE.into(), 1) == 1 {
            flood.go_on(&mut w);
            assert!(w.now_ns <= end_ns, "{turns}");
        }
        let end_ns = w.now_ns + 90 * MS;
        while newest(&w, 4) != Some(Ok(())) {
            flood.go_on(&mut w);
            assert!(w.now_ns <= end_ns, "{turns}");
        }
    }
}

#[test]
fn a_servo_that_has_come_back_is_told_at_once_that_its_motor_is_to_be_off() {
    let mut w = three_of_six(60 * MS);
    w.fault(2, ServoFault::Silent);
    let mut flood = Flood::new(&w, [0], Again::Always);
    let mut go_on = |w: &mut World, until: &dyn Fn(&World) -> bool| {
        while !until(w) {
            flood.go_on(w);
        }
    };
    w.bus.begin(w.now_ns);
    go_on(&mut w, &|w| !w.bus.servo(1).unwrap().alive);
    let on = Encoder::default().write(2, TORQUE.into(), &[1]).unwrap().to_vec();
    w.servos.receive(&on, w.now_ns);
    w.servos.hang_up();
    w.fault(2, ServoFault::Late { by_ns: 60 * MS });
    go_on(&mut w, &|w| w.bus.servo(1).unwrap().alive);
    // It has not said yet whether it is on.
    let (now_ns, turn) = (w.now_ns, w.requests.len());
    w.bus.numbered_command(7, 1, OFF).unwrap();
    go_on(&mut w, &|w| w.requests.len() > turn + 1);
    assert!(w.now_ns < now_ns + 20 * MS && register(&w, 2, TORQUE.into(), 1) == 0);
}

#[test]
fn a_start_behind_it_takes_the_place_of_what_would_switch_a_motor_off_once_more() {
    let mut w = three_of_six(60 * MS);
    let mut flood = Flood::new(&w, [1], Again::Always);
    w.bus.begin(w.now_ns);
    // The others have just had their turn.
    while newest(&w, 1) != Some(Ok(())) {
        flood.go_on(&mut w);
    }
    w.bus.numbered_command(7, 0, OFF).unwrap();
    // Behind these the start waits until they have it again.
    for servo in 3..6 {
        w.bus.command(servo, WriteCommand::GoalPwm(1)).unwrap();
    }
    w.bus.numbered_command(8, 0, WriteCommand::Start(9)).unwrap();
    w.requests.clear();
    while w.bus.outcome(0, 8).is_none() {
        flood.go_on(&mut w);
    }
    let told = w.requests.iter().filter(|r| (r[7], r[8]) == (0x83, TORQUE));
    let with_others = told.filter(|r| r[12..].chunks(2).any(|to| to == [1, 0]) && write_of(r).is_none());
    assert_eq!(with_others.count(), 0);
    assert_eq!((w.bus.outcome(0, 8), newest(&w, 0)), (Some(Ok(())), Some(Ok(()))));
    for _ in 0..200 {
        flood.go_on(&mut w);
    }
    assert_eq!([64, 98].map(|at| register(&w, 1, at, 1)), [1, 127]);
}

#[test]
fn who_has_a_motor_switched_off_without_end_that_does_not_confirm_it_keeps_no_other_from_being_driven() {
    for fault in [
        ServoFault::Silent,
        ServoFault::BadCrc,
        ServoFault::Refuse { number: 7 },
    ] {
        for again in [Again::Answered, Again::Always] {
            let what = format!("{fault:?} {again:?}");
            let mut w = watched(6, 2540);
            // In each cycle is time for one that is in vain.
            w.pause_ns = 30 * MS;
            start(&mut w, 0..6);
            w.fault(1, fault);
            let flood = Flood::new(&w, [0], again);
            w.bus.numbered_command(1, 0, OFF).unwrap();
            let (readings, goals, _) = four_seconds(&mut w, flood);
            assert!(
                readings > 50 && goals > 50,
                "{what}: {readings} readings, {goals} goals"
            );
        }
    }
}

#[test]
fn a_goal_that_is_in_vain_is_given_up_though_motors_are_switched_off_without_end_meanwhile() {
    for (late_ms, goals) in [(0, &[3][..]), (60, &[3]), (0, &[3, 4]), (60, &[3, 4])] {
        for fault in [ServoFault::Silent, ServoFault::BadCrc] {
            let mut w = three_of_six(late_ms * MS);
            let mut flood = Flood::new(&w, 0..3, Again::Always);
            for servo in goals {
                w.fault(*servo as u8 + 1, fault);
            }
            let given: Vec<(usize, i16)> = goals.iter().map(|servo| (*servo, 5)).collect();
            w.bus.begin(w.now_ns);
            w.bus.command_together(7, &given).unwrap();
            let end_ns = w.now_ns + 5_000 * MS;
            while goals.iter().any(|servo| w.bus.outcome(*servo, 7).is_none()) {
                flood.go_on(&mut w);
                assert!(w.now_ns < end_ns, "{late_ms} ms, {fault:?} of {goals:?}");
            }
        }
    }
}

/// Those that have just been told once more are to be so again, which waits.
fn two_that_wait() -> World {
    let mut w = three_of_six(60 * MS);
    for number in [1, 2] {
        for servo in 0..2 {
            w.bus.numbered_command(number, servo, OFF).unwrap();
        }
        if number == 1 {
            w.cycles(1);
        }
    }
    assert_eq!([0, 1].map(|servo| newest(&w, servo)), [None; 2]);
    w
}

#[test]
fn what_waits_to_be_told_once_more_when_the_port_is_lost_is_told_when_it_is_back() {
    let mut w = two_that_wait();
    w.bus.port_lost();
    for servo in 0..2 {
        assert_eq!(newest(&w, servo), Some(Err(WriteError::PortLost)));
        assert!(off(&w, servo).unconfirmed);
    }
    w.bus.port_opened();
    until(&mut w, 1_000 * MS, "told", |w| {
        (0..2).all(|servo| newest(w, servo) == Some(Ok(())))
    });
}

#[test]
fn what_waits_to_be_told_once_more_at_the_end_is_told_first() {
    let mut w = two_that_wait();
    w.bus.release_motors();
    w.requests.clear();
    w.bus.begin(w.now_ns);
    until(&mut w, 100 * MS, "told", |w| {
        (0..6).all(|servo| says_off(w, servo))
    });
    assert_eq!(
        w.requests[0].len(),
        14 + 2 * 5,
        "the three that are on and those two"
    );
    assert_eq!([0, 1].map(|servo| newest(&w, servo)), [Some(Ok(())); 2]);
}

#[test]
fn the_watchdogs_of_motors_that_are_switched_off_without_end_are_cleared() {
    let mut w = slow(2, 60 * MS);
    let mut flood = Flood::new(&w, 0..2, Again::Always);
    w.bus.begin(w.now_ns);
    while (1..=2).any(|id| register(&w, id, WATCHDOG.into(), 1) != 0) {
        flood.go_on(&mut w);
    }
    assert!((0..2).all(|servo| says_off(&w, servo)));
}

#[test]
fn what_a_motor_that_is_off_is_being_told_to_start_it_is_not_told_again_behind_a_torque_off() {
    let mut w = watched(2, 2540);
    switch_off(&mut w, 0..1);
    w.cycles(10);
    w.bus.command(0, WriteCommand::Start(9)).unwrap();
    w.bus.begin(w.now_ns);
    while w.requests.last().and_then(|r| write_of(r)) != Some((1, WATCHDOG, 127)) {
        assert!(w.turn());
    }
    w.fault(1, ServoFault::Silent);
    w.bus.numbered_command(7, 0, OFF).unwrap();
    while w.turn() {}
    w.servos.set_fault(1, None, 1);
    w.requests.clear();
    w.cycles(30);
    assert!(!w.requests.iter().any(|r| write_of(r) == Some((1, WATCHDOG, 127))));
    assert_eq!([TORQUE, WATCHDOG].map(|at| register(&w, 1, at.into(), 1)), [0, 0]);
    assert_eq!(newest(&w, 0), Some(Ok(())));
}
