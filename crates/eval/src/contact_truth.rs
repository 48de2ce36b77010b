//! Whether contacts are where something touches.

use crate::sequence::Sequence;
use crate::tally::share;
use serde::Serialize;

/// How the contacts found compare with what a scene says touches the hand. Frames of the
/// calibration window and taxels with a fault are left out.
#[derive(Debug, Default, Clone, Copy, PartialEq, Serialize)]
pub struct ContactTruth {
    /// Share of the contacts that something touches.
    pub precision: f64,
    /// Share of the touched taxels that are found.
    pub recall: f64,
    /// The same of those taxels that are touched harder than the contact threshold (its root, where the
    /// conditioning gives squares of forces).
    pub recall_above_threshold: f64,
    /// Taxels touched, over all frames.
    pub touched: u64,
    /// Contacts, over all frames.
    pub contacts: u64,
}

/// Compares contacts with the truth. `truth(frame, taxel)` is the force on a taxel at the time of
/// its sample in that frame, counts; 0 where nothing touches it.
pub fn contact_truth(sequence: &Sequence, mut truth: impl FnMut(usize, usize) -> f64) -> ContactTruth {
    let (mut touched, mut contacts, mut right, mut hard, mut hard_found) = (0, 0, 0, 0, 0);
    for (index, frame) in sequence.force.iter().enumerate().filter(|(_, f)| !f.calibrating) {
        for taxel in (0..frame.contact.len()).filter(|t| frame.faults[*t].is_empty()) {
            let (force, found) = (truth(index, taxel), frame.contact[taxel]);
            let is_hard = force > sequence.felt().of(frame.threshold);
            touched += u64::from(force > 0.0);
            contacts += u64::from(found);
            right += u64::from(found && force > 0.0);
            hard += u64::from(is_hard);
            hard_found += u64::from(is_hard && found);
        }
    }
    ContactTruth {
        precision: share(right, contacts),
        recall: share(right, touched),
        recall_above_threshold: share(hard_found, hard),
        touched,
        contacts,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_hand::{Fault, ForceFrame};
    use taxel_skin::Layout;

    #[test]
    fn precision_and_recall_count_taxels_over_all_frames() {
        let mut frame = ForceFrame::new(6);
        frame.threshold = 10.0;
        frame.contact = vec![true, true, false, false, true, false];
        frame.faults[5].insert(Fault::Dead);
        let mut calibrating = frame.clone();
        calibrating.calibrating = true;
        let sequence = Sequence {
            layout: Layout::grid(6, 1).unwrap(),
            force: vec![calibrating, frame],
            tactile: Vec::new(),
            conditioning: None,
        };
        // Found and there; found but not there; faint and missed; hard and missed; found and there; faulty.
        let truth = [50.0, 0.0, 5.0, 60.0, 70.0, 80.0];
        let got = contact_truth(&sequence, |_, taxel| truth[taxel]);
        let want = ContactTruth {
            precision: 2.0 / 3.0,
            recall: 2.0 / 4.0,
            recall_above_threshold: 2.0 / 3.0,
            touched: 4,
            contacts: 3,
        };
        assert_eq!(got, want);
    }

    #[test]
    fn a_threshold_in_counts_squared_is_compared_as_counts() {
        let mut frame = ForceFrame::new(3);
        frame.threshold = 100.0;
        frame.contact = vec![true, false, false];
        let sequence = Sequence {
            layout: Layout::grid(3, 1).unwrap(),
            force: vec![frame],
            tactile: Vec::new(),
            conditioning: Some(taxel_skin::ConditionConfig::paper()),
        };
        // Harder than 10 counts and found; harder and missed; fainter.
        let truth = [50.0, 20.0, 5.0];
        let got = contact_truth(&sequence, |_, taxel| truth[taxel]);
        assert_eq!((got.recall, got.recall_above_threshold), (1.0 / 3.0, 0.5));
    }
}
