//! What a skin gives: a tactile frame of raw counts, and the force frame made of it.

/// The greatest force taken, in the unit of [`ForceFrame::force`]: levels leave as 32-bit floats, whose greatest
/// is 3.4e38. The skin's own greatest are 113,509 counts, or 1.3e10 squared.
pub const FORCE_MAX: f64 = 1e38;

/// The least force of a contact, in the same unit: squares of such forces and of their differences do not vanish.
pub const FORCE_MIN: f64 = 1.0 / FORCE_MAX;

/// How a taxel's value got into a tactile frame.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub enum Freshness {
    /// No value has ever come from this taxel.
    #[default]
    Missing,
    /// The value is older than the deadline allows; it is there to be looked at, not to be felt.
    Stale,
    /// The value belongs to this frame.
    Fresh,
}

/// Every taxel's counts at one instant, with what is missing. Indexed by taxel, `0..N`.
#[derive(Debug, Default, Clone, PartialEq)]
pub struct TactileFrame {
    /// Number of the frame since the daemon started.
    pub seq: u64,
    /// Time of validity: receive time of the newest reading in it, nanoseconds; the tick's time
    /// where none came.
    pub t_ns: u64,
    /// Newest raw counts x, y, z of each taxel; zeros where missing.
    pub counts: Vec<[u16; 3]>,
    /// Status byte that came with them.
    pub status: Vec<u8>,
    /// Age of each taxel's value at `t_ns`, nanoseconds; `u64::MAX` where missing.
    pub age_ns: Vec<u64>,
    /// Whether each value may be used.
    pub freshness: Vec<Freshness>,
    /// Joint angles of the same instant, radians; not a number where unknown, empty where no joints are read.
    pub joints: Vec<f32>,
    /// Time from `t_ns` to the reading nearest to it of each joint, nanoseconds; `u64::MAX` where
    /// there is none.
    pub joint_age_ns: Vec<u64>,
    /// Angular velocity of each joint, radians per second, positive the way in which its angle
    /// grows; not a number where unknown, empty where no joint's is known.
    pub joint_velocity_rad_s: Vec<f32>,
    /// Current that each joint's motor takes, amperes, with the sign that the servo reports; not a
    /// number where unknown, empty where no joint's is known.
    pub joint_current_a: Vec<f32>,
}

/// Why a taxel is not used. A set, since a taxel can be broken in several ways.
#[derive(Default, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Faults(u16);

/// One reason why a taxel is not used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u16)]
pub enum Fault {
    /// Reads 0 or 65535 on every axis: the sensor chip does not answer.
    Dead = 1 << 0,
    /// Has not changed by one count over the calibration window, or for too long since.
    Stuck = 1 << 1,
    /// Its noise is far above that of the other taxels.
    Noisy = 1 << 2,
    /// Wrapped modulo 2^16 more often than a press explains, so that its value cannot be trusted.
    Wrapping = 1 << 3,
    /// Flagged by the publication's rule, mean plus one standard deviation per axis.
    PaperRule = 1 << 4,
    /// The board's status byte reports an error.
    Status = 1 << 5,
    /// No value, or one older than the deadline.
    Missing = 1 << 6,
    /// Switched off in the configuration.
    Masked = 1 << 7,
}

impl Faults {
    /// No fault.
    pub const NONE: Self = Self(0);

    /// The set of these bits, as they came over the wire; those of no reason known here are left out.
    pub fn from_bits(bits: u16) -> Self {
        let known = Fault::ALL
            .into_iter()
            .fold(0, |known, fault| known | fault as u16);
        Self(bits & known)
    }

    /// Adds a reason.
    #[inline]
    pub fn insert(&mut self, fault: Fault) {
        self.0 |= fault as u16;
    }

    /// Takes a reason away.
    #[inline]
    pub fn remove(&mut self, fault: Fault) {
        self.0 &= !(fault as u16);
    }

    /// The reasons of both sets.
    #[must_use]
    #[inline]
    pub fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Whether this reason holds.
    #[inline]
    pub fn contains(self, fault: Fault) -> bool {
        self.0 & fault as u16 != 0
    }

    /// Whether the taxel may be used.
    #[inline]
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The set as bits, as they go over the wire.
    #[inline]
    pub fn bits(self) -> u16 {
        self.0
    }

    /// The reasons, in the order of their bits.
    pub fn iter(self) -> impl Iterator<Item = Fault> {
        Fault::ALL.into_iter().filter(move |f| self.contains(*f))
    }
}

impl std::fmt::Debug for Faults {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_set().entries(self.iter()).finish()
    }
}

impl Fault {
    /// Every reason, in the order of their bits.
    pub const ALL: [Fault; 8] = [
        Fault::Dead,
        Fault::Stuck,
        Fault::Noisy,
        Fault::Wrapping,
        Fault::PaperRule,
        Fault::Status,
        Fault::Missing,
        Fault::Masked,
    ];

    /// The reason in one word, as status reports print it.
    pub fn name(self) -> &'static str {
        match self {
            Fault::Dead => "dead",
            Fault::Stuck => "stuck",
            Fault::Noisy => "noisy",
            Fault::Wrapping => "wrapping",
            Fault::PaperRule => "paper-rule",
            Fault::Status => "status",
            Fault::Missing => "missing",
            Fault::Masked => "masked",
        }
    }
}

/// What the skin feels at one instant: force above baseline per taxel, and which taxels are in contact.
/// Indexed by taxel, `0..N`.
#[derive(Debug, Default, Clone, PartialEq)]
pub struct ForceFrame {
    /// Number of the tactile frame it was made from.
    pub seq: u64,
    /// Time of validity of that frame, nanoseconds.
    pub t_ns: u64,
    /// Magnitude above baseline, counts (counts squared in the publication's squared mode); zero
    /// where faulty.
    pub force: Vec<f64>,
    /// Whether the taxel is in contact: over the threshold of eq. (2) and without a fault.
    pub contact: Vec<bool>,
    /// Why a taxel is not used.
    pub faults: Vec<Faults>,
    /// Whether this taxel's value was repaired in this frame: unwrapped, or a glitch was held back.
    pub repaired: Vec<bool>,
    /// Whether this taxel is used and reads an end of its range, as its board's protocol says: it may be pressed harder
    /// than it can tell.
    pub saturated: Vec<bool>,
    /// The contact threshold in force, in the unit of `force`.
    pub threshold: f64,
    /// Whether the baseline is still being measured; no taxel is in contact then.
    pub calibrating: bool,
}

impl TactileFrame {
    /// A frame of `taxels` missing taxels, with all its memory.
    pub fn new(taxels: usize) -> Self {
        Self {
            seq: 0,
            t_ns: 0,
            counts: vec![[0; 3]; taxels],
            status: vec![0; taxels],
            age_ns: vec![u64::MAX; taxels],
            freshness: vec![Freshness::Missing; taxels],
            joints: Vec::new(),
            joint_age_ns: Vec::new(),
            joint_velocity_rad_s: Vec::new(),
            joint_current_a: Vec::new(),
        }
    }

    /// How many taxels have no usable value: missing or stale.
    pub fn missing(&self) -> usize {
        self.freshness.iter().filter(|f| **f != Freshness::Fresh).count()
    }
}

impl ForceFrame {
    /// A frame of `taxels` taxels that feel nothing, with all its memory.
    pub fn new(taxels: usize) -> Self {
        Self {
            seq: 0,
            t_ns: 0,
            force: vec![0.0; taxels],
            contact: vec![false; taxels],
            faults: vec![Faults::NONE; taxels],
            repaired: vec![false; taxels],
            saturated: vec![false; taxels],
            threshold: 0.0,
            calibrating: false,
        }
    }

    /// Number of taxels in contact, `N_C`.
    pub fn contacts(&self) -> usize {
        self.contact.iter().filter(|c| **c).count()
    }
}
