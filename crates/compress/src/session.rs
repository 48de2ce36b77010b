//! A codebook for the session, learned while it is used.

use taxel_cluster::Kmeans1d;

/// Bins per octave of force: neighbours differ by 4.4 %.
const PER_OCTAVE: usize = 16;
/// Octaves that have bins of their own, from `2^LOWEST`; forces beyond are gathered in the bins at the ends.
const OCTAVES: usize = 64;
const LOWEST: i32 = -16;
/// Weight that the solver is given for a contact of this frame, and the most it is given in all.
const UNIT: f64 = 1024.0;
const TOTAL: f64 = (1u64 << 30) as f64;

/// The forces felt so far, as a histogram that fades, and the best levels for it.
#[derive(Debug)]
pub(crate) struct Session {
    /// Weight and weighted sum of the forces of each bin.
    bins: Vec<[f64; 2]>,
    values: Vec<f64>,
    weights: Vec<u32>,
    solver: Kmeans1d,
}

impl Session {
    pub(crate) fn new(levels: usize) -> Self {
        let bins = OCTAVES * PER_OCTAVE;
        Self {
            bins: vec![[0.0; 2]; bins],
            values: Vec::with_capacity(bins),
            weights: Vec::with_capacity(bins),
            solver: Kmeans1d::new(bins, levels),
        }
    }

    /// Lets what is known fade by a share, learns the forces of a frame, and writes the levels with
    /// the least squared error for all that is known; a bin counts as its mean. The work is bounded
    /// by the number of bins and of forces.
    pub(crate) fn learn(&mut self, forces: &[f64], forgetting: f64, levels: usize, codebook: &mut Vec<f64>) {
        if forces.is_empty() {
            return;
        }
        let keep = 1.0 - forgetting;
        for [weight, sum] in &mut self.bins {
            *weight *= keep;
            *sum *= keep;
        }
        for force in forces {
            let [weight, sum] = &mut self.bins[bin(*force)];
            *weight += 1.0;
            *sum += force;
        }
        let total: f64 = self.bins.iter().map(|[weight, _]| weight).sum();
        let unit = UNIT.min(TOTAL / total);
        self.values.clear();
        self.weights.clear();
        for [weight, sum] in &self.bins {
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

/// The bin of a positive force: its exponent and the first four bits of its mantissa.
fn bin(force: f64) -> usize {
    let first = ((1023 + LOWEST) as usize) * PER_OCTAVE;
    let place = (force.to_bits() >> 48) as usize;
    place.saturating_sub(first).min(OCTAVES * PER_OCTAVE - 1)
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
    fn forces_of_every_size_have_a_bin() {
        for (force, want) in [
            (5e-324, 0),
            (1.0 / 65536.0, 0),
            (1.0, 16 * PER_OCTAVE),
            (1.9999, 17 * PER_OCTAVE - 1),
            (1e100, OCTAVES * PER_OCTAVE - 1),
        ] {
            assert_eq!(bin(force), want, "{force}");
        }
    }
}
