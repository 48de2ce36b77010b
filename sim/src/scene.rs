//! A scene: what is in it, and nothing else is modelled.

use crate::clock::ns_of_seconds;
use crate::contact::Contact;
use crate::contact_file::ContactToml;
use crate::fault::{Fault, FaultToml};
use crate::levels::Levels;
use crate::objects;
use crate::phantom::{Palpation, PalpationToml};
use serde::Deserialize;
use std::path::{Path, PathBuf};
use taxel_hand::{FromMap, did_you_mean, plain_words};
use taxel_sequence::Motion;
use toml::Spanned;

/// What a simulated hand goes through: which of its modules are there, what touches them, and what breaks.
///
/// Made from a TOML file ([`Scene::load`], the keys are in `scenes/README.md`) or built in
/// ([`Scene::builtin`]). Places are names until a [`crate::Simulator`] is made for a layout.
#[derive(Debug, Clone)]
pub struct Scene {
    pub(crate) file: String,
    pub(crate) name: String,
    pub(crate) about: String,
    pub(crate) length_ns: u64,
    pub(crate) layout: String,
    pub(crate) seed: u64,
    pub(crate) modules: Option<(u32, Vec<String>)>,
    pub(crate) boards: Boards,
    pub(crate) contacts: Vec<Contact>,
    pub(crate) faults: Vec<Fault>,
    pub(crate) palpation: Option<Palpation>,
}

/// How the boards of a scene behave.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Boards {
    /// Sweeps per second of boards that are not told their rate; `None`: what each kind usually has.
    pub(crate) rate_hz: Option<u32>,
    pub(crate) drift_ppm: u32,
    pub(crate) class7_hazard: bool,
    pub(crate) boot_replies: bool,
    pub(crate) boot_sweeps: u32,
    pub(crate) levels: Levels,
    pub(crate) noise: f64,
}

/// Why a scene cannot be played.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The file cannot be read.
    #[error("cannot read the scene {path}: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Not TOML, or a key that a scene does not have.
    #[error("{file}:{line}: {message}")]
    Syntax {
        /// The file, or `built-in NAME`.
        file: String,
        /// Line, from 1.
        line: u32,
        /// What is wrong, in the words of the TOML reader.
        message: String,
    },
    /// A value that makes no sense.
    #[error("{file}:{line}: {problem}")]
    Invalid {
        /// The file, or `built-in NAME`.
        file: String,
        /// Line, from 1, where the table that holds the value begins.
        line: u32,
        /// What is wrong and what would be right.
        problem: String,
    },
    /// A module or part that the layout does not have.
    #[error(
        "{file}:{line}: the layout {layout} has no module or part `{place}`; it has {}. The scenes `roll`, `idle` and `worst-case` fit every hand",
        known.join(", ")
    )]
    UnknownPlace {
        /// The file, or `built-in NAME`.
        file: String,
        /// Line, from 1.
        line: u32,
        /// The name given.
        place: String,
        /// The layout's name.
        layout: String,
        /// The parts and modules of the layout.
        known: Vec<String>,
    },
    /// Neither a built-in scene nor a file.
    #[error(
        "there is no scene `{name}`{}: neither a file nor one of {}, {}{}",
        if name == "forearm" { " but for `taxel sim` and `taxel demo`" } else { "" },
        Scene::names().collect::<Vec<_>>().join(", "),
        Scene::objects().collect::<Vec<_>>().join(", "),
        did_you_mean(name, Scene::names().chain(Scene::objects()))
    )]
    UnknownScene {
        /// The name given.
        name: String,
    },
    /// The layout cannot be simulated.
    #[error("the layout {layout} cannot be simulated: {problem}")]
    Layout {
        /// The layout's name.
        layout: String,
        /// Why, with the module.
        problem: String,
    },
}

const BUILTIN: &[(&str, &str)] = &[
    ("idle", include_str!("../scenes/idle.toml")),
    ("roll", include_str!("../scenes/roll.toml")),
    ("tap", include_str!("../scenes/tap.toml")),
    ("ball-grasp", include_str!("../scenes/ball-grasp.toml")),
    ("slip", include_str!("../scenes/slip.toml")),
    ("worst-case", include_str!("../scenes/worst-case.toml")),
    ("faulty-hand", include_str!("../scenes/faulty-hand.toml")),
    ("phantom-1", include_str!("../scenes/phantom-1.toml")),
    ("phantom-2", include_str!("../scenes/phantom-2.toml")),
];

impl Scene {
    /// The names of the built-in scenes without those of [`Scene::objects`].
    pub fn names() -> impl Iterator<Item = &'static str> {
        BUILTIN.iter().map(|(name, _)| *name)
    }

    /// The names of twenty more: simple objects of daily life, each grasped and let go.
    pub fn objects() -> impl Iterator<Item = &'static str> {
        objects::names()
    }

    /// A built-in scene; [`SceneError::UnknownScene`] where there is none of that name.
    pub fn builtin(name: &str) -> Result<Self, SceneError> {
        match Self::builtin_text(name) {
            Some(text) => Self::parse(&text, &format!("built-in {name}")),
            None => Err(SceneError::UnknownScene { name: name.into() }),
        }
    }

    /// The text of a built-in scene, to start one's own from.
    pub fn builtin_text(name: &str) -> Option<String> {
        let written = BUILTIN
            .iter()
            .find(|(n, _)| *n == name)
            .map(|(_, text)| (*text).to_owned());
        written.or_else(|| objects::text(name))
    }

    /// Reads a scene file.
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        let text = taxel_skin::read_text_file(path).map_err(|source| SceneError::Read {
            path: path.into(),
            source,
        })?;
        Self::parse(&text, &path.display().to_string())
    }

    /// The built-in scene of this name, or else the file at this path.
    pub fn resolve(name_or_path: &str) -> Result<Self, SceneError> {
        match Self::builtin(name_or_path) {
            Err(SceneError::UnknownScene { .. }) => {
                let path = Path::new(name_or_path);
                if path.exists() || name_or_path.contains(['/', '.']) {
                    Self::load(path)
                } else {
                    Err(SceneError::UnknownScene {
                        name: name_or_path.into(),
                    })
                }
            }
            scene => scene,
        }
    }

    /// A scene from TOML text; `file` is the name that errors give.
    pub fn parse(text: &str, file: &str) -> Result<Self, SceneError> {
        let line_of = |at: usize| {
            1 + text.as_bytes()[..at.min(text.len())]
                .iter()
                .filter(|b| **b == b'\n')
                .count() as u32
        };
        let scene: SceneToml = toml::from_str(text).map_err(|e| SceneError::Syntax {
            file: file.into(),
            line: e.span().map_or(1, |s| line_of(s.start)),
            message: plain_words(e.message()),
        })?;
        let invalid = |line: u32| {
            move |problem: String| SceneError::Invalid {
                file: file.into(),
                line,
                problem,
            }
        };
        let top = invalid(1);
        let line = scene.palpation.as_ref().map_or(1, |p| line_of(p.span().start));
        let palpation = scene.palpation.map(|p| p.into_inner().0.check()).transpose();
        let palpation = palpation.map_err(invalid(line))?;
        let length_ns = match (scene.seconds, &palpation) {
            (None, Some(palpation)) => palpation.length_ns(),
            (Some(seconds), None) if (0.001..=86_400.0).contains(&seconds) => ns_of_seconds(seconds),
            (Some(_), Some(_)) => {
                return Err(top("`seconds` follows from [palpation]; leave it out".into()));
            }
            (None, None) => return Err(top("`seconds` is missing: how long the scene is".into())),
            (Some(seconds), None) => {
                return Err(top(format!("`seconds` is {seconds}; it must be 0.001 to 86400")));
            }
        };
        let line = scene.boards.as_ref().map_or(1, |b| line_of(b.span().start));
        let boards = scene.boards.map(|boards| boards.into_inner().0);
        let boards = boards.unwrap_or_default().check().map_err(invalid(line))?;
        let contacts = scene
            .contact
            .into_iter()
            .map(|c| {
                let line = line_of(c.span().start);
                let FromMap(contact) = c.into_inner();
                contact
                    .check(line, length_ns, boards.levels)
                    .map_err(invalid(line))
            })
            .collect::<Result<_, _>>()?;
        let faults = scene
            .fault
            .into_iter()
            .map(|f| {
                let line = line_of(f.span().start);
                f.into_inner().0.check(line, length_ns).map_err(invalid(line))
            })
            .collect::<Result<_, _>>()?;
        Ok(Self {
            file: file.into(),
            name: scene.name,
            about: scene.about,
            length_ns,
            layout: scene.layout.unwrap_or_else(|| "allegro-uskin-15".into()),
            seed: scene.seed.unwrap_or(1),
            modules: scene.modules.map(|m| (line_of(m.span().start), m.into_inner())),
            boards,
            contacts,
            faults,
            palpation,
        })
    }

    /// The scene's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// One sentence on what happens; empty where the file has none.
    pub fn about(&self) -> &str {
        &self.about
    }

    /// How long it lasts, seconds.
    pub fn seconds(&self) -> f64 {
        self.length_ns as f64 / 1e9
    }

    /// How long it lasts, nanoseconds.
    pub fn length_ns(&self) -> u64 {
        self.length_ns
    }

    /// The name or path of the layout it is meant for.
    pub fn layout(&self) -> &str {
        &self.layout
    }

    /// The seed it names, or 1.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// The phantom that is palpated, if it is that.
    pub fn palpation(&self) -> Option<&Palpation> {
        self.palpation.as_ref()
    }

    /// The same scene with another motion of the probe, and so of another length, where a phantom is palpated.
    pub fn with_motion(mut self, motion: Motion) -> Self {
        if let Some(palpation) = &mut self.palpation {
            palpation.motion = motion;
            self.length_ns = palpation.length_ns();
        }
        self
    }

    /// The same scene with another board rate, 1 to 1000 sweeps per second (clamped).
    pub fn with_rate_hz(mut self, rate_hz: u32) -> Self {
        self.boards.rate_hz = Some(rate_hz.clamp(1, 1000));
        self
    }
}

/// A table of the file: keys with their values, and no list of values in the order of the keys.
type Table<T> = Spanned<FromMap<T>>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SceneToml {
    name: String,
    #[serde(default)]
    about: String,
    seconds: Option<f64>,
    layout: Option<String>,
    seed: Option<u64>,
    modules: Option<Spanned<Vec<String>>>,
    boards: Option<Table<BoardsToml>>,
    #[serde(default)]
    contact: Vec<Table<ContactToml>>,
    #[serde(default)]
    fault: Vec<Table<FaultToml>>,
    palpation: Option<Table<PalpationToml>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, default)]
struct BoardsToml {
    rate_hz: Option<u32>,
    drift_ppm: u32,
    class7_hazard: bool,
    boot_replies: bool,
    boot_sweeps: u32,
    levels: Levels,
    noise: f64,
}

impl Default for BoardsToml {
    fn default() -> Self {
        Self {
            rate_hz: None,
            drift_ppm: 100,
            class7_hazard: false,
            boot_replies: false,
            boot_sweeps: 0,
            levels: Levels::default(),
            noise: 1.0,
        }
    }
}

impl BoardsToml {
    fn check(self) -> Result<Boards, String> {
        if let Some(rate_hz) = self.rate_hz.filter(|hz| !(1..=1000).contains(hz)) {
            return Err(format!("`rate_hz` is {rate_hz}; it must be 1 to 1000"));
        }
        if self.drift_ppm > 10_000 {
            return Err(format!(
                "`drift_ppm` is {}; it must be 0 to 10000",
                self.drift_ppm
            ));
        }
        if !(0.0..=1000.0).contains(&self.noise) {
            return Err(format!("`noise` is {}; it must be 0 to 1000", self.noise));
        }
        Ok(Boards {
            rate_hz: self.rate_hz,
            drift_ppm: self.drift_ppm,
            class7_hazard: self.class7_hazard,
            boot_replies: self.boot_replies,
            boot_sweeps: self.boot_sweeps,
            levels: self.levels,
            noise: self.noise,
        })
    }
}
