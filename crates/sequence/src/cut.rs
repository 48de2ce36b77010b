//! Which frames belong to which touch.

use crate::SequenceError;
use std::ops::Range;

/// Something that was said about an instant of a stream, such as where the robot is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mark {
    /// When, ns, in the time of the stream.
    pub t_ns: u64,
    /// What.
    pub text: String,
}

/// Frames that belong together.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cut {
    /// The text of the mark that began it; empty where contact did.
    pub mark: String,
    /// Their numbers.
    pub frames: Range<usize>,
}

/// What contact cuts out of a stream.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ContactCuts {
    /// Touches, in their order. The first may have begun before the stream, and the last may go on behind it.
    pub touches: Vec<Cut>,
    /// How many contacts were too short for a touch.
    pub short: usize,
    /// How many rests were too short to end the touch that they are in.
    pub rests: usize,
}

/// The frames from each mark to the next one or to the end of the stream, but for those from a mark whose text is
/// `until` (a withdrawal, a way to the next place): each of the others begins a touch.
///
/// # Errors
/// Frames or marks out of order; a touch without frames; no touch.
pub fn cut_by_marks(times_ns: &[u64], marks: &[Mark], until: &str) -> Result<Vec<Cut>, SequenceError> {
    in_order("frame", times_ns.iter().copied())?;
    in_order("mark", marks.iter().map(|m| m.t_ns))?;
    let frame_at = |t_ns: u64| times_ns.partition_point(|t| *t < t_ns);
    let mut cuts = Vec::new();
    for (n, mark) in marks.iter().enumerate().filter(|(_, mark)| mark.text != until) {
        let end = marks
            .get(n + 1)
            .map_or(times_ns.len(), |next| frame_at(next.t_ns));
        let frames = frame_at(mark.t_ns)..end;
        if frames.is_empty() {
            return Err(SequenceError::EmptyCut {
                mark: mark.text.clone(),
                t_ns: mark.t_ns,
                from_to_ns: times_ns
                    .first()
                    .copied()
                    .zip(times_ns.last().copied())
                    .map(<[u64; 2]>::from),
            });
        }
        cuts.push(Cut {
            mark: mark.text.clone(),
            frames,
        });
    }
    if cuts.is_empty() {
        Err(SequenceError::NoTouch)
    } else {
        Ok(cuts)
    }
}

/// The frames during which the greatest magnitude of a taxel is above `threshold`, where that lasts for `least` frames
/// or more; it may fall below for fewer frames than that, which take no longer than so many usually do. For motions that begin
/// and end with contact. There are as many values as taxels for each of `times_ns`.
pub fn cut_by_contact(values: &[f64], times_ns: &[u64], threshold: f64, least: usize) -> ContactCuts {
    let mut steps: Vec<u64> = times_ns.windows(2).map(|t| t[1].saturating_sub(t[0])).collect();
    steps.sort_unstable();
    let usual_ns = steps.get(steps.len() / 2).copied().unwrap_or(0);
    let longest_ns = usual_ns.saturating_mul(least.max(1) as u64);
    let taxels = values.len() / times_ns.len().max(1);
    let touched = |frame: &[f64]| frame.iter().any(|x| x.abs() > threshold);
    let mut cuts: Vec<(Range<usize>, usize)> = Vec::new();
    let frames = values.chunks_exact(taxels.max(1)).enumerate();
    for (n, _) in frames.filter(|(_, frame)| touched(frame)) {
        let goes_on = |last: &Range<usize>| {
            let since_ns = times_ns[n].saturating_sub(times_ns[last.end - 1]);
            n == last.end || (n - last.end < least && since_ns <= longest_ns + usual_ns / 2)
        };
        match cuts.last_mut() {
            Some((last, rests)) if goes_on(last) => {
                *rests += usize::from(n > last.end);
                last.end = n + 1;
            }
            _ => cuts.push((n..n + 1, 0)),
        }
    }
    let all = cuts.len();
    cuts.retain(|(cut, _)| cut.len() >= least);
    ContactCuts {
        short: all - cuts.len(),
        rests: cuts.iter().map(|(_, rests)| rests).sum(),
        touches: cuts
            .into_iter()
            .map(|(frames, _)| Cut {
                mark: String::new(),
                frames,
            })
            .collect(),
    }
}

fn in_order(what: &'static str, times: impl Iterator<Item = u64>) -> Result<(), SequenceError> {
    let mut before = 0;
    for (index, t_ns) in times.enumerate() {
        if t_ns < before {
            return Err(SequenceError::Order { what, index, t_ns });
        }
        before = t_ns;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn marks(marks: &[(u64, &str)]) -> Vec<Mark> {
        let mark = |(t_ns, text): &(u64, &str)| Mark {
            t_ns: *t_ns,
            text: (*text).into(),
        };
        marks.iter().map(mark).collect()
    }

    #[test]
    fn a_touch_lasts_from_its_mark_to_the_next() {
        let times = [0, 10, 20, 30, 40, 50, 60];
        let marks = marks(&[(10, "a"), (25, "up"), (40, "b"), (60, "c")]);
        let cuts = cut_by_marks(&times, &marks, "up").unwrap();
        let found: Vec<_> = cuts
            .iter()
            .map(|cut| (cut.mark.as_str(), cut.frames.clone()))
            .collect();
        assert_eq!(found, [("a", 1..3), ("b", 4..6), ("c", 6..7)]);
    }

    #[test]
    fn marks_that_cut_nothing_are_named() {
        let times = [0, 10, 20].map(|ms| ms * 1_000_000);
        for (given, words) in [
            (marks(&[]), "there is no touch"),
            (marks(&[(5, "up")]), "there is no touch"),
            (
                marks(&[(5, "a"), (7, "up")]),
                "no frame between the mark \"a\" at 0.005 s and the next; was",
            ),
            (
                marks(&[(30, "a")]),
                "mark \"a\" at 0.03 s and the next; the frames are from 0 s to 0.02 s",
            ),
            (marks(&[(10, "a"), (5, "b")]), "mark 1 is at 0.005 s"),
        ] {
            let given: Vec<Mark> = given
                .into_iter()
                .map(|mark| Mark {
                    t_ns: 1_000_000 * mark.t_ns,
                    ..mark
                })
                .collect();
            let error = cut_by_marks(&times, &given, "up").unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
        assert!(
            cut_by_marks(&[10, 0], &[], "up")
                .unwrap_err()
                .to_string()
                .contains("frame 1")
        );
    }

    #[test]
    fn contact_may_flicker_for_less_than_a_touch() {
        let values = [
            0.0, -9.0, 9.0, 0.0, 9.0, 9.0, 0.0, 0.0, 0.0, 9.0, 0.0, 0.0, 9.0, 9.0, 9.0,
        ];
        let times: Vec<u64> = (0..15).map(|n| 50 * n).collect();
        let frames = |cuts: &ContactCuts| {
            cuts.touches
                .iter()
                .map(|cut| cut.frames.clone())
                .collect::<Vec<_>>()
        };
        let cuts = cut_by_contact(&values, &times, 5.0, 2);
        assert_eq!(frames(&cuts), [1..6, 12..15]);
        assert_eq!((cuts.short, cuts.rests), (1, 1));
        assert_eq!(cut_by_contact(&values, &times, 10.0, 2), ContactCuts::default());
        assert_eq!(cut_by_contact(&[], &[], 10.0, 2), ContactCuts::default());
        // A recorder that kept nothing for a while.
        let times: Vec<u64> = (0..15).map(|n| 50 * n + if n > 3 { 500 } else { 0 }).collect();
        let cuts = cut_by_contact(&values, &times, 5.0, 2);
        assert_eq!(frames(&cuts), [1..3, 4..6, 12..15]);
        assert_eq!((cuts.short, cuts.rests), (1, 0));
    }
}
