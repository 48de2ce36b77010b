//! What makes no display, and why.

use crate::{
    CodebookLearning, Coordinates, FORCE_MAX, FORCE_MIN, LevelSteps, Placement, Profile, RangeError,
    check_range,
};

/// How messages about a key of it begin.
const TABLE: &str = "profile: ";

/// Why a profile describes no display.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ProfileError {
    /// A number outside its range, or not a number.
    #[error(transparent)]
    Range(#[from] RangeError),
    /// A codebook with more entries than levels.
    #[error("profile: the codebook has {entries} levels and the display only {levels}")]
    CodebookTooLong {
        /// Entries of the codebook.
        entries: usize,
        /// `K_D`.
        levels: u16,
    },
    /// A codebook that is not ascending and positive.
    #[error(
        "profile: codebook entry {index} ({value}) is not a force above {}",
        if *index == 0 { "0" } else { "the one before it" }
    )]
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
    /// A codebook with a force that no image can carry.
    #[error(
        "profile: codebook entry {index} ({value:?}) is above 1e38, the greatest force that an image carries; \
         give it in another unit"
    )]
    CodebookTooLarge {
        /// Place in the codebook, from 0.
        index: usize,
        /// The entry.
        value: f64,
    },
    /// A setting that needs another one.
    #[error("profile: {field} needs {needs}")]
    Needs {
        /// The field that is set.
        field: &'static str,
        /// What is missing.
        needs: &'static str,
    },
    /// Two settings that exclude each other.
    #[error("profile: {field} cannot be combined with {other}; leave one of them out")]
    Conflict {
        /// One of them.
        field: &'static str,
        /// The other.
        other: &'static str,
    },
    /// A force range that is none.
    #[error(
        "profile: force_min = {least} and force_max = {greatest} are no range of forces; give 1e-38 <= force_min < force_max <= 1e38"
    )]
    NoRange {
        /// `force_min`.
        least: f64,
        /// `force_max`.
        greatest: f64,
    },
    /// Places in other number than actuators.
    #[error(
        "profile: fixed has {places} places and actuators = {actuators}; there is one place for each actuator, at most 256"
    )]
    PlacesNotActuators {
        /// Number of places.
        places: usize,
        /// `K_A`.
        actuators: u16,
    },
    /// A place that is no place, or another one's.
    #[error(
        "profile: place {index} of fixed, [{x}, {y}], is no finite place within 1e6 or that of another actuator"
    )]
    BadPlace {
        /// Its number, from 0.
        index: usize,
        /// Its first coordinate.
        x: f64,
        /// Its second coordinate.
        y: f64,
    },
    /// A place beside the image.
    #[error(
        "profile: place {index} of fixed, [{x}, {y}], is outside the {width}x{height} image of this hand; places are \
         pixels, from 0, unless coordinates = \"hand\""
    )]
    PlaceOutsideImage {
        /// Its number, from 0.
        index: usize,
        /// Its column.
        x: f64,
        /// Its row.
        y: f64,
        /// Width of the image.
        width: u16,
        /// Height of the image.
        height: u16,
    },
    /// A budget for a part that the hand does not have.
    #[error("profile: budgets names {part:?}, but the parts of this hand are {parts}")]
    UnknownPart {
        /// The part named.
        part: String,
        /// Names of the hand's parts.
        parts: String,
    },
    /// Budgets that are more than all actuators, or leave none for the other parts.
    #[error(
        "profile: budgets add up to {sum} of actuators = {actuators}, {others} parts have none of their own; give each of them at least one"
    )]
    BudgetsTooLarge {
        /// Sum of the budgets.
        sum: u32,
        /// `K_A`.
        actuators: u16,
        /// Number of parts without a budget.
        others: usize,
    },
    /// Budgets for more parts than there are actuators.
    #[error(
        "profile: budgets names {parts} parts and there are actuators = {actuators}; each of them needs one"
    )]
    TooManyBudgets {
        /// Number of parts that have a budget.
        parts: usize,
        /// `K_A`.
        actuators: u16,
    },
    /// A place beside the hand.
    #[error(
        "profile: place {index} of fixed, [{x}, {y}], is {distance_mm:.0} mm from the nearest taxel of this hand; its \
         taxels are from [{:.1}, {:.1}] to [{:.1}, {:.1}], millimetres as coordinates = \"hand\" has them",
        .from[0], .from[1], .to[0], .to[1]
    )]
    PlaceOffHand {
        /// Its number, from 0.
        index: usize,
        /// Its first coordinate, millimetres.
        x: f64,
        /// Its second coordinate, millimetres.
        y: f64,
        /// From the nearest taxel, millimetres.
        distance_mm: f64,
        /// The least coordinates of taxels, millimetres.
        from: [f64; 2],
        /// The greatest coordinates of taxels, millimetres.
        to: [f64; 2],
    },
    /// Hand coordinates that the layout does not have.
    #[error(
        "profile: coordinates = \"hand\" needs the place of every taxel, and the layout has none for taxel {taxel}; add positions to it"
    )]
    NoPosition {
        /// Number of the taxel.
        taxel: usize,
    },
}

impl Profile {
    /// Refuses values that make no display.
    pub fn check(&self) -> Result<(), ProfileError> {
        let ranges = [
            ("levels", self.levels, 255.0),
            ("actuators", self.actuators, 1024.0),
            ("force_iterations", self.force_iterations, 1000.0),
            ("actuator_iterations", self.actuator_iterations, 1000.0),
        ];
        for (key, value, max) in ranges {
            check_range(TABLE, key, value, 1.0..=max, "")?;
        }
        let shares = [
            ("level_hysteresis", self.level_hysteresis, 0.5),
            ("history", self.history, 100.0),
            ("jump_gain", self.jump_gain, 1.0),
            ("force_distance", self.force_distance, 2.0),
        ];
        for (key, value, max) in shares {
            check_range(TABLE, key, value, 0.0..=max, "")?;
        }
        self.check_levels()?;
        self.check_places()?;
        if self.codebook.len() > usize::from(self.level_count()) {
            return Err(ProfileError::CodebookTooLong {
                entries: self.codebook.len(),
                levels: self.level_count(),
            });
        }
        let mut before = 0.0;
        for (index, &value) in self.codebook.iter().enumerate() {
            if value.is_nan() || value <= before {
                return Err(ProfileError::CodebookNotAscending { index, value });
            }
            if value > FORCE_MAX {
                return Err(ProfileError::CodebookTooLarge { index, value });
            }
            before = value;
        }
        Ok(())
    }

    fn check_levels(&self) -> Result<(), ProfileError> {
        if let Some(jnd) = self.jnd {
            check_range(TABLE, "jnd", jnd, 0.001..=1.0, "")?;
        }
        if let Some(CodebookLearning { forgetting }) = self.codebook_learning {
            check_range(TABLE, "codebook_learning.forgetting", forgetting, 0.0..=1.0, "")?;
        }
        match (self.force_min, self.force_max) {
            (Some(least), Some(greatest)) => {
                if !(least >= FORCE_MIN && least < greatest && greatest <= FORCE_MAX) {
                    return Err(ProfileError::NoRange { least, greatest });
                }
            }
            (None, None) if self.jnd.is_some() => {
                return Err(ProfileError::Needs {
                    field: "jnd",
                    needs: "force_min and force_max",
                });
            }
            (None, None) => {}
            (Some(_), None) => {
                return Err(ProfileError::Needs {
                    field: "force_min",
                    needs: "force_max",
                });
            }
            (None, Some(_)) => {
                return Err(ProfileError::Needs {
                    field: "force_max",
                    needs: "force_min",
                });
            }
        }
        let sources = [
            ("codebook", !self.codebook.is_empty()),
            ("codebook_learning", self.codebook_learning.is_some()),
            ("level_steps", self.level_steps != LevelSteps::Fitted),
        ];
        let mut set = sources.iter().filter(|(_, set)| *set);
        if let (Some((field, _)), Some((other, _))) = (set.next(), set.next()) {
            return Err(ProfileError::Conflict { field, other });
        }
        if !self.codebook.is_empty() && self.jnd.is_some() {
            let (field, other) = ("codebook", "jnd");
            return Err(ProfileError::Conflict { field, other });
        }
        Ok(())
    }

    fn check_places(&self) -> Result<(), ProfileError> {
        let follows = self.placement() == Placement::Follow;
        if self.fixed.is_empty() {
            for (field, set) in [
                ("budgets", !self.budgets.is_empty()),
                ("coordinates", self.coordinates == Coordinates::Hand),
            ] {
                if set && !follows {
                    return Err(ProfileError::Needs {
                        field,
                        needs: "placement = \"follow\", as method = \"optimal\" has it",
                    });
                }
            }
            if self.budgets.len() > usize::from(self.actuators) {
                return Err(ProfileError::TooManyBudgets {
                    parts: self.budgets.len(),
                    actuators: self.actuators,
                });
            }
            return Ok(());
        }
        for (other, set) in [
            ("budgets", !self.budgets.is_empty()),
            ("placement", self.placement.is_some()),
        ] {
            if set {
                return Err(ProfileError::Conflict {
                    field: "fixed",
                    other,
                });
            }
        }
        let places = self.fixed.len();
        if places != usize::from(self.actuators) || places > 256 {
            return Err(ProfileError::PlacesNotActuators {
                places,
                actuators: self.actuators,
            });
        }
        for (index, &[x, y]) in self.fixed.iter().enumerate() {
            let far = |v: f64| v.is_nan() || v.abs() > 1e6;
            if far(x) || far(y) || self.fixed[..index].contains(&[x, y]) {
                return Err(ProfileError::BadPlace { index, x, y });
            }
        }
        Ok(())
    }
}
