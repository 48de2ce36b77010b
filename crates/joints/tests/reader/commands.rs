//! What servos are told through the thread that reads them.

use crate::{HANGS_AFTER, all_read, config, eventually, pty};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;
use taxel_joints::bus::{WriteCommand, WriteError, WriteRefused, Written};
use taxel_joints::protocol2::Encoder;
use taxel_joints::{PortState, ServoReader};
use taxel_sim::servo::{ServoFault, servo_clock_ns};

/// Reads these servos, which may be told to move, and has read all of them.
fn driven(path: &Path, n: u8) -> ServoReader {
    let mut config = config(path, n);
    config.allow_writes = true;
    config.watchdog_ms = 2000;
    let reader = ServoReader::start(&config).unwrap();
    eventually(&reader, "read", all_read);
    reader
}

#[test]
fn commands_need_the_configuration_s_consent() {
    let pty = pty(2);
    {
        let reader = ServoReader::start(&config(pty.path(), 2)).unwrap();
        assert_eq!(
            reader.command(0, WriteCommand::Torque(true)),
            Err(WriteRefused::ReadOnly)
        );
    }
    let reader = driven(pty.path(), 2);
    assert_eq!(
        reader.command(2, WriteCommand::Torque(true)),
        Err(WriteRefused::NoSuchJoint(2))
    );
    let early = reader.command(1, WriteCommand::GoalPwm(5)).unwrap();
    eventually(&reader, "answered", |_| reader.outcome(1, early).is_some());
    let off = Err(WriteError::NotTaken(WriteRefused::MotorOff(1)));
    assert_eq!(reader.outcome(1, early), Some(off));
    let number = reader.command(1, WriteCommand::Torque(true)).unwrap();
    let s = eventually(&reader, "written", |s| s.counters.writes_ok == 4);
    assert_eq!(s.counters.writes_failed, 0);
    assert_eq!(reader.outcome(1, number), Some(Ok(())));
    assert_eq!(reader.outcome(0, number), None);
    assert_eq!(pty.bus().servo(2).unwrap().register(64, 1), 1);
    // Ending the daemon lets the motor go.
    drop(reader);
    assert_eq!(pty.bus().servo(2).unwrap().register(64, 1), 0);
    assert_eq!(pty.bus().servo(2).unwrap().register(98, 1), 0);
}

#[test]
fn what_is_told_before_the_port_is_open_is_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("later");
    let mut config = config(&name, 2);
    config.allow_writes = true;
    config.watchdog_ms = 2000;
    let reader = ServoReader::start(&config).unwrap();
    for command in [
        WriteCommand::Torque(true),
        WriteCommand::Start(1),
        WriteCommand::Torque(false),
    ] {
        assert_eq!(reader.command(0, command), Err(WriteRefused::NoPort));
    }
    assert_eq!(
        reader.command_together(&[(0, 1), (1, 1)]),
        Err(WriteRefused::NoPort)
    );
    let pty = pty(2);
    std::os::unix::fs::symlink(pty.path(), &name).unwrap();
    eventually(&reader, "read", all_read);
    let number = reader.command(0, WriteCommand::Torque(true)).unwrap();
    eventually(&reader, "written", |_| reader.outcome(0, number) == Some(Ok(())));
}

#[test]
fn whoever_waits_when_the_port_is_lost_hears_of_it() {
    let pty = pty(1);
    let reader = driven(pty.path(), 1);
    let mut newest = reader.command(0, WriteCommand::Torque(true)).unwrap();
    drop(pty);
    eventually(&reader, "taken", |_| reader.outcome(0, newest).is_some());
    let end = Instant::now() + HANGS_AFTER;
    loop {
        match reader.command(0, WriteCommand::GoalPwm(1)) {
            Ok(number) => newest = number,
            Err(WriteRefused::NoPort) => break,
            Err(WriteRefused::QueueFull(_)) => std::thread::yield_now(),
            Err(other) => panic!("{other}"),
        }
        assert!(Instant::now() < end, "it is taken for ever");
    }
    eventually(&reader, "told", |_| reader.outcome(0, newest).is_some());
}

#[test]
fn a_motor_that_is_to_be_off_while_the_port_is_away_is_when_it_is_back() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("servos");
    let before = pty(2);
    std::os::unix::fs::symlink(before.path(), &name).unwrap();
    let reader = driven(&name, 2);
    std::fs::remove_file(&name).unwrap();
    drop(before);
    eventually(&reader, "gone", |_| {
        matches!(reader.port().state, PortState::Away { .. })
    });
    let number = reader.command(1, WriteCommand::Torque(false)).unwrap();
    let told = Some(Written {
        number,
        result: Err(WriteError::PortLost),
    });
    eventually(&reader, "told", |s| s.servos[1].motor_off.written == told);
    assert_eq!(reader.motors_not_off(), [1]);
    assert_eq!(
        reader.command(1, WriteCommand::Torque(true)),
        Err(WriteRefused::NoPort)
    );

    let back = pty(2);
    for id in [1, 2] {
        let on = Encoder::default().write(id, 64, &[1]).unwrap().to_vec();
        back.bus().receive(&on, servo_clock_ns());
    }
    std::os::unix::fs::symlink(back.path(), &name).unwrap();
    let done = Some(Written {
        number,
        result: Ok(()),
    });
    eventually(&reader, "off", |s| s.servos[1].motor_off.written == done);
    assert_eq!(
        [1, 2].map(|id| back.bus().servo(id).unwrap().register(64, 1)),
        [1, 0]
    );
    assert_eq!(reader.motors_not_off(), [0; 0]);
}

#[test]
fn who_ends_with_a_motor_of_which_nobody_knows_whether_it_is_off_can_tell() {
    for away in [false, true] {
        let pty = pty(2);
        let reader = driven(pty.path(), 2);
        for joint in 0..2 {
            let number = reader.command(joint, WriteCommand::Torque(true)).unwrap();
            eventually(&reader, "on", |_| reader.outcome(joint, number).is_some());
        }
        let pty = match away {
            true => {
                drop(pty);
                eventually(&reader, "gone", |_| {
                    matches!(reader.port().state, PortState::Away { .. })
                });
                None
            }
            false => {
                pty.bus().set_fault(2, Some(ServoFault::Silent), 1);
                Some(pty)
            }
        };
        reader.end().unwrap();
        let expected: &[usize] = if away { &[0, 1] } else { &[1] };
        assert_eq!(reader.motors_not_off(), expected);
        drop(pty);
    }
}

#[test]
fn at_the_end_no_motor_stays_on_because_others_are_silent() {
    let pty = pty(8);
    let mut config = config(pty.path(), 8);
    config.allow_writes = true;
    config.watchdog_ms = 2540;
    config.answer_margin_ms = Some(500.0);
    let reader = ServoReader::start(&config).unwrap();
    eventually(&reader, "read", all_read);
    for joint in 0..8 {
        let number = reader.command(joint, WriteCommand::Torque(true)).unwrap();
        eventually(&reader, "on", |_| reader.outcome(joint, number).is_some());
    }
    let torque = || (1..=8).map(|id| pty.bus().servo(id).unwrap().register(64, 1));
    assert_eq!(torque().sum::<i32>(), 8);
    for id in 1..=6 {
        pty.bus().set_fault(id, Some(ServoFault::Silent), 1);
    }
    drop(reader);
    assert_eq!(torque().collect::<Vec<_>>(), [0; 8]);
}

#[test]
fn each_command_is_told_what_became_of_it_whatever_became_of_later_ones_to_the_same_servo() {
    use WriteCommand::{GoalPwm, Start, Torque};
    let not_on = WriteError::NotTaken(WriteRefused::MotorOff(0));
    let pty = pty(1);
    let reader = driven(pty.path(), 1);
    // Given at once, and looked at only when the last is done with.
    let given = [
        (GoalPwm(1), Err(not_on)),
        (GoalPwm(2), Err(not_on)),
        (Start(0), Ok(())),
        (GoalPwm(3), Ok(())),
        (Torque(true), Ok(())),
    ]
    .map(|(command, expected)| (reader.command(0, command).unwrap(), expected));
    let last = given[given.len() - 1].0;
    eventually(&reader, "done", |_| reader.outcome(0, last).is_some());
    for (number, expected) in given {
        assert_eq!(reader.outcome(0, number), Some(expected), "{number}");
    }
}

#[test]
fn what_a_torque_off_overtakes_is_told_so_however_far_it_has_come() {
    let pty = pty(1);
    let reader = driven(pty.path(), 1);
    pty.bus().set_fault(1, Some(ServoFault::Silent), 1);
    // So many that some still wait for the thread.
    let starts: Vec<u64> = (0..40)
        .map(|_| reader.command(0, WriteCommand::Start(0)).unwrap())
        .collect();
    let off = reader.command(0, WriteCommand::Torque(false)).unwrap();
    eventually(&reader, "off", |s| {
        s.servos[0].motor_off.written.is_some_and(|w| w.number == off)
    });
    for number in starts {
        let outcome = reader.outcome(0, number);
        assert!(outcome.is_some_and(|result| result.is_err()), "{outcome:?}");
    }
}

#[test]
fn that_a_motor_is_off_is_told_before_the_others_are_read() {
    let pty = pty(2);
    let reader = driven(pty.path(), 2);
    // Each cycle waits for it.
    let late = ServoFault::Late { by_ns: 200_000_000 };
    pty.bus().set_fault(2, Some(late), 1);
    // Readings are shown at the end of a cycle. A busy machine may look only then.
    let end = Instant::now() + HANGS_AFTER;
    loop {
        let before = reader.snapshot();
        let number = reader.command(0, WriteCommand::Torque(false)).unwrap();
        let told = eventually(&reader, "told", |s| {
            s.servos[0]
                .motor_off
                .written
                .is_some_and(|off| off.number == number)
        });
        assert_eq!(told.servos[0].torque_enabled, Some(false));
        // Whoever is told finds it counted.
        assert!(told.counters.writes_ok > before.counters.writes_ok);
        if told.results == before.results {
            break;
        }
        assert!(Instant::now() < end, "never before the end of the cycle");
    }
}

#[test]
fn goals_that_are_given_without_end_beside_motors_that_are_switched_off_without_end_are_taken_cycle_by_cycle()
{
    let pty = pty(2);
    let reader = driven(pty.path(), 2);
    let number = reader.command(1, WriteCommand::Start(0)).unwrap();
    eventually(&reader, "on", |_| reader.outcome(1, number) == Some(Ok(())));
    let is_over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        for command in [WriteCommand::GoalPwm(1), WriteCommand::Torque(false)] {
            let (reader, is_over) = (&reader, &is_over);
            let joint = usize::from(command == WriteCommand::GoalPwm(1));
            scope.spawn(move || {
                while !is_over.load(Ordering::Relaxed) {
                    // Where no more can wait, later ones do.
                    let _ = reader.command(joint, command);
                    std::thread::yield_now();
                }
            });
        }
        let before = reader.snapshot().counters;
        eventually(&reader, "at work", |s| {
            s.counters.writes_ok > before.writes_ok + 100
        });
        let before = reader.snapshot().counters.cycles;
        // They end also where this fails.
        let end = Instant::now() + HANGS_AFTER;
        while reader.snapshot().counters.cycles < before + 5 && Instant::now() < end {
            std::thread::yield_now();
        }
        is_over.store(true, Ordering::Relaxed);
        assert!(
            reader.snapshot().counters.cycles >= before + 5,
            "a cycle has no end"
        );
    });
}
