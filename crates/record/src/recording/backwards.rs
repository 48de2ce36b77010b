//! Times that run backwards: frames that came out of order, or recordings one behind another.

use crate::error::RecordError;
use taxel_hand::plural;

/// Fewest frames, in the mean, of recordings that are told from frames out of order.
const FEWEST_FRAMES: usize = 5;
/// Recordings whose first frames are named.
const MOST_NAMED: usize = 5;

/// Refuses times that run backwards.
pub(super) fn refuse_backwards(at: &str, times_ns: &[u64]) -> Result<(), RecordError> {
    let begins: Vec<usize> = (1..times_ns.len())
        .filter(|frame| times_ns[*frame] < times_ns[*frame - 1])
        .collect();
    let Some(first) = begins.first() else {
        return Ok(());
    };
    let before = format!("the time of frame {first} is before that of the frame before it");
    let reason = if are_recordings(times_ns, &begins) {
        let named: Vec<String> = begins.iter().take(MOST_NAMED).map(usize::to_string).collect();
        let more = if begins.len() > MOST_NAMED { ", .." } else { "" };
        format!(
            "{before}: {} of the same times stand one behind another, from frames 0, {}{more}; take them apart, \
             values[:{first}] and t[:{first}] are the first (sorted by time, their frames would be mixed)",
            plural(begins.len() + 1, "recording"),
            named.join(", ")
        )
    } else {
        format!(
            "{before}; where the frames are only out of order, n = numpy.argsort(t, kind=\"stable\") puts them into it, \
             values[n] and t[n]"
        )
    };
    Err(RecordError::unreadable(at, reason))
}

/// Whether times that begin anew at these frames are those of recordings one behind another: each and the one behind it go
/// through the same times for half of the shorter one at least, while frames out of order do so for moments.
fn are_recordings(times_ns: &[u64], begins: &[usize]) -> bool {
    let ends = begins.iter().copied().chain([times_ns.len()]);
    let spans: Vec<[u64; 2]> = std::iter::once(0)
        .chain(begins.iter().copied())
        .zip(ends)
        // A single time that is wrong is the first or the last.
        .map(|(first, end)| [(first + 1).min(end - 1), (end - 1).saturating_sub(1).max(first)])
        .map(|ends| ends.map(|frame| times_ns[frame]))
        .collect();
    let go_through_the_same = |pair: &[[u64; 2]]| {
        let [[a, b], [c, d]] = [pair[0], pair[1]];
        let both = b.min(d).saturating_sub(a.max(c));
        2 * both > b.saturating_sub(a).min(d.saturating_sub(c))
    };
    times_ns.len() >= FEWEST_FRAMES * spans.len() && spans.windows(2).all(go_through_the_same)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recordings_one_behind_another_are_told_from_frames_out_of_order() {
        let trials = |begins: &[u64], frames: u64| -> Vec<u64> {
            let frame = |begin: &u64| (0..frames).map(|n| begin + 10 * n).collect::<Vec<u64>>();
            begins.iter().flat_map(frame).collect()
        };
        // One frame and two that are late, and one of another clock.
        let mut late = trials(&[0], 200);
        late.swap(50, 51);
        late[120..124].rotate_left(2);
        let mut other = trials(&[1_000], 50);
        other[20] = 3;
        for (times, told) in [
            (
                trials(&[0, 0, 0], 200),
                Some("3 recordings of the same times stand one behind another, from frames 0, 200, 400;"),
            ),
            (trials(&[0, 300, 80], 100), Some("from frames 0, 100, 200;")),
            (
                trials(&[0; 9], 20),
                Some(
                    "9 recordings of the same times stand one behind another, from frames 0, 20, 40, 60, 80, 100, ..;",
                ),
            ),
            (late, None),
            (other, None),
            // The later one first; and a clock that counts down.
            (trials(&[5_000, 0], 200), None),
            (trials(&[0], 100).into_iter().rev().collect(), None),
        ] {
            let told_is = refuse_backwards("a", &times).unwrap_err().to_string();
            assert_eq!(told_is.contains("argsort"), told.is_none(), "{told_is}");
            assert!(told.is_none_or(|told| told_is.contains(told)), "{told_is}");
        }
        assert!(refuse_backwards("a", &trials(&[0], 5)).is_ok());
    }
}
