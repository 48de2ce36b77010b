//! The four angles of a squeeze: how they are read, which of them are looked at together, and how little they move.

use crate::left_out::LeftOut;
use crate::plausibility::glitch::without_glitches;
use crate::squeeze::Squeeze;
use std::borrow::Cow;

/// Which angles are there: all, one lost, both potentiometers lost, one finger lost. The two fingers' angles are added up:
/// the sum does not change where the arm lies nearer to one of them.
pub(super) const READINGS: [[bool; 4]; 8] = [
    [true, true, true, true],
    [false, true, true, true],
    [true, false, true, true],
    [true, true, false, true],
    [true, true, true, false],
    [false, false, true, true],
    [false, true, false, true],
    [true, false, true, false],
];
/// The motors' angles among the four.
pub(super) const MOTORS: std::ops::Range<usize> = 2..4;
/// An angle that moves by no more than this until the peak is stuck, degrees: less than a step of either sensor.
pub(super) const STUCK_DEG: f64 = 0.05;
/// Of what a motor's angle goes through in all squeezes, it moves by this much in each. The least is 0.23 in the public
/// data and 0.15 in the simulation; in radians it is 0.02 at most.
pub(super) const LEAST_MOVED: f64 = 0.05;

/// Whether these angles are all that a reading needs.
pub(super) fn covers(has: [bool; 4], reading: [bool; 4]) -> bool {
    reading.iter().zip(has).all(|(needs, has)| has || !needs)
}

/// What is left out where only these angles are used.
pub(super) fn without(used: [bool; 4]) -> LeftOut {
    LeftOut {
        angles: used.map(|used| !used),
        touch: false,
    }
}

/// An angle by its number in `ANGLES`.
pub(super) fn as_read(squeeze: &Squeeze, angle: usize) -> &[f64] {
    let ([p0, p1], [a0, a1]) = (&squeeze.theta_p_deg, &squeeze.theta_a_deg);
    [p0, p1, a0, a1][angle]
}

/// The same without glitches, which potentiometers have; a motor's angle comes in a packet with a checksum.
pub(super) fn angle(squeeze: &Squeeze, angle: usize) -> Cow<'_, [f64]> {
    match as_read(squeeze, angle) {
        column if MOTORS.contains(&angle) => Cow::Borrowed(column),
        column => Cow::Owned(without_glitches(column)),
    }
}

/// The angles of a reading that are added up, as numbers of `ANGLES`: the motors', then the potentiometers'.
pub(super) fn columns_of(reading: [bool; 4]) -> impl Iterator<Item = Vec<usize>> {
    let of = move |pair: [usize; 2]| pair.into_iter().filter(|n| reading[*n]).collect::<Vec<_>>();
    [[2, 3], [0, 1]]
        .into_iter()
        .map(of)
        .filter(|pair| !pair.is_empty())
}

/// Smallest and largest number of a column.
pub(super) fn range(column: &[f64]) -> [f64; 2] {
    let known = || column.iter().copied().filter(|v| v.is_finite());
    [
        known().fold(f64::INFINITY, f64::min),
        known().fold(f64::NEG_INFINITY, f64::max),
    ]
}
