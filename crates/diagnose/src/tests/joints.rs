//! Problems of servos and their angles, as they come and go.

use super::*;
use crate::Place;
use crate::joints::test_views::{open, servo, servos};
use taxel_joints::JointSource;
use taxel_joints::bus::{MotorLost, MotorOff, ServoIdentity, WriteError, Written};
use taxel_joints::protocol2::StatusError;
use taxel_joints::registers::HardwareError;

pub(super) struct JointsBench {
    pub(super) bench: Bench,
    pub(super) view: JointsView,
}

impl JointsBench {
    pub(super) fn new((joints, view): (JointsConfig, JointsView)) -> Self {
        let mut bench = Bench::new();
        bench.joints = Some(joints);
        Self { bench, view }
    }

    /// Servos that all answer.
    pub(super) fn answering(n: u8) -> Self {
        let (config, mut view) = servos(n);
        open(&mut view, "/dev/ttyUSB0", 1);
        for joint in 0..usize::from(n) {
            servo(&mut view, joint).alive = true;
            view.tick.angles[joint] = 0.0;
        }
        let mut bench = Self::new((config, view));
        bench.pass(1000, |_| {});
        assert_eq!(bench.bench.said, []);
        bench
    }

    pub(super) fn pass(&mut self, ms: u64, mut change: impl FnMut(&mut JointsView)) {
        let Self { bench, view } = self;
        for _ in 0..ms / 100 {
            bench.known.now_ns += 100 * MS;
            view.now_ns = bench.known.now_ns;
            if let Some((snapshot, _)) = &mut view.servos {
                snapshot.counters.cycles += 1;
                for servo in snapshot.servos.iter_mut().filter(|servo| servo.alive) {
                    servo.counters.ok += 1;
                }
            }
            change(view);
            bench.look(Some(view));
        }
    }

    /// What was said of late; each sentence must hold its words.
    #[track_caller]
    pub(super) fn said(&mut self, sentences: &[&[&str]]) {
        let said: Vec<String> = (self.bench.said.drain(..))
            .map(|news| sentence(&news).into())
            .collect();
        assert_eq!(said.len(), sentences.len(), "{said:#?}");
        for (text, words) in said.iter().zip(sentences) {
            assert!(words.iter().all(|word| text.contains(word)), "{words:?}: {text}");
        }
    }
}

#[test]
fn a_servo_that_is_silent_late_damaged_hot_or_failed_is_named_with_what_to_do() {
    type Change = fn(&mut JointsView);
    let cases: [(&str, Change, Change, &[&str], &str); 18] = [
        (
            "motor-lost",
            |v| servo(v, 1).motor_lost = Some(MotorLost::Restarted),
            |v| servo(v, 1).motor_lost = None,
            &[
                "servo 2 has restarted while its motor was on",
                "its motor is switched off. Look at its supply",
                "enabled anew (`taxel servo`, --torque on), and is switched off again whoever else switches it on",
            ],
            "the motor of servo 2 is on again",
        ),
        (
            "motor-lost",
            |v| {
                servo(v, 1).motor_lost = Some(MotorLost::Meddled {
                    watchdog: 50,
                    armed: 10,
                })
            },
            |v| servo(v, 1).motor_lost = None,
            &[
                "another program has set the bus watchdog of servo 2 to 50",
                "had 10",
            ],
            "is on again",
        ),
        (
            "motor-lost",
            |v| servo(v, 1).motor_lost = Some(MotorLost::LeftOn),
            |v| servo(v, 1).motor_lost = None,
            &[
                "the motor of servo 2 was left on by a taxeld that was killed, or by another program",
                "it is switched off",
                "enabled anew",
            ],
            "is on again",
        ),
        (
            "motor-lost",
            |v| servo(v, 1).motor_lost = Some(MotorLost::GoneOff),
            |v| servo(v, 1).motor_lost = None,
            &[
                "the motor of servo 2 was on and has gone off by itself",
                "enabled anew (`taxel servo`, --torque on)",
            ],
            "is on again",
        ),
        (
            "motor-stopped",
            |v| (servo(v, 1).torque_enabled, servo(v, 1).watchdog_tripped) = (Some(true), Some(true)),
            |v| servo(v, 1).torque_enabled = Some(false),
            &[
                "the motor of servo 2 is switched on and holds nothing: its bus watchdog has stopped it",
                "Enable its torque anew",
            ],
            "servo 2 is not stopped by its watchdog any more",
        ),
        (
            "motor-not-off",
            |v| {
                servo(v, 1).motor_off = MotorOff {
                    newest: 3,
                    written: Some(Written {
                        number: 3,
                        result: Err(WriteError::Silent),
                    }),
                    unconfirmed: true,
                }
            },
            |v| servo(v, 1).motor_off.unconfirmed = false,
            &[
                "the motor of servo 2 is off, as it was told to be: the servo does not answer",
                "cut its supply",
            ],
            "the motor of servo 2 is off",
        ),
        (
            "motor-not-off",
            |v| {
                servo(v, 1).motor_off = MotorOff {
                    newest: 3,
                    written: Some(Written {
                        number: 3,
                        result: Err(WriteError::StillOn),
                    }),
                    unconfirmed: true,
                }
            },
            |v| servo(v, 1).motor_off.unconfirmed = false,
            &["the motor of servo 2 is on, though it was told to be off. It is told again"],
            "the motor of servo 2 is off",
        ),
        (
            "servo-silent",
            |v| servo(v, 1).alive = false,
            |v| servo(v, 1).alive = true,
            &["servo 2 is silent; check its power and cable. "],
            "servo 2 answers again",
        ),
        (
            "servo-late",
            |v| servo(v, 1).counters.late += 1,
            |_| {},
            &["servo 2 answers after its deadline", "answer_margin_ms"],
            "answers in time",
        ),
        (
            "servo-damaged",
            |v| servo(v, 1).counters.bad_crc += 1,
            |_| {},
            &["answers of servo 2", "damaged (CRC)", "termination"],
            "are whole",
        ),
        (
            "two-servos-one-id",
            |v| {
                servo(v, 1).counters.double += 1;
                v.tick.angles[1] = f32::NAN;
            },
            |v| v.tick.angles[1] = 0.0,
            &[
                "2 servos answer with the id of servo 2",
                "the angle of none is taken; unplug all but one",
            ],
            "one servo answers with the id of servo 2",
        ),
        (
            "servo-error",
            |v| servo(v, 1).hardware_error = Some(HardwareError(0x24)),
            |v| servo(v, 1).hardware_error = Some(HardwareError(0)),
            &[
                "servo 2",
                "overheating, overload",
                "stays off until it is rebooted",
                "Let it cool down, free the joint; then reboot it",
            ],
            "no hardware error",
        ),
        (
            "servo-error",
            |v| {
                servo(v, 1).hardware_error = Some(HardwareError(0x01));
                servo(v, 1).torque_enabled = Some(true);
            },
            |v| servo(v, 1).hardware_error = Some(HardwareError(0)),
            &[
                "servo 2",
                "input voltage",
                "Its motor is on and obeys all the same",
            ],
            "no hardware error",
        ),
        (
            "servo-refuses",
            |v| {
                servo(v, 1).counters.refused += 1;
                servo(v, 1).refusal = Some(StatusError::Instruction);
                v.tick.angles[1] = f32::NAN;
            },
            |v| {
                servo(v, 1).refusal = None;
                v.tick.angles[1] = 0.0;
            },
            &[
                "servo 2 answers and refuses to be read",
                "does not know the instruction (2",
                "firmware up to date",
            ],
            "servo 2 is read again",
        ),
        (
            "servo-refuses",
            |v| {
                servo(v, 1).counters.refused += 1;
                servo(v, 1).refusal = Some(StatusError::Crc);
            },
            |v| servo(v, 1).refusal = None,
            &["reached the servo damaged (3", "motor wires"],
            "servo 2 is read again",
        ),
        (
            "servo-error",
            |v| (servo(v, 1).alert, servo(v, 1).refusal) = (true, Some(StatusError::DataRange)),
            |v| servo(v, 1).alert = false,
            &[
                "servo 2 reports a hardware error: it does not say which",
                "Reboot it",
            ],
            "no hardware error",
        ),
        (
            "servo-model",
            |v| {
                servo(v, 1).identity = Some(ServoIdentity {
                    model_number: 51_200,
                    ..ServoIdentity::default()
                });
            },
            |v| servo(v, 1).identity.as_mut().unwrap().model_number = 1030,
            &[
                "the model number 51200 of servo 2 is not known, so that its angles may be wrong",
                "X-series servo with the control table of the XM430-W210",
            ],
            "servo 2 is of a known model",
        ),
        (
            "servo-hot",
            |v| servo(v, 1).temperature_c = Some(71),
            |v| servo(v, 1).temperature_c = Some(64),
            &["servo 2 has 71 degrees"],
            "cooled down",
        ),
    ];
    for (kind, begin, end, words, over) in cases {
        let mut bench = JointsBench::answering(3);
        bench.pass(1500, begin);
        bench.said(&[words]);
        assert_eq!(bench.bench.kinds(), [kind]);
        assert_eq!(bench.bench.problems.kinds(Place::Joint(1)).len(), 1);
        assert_eq!(bench.bench.problems.current()[0].problem.place, Place::Joint(1));
        bench.pass(1000, end);
        bench.said(&[&[over]]);
    }
}

#[test]
fn an_angle_that_nobody_explains_is_told_as_stale() {
    let mut bench = JointsBench::answering(2);
    bench.pass(1000, |view| {
        view.tick.angles[1] = f32::NAN;
        view.tick.age_ns[1] = 400 * MS;
    });
    bench.said(&[&[
        "the angle of servo 2 is unknown",
        "400 ms old, hold_ms = 250",
        "baud rate",
    ]]);
    bench.pass(200, |view| view.tick.angles[1] = 1.0);
    bench.said(&[&["is known"]]);
    let JointSource::Dynamixel(config) = &mut bench.bench.joints.as_mut().unwrap().source else {
        panic!("no servos");
    };
    config.answer_margin_ms = Some(300.0);
    bench.pass(1000, |view| view.tick.angles[1] = f32::NAN);
    bench.said(&[&["is unknown", "waited for 300 ms (`answer_margin_ms`)"]]);
}
