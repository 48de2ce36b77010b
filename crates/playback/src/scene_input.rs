//! A scene as a recording: what a simulated hand goes through, once, with the angles of its joints.

use crate::pipeline::{Emit, emit_at, pipeline};
use std::f64::consts::TAU;
use taxel_can::Received;
use taxel_config::Config;
use taxel_sim::servo::servos_of_scene;
use taxel_sim::{Scene, Simulator};

/// Simulated at once.
const STEP_NS: u64 = 10_000_000;
/// A servo's pulses in a turn, and where its joint is at 0.
const PULSES: f64 = 4096.0;
const ZERO: f64 = 2048.0;

/// Plays the scene through the daemon's pipeline, ticks as configured.
pub fn run(scene: &Scene, config: &Config, emit: &mut Emit<'_>) -> anyhow::Result<()> {
    let mut simulator = Simulator::new(scene, &config.layout, scene.seed())?;
    simulator.start_all();
    let servos = servos_of_scene(scene, &config.layout, 0);
    let angles_at = |t_ns: u64| -> Vec<f32> {
        let positions = servos.iter().map(|servo| servo.build.motion.position(t_ns));
        positions
            .map(|pulses| ((pulses - ZERO) * TAU / PULSES) as f32)
            .collect()
    };
    pipeline(
        &config.engine(false)?,
        traffic(simulator, scene.length_ns()),
        &mut |felt| emit_at(emit, felt.force.t_ns, &angles_at(felt.force.t_ns), felt),
    )
}

/// What the joints of the scene are called, in the order of their angles.
pub fn joint_names(scene: &Scene, config: &Config) -> Vec<String> {
    let servos = servos_of_scene(scene, &config.layout, 0);
    servos.into_iter().map(|servo| servo.name).collect()
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
