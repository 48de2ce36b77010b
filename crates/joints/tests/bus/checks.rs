//! Motors that are on are asked once a second whether they still are, and for their watchdogs, on a bus that is nearly full too.

use crate::restarts::{lost, meddle, restart, starts_with_torque, torque_and_watchdog};
use crate::writes::{register, start};
use crate::{MS, World};
use taxel_joints::bus::MotorLost;
use taxel_joints::protocol2::Instruction;
use taxel_joints::{DynamixelConfig, FastSyncRead};
use taxel_sim::servo::{AfterSilence, ServoBuild, ServoFault};

/// Servos as they come from the factory, at a baud rate; their motors are on, that of the second behind a restart, too.
fn on_a_bus_of(servos: u8, baud: u32, fast: FastSyncRead) -> World {
    let mut config = DynamixelConfig::new("none", 1..=servos);
    config.baud = baud;
    config.fast_sync_read = fast;
    config.allow_writes = true;
    config.watchdog_ms = 2540;
    let builds = (1..=servos).map(|id| ServoBuild {
        return_delay: 250,
        ..ServoBuild::new(id)
    });
    let mut w = World::new(&config, builds);
    starts_with_torque(&mut w, 2);
    w.cycles(30);
    start(&mut w, 0..usize::from(servos));
    w.cycles(10);
    w
}

/// How long it takes from now until this is so, ms.
fn until_ms(w: &mut World, mut is_so: impl FnMut(&World) -> bool) -> u64 {
    let since_ns = w.now_ns;
    w.bus.begin(since_ns);
    while !is_so(w) {
        w.go_on(u64::MAX);
        assert!(w.now_ns < since_ns + 60_000 * MS, "never");
    }
    let took_ms = (w.now_ns - since_ns) / MS;
    while w.turn() {}
    took_ms
}

/// Buses that are slower than the rate that they are to have.
const SLOW: [(u8, u32); 5] = [
    (10, 57_600),
    (16, 57_600),
    (64, 57_600),
    (32, 115_200),
    (16, 1_000_000),
];

#[test]
fn a_servo_that_restarts_with_its_motor_on_has_it_switched_off_within_a_second_on_a_slow_bus_too() {
    for (servos, baud) in SLOW {
        for fast in [FastSyncRead::Off, FastSyncRead::Auto] {
            let mut w = on_a_bus_of(servos, baud, fast);
            restart(&mut w, 2);
            let mut heard_ns = None;
            until_ms(&mut w, |w| {
                if w.bus.results()[1].is_ok() {
                    heard_ns.get_or_insert(w.now_ns);
                }
                torque_and_watchdog(w, 2)[0] == 0
            });
            let off_ms = (w.now_ns - heard_ns.expect("it answers again")) / MS;
            let what = format!("{servos} at {baud}, {fast:?}: {off_ms} ms");
            assert!(off_ms < 1000, "{what}");
            assert_eq!(lost(&w, 1), Some(MotorLost::Restarted), "{what}");
        }
    }
}

#[test]
fn what_becomes_of_a_motor_is_known_within_a_second_on_a_slow_bus_too() {
    for (servos, baud) in SLOW {
        // At any place of the round.
        for cycles in 0..14 {
            let mut w = on_a_bus_of(servos, baud, FastSyncRead::Off);
            w.cycles(cycles);
            for (id, at, value, expected) in [
                (1, 98, 0, MotorLost::Restarted),
                (servos, 64, 0, MotorLost::GoneOff),
            ] {
                meddle(&mut w, id, Instruction::Write, &[at, 0, value]);
                let ms = until_ms(&mut w, |w| lost(w, usize::from(id) - 1) == Some(expected));
                assert!(ms < 1000, "{servos} at {baud}, {expected:?}: {ms} ms");
            }
        }
    }
}

#[test]
fn a_servo_that_falls_silent_or_refuses_keeps_the_motors_of_no_other_unchecked() {
    for after in [AfterSilence::Answer, AfterSilence::Stop] {
        for fault in [
            ServoFault::Silent,
            ServoFault::BadCrc,
            ServoFault::Refuse { number: 7 },
        ] {
            let mut w = on_a_bus_of(16, 57_600, FastSyncRead::Off);
            w.servos.set_after_silence(after);
            w.fault(2, fault);
            meddle(&mut w, 16, Instruction::Write, &[98, 0, 0]);
            let ms = until_ms(&mut w, |w| lost(w, 15).is_some());
            assert!(ms < 1500, "{after:?}, {fault:?}: {ms} ms");
        }
    }
}

#[test]
fn no_watchdog_of_a_motor_runs_out_while_the_motors_are_asked_and_the_rest_is_asked_for_too() {
    let mut config = DynamixelConfig::new("none", 1..=16);
    config.baud = 57_600;
    config.fast_sync_read = FastSyncRead::Off;
    config.allow_writes = true;
    // The least that is taken on such a bus.
    config.watchdog_ms = 100;
    let builds = (1..=16).map(|id| ServoBuild {
        return_delay: 250,
        ..ServoBuild::new(id)
    });
    let mut w = World::new(&config, builds);
    w.cycles(30);
    start(&mut w, 0..16);
    let (since_ns, cycles) = (w.now_ns, w.bus.counters().cycles);
    while w.now_ns < since_ns + 30_000 * MS {
        w.cycles(1);
    }
    for (servo, id) in (0..).zip(1..=16) {
        assert_eq!(torque_and_watchdog(&w, id), [1, 5], "{id}");
        let state = w.bus.servo(servo).unwrap();
        assert!(state.temperature_c.is_some() && state.identity.is_some(), "{id}");
        assert_eq!(register(&w, id, 98, 1), 5);
    }
    // Nor does it cost much of the bus.
    assert!(w.bus.counters().cycles - cycles > 30 * 10);
}
