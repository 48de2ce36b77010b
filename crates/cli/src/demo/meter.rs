//! What the demo's subscriber has seen of the scene that is played.

use super::palpation::Palpation;
use crate::view::{lock, object};
use serde_json::json;
use std::sync::{Mutex, OnceLock};
use taxel_hand::plural;
use taxel_sim::Scene;
use taxel_skin::Layout;
use taxel_view::{Heading, Seen};

/// Everything seen so far, and what is played.
pub(super) struct Meter {
    scene: String,
    about: String,
    scene_seconds: f64,
    scene_began_ns: u64,
    /// Name of the hand, and what carries its frames.
    hand: String,
    pub(super) seen: Mutex<Seen>,
    /// Where touches fell, where a phantom is palpated.
    pub(super) palpation: Option<Mutex<Palpation>>,
    /// The connection is over, and why, unless the daemon has closed it.
    pub(super) end: OnceLock<Option<String>>,
}

impl Meter {
    /// Of a hand on which the scene began at this time on the images' clock, nanoseconds.
    pub(super) fn new(
        layout: &Layout,
        scene_began_ns: u64,
        scene: &Scene,
        palpation: Option<Palpation>,
    ) -> Self {
        let buses = match layout.buses.len() {
            1 => "1 bus".into(),
            buses => format!("{buses} buses"),
        };
        Self {
            scene: scene.name().into(),
            about: scene.about().into(),
            scene_seconds: scene.seconds(),
            scene_began_ns,
            hand: format!("{}, {} on {buses}", layout.name, plural(layout.len(), "taxel")),
            seen: Mutex::default(),
            palpation: palpation.map(Mutex::new),
            end: OnceLock::new(),
        }
    }

    /// The scene and how far it is.
    pub(super) fn heading(&self, seen: &Seen) -> Heading {
        let played_s = seen.t_ns().saturating_sub(self.scene_began_ns) as f64 / 1e9;
        Heading {
            name: format!("scene {}", self.scene),
            detail: format!(
                "{:4.1} of {:.1} s",
                played_s % self.scene_seconds,
                self.scene_seconds
            ),
            about: self.about.clone(),
        }
    }

    /// Tells whoever is looking what happened by itself; the daemon's end is the demo's, and nothing to tell.
    pub(super) fn tell(&self, words: String) {
        if self.end.get().is_none() {
            lock(&self.seen).tell(words, taxel_can::monotonic_ns());
        }
    }

    /// The whole run as one JSON object.
    pub(super) fn object(&self) -> anyhow::Result<String> {
        let palpation = self.palpation.as_ref().map(lock);
        let touches = palpation.map_or(json!({}), |palpation| json!({ "touches": palpation.figures() }));
        object(
            &lock(&self.seen),
            &self.scene,
            (self.scene_began_ns, None),
            touches,
        )
    }

    /// The whole run in a few lines.
    pub(super) fn summary(&self) -> String {
        let seen = lock(&self.seen);
        let display = match seen.hello().map(|hello| &hello.profile) {
            Some(profile) => format!(
                "method {}, {}, {}",
                profile.method,
                plural(profile.levels, "level"),
                plural(profile.actuators, "actuator")
            ),
            None => "no display".into(),
        };
        let touches = self
            .palpation
            .as_ref()
            .map(|palpation| lock(palpation).summary())
            .unwrap_or_default();
        format!(
            "{}: {}; {display}\n{}{touches}",
            self.scene,
            self.hand,
            seen.summary(self.scene_began_ns, None)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_heading_tells_the_scene_and_the_summary_the_hand() {
        let layout = Layout::builtin("allegro-uskin-15").unwrap();
        let scene = Scene::builtin("tap").unwrap();
        let meter = Meter::new(&layout, 1_000_000_000, &scene, None);
        let heading = meter.heading(&lock(&meter.seen));
        assert_eq!(heading.name, "scene tap");
        assert!(heading.detail.starts_with(" 0.0 of "), "{heading:?}");
        let summary = meter.summary();
        assert!(
            summary.starts_with("tap: allegro-uskin-15, 240 taxels on 2 buses; no display\n"),
            "{summary}"
        );
    }
}
