//! The thread that reads joints, over a real (pseudo) terminal, against simulated servos.
//!
//! Nothing here is timed: waiting only ends a test that would never succeed.

mod commands;
mod terminals;

use nix::fcntl::{FcntlArg, OFlag, fcntl};
use std::io::Read;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use taxel_joints::bus::{FastState, NoReading};
use taxel_joints::protocol2::Encoder;
use taxel_joints::{
    AnalogueConfig, AnalogueReader, AnalogueSnapshot, DynamixelConfig, FastSyncRead, JointHistory,
    JointReader, JointsConfig, NoAngle, PortState, ReadingThreadError, ServoReader, ServoSnapshot,
    StartError, scan, survey,
};
use taxel_sim::servo::{LinePty, Motion, ServoBuild, ServoBus, ServoFault, ServoPty, servo_clock_ns};

const BAUD: u32 = 1_000_000;
/// What takes longer has hung, also on a busy machine.
const HANGS_AFTER: Duration = Duration::from_secs(200);

fn pty(n: u8) -> ServoPty {
    ServoPty::open(ServoBus::new((1..=n).map(ServoBuild::new), BAUD)).unwrap()
}

fn config(path: &Path, n: u8) -> DynamixelConfig {
    let mut config = DynamixelConfig::new(path, 1..=n);
    config.rate_hz = 500.0;
    // The machine that runs the tests may be busy.
    config.answer_margin_ms = Some(400.0);
    config
}

/// Two, on the lines of this port.
fn potentiometers(path: &Path) -> AnalogueConfig {
    let joint = |n: usize| {
        format!("[[joint]]\nname = \"{n}\"\nchannel = \"p{n}\"\ncounts = [100, 900]\ndegrees = [0, 80]\n")
    };
    let joints: String = (0..2).map(joint).collect();
    toml::from_str(&format!("device = {path:?}\n{joints}")).unwrap()
}

fn eventually(reader: &ServoReader, what: &str, done: impl Fn(&ServoSnapshot) -> bool) -> ServoSnapshot {
    let end = Instant::now() + HANGS_AFTER;
    loop {
        let snapshot = reader.snapshot();
        if done(&snapshot) {
            return snapshot;
        }
        assert!(
            Instant::now() < end,
            "never {what}: {snapshot:?}, {:?}",
            reader.port()
        );
        std::thread::sleep(Duration::from_millis(2));
    }
}

fn all_read(s: &ServoSnapshot) -> bool {
    s.results.iter().all(Result::is_ok)
}

#[test]
fn all_joints_are_read_and_known() {
    let pty = pty(16);
    let reader = ServoReader::start(&config(pty.path(), 16)).unwrap();
    assert_eq!(reader.names()[15], "servo 16");
    let s = eventually(&reader, "known", |s| {
        all_read(s)
            && s.fast == FastState::On
            && s.servos
                .iter()
                .all(|v| v.identity.is_some() && v.temperature_c.is_some())
    });
    for (i, result) in s.results.iter().enumerate() {
        assert_eq!(result.unwrap().position, 2058 + 10 * i as i32);
    }
    let port = reader.port();
    assert_eq!((port.state, port.opened), (PortState::Open, 1));
    // A pseudo terminal has neither flag nor timer, and that is no error.
    let latency = port.latency.unwrap();
    assert_eq!((latency.low_latency, latency.ftdi_timer_ms), (false, None));
    assert!(reader.snapshot().counters.cycles >= s.counters.cycles);
}

#[test]
fn a_servo_that_dies_and_comes_back_is_seen_as_that() {
    let pty = pty(4);
    let reader = ServoReader::start(&config(pty.path(), 4)).unwrap();
    eventually(&reader, "read", all_read);
    pty.bus().set_fault(2, Some(ServoFault::Silent), 1);
    let s = eventually(&reader, "resting", |s| s.results[1] == Err(NoReading::Resting));
    assert!(!s.servos[1].alive && s.servos[0].alive);
    let steps = reader.steps();
    eventually(&reader, "at work", |_| reader.steps() > steps);
    pty.bus().set_fault(2, None, 1);
    eventually(&reader, "back", |s| all_read(s) && s.servos[1].identity.is_some());
}

#[test]
fn an_adapter_that_comes_back_under_another_number_is_found_by_its_stable_name() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("usb-FTDI-if00-port0");
    let first = pty(2);
    std::os::unix::fs::symlink(first.path(), &name).unwrap();
    let reader = ServoReader::start(&config(&name, 2)).unwrap();
    let before = eventually(&reader, "read", all_read).counters.cycles;
    // Unplugged. Another terminal takes a number first, so that the old one is not used again.
    let old = first.path().to_path_buf();
    let other = pty(1);
    drop(first);
    std::fs::remove_file(&name).unwrap();
    eventually(&reader, "gone", |s| s.results[0] == Err(NoReading::NotAsked));
    let end = Instant::now() + HANGS_AFTER;
    let reason = loop {
        if let PortState::Away { reason, .. } = reader.port().state
            && reason.contains("/dev/serial/by-id")
        {
            break reason;
        }
        assert!(Instant::now() < end, "{:?}", reader.port());
        std::thread::sleep(Duration::from_millis(2));
    };
    assert!(reason.contains("is the adapter plugged in?"), "{reason}");
    let second = pty(2);
    let _third = pty(2);
    std::os::unix::fs::symlink(second.path(), &name).unwrap();
    eventually(&reader, "back", |s| all_read(s) && s.counters.cycles > before);
    assert_eq!(reader.port().opened, 2);
    drop((other, old));
}

#[test]
fn a_port_that_another_program_has_is_not_said_to_be_unplugged() {
    let pty = pty(2);
    let first = ServoReader::start(&config(pty.path(), 2)).unwrap();
    eventually(&first, "read", all_read);
    let reason = why_away(pty.path());
    assert!(reason.contains("does another program have it open?"), "{reason}");
    assert!(!reason.contains("plugged in"), "{reason}");
}

#[test]
fn what_is_no_serial_device_or_has_no_folder_is_said_to_be_that() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("servos");
    std::fs::write(&file, "").unwrap();
    for (path, words) in [
        (folder.path(), "it is no serial device"),
        (&*file, "it is no serial device"),
        (Path::new("ttyUSB-none"), "named with its folder"),
        (Path::new("/dev/ttyUSB-none"), "is the adapter plugged in?"),
    ] {
        let reason = why_away(path);
        assert!(reason.contains(words), "{reason}");
    }
}

/// Why a port cannot be opened.
fn why_away(path: &Path) -> String {
    let reader = ServoReader::start(&config(path, 2)).unwrap();
    let end = Instant::now() + HANGS_AFTER;
    loop {
        match reader.port().state {
            PortState::Away { reason, .. } => return reason,
            state => assert!(Instant::now() < end, "{state:?}"),
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn a_port_that_is_not_there_yet_is_opened_when_it_comes() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("later");
    let reader = ServoReader::start(&config(&name, 1)).unwrap();
    let pty = pty(1);
    std::os::unix::fs::symlink(pty.path(), &name).unwrap();
    eventually(&reader, "read", all_read);
}

#[test]
fn angles_are_given_for_the_instant_that_is_asked_for() {
    let motion = Motion::Sine {
        centre: 2048.0,
        amplitude: 600.0,
        hz: 1.0,
        phase: 0.0,
    };
    let build = ServoBuild {
        motion,
        ..ServoBuild::new(1)
    };
    let pty = ServoPty::open(ServoBus::new([build], BAUD)).unwrap();
    let mut config = config(pty.path(), 1);
    config.rate_hz = 100.0;
    let reader = ServoReader::start(&config).unwrap();
    eventually(&reader, "read often", |s| {
        s.servos[0].counters.ok > 60 && s.servos[0].identity.is_some()
    });
    let mut history = JointHistory::new(1, 32);
    let end = Instant::now() + HANGS_AFTER;
    // It is tried: while the thread has the lock there is nothing new. On a busy machine cycles are missed: only what is
    // between readings that are close counts, and there is a time with enough of it.
    let mut errors = Vec::new();
    while errors.len() <= 10 {
        assert!(Instant::now() < end, "close readings: {}", errors.len());
        let newest = eventually(&reader, "read", all_read).results[0].unwrap().t_ns;
        if reader.try_history_since(0, &mut history) == 0 {
            continue;
        }
        errors.clear();
        for back_ms in 0..150 {
            let t_ns = newest - back_ms * 1_000_000;
            let at = history.at(0, t_ns).unwrap();
            let truth =
                (pty.bus().servo(1).unwrap().position(t_ns) - 2048.0) * std::f64::consts::TAU / 4096.0;
            if at.age_ns <= 5_500_000 && !at.extrapolated {
                errors.push((at.angle_rad - truth).abs());
            }
        }
    }
    let tested = errors.len();
    errors.sort_by(f64::total_cmp);
    let (median, worst) = (errors[tested / 2], errors[tested - 1]);
    println!("interpolated over the terminal: {median:.5} rad off, {worst:.5} at most, {tested} instants");
    // Curvature 0.0005 rad, half a pulse 0.0008 rad, and some of 5.8 rad/s by the time of the
    // reading. The median: a machine that is busy with other things stamps some readings late, by
    // any time.
    assert!(median < 0.02, "{median}");
    let future = history.at(0, servo_clock_ns() + 1_000_000_000);
    assert!(future.unwrap().extrapolated);
}

#[test]
fn another_program_that_reads_the_port_is_noticed_and_stops_nothing() {
    let pty = pty(2);
    // It has had the port open before; nobody who comes later may, but root.
    let thief = std::fs::File::open(pty.path()).unwrap();
    let over = Arc::new(AtomicBool::new(false));
    let reader = ServoReader::start(&config(pty.path(), 2)).unwrap();
    let taking = std::thread::spawn({
        let over = over.clone();
        move || {
            // The reader has made reading the port raw. Bytes are taken as soon as there are any.
            fcntl(&thief, FcntlArg::F_SETFL(OFlag::O_NONBLOCK)).unwrap();
            let mut bytes = [0; 1024];
            while !over.load(Ordering::Relaxed) {
                let _ = (&thief).read(&mut bytes);
            }
        }
    });
    eventually(&reader, "noticed", |_| reader.port().taken_ns.is_some());
    let cycles = reader.snapshot().counters.cycles;
    eventually(&reader, "going on", |s| s.counters.cycles > cycles + 3);
    over.store(true, Ordering::Relaxed);
    taking.join().unwrap();
    eventually(&reader, "read again", all_read);
    reader.end().unwrap();
}

#[test]
fn a_thread_that_has_panicked_leaves_its_port_and_is_told_at_the_end() {
    let joints = JointsConfig::dynamixel("/dev/null", [1]);
    let threads = JointReader::start(&joints, || panic!("as a fault would"))
        .unwrap()
        .unwrap();
    let servos = threads.servos.clone().unwrap();
    eventually(&servos, "abandoned", |_| servos.port().abandoned);
    assert_eq!(threads.end(), Err(ReadingThreadError::Panicked));
    // One that is told to end leaves nothing.
    let reader = ServoReader::start(&config("/dev/null".as_ref(), 1)).unwrap();
    assert_eq!(reader.end(), Ok(()));
    assert!(!reader.port().abandoned);
}

#[test]
fn a_scan_finds_who_is_there() {
    let pty = ServoPty::open(ServoBus::new([40, 3, 252].map(ServoBuild::new), BAUD)).unwrap();
    pty.bus().servo_mut(40).unwrap().set_hardware_error(1);
    let found = scan(pty.path(), BAUD).unwrap();
    let seen: Vec<_> = found.iter().map(|f| (f.id, f.model_number, f.alert)).collect();
    assert_eq!(seen, [(3, 1030, false), (40, 1030, true), (252, 1030, false)]);
}

#[test]
fn clients_come_and_go() {
    let pty = pty(2);
    for fast in [FastSyncRead::Off, FastSyncRead::On, FastSyncRead::Auto] {
        let mut config = config(pty.path(), 2);
        config.fast_sync_read = fast;
        let reader = ServoReader::start(&config).unwrap();
        eventually(&reader, "read", all_read);
    }
}

#[test]
fn readings_are_copied_when_there_are_others_than_before() {
    let pty = pty(2);
    let reader = ServoReader::start(&config(pty.path(), 2)).unwrap();
    eventually(&reader, "all read", all_read);
    let mut history = JointHistory::new(2, 32);
    let mut seen = 0;
    while seen == 0 {
        seen = reader.try_history_since(0, &mut history);
    }
    assert!(history.at(0, 0).is_some() && history.at(1, 0).is_some());
    for _ in 0..100 {
        let mut nothing_yet = JointHistory::new(2, 32);
        let now = reader.try_history_since(seen, &mut nothing_yet);
        assert_eq!(nothing_yet.at(0, 0).is_some(), now > seen);
    }
}

#[test]
fn what_needs_no_thread_gets_none_and_what_cannot_be_started_says_why() {
    let hand: JointsConfig = toml::from_str("source = \"allegro:can2\"\nallegro.version = 4").unwrap();
    assert!(JointReader::start(&hand, || {}).unwrap().is_none());
    let none = JointsConfig::dynamixel("/dev/null", []);
    assert!(matches!(
        JointReader::start(&none, || {}),
        Err(StartError::Config(_))
    ));
    let none = DynamixelConfig::new("/dev/null", []);
    assert!(matches!(ServoReader::start(&none), Err(StartError::Config(_))));
}

#[test]
fn a_survey_says_what_each_servo_is_set_to_and_who_shares_an_id() {
    let slow = ServoBuild {
        return_delay: 250,
        ..ServoBuild::new(2)
    };
    let builds = [ServoBuild::new(1), slow, ServoBuild::new(4), ServoBuild::new(4)];
    let pty = ServoPty::open(ServoBus::new(builds, BAUD)).unwrap();
    pty.bus().servo_mut(1).unwrap().set_hardware_error(0x24);
    let found = survey(pty.path(), BAUD, &[1, 2, 3]).unwrap();
    let answers: Vec<(u8, u32)> = found.servos.iter().map(|s| (s.id, s.answers)).collect();
    assert_eq!(answers, [(1, 1), (2, 1), (4, 2)]);
    let servo = &found.servos[0];
    assert_eq!(servo.hardware_error.unwrap().to_string(), "overheating, overload");
    assert_eq!(
        (servo.torque_enabled, servo.status_return_level),
        (Some(false), Some(2))
    );
    assert!(servo.voltage_v.unwrap() > 5.0 && servo.temperature_c.unwrap() > 0);
    assert_eq!(found.servos[1].identity.unwrap().return_delay_us, 500);
    assert_eq!(found.damaged, 0);
}

#[test]
fn a_survey_counts_damaged_answers_and_goes_on() {
    let pty = pty(3);
    pty.bus().set_fault(2, Some(ServoFault::BadCrc), 1);
    let found = survey(pty.path(), BAUD, &[1, 2, 3]).unwrap();
    let ids: Vec<u8> = found.servos.iter().map(|s| s.id).collect();
    assert_eq!(ids, [1, 3]);
    assert!(
        found.damaged >= 2,
        "the broadcast and the one of its own: {}",
        found.damaged
    );
}

#[test]
fn a_survey_reads_a_servo_that_answers_late_and_knows_one_that_answers_pings_alone() {
    let pty = pty(3);
    let level = Encoder::default().write(2, 68, &[0]).unwrap().to_vec();
    pty.bus().receive(&level, servo_clock_ns());
    let late = ServoFault::Late { by_ns: 300_000_000 };
    pty.bus().set_fault(3, Some(late), 1);
    let found = survey(pty.path(), BAUD, &[1, 2, 3]).unwrap();
    let read: Vec<_> = (found.servos.iter())
        .map(|servo| {
            (
                servo.id,
                servo.identity.is_some(),
                servo.status_return_level,
                servo.temperature_c.is_some(),
            )
        })
        .collect();
    assert_eq!(
        read,
        [
            (1, true, Some(2), true),
            (2, false, None, false),
            (3, true, Some(2), true)
        ]
    );
    let took = |servo: usize| &found.servos[servo].answers_ns;
    assert!(!took(0).is_empty() && took(1).is_empty());
    assert!(took(2).iter().any(|ns| *ns > 280_000_000), "{:?}", took(2));
}

#[test]
fn potentiometers_are_read_line_by_line_and_their_port_is_opened_again() {
    let line = |_: u64| b"p0 500 p1 0\n".to_vec();
    let pty = LinePty::open(Duration::from_millis(2), line).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("lines");
    std::os::unix::fs::symlink(pty.path(), &link).unwrap();
    let config = potentiometers(&link);
    let reader = AnalogueReader::start(&config, || ()).unwrap();
    let wait = |what: &str, done: &dyn Fn(&AnalogueSnapshot) -> bool| {
        let end = Instant::now() + HANGS_AFTER;
        while !done(&reader.snapshot()) {
            assert!(Instant::now() < end, "never {what}: {:?}", reader.snapshot());
            std::thread::sleep(Duration::from_millis(2));
        }
    };
    wait("read", &|s| s.counters.lines > 5);
    let snapshot = reader.snapshot();
    assert!((snapshot.angles[0].unwrap().to_degrees() - 40.0).abs() < 1e-9);
    assert_eq!(snapshot.angles[1], Err(NoAngle::AtEnd(0.0)));
    let mut history = JointHistory::new(2, 32);
    // It is tried: while the thread has the lock there is nothing new.
    let end = Instant::now() + HANGS_AFTER;
    while reader.try_history_since(0, &mut history) == 0 {
        assert!(Instant::now() < end, "the lock is never free");
    }
    assert!(history.at(0, u64::MAX).is_some());
    assert_eq!(history.at(1, u64::MAX), None, "what is at an end is no angle");
    drop(pty);
    wait("away", &|s| matches!(s.port.state, PortState::Away { .. }));
    let again = LinePty::open(Duration::from_millis(2), line).unwrap();
    std::fs::remove_file(&link).unwrap();
    std::os::unix::fs::symlink(again.path(), &link).unwrap();
    let before = reader.snapshot().counters.lines;
    wait("back", &|s| s.port.opened == 2 && s.counters.lines > before);
}
