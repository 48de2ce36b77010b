//! Two servos with one id: each request has two answers.

use crate::{MS, World, still};
use taxel_joints::FastSyncRead;
use taxel_joints::bus::NoReading;
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
    }
}
