//! A simulated bus behind the CAN source seam, and the promise of equal bytes.

use crate::support::{boards, scene};
use taxel_can::{CanFrame, CanSource, LinkState, Received, SendError};
use taxel_sim::{Scene, SimOptions, SimSource, Simulator};
use taxel_skin::Layout;

const START_NS: u64 = 7_000_000_000;

fn options() -> SimOptions {
    SimOptions {
        start_ns: START_NS,
        autostart: true,
        looping: false,
        ..SimOptions::default()
    }
}

/// FNV-1a over bus, time and bytes of every frame.
fn hash(frames: &[(u8, Received)]) -> u64 {
    let mut h = 0xCBF2_9CE4_8422_2325u64;
    let mut eat = |bytes: &[u8]| {
        for b in bytes {
            h = (h ^ u64::from(*b)).wrapping_mul(0x100_0000_01B3);
        }
    };
    for (bus, r) in frames {
        eat(&[*bus, r.frame.dlc()]);
        eat(&r.t_ns.to_le_bytes());
        eat(&r.frame.raw_id().to_le_bytes());
        eat(r.frame.data());
    }
    h
}

fn play(name: &str, seed: u64, until_ns: u64) -> Vec<(u8, Received)> {
    let scene = Scene::builtin(name).unwrap();
    let layout = Layout::builtin("allegro-uskin-15").unwrap();
    let mut sim = Simulator::new(&scene, &layout, seed).unwrap();
    sim.start_all();
    let mut frames = Vec::new();
    sim.advance(until_ns, &mut frames);
    frames
}

#[test]
fn the_same_scene_and_seed_give_the_same_bytes_everywhere() {
    // Pinned: a change here is a change of every recording made from these scenes, on purpose or not.
    let cases = [
        ("tap", 1, 0xE306_CC01_0195_D0AAu64),
        ("tap", 2, 0xA480_8BE2_06A3_5487),
        ("ball-grasp", 1, 0xF3B4_CBC0_07D2_9EC4),
        ("faulty-hand", 1, 0x24F1_A601_9E2E_3B38),
    ];
    for (name, seed, pinned) in cases {
        let got = hash(&play(name, seed, 9_000_000_000));
        assert_eq!(got, pinned, "{name}, seed {seed}: {got:#018X}");
    }
}

#[test]
fn how_time_is_cut_does_not_matter() {
    let layout = Layout::builtin("allegro-uskin-15").unwrap();
    let scene = Scene::builtin("faulty-hand").unwrap();
    let whole = play("faulty-hand", 1, 6_000_000_000);
    let mut sim = Simulator::new(&scene, &layout, 1).unwrap();
    sim.start_all();
    let mut pieces = Vec::new();
    let (mut t_ns, mut step_ns) = (0, 1);
    while t_ns < 6_000_000_000 {
        t_ns = (t_ns + step_ns).min(6_000_000_000);
        step_ns = step_ns * 7 % 9_999_991 + 1;
        sim.advance(t_ns, &mut pieces);
    }
    assert!(whole == pieces, "{} and {} frames", whole.len(), pieces.len());
}

#[test]
fn a_source_delivers_its_bus_of_the_whole_hand_without_growing_the_batch() {
    let layout = Layout::builtin("allegro-uskin-15").unwrap();
    let scene = Scene::builtin("ball-grasp").unwrap();
    let whole = play("ball-grasp", scene.seed(), 500_000_000);
    for bus in 0..2u8 {
        let mut source = SimSource::new(&scene, &layout, bus, options()).unwrap();
        let mut batch = Vec::with_capacity(64);
        let mut frames = Vec::new();
        let mut now_ns = START_NS;
        while let Some(at_ns) = source.wakeup().at_ns.filter(|t| *t <= START_NS + 500_000_000) {
            assert!(
                at_ns >= now_ns + 500_000 || now_ns == START_NS,
                "woken too often: {now_ns} then {at_ns}"
            );
            now_ns = at_ns;
            loop {
                let more = source.receive(now_ns, &mut batch);
                assert!(batch.capacity() == 64 && batch.iter().all(|r| r.t_ns <= now_ns));
                frames.append(&mut batch);
                if !more {
                    break;
                }
            }
        }
        let expected: Vec<_> = whole.iter().filter(|(b, _)| *b == bus).collect();
        assert!(
            expected.len().abs_diff(frames.len()) < 8,
            "{} of {}",
            frames.len(),
            expected.len()
        );
        for ((_, e), f) in expected.into_iter().zip(&frames) {
            assert_eq!((e.t_ns + START_NS, e.frame), (f.t_ns, f.frame));
        }
        assert_eq!(source.counters().received, frames.len() as u64);
        assert_eq!(source.link(), LinkState::Up);
    }
}

#[test]
fn commands_through_a_source_start_boards_and_a_full_queue_is_reported() {
    let layout = boards("uskin-l2", &[3]);
    let idle = scene(60, "");
    let waiting = SimOptions {
        autostart: false,
        ..options()
    };
    let mut source = SimSource::new(&idle, &layout, 0, waiting).unwrap();
    let mut batch = Vec::with_capacity(4096);
    assert!(!source.receive(START_NS + 1_000_000_000, &mut batch));
    assert!(batch.is_empty() && source.wakeup().at_ns.is_none());
    let start = CanFrame::standard(0x203, &[0x07, 0x00]).unwrap();
    source.send(&start).unwrap();
    assert!(source.wakeup().at_ns.is_some());
    source.receive(START_NS + 2_000_000_000, &mut batch);
    assert!(batch.len() > 700, "{}", batch.len());
    assert!(
        batch.iter().all(|r| r.frame.id() != 0x203 || r.frame.dlc() == 8),
        "own frames are not received"
    );
    let failed = (0..100).find_map(|_| source.send(&start).err());
    assert!(matches!(failed, Some(SendError::QueueFull)));
    assert_eq!(source.counters().send_failures, 1);
}

#[test]
fn jitter_delays_frames_and_keeps_their_order() {
    let layout = boards("uskin-l2", &[3, 4]);
    let idle = scene(60, "");
    let receive = |jitter_ns| {
        let mut source = SimSource::new(
            &idle,
            &layout,
            0,
            SimOptions {
                jitter_ns,
                ..options()
            },
        )
        .unwrap();
        let mut batch = Vec::with_capacity(4096);
        source.receive(START_NS + 1_000_000_000, &mut batch);
        batch
    };
    let (steady, late) = (receive(0), receive(300_000));
    assert!(late.windows(2).all(|w| w[0].t_ns <= w[1].t_ns));
    assert!(steady.len() - late.len() < 4);
    let mut delayed = 0;
    for (s, l) in steady.iter().zip(&late) {
        assert_eq!(s.frame, l.frame);
        assert!((s.t_ns..=s.t_ns + 300_000).contains(&l.t_ns));
        delayed += usize::from(l.t_ns > s.t_ns + 50_000);
    }
    assert!(delayed > steady.len() / 2, "{delayed} of {}", steady.len());
}

#[test]
fn a_scene_ends_once_or_begins_again() {
    let layout = boards("uskin-l2", &[3]);
    let short = scene(
        2,
        "[[contact]]\nshape = \"flat\"\non = [\"all\"]\nradius = 9\nforce_counts = [[0.5, 0], [0.6, 5000], [1.4, 5000], [1.5, 0]]\n\
         [[fault]]\nkind = \"silent\"\non = [\"m3\"]\nfrom = 1.6\nto = 1.8\n",
    );
    let mut batch = Vec::with_capacity(100_000);
    let mut once = SimSource::new(&short, &layout, 0, options()).unwrap();
    once.receive(START_NS + 1_000_000_000, &mut batch);
    assert!(!once.is_finished());
    once.receive(START_NS + 9_000_000_000, &mut batch);
    assert!(once.is_finished() && once.wakeup().at_ns.is_none());
    let played = batch.len();

    batch.clear();
    let mut again = SimSource::new(
        &short,
        &layout,
        0,
        SimOptions {
            looping: true,
            ..options()
        },
    )
    .unwrap();
    again.receive(START_NS + 8_000_000_000, &mut batch);
    assert!(!again.is_finished());
    assert!(
        (batch.len() as i64 - 4 * played as i64).abs() < 4 * 32,
        "{} and {played}",
        batch.len()
    );
    let z = |from_ms: u64| {
        let t_ns = START_NS + from_ms * 1_000_000;
        let frame = batch
            .iter()
            .find(|r| r.t_ns >= t_ns && r.frame.id() == 0x300)
            .unwrap()
            .frame;
        u16::from_be_bytes([frame.data()[5], frame.data()[6]])
    };
    for round in 0..4 {
        assert!(
            z(round * 2000 + 200) < 14_000 && z(round * 2000 + 1000) > 16_000,
            "round {round}"
        );
        let gap = |r: &&Received| {
            let ms = (r.t_ns - START_NS) / 1_000_000;
            (round * 2000 + 1605..round * 2000 + 1795).contains(&ms)
        };
        assert_eq!(batch.iter().filter(gap).count(), 0, "round {round}");
    }
}

#[test]
fn values_look_like_the_recordings_and_wrap_on_overload() {
    let frames = play("idle", 1, 4_000_000_000);
    let mut sums = std::collections::BTreeMap::<(u8, u32), (f64, [f64; 3], [f64; 3])>::new();
    for (bus, r) in &frames {
        let entry = sums.entry((*bus, r.frame.id())).or_default();
        entry.0 += 1.0;
        for axis in 0..3 {
            let v = f64::from(u16::from_be_bytes([
                r.frame.data()[1 + 2 * axis],
                r.frame.data()[2 + 2 * axis],
            ]));
            entry.1[axis] += v;
            entry.2[axis] += v * v;
        }
    }
    assert_eq!(sums.len(), 240);
    // docs/protocols.md, "uSkin values": idle level and noise deviation of LOG7.
    let expected = [
        (32_690.0..32_880.0, 1.5..3.2),
        (32_570.0..32_865.0, 3.0..5.8),
        (12_290.0..13_410.0, 9.5..53.0),
    ];
    for (taxel, (n, sum, squares)) in sums {
        for axis in 0..3 {
            let mean = sum[axis] / n;
            let sd = (squares[axis] / n - mean * mean).sqrt();
            let (idle, noise) = &expected[axis];
            assert!(
                idle.contains(&mean) && noise.contains(&sd),
                "{taxel:?} axis {axis}: {mean} +- {sd}"
            );
        }
    }

    let layout = boards("uskin-l2", &[3]);
    let press = scene(
        2,
        "[[contact]]\nshape = \"flat\"\non = [\"all\"]\nradius = 9\nforce_counts = [[0, 0], [2, 62000]]\n",
    );
    let mut source = SimSource::new(&press, &layout, 0, options()).unwrap();
    let mut batch = Vec::with_capacity(4096);
    source.receive(START_NS + 2_000_000_000, &mut batch);
    let z: Vec<u16> = batch
        .iter()
        .filter(|r| r.frame.id() == 0x300)
        .map(|r| u16::from_be_bytes([r.frame.data()[5], r.frame.data()[6]]))
        .collect();
    let wraps = z.windows(2).filter(|w| w[0] > 60_000 && w[1] < 5_000).count();
    assert_eq!(wraps, 1, "{z:?}");
}
