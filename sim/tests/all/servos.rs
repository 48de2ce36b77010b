//! The simulated servo bus, packet by packet, in its own time.

use std::sync::Arc;
use taxel_joints::bus::wire_ns;
use taxel_joints::protocol2::{Encoder, FastBlocks, Instruction, Parser};
use taxel_sim::servo::{ServoBuild, ServoBus, SpringWall};

const BAUD: u32 = 1_000_000;
const MS: u64 = 1_000_000;
const TORQUE: u16 = 64;
const LED: u16 = 65;
const REGISTERED: u16 = 69;
const WATCHDOG: u16 = 98;
const GOAL_PWM: u16 = 100;
const GOAL_VELOCITY: u16 = 104;
const GOAL_POSITION: u16 = 116;
const PRESENT_PWM: u16 = 124;

/// Servos and the time on their bus, which goes on by what is sent.
struct Bench {
    bus: ServoBus,
    now_ns: u64,
}

impl Bench {
    fn new(ids: impl IntoIterator<Item = u8>) -> Self {
        Self {
            bus: ServoBus::new(ids.into_iter().map(ServoBuild::new), BAUD),
            now_ns: 0,
        }
    }

    /// Sends a packet, and gives the bytes that are answered to it.
    fn ask(&mut self, packet: &[u8]) -> Vec<u8> {
        self.bus.receive(packet, self.now_ns);
        self.now_ns += wire_ns(packet.len(), BAUD);
        let mut answer = Vec::new();
        while let Some(due_ns) = self.bus.next_due_ns() {
            self.now_ns = self.now_ns.max(due_ns);
            self.bus.take_due(self.now_ns, &mut answer);
        }
        answer
    }

    fn send(&mut self, id: u8, instruction: Instruction, parameters: &[u8]) -> Vec<u8> {
        let packet = Encoder::default()
            .packet(id, instruction, parameters.iter().copied())
            .unwrap()
            .to_vec();
        self.ask(&packet)
    }

    /// The error number of the one answer.
    fn error(&mut self, id: u8, instruction: Instruction, parameters: &[u8]) -> u8 {
        let answer = self.send(id, instruction, parameters);
        let mut parser = Parser::new(64);
        assert_eq!(parser.push(&answer), answer.len());
        let packet = parser.next_packet().expect("an answer").expect("whole");
        assert_eq!((packet.id, packet.instruction), (id, Instruction::Status as u8));
        packet.parameters[0]
    }

    fn write(&mut self, id: u8, at: u16, data: &[u8]) {
        let parameters = [&at.to_le_bytes(), data].concat();
        assert_eq!(
            self.error(id, Instruction::Write, &parameters),
            0,
            "{at}: {data:?}"
        );
    }

    fn register(&self, id: u8, at: u16, size: u8) -> i32 {
        self.bus.servo(id).unwrap().register(at, size)
    }

    fn position(&self, id: u8) -> f64 {
        self.bus.servo(id).unwrap().position(self.now_ns)
    }
}

fn hex(text: &str) -> Vec<u8> {
    text.split_whitespace()
        .map(|b| u8::from_str_radix(b, 16).unwrap())
        .collect()
}

/// The e-Manual's own packets ("Protocol 2.0", Instruction details).
#[test]
fn the_manuals_examples_are_answered_as_it_says() {
    let mut bench = Bench::new([1, 2]);
    let done = hex("FF FF FD 00 01 04 00 55 00 A1 0C");
    // Reg Write: Goal Velocity 200 of servo 1. Then Action.
    assert_eq!(
        bench.ask(&hex("FF FF FD 00 01 09 00 04 68 00 C8 00 00 00 AE 8E")),
        done
    );
    assert_eq!(
        (
            bench.register(1, REGISTERED, 1),
            bench.register(1, GOAL_VELOCITY, 4)
        ),
        (1, 0)
    );
    assert_eq!(bench.ask(&hex("FF FF FD 00 01 03 00 05 02 CE")), done);
    assert_eq!(
        (
            bench.register(1, REGISTERED, 1),
            bench.register(1, GOAL_VELOCITY, 4)
        ),
        (0, 200)
    );
    // Clear: the revolutions of servo 1.
    assert_eq!(
        bench.ask(&hex("FF FF FD 00 01 08 00 10 01 44 58 4C 22 B1 DC")),
        done
    );
    // Bulk Write: Max Voltage Limit 160 of servo 1, Temperature Limit 80 of servo 2. Nobody answers.
    let bulk_write = hex("FF FF FD 00 FE 10 00 93 01 20 00 02 00 A0 00 02 1F 00 01 00 50 B7 68");
    assert_eq!(bench.ask(&bulk_write), []);
    assert_eq!((bench.register(1, 32, 2), bench.register(2, 31, 1)), (160, 80));
    // Bulk Read: Present Input Voltage of servo 1, Present Temperature of servo 2.
    let answer = bench.ask(&hex(
        "FF FF FD 00 FE 0D 00 92 01 90 00 02 00 02 92 00 01 00 1A 05",
    ));
    assert_eq!(
        answer,
        [
            hex("FF FF FD 00 01 06 00 55 00 78 00 E0 CA")[..9].to_vec(),
            answer[9..].to_vec()
        ]
        .concat()
    );
    assert_eq!((answer[9], answer[22]), (120, 32));
}

#[test]
fn a_registered_write_waits_for_action_and_one_that_is_refused_is_none() {
    let mut bench = Bench::new([1, 2]);
    let led = |value: u8| [&LED.to_le_bytes()[..], &[value]].concat();
    for id in [1, 2] {
        assert_eq!(bench.error(id, Instruction::RegWrite, &led(1)), 0);
    }
    // Out of range, half a register, no address: the one before stays.
    for (parameters, number) in [(led(9), 4), (vec![116, 0, 1], 5), (vec![1], 5)] {
        assert_eq!(
            bench.error(1, Instruction::RegWrite, &parameters),
            number,
            "{parameters:?}"
        );
    }
    assert_eq!((bench.register(1, LED, 1), bench.register(2, LED, 1)), (0, 0));
    assert_eq!(
        bench.send(0xFE, Instruction::Action, &[]),
        [],
        "a broadcast is not answered"
    );
    assert_eq!((bench.register(1, LED, 1), bench.register(2, LED, 1)), (1, 1));
    bench.write(1, LED, &[0]);
    assert_eq!(bench.error(1, Instruction::Action, &[]), 0);
    assert_eq!(bench.register(1, LED, 1), 0, "it was carried out once");
    assert_eq!(bench.error(1, Instruction::RegWrite, &led(1)), 0);
    bench.send(1, Instruction::Reboot, &[]);
    bench.now_ns += 200 * MS;
    assert_eq!(bench.error(1, Instruction::Action, &[]), 0);
    assert_eq!(bench.register(1, LED, 1), 0, "a restart forgets it");
}

#[test]
fn clear_forgets_the_revolutions_of_a_motor_that_stands() {
    let clear = [0x01, 0x44, 0x58, 0x4C, 0x22];
    let mut bench = Bench::new([1]);
    bench.bus.servo_mut(1).unwrap().set_operating_mode(4);
    bench.write(1, TORQUE, &[1]);
    bench.write(1, GOAL_POSITION, &9000i32.to_le_bytes());
    assert_eq!(bench.error(1, Instruction::Clear, &clear), 1, "it moves");
    bench.now_ns += 20_000 * MS;
    assert_eq!(bench.position(1), 9000.0);
    assert_eq!(
        bench.error(1, Instruction::Clear, &[0x01, 0x44, 0x58, 0x4C, 0x23]),
        4
    );
    assert_eq!(bench.error(1, Instruction::Clear, &clear), 0);
    assert_eq!(
        (bench.position(1), bench.register(1, GOAL_POSITION, 4)),
        (808.0, 808)
    );
    bench.now_ns += 1000 * MS;
    assert_eq!(bench.position(1), 808.0, "it stays there");
}

#[test]
fn bulk_writes_reach_each_servo_in_its_own_place_up_to_where_they_are_cut() {
    let mut bench = Bench::new(1..=3);
    let rows = [
        &[1, 65, 0, 1, 0, 1][..],
        &[9, 65, 0, 1, 0, 1],
        &[3, 116, 0, 4, 0, 0, 2, 0, 0],
        &[2, 65, 0, 5, 0, 1],
    ];
    assert_eq!(bench.send(0xFE, Instruction::BulkWrite, &rows.concat()), []);
    let registers =
        [(1, LED, 1), (2, LED, 1), (3, GOAL_POSITION, 4)].map(|(id, at, n)| bench.register(id, at, n));
    assert_eq!(registers, [1, 0, 512]);
    for parameters in [&[][..], &[1], &[1, 65, 0, 1]] {
        assert_eq!(bench.send(0xFE, Instruction::BulkWrite, parameters), []);
    }
}

#[test]
fn a_fast_bulk_read_is_one_packet_that_ends_at_the_first_servo_that_is_missing() {
    let asked = [3, 132, 0, 4, 0, 1, 144, 0, 2, 0, 2, 146, 0, 1, 0];
    let mut bench = Bench::new(1..=3);
    let answer = bench.send(0xFE, Instruction::FastBulkRead, &asked);
    let length = usize::from(u16::from_le_bytes([answer[5], answer[6]]));
    assert_eq!((answer.len(), length), (7 + length, 1 + 4 + 4 + 4 + 2 + 4 + 1));
    let first = FastBlocks::new(&answer, 4).unwrap().next().unwrap();
    assert_eq!(
        (first.id, first.data, first.crc_ok),
        (3, &2078i32.to_le_bytes()[..], true)
    );
    let second = &answer[8 + 8..];
    assert_eq!(second[..4], [0, 1, 120, 0]);
    assert_eq!(second[6..9], [0, 2, 32]);
    let mut bench = Bench::new([3, 2]);
    let answer = bench.send(0xFE, Instruction::FastBulkRead, &asked);
    assert_eq!(answer.len(), 8 + 8, "servo 1 is missing, and so is all behind it");
}

#[test]
fn a_motor_stops_within_its_watchdog_though_nobody_speaks() {
    let mut bench = Bench::new([1, 2]);
    for id in [1, 2] {
        bench.bus.servo_mut(id).unwrap().set_operating_mode(16);
        bench.write(id, TORQUE, &[1]);
        bench.write(id, GOAL_PWM, &177i16.to_le_bytes());
    }
    bench.write(1, WATCHDOG, &[5]);
    let heard_ns = bench.now_ns;
    bench.send(1, Instruction::Read, &[124, 0, 2, 0]);
    assert_eq!(bench.register(1, PRESENT_PWM, 2), 177);
    // The last instruction ends after the one that armed it.
    let heard_ns = heard_ns + wire_ns(14, BAUD);
    bench.now_ns = heard_ns + 100 * MS;
    bench.bus.handle_time(bench.now_ns);
    assert_eq!(
        (
            bench.register(1, WATCHDOG, 1),
            bench.bus.servo(1).unwrap().stopped_ns()
        ),
        (5, None)
    );
    let there = bench.position(1);
    bench.now_ns += 1;
    bench.bus.handle_time(bench.now_ns);
    let servo = bench.bus.servo(1).unwrap();
    assert_eq!(
        (servo.register(WATCHDOG, 1), servo.stopped_ns()),
        (255, Some(heard_ns + 100 * MS))
    );
    bench.now_ns += 1000 * MS;
    assert_eq!(bench.position(1), there);
    bench.bus.handle_time(bench.now_ns);
    assert_eq!(bench.register(1, PRESENT_PWM, 2), 0);
    assert_eq!(
        bench.bus.servo(2).unwrap().stopped_ns(),
        None,
        "the other's is not armed"
    );
}

#[test]
fn a_watchdog_that_is_held_counts_no_silence_until_it_runs_again() {
    let mut bench = Bench::new([1]);
    bench.bus.hold_watchdogs();
    bench.write(1, WATCHDOG, &[5]);
    bench.now_ns += 10_000 * MS;
    bench.bus.handle_time(bench.now_ns);
    assert_eq!(bench.register(1, WATCHDOG, 1), 5);
    let runs_ns = bench.now_ns;
    bench.bus.run_watchdogs(runs_ns);
    for (after_ns, register) in [(100 * MS, 5), (100 * MS + 1, 255)] {
        bench.bus.handle_time(runs_ns + after_ns);
        assert_eq!(bench.register(1, WATCHDOG, 1), register);
    }
}

#[test]
fn torque_moves_no_motor_whose_watchdog_has_stopped_it() {
    let mut bench = Bench::new([1]);
    bench.bus.servo_mut(1).unwrap().set_operating_mode(16);
    bench.write(1, GOAL_PWM, &177i16.to_le_bytes());
    bench.write(1, WATCHDOG, &[5]);
    bench.now_ns += 1000 * MS;
    bench.bus.handle_time(bench.now_ns);
    let there = bench.position(1);
    bench.write(1, TORQUE, &[1]);
    bench.now_ns += 1000 * MS;
    assert_eq!((bench.register(1, WATCHDOG, 1), bench.position(1)), (255, there));
    // Cleared, it takes goals again.
    bench.write(1, WATCHDOG, &[0]);
    bench.write(1, GOAL_PWM, &177i16.to_le_bytes());
    bench.now_ns += 1000 * MS;
    assert!(bench.position(1) > there);
}

#[test]
fn a_motor_under_pwm_comes_to_rest_where_the_load_holds_it_and_opens_when_it_is_let_go() {
    let wall = SpringWall {
        open: 2058.0,
        touch: 2500.0,
        counts_per_pulse: 1.0,
        efficiency: 0.5,
    };
    let build = ServoBuild {
        load: Some(Arc::new(wall)),
        ..ServoBuild::new(1)
    };
    let mut bench = Bench {
        bus: ServoBus::new([build], BAUD),
        now_ns: 0,
    };
    bench.bus.servo_mut(1).unwrap().set_operating_mode(16);
    bench.write(1, GOAL_PWM, &0i16.to_le_bytes());
    bench.write(1, TORQUE, &[1]);
    for (pwm, at) in [(200i16, 2600.0), (400, 2700.0), (100, 2700.0), (50, 2600.0)] {
        bench.write(1, GOAL_PWM, &pwm.to_le_bytes());
        bench.now_ns += 1000 * MS;
        assert_eq!(bench.position(1), at, "{pwm}");
        bench.send(1, Instruction::Read, &[124, 0, 2, 0]);
        assert_eq!(bench.register(1, PRESENT_PWM, 2), i32::from(pwm));
    }
    // Nobody speaks any more: the watchdog takes the torque away, and the finger opens.
    bench.write(1, WATCHDOG, &[5]);
    bench.now_ns += 1000 * MS;
    bench.bus.handle_time(bench.now_ns);
    assert_eq!(bench.position(1), 2058.0);
    bench.send(1, Instruction::Read, &[124, 0, 2, 0]);
    assert_eq!(bench.register(1, PRESENT_PWM, 2), 0);
    // So it does when it is switched off.
    bench.write(1, WATCHDOG, &[0]);
    bench.write(1, GOAL_PWM, &200i16.to_le_bytes());
    bench.now_ns += 1000 * MS;
    assert_eq!(bench.position(1), 2600.0);
    bench.write(1, TORQUE, &[0]);
    bench.now_ns += 1000 * MS;
    assert_eq!(bench.position(1), 2058.0);
}
