//! That a reading is of the time it carries.

use crate::{MS, World};
use taxel_joints::{DynamixelConfig, FastSyncRead};
use taxel_sim::servo::{Motion, ServoBuild, ServoFault};

/// Servos whose position is the time: a reading that is old gives itself away.
fn clocks(n: u8) -> Vec<ServoBuild> {
    (1..=n)
        .map(|id| ServoBuild {
            motion: Motion::Sine {
                centre: 0.0,
                amplitude: 1e8,
                hz: 0.0001,
                phase: 0.0,
            },
            ..ServoBuild::new(id)
        })
        .collect()
}

#[test]
fn a_late_answer_is_never_taken_for_a_new_one() {
    for fast in [FastSyncRead::Off, FastSyncRead::Auto] {
        for n in [1, 2, 5] {
            for by_us in (500..30_000).step_by(370) {
                let mut config = DynamixelConfig::new("none", 1..=n);
                config.fast_sync_read = fast;
                let mut w = World::new(&config, clocks(n));
                w.cycles(3);
                let late = n.div_ceil(2);
                assert!(
                    w.servos
                        .set_fault(late, Some(ServoFault::Late { by_ns: by_us * 1000 }), 3)
                );
                for _ in 0..40 {
                    w.cycle(300_000);
                    for result in w.bus.results().iter().flatten() {
                        let truth = w.servos.servo(1).unwrap().position(result.t_ns);
                        let error_ns = (f64::from(result.position) - truth).abs()
                            / (1e8 * 0.0001 * std::f64::consts::TAU)
                            * 1e9;
                        // An answer within its deadline may be as late as the deadline allows.
                        assert!(
                            error_ns < 9e6,
                            "{fast:?}, {n} servos, {by_us} us late: {error_ns} ns old"
                        );
                    }
                }
                let late_count = w.bus.servo(usize::from(late) - 1).unwrap().counters.late;
                if by_us > 10_000 && fast == FastSyncRead::Off {
                    assert!(late_count > 0, "{n} servos, {by_us} us late");
                }
            }
        }
    }
}

#[test]
fn readings_carry_the_time_of_their_servo() {
    let mut w = World::new(&DynamixelConfig::new("none", 1..=8), clocks(8));
    for _ in 0..300 {
        w.cycle(1_234_567);
        for (i, result) in w.bus.results().iter().enumerate() {
            let reading = result.unwrap();
            let truth = w.servos.servo(i as u8 + 1).unwrap().position(reading.t_ns);
            let error_ns =
                (f64::from(reading.position) - truth).abs() / (1e8 * 0.0001 * std::f64::consts::TAU) * 1e9;
            // Before a servo has told that it answers at once, half a millisecond is allowed for.
            if w.bus.counters().cycles > 100 {
                assert!(error_ns < 150_000.0, "servo {i}: {error_ns} ns");
            }
        }
    }
}

#[test]
fn a_servo_that_rests_is_not_waited_for_until_it_answers_late_or_not() {
    for fast in [FastSyncRead::Off, FastSyncRead::Auto, FastSyncRead::On] {
        let mut w = World::of(4, fast);
        w.bus.set_margins_ns(500 * MS, 4 * MS);
        w.cycles(5);
        w.fault(2, ServoFault::Silent);
        w.cycles(10);
        let heard = |w: &World| [0, 1, 3].map(|servo| w.bus.servo(servo).unwrap().counters.ok);
        let before = heard(&w);
        for _ in 0..1000 {
            w.cycle(5 * MS);
            let took_ms = w.bus.counters().cycle_ns / MS;
            assert!(took_ms < 20, "{fast:?}: {took_ms} ms");
        }
        let after = heard(&w);
        assert_eq!([0, 2].map(|i| after[i] - before[i]), [1000; 2], "{fast:?}");
        // It is back, and slow where each answers with its own packet.
        match fast {
            FastSyncRead::Off => w.fault(2, ServoFault::Late { by_ns: 300 * MS }),
            _ => assert!(w.servos.set_fault(2, None, 1)),
        }
        w.cycles(300);
        assert!(heard(&w)[1] > before[1] + 100, "{fast:?}");
    }
}
