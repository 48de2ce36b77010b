//! The map of a simulated phantom, for who plays its scene.

use super::live::Live;
use super::map_file::MapFile;
use super::{matrix, touches};
use anyhow::Context;
use taxel_palpation::{Agreement, Classifier, Pca, Solver, optimal};

/// The touches of a scene on their first two components, in as many categories as it has classes.
pub(crate) struct PhantomMap {
    /// Where each touch is.
    pub(crate) places: Vec<[f64; 2]>,
    /// The category of each touch.
    pub(crate) labels: Vec<usize>,
    /// The class that each category stands for, where it stands for one.
    pub(crate) classes: Vec<Option<String>>,
    /// Puts touches to come onto the map.
    pub(crate) live: Live,
}

impl PhantomMap {
    /// Of a scene with a phantom, played offline.
    pub(crate) fn of_scene(name: &str) -> anyhow::Result<Self> {
        let set = touches::of_scene(name, None)?;
        let aligned = set.align(None)?;
        let touches = matrix(&aligned);
        let (names, known) = set.classes().context("a phantom's classes")?;
        let pca = Pca::fit(&touches, 2, Solver::Auto)?;
        let map = pca.project(&touches)?;
        let categories = optimal(&map, names.len(), 1)?;
        let agreement = Agreement::of(&categories.labels, &known)?;
        let mut classes: Vec<Option<String>> = (agreement.class_of.iter())
            .map(|class| names.get(*class).cloned())
            .collect();
        let classifier = Classifier::new(&pca, &touches, &categories)?;
        classes.resize(classifier.categories(), None);
        let file = MapFile::new(&set, &aligned, classes.clone(), classifier);
        Ok(Self {
            places: map.column_iter().map(|place| [place[0], place[1]]).collect(),
            labels: categories.labels,
            classes,
            live: Live::new(file, "away")?,
        })
    }
}
