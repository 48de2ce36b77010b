//! How long to leave the buses alone after they were drained, so that frames come in handfuls.
//!
//! Waking up for a frame costs more than everything done with it: at 7,200 frames/s, one wake-up
//! each is a fifth of a core. In `timer` mode nothing is due before the tick. In `sweep` mode the
//! image is due with the last frame of the sweep, and the time until then is known roughly: so many
//! taxels are awaited, and frames have been coming so fast. Half of it can be slept through, and half
//! of the rest after that; the last frames are waited for one by one. The pace is that of the fastest
//! frames of late, which a bus cannot exceed by much, so that the guess errs towards waking up. However
//! wrong it is, an image is never late by more than a millisecond.

use taxel_engine::{TickConfig, TickMode};

/// Longest pause in `timer` mode, nanoseconds. A bus at full load, 9,000 frames/s, brings 45 frames
/// meanwhile; the smallest queue that a kernel gives holds 278.
const TIMER_NS: u64 = 5_000_000;
/// Longest pause in `sweep` mode, nanoseconds: how late an image can be where frames come all at once.
const SWEEP_NS: u64 = 1_000_000;
/// The last frames of a sweep, which are waited for one by one.
const LAST: usize = 3;
/// A pause shorter than this is not worth its wake-up, nanoseconds.
const SHORTEST_NS: u64 = 50_000;

/// Decides how long the buses are left alone.
#[derive(Debug)]
pub(crate) enum Gather {
    /// Always as long.
    Timer {
        /// The pause, nanoseconds.
        pause_ns: u64,
    },
    /// By what is awaited.
    Sweep {
        /// Time between two frames while they come, of all buses together, nanoseconds. A low estimate.
        spacing_ns: u64,
        /// When the buses were drained last, nanoseconds.
        drained_ns: u64,
    },
}

impl Gather {
    pub(crate) fn new(tick: &TickConfig) -> Self {
        match tick.mode {
            TickMode::Timer => Self::Timer {
                pause_ns: TIMER_NS.min(tick.period_ns() / 2),
            },
            TickMode::Sweep => Self::Sweep {
                spacing_ns: 0,
                drained_ns: 0,
            },
        }
    }

    /// How long to pause after the buses gave `frames` frames at `now_ns` and `awaited` taxels are
    /// still to come.
    pub(crate) fn pause_ns(&mut self, now_ns: u64, frames: usize, awaited: usize) -> u64 {
        let (spacing_ns, drained_ns) = match self {
            Self::Timer { pause_ns } => return *pause_ns,
            Self::Sweep {
                spacing_ns,
                drained_ns,
            } => (spacing_ns, drained_ns),
        };
        if frames > 0 {
            // Falls at once and rises slowly, so that a pause between two sweeps is not taken for a slow bus.
            let seen_ns = now_ns.saturating_sub(*drained_ns) / frames as u64;
            *spacing_ns = seen_ns.min(*spacing_ns + *spacing_ns / 16 + 100);
        }
        *drained_ns = now_ns;
        let until_last_ns = *spacing_ns * awaited.saturating_sub(LAST) as u64;
        let pause_ns = (until_last_ns / 2).min(SWEEP_NS);
        if pause_ns < SHORTEST_NS { 0 } else { pause_ns }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sweep() -> Gather {
        Gather::new(&TickConfig {
            mode: TickMode::Sweep,
            ..TickConfig::default()
        })
    }

    /// Plays sweeps of 240 frames on two buses through it; returns wake-ups per sweep and the
    /// longest time that the last frame of a sweep lay unseen, once it knows the pace.
    fn play(spacing_ns: u64, period_ns: u64) -> (u64, u64) {
        let mut gather = sweep();
        let (mut wakes, mut latest) = (0, 0);
        for round in 0..200_u64 {
            let start_ns = round * period_ns;
            let arrival = |i: u64| start_ns + i * spacing_ns;
            let mut taken = 0;
            let mut now_ns = start_ns;
            while taken < 240 {
                now_ns = now_ns.max(arrival(taken));
                let frames = (taken..240).take_while(|i| arrival(*i) <= now_ns).count() as u64;
                taken += frames;
                if round >= 100 {
                    wakes += 1;
                    if taken == 240 {
                        latest = latest.max(now_ns - arrival(239));
                    }
                }
                // Every wake-up takes some time of its own.
                now_ns += 10_000 + gather.pause_ns(now_ns, frames as usize, 240 - taken as usize);
            }
        }
        (wakes / 100, latest)
    }

    #[test]
    fn a_real_bus_wakes_the_thread_few_times_a_sweep_and_the_last_frame_is_seen_at_once() {
        // Two buses of 9,000 frames/s, 30 sweeps/s.
        let (wakes, latest_ns) = play(55_000, 33_000_000);
        assert!(wakes <= 25, "{wakes} wake-ups for 240 frames");
        assert!(latest_ns <= 10_000, "the last frame waited {latest_ns} ns");
        // Boards that run freely, as fast as the sweeps.
        let (wakes, latest_ns) = play(137_000, 33_000_000);
        assert!(wakes <= 45, "{wakes} wake-ups for 240 frames");
        assert!(latest_ns <= 10_000, "the last frame waited {latest_ns} ns");
    }

    #[test]
    fn a_burst_is_not_slept_through() {
        let (wakes, latest_ns) = play(3_000, 10_000_000);
        assert!(wakes <= 30, "{wakes} wake-ups for 240 frames");
        assert!(latest_ns <= 60_000, "the last frame waited {latest_ns} ns");
    }

    #[test]
    fn timer_mode_pauses_for_no_more_than_half_a_tick() {
        let pause_ns = |rate_hz| {
            let tick = TickConfig {
                mode: TickMode::Timer,
                rate_hz,
                ..TickConfig::default()
            };
            Gather::new(&tick).pause_ns(0, 10, 100)
        };
        assert_eq!(pause_ns(30.0), TIMER_NS);
        assert_eq!(pause_ns(1000.0), 500_000);
    }
}
