//! Touches of a recording: those that are whole.

use taxel_hand::plural;
use taxel_record::Recording;
use taxel_sequence::{ContactCuts, Cut, Mark, Motion, SequenceError, cut_by_marks};

/// The touches that marks cut out. One that the recording ends, and no mark, is left out, and that is said, where it lacks a
/// step of its motion, or where no motion is known lasts less than half as long as the shortest of the others: all would be
/// cut down to the steps that it has.
///
/// # Errors
/// As [`cut_by_marks`], but that the last mark may have no frame behind it.
pub(super) fn of_marks(
    times: &[u64],
    marks: &[Mark],
    until: &str,
    name: &str,
    motion: Option<Motion>,
) -> Result<Vec<Cut>, SequenceError> {
    let (touches, told) = by_marks(times, marks, until, motion)?;
    if let Some(sentence) = told {
        remark!("taxel: {name}: {sentence}");
    }
    Ok(touches)
}

fn by_marks(
    times: &[u64],
    marks: &[Mark],
    until: &str,
    motion: Option<Motion>,
) -> Result<(Vec<Cut>, Option<String>), SequenceError> {
    let is_left_out = |length: &str, mark: &Mark| {
        format!(
            "the last touch, \"{}\", is left out ({length}): the recording ends in it, before a mark does",
            mark.text
        )
    };
    match marks {
        [earlier @ .., last] if last.text != until && !earlier.is_empty() => {
            if times.last().is_some_and(|end| *end < last.t_ns) {
                let cuts = cut_by_marks(times, earlier, until)?;
                return Ok((cuts, Some(is_left_out("no frame", last))));
            }
            let mut cuts = cut_by_marks(times, marks, until)?;
            let lasts = |cut: &Cut| times[cut.frames.end - 1] - times[cut.frames.start];
            let Some((unended, others)) = cuts.split_last().filter(|(_, others)| !others.is_empty()) else {
                return Ok((cuts, None));
            };
            let is_half = match motion {
                Some(motion) => unended.frames.len() < motion.steps(),
                None => others.iter().all(|other| 2 * lasts(unended) < lasts(other)),
            };
            let told = is_half.then(|| is_left_out(&plural(unended.frames.len(), "frame"), last));
            cuts.truncate(cuts.len() - usize::from(is_half));
            Ok((cuts, told))
        }
        _ => Ok((cut_by_marks(times, marks, until)?, None)),
    }
}

/// The touches that contact cuts out and that are whole; of all others it is said that they are left out.
///
/// A touch in contact in the first or the last frame of the recording has only one of its ends in it, unless it has a frame for
/// each step of its motion.
pub(super) fn of_contact(
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
    fn a_touch_that_the_recording_ends_is_left_out_where_it_is_much_shorter_than_the_others() {
        let marks = |texts: &[(u64, &str)]| -> Vec<Mark> {
            let mark = |(t_ns, text): &(u64, &str)| Mark {
                t_ns: *t_ns,
                text: (*text).to_owned(),
            };
            texts.iter().map(mark).collect()
        };
        let times: Vec<u64> = (0..40).collect();
        let motion = Motion::new(6.5, 0.0).ok();
        assert_eq!(motion.map(|motion| motion.steps()), Some(13));
        for (of, motion, left, said) in [
            // Ends 2 frames after it began.
            (
                &[(0, "a"), (13, "b"), (26, "away"), (38, "c")][..],
                None,
                &[(0, 13), (13, 26)][..],
                Some("2 frames"),
            ),
            (
                &[(0, "a"), (13, "b"), (26, "away"), (27, "c")],
                motion,
                &[(0, 13), (13, 26), (27, 40)],
                None,
            ),
            (
                &[(0, "a"), (13, "b"), (26, "away"), (28, "c")],
                motion,
                &[(0, 13), (13, 26)],
                Some("12 frames"),
            ),
            // Nearly as long as the others.
            (
                &[(0, "a"), (13, "b"), (26, "away"), (28, "c")],
                None,
                &[(0, 13), (13, 26), (28, 40)],
                None,
            ),
            // A mark ends it.
            (
                &[(0, "a"), (13, "b"), (26, "c"), (28, "away")],
                None,
                &[(0, 13), (13, 26), (26, 28)],
                None,
            ),
            (
                &[(0, "a"), (13, "b"), (26, "away"), (40, "c")],
                None,
                &[(0, 13), (13, 26)],
                Some("no frame"),
            ),
            (&[(26, "away"), (38, "c")], None, &[(38, 40)], None),
        ] {
            let (touches, told) = by_marks(&times, &marks(of), "away", motion).unwrap();
            let frames: Vec<_> = touches
                .iter()
                .map(|cut| (cut.frames.start, cut.frames.end))
                .collect();
            assert_eq!(frames, left, "{of:?}");
            assert_eq!(told.is_some(), said.is_some(), "{told:?}");
            assert!(
                told.zip(said).is_none_or(|(told, said)| told.contains(said)),
                "{said:?}"
            );
        }
        let behind = by_marks(&times, &marks(&[(50, "a"), (60, "b")]), "away", None);
        assert!(
            matches!(behind, Err(SequenceError::EmptyCut { .. })),
            "{behind:?}"
        );
    }

    #[test]
    fn of_raw_counts_in_contact_at_the_end_the_first_frame_is_named() {
        let said = |of: (usize, usize), raw| split(cuts(&[of]), 40, None, 5, raw).1[0].contains("raw counts");
        assert!(said((20, 40), true) && !said((20, 40), false) && !said((0, 20), true));
    }
}
