//! A map and its categories in a file.

use super::touches::Set;
use super::values::Values;
use anyhow::{Context, ensure};
use serde::{Deserialize, Serialize};
use std::path::Path;
use taxel_palpation::Classifier;
use taxel_playback::output_file::OutputFile;
use taxel_sequence::Aligned;

/// A map in a file: categories, and how touches were put side by side.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MapFile {
    /// What it is of, for messages.
    pub(super) name: String,
    /// Depth and radius, mm; null where touches are aligned by time.
    pub(super) motion: Option<[f64; 2]>,
    /// How long the probe rests on each step, ms; null where there is a frame for each.
    pub(super) rest_ms: Option<f64>,
    pub(super) first: f64,
    pub(super) step: f64,
    pub(super) steps: usize,
    /// Values of a frame: one or three for each taxel.
    pub(super) values: usize,
    /// What they are; not in maps that were saved before it was kept.
    #[serde(default)]
    pub(super) values_are: Option<Values>,
    /// The layout of the hand, where it is known.
    #[serde(default)]
    pub(super) layout: Option<String>,
    /// The name of each category.
    pub(super) labels: Vec<Option<String>>,
    pub(super) classifier: Classifier,
}

impl MapFile {
    pub(super) fn new(
        set: &Set,
        aligned: &Aligned,
        labels: Vec<Option<String>>,
        classifier: Classifier,
    ) -> Self {
        Self {
            name: set.name.clone(),
            motion: set.motion.map(|motion| [motion.depth_mm, motion.radius_mm]),
            rest_ms: set.rest_ms,
            first: aligned.first,
            step: aligned.step,
            steps: aligned.steps,
            values: aligned.taxels,
            values_are: Some(set.values_are),
            layout: set.layout.clone(),
            labels,
            classifier,
        }
    }

    pub(super) fn save(&self, path: &Path) -> anyhow::Result<()> {
        OutputFile::write(path, serde_json::to_vec(self)?)
    }

    pub(super) fn load(path: &Path) -> anyhow::Result<Self> {
        let text = std::fs::read(path).with_context(|| path.display().to_string())?;
        let not_a_map = || {
            format!(
                "{}: no map as `taxel categorize --save` writes it",
                path.display()
            )
        };
        let map: Self = serde_json::from_slice(&text).with_context(not_a_map)?;
        // Numbers of frames are bounded before anything is made of them.
        let features = map
            .steps
            .checked_mul(map.values)
            .filter(|n| (1..=10_000_000).contains(n));
        let whole =
            features.is_some_and(|n| map.classifier.is_whole(n)) && map.step > 0.0 && map.first.is_finite();
        ensure!(
            whole && map.labels.len() == map.classifier.categories(),
            "{}: its parts do not fit",
            not_a_map()
        );
        Ok(map)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_palpation::{Matrix, Pca, Solver, optimal};

    impl MapFile {
        /// A map of two classes on one taxel, three steps of half a millimetre.
        pub(in crate::categorize) fn of_two_classes(rest_ms: Option<f64>) -> Self {
            let touches = Matrix::from_fn(3, 6, |step, n| {
                (step + 1) as f64 * (1.0 + (n / 3) as f64) * 10.0 + n as f64 * 0.1
            });
            let pca = Pca::fit(&touches, 1, Solver::Auto).unwrap();
            let found = optimal(&pca.project(&touches).unwrap(), 2, 1).unwrap();
            Self {
                name: "test".into(),
                motion: Some([1.5, 0.0]),
                rest_ms,
                first: 0.5,
                step: 0.5,
                steps: 3,
                values: 1,
                values_are: Some(Values::Z),
                layout: None,
                labels: vec![Some("soft".into()), None],
                classifier: Classifier::new(&pca, &touches, &found).unwrap(),
            }
        }
    }

    #[test]
    fn a_map_comes_back_from_its_file_and_another_file_is_none() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("map.json");
        let map = MapFile::of_two_classes(None);
        map.save(&path).unwrap();
        let back = MapFile::load(&path)
            .unwrap()
            .classifier
            .classify(&[1.0, 2.0, 3.0])
            .unwrap();
        assert_eq!(
            back.category,
            map.classifier.classify(&[1.0, 2.0, 3.0]).unwrap().category
        );
        let text = std::fs::read_to_string(&path).unwrap();
        for (from, to) in [
            ("\"steps\":3", "\"steps\":4"),
            ("\"labels\":[", "\"labels\":[null,"),
            ("{", "["),
        ] {
            std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
            let error = format!("{:#}", MapFile::load(&path).unwrap_err());
            assert!(
                error.contains("no map as `taxel categorize --save` writes it"),
                "{error}"
            );
        }
    }
}
