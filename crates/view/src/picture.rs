//! One picture: all that the panes show, taken at one instant.

use crate::figures::Figures;
use crate::flat::Hand;
use std::sync::Arc;
use taxel_hand::{Fault, Freshness};
use taxel_wire::status::ProblemStatus;
use taxel_wire::{RawTaxel, WireActuator};

/// One picture of a hand.
#[derive(Debug, Clone)]
pub struct Picture {
    pub(crate) hand: Arc<Hand>,
    /// By taxel; empty before the first raw frame and without a daemon.
    pub(crate) taxels: Vec<TaxelNow>,
    pub(crate) actuators: Vec<WireActuator>,
    pub(crate) joints: Vec<Joint>,
    /// The force that the brightest colour stands for.
    pub(crate) scale: f64,
    /// Whether somebody holds the scale.
    pub(crate) held: bool,
    pub(crate) threshold: f64,
    /// Of forces; empty where they are magnitudes, whose unit nobody knows.
    pub(crate) unit: String,
    pub(crate) levels: u16,
    pub(crate) max_actuators: u16,
    pub(crate) method: String,
    pub(crate) figures: Figures,
    pub(crate) contacts: u32,
    pub(crate) missing: u32,
    pub(crate) faulty: u32,
    /// Images that this subscriber was not given; `None` where it asked for fewer.
    pub(crate) skipped: Option<u64>,
    pub(crate) calibrating: bool,
    pub(crate) paused: bool,
    /// Why there is no connection.
    pub(crate) gone: Option<String>,
    /// How long ago the newest image came, seconds.
    pub(crate) age_s: Option<f64>,
    pub(crate) note: Option<String>,
    /// Errors before warnings; none where nobody has looked for any.
    pub(crate) problems: Option<Vec<ProblemStatus>>,
    /// Whether what is seen is a recording, in which nobody looks.
    pub(crate) recorded: bool,
    /// Taxels that are shown over time.
    pub(crate) traces: Vec<Trace>,
    /// The taxel that is told in words.
    pub(crate) cursor: Option<usize>,
}

impl Picture {
    /// Whether forces were made of counts.
    pub(crate) fn has_counts(&self) -> bool {
        !self.unit.is_empty()
    }

    /// The problems there are, or why nothing is known of them.
    pub(crate) fn problems(&self) -> Result<&[ProblemStatus], &'static str> {
        self.problems.as_deref().ok_or(unlooked(self.recorded))
    }
}

/// Why nothing is known of problems.
pub(crate) fn unlooked(recorded: bool) -> &'static str {
    match recorded {
        true => "not looked for in a recording",
        false => "not told yet",
    }
}

/// One taxel's newest reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TaxelNow {
    pub(crate) raw: RawTaxel,
    /// Signed press of x, y and z, counts, where the baseline is known.
    pub(crate) press: Option<[f32; 3]>,
}

/// What a taxel is, for the eye.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Condition {
    /// In use; the force above baseline.
    Force(f64),
    Faulty,
    /// No value of late.
    Missing,
}

/// A joint's name and angle; `None` where unknown.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Joint {
    pub(crate) name: String,
    pub(crate) angle_rad: Option<f32>,
}

/// A taxel's force over time: seconds before now, 0 or below, and force.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Trace {
    pub(crate) taxel: usize,
    pub(crate) points: Vec<(f64, f64)>,
}

impl TaxelNow {
    pub(crate) fn condition(&self) -> Condition {
        match (self.raw.freshness, self.raw.faults) {
            (Freshness::Fresh, 0) => Condition::Force(f64::from(self.raw.force)),
            (Freshness::Fresh, _) => Condition::Faulty,
            _ => Condition::Missing,
        }
    }

    /// Where the skin is pulled to along the board's x and y, as an arrow; `None` where that is little beside the
    /// press, or the press below `threshold`.
    pub(crate) fn shear(&self, threshold: f64) -> Option<&'static str> {
        const ARROWS: [&str; 8] = ["→", "↘", "↓", "↙", "←", "↖", "↑", "↗"];
        let [x, y, z] = self.press?.map(f64::from);
        let along = x.hypot(y);
        if !self.raw.contact || along < threshold || along < 0.25 * z.abs() {
            return None;
        }
        let eighths = (y.atan2(x) / std::f64::consts::FRAC_PI_4).round() as i32;
        Some(ARROWS[eighths.rem_euclid(8) as usize])
    }
}

/// Why a taxel is out of use, in words.
pub(crate) fn fault_in_words(fault: Fault) -> &'static str {
    match fault {
        Fault::Dead => "dead, it reads 0 or 65535 on every axis",
        Fault::Stuck => "stuck, it has not changed by one count for too long",
        Fault::Noisy => "noisy, far more so than the others",
        Fault::Wrapping => "wrapping around more often than a press explains",
        Fault::PaperRule => "flagged by the publication's rule",
        Fault::Status => "its board reports an error with it",
        Fault::Missing => "no value, or one that is too old",
        Fault::Masked => "switched off in the configuration",
    }
}
