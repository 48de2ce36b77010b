//! A row of a manifest.

use crate::recordings::own_clock::CLOCK_S;
use anyhow::{bail, ensure};
use taxel_sequence::Motion;

/// A row of a manifest: one touch, or all touches of a scene. Columns may be empty; `file` may not.
#[derive(Debug, Clone, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Row {
    #[serde(default)]
    pub(super) phantom: String,
    #[serde(default)]
    pub(super) motion: String,
    pub(super) depth: Option<f64>,
    pub(super) radius: Option<f64>,
    #[serde(default)]
    pub(super) area: String,
    #[serde(default)]
    pub(super) label: String,
    /// A recording, `FILE:ARRAY` for one array of an npz, or `sim:SCENE`.
    pub(super) file: String,
    /// Where in the file the touch begins, s; its whole length where it is empty.
    pub(super) time: Option<f64>,
    /// Where no row of its file has a time, the steps of the longest motion that any of them has: frames behind these are of
    /// no touch.
    #[serde(skip)]
    pub(super) longest: Option<usize>,
    /// When the next touch of its file begins, s.
    #[serde(skip)]
    pub(super) next: Option<f64>,
}

impl Row {
    /// How the touch was made, where it is said.
    ///
    /// # Errors
    /// Where that, or when the touch begins, cannot be.
    pub(super) fn motion(&self) -> anyhow::Result<Option<Motion>> {
        if let Some(time) = self.time.filter(|time| !CLOCK_S.contains(time)) {
            bail!(
                "time {time}; a touch begins at a number of seconds from 0 to {:.0}",
                CLOCK_S.end()
            );
        }
        let radius = self.radius.unwrap_or(0.0);
        let is_rotary = match self.motion.trim().to_lowercase().as_str() {
            "" => radius > 0.0,
            "vertical" => false,
            "rotary" => true,
            _ => bail!("motion {:?}; it is vertical or rotary", self.motion),
        };
        ensure!(
            is_rotary == (radius > 0.0),
            "a {} motion of radius {radius} mm; vertical is 0, rotary above it",
            self.motion
        );
        let motion = self.depth.map(|depth| Motion::new(depth, radius));
        Ok(motion.transpose()?)
    }
}
