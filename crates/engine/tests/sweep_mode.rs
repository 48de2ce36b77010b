//! Simulated hands through the pipeline in `sweep` mode, with nothing said about their rate.

use taxel_engine::{Engine, EngineConfig, TickMode};
use taxel_sim::{Scene, Simulator};
use taxel_skin::{BoardState, Layout};

const SECOND: u64 = 1_000_000_000;

/// What became of a scene. Images of the first second, in which boards settle, are not in `lacking`
/// and `oldest_ns`.
struct Played {
    engine: Engine,
    /// Times of images.
    images: Vec<u64>,
    /// Images that lacked a taxel.
    lacking: usize,
    /// Age of the oldest value in any image.
    oldest_ns: u64,
}

/// Plays a built-in scene whose boards send at `rate_hz` for `seconds`.
fn play(scene: &str, layout: &Layout, rate_hz: u32, seconds: u64) -> Played {
    let scene = Scene::builtin(scene).unwrap().with_rate_hz(rate_hz);
    let mut hand = Simulator::looping(&scene, layout, 1).unwrap();
    hand.start_all();
    let mut config = EngineConfig::new(layout.clone());
    config.tick.mode = TickMode::Sweep;
    let mut engine = Engine::new(&config, 0).unwrap();
    let (mut images, mut lacking, mut oldest_ns) = (Vec::new(), 0, 0);
    let mut frames = Vec::new();
    for second in 1..=seconds {
        frames.clear();
        hand.advance(second * SECOND, &mut frames);
        for (bus, received) in &frames {
            engine.handle_frame(*bus, received);
            engine.drain(&mut |outputs| {
                images.push(outputs.due_ns);
                if outputs.due_ns > SECOND {
                    lacking += usize::from(outputs.tactile.missing() > 0);
                    oldest_ns = outputs.tactile.age_ns.iter().copied().fold(oldest_ns, u64::max);
                }
            });
        }
    }
    Played {
        engine,
        images,
        lacking,
        oldest_ns,
    }
}

#[test]
fn a_hand_whose_buses_are_full_loses_nothing_and_gives_an_image_per_sweep() {
    let layout = Layout::builtin("allegro-uskin-15").unwrap();
    for scene in ["ball-grasp", "worst-case"] {
        let Played {
            engine,
            images,
            lacking,
            ..
        } = play(scene, &layout, 50, 30);
        assert_eq!(lacking, 0, "{scene}");
        assert!(
            (1450..=1500).contains(&images.len()),
            "{scene}: {} images",
            images.len()
        );
        for board in 0..layout.modules.len() as u16 {
            let counters = engine.sweep().board(board);
            let case = format!(
                "{scene}, {}: {counters:?}",
                layout.modules[usize::from(board)].name
            );
            assert_eq!(counters.state, BoardState::Streaming, "{case}");
            // Settling may end within a sweep.
            assert!(counters.missed < 16, "{case}");
            assert_eq!((counters.duplicate, counters.late), (0, 0), "{case}");
            assert!((1480..=1490).contains(&counters.sweeps), "{case}");
            assert!(
                counters.period_ns.unwrap().abs_diff(20_000_000) < 500_000,
                "{case}"
            );
        }
    }
}

#[test]
fn a_single_board_gives_every_image_at_the_end_of_its_burst() {
    let layout = Layout::builtin("uskin-module").unwrap();
    for rate_hz in [10, 50, 100] {
        let Played {
            engine,
            images,
            lacking,
            oldest_ns,
        } = play("idle", &layout, rate_hz, 10);
        assert_eq!(lacking, 0, "{rate_hz} Hz");
        // Four chips, one every 1.5 ms.
        assert!(
            oldest_ns < 6_000_000,
            "{rate_hz} Hz: an image has values {oldest_ns} ns old"
        );
        let period_ns = SECOND / u64::from(rate_hz);
        let steady = images.iter().position(|t| *t > SECOND).unwrap();
        assert!(
            images[steady..]
                .windows(2)
                .all(|pair| (pair[1] - pair[0]).abs_diff(period_ns) < period_ns / 20)
        );
        let counters = engine.sweep().board(0);
        assert_eq!(
            (counters.duplicate, counters.late, counters.missed < 16),
            (0, 0, true),
            "{counters:?}"
        );
    }
}
