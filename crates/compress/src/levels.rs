//! Force quantisation, eqs (3) to (7): the force level of each contact.

use taxel_cluster::{Kmeans1d, assign1d, lloyd1d, nearest1d, uniform};

use crate::contacts::Contacts;
use crate::session::Session;
use crate::steps::{nearest_in_ratio, steps};
use taxel_hand::{ForceFit, LevelSteps, Profile};

/// The force stage: its codebook and the level of each contact.
#[derive(Debug)]
pub(crate) struct Levels {
    /// Force of each level, ascending: `mu_k`. Neighbours are equal where a frame has fewer different
    /// forces than levels.
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

    /// The level nearest to a force; of levels with equal forces the highest.
    pub(crate) fn nearest(&self, force: f64) -> u16 {
        let mut level = nearest1d(force, &self.codebook);
        while self.codebook.get(level + 1) == Some(&self.codebook[level]) {
            level += 1;
        }
        level as u16
    }

    /// Levels in equal steps over the range of the profile, constant, or else over that of the
    /// frame's forces.
    fn steps(&mut self, profile: &Profile, forces: &[f64]) {
        let follows = profile.force_min.is_none();
        if follows {
            self.codebook.clear();
            if let Some((least, greatest)) = range(forces) {
                self.codebook.resize(usize::from(profile.levels), 0.0);
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
        if follows {
            self.lift_strongest(forces);
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
        self.spread(levels);
    }

    /// Keeps contacts at the level their taxel had, [`Self::keep`].
    fn hold(&mut self, share: f64, contacts: &Contacts) {
        for n in 0..contacts.len() {
            let held = self.held[usize::from(contacts.rank[n])];
            self.level[n] = self.keep(share, held, contacts.force[n], self.level[n]);
        }
        self.held.fill(0);
        for (level, rank) in self.level.iter().zip(&contacts.rank) {
            self.held[usize::from(*rank)] = level + 1;
        }
    }

    /// The level of a force that had level `held` in the last frame (from 1; 0 for none): that one, unless the force is
    /// past its border by more than a share of the distance between the levels. Levels with equal forces are one.
    pub(crate) fn keep(&self, share: f64, held: u16, force: f64, level: u16) -> u16 {
        let levels = &self.codebook;
        let Some(first) = usize::from(held)
            .checked_sub(1)
            .filter(|held| *held < levels.len())
        else {
            return level;
        };
        let own = levels[first];
        let held = first + levels[first..].iter().take_while(|l| **l == own).count() - 1;
        let below = levels[..first].iter().rfind(|l| **l < own);
        let above = levels.get(held + 1);
        let far_below = below.is_some_and(|l| force < 0.5 * (l + own) - share * (own - l));
        let far_above = above.is_some_and(|l| force > 0.5 * (own + l) + share * (l - own));
        if far_below || far_above {
            level
        } else {
            held as u16
        }
    }

    /// The publication's Table I: Lloyd's iterations from a uniform start.
    ///
    /// - K: always `K_D` clusters.
    /// - init: [`uniform`] over the least to the greatest force of the frame.
    /// - distance, ties, update, empty cluster, iterations: [`lloyd1d`], `I_D` times.
    /// - numbering: clusters in ascending order of their centroids; those that ended empty stay in
    ///   the codebook.
    /// - top: [`Self::lift_strongest`].
    fn lloyd(&mut self, profile: &Profile, forces: &[f64]) {
        self.codebook.clear();
        let Some((least, greatest)) = range(forces) else {
            return;
        };
        self.codebook.resize(usize::from(profile.levels), 0.0);
        uniform(least, greatest, &mut self.codebook);
        lloyd1d(
            forces,
            profile.force_iterations,
            &mut self.codebook,
            &mut self.level,
            &mut self.sums,
        );
        self.number_ascending();
        self.lift_strongest(forces);
    }

    /// Puts the strongest contacts, and those that share their level, into the highest level. They are there already
    /// unless levels are equal, or differ by rounding only.
    fn lift_strongest(&mut self, forces: &[f64]) {
        let strongest = (forces.iter().zip(&self.level)).max_by(|(a, _), (b, _)| a.total_cmp(b));
        let highest = self.codebook.len().saturating_sub(1) as u16;
        if let Some(strongest) = strongest
            .map(|(_, level)| *level)
            .filter(|level| *level < highest)
        {
            for level in self.level.iter_mut().filter(|level| **level == strongest) {
                *level = highest;
            }
        }
    }

    /// Spreads the K levels that were found over the K_D of the display: the k-th is level `floor(k K_D / K + 1/2)`,
    /// and the levels from the one before it up to there have its force.
    fn spread(&mut self, levels: usize) {
        let found = self.codebook.len();
        if found == 0 || found == levels {
            return;
        }
        let place = |k: usize| (2 * k * levels + found) / (2 * found);
        self.codebook.resize(levels, 0.0);
        for k in (0..found).rev() {
            let force = self.codebook[k];
            self.codebook[place(k)..place(k + 1)].fill(force);
        }
        for level in &mut self.level {
            *level = place(usize::from(*level) + 1) as u16 - 1;
        }
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

/// The least and the greatest of the forces, if there are any.
fn range(forces: &[f64]) -> Option<(f64, f64)> {
    let (first, others) = forces.split_first()?;
    Some(
        (others.iter()).fold((*first, *first), |(least, greatest), force| {
            (least.min(*force), greatest.max(*force))
        }),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

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
            ("one contact", 4, &[], &[7.0], &[7.0; 4], &[3]),
            ("all equal", 4, &[], &[7.0, 7.0, 7.0], &[7.0; 4], &[3, 3, 3]),
            (
                "fewer than K_D",
                4,
                &[],
                &[9.0, 1.0],
                &[1.0, 4.0, 6.0, 9.0],
                &[3, 0],
            ),
            ("one level", 1, &[], &[1.0, 2.0, 6.0], &[3.0], &[0, 0, 0]),
            (
                "an empty level stays",
                3,
                &[],
                &[1.0, 2.0, 100.0],
                &[1.5, 50.5, 100.0],
                &[0, 0, 2],
            ),
            ("saturated", 2, &[], &[65535.0; 3], &[65535.0; 2], &[1, 1, 1]),
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
    fn levels_found_are_spread_over_those_of_the_display() {
        let profile = |levels| Profile {
            levels,
            ..Profile::default()
        };
        for (levels, forces, want, level) in [
            (8, &[7.0][..], &[7.0; 8][..], &[7][..]),
            (4, &[9.0, 3.0], &[3.0, 3.0, 9.0, 9.0], &[3, 1]),
            (5, &[9.0, 3.0], &[3.0, 3.0, 3.0, 9.0, 9.0], &[4, 2]),
            (5, &[1.0, 9.0, 3.0], &[1.0, 1.0, 3.0, 9.0, 9.0], &[1, 4, 2]),
            (2, &[1.0, 3.0, 9.0], &[2.0, 9.0], &[0, 0, 1]),
        ] {
            let got = quantise(&profile(levels), forces);
            assert_eq!(got, (want.to_vec(), level.to_vec()), "{forces:?} in {levels}");
        }
    }

    #[test]
    fn of_levels_with_one_force_the_highest_is_the_nearest() {
        let mut stage = Levels::new(&Profile::default(), 1);
        stage.codebook = vec![3.0, 3.0, 9.0, 9.0];
        assert_eq!(
            [1.0, 3.0, 6.0, 6.1].map(|force| stage.nearest(force)),
            [1, 1, 1, 3]
        );
    }

    #[test]
    fn of_levels_with_one_force_hysteresis_holds_the_highest() {
        let profile = Profile {
            levels: 4,
            level_hysteresis: 0.3,
            force_fit: Some(ForceFit::Lloyd),
            ..Profile::default()
        };
        let geometry = taxel_hand::Geometry::grid(4, 1).expect("a grid that fits");
        let places =
            crate::actuator_groups::places(&geometry, taxel_hand::Coordinates::Pixels).expect("pixels");
        let mut contacts = Contacts::new(&geometry, &places);
        let mut stage = Levels::new(&profile, 4);
        let mut frame = taxel_hand::ForceFrame::new(4);
        for (forces, level) in [([2.0, 3.0, 6.0, 9.0], 0), ([2.0, 0.0, 0.0, 0.0], 3)] {
            frame.force.copy_from_slice(&forces);
            frame.contact = forces.map(|force| force > 0.0).to_vec();
            contacts.collect(&frame);
            stage.quantise(&profile, &contacts);
            assert_eq!(stage.level[0], level, "{forces:?}");
        }
    }

    /// Forces that hardly differ, or not at all, and those at the ends of the range.
    fn hard_forces() -> impl Strategy<Value = Vec<f64>> {
        let around = |force: f64| (0u64..4).prop_map(move |step| f64::from_bits(force.to_bits() + step));
        let close = prop_oneof![
            Just(1.0),
            Just(5e9),
            Just(taxel_hand::FORCE_MIN),
            Just(taxel_hand::FORCE_MAX / 2.0)
        ]
        .prop_flat_map(move |force| prop::collection::vec(around(force), 1..40));
        let apart = prop::collection::vec((-37i32..38).prop_map(|power| 10f64.powi(power)), 1..40);
        let few = prop::collection::vec((1u8..5).prop_map(f64::from), 1..40);
        prop_oneof![close, apart, few]
    }

    proptest! {
        #[test]
        fn the_strongest_force_of_a_frame_is_the_full_drive(
            exact in any::<bool>(),
            of in prop_oneof![Just(LevelSteps::Fitted), Just(LevelSteps::Equal), Just(LevelSteps::Weber)],
            levels in 1u16..40,
            forces in hard_forces(),
        ) {
            let force_fit = Some(if exact { ForceFit::Exact } else { ForceFit::Lloyd });
            let profile = Profile { levels, force_fit, level_steps: of, ..Profile::default() };
            let (codebook, level) = quantise(&profile, &forces);
            prop_assert_eq!(codebook.len(), usize::from(levels));
            prop_assert!(codebook.is_sorted());
            let greatest = forces.iter().copied().fold(0.0, f64::max);
            for (force, level) in forces.iter().zip(&level) {
                prop_assert!(*force < greatest || *level == levels - 1, "{:?} {:?}", codebook, level);
            }
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
