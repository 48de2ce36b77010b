//! What a display can do, and how a frame is compressed for it.

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
    pub levels: u16,
    /// `K_A`, number of actuators, 1 to 1024.
    pub actuators: u16,
    /// `I_D`, number of iterations of the force stage, 1 to 1000.
    pub force_iterations: u16,
    /// `I_A`, number of iterations of the actuator stage, 1 to 1000. `follow` places actuators in as many as it needs.
    pub actuator_iterations: u16,
    /// How force levels are fitted to a frame; where absent, as the method does it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_fit: Option<ForceFit>,
    /// How actuators are placed; where absent, as the method does it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub placement: Option<Placement>,
    /// Hysteresis of the force levels, 0 to 0.5: a taxel keeps the level it had until its force is past the border by this share of the
    /// distance between the two levels. 0 gives each force its nearest level.
    pub level_hysteresis: f64,
    /// History cost of `follow`, 0 to 100: an actuator is drawn to where it was as if by this many times its own contacts.
    /// 0 follows the contacts alone.
    pub history: f64,
    /// Share of the position error that an actuator must save to be moved elsewhere, 0 to 1, for `follow`.
    pub jump_gain: f64,
    /// Whether `follow` keeps the parts of the hand apart, so that no actuator stands for contacts of two fingers.
    pub parts_apart: bool,
    /// Meaning of a pixel's grey.
    pub grey: Grey,
    /// Which force an actuator presses with when its cluster holds several levels.
    pub actuator_force: ActuatorForce,
    /// Weigh contacts by their force when placing actuators, so that an actuator stands at the centre of
    /// pressure. The publication does not.
    pub force_weighted: bool,
    /// Force codebook learned offline and kept constant (mark (*) of Table I), ascending, at most `levels`
    /// entries; empty to fit one to each frame.
    pub codebook: Vec<f64>,
}

/// How the two stages are computed.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// The publication's Table I to the letter.
    #[default]
    Paper,
    /// Exactly optimal force levels, and actuators that stay where they are unless the contact moves.
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

/// Meaning of a pixel's grey (papers.md 1.4, eq. (7)).
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Grey {
    /// `round(255 k / K_D)` for level `k = 1..K_D`: the display's full range, in equal steps.
    #[default]
    Level,
    /// `round(255 mu_k / mu_max)`, at least 1: greys keep the ratios of the forces.
    Centroid,
}

/// Which force an actuator presses with when its cluster holds several levels (papers.md 1.5).
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ActuatorForce {
    /// The strongest level in the cluster: never under-reports a force.
    #[default]
    Max,
    /// The level nearest to the mean force of the cluster.
    Mean,
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
            jump_gain: 0.03,
            parts_apart: false,
            grey: Grey::default(),
            actuator_force: ActuatorForce::default(),
            force_weighted: false,
            codebook: Vec::new(),
        }
    }
}

/// Why a profile describes no display.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ProfileError {
    /// A number outside its range.
    #[error("profile: {field} = {value} is outside {min}..={max}")]
    OutOfRange {
        /// Name of the field.
        field: &'static str,
        /// The value given.
        value: u16,
        /// Smallest allowed value.
        min: u16,
        /// Largest allowed value.
        max: u16,
    },
    /// A share or factor outside its range, or not a number.
    #[error("profile: {field} = {value} is outside {min}..={max}")]
    ShareOutOfRange {
        /// Name of the field.
        field: &'static str,
        /// The value given.
        value: f64,
        /// Smallest allowed value.
        min: f64,
        /// Largest allowed value.
        max: f64,
    },
    /// A codebook with more entries than levels.
    #[error("profile: the codebook has {entries} levels and the display only {levels}")]
    CodebookTooLong {
        /// Entries of the codebook.
        entries: usize,
        /// `K_D`.
        levels: u16,
    },
    /// A codebook that is not ascending, positive and finite.
    #[error("profile: codebook entry {index} ({value}) is not a finite force above the one before it")]
    CodebookNotAscending {
        /// Place in the codebook, from 0.
        index: usize,
        /// The entry.
        value: f64,
    },
    /// A layout with a taxel outside its image.
    #[error("layout: taxel {taxel} lies at ({x}, {y}), outside the {width}x{height} image")]
    TaxelOutsideImage {
        /// Number of the taxel.
        taxel: usize,
        /// Its column.
        x: u16,
        /// Its row.
        y: u16,
        /// Width of the image.
        width: u16,
        /// Height of the image.
        height: u16,
    },
    /// A layout with two taxels on one pixel.
    #[error("layout: taxels {first} and {second} both lie at ({x}, {y})")]
    PixelShared {
        /// Number of the first taxel.
        first: usize,
        /// Number of the second taxel.
        second: usize,
        /// Their column.
        x: u16,
        /// Their row.
        y: u16,
    },
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

    /// Refuses values that make no display.
    pub fn check(&self) -> Result<(), ProfileError> {
        let ranges = [
            ("levels", self.levels, 255),
            ("actuators", self.actuators, 1024),
            ("force_iterations", self.force_iterations, 1000),
            ("actuator_iterations", self.actuator_iterations, 1000),
        ];
        for (field, value, max) in ranges {
            if value < 1 || value > max {
                return Err(ProfileError::OutOfRange {
                    field,
                    value,
                    min: 1,
                    max,
                });
            }
        }
        let shares = [
            ("level_hysteresis", self.level_hysteresis, 0.5),
            ("history", self.history, 100.0),
            ("jump_gain", self.jump_gain, 1.0),
        ];
        for (field, value, max) in shares {
            if !(0.0..=max).contains(&value) {
                return Err(ProfileError::ShareOutOfRange {
                    field,
                    value,
                    min: 0.0,
                    max,
                });
            }
        }
        if self.codebook.len() > self.levels as usize {
            return Err(ProfileError::CodebookTooLong {
                entries: self.codebook.len(),
                levels: self.levels,
            });
        }
        let mut before = 0.0;
        for (index, &value) in self.codebook.iter().enumerate() {
            if !(value.is_finite() && value > before) {
                return Err(ProfileError::CodebookNotAscending { index, value });
            }
            before = value;
        }
        Ok(())
    }
}
