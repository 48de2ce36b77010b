//! What an untouched taxel reads, how noisy it is, and what a newton does to it (docs/protocols.md,
//! "uSkin values").

use crate::random::{bell, between, bits};
use serde::Deserialize;

/// Counts per newton of a uSPa46 at high range: x, y 1 / 0.000628 N, z 1 / 0.000729 N (docs/protocols.md,
/// "uSkin values").
const COUNTS_PER_NEWTON: [f64; 3] = [1592.0, 1592.0, 1372.0];
/// How far a taxel's sensitivity is from the nominal one, at most.
const GAIN_SPREAD: f64 = 0.15;

/// Which recording's idle levels and noise the boards imitate.
///
/// The sensitivity that goes with each is an assumption where the recording does not tell it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Levels {
    /// `LOG7` of kolintang/skin_sensor: x, y about 32,768, z about 13,000.
    #[default]
    Waseda,
    /// `debug_0B*Z` of the same: higher gain, so that a firm press wraps modulo 2^16.
    WasedaHighGain,
    /// tactile_prediction's trials: x about 48,000, y 16,000, z 37,000 to 47,000, hardly any noise.
    PickAndMove,
}

/// Lowest and highest idle level and noise deviation of one axis, counts.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Axis {
    pub(crate) idle: [f64; 2],
    pub(crate) sd: [f64; 2],
}

/// What the taxels of one kind of board have in common.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Nature {
    pub(crate) axes: [Axis; 3],
    /// What a count of a contact on x, y, z is to them: 1 for uSkin, in whose counts contacts are.
    pub(crate) scale: [f64; 3],
    /// Counts that the decoder makes of one of theirs.
    pub(crate) decoded: f64,
}

impl Nature {
    /// Taxels of one axis, z, that a newton moves by this many of their counts.
    pub(crate) fn of_one_axis(levels: Levels, z: Axis, counts_per_newton: f64, decoded: f64) -> Self {
        const STILL: Axis = Axis {
            idle: [0.0; 2],
            sd: [0.0; 2],
        };
        let z_per_newton = levels.counts_per_newton()[2];
        Self {
            axes: [STILL, STILL, z],
            scale: [0.0, 0.0, counts_per_newton / z_per_newton],
            decoded,
        }
    }

    /// The properties of one taxel, drawn from the seed.
    pub(crate) fn taxel(&self, seed: u64, taxel: u16) -> Character {
        let draw = |what: u64, from, to| between(bits(seed, STREAM, u64::from(taxel) << 8 | what), from, to);
        let axes = &self.axes;
        Character {
            idle: std::array::from_fn(|a| draw(a as u64, axes[a].idle[0], axes[a].idle[1])),
            sd: std::array::from_fn(|a| draw(3 + a as u64, axes[a].sd[0], axes[a].sd[1])),
            gain: draw(6, 1.0 - GAIN_SPREAD, 1.0 + GAIN_SPREAD),
            scale: self.scale,
            decoded: self.decoded,
        }
    }
}

impl Levels {
    /// Those of a uSkin taxel.
    pub(crate) fn axes(self) -> [Axis; 3] {
        let axis = |i0, i1, s0, s1| Axis {
            idle: [i0, i1],
            sd: [s0, s1],
        };
        match self {
            Levels::Waseda => [
                axis(32_695.0, 32_875.0, 2.0, 2.6),
                axis(32_577.0, 32_859.0, 3.7, 4.8),
                axis(12_300.0, 13_400.0, 12.0, 45.0),
            ],
            Levels::WasedaHighGain => [
                axis(21_000.0, 29_000.0, 5.0, 13.0),
                axis(10_000.0, 31_500.0, 8.0, 17.0),
                axis(5_000.0, 9_400.0, 10.0, 37.0),
            ],
            Levels::PickAndMove => [
                axis(46_000.0, 50_100.0, 0.3, 0.7),
                axis(15_800.0, 17_900.0, 0.3, 1.0),
                axis(37_360.0, 47_240.0, 0.4, 2.6),
            ],
        }
    }

    /// Counts that one newton moves x, y and z by, before a taxel's own gain.
    pub(crate) fn counts_per_newton(self) -> [f64; 3] {
        let sensitivity = match self {
            Levels::WasedaHighGain => 4.0,
            Levels::Waseda | Levels::PickAndMove => 1.0,
        };
        COUNTS_PER_NEWTON.map(|c| c * sensitivity)
    }
}

/// Random numbers that belong to taxels as such.
const STREAM: u64 = 0x7A78;
/// Random numbers that belong to one reading of a taxel; one stream per axis.
const NOISE_STREAM: u64 = 0x6E6F;

/// What distinguishes a taxel from its neighbours.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Character {
    /// Reading of x, y, z when nothing touches it, counts.
    pub(crate) idle: [f64; 3],
    /// Standard deviation of its noise, counts.
    pub(crate) sd: [f64; 3],
    /// How its sensitivity compares with the nominal one.
    pub(crate) gain: f64,
    /// What a count of a contact on x, y, z is to it: 1 for uSkin, in whose counts contacts are.
    pub(crate) scale: [f64; 3],
    /// Counts that the decoder makes of one of its own.
    pub(crate) decoded: f64,
}

/// White noise of unit deviation on one axis of a taxel at one instant.
pub(crate) fn noise(seed: u64, taxel: u16, axis: usize, t_ns: u64) -> f64 {
    bell(bits(
        seed,
        NOISE_STREAM << 32 | (axis as u64) << 16 | u64::from(taxel),
        t_ns,
    ))
}
