//! Force quantisation, eqs (3) to (7): the force level of each contact.

use taxel_cluster::{Kmeans1d, assign1d, distinct_up_to, lloyd1d, uniform};

use crate::contacts::Contacts;
use crate::session::Session;
use crate::steps::{nearest_in_ratio, steps};
use taxel_hand::{ForceFit, LevelSteps, Profile};

/// The force stage: its codebook and the level of each contact.
#[derive(Debug)]
pub(crate) struct Levels {
    /// Force of each level, ascending: `mu_k`.
    pub(crate) codebook: Vec<f64>,
    /// Level of each contact, from 0.
    pub(crate) level: Vec<u16>,
    sums: Vec<(f64, u32)>,
    order: Vec<u16>,
    rank: Vec<u16>,
    /// Forces in ascending order.
    sorted: Vec<f64>,
    /// The different forces in ascending order, and how many contacts have each.
    values: Vec<f64>,
    counts: Vec<u32>,
    solver: Kmeans1d,
    session: Option<Session>,
    /// Level that each taxel (by raster order) had in the last frame, from 1; 0 where it had none.
    held: Vec<u16>,
}

impl Levels {
    /// Memory for `taxels` contacts.
    pub(crate) fn new(profile: &Profile, taxels: usize) -> Self {
        let most = usize::from(profile.levels);
        let mut codebook = Vec::with_capacity(most);
        codebook.extend_from_slice(&profile.codebook);
        if let (LevelSteps::Equal | LevelSteps::Weber, Some(least), Some(greatest)) =
            (profile.level_steps, profile.force_min, profile.force_max)
        {
            codebook.resize(most, 0.0);
            steps(profile.level_steps, least, greatest, &mut codebook);
        }
        Self {
            codebook,
            level: Vec::with_capacity(taxels),
            sums: vec![(0.0, 0); most],
            order: Vec::with_capacity(most),
            rank: vec![0; most],
            sorted: Vec::with_capacity(taxels),
            values: Vec::with_capacity(taxels),
            counts: Vec::with_capacity(taxels),
            solver: Kmeans1d::new(taxels, most),
            session: profile.codebook_learning.map(|_| Session::new(most)),
            held: vec![0; taxels],
        }
    }

    /// Fits levels to the contacts of a frame, or assigns them to the constant codebook, and gives
    /// each contact its level.
    pub(crate) fn quantise(&mut self, profile: &Profile, contacts: &Contacts) {
        let forces = &contacts.force;
        self.level.clear();
        self.level.resize(forces.len(), 0);
        if !profile.codebook.is_empty() {
            assign1d(forces, &self.codebook, &mut self.level);
        } else if let Some(learning) = profile.codebook_learning {
            let most = usize::from(profile.levels);
            (self.session.iter_mut())
                .for_each(|session| session.learn(forces, learning.forgetting, most, &mut self.codebook));
            if !forces.is_empty() {
                assign1d(forces, &self.codebook, &mut self.level);
            }
        } else if profile.level_steps != LevelSteps::Fitted {
            self.steps(profile, forces);
        } else {
            match profile.force_fit() {
                ForceFit::Lloyd => self.lloyd(profile, forces),
                ForceFit::Exact => self.exact(profile, forces),
            }
        }
        if profile.level_hysteresis > 0.0 {
            self.hold(profile.level_hysteresis, contacts);
        }
    }

    /// Levels in equal steps over the range of the profile, constant, or else over that of the
    /// frame's forces.
    fn steps(&mut self, profile: &Profile, forces: &[f64]) {
        if profile.force_min.is_none() {
            self.codebook.clear();
            self.codebook.resize(usize::from(profile.levels), 0.0);
            let levels = distinct_up_to(forces, &mut self.codebook);
            self.codebook.truncate(levels);
            let least = forces.iter().copied().fold(f64::INFINITY, f64::min);
            let greatest = forces.iter().copied().fold(0.0, f64::max);
            if levels > 0 {
                steps(profile.level_steps, least, greatest, &mut self.codebook);
            }
        }
        if profile.level_steps == LevelSteps::Weber {
            for (level, force) in self.level.iter_mut().zip(forces) {
                *level = nearest_in_ratio(*force, &self.codebook) as u16;
            }
        } else if !forces.is_empty() {
            assign1d(forces, &self.codebook, &mut self.level);
        }
    }

    /// The levels with the least squared error there is, [`Kmeans1d`]. Each contact has the level
    /// of its cluster, which is the nearest.
    fn exact(&mut self, profile: &Profile, forces: &[f64]) {
        self.sorted.clear();
        self.sorted.extend_from_slice(forces);
        self.sorted.sort_unstable_by_key(|force| force.to_bits());
        let levels = usize::from(profile.levels);
        let all_differ = self.sorted.windows(2).all(|pair| pair[0] != pair[1]);
        let (values, found) = if all_differ {
            (&self.sorted, self.solver.solve(&self.sorted, levels))
        } else {
            self.values.clear();
            self.counts.clear();
            for equal in self.sorted.chunk_by(|a, b| a == b) {
                self.values.push(equal[0]);
                self.counts.push(equal.len() as u32);
            }
            let found = self.solver.solve_weighted(&self.values, &self.counts, levels);
            (&self.values, found)
        };
        self.codebook.clear();
        match found {
            Ok(found) => {
                self.codebook.extend_from_slice(found.centroids);
                for start in found.starts.iter().skip(1) {
                    let border = values[*start as usize];
                    for (level, force) in self.level.iter_mut().zip(forces) {
                        *level += u16::from(*force >= border);
                    }
                }
            }
            Err(error) => unreachable!("the contact list holds finite forces within its capacity: {error}"),
        }
    }

    /// Keeps contacts at the level their taxel had, unless the force is past the border by a share
    /// of the distance between the levels.
    fn hold(&mut self, share: f64, contacts: &Contacts) {
        let levels = &self.codebook;
        for ((level, force), rank) in self.level.iter_mut().zip(&contacts.force).zip(&contacts.rank) {
            let held = usize::from(self.held[usize::from(*rank)]);
            if held == 0 || held > levels.len() {
                continue;
            }
            let held = held - 1;
            let past = |below: usize| {
                0.5 * (levels[below] + levels[below + 1]) + {
                    let gap = levels[below + 1] - levels[below];
                    if below < held { -share * gap } else { share * gap }
                }
            };
            let above = held == 0 || *force >= past(held - 1);
            let below = held + 1 == levels.len() || *force <= past(held);
            if above && below {
                *level = held as u16;
            }
        }
        self.held.fill(0);
        for (level, rank) in self.level.iter().zip(&contacts.rank) {
            self.held[usize::from(*rank)] = level + 1;
        }
    }

    /// The publication's Table I: Lloyd's iterations from a uniform start.
    ///
    /// - K: `min(K_D, distinct forces)` clusters.
    /// - init: [`uniform`] over the least to the greatest force of the frame.
    /// - distance, ties, update, empty cluster, iterations: [`lloyd1d`], `I_D` times.
    /// - numbering: clusters in ascending order of their centroids; those that ended empty stay in
    ///   the codebook.
    fn lloyd(&mut self, profile: &Profile, forces: &[f64]) {
        self.codebook.clear();
        self.codebook.resize(usize::from(profile.levels), 0.0);
        let clusters = distinct_up_to(forces, &mut self.codebook);
        self.codebook.truncate(clusters);
        let least = forces.iter().copied().fold(f64::INFINITY, f64::min);
        let greatest = forces.iter().copied().fold(0.0, f64::max);
        uniform(least, greatest, &mut self.codebook);
        lloyd1d(
            forces,
            profile.force_iterations,
            &mut self.codebook,
            &mut self.level,
            &mut self.sums[..clusters],
        );
        self.number_ascending();
    }

    /// Renumbers the levels so that their forces ascend; among equal forces the lower number stays first.
    fn number_ascending(&mut self) {
        if self.codebook.is_sorted() {
            return;
        }
        let codebook = &mut self.codebook;
        self.order.clear();
        self.order.extend(0..codebook.len() as u16);
        self.order.sort_unstable_by(|a, b| {
            codebook[usize::from(*a)]
                .total_cmp(&codebook[usize::from(*b)])
                .then(a.cmp(b))
        });
        for (rank, k) in self.order.iter().enumerate() {
            self.rank[usize::from(*k)] = rank as u16;
        }
        codebook.sort_unstable_by(f64::total_cmp);
        for level in &mut self.level {
            *level = self.rank[usize::from(*level)];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quantise(profile: &Profile, forces: &[f64]) -> (Vec<f64>, Vec<u16>) {
        let geometry = taxel_hand::Geometry::grid(forces.len().max(1) as u16, 1).expect("a grid that fits");
        let mut frame = taxel_hand::ForceFrame::new(geometry.taxels.len());
        frame.contact[..forces.len()].fill(true);
        frame.force[..forces.len()].copy_from_slice(forces);
        let places =
            crate::actuator_groups::places(&geometry, taxel_hand::Coordinates::Pixels).expect("pixels");
        let mut contacts = Contacts::new(&geometry, &places);
        contacts.collect(&frame);
        let mut stage = Levels::new(profile, forces.len());
        stage.quantise(profile, &contacts);
        (stage.codebook, stage.level)
    }

    fn lloyd(levels: u16, iterations: u16, codebook: &[f64], forces: &[f64]) -> (Vec<f64>, Vec<u16>) {
        let profile = Profile {
            levels,
            force_fit: Some(ForceFit::Lloyd).filter(|_| codebook.is_empty()),
            force_iterations: iterations,
            codebook: codebook.to_vec(),
            ..Profile::default()
        };
        quantise(&profile, forces)
    }

    #[test]
    fn levels_follow_the_recipe() {
        for (name, levels, codebook, forces, want, level) in [
            ("no contact", 4, &[][..], &[][..], &[][..], &[][..]),
            (
                "no contact, constant codebook",
                4,
                &[1.0, 2.0],
                &[],
                &[1.0, 2.0],
                &[],
            ),
            ("one contact", 4, &[], &[7.0], &[7.0], &[0]),
            ("all equal", 4, &[], &[7.0, 7.0, 7.0], &[7.0], &[0, 0, 0]),
            ("fewer than K_D", 4, &[], &[9.0, 1.0], &[1.0, 9.0], &[1, 0]),
            ("one level", 1, &[], &[1.0, 2.0, 6.0], &[3.0], &[0, 0, 0]),
            (
                "an empty level stays",
                3,
                &[],
                &[1.0, 2.0, 100.0],
                &[1.5, 50.5, 100.0],
                &[0, 0, 2],
            ),
            ("saturated", 2, &[], &[65535.0; 3], &[65535.0], &[0, 0, 0]),
            (
                "saturated, squared",
                2,
                &[],
                &[12_884_508_675.0, 12_884_508_674.0, 12_884_508_675.0],
                &[12_884_508_674.0, 12_884_508_675.0],
                &[1, 0, 1],
            ),
            (
                "half way between two entries of a constant codebook goes down",
                4,
                &[10.0, 20.0, 40.0],
                &[15.0, 15.5, 30.0, 1000.0, 1.0],
                &[10.0, 20.0, 40.0],
                &[0, 1, 1, 2, 0],
            ),
        ] {
            let got = lloyd(levels, 10, codebook, forces);
            assert_eq!(got, (want.to_vec(), level.to_vec()), "{name}");
        }
    }

    #[test]
    fn levels_out_of_order_are_renumbered() {
        let profile = Profile::default();
        let mut stage = Levels::new(&profile, 4);
        stage.codebook = vec![3.0, 1.0, 2.0, 1.0];
        stage.level = vec![0, 1, 2, 3];
        stage.number_ascending();
        assert_eq!(stage.codebook, [1.0, 1.0, 2.0, 3.0]);
        assert_eq!(stage.level, [3, 0, 2, 1]);
    }
}
