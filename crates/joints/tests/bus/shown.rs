//! What is shown of a motor: what its servo has confirmed at once, and that its watchdog has stopped it within a second.

use crate::writes::{start, watched};
use crate::{MS, World};
use taxel_joints::bus::WriteCommand;

fn torque(w: &World) -> [Option<bool>; 2] {
    [0, 1].map(|servo| w.bus.servo(servo).unwrap().torque_enabled)
}

#[test]
fn a_motor_is_shown_as_on_or_off_as_soon_as_its_servo_has_confirmed_it() {
    // Between two questions about its state, and just behind one.
    for cycles in [400, 403, 417, 450] {
        let mut w = watched(2, 1000);
        w.cycles(cycles);
        assert_eq!(torque(&w), [Some(false); 2]);
        for is_on in [true, false, true] {
            let number = w.bus.counters().writes_ok;
            w.bus.command(1, WriteCommand::Torque(is_on)).unwrap();
            while w.bus.has_writes() {
                w.cycles(1);
            }
            assert!(w.bus.counters().writes_ok > number);
            for _ in 0..20 {
                assert_eq!(torque(&w), [Some(false), Some(is_on)]);
                w.cycles(1);
            }
        }
    }
}

#[test]
fn a_motor_that_its_watchdog_has_stopped_is_shown_within_a_second_until_it_is_started_anew() {
    let stopped = |w: &World| [0, 1].map(|servo| w.bus.servo(servo).unwrap().is_stopped());
    let mut w = watched(2, 100);
    start(&mut w, [1]);
    w.cycles(300);
    assert_eq!(stopped(&w), [false, false]);
    // The host stands still.
    w.now_ns += 200 * MS;
    let since_ns = w.now_ns;
    while !stopped(&w)[1] {
        w.cycles(1);
        assert!(w.now_ns - since_ns < 1100 * MS, "it is not seen");
    }
    w.cycles(300);
    assert_eq!(stopped(&w), [false, true]);
    start(&mut w, [1]);
    assert_eq!(stopped(&w), [false, false]);
    w.cycles(300);
    assert_eq!(stopped(&w), [false, false]);
    // One that is off has nothing to be stopped.
    w.bus.command(1, WriteCommand::Torque(false)).unwrap();
    w.cycles(300);
    let watchdogs = w
        .requests
        .iter()
        .filter(|r| r[7] == 2 && r[8] == 98)
        .map(|r| r[4]);
    assert!(watchdogs.into_iter().all(|id| id == 2), "who is off is not asked");
}
