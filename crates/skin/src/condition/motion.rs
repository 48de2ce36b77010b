//! Where the counts of all taxels are, how they last moved, and which of a frame's samples call for
//! a closer look.
//!
//! Most samples are a short step on from the last one, and no rule of repair or health has anything
//! to say about them. That is found out for a whole frame in one loop over the axes of all taxels,
//! without a branch, so that the compiler makes vector instructions of it.

use super::place::{Place, RepairLimits};

/// A step beyond this is always in doubt.
const MOST_COUNTS: i16 = i16::MAX - 1;

/// What a step is compared with, counts.
#[derive(Debug, Clone, Copy)]
pub(super) struct StepLimits {
    glitch_counts: i16,
    jump_counts: i16,
    unsteady_counts: i16,
}

impl StepLimits {
    pub(super) fn new(repair: &RepairLimits, unsteady_counts: i32) -> Self {
        let cut = |counts: i32| counts.min(MOST_COUNTS.into()) as i16;
        let when_rejecting = |counts| if repair.reject { cut(counts) } else { MOST_COUNTS };
        Self {
            glitch_counts: when_rejecting(repair.glitch_counts),
            jump_counts: when_rejecting(repair.jump_counts),
            unsteady_counts: cut(unsteady_counts),
        }
    }
}

/// The places of all taxels.
#[derive(Debug, Clone)]
struct Places {
    counts: Vec<[i32; 3]>,
    step: Vec<[i32; 3]>,
}

impl Places {
    fn new(taxels: usize) -> Self {
        Self {
            counts: vec![[0; 3]; taxels],
            step: vec![[0; 3]; taxels],
        }
    }

    #[inline(always)]
    fn at(&self, taxel: usize) -> Place {
        Place {
            counts: self.counts[taxel],
            step: self.step[taxel],
        }
    }

    fn set(&mut self, taxel: usize, place: Place) {
        (self.counts[taxel], self.step[taxel]) = (place.counts, place.step);
    }
}

/// Where all taxels are, and where a frame's samples would take them.
#[derive(Debug, Clone)]
pub(super) struct Motion {
    now: Places,
    next: Places,
    doubt: Vec<[i16; 3]>,
}

impl Motion {
    pub(super) fn new(taxels: usize) -> Self {
        Self {
            now: Places::new(taxels),
            next: Places::new(taxels),
            doubt: vec![[0; 3]; taxels],
        }
    }

    /// Repaired counts of every taxel.
    #[inline]
    pub(super) fn counts(&self) -> &[[i32; 3]] {
        &self.now.counts
    }

    #[inline]
    pub(super) fn at(&self, taxel: usize) -> Place {
        self.now.at(taxel)
    }

    pub(super) fn set(&mut self, taxel: usize, place: Place) {
        self.now.set(taxel, place);
    }

    /// Forgets how a taxel last moved.
    pub(super) fn rest(&mut self, taxel: usize) {
        self.now.step[taxel] = [0; 3];
    }

    /// Compares a frame's raw counts with where every taxel is. [`Motion::next`] and
    /// [`Motion::is_clear`] then tell, and [`Motion::go_on`] takes all taxels there but those that
    /// [`Motion::stay`].
    pub(super) fn compare(&mut self, raw: &[[u16; 3]], limits: &StepLimits) {
        compare(
            raw.as_flattened(),
            (self.now.counts.as_flattened(), self.now.step.as_flattened()),
            limits,
            (
                self.next.counts.as_flattened_mut(),
                self.next.step.as_flattened_mut(),
            ),
            self.doubt.as_flattened_mut(),
        );
    }

    /// Where the sample last compared would take a taxel.
    #[inline(always)]
    pub(super) fn next(&self, taxel: usize) -> Place {
        self.next.at(taxel)
    }

    /// Whether no rule can object to the step: no axis crosses the border of 2^16, jumps, goes back
    /// and forth, or reads as a silent chip's does. (A rule that looks at all axes may yet find
    /// nothing wrong where this says no.)
    #[inline(always)]
    pub(super) fn is_clear(&self, taxel: usize) -> bool {
        let [x, y, z] = self.doubt[taxel];
        x | y | z == 0
    }

    /// A taxel does not move on.
    #[inline(always)]
    pub(super) fn stay(&mut self, taxel: usize) {
        self.next.set(taxel, self.now.at(taxel));
    }

    /// All taxels move on.
    pub(super) fn go_on(&mut self) {
        std::mem::swap(&mut self.now, &mut self.next);
    }
}

/// Where each axis goes, and whether that is in doubt. Sixteen bits are enough for a step, and a
/// vector holds many: differences are cut off where they do not fit, and limits short of that, so
/// that such a step is in doubt.
fn compare(
    raw: &[u16],
    (counts, before): (&[i32], &[i32]),
    limits: &StepLimits,
    (next_counts, next_step): (&mut [i32], &mut [i32]),
    doubt: &mut [i16],
) {
    // Slices of one length, so that no index below needs a check.
    let axes = raw.len();
    let (counts, before) = (&counts[..axes], &before[..axes]);
    let (next_counts, next_step) = (&mut next_counts[..axes], &mut next_step[..axes]);
    let (doubt, limits) = (&mut doubt[..axes], *limits);
    for n in 0..axes {
        let (now, last) = (raw[n], counts[n] as u16);
        let (step, before) = (now.wrapping_sub(last).cast_signed(), before[n] as i16);
        let crosses = (step < 0) != (now < last);
        let (size, size_before) = (step.saturating_abs(), before.saturating_abs());
        // As in `RepairState::suspicion`, without regard to the other axes.
        let odd = size.min(step.saturating_sub(before).saturating_abs());
        let usual = size_before.min(MOST_COUNTS / 4) * 4;
        let jumps = odd > limits.jump_counts.min(limits.glitch_counts.max(usual));
        // As in `Health::moved`.
        let reverses = ((step ^ before) < 0) & (size.min(size_before) > limits.unsteady_counts);
        // 0 or 65535, as in `is_dead_sample`.
        let silent = now.wrapping_add(1) <= 1;
        doubt[n] = i16::from(crosses | jumps | reverses | silent);
        (next_step[n], next_counts[n]) = (step.into(), counts[n] + i32::from(step));
    }
}
