//! A codebook for the session, learned while it is used.

use std::ops::Range;
use taxel_cluster::Kmeans1d;
use taxel_hand::{FORCE_MAX, FORCE_MIN};

/// Bins: sixteen for each octave of the forces that a contact can have.
const BINS: usize = cell(FORCE_MAX) - cell(FORCE_MIN) + 1;
/// Weight below which a bin is empty. It is far too little to move a level, since what is felt now weighs one, and
/// numbers that fade on and on would end among the subnormal ones, which processors are slow with.
const FADED: f64 = 1e-200;
/// Weight that the solver is given for a contact of this frame, and the most it is given in all.
const UNIT: f64 = 1024.0;
const TOTAL: f64 = (1u64 << 30) as f64;

/// The forces felt so far, as a histogram that fades, and the best levels for it.
#[derive(Debug)]
pub(crate) struct Session {
    /// Weight and weighted sum of the forces of each bin.
    bins: Vec<[f64; 2]>,
    /// From the bin of the least force felt so far to that of the greatest: the others are empty.
    felt: Range<usize>,
    values: Vec<f64>,
    weights: Vec<u32>,
    solver: Kmeans1d,
}

impl Session {
    pub(crate) fn new(levels: usize) -> Self {
        Self {
            bins: vec![[0.0; 2]; BINS],
            felt: Range { start: BINS, end: 0 },
            values: Vec::with_capacity(BINS),
            weights: Vec::with_capacity(BINS),
            solver: Kmeans1d::new(BINS, levels),
        }
    }

    /// Lets what is known fade by a share, learns the forces of a frame, and writes the levels with
    /// the least squared error for all that is known; a bin counts as its mean. The work is bounded
    /// by the number of bins between the least and the greatest force felt so far, and of forces,
    /// which are from [`FORCE_MIN`] to [`FORCE_MAX`].
    pub(crate) fn learn(&mut self, forces: &[f64], forgetting: f64, levels: usize, codebook: &mut Vec<f64>) {
        if forces.is_empty() {
            return;
        }
        for force in forces {
            let bin = bin(*force);
            self.felt = self.felt.start.min(bin)..self.felt.end.max(bin + 1);
        }
        let keep = 1.0 - forgetting;
        for bin in &mut self.bins[self.felt.clone()] {
            let [weight, sum] = bin.map(|v| v * keep);
            *bin = if weight < FADED { [0.0; 2] } else { [weight, sum] };
        }
        for force in forces {
            let [weight, sum] = &mut self.bins[bin(*force)];
            *weight += 1.0;
            *sum += force;
        }
        let bins = &self.bins[self.felt.clone()];
        let total: f64 = bins.iter().map(|[weight, _]| weight).sum();
        let unit = UNIT.min(TOTAL / total);
        self.values.clear();
        self.weights.clear();
        for [weight, sum] in bins {
            let parts = (weight * unit) as u32;
            let mean = sum / weight;
            if parts > 0 && self.values.last().is_none_or(|last| mean > *last) {
                self.values.push(mean);
                self.weights.push(parts);
            }
        }
        match self.solver.solve_weighted(&self.values, &self.weights, levels) {
            Ok(found) => {
                codebook.clear();
                codebook.extend_from_slice(found.centroids);
            }
            Err(error) => unreachable!("the means of bins ascend and are finite: {error}"),
        }
    }
}

/// The bin of a force.
fn bin(force: f64) -> usize {
    cell(force) - cell(FORCE_MIN)
}

/// The exponent of a positive number and the first four bits of its mantissa, as one number that ascends with it.
const fn cell(force: f64) -> usize {
    (force.to_bits() >> 48) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    fn learned(frames: &[&[f64]], forgetting: f64, levels: usize) -> Vec<f64> {
        let mut session = Session::new(levels);
        let mut codebook = Vec::new();
        for frame in frames {
            session.learn(frame, forgetting, levels, &mut codebook);
        }
        codebook
    }

    #[test]
    fn levels_of_all_frames_are_learned() {
        assert_eq!(
            learned(&[&[10.0, 20.0], &[100.0], &[]], 0.0, 3),
            [10.0, 20.0, 100.0]
        );
        assert_eq!(
            learned(&[&[10.0, 100.0], &[104.0, 104.0]], 0.0, 2),
            [10.0, (100.0 + 208.0) / 3.0]
        );
    }

    #[test]
    fn what_is_long_past_is_forgotten() {
        let mut frames: Vec<&[f64]> = vec![&[1000.0; 20]];
        frames.extend(vec![&[10.0, 20.0][..]; 60]);
        assert_eq!(learned(&frames, 0.3, 2), [10.0, 20.0]);
        assert_eq!(learned(&frames, 0.0, 2).last(), Some(&1000.0));
    }

    #[test]
    fn an_octave_of_any_force_that_a_contact_can_have_is_sixteen_bins() {
        assert_eq!((bin(FORCE_MIN), bin(FORCE_MAX)), (0, BINS - 1));
        for octave in -126..126 {
            let force = 2f64.powi(octave);
            let of = |part: f64| bin(force * part) - bin(force);
            let got = [1.0, 1.0624, 1.0625, 1.9374, 1.9375, 1.9999, 2.0].map(of);
            assert_eq!(got, [0, 0, 1, 14, 15, 15, 16], "2^{octave}");
        }
    }

    #[test]
    fn what_fades_for_ever_is_nothing_in_the_end() {
        for (forgetting, frames) in [(1.0, 1), (0.9, 400), (0.3, 3000), (0.02, 40_000)] {
            let mut session = Session::new(2);
            let mut codebook = Vec::new();
            session.learn(&[FORCE_MIN, 1000.0, FORCE_MAX], forgetting, 2, &mut codebook);
            for _ in 0..frames {
                session.learn(&[10.0], forgetting, 2, &mut codebook);
            }
            let left: Vec<usize> = (0..BINS).filter(|n| session.bins[*n] != [0.0; 2]).collect();
            assert_eq!(left, [bin(10.0)], "{forgetting}");
        }
    }
}
