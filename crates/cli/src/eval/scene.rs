//! The frames of a scene, whose truth is known.

use super::{Args, Frames, gathered};
use taxel_eval::{Sequence, contact_truth};
use taxel_playback::scene_input;
use taxel_sim::{Scene, Simulator};
use taxeld::Config;

/// Plays a scene once through the daemon's pipeline, ticks as configured, and compares contacts
/// with its truth.
pub(super) fn frames(name: &str, args: &Args) -> anyhow::Result<(Frames, Config)> {
    let scene = Scene::resolve(name)?;
    let mut config = args.offline.configure_scene(&scene)?;
    args.condition(&mut config);
    let sequence = gathered(&config, |emit| scene_input::run(&scene, &config, emit))?;
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
