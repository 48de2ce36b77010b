//! Which taxels of a recording are out of use, and why, in a sentence.

use taxel_hand::{FORCE_MAX, FORCE_MIN, Fault, Faults, ForceFrame, plural};

/// What was out of use, calibration over. Taxels that are missing have a sentence of their own.
#[derive(Debug, Default)]
pub(crate) struct OutOfUse {
    /// Every reason there was against each taxel.
    faults: Vec<Faults>,
    /// Whether it had a force that no image can carry.
    refused: Vec<bool>,
    frames: u64,
}

impl OutOfUse {
    /// What was out of use in these frames.
    pub(crate) fn of<'a>(frames: impl IntoIterator<Item = &'a ForceFrame>) -> Self {
        let mut all = Self::default();
        frames.into_iter().for_each(|frame| all.take(frame));
        all
    }

    /// Takes the next frame.
    pub(crate) fn take(&mut self, frame: &ForceFrame) {
        if frame.calibrating {
            return;
        }
        self.faults.resize(frame.faults.len(), Faults::NONE);
        self.refused.resize(frame.faults.len(), false);
        let mut any = false;
        for (n, faults) in frame.faults.iter().enumerate() {
            let force = frame.force[n];
            let refused = faults.is_empty()
                && (!force.is_finite() || frame.contact[n] && !(FORCE_MIN..=FORCE_MAX).contains(&force));
            let faulty = !faults.is_empty() && !faults.contains(Fault::Missing);
            any |= refused | faulty;
            self.refused[n] |= refused;
            if faulty {
                self.faults[n] = self.faults[n].union(*faults);
            }
        }
        self.frames += u64::from(any);
    }

    /// In how many frames, of which one is called so here, and how many taxels for which reason; none where there was none.
    pub(crate) fn sentence(&self, frame: &str) -> Option<String> {
        let mut reasons: Vec<String> = Vec::new();
        for fault in Fault::ALL {
            let count = self.faults.iter().filter(|faults| faults.contains(fault)).count();
            if count > 0 {
                let are_most = 2 * count > self.faults.len();
                reasons.push(format!("{count} {}", in_words(fault, are_most)));
            }
        }
        let refused = self.refused.iter().filter(|refused| **refused).count();
        if refused > 0 {
            reasons.push(format!(
                "{refused} with a force that is not a number from {FORCE_MIN:e} to {FORCE_MAX:e}"
            ));
        }
        let count = self.frames;
        (count > 0).then(|| {
            format!(
                "taxels are out of use in {}: {}",
                plural(count, frame),
                reasons.join(", ")
            )
        })
    }

    /// Says so on stderr.
    pub(crate) fn tell(&self, frame: &str) {
        if let Some(sentence) = self.sentence(frame) {
            remark!("taxel: {sentence}");
        }
    }
}

/// What taxels with this fault are, where they are most of all or not.
fn in_words(fault: Fault, are_most: bool) -> &'static str {
    match fault {
        Fault::Dead => "dead (0 or 65535 on every axis)",
        Fault::Stuck => "stuck (not changed by one count; in use from the first change on)",
        Fault::Noisy if are_most => "noisy (jumping to and fro)",
        Fault::Noisy => "noisy (far more so than the others)",
        Fault::Wrapping => "wrapping around more often than a press explains",
        Fault::PaperRule => "flagged by the publication's rule",
        Fault::Status => "with an error of their board",
        Fault::Missing => "missing",
        Fault::Masked => "switched off in the configuration",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn taxels_are_counted_by_reason_once_and_frames_that_lack_any() {
        let mut all = OutOfUse::default();
        let mut frame = ForceFrame::new(4);
        frame.calibrating = true;
        frame.faults[3].insert(Fault::Dead);
        all.take(&frame);
        assert_eq!(all.sentence("frame"), None);
        frame.calibrating = false;
        frame.faults.fill(Faults::NONE);
        frame.faults[0].insert(Fault::Missing);
        all.take(&frame);
        assert_eq!(all.sentence("frame"), None, "missing is told elsewhere");
        frame.faults[1].insert(Fault::Stuck);
        frame.faults[2].insert(Fault::Stuck);
        all.take(&frame);
        frame.faults[2].insert(Fault::Noisy);
        (frame.force[3], frame.contact[3]) = (1e39, true);
        all.take(&frame);
        assert_eq!(
            all.sentence("image").as_deref(),
            Some(
                "taxels are out of use in 2 images: 2 stuck (not changed by one count; in use from the first change on), \
                 1 noisy (far more so than the others), 1 with a force that is not a number from 1e-38 to 1e38"
            )
        );
        // There are no others where it is all of them.
        let mut all = OutOfUse::default();
        frame
            .faults
            .iter_mut()
            .for_each(|faults| faults.insert(Fault::Noisy));
        all.take(&frame);
        let told = all.sentence("image").unwrap();
        assert!(told.contains("3 noisy (jumping to and fro)"), "{told}");
    }
}
