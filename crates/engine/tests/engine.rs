//! What the pipeline promises: the same frames give the same images, and each image is made at its
//! own instant.

use std::ops::ControlFlow;
use taxel_can::{CanFrame, Received};
use taxel_engine::{Display, Engine, EngineConfig, EngineJoints, Frames, TickMode, run_recorded};
use taxel_hand::{Freshness, Profile};
use taxel_sim::{Scene, Simulator};
use taxel_skin::Layout;

const NO_FRAMES: [(u8, Received); 0] = [];

fn config(mode: TickMode, rate_hz: f64) -> EngineConfig {
    let layout = Layout::builtin("allegro-uskin-15").unwrap();
    let mut config = EngineConfig::new(layout);
    config.tick.mode = mode;
    config.tick.rate_hz = rate_hz;
    config
}

/// The default display of a hand.
fn display(config: &EngineConfig) -> Display {
    Display::new(Profile::default(), None, &config.layout).unwrap()
}

fn scene(name: &str) -> Vec<(u8, Received)> {
    let scene = Scene::builtin(name).unwrap();
    let layout = Layout::builtin(scene.layout()).unwrap();
    let mut simulator = Simulator::new(&scene, &layout, 1).unwrap();
    simulator.start_all();
    let mut frames = Vec::new();
    simulator.advance(scene.length_ns(), &mut frames);
    frames
}

/// The bytes that subscribers are given, one after the other.
fn bytes(config: &EngineConfig, frames: &[(u8, Received)]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut payload = Vec::new();
    let mut display = display(config);
    run_recorded(config, frames.iter().copied(), None, |frames| {
        let image = display.compress(frames);
        taxel_wire::encode_image_payload(image, &mut payload).unwrap();
        bytes.extend(taxel_wire::Header::of_image(image, payload.len()).to_bytes());
        bytes.extend(&payload);
        taxel_wire::encode_raw_payload(&frames.tactile, &frames.force, None, &mut payload).unwrap();
        bytes.extend(&payload);
        ControlFlow::Continue(())
    })
    .unwrap();
    bytes
}

#[test]
fn a_recording_gives_the_same_bytes_every_time() {
    for name in ["ball-grasp", "faulty-hand"] {
        let frames = scene(name);
        for config in [config(TickMode::Timer, 30.0), config(TickMode::Sweep, 30.0)] {
            let first = bytes(&config, &frames);
            assert!(first.len() > 100_000, "{name}: only {} bytes", first.len());
            assert!(first == bytes(&config, &frames), "{name}: two runs differ");
        }
    }
}

/// However the daemon is scheduled, it hands frames over in pieces and asks for the ticks in between.
#[test]
fn frames_do_not_depend_on_how_often_the_pipeline_is_called() {
    let frames = scene("tap");
    let config = config(TickMode::Timer, 30.0);
    let collect = |step_ns: u64| {
        let mut engine = Engine::new(&config, 0).unwrap();
        let mut felt = Vec::new();
        let mut emit =
            |frames: &Frames| felt.push((frames.due_ns, frames.tactile.clone(), frames.force.clone()));
        let mut now_ns = 0;
        let mut rest = frames.as_slice();
        while !rest.is_empty() {
            now_ns += step_ns;
            while let Some(((bus, received), after)) =
                rest.split_first().filter(|((_, r), _)| r.t_ns <= now_ns)
            {
                engine.handle_frame(*bus, received);
                engine.drain(&mut emit);
                rest = after;
            }
            engine.handle_time(now_ns);
            engine.drain(&mut emit);
        }
        felt
    };
    let often = collect(300_000);
    let seldom = collect(70_000_000);
    let both = often.len().min(seldom.len());
    assert!(both > 200, "{both} ticks");
    assert!(often[..both] == seldom[..both]);
}

#[test]
fn timer_ticks_fall_on_whole_periods_and_a_frame_at_the_tick_belongs_to_it() {
    let mut config = config(TickMode::Timer, 100.0);
    config.sweep.settle_ms = 0.0;
    let mut engine = Engine::new(&config, 1_000).unwrap();
    let wiring = &config.layout.wiring[0];
    let frame = |z| {
        wiring
            .protocol
            .frame(wiring.board, 0, [32_000, 32_000, z], 0x80)
            .unwrap()
    };
    let mut ticks = Vec::new();
    let mut emit = |frames: &Frames| ticks.push((frames.due_ns, frames.tactile.counts[0][2]));
    let tick_ns = 1_000 + 10_000_000;
    engine.handle_frame(
        0,
        &Received {
            t_ns: tick_ns,
            frame: frame(1),
        },
    );
    engine.drain(&mut emit);
    engine.handle_frame(
        0,
        &Received {
            t_ns: tick_ns + 1,
            frame: frame(2),
        },
    );
    engine.drain(&mut emit);
    engine.handle_time(tick_ns + 10_000_000);
    engine.drain(&mut emit);
    assert_eq!(ticks, [(tick_ns, 1), (tick_ns + 10_000_000, 2)]);
}

#[test]
fn a_daemon_that_was_held_up_gives_up_old_ticks_and_counts_them() {
    let config = config(TickMode::Timer, 100.0);
    let mut engine = Engine::new(&config, 0).unwrap();
    let mut images = 0;
    let mut emit = |_: &Frames| images += 1;
    assert_eq!(engine.skip_overdue(10_000_000), 0);
    assert_eq!(engine.skip_overdue(55_000_000), 4);
    engine.handle_time(55_000_000);
    engine.drain(&mut emit);
    assert_eq!(images, 1, "only the newest of the five ticks");
}

#[test]
fn a_silent_hand_still_gives_images_that_say_so() {
    for mode in [TickMode::Timer, TickMode::Sweep] {
        let config = config(mode, 30.0);
        let mut missing = Vec::new();
        let mut display = display(&config);
        run_recorded(&config, NO_FRAMES, Some(1_000_000_000), |frames| {
            missing.push(display.compress(frames).missing);
            ControlFlow::Continue(())
        })
        .unwrap();
        assert!(
            missing.len() >= 9,
            "{mode:?}: {} images in a second",
            missing.len()
        );
        assert!(missing.iter().all(|m| *m == 240), "{mode:?}");
    }
}

#[test]
fn whoever_breaks_off_is_given_no_more_of_the_ticks_that_are_due_before_one_frame() {
    let config = config(TickMode::Timer, 1000.0);
    let mut after_a_pause = scene("tap")[0];
    after_a_pause.1.t_ns = 60_000_000_000;
    let mut ticks = 0;
    run_recorded(&config, [after_a_pause], None, |_| {
        ticks += 1;
        if ticks < 3 {
            ControlFlow::Continue(())
        } else {
            ControlFlow::Break(())
        }
    })
    .unwrap();
    assert_eq!(ticks, 3);
}

#[test]
fn a_board_that_falls_silent_is_missing_and_never_repeated() {
    let mut frames = scene("worst-case");
    let half_ns = frames.last().unwrap().1.t_ns / 2;
    // Board 1 of bus 0, index distal, stops in the middle.
    let silent = 16..32;
    frames.retain(|(bus, r)| !(*bus == 0 && r.frame.id() >> 8 == 1 && r.t_ns > half_ns));
    for mode in [TickMode::Timer, TickMode::Sweep] {
        let mut after = 0;
        let mut most_contacts = 0;
        let config = config(mode, 30.0);
        let layout = &config.layout;
        let mut display = display(&config);
        run_recorded(&config, frames.iter().copied(), None, |frames| {
            let image = display.compress(frames);
            if frames.due_ns > half_ns + 200_000_000 {
                after += 1;
                for taxel in silent.clone() {
                    assert_eq!(layout.module_of(taxel).name, "index distal");
                    assert_ne!(
                        frames.tactile.freshness[taxel],
                        Freshness::Fresh,
                        "{mode:?} taxel {taxel}"
                    );
                    assert!(
                        !frames.force.contact[taxel],
                        "{mode:?}: a stale taxel is no contact"
                    );
                }
                assert_eq!(image.missing, 16, "{mode:?}");
                most_contacts = most_contacts.max(image.contacts);
            }
            ControlFlow::Continue(())
        })
        .unwrap();
        assert!(
            after > 100,
            "{mode:?}: {after} images after the board fell silent"
        );
    }
}

#[test]
fn a_paused_hand_presses_nothing_and_a_rezeroed_hand_starts_anew() {
    let frames = scene("worst-case");
    let config = config(TickMode::Timer, 30.0);
    let mut engine = Engine::new(&config, 0).unwrap();
    let contacts = |engine: &Engine| engine.frames().force.contact.iter().filter(|c| **c).count();
    let mut rest = frames.iter();
    let mut play = |engine: &mut Engine, until: &dyn Fn(&Engine) -> bool| {
        while !until(engine) {
            let (bus, received) = rest.next().expect("the scene ends too soon");
            engine.handle_frame(*bus, received);
            engine.drain(&mut |_| ());
        }
    };
    assert!(
        engine.frames().force.calibrating,
        "there is no baseline before the first frame"
    );
    play(&mut engine, &|engine| contacts(engine) == 240);
    engine.set_paused(true);
    play(&mut engine, &|engine| contacts(engine) == 0);
    assert!(!engine.frames().force.calibrating);
    engine.set_paused(false);
    play(&mut engine, &|engine| contacts(engine) == 240);
    engine.rezero();
    play(&mut engine, &|engine| engine.frames().force.calibrating);
    assert_eq!(contacts(&engine), 0);
}

/// A module and an Allegro hand on one bus: each frame is that of one of them, and a frame has the
/// angles of its own instant.
#[test]
fn a_hand_on_the_skins_bus_gives_its_angles_and_nothing_to_the_skin() {
    let mut config = EngineConfig::new(Layout::builtin("uskin-module").unwrap());
    config.tick.rate_hz = 100.0;
    let joints = "source = \"allegro:can0\"\nallegro.version = 4\nhold_ms = 50.0\n";
    config.joints = Some(EngineJoints {
        config: toml::from_str(joints).unwrap(),
        bus: Some(0),
        is_read: false,
    });
    let mut engine = Engine::new(&config, 0).unwrap();
    const MS: u64 = 1_000_000;
    let count_rad = (333.3_f64 / 65_536.0).to_radians();
    let mut seen = Vec::new();
    let mut emit = |frames: &Frames| {
        let tactile = &frames.tactile;
        seen.push((tactile.t_ns, tactile.joints.clone(), tactile.joint_age_ns.clone()));
    };
    // The index finger moves by 100 counts a millisecond and reports every 4 ms, until it falls
    // silent at 100 ms.
    for ms in 0..200_u64 {
        let taxel = CanFrame::standard(0x710 | (ms % 16) as u16, &[0x80, 1, 2, 3, 4, 5, 6, 1]).unwrap();
        let received = |frame, t_ns| Received { t_ns, frame };
        if ms % 4 == 0 && ms < 100 {
            let [lo, hi] = (100 * ms as i16).to_le_bytes();
            let finger = CanFrame::standard(0x080, &[lo, hi, 0, 0, 0, 0, 0, 0]).unwrap();
            engine.handle_frame(0, &received(finger, ms * MS));
            engine.drain(&mut emit);
        }
        engine.handle_frame(0, &received(taxel, ms * MS + 1));
        engine.drain(&mut emit);
    }
    let decoder = engine.decoders()[0].counters();
    assert_eq!((decoder.unknown, decoder.not_data), (0, 0));
    assert!(seen.len() >= 19, "{}", seen.len());
    for (t_ns, joints, ages) in seen {
        let ms = t_ns as f64 / MS as f64;
        assert_eq!((joints.len(), ages.len()), (16, 16));
        assert!(
            joints[4].is_nan() && ages[4] == u64::MAX,
            "a finger that was never heard"
        );
        if ms < 100.0 {
            let truth = 100.0 * ms * count_rad;
            assert!(
                (f64::from(joints[0]) - truth).abs() < 1e-5,
                "{} at {ms} ms",
                joints[0]
            );
            assert!(ages[0] <= 4 * MS, "{}", ages[0]);
        } else {
            assert_eq!(ages[0], t_ns - 96 * MS);
            assert_eq!(joints[0].is_nan(), ages[0] > 50 * MS, "{ms} ms");
        }
    }
}
