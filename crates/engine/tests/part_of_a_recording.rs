//! A part of a recording, which may begin in a grasp, goes on from what was calibrated before it.

use std::ops::ControlFlow;
use taxel_can::Received;
use taxel_engine::{EngineConfig, Frames, run_recorded};
use taxel_sim::{Scene, Simulator};
use taxel_skin::{Calibrated, Layout};

/// Ticks until each taxel of a part has been heard.
const FIRST_TICKS: usize = 2;

fn felt(config: &EngineConfig, frames: &[(u8, Received)]) -> Vec<Frames> {
    let mut felt = Vec::new();
    run_recorded(config, frames.iter().copied(), None, |frames| {
        felt.push(frames.clone());
        ControlFlow::Continue(())
    })
    .unwrap();
    felt
}

#[test]
fn every_part_feels_the_contacts_that_the_whole_recording_feels_there() {
    // At 2/6 taxels of the faulty hand are pressed so far that nobody can tell from one frame which way.
    for (name, begins) in [
        ("ball-grasp", &[1, 2, 3, 4, 5][..]),
        ("faulty-hand", &[1, 3, 4, 5]),
    ] {
        let scene = Scene::builtin(name).unwrap();
        let layout = Layout::builtin(scene.layout()).unwrap();
        let mut simulator = Simulator::new(&scene, &layout, 1).unwrap();
        simulator.start_all();
        let mut frames = Vec::new();
        simulator.advance(scene.length_ns(), &mut frames);
        let mut config = EngineConfig::new(layout);
        config.tick.rate_hz = 50.0;
        let whole = felt(&config, &frames);
        let mut begun_in_contact = 0;
        for sixth in begins {
            let from = &whole[whole.len() * sixth / 6];
            begun_in_contact += usize::from(from.force.contacts() > 0);
            let calibrated = Calibrated {
                threshold: f64::from(from.force.threshold as f32),
                baseline: from.baseline.clone(),
                contact: from.force.contact.clone(),
                faults: from.force.faults.clone(),
            };
            let part_config = EngineConfig {
                calibrated: Some(calibrated),
                ..config.clone()
            };
            let start_ns = from.due_ns;
            let behind = frames.iter().filter(|(_, received)| received.t_ns >= start_ns);
            let part: Vec<(u8, Received)> = behind
                .map(|(bus, received)| {
                    let t_ns = received.t_ns - start_ns;
                    (*bus, Received { t_ns, ..*received })
                })
                .collect();
            let part = felt(&part_config, &part);
            assert!(
                part.len() > 50,
                "{name}, from {start_ns} ns: {} ticks",
                part.len()
            );
            for part in part.iter().skip(FIRST_TICKS) {
                let due_ns = part.due_ns + start_ns;
                let whole = whole.iter().find(|whole| whole.due_ns == due_ns).unwrap();
                assert!(!part.force.calibrating);
                let forces = part.force.force.iter().zip(&whole.force.force);
                let contacts = part.force.contact.iter().zip(&whole.force.contact);
                for (taxel, (contacts, forces)) in contacts.zip(forces).enumerate() {
                    // Its baseline waits anew until it follows drift, so that a force at a threshold may be on either side.
                    let release = config.conditioning.threshold_release;
                    let band = 0.99 * release..1.01;
                    let is_between = band.contains(&(forces.0 / whole.force.threshold))
                        && (forces.0 - forces.1).abs() < 5.0;
                    assert!(
                        contacts.0 == contacts.1 || is_between,
                        "{name}, from {start_ns} ns, at {due_ns} ns: taxel {taxel}, {contacts:?}, {forces:?}"
                    );
                }
            }
        }
        assert!(begun_in_contact > 0, "{name}");
    }
}
