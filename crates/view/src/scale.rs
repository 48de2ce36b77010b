//! Which force the brightest colour stands for.

/// The scale halves in this time without a greater force.
const HALVES_NS: f64 = 10e9;
/// The greatest force of late is that of this window and the one before.
const WINDOW_NS: u64 = 750_000_000;
/// The scale is at most so many times the greatest force of late: what a broken taxel or a blow has set is forgotten
/// within two seconds, and the rest of a touch stays in proportion.
const ABOVE_LATE: f64 = 4.0;

/// A quarter of the actuators at most may be brighter than the rest could ever be: what they feel counts up to so
/// many times what the next one does.
const ABOVE_MOST: f64 = 3.0;

/// The greatest of these forces. A few that are many times the others count less, be it a broken taxel or a blow to one
/// finger: the rest of the hand would be dark beside them.
pub(crate) fn greatest_of_most(forces: impl Iterator<Item = f64>) -> f64 {
    let mut forces: Vec<f64> = forces.collect();
    forces.sort_by(|a, b| b.total_cmp(a));
    let greatest = forces.first().copied().unwrap_or(0.0);
    match forces.get(forces.len() / 4) {
        Some(most) => greatest.min(ABOVE_MOST * most),
        None => greatest,
    }
}

/// The scale of the colours, from the greatest force of each image.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Scale {
    slow: f64,
    seen_ns: u64,
    window_ns: u64,
    /// Greatest force of this window and of the one before.
    late: [f64; 2],
}

impl Scale {
    /// An image whose greatest force is this, in the unit of the forces.
    pub(crate) fn see(&mut self, greatest: f64, t_ns: u64) {
        let elapsed_ns = t_ns.saturating_sub(self.seen_ns);
        self.seen_ns = t_ns;
        match t_ns.saturating_sub(self.window_ns) {
            past if past >= 2 * WINDOW_NS => (self.window_ns, self.late) = (t_ns, [0.0; 2]),
            past if past >= WINDOW_NS => (self.window_ns, self.late) = (t_ns, [0.0, self.late[0]]),
            _ => {}
        }
        self.late[0] = self.late[0].max(greatest);
        let slow = self.slow * 0.5f64.powf(elapsed_ns as f64 / HALVES_NS);
        let late = self.late[0].max(self.late[1]);
        let most = if late > 0.0 {
            ABOVE_LATE * late
        } else {
            f64::INFINITY
        };
        self.slow = slow.min(most).max(greatest);
    }

    /// The force that the brightest colour stands for, at least `least`.
    pub(crate) fn force(&self, least: f64) -> f64 {
        self.slow.max(least)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_NS: u64 = 33_000_000;

    /// Images at 30 Hz; returns when the last one was.
    fn see(scale: &mut Scale, from_ns: u64, seconds: f64, force: f64) -> u64 {
        let images = (seconds * 1e9) as u64 / STEP_NS;
        for image in 1..=images {
            scale.see(force, from_ns + image * STEP_NS);
        }
        from_ns + images * STEP_NS
    }

    #[test]
    fn a_broken_taxel_darkens_the_hand_for_two_seconds_at_most() {
        let mut scale = Scale::default();
        let mut now = see(&mut scale, 0, 3.0, 62_000.0);
        now = see(&mut scale, now, 1.9, 3_000.0);
        assert!(scale.force(0.0) <= 12_000.0, "{scale:?} at {now}");
        // The same when nothing touched meanwhile.
        let mut scale = Scale::default();
        now = see(&mut scale, 0, 3.0, 62_000.0);
        now = see(&mut scale, now, 5.0, 0.0);
        see(&mut scale, now, 0.1, 3_000.0);
        assert!(scale.force(0.0) <= 12_000.0, "{scale:?}");
    }

    #[test]
    fn a_few_places_pressed_many_times_harder_than_the_others_do_not_darken_these() {
        let rest = |count| vec![4_000.0; count];
        for (strong, others, greatest) in [
            (vec![], rest(0), 0.0),
            (vec![62_000.0], rest(0), 62_000.0),
            (vec![62_000.0, 100.0], rest(0), 62_000.0),
            (vec![62_000.0], rest(3), 12_000.0),
            (vec![19_000.0, 62_000.0, 45_000.0, 30_000.0], rest(12), 12_000.0),
            // A touch has its strongest place; and what most of them feel is no exception.
            (vec![9_000.0, 7_000.0], rest(14), 9_000.0),
            (vec![62_000.0; 5], rest(11), 62_000.0),
        ] {
            let forces = others.iter().chain(&strong).copied();
            assert_eq!(
                greatest_of_most(forces),
                greatest,
                "{strong:?} beside {}",
                others.len()
            );
        }
    }

    #[test]
    fn a_touch_that_fades_is_seen_to_fade() {
        let mut scale = Scale::default();
        let now = see(&mut scale, 0, 1.0, 1000.0);
        see(&mut scale, now, 1.0, 300.0);
        assert!((900.0..=1000.0).contains(&scale.force(0.0)), "{scale:?}");
        assert_eq!(scale.force(5000.0), 5000.0);
    }
}
