//! Ten displays on one hand, each against a compressor of its own.

use crate::{config, connect, eventually, hand, of, profiles, state};
use serde_json::json;
use std::collections::BTreeMap;
use std::io::BufWriter;
use taxel_can::{LogWriter, Received};
use taxel_compress::Compressor;
use taxel_engine::{Engine, Frames};
use taxel_hand::{Faults, ForceFrame, Grey, Method, Profile, TactileImage};
use taxel_sim::{Scene, Simulator};
use taxel_skin::Layout;
use taxel_wire::{Header, ImageView, ReadError};
use taxeld::{Config, Daemon};
use tempfile::TempDir;

/// Ten displays as different as displays are: the daemon's own, and nine others.
fn ten_displays() -> Vec<(Option<Profile>, Option<&'static [&'static str]>)> {
    let optimal = |levels, actuators| Profile {
        method: Method::Optimal,
        ..of(levels, actuators)
    };
    vec![
        (None, None),
        (Some(of(4, 5)), None),
        (Some(of(8, 16)), None),
        (
            Some(Profile {
                parts_apart: true,
                ..optimal(4, 5)
            }),
            None,
        ),
        (
            Some(Profile {
                grey: Grey::Centroid,
                ..of(8, 16)
            }),
            None,
        ),
        (
            Some(Profile {
                codebook: vec![300.0, 900.0, 2700.0],
                ..of(3, 8)
            }),
            None,
        ),
        (
            Some(Profile {
                level_hysteresis: 0.2,
                ..optimal(8, 16)
            }),
            None,
        ),
        (Some(optimal(8, 16)), Some(&["thumb"])),
        (Some(of(16, 32)), Some(&["thumb", "index"])),
        (
            Some(Profile {
                history: 1.0,
                force_weighted: true,
                ..optimal(32, 4)
            }),
            None,
        ),
    ]
}

/// A scene in which nothing is touched until ten displays have connected, however busy the machine is.
const SCENE: &str = r#"
name = "late touch"
about = "Pressure travels over the whole hand after a long rest."
seconds = 11.0
[[contact]]
shape = "flat"
on = ["all"]
radius = 30.0
force_n = [[7.0, 0.0], [7.5, 0.8], [8.5, 1.2], [9.5, 0.4], [10.0, 0.0]]
[[contact]]
shape = "bump"
on = ["all"]
radius = 7.0
path = [[0.0, 2.0, 2.0], [7.0, 2.0, 2.0], [9.0, 13.0, 5.0], [10.0, 5.0, 13.0], [11.0, 7.5, 7.5]]
force_n = [[7.0, 0.0], [7.5, 4.0], [9.5, 4.0], [10.5, 0.0]]
"#;

/// A recording of the scene, and its frames as the recording has them: in whole microseconds from the first.
fn record(folder: &TempDir) -> (String, Vec<(u8, Received)>) {
    let layout = hand();
    let scene = folder.path().join("scene.toml");
    std::fs::write(&scene, SCENE).unwrap();
    let scene = Scene::load(&scene).unwrap();
    let mut simulator = Simulator::new(&scene, &layout, 1).unwrap();
    simulator.start_all();
    let mut frames = Vec::new();
    simulator.advance(scene.length_ns(), &mut frames);
    let first_us = frames.iter().map(|(_, r)| r.t_ns).min().unwrap() / 1000;
    let path = folder.path().join("recording.log");
    let mut log = LogWriter::new(BufWriter::new(std::fs::File::create(&path).unwrap()));
    for (bus, received) in &mut frames {
        let interface = &layout.buses[usize::from(*bus)];
        log.write(received.t_ns, interface, &received.frame).unwrap();
        received.t_ns = (received.t_ns / 1000 - first_us) * 1000;
    }
    log.flush().unwrap();
    (path.display().to_string(), frames)
}

/// The force frame as a region of the hand feels it, written without looking at how the daemon does it.
fn restrict(force: &ForceFrame, layout: &Layout, parts: &[&str]) -> ForceFrame {
    let mut inside = force.clone();
    for taxel in 0..layout.len() {
        if !parts.contains(&layout.module_of(taxel).part.as_str()) {
            inside.contact[taxel] = false;
            inside.faults[taxel] = Faults::NONE;
            inside.repaired[taxel] = false;
            inside.saturated[taxel] = false;
        }
    }
    inside
}

/// Images as they come over the wire, by sequence number.
type Images = BTreeMap<u64, TactileImage>;

/// What compressors of their own make of the same force frames, for each display.
fn offline(config: &Config, frames: &[(u8, Received)]) -> Vec<Images> {
    let layout = &config.layout;
    let displays = ten_displays();
    let mut compressors: Vec<Compressor> = (displays.iter())
        .map(|(profile, _)| profile.as_ref().unwrap_or(&config.profile))
        .map(|profile| Compressor::new(profile.clone(), layout).unwrap())
        .collect();
    let mut images = vec![Images::new(); displays.len()];
    let mut engine = Engine::new(&config.engine(false).unwrap(), 0).unwrap();
    let mut emit = |frames: &Frames| {
        for (((_, region), compressor), images) in displays.iter().zip(&mut compressors).zip(&mut images) {
            let force = match region {
                Some(parts) => restrict(&frames.force, layout, parts),
                None => frames.force.clone(),
            };
            let mut image = compressor.new_image();
            compressor.compress(&force, &mut image);
            let mut payload = Vec::new();
            taxel_wire::encode_image_payload(&image, &mut payload).unwrap();
            let header = Header::of_image(&image, payload.len());
            images.insert(image.seq, ImageView::decode(&payload).unwrap().to_image(&header));
        }
    };
    for (bus, received) in frames {
        engine.handle_frame(*bus, received);
        engine.drain(&mut emit);
    }
    images
}

#[test]
fn ten_different_displays_on_one_hand_each_get_what_a_compressor_of_their_own_makes() {
    let (folder, mut config) = config("sim:idle");
    let (path, frames) = record(&folder);
    for (source, bus) in config.sources.iter_mut().zip(&config.layout.buses) {
        *source = format!("log:{path}?interface={bus}").parse().unwrap();
    }
    let expected = offline(&config, &frames);
    let touched = expected[0].values().find(|image| image.contacts > 0).unwrap().seq;

    let daemon = Daemon::start(config.clone()).unwrap();
    let readers: Vec<_> = (ten_displays().into_iter())
        .map(|(profile, region)| {
            let config = config.clone();
            std::thread::spawn(move || {
                let mut subscriber = connect(&config);
                let hello = match (&profile, region) {
                    (None, None) => subscriber.hello().unwrap().clone(),
                    _ => state(&mut subscriber, profile, region).unwrap(),
                };
                let mut images = Images::new();
                loop {
                    match subscriber.next() {
                        Ok(taxel_wire::Received::Image(header, image)) => {
                            images.insert(header.seq, image.to_image(&header));
                        }
                        Ok(_) => {}
                        Err(ReadError::Closed) => return (hello, images),
                        Err(error) => panic!("{error}"),
                    }
                }
            })
        })
        .collect();
    eventually("ten profiles are made", || profiles(&config).len() == 10);
    // The same display twice: both are shown one profile.
    let mut twin = connect(&config);
    let (profile, region) = ten_displays().swap_remove(7);
    state(&mut twin, profile, region).unwrap();
    let shared = profiles(&config);
    assert_eq!(shared.len(), 10, "{shared:?}");
    let of_two: Vec<_> = shared.iter().filter(|p| p["subscribers"] == 2).collect();
    assert_eq!(of_two.len(), 1, "{shared:?}");
    assert_eq!(of_two[0]["region"], json!(["thumb"]));
    assert_eq!(
        shared.iter().filter(|p| p["subscribers"] == 1).count(),
        9,
        "{shared:?}"
    );

    eventually("the recording has ended", || !daemon.is_running());
    println!(
        "{}",
        json!(shared.iter().map(|p| &p["cost_us"]).collect::<Vec<_>>())
    );
    for (display, (reader, expected)) in readers.into_iter().zip(&expected).enumerate() {
        let (hello, images) = reader.join().unwrap();
        let (profile, region) = &ten_displays()[display];
        let stated = profile.as_ref().unwrap_or(&config.profile);
        assert_eq!(hello.profile, stated.into(), "display {display}");
        assert_eq!(hello.region.is_some(), region.is_some(), "display {display}");
        // Compressors remember; the daemon's began where nothing had been touched yet.
        let first = *images.keys().next().unwrap();
        assert!(
            first < touched,
            "display {display} came too late: {first} of {touched}"
        );
        let shown = images.values().filter(|image| image.contacts > 0).count();
        assert!(shown > 40, "display {display}: {shown} images with contacts");
        for (seq, image) in &images {
            assert_eq!(*image, expected[seq], "display {display}, image {seq}");
        }
    }
}
