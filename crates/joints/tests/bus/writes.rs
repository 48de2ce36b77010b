//! What is written to servos, where that is allowed: never a motor that nobody watches.

use crate::{MS, World};
use taxel_joints::bus::{Step, WriteCommand, WriteError, WriteRefused};
use taxel_joints::protocol2::{Assignment, Encoder, Instruction};
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

pub(crate) fn writable(n: u8) -> World {
    watched(n, 100)
}

/// The same, whose motors stop by themselves after so long.
pub(crate) fn watched(n: u8, watchdog_ms: u16) -> World {
    let mut config = DynamixelConfig::new("none", 1..=n);
    config.allow_writes = true;
    config.watchdog_ms = watchdog_ms;
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
        (5, 0)
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
    assert!(!w.requests.iter().any(|r| write_of(r) == Some((1, 64, 1))));
    assert_eq!(w.servos.servo(2).unwrap().register(64, 1), 1);
    assert_eq!(
        (w.bus.counters().writes_ok, w.bus.counters().writes_failed),
        (4, 4)
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
    let goals = w.requests.iter().filter(|r| r[7] == 0x83 && r[8] == 100).count();
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
    assert_eq!((counters.writes_ok, counters.writes_failed), (4, 0));
    let sent = (w.requests.iter().filter_map(|r| write_of(r)))
        .filter(|(id, ..)| *id == 2)
        .count();
    assert!(sent > 4, "none was missed: {sent}");
}

/// Servo, address and first byte of what one servo is told.
pub(crate) fn write_of(request: &[u8]) -> Option<(u8, u8, u8)> {
    let is_for_one = request[7] == 0x83 && request.len() == 15 + usize::from(request[10]);
    is_for_one.then(|| (request[12], request[8], request[13]))
}

#[test]
fn to_switch_a_motor_off_goes_before_every_other_command_and_before_the_readings() {
    let mut w = writable(3);
    for servo in 0..3 {
        w.bus.command(servo, WriteCommand::Torque(true)).unwrap();
    }
    w.cycles(3);
    w.requests.clear();
    while w.bus.command(0, WriteCommand::GoalPwm(1)).is_ok() {}
    w.bus.command(1, WriteCommand::GoalPwm(2)).unwrap_err();
    // The queue is full, and yet it is taken.
    w.bus.command(2, WriteCommand::Torque(false)).unwrap();
    w.bus.command(0, WriteCommand::Torque(false)).unwrap();
    w.cycle(5 * MS);
    let both = [3, 1].map(|id| Assignment { id, data: &[0] });
    for (at, requests) in [64, 98].into_iter().zip(w.requests.chunks(2)) {
        assert_eq!(Some(&requests[0][..]), Encoder::default().sync_write(at, &both));
        // They are asked behind it what they hold.
        let is_asked = (requests[1][7], u16::from(requests[1][8]), &requests[1][12..14]);
        assert_eq!(is_asked, (0x82, at, &[3, 1][..]));
    }
    assert_eq!(w.requests[4][8], 124, "where they are");
    w.cycles(3);
    let goals = w
        .requests
        .iter()
        .filter_map(|r| write_of(r))
        .filter(|(_, at, _)| *at == 100);
    assert_eq!(goals.count(), 0, "a motor that is off was given goals");
    assert_eq!(
        [1, 2, 3].map(|id| w.servos.servo(id).unwrap().register(64, 1)),
        [0, 1, 0]
    );
}

#[test]
fn a_motor_that_comes_to_be_switched_off_in_the_middle_of_a_command_ends_up_off() {
    let mut w = writable(1);
    w.cycles(2);
    w.bus.command(0, WriteCommand::Torque(true)).unwrap();
    w.bus.begin(w.now_ns);
    let mut told = false;
    loop {
        match w.bus.step(w.now_ns) {
            Step::Send => {
                w.receive();
                let request = w.bus.request().to_vec();
                w.servos.receive(&request, w.now_ns);
                w.bus.sent(w.now_ns);
                // The watchdog has just been armed; the motor would be switched on next.
                if write_of(&request) == Some((1, 98, 5)) {
                    w.bus.command(0, WriteCommand::Torque(false)).unwrap();
                    told = true;
                }
            }
            Step::Wait { until_ns } => {
                let next = w.servos.next_due_ns().map_or(until_ns, |t| t.min(until_ns));
                w.now_ns = w.now_ns.max(next);
                w.receive();
            }
            Step::Done => break,
        }
    }
    assert!(told);
    w.cycles(2);
    assert_eq!(
        [98, 64].map(|at| w.servos.servo(1).unwrap().register(at, 1)),
        [0, 0]
    );
    assert_eq!(w.bus.counters().writes_failed, 0);
}

#[test]
fn a_motor_stands_within_its_watchdog_whichever_request_is_the_last() {
    let (on, start, goal) = (
        WriteCommand::Torque(true),
        WriteCommand::Start(40),
        WriteCommand::GoalPwm(60),
    );
    for (before, command) in [
        (None, on),
        (None, start),
        (Some(start), on),
        (Some(start), start),
        (Some(start), goal),
    ] {
        let mut whole = false;
        for last in 0.. {
            let mut w = writable(1);
            w.servos.servo_mut(1).unwrap().set_operating_mode(16);
            if let Some(before) = before {
                w.bus.command(0, before).unwrap();
            }
            w.cycles(3);
            w.requests.clear();
            w.bus.command(0, command).unwrap();
            w.bus.begin(w.now_ns);
            while w.requests.len() < last && w.turn() {}
            if w.requests.len() < last {
                whole = !w.bus.has_writes();
                break;
            }
            // The host is killed here.
            w.now_ns += 200 * MS;
            w.servos.handle_time(w.now_ns);
            let servo = w.servos.servo(1).unwrap();
            assert_eq!(
                servo.position(w.now_ns),
                servo.position(w.now_ns + 1000 * MS),
                "{command:?} after {before:?} runs on after request {last}"
            );
        }
        assert!(whole, "{command:?}");
    }
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

pub(crate) fn register(w: &World, id: u8, at: u16, size: u8) -> i32 {
    w.servos.servo(id).unwrap().register(at, size)
}

/// Switches these motors on, each with no PWM.
pub(crate) fn start(w: &mut World, servos: impl IntoIterator<Item = usize>) {
    for servo in servos {
        w.bus.command(servo, WriteCommand::Start(0)).unwrap();
        w.cycles(2);
    }
}

#[test]
fn a_motor_is_given_its_first_goal_before_it_is_switched_on() {
    let mut w = writable(2);
    assert_eq!(register(&w, 2, 100, 2), 885, "all of it, from the factory");
    w.bus.command(1, WriteCommand::Start(40)).unwrap();
    w.cycles(3);
    assert_eq!(
        [
            register(&w, 2, 98, 1),
            register(&w, 2, 100, 2),
            register(&w, 2, 64, 1)
        ],
        [5, 40, 1]
    );
    let written: Vec<u8> = (w.requests.iter().filter_map(|r| write_of(r)))
        .map(|(_, at, _)| at)
        .collect();
    assert_eq!(written, [64, 98, 98, 100, 64]);
}

#[test]
fn a_motor_whose_first_goal_is_not_taken_stays_off() {
    let mut w = writable(2);
    // PWM Limit 300.
    let limit = [&36u16.to_le_bytes()[..], &300u16.to_le_bytes()].concat();
    let packet = Encoder::default()
        .packet(2, Instruction::Write, limit.iter().copied())
        .unwrap()
        .to_vec();
    w.servos.receive(&packet, w.now_ns);
    w.servos.take_due(u64::MAX, &mut Vec::new());
    w.bus.command(1, WriteCommand::Start(301)).unwrap();
    w.cycles(4);
    assert_eq!(
        [64, 98].map(|at| register(&w, 2, at, 1)),
        [0, 0],
        "nor is it watched"
    );
    assert_eq!(
        w.bus.command(1, WriteCommand::GoalPwm(1)),
        Err(WriteRefused::MotorOff(1))
    );
}

#[test]
fn goals_of_several_servos_go_out_in_one_packet_and_are_read_back() {
    let mut w = writable(3);
    start(&mut w, 0..3);
    let before = w.bus.counters();
    w.requests.clear();
    w.bus.command_together(7, &[(2, 300), (0, -300)]).unwrap();
    w.cycles(1);
    assert_eq!(
        [1, 2, 3].map(|id| register(&w, id, 100, 2)),
        [-300, 0, 300],
        "both, and nobody else"
    );
    let sync_writes = w.requests.iter().filter(|r| r[7] == 0x83).count();
    let writes = w.requests.iter().filter(|r| r[7] == 0x03).count();
    assert_eq!((sync_writes, writes), (1, 0));
    for servo in [0, 2] {
        assert_eq!(w.bus.outcome(servo, 7), Some(Ok(())));
    }
    assert_eq!(w.bus.counters().writes_ok, before.writes_ok + 2);
    assert!(w.bus.results().iter().all(Result::is_ok));
}

#[test]
fn one_that_has_not_taken_its_goal_is_told_from_one_that_is_silent_and_one_that_has() {
    let mut w = writable(4);
    start(&mut w, 0..4);
    // Servo 1's watchdog has stopped it: it refuses goals. Servo 3's answers come damaged, servo 4's not at all.
    let trip = Encoder::default()
        .packet(1, Instruction::Write, [98, 0, 1])
        .unwrap()
        .to_vec();
    w.servos.receive(&trip, w.now_ns);
    w.servos.take_due(u64::MAX, &mut Vec::new());
    w.now_ns += 50 * MS;
    w.servos.handle_time(w.now_ns);
    w.fault(3, ServoFault::BadCrc);
    w.fault(4, ServoFault::Silent);
    w.bus
        .command_together(9, &[(0, 50), (1, 50), (2, 50), (3, 50)])
        .unwrap();
    w.cycles(4);
    let results = [0, 1, 2, 3].map(|servo| w.bus.outcome(servo, 9).unwrap());
    assert_eq!(
        results,
        [
            Err(WriteError::NotHeld),
            Ok(()),
            Err(WriteError::Damaged),
            Err(WriteError::Silent)
        ]
    );
    assert_eq!(register(&w, 2, 100, 2), 50);
    assert!(!w.bus.has_writes());
}

#[test]
fn goals_whose_confirmation_is_missed_are_sent_again() {
    let mut w = writable(3);
    start(&mut w, 0..3);
    // Both are silent for the next two answers: their reading, and what they hold.
    w.fault(1, ServoFault::Silent);
    w.fault(3, ServoFault::Silent);
    w.bus.command_together(4, &[(0, 60), (1, 60), (2, 60)]).unwrap();
    w.cycles(1);
    let written = |w: &World, servo| w.bus.outcome(servo, 4);
    assert_eq!(
        [0, 1, 2].map(|servo| written(&w, servo)),
        [None, Some(Ok(())), None]
    );
    assert!(w.bus.has_writes());
    for id in [1, 3] {
        w.servos.set_fault(id, None, 1);
    }
    w.cycles(1);
    for servo in 0..3 {
        assert_eq!(written(&w, servo), Some(Ok(())));
    }
    assert!(!w.bus.has_writes());
}

#[test]
fn several_are_given_goals_or_none_is() {
    let mut w = writable(3);
    start(&mut w, [0, 1]);
    for (goals, refused) in [
        (&[(0, 10), (2, 10)][..], WriteRefused::MotorOff(2)),
        (&[(0, 10), (0, 20)], WriteRefused::Twice(0)),
        (&[(0, 10), (1, 900)], WriteRefused::Range(900)),
        (&[(0, 10), (3, 10)], WriteRefused::NoSuchJoint(3)),
    ] {
        assert_eq!(w.bus.command_together(1, goals), Err(refused), "{goals:?}");
    }
    w.cycles(2);
    assert_eq!([1, 2].map(|id| register(&w, id, 100, 2)), [0, 0]);
}

#[test]
fn a_motor_is_switched_off_right_behind_the_goals_that_are_out() {
    let mut w = writable(2);
    start(&mut w, 0..2);
    w.bus.command_together(5, &[(0, 80), (1, 90)]).unwrap();
    w.bus.begin(w.now_ns);
    let mut ordered = false;
    loop {
        // As soon as the goals are out.
        if w.bus.request().get(7) == Some(&0x83) && !ordered {
            ordered = true;
            w.bus.command(1, WriteCommand::Torque(false)).unwrap();
        }
        if !w.turn() {
            break;
        }
    }
    w.cycles(1);
    assert!(ordered);
    assert_eq!([1, 2].map(|id| register(&w, id, 64, 1)), [1, 0]);
    assert_eq!([1, 2].map(|id| register(&w, id, 100, 2)), [80, 90]);
    assert!(!w.bus.has_writes());
}

#[test]
fn a_goal_whose_answer_is_missed_keeps_no_motor_on() {
    for (together, off) in [(false, 1), (false, 0), (true, 2), (true, 0)] {
        let mut w = watched(3, 2540);
        start(&mut w, 0..3);
        w.fault(1, ServoFault::Silent);
        w.fault(2, ServoFault::Silent);
        match together {
            true => w.bus.command_together(5, &[(0, 80), (1, 90)]).unwrap(),
            false => w.bus.command(0, WriteCommand::GoalPwm(80)).unwrap(),
        }
        let is_goal = |request: &Vec<u8>| request[7] == 0x83 && request[8] == 100;
        w.bus.begin(w.now_ns);
        while w.requests.last().is_none_or(|request| !is_goal(request)) && w.turn() {}
        w.bus.command(off, WriteCommand::Torque(false)).unwrap();
        w.requests.clear();
        while w.turn() {}
        let id = off as u8 + 1;
        let next = w.requests.iter().find_map(|request| write_of(request));
        assert_eq!(next, Some((id, 64, 0)), "together {together}: in the same cycle");
        w.now_ns += 5 * MS;
        w.cycle(5 * MS);
        w.requests.clear();
        w.cycles(4);
        let told = |id: u8| {
            w.requests
                .iter()
                .any(|r| write_of(r).is_some_and(|(to, at, _)| (to, at) == (id, 100)))
        };
        assert!(!told(id), "a motor that is to be off is given a goal");
    }
}
