//! The bus against simulated servos, without a thread or a clock: what one servo does wrong never
//! hides another, and what comes too late is never taken for something new.

mod checks;
mod double;
mod full_queue;
mod left_on;
mod lost;
mod offs;
mod proof;
mod repeats;
mod restarts;
mod shown;
mod starts;
mod times;
mod together;
mod told_again;
mod writes;

use taxel_joints::bus::{Bus, FastState, NoReading, Step, wire_ns};
use taxel_joints::protocol2::{Encoder, StatusError};
use taxel_joints::registers::{HardwareError, angle_rad};
use taxel_joints::{DynamixelConfig, FastSyncRead};
use taxel_sim::servo::{AfterSilence, ServoBuild, ServoBus, ServoFault};

const BAUD: u32 = 1_000_000;
const MS: u64 = 1_000_000;

/// Which requests are lost on the way.
type Lost = Box<dyn FnMut(&[u8]) -> bool>;

/// A host and a bus that share a clock which only moves when something happens.
struct World {
    bus: Bus,
    servos: ServoBus,
    now_ns: u64,
    /// Bytes that arrive are given to the host in pieces of at most so many.
    piece: usize,
    requests: Vec<Vec<u8>>,
    /// Between two cycles that begin one behind the other ([`World::go_on`]).
    pause_ns: u64,
    /// What the host says is lost on the way.
    cut: bool,
    /// So are those of its requests of which this says so.
    lost: Lost,
}

impl World {
    fn new(config: &DynamixelConfig, builds: impl IntoIterator<Item = ServoBuild>) -> Self {
        config.check().unwrap();
        Self {
            bus: Bus::new(config),
            servos: ServoBus::new(builds, config.baud),
            now_ns: 1_000 * MS,
            piece: usize::MAX,
            requests: Vec::new(),
            pause_ns: MS,
            cut: false,
            lost: Box::new(|_| false),
        }
    }

    fn of(n: u8, fast: FastSyncRead) -> Self {
        let mut config = DynamixelConfig::new("none", 1..=n);
        config.fast_sync_read = fast;
        Self::new(&config, (1..=n).map(ServoBuild::new))
    }

    fn receive(&mut self) {
        let mut arrived = Vec::new();
        self.servos.take_due(self.now_ns, &mut arrived);
        for piece in arrived.chunks(self.piece.min(40)) {
            self.bus.space()[..piece.len()].copy_from_slice(piece);
            self.bus.take_bytes(piece.len(), self.now_ns);
        }
    }

    /// One turn of a cycle that has begun; `false` when it is over.
    fn turn(&mut self) -> bool {
        self.turn_to(u64::MAX)
    }

    /// The same, which ends at this time, whatever is waited for.
    fn turn_to(&mut self, end_ns: u64) -> bool {
        match self.bus.step(self.now_ns) {
            Step::Send => {
                self.receive();
                let request = self.bus.request().to_vec();
                if !self.cut && !(self.lost)(&request) {
                    self.servos.receive(&request, self.now_ns);
                }
                self.requests.push(request);
                self.bus.sent(self.now_ns);
            }
            Step::Wait { until_ns } => {
                let next = self.servos.next_due_ns().map_or(until_ns, |t| t.min(until_ns));
                self.now_ns = self.now_ns.max(next.min(end_ns));
                self.receive();
            }
            Step::Done => return false,
        }
        true
    }

    /// One turn; where the cycle is over, the next begins, and this says so.
    fn go_on(&mut self, end_ns: u64) -> bool {
        let is_over = !self.turn_to(end_ns);
        if is_over {
            self.now_ns += self.pause_ns;
            self.bus.begin(self.now_ns);
        }
        is_over
    }

    /// Somebody answers for the servo of this id, which is asked for its torque, that it is this.
    fn say_torque(&mut self, id: u8, torque: u8) {
        let asked = self.requests.last().unwrap();
        assert_eq!((asked[7], asked[8]), (0x82, 64), "it is asked for its torque");
        let mut data = vec![0; usize::from(asked[10])];
        data[0] = torque;
        let mut encoder = Encoder::default();
        let answer = encoder.status(id, 0, &data).unwrap();
        let bytes = answer.len();
        self.bus.space()[..bytes].copy_from_slice(answer);
        self.bus.take_bytes(bytes, self.now_ns);
    }

    /// One cycle; the next begins `pause_ns` later.
    fn cycle(&mut self, pause_ns: u64) -> Vec<Result<i32, NoReading>> {
        self.bus.begin(self.now_ns);
        for _ in 0..10_000 {
            if !self.turn() {
                self.now_ns += pause_ns;
                return self.bus.results().iter().map(|r| r.map(|r| r.position)).collect();
            }
        }
        panic!("the cycle does not end");
    }

    fn cycles(&mut self, n: usize) -> Vec<Vec<Result<i32, NoReading>>> {
        (0..n).map(|_| self.cycle(5 * MS)).collect()
    }

    fn fault(&mut self, id: u8, fault: ServoFault) {
        assert!(self.servos.set_fault(id, Some(fault), 1));
    }
}

fn still(id: u8) -> i32 {
    2048 + 10 * i32::from(id)
}

fn all_good(results: &[Result<i32, NoReading>]) -> bool {
    results.iter().zip(1..).all(|(r, id)| *r == Ok(still(id)))
}

#[test]
fn every_servo_is_read_in_every_cycle_however_the_bytes_come() {
    for fast in [FastSyncRead::Off, FastSyncRead::Auto, FastSyncRead::On] {
        for piece in [1, 7, usize::MAX] {
            let mut w = World::of(16, fast);
            w.piece = piece;
            for results in w.cycles(50) {
                assert!(all_good(&results), "{fast:?}, {piece}: {results:?}");
            }
            let state = match fast {
                FastSyncRead::Off => FastState::Off,
                _ => FastState::On,
            };
            assert_eq!(w.bus.fast_state(), state);
            for i in 0..16 {
                let s = w.bus.servo(i).unwrap();
                assert_eq!((s.counters.ok, s.counters.timeouts, s.counters.late), (50, 0, 0));
            }
        }
    }
}

#[test]
fn one_servo_shares_its_packet_with_nobody() {
    let mut w = World::of(1, FastSyncRead::Auto);
    assert!(w.cycles(20).iter().all(|results| all_good(results)));
    assert_eq!(w.bus.fast_state(), FastState::Off);
}

#[test]
fn a_cycle_takes_the_time_on_the_wire() {
    let mut w = World::of(16, FastSyncRead::Off);
    w.cycles(100);
    let before = w.bus.counters().requests;
    let took: Vec<u64> = (0..20)
        .map(|_| {
            w.cycle(0);
            w.bus.counters().cycle_ns
        })
        .collect();
    // docs/protocols.md, "Dynamixel cycle": 14 + 16 bytes there, 16 times 23 back, 10 us each.
    assert_eq!(took.iter().min(), Some(&wire_ns(14 + 16 + 16 * 23, BAUD)));
    assert!(w.bus.counters().requests - before < 30);
}

#[test]
fn identity_voltage_and_temperature_come_by_the_slow_lane() {
    let mut w = World::of(3, FastSyncRead::Off);
    w.cycles(400);
    for (i, id) in (1..=3_u8).enumerate() {
        let s = w.bus.servo(i).unwrap();
        let identity = s.identity.unwrap();
        assert_eq!((identity.model_number, identity.firmware), (1030, 46));
        assert_eq!(identity.return_delay_us, 0);
        assert_eq!(identity.model().unwrap().name, "XM430-W210");
        assert_eq!(s.voltage_v, Some(12.0));
        assert_eq!(s.temperature_c, Some(30 + id));
        assert_eq!(s.hardware_error, Some(HardwareError(0)));
        assert_eq!(s.torque_enabled, Some(false));
        assert_eq!(w.bus.results()[i].unwrap().current_a, Some(0.0));
    }
    assert_eq!(w.bus.counters().slow_unanswered, 0);
    // While the port was away another servo may have taken the place of one.
    w.bus.port_lost();
    w.bus.port_opened();
    w.cycle(0);
    assert_eq!(w.bus.results()[0].unwrap().current_a, None);
    w.cycles(400);
    assert_eq!(w.bus.servo(0).unwrap().identity.unwrap().model_number, 1030);
    assert_eq!(w.bus.results()[0].unwrap().current_a, Some(0.0));
}

#[test]
fn what_one_servo_does_wrong_hides_no_other() {
    let faults = [
        ServoFault::Silent,
        ServoFault::BadCrc,
        ServoFault::Truncated { bytes: 9 },
        ServoFault::Truncated { bytes: 22 },
        ServoFault::Late { by_ns: 8 * MS },
        ServoFault::Garbage { bytes: 30 },
        ServoFault::Noise { bytes: 50 },
        ServoFault::Noise { bytes: 700 },
    ];
    for fast in [FastSyncRead::Off, FastSyncRead::Auto, FastSyncRead::On] {
        for after in [AfterSilence::Answer, AfterSilence::Stop] {
            for fault in faults {
                for id in [1, 3, 5] {
                    let mut w = World::of(5, fast);
                    w.servos.set_after_silence(after);
                    w.cycles(10);
                    w.fault(id, fault);
                    for (n, results) in w.cycles(60).into_iter().enumerate() {
                        for (result, other) in results.iter().zip(1..) {
                            let what =
                                format!("{fast:?} {after:?} {fault:?} at {id}, cycle {n}: servo {other}");
                            match result {
                                Ok(position) => assert_eq!(*position, still(other), "{what}"),
                                Err(e) => assert_eq!(other, id, "{what}: {e}"),
                            }
                        }
                    }
                    w.servos.set_fault(id, None, 1);
                    w.now_ns += 500 * MS;
                    w.cycles(5);
                    let results = w.cycle(0);
                    assert!(
                        all_good(&results),
                        "{fast:?} {after:?} {fault:?} at {id}: {results:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn each_fault_is_counted_as_what_it_is() {
    for (fault, result) in [
        (ServoFault::Silent, Some(NoReading::Silent)),
        (ServoFault::BadCrc, Some(NoReading::BadCrc)),
        (ServoFault::Garbage { bytes: 5 }, None),
    ] {
        let mut w = World::of(4, FastSyncRead::Off);
        w.fault(2, fault);
        let seen = w.cycle(0);
        assert_eq!(seen[1].err(), result, "{fault:?}");
        let c = w.bus.servo(1).unwrap().counters;
        assert_eq!(c.timeouts, u64::from(fault == ServoFault::Silent));
        assert_eq!(c.bad_crc, u64::from(fault == ServoFault::BadCrc));
        assert_eq!(w.bus.counters().noise_bytes > 0, fault != ServoFault::Silent);
    }
}

#[test]
fn a_silent_servo_costs_the_living_little() {
    let mut w = World::of(16, FastSyncRead::Off);
    w.cycles(100);
    let cycle_ns = |w: &mut World| {
        let from = w.now_ns;
        for _ in 0..200 {
            w.cycle(0);
        }
        w.now_ns - from
    };
    let healthy = cycle_ns(&mut w);
    w.fault(7, ServoFault::Silent);
    w.cycles(200);
    let with_one_dead = cycle_ns(&mut w);
    assert!(
        with_one_dead < healthy * 105 / 100,
        "{with_one_dead} against {healthy}"
    );
    let c = w.bus.servo(6).unwrap().counters;
    assert!(c.rested > 20 * c.timeouts, "{c:?}");
}

#[test]
fn a_servo_that_was_away_is_back_within_a_second() {
    for fast in [FastSyncRead::Off, FastSyncRead::Auto] {
        let mut w = World::of(6, fast);
        for id in 1..=6 {
            w.fault(id, ServoFault::Silent);
        }
        // Everything is off, for long enough that every pause is the longest.
        w.cycles(1500);
        assert!(w.bus.results().iter().all(Result::is_err));
        for id in 1..=6 {
            w.servos.set_fault(id, None, 1);
        }
        let end_ns = w.now_ns + 1_000 * MS;
        while !all_good(&w.cycle(5 * MS)) {
            assert!(w.now_ns < end_ns, "{fast:?}: {:?}", w.bus.results());
        }
    }
}

#[test]
fn fast_sync_read_falls_back_when_it_is_not_known() {
    let config = DynamixelConfig::new("none", 1..=4);
    let old = |id| ServoBuild {
        fast: id != 3,
        ..ServoBuild::new(id)
    };
    let mut w = World::new(&config, (1..=4).map(old));
    for results in w.cycles(20) {
        assert!(all_good(&results), "{results:?}");
    }
    assert_eq!(w.bus.fast_state(), FastState::NotSupported);
    let fast = w.requests.iter().filter(|r| r[7] == 0x8A).count();
    assert!((1..=3).contains(&fast), "{fast} tries");
    // Another adapter, perhaps other servos: it is tried again.
    w.bus.port_opened();
    assert_eq!(w.bus.fast_state(), FastState::Probing);
}

#[test]
fn fast_sync_read_that_has_worked_is_tried_again_after_a_bad_time() {
    let mut w = World::of(4, FastSyncRead::Auto);
    w.cycles(10);
    assert_eq!(w.bus.fast_state(), FastState::On);
    w.fault(1, ServoFault::Late { by_ns: 3 * MS });
    for _ in 0..200 {
        w.cycle(5 * MS);
        if w.bus.fast_state() == FastState::NotSupported {
            break;
        }
    }
    assert_eq!(w.bus.fast_state(), FastState::NotSupported);
    w.servos.set_fault(1, None, 1);
    let tried = w.requests.len();
    w.cycles(200);
    assert!(w.requests[tried..].iter().all(|r| r[7] != 0x8A), "not at once");
    w.now_ns += 10_000 * MS;
    w.cycles(20);
    assert_eq!(w.bus.fast_state(), FastState::On);
}

#[test]
fn an_alert_leaves_the_reading_and_fetches_the_error() {
    for fast in [FastSyncRead::Off, FastSyncRead::On] {
        let mut w = World::of(3, fast);
        w.cycles(10);
        w.servos.servo_mut(2).unwrap().set_hardware_error(0x24);
        w.cycles(10);
        assert_eq!(w.bus.results()[1].unwrap().position, still(2));
        assert!(w.bus.results()[1].unwrap().alert);
        assert!(!w.bus.results()[0].unwrap().alert);
        let state = w.bus.servo(1).unwrap();
        assert_eq!(state.hardware_error, Some(HardwareError(0x24)));
        assert_eq!(state.hardware_error.unwrap().to_string(), "overheating, overload");
        assert!(state.counters.alerts >= 9);
        w.servos.servo_mut(2).unwrap().set_hardware_error(0);
        w.cycles(1);
        assert_eq!(w.bus.servo(1).unwrap().hardware_error, Some(HardwareError(0)));
    }
}

#[test]
fn an_alert_beside_an_error_number_is_counted_and_kept() {
    for fast in [FastSyncRead::Off, FastSyncRead::On] {
        let mut w = World::of(3, fast);
        w.cycles(10);
        w.servos.servo_mut(2).unwrap().set_hardware_error(0x20);
        w.fault(2, ServoFault::Refuse { number: 4 });
        w.cycles(10);
        let state = w.bus.servo(1).unwrap();
        assert_eq!(state.refusal, Some(StatusError::DataRange), "{fast:?}");
        assert!(state.alert);
        assert_eq!((state.counters.alerts, state.counters.refused), (10, 10));
        w.servos.set_fault(2, None, 1);
        w.cycles(10);
        let state = w.bus.servo(1).unwrap();
        assert_eq!((state.alert, state.refusal), (true, None));
        assert_eq!(state.hardware_error, Some(HardwareError(0x20)));
        w.servos.servo_mut(2).unwrap().set_hardware_error(0);
        w.cycles(1);
        assert!(!w.bus.servo(1).unwrap().alert);
    }
}

#[test]
fn a_servo_with_another_id_is_counted_and_changes_nothing() {
    let mut w = World::new(&DynamixelConfig::new("none", 1..=2), (1..=3).map(ServoBuild::new));
    // Something else on the wire makes servo 3 talk.
    let ping = Encoder::default().ping(3).to_vec();
    for _ in 0..5 {
        w.servos.receive(&ping, w.now_ns);
        assert!(all_good(&w.cycle(MS)));
    }
    w.cycle(MS);
    assert_eq!(w.bus.counters().foreign, 5);
}

#[test]
fn a_servo_that_refuses_is_told_from_one_that_is_silent() {
    // An address the simulated table does not have cannot be asked for, so the answer is made by hand.
    let mut w = World::of(2, FastSyncRead::Off);
    w.fault(1, ServoFault::Silent);
    w.bus.begin(w.now_ns);
    assert_eq!(w.bus.step(w.now_ns), Step::Send);
    w.bus.sent(w.now_ns);
    let mut e = Encoder::default();
    let answer = e.status(1, 7, &[]).unwrap();
    w.bus.space()[..answer.len()].copy_from_slice(answer);
    let n = answer.len();
    w.bus.take_bytes(n, w.now_ns);
    assert_eq!(
        w.bus.results()[0].unwrap_err(),
        NoReading::Refused(StatusError::Access)
    );
    assert_eq!(w.bus.servo(0).unwrap().counters.refused, 1);
}

#[test]
fn angles_are_homed_and_turned() {
    let mut config = DynamixelConfig::new("none", [1, 2]);
    config.servo[1].direction = -1;
    config.servo[1].homing_rad = 0.1;
    let mut w = World::new(&config, (1..=2).map(ServoBuild::new));
    w.cycle(0);
    let angle = |i: usize| w.bus.results()[i].unwrap().angle_rad;
    assert!((angle(0) - angle_rad(still(1))).abs() < 1e-12);
    assert!((angle(1) - (0.1 - angle_rad(still(2)))).abs() < 1e-12);
}

#[test]
fn random_bytes_at_any_time_never_end_a_cycle_badly() {
    let mut seed = 12345_u64;
    let mut random = || {
        seed = seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as usize
    };
    for fast in [FastSyncRead::Off, FastSyncRead::Auto] {
        let mut w = World::of(4, fast);
        for _ in 0..2000 {
            let header = [0xFF, 0xFF, 0xFD, 0x00, [1, 2, 3, 4, 0xFE][random() % 5]];
            let n = random() % 60;
            let mut noise: Vec<u8> = (0..n).map(|_| random() as u8).collect();
            if random() % 2 == 0 {
                noise.splice(0..0, header);
            }
            let space = w.bus.space();
            let n = noise.len().min(space.len());
            space[..n].copy_from_slice(&noise[..n]);
            w.bus.take_bytes(n, w.now_ns);
            for (result, id) in w.cycle(0).into_iter().zip(1..) {
                assert_eq!(result, Ok(still(id)));
            }
        }
    }
}
