//! The frames of a scene, whose truth is known.

use super::{Frames, empty};
use crate::offline::{OfflineArgs, pipeline};
use taxel_can::Received;
use taxel_eval::{Sequence, contact_truth};
use taxel_sim::{Scene, Simulator};
use taxeld::Config;

/// Simulated at once.
const STEP_NS: u64 = 10_000_000;

/// Plays a scene once through the daemon's pipeline, ticks as configured, and compares contacts
/// with its truth.
pub(super) fn frames(name: &str, offline: &OfflineArgs) -> anyhow::Result<(Frames, Config)> {
    let scene = Scene::resolve(name)?;
    let config = offline.configure_for(scene.layout())?;
    let mut simulator = Simulator::new(&scene, &config.layout, scene.seed())?;
    simulator.start_all();
    let traffic = traffic(simulator, scene.length_ns());
    let mut sequence = empty(&config);
    pipeline(&config, traffic, &mut |tactile, force, _| {
        sequence.tactile.extend(tactile.cloned());
        sequence.force.push(force.clone());
        Ok(())
    })?;
    let simulator = Simulator::new(&scene, &config.layout, scene.seed())?;
    let truth = Some(contact_truth(&sequence, truth(&simulator, &sequence)));
    let name = format!("sim:{name}");
    Ok((
        Frames {
            name,
            sequence,
            truth,
        },
        config,
    ))
}

/// Everything that the buses carry during the scene.
fn traffic(mut simulator: Simulator, length_ns: u64) -> impl Iterator<Item = (u8, Received)> {
    let steps = (0..length_ns).step_by(STEP_NS as usize);
    steps.flat_map(move |from_ns| {
        let mut frames = Vec::new();
        simulator.advance((from_ns + STEP_NS).min(length_ns), &mut frames);
        frames
    })
}

/// The force on a taxel when its sample in a frame was taken, as nearly as its age tells.
fn truth<'a>(simulator: &'a Simulator, sequence: &'a Sequence) -> impl FnMut(usize, usize) -> f64 + 'a {
    let mut forces = vec![0.0; sequence.layout.len()];
    let mut at_ns = None;
    move |frame, taxel| {
        let tactile = &sequence.tactile[frame];
        let t_ns = tactile.t_ns.saturating_sub(tactile.age_ns[taxel]);
        if at_ns != Some(t_ns) {
            simulator.truth(t_ns, &mut forces);
            at_ns = Some(t_ns);
        }
        forces[taxel]
    }
}
