//! Times of a recording without the pauses that are too long to be played.

use taxel_can::{ClockJumps, LONGEST_PAUSE_NS};
use taxel_hand::plural;
use taxel_record::{DEFAULT_RATE_HZ, Recording};

/// When each frame comes, nanoseconds after the first: as recorded, but behind a pause that is too long to be played
/// ([`LONGEST_PAUSE_NS`]) the next one follows after the usual time, or this where that is too long, and that is said.
pub(crate) fn without_pauses(recording: &Recording, otherwise_ns: u64) -> Vec<u64> {
    let usual_ns = match recording.period_ns() {
        usual_ns if usual_ns > LONGEST_PAUSE_NS => otherwise_ns,
        usual_ns => usual_ns,
    };
    let mut pauses = ClockJumps::default();
    let mut begins = Vec::with_capacity(recording.len());
    let mut now_ns = 0;
    for index in 0..recording.len() {
        if index > 0 {
            let pause_ns = recording.t_ns(index) - recording.t_ns(index - 1);
            now_ns += if pause_ns > LONGEST_PAUSE_NS {
                pauses.skip(index as u64, pause_ns);
                usual_ns
            } else {
                pause_ns
            };
        }
        begins.push(now_ns);
    }
    if pauses.forward > 0 {
        let are_one = pauses.forward == 1;
        remark!(
            "taxel: {}: {} of more than {} s {} left out ({:.1} s), {}before frame {}",
            recording.name(),
            plural(pauses.forward as usize, "pause"),
            LONGEST_PAUSE_NS / 1_000_000_000,
            if are_one { "is" } else { "are" },
            pauses.skipped_ns as f64 / 1e9,
            if are_one { "" } else { "the first " },
            pauses.first_line
        );
    }
    begins
}

/// When each frame is shown, nanoseconds on the recording's own clock but for such pauses.
pub(crate) fn shown_ns(recording: &Recording) -> Vec<u64> {
    let first_ns = recording.t_ns(0);
    let mut shown = without_pauses(recording, (1e9 / DEFAULT_RATE_HZ) as u64);
    shown.iter_mut().for_each(|t_ns| *t_ns += first_ns);
    shown
}
