//! After its start the tick thread allocates nothing: not per frame, not per tick, not per reader.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use taxel_allocations::{Counting, of_thread};
use taxel_engine::TickMode;
use taxel_hand::{Method, Profile};
use taxel_joints::{AllegroConfig, AllegroSource, JointSource, JointsConfig};
use taxel_sim::servo::{ServoBuild, ServoBus, ServoPty};
use taxel_wire::{Received, Subscribe, Subscriber};
use taxeld::{Config, Daemon};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// What takes longer has hung, also on a busy machine.
const HANGS_AFTER: Duration = Duration::from_secs(200);

fn tick_thread() -> usize {
    for task in std::fs::read_dir("/proc/self/task").unwrap() {
        let task = task.unwrap().path();
        if std::fs::read_to_string(task.join("comm")).unwrap().trim() == "tick" {
            return task.file_name().unwrap().to_str().unwrap().parse().unwrap();
        }
    }
    panic!("the daemon has no thread named tick");
}

/// Takes everything until the daemon is gone.
fn drain(mut subscriber: Subscriber) {
    while subscriber.next().is_ok() {}
}

/// Waits until the subscriber has seen `images` images, and returns how many joint angles were known at most.
fn watch(subscriber: &mut Subscriber, images: u64) -> usize {
    let deadline = Instant::now() + HANGS_AFTER;
    let (mut seen, mut joints) = (0, 0);
    while seen < images {
        assert!(Instant::now() < deadline, "only {seen} of {images} images");
        if let Some(Received::Image(_, image)) = subscriber.next_timeout(Duration::from_secs(1)).unwrap() {
            seen += 1;
            joints = joints.max(image.joints().filter(|angle| angle.is_finite()).count());
        }
    }
    joints
}

/// A subscriber with a display of its own.
fn display(config: &Config, profile: Profile, region: Option<&str>) -> Subscriber {
    let mut subscriber = Subscriber::connect(&config.socket.images).unwrap();
    let wanted = Subscribe {
        profile: Some(profile.clone()),
        region: region.map(|part| vec![part.to_string()]),
        ..Subscribe::default()
    };
    subscriber.subscribe(&wanted).unwrap();
    while subscriber
        .hello()
        .is_none_or(|hello| hello.profile != (&profile).into())
    {
        subscriber.next_timeout(HANGS_AFTER).unwrap().expect("an answer");
    }
    subscriber
}

/// A recording of a version 4 Allegro hand that sends its angles every 6 ms for longer than the test, also on a busy machine.
fn recorded_hand(folder: &Path) -> PathBuf {
    let mut text = String::new();
    for t_us in (0..HANGS_AFTER.as_micros() as u32).step_by(6000) {
        for finger in 0..4 {
            let (s, us, id) = (t_us / 1_000_000, t_us % 1_000_000, 0x080 + 4 * finger);
            let angle = (t_us / 6000 % 256) as u8;
            writeln!(text, "({s}.{us:06}) can2 {id:03X}#00{angle:02X}000000000000").unwrap();
        }
    }
    let path = folder.join("hand.log");
    std::fs::write(&path, text).unwrap();
    path
}

fn allocations_per_run(mode: TickMode, rate_hz: f64, joints: JointsConfig) -> u64 {
    let folder = tempfile::tempdir().unwrap();
    let layout = taxel_skin::Layout::builtin("allegro-uskin-15").unwrap();
    let source = "sim:worst-case".parse().unwrap();
    let mut config = Config::new(layout, vec![source, "sim:worst-case".parse().unwrap()]);
    config.joints = Some(joints);
    config.tick.mode = mode;
    config.tick.rate_hz = rate_hz;
    // Debug builds are slow.
    config.profiles.budget_percent = 100.0;
    config.socket.images = folder.path().join("images.sock");
    config.socket.control = folder.path().join("control.sock");
    let daemon = Daemon::start(config.clone()).unwrap();
    let mut subscriber = Subscriber::connect(&config.socket.images).unwrap();
    subscriber
        .subscribe(&Subscribe {
            raw: true,
            ..Subscribe::default()
        })
        .unwrap();
    let of = |levels, method| Profile {
        levels,
        method,
        ..Profile::default()
    };
    let others = [
        display(&config, of(4, Method::Paper), None),
        display(&config, of(5, Method::Optimal), None),
        display(&config, of(6, Method::Optimal), Some("thumb")),
    ];
    for other in others {
        std::thread::spawn(move || drain(other));
    }
    for raw in [false, true] {
        let mut recorder = Subscriber::connect(&config.socket.images).unwrap();
        let wanted = Subscribe {
            every: true,
            raw,
            ..Subscribe::default()
        };
        recorder.subscribe(&wanted).unwrap();
        std::thread::spawn(move || drain(recorder));
    }
    // Past the calibration window, and every buffer has grown to its size.
    watch(&mut subscriber, (3.0 * rate_hz) as u64);

    let tick = tick_thread();
    let before = of_thread(tick);
    // A display comes, and its profile goes again two seconds after it has left.
    drop(display(&config, of(7, Method::Optimal), None));
    let angles = watch(&mut subscriber, (3.0 * rate_hz) as u64);
    assert_eq!(angles, 16, "joints are read meanwhile");
    let allocated = of_thread(tick) - before;
    daemon.stop().unwrap();
    allocated
}

#[test]
fn the_tick_thread_allocates_nothing() {
    let servos = ServoPty::open(ServoBus::new((1..=16).map(ServoBuild::new), 1_000_000)).unwrap();
    let joints = JointsConfig::dynamixel(servos.path(), 1..=16);
    let allocated = allocations_per_run(TickMode::Timer, 100.0, joints);
    assert_eq!(allocated, 0, "timer mode, with servos");

    let folder = tempfile::tempdir().unwrap();
    let recording = format!("log:{}", recorded_hand(folder.path()).display());
    let joints = JointsConfig::new(JointSource::Allegro(AllegroSource {
        bus: recording.parse().unwrap(),
        hand: Some(AllegroConfig::new(4)),
    }));
    let allocated = allocations_per_run(TickMode::Sweep, 30.0, joints);
    assert_eq!(allocated, 0, "sweep mode, with an Allegro hand");
}
