//! What is written to servos, where that is allowed: never a motor that nobody watches.

use crate::{MS, World};
use taxel_joints::bus::{WriteCommand, WriteRefused};
use taxel_joints::{DynamixelConfig, FastSyncRead};
use taxel_sim::servo::{ServoBuild, ServoFault};

#[test]
fn read_only_means_that_nothing_but_reads_is_sent() {
    let mut w = World::of(4, FastSyncRead::Auto);
    assert_eq!(
        w.bus.command(0, WriteCommand::Torque(true)),
        Err(WriteRefused::ReadOnly)
    );
    w.servos.servo_mut(2).unwrap().set_hardware_error(1);
    w.fault(3, ServoFault::Silent);
    w.cycles(300);
    w.bus.release_motors();
    w.cycles(3);
    let instructions: std::collections::BTreeSet<u8> = w.requests.iter().map(|r| r[7]).collect();
    assert!(
        instructions.iter().all(|i| [0x02, 0x82, 0x8A].contains(i)),
        "{instructions:x?}"
    );
    for id in 1..=4 {
        assert_eq!(w.servos.servo(id).unwrap().register(64, 1), 0);
    }
}

fn writable(n: u8) -> World {
    let mut config = DynamixelConfig::new("none", 1..=n);
    config.allow_writes = true;
    config.watchdog_ms = 100;
    World::new(&config, (1..=n).map(ServoBuild::new))
}

#[test]
fn torque_arms_the_watchdog_first() {
    let mut w = writable(2);
    w.bus.command(1, WriteCommand::Torque(true)).unwrap();
    w.bus.command(1, WriteCommand::GoalPwm(-300)).unwrap();
    w.cycles(3);
    let register = |w: &World, at, size| w.servos.servo(2).unwrap().register(at, size);
    assert_eq!(
        [register(&w, 98, 1), register(&w, 64, 1), register(&w, 100, 2)],
        [5, 1, -300]
    );
    assert_eq!(w.servos.servo(1).unwrap().register(98, 1), 0);
    assert_eq!(
        (w.bus.counters().writes_ok, w.bus.counters().writes_failed),
        (4, 0)
    );
    // The daemon hangs: the servo stops its motor and takes no more goals until torque is enabled anew.
    w.now_ns += 200 * MS;
    w.bus.command(1, WriteCommand::GoalPwm(10)).unwrap();
    w.cycles(2);
    assert_eq!(register(&w, 98, 1), 0xFF);
    assert_eq!(w.bus.counters().writes_failed, 1);
    w.bus.command(1, WriteCommand::Torque(true)).unwrap();
    w.bus.command(1, WriteCommand::GoalPwm(10)).unwrap();
    w.cycles(3);
    assert_eq!([register(&w, 98, 1), register(&w, 100, 2)], [5, 10]);
    w.bus.release_motors();
    w.cycles(1);
    assert_eq!([register(&w, 98, 1), register(&w, 64, 1)], [0, 0]);
}

#[test]
fn a_motor_whose_watchdog_cannot_be_armed_stays_off() {
    let mut w = writable(2);
    w.cycles(5);
    w.fault(1, ServoFault::Silent);
    w.bus.command(0, WriteCommand::Torque(true)).unwrap();
    w.bus.command(1, WriteCommand::Torque(true)).unwrap();
    w.cycles(3);
    assert!(!w.requests.iter().any(|r| r[4] == 1 && r[7] == 3 && r[8] == 64));
    assert_eq!(w.servos.servo(2).unwrap().register(64, 1), 1);
    assert_eq!(
        (w.bus.counters().writes_ok, w.bus.counters().writes_failed),
        (3, 3)
    );
}

#[test]
fn a_motor_that_runs_is_switched_off_when_its_watchdog_cannot_be_armed_anew() {
    let mut w = writable(1);
    w.bus.command(0, WriteCommand::Torque(true)).unwrap();
    w.cycles(3);
    let register = |w: &World, at| w.servos.servo(1).unwrap().register(at, 1);
    assert_eq!([register(&w, 64), register(&w, 98)], [1, 5]);
    // It obeys, and nobody can read that it does: the watchdog counts as not armed.
    w.fault(1, ServoFault::BadCrc);
    w.bus.command(0, WriteCommand::Torque(true)).unwrap();
    w.bus.command(0, WriteCommand::GoalPwm(100)).unwrap();
    w.cycles(4);
    assert_eq!(register(&w, 64), 0, "it runs without anybody watching");
    let goals = w.requests.iter().filter(|r| r[7] == 3 && r[8] == 100).count();
    assert_eq!(goals, 0, "nor is it given a goal");
    assert_eq!(
        w.bus.command(0, WriteCommand::GoalPwm(1)),
        Err(WriteRefused::MotorOff(0))
    );
}

#[test]
fn a_write_whose_answer_is_missed_is_sent_again() {
    let mut w = writable(2);
    w.cycles(3);
    w.servos.set_fault(2, Some(ServoFault::BadCrc), 3);
    w.bus.command(1, WriteCommand::Torque(true)).unwrap();
    w.cycles(9);
    let register = |at| w.servos.servo(2).unwrap().register(at, 1);
    assert_eq!([register(98), register(64)], [5, 1]);
    let counters = w.bus.counters();
    assert_eq!((counters.writes_ok, counters.writes_failed), (3, 0));
    let sent = w.requests.iter().filter(|r| r[4] == 2 && r[7] == 3).count();
    assert!(sent > 3, "none was missed: {sent}");
}

#[test]
fn commands_that_cannot_be_are_refused() {
    let mut w = writable(2);
    assert_eq!(
        w.bus.command(2, WriteCommand::Torque(false)),
        Err(WriteRefused::NoSuchJoint(2))
    );
    assert_eq!(
        w.bus.command(0, WriteCommand::GoalPwm(886)),
        Err(WriteRefused::Range(886))
    );
    assert_eq!(
        w.bus.command(0, WriteCommand::GoalPwm(1)),
        Err(WriteRefused::MotorOff(0)),
        "nobody has armed its watchdog"
    );
    w.bus.command(0, WriteCommand::Torque(true)).unwrap();
    let full = (0..1000).find_map(|_| w.bus.command(0, WriteCommand::GoalPwm(1)).err());
    assert!(matches!(full, Some(WriteRefused::QueueFull(_))));
}
