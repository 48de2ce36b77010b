//! Which taxels are in contact: the threshold of eq. (2) with margin and hysteresis.

/// Contact thresholds, in the unit of force.
#[derive(Debug, Clone)]
pub(super) struct Thresholds {
    theta: f64,
    per_taxel: Option<Vec<f64>>,
    release: f64,
}

impl Thresholds {
    pub(super) fn new(taxels: usize, per_taxel: bool, release: f64) -> Self {
        Self {
            theta: 0.0,
            per_taxel: per_taxel.then(|| vec![0.0; taxels]),
            release,
        }
    }

    /// The hand's threshold `theta`; with thresholds per taxel, the largest of them.
    pub(super) fn theta(&self) -> f64 {
        self.theta
    }

    pub(super) fn set_theta(&mut self, theta: f64) {
        self.theta = theta;
    }

    /// Sets a taxel's own threshold; without effect where the hand has one for all.
    pub(super) fn set_taxel(&mut self, taxel: usize, theta: f64) {
        if let Some(per_taxel) = &mut self.per_taxel {
            per_taxel[taxel] = theta;
        }
    }

    /// The threshold that holds for a taxel.
    #[inline]
    pub(super) fn of(&self, taxel: usize) -> f64 {
        self.per_taxel.as_ref().map_or(self.theta, |p| p[taxel])
    }

    /// What begins a taxel's contact, and what holds it.
    pub(super) fn both_of(&self, taxel: usize) -> [f64; 2] {
        let theta = self.of(taxel);
        [theta, theta * self.release]
    }

    /// Updates which taxels are in contact: force strictly greater than the threshold, or than its
    /// release share while in contact.
    pub(super) fn judge(&self, force: &[f64], contact: &mut [bool]) {
        // The release share is no more than 1, so that what begins a contact also holds it.
        let is_contact =
            |force: f64, was: bool, theta: f64, release: f64| (force > theta) | (was & (force > release));
        match &self.per_taxel {
            None => {
                let (theta, release) = (self.theta, self.theta * self.release);
                for (force, contact) in force.iter().zip(contact) {
                    *contact = is_contact(*force, *contact, theta, release);
                }
            }
            Some(per_taxel) => {
                for ((force, contact), theta) in force.iter().zip(contact).zip(per_taxel) {
                    *contact = is_contact(*force, *contact, *theta, theta * self.release);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contact_begins_strictly_above_theta_and_ends_at_the_release_share() {
        let mut t = Thresholds::new(1, false, 0.8);
        t.set_theta(100.0);
        for (force, was, expected) in [
            (100.0, false, false),
            (100.000_001, false, true),
            (90.0, false, false),
            (90.0, true, true),
            (80.0, true, false),
        ] {
            let mut contact = [was];
            t.judge(&[force], &mut contact);
            assert_eq!(contact, [expected], "force {force}, in contact before: {was}");
        }
    }

    #[test]
    fn a_taxel_may_have_a_threshold_of_its_own() {
        let mut t = Thresholds::new(2, true, 1.0);
        t.set_theta(100.0);
        t.set_taxel(0, 10.0);
        t.set_taxel(1, 100.0);
        let mut contact = [false; 2];
        t.judge(&[11.0; 2], &mut contact);
        assert_eq!(contact, [true, false]);
    }
}
