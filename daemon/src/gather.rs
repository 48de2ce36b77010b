//! How long to leave the buses alone after they were drained, so that frames come in handfuls.
//!
//! Waking up for a frame costs more than everything done with it: at 7,200 frames/s, one wake-up
//! each is a fifth of a core. In `timer` mode nothing is due before the tick. In `sweep` mode the
//! image is due with the last frame of the sweep, and two things tell roughly when that comes.
//!
//! * The pace: so many taxels are awaited, and frames have been coming so fast. It is that of the
//!   fastest frames of late, which a bus cannot exceed by much, so that it errs towards waking up.
//! * The phase: sweeps have been ending in a period, and few of late were shorter than so much.
//!
//! Where both say that the last frame is far, the pause is as long as in `timer` mode. From when the
//! sweep may end on, an eighth of the time by the pace is slept through, a millisecond at most; the
//! last frames are waited for one by one. So an image is late by more than a millisecond only where
//! its sweep was shorter than nearly all of late and its frames came faster than all of late as well,
//! and never by more than the pause of `timer` mode.

use std::ops::RangeInclusive;
use taxel_engine::{TickConfig, TickMode};

/// Longest pause, nanoseconds. A bus at full load, 9,000 frames/s, brings 90 frames meanwhile; the
/// smallest queue that a kernel gives holds 278, so that the thread may be held up for 20 ms more.
const LONGEST_NS: u64 = 10_000_000;
/// Shortest and longest pause from when the sweep may end on, nanoseconds. The longest is how late an
/// image can be where frames come all at once; the shortest takes what two buses give side by side.
const CAREFUL_NS: RangeInclusive<u64> = 100_000..=1_000_000;
/// The last frames of a sweep, which are waited for one by one.
const LAST: usize = 3;
/// A pause shorter than this is not worth its wake-up, nanoseconds.
const SHORTEST_NS: u64 = 50_000;
/// Frames of which the pace is measured. Two buses may give one each at the same instant, which tells
/// nothing.
const MEASURED: usize = 16;
/// Sweeps whose length is remembered, and how many of them may be shorter than what is expected, so
/// that one that was cut short does not cost the wake-ups of a second.
const REMEMBERED: usize = 32;
const SHORTER: usize = 2;

/// Decides how long the buses are left alone.
#[derive(Debug)]
pub(crate) enum Gather {
    /// Always as long.
    Timer {
        /// The pause, nanoseconds.
        pause_ns: u64,
    },
    /// By what is awaited.
    Sweep(Box<Sweeps>),
}

/// What the sweeps of late tell of the one under way.
#[derive(Debug, Default)]
pub(crate) struct Sweeps {
    /// Time between two frames while they come, of all buses together, nanoseconds. A low estimate.
    spacing_ns: u64,
    /// Frames that came since the pace was measured last, and when that was, nanoseconds.
    frames: usize,
    measured_ns: u64,
    /// When the last frame of the newest sweep came, nanoseconds.
    ended_ns: u64,
    /// From the end of a sweep to that of the next, nanoseconds; zeros as long as there were fewer.
    lengths_ns: [u64; REMEMBERED],
    /// Where the next length goes.
    next: usize,
    /// The earliest that the sweep under way is expected to end, nanoseconds.
    earliest_ns: u64,
}

impl Gather {
    pub(crate) fn new(tick: &TickConfig) -> Self {
        match tick.mode {
            TickMode::Timer => Self::Timer {
                pause_ns: LONGEST_NS.min(tick.period_ns() / 2),
            },
            TickMode::Sweep => Self::Sweep(Box::default()),
        }
    }

    /// How long to pause after the buses gave `frames` frames at `now_ns` and `awaited` taxels are
    /// still to come. `ended_ns` is when the last frame of the newest sweep came.
    pub(crate) fn pause_ns(&mut self, now_ns: u64, frames: usize, awaited: usize, ended_ns: u64) -> u64 {
        match self {
            Self::Timer { pause_ns } => *pause_ns,
            Self::Sweep(sweeps) => {
                sweeps.note_frames(now_ns, frames);
                sweeps.note_end(ended_ns);
                sweeps.pause_ns(now_ns, awaited)
            }
        }
    }
}

impl Sweeps {
    fn note_frames(&mut self, now_ns: u64, frames: usize) {
        self.frames += frames;
        if self.frames >= MEASURED {
            let seen_ns = now_ns.saturating_sub(self.measured_ns) / self.frames as u64;
            // Falls at once and rises slowly, so that a pause between two sweeps is not taken for a slow bus.
            self.spacing_ns = seen_ns.min(self.spacing_ns + self.spacing_ns / 8 + 500);
            (self.frames, self.measured_ns) = (0, now_ns);
        }
    }

    fn note_end(&mut self, ended_ns: u64) {
        if ended_ns == self.ended_ns {
            return;
        }
        self.lengths_ns[self.next] = ended_ns.saturating_sub(self.ended_ns);
        self.next = (self.next + 1) % REMEMBERED;
        self.ended_ns = ended_ns;
        let mut sorted_ns = self.lengths_ns;
        sorted_ns.sort_unstable();
        let short_ns = sorted_ns[SHORTER];
        self.earliest_ns = ended_ns.saturating_add(short_ns - short_ns / 128);
    }

    fn pause_ns(&self, now_ns: u64, awaited: usize) -> u64 {
        let by_pace_ns = self.spacing_ns * awaited.saturating_sub(LAST) as u64;
        let by_phase_ns = self.earliest_ns.saturating_sub(now_ns);
        let careful_ns = (by_pace_ns / 8)
            .clamp(*CAREFUL_NS.start(), *CAREFUL_NS.end())
            .min(by_pace_ns / 2);
        let pause_ns = (by_pace_ns / 8 * 7)
            .min(by_phase_ns)
            .min(LONGEST_NS)
            .max(careful_ns);
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

    /// Plays 200 sweeps of 240 frames through it, of which `arrival(sweep, frame)` tells when each
    /// frame comes; returns wake-ups per sweep and the longest time that the last frame of a sweep lay
    /// unseen, among the sweeps from number `from` on.
    fn play(from: u64, arrival: impl Fn(u64, u64) -> u64) -> (u64, u64) {
        let mut gather = sweep();
        let (mut wakes, mut latest) = (0, 0);
        let (mut now_ns, mut ended_ns) = (0, 0);
        for round in 0..200 {
            let mut taken = 0;
            while taken < 240 {
                now_ns = now_ns.max(arrival(round, taken));
                let frames = (taken..240).take_while(|i| arrival(round, *i) <= now_ns).count() as u64;
                taken += frames;
                wakes += u64::from(round >= from);
                let mut awaited = 240 - taken as usize;
                if taken == 240 {
                    ended_ns = arrival(round, 239);
                    if round >= from {
                        latest = latest.max(now_ns - ended_ns);
                    }
                    awaited = 240;
                }
                // Every wake-up takes some time of its own.
                now_ns += 10_000 + gather.pause_ns(now_ns, frames as usize, awaited, ended_ns);
            }
        }
        (wakes / (200 - from), latest)
    }

    /// Frames that come one after the other from the beginning of each period.
    fn even(spacing_ns: u64, period_ns: u64) -> impl Fn(u64, u64) -> u64 {
        move |round, i| (round + 1) * period_ns + i * spacing_ns
    }

    #[test]
    fn a_real_bus_wakes_the_thread_few_times_a_sweep_and_the_last_frame_is_seen_at_once() {
        for (what, spacing_ns, most) in [
            ("two buses of 9,000 frames/s, 30 sweeps/s", 55_000, 8),
            ("boards that run freely, as fast as the sweeps", 137_000, 9),
        ] {
            let (wakes, latest_ns) = play(100, even(spacing_ns, 33_000_000));
            assert!(wakes <= most, "{what}: {wakes} wake-ups for 240 frames");
            assert!(
                latest_ns <= 10_000,
                "{what}: the last frame waited {latest_ns} ns"
            );
        }
    }

    #[test]
    fn sweeps_that_end_early_and_late_are_seen_at_once() {
        // A part in 256 of the period, one way and the other, never twice the same in a row.
        let jitter = |round: u64| (round * 7919 % 101) * 2_600;
        let (wakes, latest_ns) = play(100, |round, i| {
            even(130_000, 33_000_000)(round, i) + jitter(round)
        });
        assert!(wakes <= 18, "{wakes} wake-ups for 240 frames");
        assert!(latest_ns <= 10_000, "the last frame waited {latest_ns} ns");
    }

    #[test]
    fn a_sweep_that_is_over_sooner_than_all_before_is_seen_by_its_pace() {
        // The hundredth is begun 3 ms early, at the pace of all others.
        let (_, latest_ns) = play(64, |round, i| {
            even(100_000, 33_000_000)(round, i) - if round == 100 { 3_000_000 } else { 0 }
        });
        assert!(latest_ns <= 10_000, "the last frame waited {latest_ns} ns");
    }

    #[test]
    fn half_a_sweep_that_comes_all_at_once_is_late_by_a_millisecond_at_most() {
        // When the first half comes varies by 4 ms, so that the phase says little.
        let (_, latest_ns) = play(64, |round, i| match i {
            0..120 => even(100_000, 33_000_000)(round, i),
            _ => (round + 1) * 33_000_000 + 12_100_000 + round * 7919 % 41 * 100_000,
        });
        assert!(
            latest_ns <= *CAREFUL_NS.end(),
            "the last frame waited {latest_ns} ns"
        );
    }

    #[test]
    fn a_burst_is_not_slept_through() {
        let (wakes, latest_ns) = play(100, even(3_000, 10_000_000));
        assert!(wakes <= 30, "{wakes} wake-ups for 240 frames");
        assert!(latest_ns <= 60_000, "the last frame waited {latest_ns} ns");
    }

    #[test]
    fn no_pause_is_longer_than_a_kernel_queue_holds() {
        let mut gather = sweep();
        let longest = (1..1000).map(|round| {
            let now_ns = round * 1_000_000_000;
            gather.pause_ns(now_ns, 1, 240, now_ns)
        });
        assert_eq!(longest.max(), Some(LONGEST_NS));
    }

    #[test]
    fn timer_mode_pauses_for_no_more_than_half_a_tick() {
        let pause_ns = |rate_hz| {
            let tick = TickConfig {
                mode: TickMode::Timer,
                rate_hz,
                ..TickConfig::default()
            };
            Gather::new(&tick).pause_ns(0, 10, 100, 0)
        };
        assert_eq!(pause_ns(30.0), LONGEST_NS);
        assert_eq!(pause_ns(1000.0), 500_000);
    }
}
