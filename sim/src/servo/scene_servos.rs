//! The fingers of a scene: servos whose angles go with what the skin feels.
//!
//! A scene says only what touches the hand. A finger that is touched is taken to be closed, the
//! more the harder it is pressed; before and after, it closes and opens at a speed that a servo can
//! do.

use super::device::ServoBuild;
use super::motion::{Motion, Track};
use crate::scene::Scene;
use std::f64::consts::TAU;
use std::sync::Arc;
use taxel_skin::Layout;

/// Bits per second of the wire of simulated servos.
pub const SERVO_BAUD: u32 = 1_000_000;
/// Servos of one finger.
const PER_FINGER: usize = 4;
/// Most fingers: one bus carries 64 joints.
const MOST_FINGERS: usize = 16;
/// The part that no joint moves.
const PALM: &str = "palm";
/// Time between two points of a finger's way, nanoseconds.
const STEP_NS: u64 = 20_000_000;
/// How far a finger is closed when it just touches; pressed hardest it is closed altogether.
const TOUCHING: f64 = 0.8;
/// Time in which an open finger comes to touch, steps.
const CLOSING_STEPS: f64 = 35.0;

/// A servo of a finger.
#[derive(Debug, Clone)]
pub struct NamedServo {
    /// Name of its joint: the finger, and the joint's number from base to tip, such as `index 0`.
    pub name: String,
    /// The servo; its joint is at 0 where the servo is at 2048.
    pub build: ServoBuild,
}

/// Four servos for each finger (part of the layout but its palm, at most sixteen), with ids from 1 on, moved as
/// the scene has it, again and again from `start_ns` on. None where the layout is of one part: a patch of skin.
pub fn servos_of_scene(scene: &Scene, layout: &Layout, start_ns: u64) -> Vec<NamedServo> {
    let mut fingers: Vec<&str> = Vec::new();
    for module in &layout.modules {
        if !fingers.contains(&module.part.as_str()) {
            fingers.push(&module.part);
        }
    }
    if fingers.len() == 1 {
        fingers.clear();
    }
    fingers.retain(|part| *part != PALM);
    fingers.truncate(MOST_FINGERS);
    let mut servos = Vec::new();
    for (number, finger) in fingers.iter().enumerate() {
        let closed = closing(scene, layout, finger);
        for joint in 0..PER_FINGER {
            let positions = closed
                .iter()
                .map(|closed| 2048.0 + angle_rad(finger, number, joint, *closed) * 4096.0 / TAU)
                .collect();
            let track = Track::new(start_ns, STEP_NS, positions);
            servos.push(NamedServo {
                name: format!("{finger} {joint}"),
                build: ServoBuild {
                    motion: Motion::Track(Arc::new(track)),
                    ..ServoBuild::new((servos.len() + 1) as u8)
                },
            });
        }
    }
    servos
}

/// Angle of a joint, radians, for a finger that is closed so far, 0 to 1.
fn angle_rad(finger: &str, number: usize, joint: usize, closed: f64) -> f64 {
    let (open, way) = match (finger, joint) {
        ("thumb", 0) => (0.30, 0.90),
        ("thumb", 1) => (0.10, 0.40),
        ("thumb", 2) => (0.20, 0.70),
        ("thumb", _) => (0.20, 0.80),
        // Fingers spread when they open.
        (_, 0) => {
            let spread = 0.12 * (1.0 - (number % 3) as f64);
            (spread, -spread)
        }
        (_, 1) => (0.10, 1.10),
        (_, 2) => (0.20, 1.00),
        (_, _) => (0.15, 0.80),
    };
    open + way * closed
}

/// How far a finger is closed, 0 to 1, every [`STEP_NS`] of the scene.
fn closing(scene: &Scene, layout: &Layout, finger: &str) -> Vec<f64> {
    let touches = |name: &str| {
        name == "all"
            || name == finger
            || (layout.modules.iter()).any(|module| module.part == finger && module.name == name)
    };
    let steps = (scene.length_ns / STEP_NS).max(1) as usize;
    let force: Vec<f64> = (0..steps as u64)
        .map(|step| {
            let on_it = (scene.contacts.iter()).filter(|contact| contact.on.iter().any(|name| touches(name)));
            let forces = on_it.map(|contact| contact.force.at(step * STEP_NS)[0]);
            forces.fold(0.0, f64::max)
        })
        .collect();
    let hardest = force.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let mut closed: Vec<f64> = force
        .iter()
        .map(|force| match *force {
            force if force > 0.0 => TOUCHING + (1.0 - TOUCHING) * force / hardest,
            _ => 0.0,
        })
        .collect();
    // Twice around, since the scene begins anew where it ends.
    let slower = TOUCHING / CLOSING_STEPS;
    for step in (0..2 * steps).rev() {
        let next = closed[(step + 1) % steps];
        let here = &mut closed[step % steps];
        *here = here.max(next - slower);
    }
    for step in 1..2 * steps {
        let before = closed[(step - 1) % steps];
        let here = &mut closed[step % steps];
        *here = here.max(before - slower);
    }
    closed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grasp_closes_the_fingers_before_they_touch_and_opens_them_after() {
        let scene = Scene::builtin("ball-grasp").unwrap();
        let layout = Layout::resolve(scene.layout()).unwrap();
        let servos = servos_of_scene(&scene, &layout, 0);
        assert_eq!(servos.len(), 16);
        assert_eq!((servos[15].name.as_str(), servos[15].build.id), ("thumb 3", 16));
        let angle_at = |joint: usize, s: f64| {
            let position = servos[joint].build.motion.position((s * 1e9) as u64);
            (position - 2048.0) * TAU / 4096.0
        };
        for flexion in [5, 9] {
            let (open, touching, held) = (
                angle_at(flexion, 1.0),
                angle_at(flexion, 6.1),
                angle_at(flexion, 8.5),
            );
            assert!(open < 0.15, "{open}");
            assert!(touching > 0.9 && held > touching, "{touching} {held}");
            assert!(angle_at(flexion, 13.5) < 0.15);
        }
        // The index fingertip touches once before, alone.
        assert!(angle_at(1, 3.0) > 0.9 && angle_at(5, 3.0) < 0.15);
    }

    #[test]
    fn no_joint_is_faster_than_its_motor_whichever_the_scene() {
        for name in Scene::names().chain(Scene::objects()) {
            let scene = Scene::builtin(name).unwrap();
            let layout = Layout::resolve(scene.layout()).unwrap();
            for servo in servos_of_scene(&scene, &layout, 0) {
                let end_ns = 2 * scene.length_ns();
                for t_ns in (0..end_ns).step_by(10_000_000) {
                    let at = |t_ns| servo.build.motion.position(t_ns);
                    let pulses_per_s = (at(t_ns + 10_000_000) - at(t_ns)).abs() * 100.0;
                    // An XM430-W210 turns 77 times a minute without load.
                    assert!(
                        pulses_per_s < 77.0 / 60.0 * 4096.0,
                        "{name} {}: {pulses_per_s}",
                        servo.name
                    );
                }
            }
        }
    }

    #[test]
    fn fingers_have_servos_and_palms_and_patches_of_skin_have_none() {
        let scene = Scene::builtin("idle").unwrap();
        for name in Layout::builtin_names() {
            let layout = Layout::builtin(name).unwrap();
            let servos = servos_of_scene(&scene, &layout, 0);
            // One bus carries 64.
            assert!(servos.len() <= 64, "{name}");
            let one_part = layout.modules.iter().all(|m| m.part == layout.modules[0].part);
            assert_eq!(servos.is_empty(), one_part, "{name}");
            assert!(
                servos.iter().all(|servo| !servo.name.starts_with("palm")),
                "{name}"
            );
        }
    }
}
