//! What an untouched taxel reads, how noisy it is, and what a newton does to it (protocols.md 2.6).

use crate::random::{bell, between, bits};
use serde::Deserialize;
use taxel_skin::Protocol;

/// Counts per newton of a uSPa46 at high range: x, y 1 / 0.000628 N, z 1 / 0.000729 N (protocols.md 2.6).
const COUNTS_PER_NEWTON: [f64; 3] = [1592.0, 1592.0, 1372.0];
/// Steps of eight bits that a newton moves a pad of the iCub's by, and z of a CySkin-type sensor. No source says; these
/// are assumptions that make a firm press (6 N) reach the end of the iCub's range.
const ICUB_STEPS_PER_NEWTON: f64 = 40.0;
const CAPACITANCE_PER_NEWTON: f64 = 2000.0;
/// Idle level and noise deviation of CySkin-type sensors; assumptions, too.
const CAPACITANCE: Axis = Axis {
    idle: [20_000.0, 26_000.0],
    sd: [5.0, 12.0],
};
/// A pad of the iCub's after calibration, away from its no-load value, steps.
const ICUB: Axis = Axis {
    idle: [-0.3, 0.3],
    sd: [0.1, 0.25],
};
/// Counts that the decoder makes of a step of the iCub's.
const ICUB_COUNTS_PER_STEP: f64 = 16.0;
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
#[derive(Clone, Copy)]
struct Axis {
    idle: [f64; 2],
    sd: [f64; 2],
}

impl Levels {
    fn axes(self) -> [Axis; 3] {
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

    /// The properties of one taxel of a board that speaks `protocol`, drawn from the seed.
    pub(crate) fn taxel(self, seed: u64, taxel: u16, protocol: Protocol) -> Character {
        const STILL: Axis = Axis {
            idle: [0.0; 2],
            sd: [0.0; 2],
        };
        let z_per_newton = self.counts_per_newton()[2];
        let (axes, scale, decoded) = match protocol {
            Protocol::IcubMtb3 | Protocol::IcubMtb4 => {
                let scale = [0.0, 0.0, ICUB_STEPS_PER_NEWTON / z_per_newton];
                ([STILL, STILL, ICUB], scale, ICUB_COUNTS_PER_STEP)
            }
            Protocol::Cyskin | Protocol::CpmFinger => {
                let scale = [0.0, 0.0, CAPACITANCE_PER_NEWTON / z_per_newton];
                ([STILL, STILL, CAPACITANCE], scale, 1.0)
            }
            _ => (self.axes(), [1.0; 3], 1.0),
        };
        let draw = |what: u64, from, to| between(bits(seed, STREAM, u64::from(taxel) << 8 | what), from, to);
        Character {
            idle: std::array::from_fn(|a| draw(a as u64, axes[a].idle[0], axes[a].idle[1])),
            sd: std::array::from_fn(|a| draw(3 + a as u64, axes[a].sd[0], axes[a].sd[1])),
            gain: draw(6, 1.0 - GAIN_SPREAD, 1.0 + GAIN_SPREAD),
            scale,
            decoded,
        }
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
