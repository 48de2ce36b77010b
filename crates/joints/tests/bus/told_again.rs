//! What becomes of a motor that was told to be off and has not confirmed it.

use crate::writes::{register, start, watched, writable, write_of};
use crate::{MS, World};
use taxel_joints::bus::{WriteCommand, WriteRefused};
use taxel_sim::servo::ServoFault;

const OFF: WriteCommand = WriteCommand::Torque(false);

fn is_unconfirmed(w: &World, servo: usize) -> bool {
    w.bus.servo(servo).unwrap().motor_off.unconfirmed
}

/// How often a servo was told to be off, by itself or with others.
fn tells_off(w: &World, id: u8) -> usize {
    let told = w.requests.iter().filter(|r| r[7] == 0x83 && r[8] == 64);
    told.filter(|r| r[12..r.len() - 2].chunks(2).any(|row| row == [id, 0]))
        .count()
}

#[test]
fn a_motor_that_nobody_knows_to_be_off_keeps_its_watchdog_and_is_told_again_until_it_is() {
    for (fault, at_the_end) in [
        (ServoFault::Silent, false),
        (ServoFault::Silent, true),
        (ServoFault::BadCrc, false),
    ] {
        let mut w = writable(1);
        start(&mut w, [0]);
        w.fault(1, fault);
        w.bus.command(0, OFF).unwrap();
        w.cycles(8);
        assert!(is_unconfirmed(&w, 0) && w.bus.has_writes(), "{fault:?}");
        assert_eq!(register(&w, 1, 98, 1), 5, "{fault:?}");
        assert_eq!(
            w.bus.command(0, WriteCommand::GoalPwm(1)),
            Err(WriteRefused::MotorOff(0)),
            "{fault:?}"
        );
        w.servos.set_fault(1, None, 1);
        if at_the_end {
            w.bus.release_motors();
        }
        w.cycles(200);
        assert!(!is_unconfirmed(&w, 0) && !w.bus.has_writes(), "{fault:?}");
        assert_eq!([98, 64].map(|at| register(&w, 1, at, 1)), [0, 0], "{fault:?}");
    }
}

#[test]
fn a_motor_that_has_not_heard_that_it_is_to_be_off_is_off_as_soon_as_its_servo_answers_again() {
    // Cycles in which nothing is heard: few, and so many that the servo is asked twice a second.
    for cut in [1, 3, 8, 40, 200] {
        let mut w = watched(2, 2540);
        start(&mut w, [0]);
        w.cut = true;
        w.bus.command(0, OFF).unwrap();
        w.cycles(cut);
        assert_eq!(register(&w, 1, 64, 1), 1, "{cut}");
        w.cut = false;
        let answers = |w: &World| w.bus.servo(0).unwrap().counters.ok;
        let before = answers(&w);
        while answers(&w) == before {
            w.cycle(5 * MS);
        }
        w.cycles(1);
        assert_eq!([64, 98].map(|at| register(&w, 1, at, 1)), [0, 0], "{cut}");
        assert!(!is_unconfirmed(&w, 0), "{cut}");
    }
}

#[test]
fn a_dead_servo_that_is_told_again_and_again_costs_the_living_little() {
    let mut w = writable(4);
    w.fault(2, ServoFault::Silent);
    w.bus.command(1, OFF).unwrap();
    w.cycles(200);
    w.requests.clear();
    let from_ns = w.now_ns;
    w.cycles(1000);
    let most = 2 * (w.now_ns - from_ns) / (1000 * MS) + 1;
    assert!(
        (1..=most as usize).contains(&tells_off(&w, 2)),
        "{}",
        tells_off(&w, 2)
    );
}

#[test]
fn one_that_never_confirms_keeps_no_other_motor_on() {
    let mut w = writable(3);
    start(&mut w, 0..3);
    for id in [1, 2] {
        w.fault(id, ServoFault::BadCrc);
    }
    w.bus.command(0, OFF).unwrap();
    w.bus.command(1, OFF).unwrap();
    w.cycles(30);
    assert_eq!(
        [1, 2].map(|id| register(&w, id, 64, 1)),
        [0, 0],
        "it obeys, and nobody can read that"
    );
    w.bus.command(2, OFF).unwrap();
    w.cycles(2);
    assert_eq!(register(&w, 3, 64, 1), 0);
    w.servos.set_fault(2, None, 1);
    w.cycles(200);
    assert_eq!(
        [0, 1, 2].map(|servo| is_unconfirmed(&w, servo)),
        [true, false, false]
    );
}

#[test]
fn one_that_is_silent_keeps_no_other_motor_on_for_longer_than_it_is_waited_for_once() {
    for at_the_end in [false, true] {
        let mut w = writable(4);
        start(&mut w, 0..4);
        for id in [1, 3] {
            w.fault(id, ServoFault::Silent);
        }
        if at_the_end {
            w.bus.release_motors();
        } else {
            for servo in 0..4 {
                w.bus.command(servo, OFF).unwrap();
            }
        }
        w.cycles(1);
        assert_eq!(
            [1, 2, 3, 4].map(|id| register(&w, id, 64, 1)),
            [0; 4],
            "{at_the_end}"
        );
        assert_eq!(
            [0, 1, 2, 3].map(|servo| w.bus.servo(servo).unwrap().torque_enabled),
            [Some(true), Some(false), Some(true), Some(false)],
            "{at_the_end}"
        );
        assert_eq!(
            [1, 3].map(|id| tells_off(&w, id)),
            [2, 2],
            "one to start it, one now"
        );
        for id in [1, 3] {
            w.servos.set_fault(id, None, 1);
        }
        w.cycles(3);
        assert!(!w.bus.has_writes(), "{at_the_end}");
    }
}

#[test]
fn one_that_is_silent_is_asked_behind_those_that_are_switched_off_later() {
    let mut w = writable(3);
    start(&mut w, 0..3);
    for id in [1, 2] {
        w.fault(id, ServoFault::Silent);
    }
    for servo in [0, 1] {
        w.bus.command(servo, OFF).unwrap();
    }
    w.cycles(1);
    w.bus.command(2, OFF).unwrap();
    w.requests.clear();
    w.cycles(1);
    assert_eq!(write_of(&w.requests[0]), Some((3, 64, 0)));
    assert_eq!(register(&w, 3, 64, 1), 0);
}

#[test]
fn a_later_command_to_start_a_motor_takes_the_place_of_one_to_switch_it_off() {
    let mut w = writable(1);
    start(&mut w, [0]);
    w.fault(1, ServoFault::Silent);
    w.bus.command(0, OFF).unwrap();
    w.cycles(8);
    w.servos.set_fault(1, None, 1);
    w.bus.command(0, WriteCommand::Start(40)).unwrap();
    w.cycles(200);
    assert_eq!([64, 98].map(|at| register(&w, 1, at, 1)), [1, 5]);
    assert!(!is_unconfirmed(&w, 0));
    assert_eq!(w.bus.command(0, WriteCommand::GoalPwm(1)), Ok(()));

    // One that is in vain itself does not.
    w.fault(1, ServoFault::Silent);
    w.bus.command(0, OFF).unwrap();
    w.cycles(8);
    w.bus.command(0, WriteCommand::Start(40)).unwrap();
    w.cycles(8);
    w.servos.set_fault(1, None, 1);
    w.cycles(200);
    assert_eq!(register(&w, 1, 64, 1), 0);
}

#[test]
fn a_motor_that_runs_and_cannot_be_started_anew_is_told_to_be_off_until_it_is() {
    let mut w = watched(1, 2540);
    start(&mut w, [0]);
    w.cut = true;
    w.bus.command(0, WriteCommand::Torque(true)).unwrap();
    w.cycles(8);
    assert!(is_unconfirmed(&w, 0));
    w.cut = false;
    w.cycles(200);
    assert_eq!(register(&w, 1, 64, 1), 0);
    assert!(!w.bus.has_writes());
}

#[test]
fn a_motor_can_be_started_as_soon_as_it_has_confirmed_that_it_is_off_however_long_its_servo_was_silent() {
    for silent in [3, 8, 40, 200] {
        let mut w = watched(2, 2540);
        w.bus.set_margins_ns(100 * MS, 4 * MS);
        start(&mut w, [0]);
        w.cut = true;
        w.bus.command(0, OFF).unwrap();
        w.cycles(silent);
        w.cut = false;
        // It comes back between two readings.
        w.lost = Box::new(|request| (112..128).contains(&request[8]));
        while w.bus.has_writes() {
            w.go_on(u64::MAX);
        }
        // From now on it takes longer than servos are waited for that are silent, and not as long as others are.
        w.fault(1, ServoFault::Late { by_ns: 20 * MS });
        w.bus.command(0, WriteCommand::Torque(true)).unwrap();
        w.cycles(3);
        assert_eq!(register(&w, 1, 64, 1), 1, "silent for {silent} cycles");
        assert!(
            !is_unconfirmed(&w, 0) && !w.bus.has_writes(),
            "silent for {silent} cycles"
        );
    }
}

#[test]
fn a_motor_that_was_to_be_switched_off_when_the_port_was_lost_is_when_it_is_back() {
    for in_vain in [false, true] {
        let mut w = watched(2, 2540);
        start(&mut w, [0, 1]);
        w.cut = in_vain;
        w.bus.command(0, OFF).unwrap();
        if in_vain {
            w.cycles(8);
        }
        w.bus.port_lost();
        w.cut = false;
        w.bus.port_opened();
        assert_eq!(register(&w, 1, 64, 1), 1, "it never heard of it");
        w.cycles(20);
        assert_eq!(register(&w, 1, 64, 1), 0, "told in vain before: {in_vain}");
        assert_eq!(register(&w, 2, 64, 1), 1, "nobody has told that one");
    }
}

#[test]
fn where_several_motors_are_to_be_off_the_first_packet_switches_all_of_them_off() {
    for at_the_end in [false, true] {
        let mut w = watched(8, 2540);
        w.bus.set_margins_ns(500 * MS, 4 * MS);
        start(&mut w, 0..8);
        for id in 1..=6 {
            w.fault(id, ServoFault::Silent);
        }
        if at_the_end {
            w.bus.release_motors();
        } else {
            for servo in 0..8 {
                w.bus.command(servo, OFF).unwrap();
            }
        }
        let from_ns = w.now_ns;
        w.bus.begin(from_ns);
        assert!(w.turn());
        let torque: Vec<i32> = (1..=8).map(|id| register(&w, id, 64, 1)).collect();
        assert_eq!(torque, [0; 8], "{at_the_end}");
        // Those that answer confirm it before any of the others is given the time that it may take.
        let is_known_off =
            |w: &World, servo: usize| w.bus.servo(servo).unwrap().torque_enabled == Some(false);
        while !(is_known_off(&w, 6) && is_known_off(&w, 7)) {
            assert!(w.turn() && w.now_ns < from_ns + 100 * MS, "{at_the_end}");
        }
    }
}

#[test]
fn a_motor_that_was_about_to_be_switched_on_at_the_end_is_not() {
    let mut w = watched(2, 2540);
    w.cycles(3);
    w.bus.command(0, WriteCommand::Start(0)).unwrap();
    w.bus.begin(w.now_ns);
    while write_of(w.bus.request()) != Some((1, 64, 1)) {
        assert!(w.turn());
    }
    w.bus.release_motors();
    w.requests.clear();
    w.cycles(3);
    assert!(!w.requests.iter().any(|r| write_of(r) == Some((1, 64, 1))));
    assert_eq!([64, 98].map(|at| register(&w, 1, at, 1)), [0, 0]);
    assert!(!w.bus.has_writes());
}

#[test]
fn at_the_end_one_that_takes_its_time_confirms_it_before_the_silent_have_had_all_of_theirs() {
    let mut w = watched(8, 2540);
    w.bus.set_margins_ns(500 * MS, 4 * MS);
    start(&mut w, 0..8);
    for id in 1..=6 {
        w.fault(id, ServoFault::Silent);
    }
    w.fault(7, ServoFault::Late { by_ns: 20 * MS });
    w.bus.release_motors();
    let from_ns = w.now_ns;
    w.bus.begin(from_ns);
    while w.bus.servo(6).unwrap().torque_enabled != Some(false) {
        if !w.turn() {
            w.now_ns += MS;
            w.bus.begin(w.now_ns);
        }
        assert!(w.now_ns < from_ns + 300 * MS);
    }
}

#[test]
fn a_motor_that_is_to_be_off_does_not_wait_for_another_servo_s_answer() {
    let mut w = watched(4, 2540);
    w.bus.set_margins_ns(500 * MS, 4 * MS);
    start(&mut w, [3]);
    w.fault(1, ServoFault::Silent);
    w.bus.begin(w.now_ns);
    assert!(w.turn());
    w.bus.command(3, OFF).unwrap();
    let from_ns = w.now_ns;
    while register(&w, 4, 64, 1) == 1 {
        assert!(w.turn() && w.now_ns < from_ns + 50 * MS);
    }
    w.cycles(200);
    assert!(!w.bus.has_writes());
}

#[test]
fn at_the_end_healthy_servos_have_as_long_as_their_answers_take() {
    for (late_ns, most_ns) in [(0, 500 * MS), (100 * MS, 1300 * MS)] {
        let mut w = watched(6, 2540);
        w.bus.set_margins_ns(300 * MS, 4 * MS);
        for id in 1..=6 {
            w.fault(id, ServoFault::Late { by_ns: late_ns });
        }
        w.cycles(30);
        start(&mut w, 0..6);
        let from_ns = w.now_ns;
        let patience_ns = w.bus.release_motors();
        assert!((500 * MS..=most_ns).contains(&patience_ns), "{patience_ns}");
        while (0..6).any(|servo| w.bus.servo(servo).unwrap().torque_enabled != Some(false)) {
            w.cycle(MS);
            assert!(w.now_ns < from_ns + patience_ns, "{late_ns}");
        }
    }
    // However slow they are, the end comes.
    let mut w = watched(16, 2540);
    w.bus.set_margins_ns(500 * MS, 4 * MS);
    for id in 1..=16 {
        w.fault(id, ServoFault::Late { by_ns: 400 * MS });
    }
    w.cycles(30);
    start(&mut w, 0..16);
    assert_eq!(w.bus.release_motors(), 2000 * MS);
}

#[test]
fn at_the_end_the_first_packet_is_sent_however_late_and_patience_begins_with_it() {
    let mut w = watched(2, 2540);
    start(&mut w, 0..2);
    w.fault(1, ServoFault::Silent);
    let patience_ns = w.bus.release_motors();
    // The thread gets no processor.
    w.now_ns += 20 * patience_ns;
    assert!(w.bus.is_releasing(w.now_ns));
    let begun_ns = w.now_ns;
    while w.bus.is_releasing(w.now_ns) {
        w.cycle(MS);
        assert!(w.now_ns < begun_ns + 2 * patience_ns);
    }
    assert_eq!([1, 2].map(|id| register(&w, id, 64, 1)), [0, 0]);
    assert!(w.now_ns >= begun_ns + patience_ns && is_unconfirmed(&w, 0));
}
