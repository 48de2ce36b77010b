//! What is shown of a motor: what its servo has confirmed, at once.

use crate::World;
use crate::writes::watched;
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
