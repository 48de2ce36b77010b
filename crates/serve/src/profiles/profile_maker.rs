//! What a program says of the profiles it serves: how to make one's messages, and what they cost.

use taxel_hand::Profile;
use taxel_wire::{Encode, Hello};

/// What makes a profile distinct: two displays that state the same are given the same bytes.
#[derive(Debug, Clone, PartialEq)]
pub struct DisplayProfile {
    /// What the display can do.
    pub profile: Profile,
    /// Parts of the hand, each once and in the layout's order; `None` for all of it.
    pub region: Option<Vec<String>>,
}

impl DisplayProfile {
    /// Written in one way: those that give the same images are equal so.
    pub(crate) fn canonical(&self) -> Self {
        Self {
            profile: self.profile.canonical(),
            region: self.region.clone(),
        }
    }
}

/// Time on a processor that one image takes, compressed and encoded, nanoseconds.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct Cost {
    /// With every taxel in contact, each with a force of its own that changes at random from frame to frame.
    pub worst_ns: u64,
    /// With the forces that the hand feels at the moment.
    pub newest_ns: u64,
}

impl Cost {
    /// What is set aside for it.
    pub fn reserved_ns(&self) -> u64 {
        self.worst_ns.max(self.newest_ns)
    }
}

/// An encoder, and the bytes of its longest payload.
pub type MadeOutput<F> = (Box<dyn Encode<F> + Send>, usize);

/// The measurement of a profile's cost, which takes a while; it is run on a thread of its own.
pub type Measurement = Box<dyn FnOnce() -> Cost + Send>;

/// How a program makes messages for a display profile.
pub trait ProfileMaker: 'static {
    /// What messages are made of.
    type Frames: 'static;

    /// The description that subscribers of this profile get.
    fn hello(&self, wanted: &DisplayProfile) -> Hello;

    /// The encoder of this profile's images, with all its memory; `None` where no images are made
    /// at all. The error is fit for an EVENT.
    fn output(&self, wanted: &DisplayProfile) -> Result<Option<MadeOutput<Self::Frames>>, String>;

    /// What measures the cost of this profile. One whose first image takes longer than
    /// `hopeless_ns` need not be measured further.
    fn measurement(&self, wanted: &DisplayProfile, hopeless_ns: u64) -> Result<Measurement, String>;

    /// The encoder of raw frames; `None` where there are none.
    fn raw(&self) -> Option<MadeOutput<Self::Frames>>;

    /// The parts of a stated region as a [`DisplayProfile`] has them. The error is fit for an EVENT.
    fn region(&self, names: &[String]) -> Result<Option<Vec<String>>, String>;

    /// Time between two images, nanoseconds.
    fn period_ns(&self) -> u64;

    /// Messages per second.
    fn rate_hz(&self) -> f64 {
        1e9 / self.period_ns().max(1) as f64
    }
}
