//! What a display can do, and how a frame is compressed for it.

use std::collections::BTreeMap;

use crate::{FromMap, WholeList};
use serde::de::{Deserializer, Error as _, Unexpected};
use serde::{Deserialize, Serialize};

/// What a display can do and how frames are compressed for it: the inputs of the publication's Table I.
///
/// It is the `[profile]` table of the configuration; [`Profile::check`] refuses values that make no display.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Profile {
    /// How the two stages are computed.
    pub method: Method,
    /// `K_D`, number of force levels the display can render, 1 to 255.
    #[serde(deserialize_with = "count::<_, 255>")]
    pub levels: u16,
    /// `K_A`, number of actuators, 1 to 1024.
    #[serde(deserialize_with = "count::<_, 1024>")]
    pub actuators: u16,
    /// `I_D`, number of iterations of the force stage, 1 to 1000.
    #[serde(deserialize_with = "count::<_, 1000>")]
    pub force_iterations: u16,
    /// `I_A`, number of iterations of the actuator stage, 1 to 1000. `follow` places actuators in
    /// as many as it needs.
    #[serde(deserialize_with = "count::<_, 1000>")]
    pub actuator_iterations: u16,
    /// How force levels are fitted to a frame, where neither `codebook`, `codebook_learning` nor
    /// `level_steps` gives them; where absent, as the method does it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_fit: Option<ForceFit>,
    /// How actuators are placed; where absent, as the method does it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub placement: Option<Placement>,
    /// Hysteresis of the force levels, 0 to 0.5: a taxel keeps the level it had until its force is
    /// past the border by this share of the distance between the two levels. 0 gives each force its
    /// nearest level.
    pub level_hysteresis: f64,
    /// History cost of `follow`, 0 to 100: an actuator is drawn to where it was as if by this many
    /// times its own contacts. 0 follows the contacts alone.
    pub history: f64,
    /// Share of the position error that an actuator must save to be moved elsewhere, 0 to 1, for `follow`. A quarter of
    /// it is asked where `force_distance` matters to places.
    pub jump_gain: f64,
    /// How far apart two contacts count whose forces differ by 4.75 times what those of neighbours differ by in the mean,
    /// in distances of neighbouring taxels, 0 to 2, for `follow` with at most five contacts for each actuator. It decides which contacts share an actuator where places leave that open. With more contacts, those
    /// between two actuators go to the one whose contacts are pressed like them, for no more than 2 % of the position
    /// error; 0 leaves forces out of both.
    pub force_distance: f64,
    /// Whether `follow` keeps the parts of the hand apart, so that no actuator stands for contacts
    /// of two fingers.
    pub parts_apart: bool,
    /// Meaning of a pixel's grey.
    pub grey: Grey,
    /// Which force an actuator presses with when its cluster holds several levels; where absent, as
    /// the method does it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub actuator_force: Option<ActuatorForce>,
    /// Weigh contacts by their force when placing actuators, so that an actuator stands at the centre of
    /// pressure. The publication does not.
    pub force_weighted: bool,
    /// Force codebook learned offline and kept constant (mark (*) of Table I), ascending, at most `levels`
    /// entries; empty to fit one to each frame.
    pub codebook: Vec<f64>,
    /// Force JND of the person who wears the display, as a Weber fraction, 0.001 to 1: where given,
    /// `K_D` is the number of just distinguishable steps from `force_min` to `force_max`, which it needs
    /// ([`Profile::level_count`]), instead of `levels`. About 0.07 on fingers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub jnd: Option<f64>,
    /// Least and greatest force that the display shows, in the unit of the force frames, for `jnd`
    /// and `level_steps`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_min: Option<f64>,
    /// See `force_min`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_max: Option<f64>,
    /// How the levels lie between the least and the greatest force.
    pub level_steps: LevelSteps,
    /// Learns one codebook for the session while it runs, instead of fitting one to each frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[serde(deserialize_with = "FromMap::optional")]
    pub codebook_learning: Option<CodebookLearning>,
    /// In which coordinates actuators are placed, of `follow` or `fixed`.
    pub coordinates: Coordinates,
    /// Most actuators on each part of the hand, by the layout's names of parts; parts not named
    /// share what is left of `actuators`. Empty for no such limits. For `follow`.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub budgets: BTreeMap<String, u16>,
    /// Places `[x, y]` of a display's actuators that cannot move, in `coordinates`, 1 to 256 of
    /// them and as many as `actuators`; an actuator's id is its place in this list. Empty for a
    /// display that shows an actuator wherever it is wanted.
    #[serde(skip_serializing_if = "Vec::is_empty", deserialize_with = "WholeList::read")]
    pub fixed: Vec<[f64; 2]>,
}

/// A count that no u16 holds is refused here, the others by [`Profile::check`].
fn count<'de, D: Deserializer<'de>, const MOST: u16>(deserializer: D) -> Result<u16, D::Error> {
    let number = i64::deserialize(deserializer)?;
    let wanted = format!("a whole number from 1 to {MOST}");
    u16::try_from(number).map_err(|_| D::Error::invalid_value(Unexpected::Signed(number), &&*wanted))
}

/// How force levels lie between the least and the greatest force.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LevelSteps {
    /// As `force_fit` has it.
    #[default]
    Fitted,
    /// The middles of equal steps of force.
    Equal,
    /// The middles of equal steps of the logarithm of force, after Weber's law; a force has the
    /// level that is nearest in ratio.
    Weber,
}

/// How a codebook is learned while it is used.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CodebookLearning {
    /// Share of what was learned that each frame with contact lets fade, 0 to 1: 0.001 remembers
    /// about a thousand frames.
    pub forgetting: f64,
}

/// In which coordinates actuators are placed.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Coordinates {
    /// Columns and rows of the image.
    #[default]
    Pixels,
    /// The taxels' places on the hand laid flat, x and y of the layout's `position_mm`, millimetres.
    Hand,
}

/// How the two stages are computed.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// The publication's Table I to the letter.
    Paper,
    /// Exactly optimal force levels, and actuators that stay where they are unless the contact moves.
    #[default]
    Optimal,
}

/// How force levels are fitted to a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ForceFit {
    /// Lloyd's iterations from a uniform start, eqs (3) to (6): the method `paper`.
    Lloyd,
    /// The levels with the least squared error there is: the method `optimal`.
    Exact,
}

/// How actuators are placed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Placement {
    /// Lloyd's iterations anew in each frame, eqs (8) to (11): the method `paper`.
    Lloyd,
    /// From where the actuators were, each with the id it had: the method `optimal`.
    Follow,
}

/// Meaning of a pixel's grey (eq. (7) of the publication; docs/algorithm.md, "Grey").
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Grey {
    /// `round(255 k / K_D)` for level `k = 1..K_D`: the display's full range, in equal steps.
    #[default]
    Level,
    /// `round(255 mu_k / mu_max)`, at least 1: greys keep the ratios of the forces.
    Centroid,
}

/// Which force an actuator presses with when its cluster holds several levels (docs/algorithm.md,
/// "Actuator quantisation").
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ActuatorForce {
    /// The strongest level in the cluster, which never under-reports a force: the method `paper`.
    Max,
    /// The level nearest to the mean of the cluster's levels.
    Mean,
    /// The level with the least squared error from the measured forces of the cluster: the method `optimal`.
    Closest,
}

impl Default for Profile {
    fn default() -> Self {
        Self {
            method: Method::default(),
            levels: 8,
            actuators: 16,
            force_iterations: 10,
            actuator_iterations: 10,
            force_fit: None,
            placement: None,
            level_hysteresis: 0.0,
            history: 0.0,
            jump_gain: 0.04,
            force_distance: 1.0,
            parts_apart: false,
            grey: Grey::default(),
            actuator_force: None,
            force_weighted: false,
            codebook: Vec::new(),
            jnd: None,
            force_min: None,
            force_max: None,
            level_steps: LevelSteps::default(),
            codebook_learning: None,
            coordinates: Coordinates::default(),
            budgets: BTreeMap::new(),
            fixed: Vec::new(),
        }
    }
}

impl Profile {
    /// How force levels are fitted: as set, or as the method does it.
    pub fn force_fit(&self) -> ForceFit {
        self.force_fit.unwrap_or(match self.method {
            Method::Paper => ForceFit::Lloyd,
            Method::Optimal => ForceFit::Exact,
        })
    }

    /// How actuators are placed: as set, or as the method does it.
    pub fn placement(&self) -> Placement {
        self.placement.unwrap_or(match self.method {
            Method::Paper => Placement::Lloyd,
            Method::Optimal => Placement::Follow,
        })
    }

    /// Which force an actuator presses with: as set, or as the method does it.
    pub fn actuator_force(&self) -> ActuatorForce {
        self.actuator_force.unwrap_or(match self.method {
            Method::Paper => ActuatorForce::Max,
            Method::Optimal => ActuatorForce::Closest,
        })
    }

    /// Whether levels are fitted to each frame by [`Self::force_fit`], since no codebook, no learning and no steps
    /// give them.
    pub fn fits_frames(&self) -> bool {
        self.codebook.is_empty() && self.codebook_learning.is_none() && self.level_steps == LevelSteps::Fitted
    }

    /// `K_D`: `levels`, or the number of just distinguishable steps where a JND is given, at most 255.
    ///
    /// That is the least `k` with `(1 + jnd)^k >= force_max / force_min`: 58 from 1 to 50 at 7 %.
    pub fn level_count(&self) -> u16 {
        let (Some(jnd), Some(least), Some(greatest)) = (self.jnd, self.force_min, self.force_max) else {
            return self.levels;
        };
        let mut reached = least;
        let mut count = 0;
        while reached < greatest && count < 255 {
            reached *= 1.0 + jnd;
            count += 1;
        }
        count.max(1)
    }

    /// The profile with what the method implies stated: how levels are fitted, how actuators are placed and with which
    /// force they press. What other settings leave without effect is not stated, so that [`Profile::check`] accepts it
    /// as it accepts this one.
    pub fn in_force(&self) -> Self {
        Self {
            force_fit: self.fits_frames().then(|| self.force_fit()),
            placement: self.fixed.is_empty().then(|| self.placement()),
            actuator_force: Some(self.actuator_force()),
            ..self.clone()
        }
    }

    /// The profile written in one way: settings that make no difference are at their defaults, and
    /// what the method or a JND implies is stated. Profiles with the same canonical form give the
    /// same images. It is for comparing; [`Profile::check`] may refuse it.
    pub fn canonical(&self) -> Self {
        let default = Self::default();
        let mut canonical = Self {
            method: default.method,
            levels: self.level_count(),
            jnd: None,
            ..self.in_force()
        };
        if canonical.force_fit != Some(ForceFit::Lloyd) {
            canonical.force_iterations = default.force_iterations;
        }
        if canonical.placement != Some(Placement::Lloyd) {
            canonical.actuator_iterations = default.actuator_iterations;
        }
        if canonical.placement != Some(Placement::Follow) {
            (canonical.history, canonical.jump_gain) = (default.history, default.jump_gain);
            canonical.parts_apart = default.parts_apart;
            canonical.force_distance = default.force_distance;
        }
        if !self.fixed.is_empty() {
            canonical.force_weighted = default.force_weighted;
        }
        if self.level_steps == LevelSteps::Fitted {
            (canonical.force_min, canonical.force_max) = (None, None);
        }
        canonical
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FORCE_MAX;

    fn profile(text: &str) -> Profile {
        let profile: Profile = toml::from_str(text).expect(text);
        profile.check().expect(text);
        profile
    }

    #[test]
    fn forces_that_no_image_can_carry_are_refused_by_name_and_number() {
        for (text, wanted) in [
            ("codebook = [1.0, 1e39]", "codebook entry 1 (1e39) is above 1e38"),
            ("codebook = [1.0, inf]", "codebook entry 1 (inf) is above 1e38"),
            ("codebook = [nan]", "codebook entry 0 (NaN) is not a force above"),
            (
                "codebook = [2.0, 2.0]",
                "codebook entry 1 (2) is not a force above the one before it",
            ),
            (
                "codebook = [-5.0, 3.0]",
                "codebook entry 0 (-5) is not a force above 0",
            ),
            (
                "codebook = [1.0]\njnd = 0.07\nforce_min = 1.0\nforce_max = 50.0",
                "codebook cannot be combined with jnd",
            ),
            (
                "level_steps = 'equal'\nforce_min = 1.0\nforce_max = 1e39",
                "force_max <= 1e38",
            ),
        ] {
            let profile: Profile = toml::from_str(text).expect(text);
            let message = profile.check().unwrap_err().to_string();
            assert!(message.contains(wanted), "{text}: {message}");
        }
        assert!((FORCE_MAX as f32).is_finite());
        profile("codebook = [1e-38, 1e38]");
    }

    #[test]
    fn budgets_for_more_parts_than_there_are_actuators_are_refused_by_their_number() {
        let text = "actuators = 2\nbudgets = { index = 1, ring = 1, thumb = 1 }";
        let profile: Profile = toml::from_str(text).expect(text);
        let message = profile.check().unwrap_err().to_string();
        assert!(
            message.contains("budgets names 3 parts") && message.contains("actuators = 2"),
            "{message}"
        );
    }

    #[test]
    fn a_count_that_is_none_is_refused_with_the_range_of_its_key() {
        for (text, wanted) in [
            (
                "levels = -1",
                "a whole number from 1 to 255 is wanted here, not -1",
            ),
            (
                "actuators = 70000",
                "a whole number from 1 to 1024 is wanted here, not 70000",
            ),
            ("levels = 2.5", "a whole number is wanted here, not 2.5"),
        ] {
            let error = toml::from_str::<Profile>(text).unwrap_err();
            assert_eq!(crate::plain_words(error.message()), wanted, "{text}");
        }
    }

    #[test]
    fn what_is_in_force_is_a_profile_that_says_the_same() {
        for (text, fit, placement, force) in [
            ("", Some("exact"), Some("follow"), "closest"),
            ("method = 'paper'", Some("lloyd"), Some("lloyd"), "max"),
            (
                "method = 'paper'\nplacement = 'follow'",
                Some("lloyd"),
                Some("follow"),
                "max",
            ),
            ("codebook = [1.0]", None, Some("follow"), "closest"),
            (
                "actuators = 1\nfixed = [[1.0, 2.0]]",
                Some("exact"),
                None,
                "closest",
            ),
        ] {
            let stated = profile(text);
            let in_force = toml::Table::try_from(stated.in_force()).unwrap();
            let of = |key: &str| in_force.get(key).and_then(toml::Value::as_str);
            let wanted = [fit, placement, Some(force)];
            assert_eq!(
                ["force_fit", "placement", "actuator_force"].map(of),
                wanted,
                "{text}"
            );
            let again = profile(&in_force.to_string());
            assert_eq!(again.canonical(), stated.canonical(), "{text}");
        }
    }

    #[test]
    fn profiles_that_mean_the_same_have_one_canonical_form() {
        for (a, b, same) in [
            (
                "",
                "method = 'optimal'\nforce_fit = 'exact'\nplacement = 'follow'",
                true,
            ),
            ("force_iterations = 3\nactuator_iterations = 4", "", true),
            (
                "method = 'paper'\nforce_fit = 'exact'\nplacement = 'follow'\nactuator_force = 'closest'",
                "",
                true,
            ),
            (
                "method = 'paper'\njump_gain = 0.5\nhistory = 1.0\nparts_apart = true",
                "method = 'paper'",
                true,
            ),
            ("jnd = 0.5\nforce_min = 1.0\nforce_max = 3.0", "levels = 3", true),
            (
                "codebook = [1.0]\nforce_fit = 'lloyd'\nforce_iterations = 2",
                "codebook = [1.0]",
                true,
            ),
            (
                "actuators = 1\nfixed = [[1.0, 2.0]]\njump_gain = 0.3",
                "actuators = 1\nfixed = [[1.0, 2.0]]\nmethod = 'paper'\nforce_fit = 'exact'\nactuator_force = 'closest'",
                true,
            ),
            ("method = 'paper'", "", false),
            ("jump_gain = 0.3", "", false),
            (
                "method = 'paper'\nforce_iterations = 3",
                "method = 'paper'",
                false,
            ),
            (
                "level_steps = 'weber'\nforce_min = 1.0\nforce_max = 3.0",
                "level_steps = 'weber'",
                false,
            ),
        ] {
            assert_eq!(
                profile(a).canonical() == profile(b).canonical(),
                same,
                "{a:?} and {b:?}"
            );
        }
    }
}
