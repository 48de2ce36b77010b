//! What a display profile costs, measured before it is taken on.

use crate::display::Display;
use crate::pipeline::Frames;
use nix::time::{ClockId, clock_gettime};
use std::time::Duration;
use taxel_hand::ForceFrame;

/// How often each kind of frame is compressed, at most.
const RUNS: usize = 9;
/// After this long no further run is begun, beyond the first of each kind.
const PATIENCE: Duration = Duration::from_millis(100);

/// Time on a processor that one image takes, compressed and encoded: the median of some runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Cost {
    /// With every taxel in contact, each with a force of its own that changes at random from frame to frame.
    pub(crate) worst_ns: u64,
    /// With the forces that the hand feels at the moment.
    pub(crate) newest_ns: u64,
}

impl Cost {
    /// What is set aside for it.
    pub(crate) fn reserved_ns(&self) -> u64 {
        self.worst_ns.max(self.newest_ns)
    }
}

/// Measures what a display costs that was made for nothing else: it is left with a memory of frames that never were.
///
/// Time is that of the calling thread on its processor, so that whatever else the machine does is not counted. A
/// display whose first image takes longer than `hopeless_ns` is not measured further.
pub(crate) fn measure(mut display: Display, newest: ForceFrame, hopeless_ns: u64) -> Cost {
    let taxels = newest.force.len();
    let mut payload = Vec::new();
    let mut frames = Frames::new(taxels);
    let mut random = 0x9e37_79b9_7f4a_7c15_u64;
    let mut spent_ns = 0_u64;
    let mut median = |frames: &mut Frames, next: &mut dyn FnMut(&mut ForceFrame)| {
        let mut costs = [0; RUNS];
        let mut runs = 0;
        for cost in &mut costs {
            if runs > 0 && spent_ns > PATIENCE.as_nanos() as u64 {
                break;
            }
            next(&mut frames.force);
            let before_ns = thread_ns();
            // What cannot be encoded is refused for that elsewhere; here it costs what it costs.
            let _ = display.encode(frames, &mut payload);
            *cost = thread_ns().saturating_sub(before_ns);
            spent_ns = spent_ns.saturating_add(*cost);
            runs += 1;
            if *cost > hopeless_ns {
                spent_ns = u64::MAX;
            }
        }
        let costs = &mut costs[..runs];
        costs.sort_unstable();
        costs[runs / 2]
    };

    let worst_ns = median(&mut frames, &mut |force: &mut ForceFrame| {
        for (force, contact) in force.force.iter_mut().zip(&mut force.contact) {
            // xorshift64
            random ^= random << 13;
            random ^= random >> 7;
            random ^= random << 17;
            *force = 1.0 + (random % 20_000) as f64;
            *contact = true;
        }
    });
    if worst_ns > hopeless_ns {
        return Cost {
            worst_ns,
            newest_ns: worst_ns,
        };
    }
    frames.force = newest;
    let newest_ns = median(&mut frames, &mut |_| {});
    Cost { worst_ns, newest_ns }
}

fn thread_ns() -> u64 {
    clock_gettime(ClockId::CLOCK_THREAD_CPUTIME_ID)
        .map_or(0, |t| t.tv_sec() as u64 * 1_000_000_000 + t.tv_nsec() as u64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_hand::Profile;
    use taxel_skin::Layout;

    fn cost(profile: Profile, hopeless_ns: u64) -> Cost {
        let layout = Layout::builtin("allegro-uskin-15").unwrap();
        let display = Display::new(profile, None, &layout).unwrap();
        measure(display, ForceFrame::new(layout.len()), hopeless_ns)
    }

    #[test]
    fn a_display_a_hundred_times_larger_costs_more() {
        let of = |levels, actuators| Profile {
            levels,
            actuators,
            ..Profile::default()
        };
        let (few, many) = (cost(of(2, 2), u64::MAX), cost(of(200, 200), u64::MAX));
        assert!(few.newest_ns > 0, "{few:?}");
        assert!(few.worst_ns < many.worst_ns, "{few:?} {many:?}");
        assert_eq!(many.reserved_ns(), many.worst_ns.max(many.newest_ns));
    }

    #[test]
    fn what_is_hopeless_is_measured_once() {
        let hopeless = cost(Profile::default(), 1);
        assert_eq!(hopeless.newest_ns, hopeless.worst_ns);
    }
}
