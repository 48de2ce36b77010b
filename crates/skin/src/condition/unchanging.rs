//! Contacts that go on without a change: something rests on the skin, or a baseline has drifted
//! faster than it was followed. A contact is never ended for that; it is only told.

use super::{MS, NEVER};

/// A contact without a change for this long is told, nanoseconds.
pub(super) const LONG_NS: u64 = 120_000 * MS;
/// A board that says nothing for less than this pauses, and what it touched it touches still, nanoseconds.
pub(super) const PAUSE_NS: u64 = 2_000 * MS;
/// Smooths noise out of the force, one over nanoseconds: over a second.
const PER_SHORT: f64 = 1.0 / 1e9;
/// ... and what it is compared with, over ten.
const PER_LONG: f64 = 1.0 / 10e9;
/// A change is more than this share of the contact threshold between the two: far above what is left
/// of noise in a second, also at a few samples a second, and creeping by less than a twentieth of the
/// threshold a second is none.
const CHANGE_SHARE: f64 = 0.5;

/// One taxel's force from when a contact begins until its force, smoothed, is below what holds a contact: just above
/// that, noise ends and begins contacts all the time.
#[derive(Debug, Clone, Copy)]
pub(super) struct LastingContact {
    short: f64,
    long: f64,
    /// When it changed last, or began; [`NEVER`] where there is none.
    changed_ns: u64,
}

impl LastingContact {
    pub(super) const NONE: Self = Self {
        short: 0.0,
        long: 0.0,
        changed_ns: NEVER,
    };

    /// Whether there is one.
    #[inline]
    pub(super) fn has_begun(&self) -> bool {
        self.changed_ns != NEVER
    }

    /// A contact of `force` begins at `t_ns`.
    pub(super) fn begin(force: f64, t_ns: u64) -> Self {
        Self {
            short: force,
            long: force,
            changed_ns: t_ns,
        }
    }

    /// A sample of `force` at `t_ns`, `dt_ns` after the last. Forces are in counts: a contact begins above `threshold`, and
    /// is held above `release`.
    pub(super) fn go_on(&mut self, force: f64, [threshold, release]: [f64; 2], (t_ns, dt_ns): (u64, u64)) {
        let dt = dt_ns.cast_signed() as f64;
        self.short += (force - self.short) * (dt * PER_SHORT).min(1.0);
        self.long += (self.short - self.long) * (dt * PER_LONG).min(1.0);
        if self.short < release {
            *self = Self::NONE;
        } else if (self.short - self.long).abs() > CHANGE_SHARE * threshold {
            (self.long, self.changed_ns) = (self.short, t_ns);
        }
    }

    /// Whether it has not changed for long at `now_ns`.
    pub(super) fn is_long(&self, now_ns: u64) -> bool {
        now_ns.saturating_sub(self.changed_ns) >= LONG_NS
    }
}
