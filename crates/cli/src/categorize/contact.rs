//! Touches that contact cuts out of a recording: those that are whole.

use taxel_hand::plural;
use taxel_record::Recording;
use taxel_sequence::{ContactCuts, Cut, Motion};

/// The touches that are whole; of all others it is said that they are left out.
///
/// A touch in contact in the first or the last frame of the recording has only one of its ends in it, unless it has a frame for
/// each step of its motion.
pub(super) fn whole(
    cuts: ContactCuts,
    recording: &Recording,
    motion: Option<Motion>,
    least: usize,
) -> Vec<Cut> {
    let (touches, told) = split(cuts, recording.len(), motion, least, recording.has_counts());
    for sentence in told {
        remark!("taxel: {}: {sentence}", recording.name());
    }
    touches
}

fn split(
    cuts: ContactCuts,
    frames: usize,
    motion: Option<Motion>,
    least: usize,
    raw: bool,
) -> (Vec<Cut>, Vec<String>) {
    let mut told = Vec::new();
    if cuts.short > 0 {
        let are = if cuts.short == 1 { "is" } else { "are" };
        told.push(format!(
            "{} shorter than {} {are} left out; --least N says how short a touch may be",
            plural(cuts.short, "contact"),
            plural(least, "frame")
        ));
    }
    if cuts.rests > 0 {
        let [end, are] = if cuts.rests == 1 {
            ["ends", "is"]
        } else {
            ["end", "are"]
        };
        told.push(format!(
            "{} of fewer than {} in between {end} no touch and {are} part of it; --least N says how short a rest may be",
            plural(cuts.rests, "rest"),
            plural(least, "frame")
        ));
    }
    let mut touches = cuts.touches;
    touches.retain(|cut| {
        let (begins, ends) = (cut.frames.start > 0, cut.frames.end < frames);
        let has_all_steps = motion.is_some_and(|motion| motion.steps() == cut.frames.len());
        if (begins && ends) || has_all_steps {
            return true;
        }
        let length = plural(cut.frames.len(), "frame");
        let mut sentence = match (begins, ends) {
            (false, false) => "it is in contact from the first frame to the last, which is no whole touch".to_owned(),
            (false, _) => format!(
                "the touch that is in contact in the first frame is left out ({length}): where it began is not in the \
                 recording"
            ),
            _ => format!(
                "the touch that is in contact in the last frame is left out ({length}): where it ends is not in the recording"
            ),
        };
        if raw && !ends {
            sentence += "; raw counts are taken above those of the first frame, in which nothing may be touched";
        }
        told.push(sentence);
        false
    });
    (touches, told)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cuts(frames: &[(usize, usize)]) -> ContactCuts {
        let cut = |(start, end): &(usize, usize)| Cut {
            mark: String::new(),
            frames: *start..*end,
        };
        ContactCuts {
            touches: frames.iter().map(cut).collect(),
            short: 0,
            rests: 0,
        }
    }

    #[test]
    fn a_touch_with_one_end_outside_the_recording_is_left_out_and_said() {
        let motion = Motion::new(6.5, 0.0).ok();
        let first = "in contact in the first frame is left out (10 frames)";
        let last = "in contact in the last frame is left out (13 frames)";
        let all = "from the first frame to the last";
        for (of, motion, left, said) in [
            (&[(1, 11), (20, 39)][..], None, &[(1, 11), (20, 39)][..], &[][..]),
            (
                &[(0, 10), (20, 33), (34, 39)],
                None,
                &[(20, 33), (34, 39)],
                &[first],
            ),
            (&[(5, 10), (27, 40)], None, &[(5, 10)], &[last]),
            (&[(0, 10), (27, 40)], None, &[], &[first, last]),
            (&[(0, 40)], None, &[], &[all]),
            // A frame for each of 13 steps.
            (
                &[(0, 10), (14, 27), (27, 40)],
                motion,
                &[(14, 27), (27, 40)],
                &[first],
            ),
        ] {
            let (touches, told) = split(cuts(of), 40, motion, 5, false);
            assert_eq!(touches, cuts(left).touches, "{of:?}");
            assert_eq!(told.len(), said.len(), "{told:?}");
            assert!(
                told.iter().zip(said).all(|(told, said)| told.contains(said)),
                "{told:?}"
            );
        }
    }

    #[test]
    fn of_raw_counts_in_contact_at_the_end_the_first_frame_is_named() {
        let said = |of: (usize, usize), raw| split(cuts(&[of]), 40, None, 5, raw).1[0].contains("raw counts");
        assert!(said((20, 40), true) && !said((20, 40), false) && !said((0, 20), true));
    }
}
