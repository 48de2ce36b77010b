//! Where a taxel's counts are, and which steps from there are suspect: what repair and motion share.

/// The repaired counts of one taxel and the last accepted step of each axis, counts.
#[derive(Debug, Default, Clone, Copy)]
pub(super) struct Place {
    pub(super) counts: [i32; 3],
    pub(super) step: [i32; 3],
}

impl Place {
    /// Whether an axis is a multiple of 65536 away from what the board sent.
    #[inline(always)]
    pub(super) fn is_beyond_border(&self) -> bool {
        let [x, y, z] = self.counts;
        (x | y | z) >> 16 != 0
    }

    /// Whether the taxel moved by a count.
    #[inline(always)]
    pub(super) fn has_moved(&self) -> bool {
        let [x, y, z] = self.step;
        x | y | z != 0
    }

    /// Whether the last step fits into sixteen bits, as
    /// [`Motion::compare`](super::motion::Motion::compare) takes for granted.
    pub(super) fn is_within_reach(&self) -> bool {
        self.step.iter().all(|s| i16::try_from(*s).is_ok())
    }
}

/// Thresholds of the repair, in counts.
#[derive(Debug, Clone, Copy)]
pub(super) struct RepairLimits {
    pub(super) unwrap: bool,
    pub(super) reject: bool,
    pub(super) glitch_counts: i32,
    pub(super) jump_counts: i32,
}
