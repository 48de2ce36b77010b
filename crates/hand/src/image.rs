//! What a display is given: the tactile image.

use crate::{Fault, Faults};

/// A force frame compressed to what a display can render: `K_D` force levels at no more than `K_A` places.
#[derive(Debug, Default, Clone, PartialEq)]
pub struct TactileImage {
    /// Number of the tactile frame it was made from.
    pub seq: u64,
    /// Time of validity of that frame, nanoseconds.
    pub t_ns: u64,
    /// Width, pixels.
    pub width: u16,
    /// Height, pixels.
    pub height: u16,
    /// The 8-bit image, row by row from the top left; 0 is no contact. Shape `height x width`.
    pub pixels: Vec<u8>,
    /// The force codebook: the force of each level, ascending, in the unit of [`crate::ForceFrame::force`].
    /// `K_D` entries where levels are fitted to a frame, neighbours equal where it has fewer distinct
    /// forces, and none without contact; those of the codebook where it is constant.
    pub levels: Vec<f64>,
    /// The actuators that press, in the order of their ids. At most `K_A`.
    pub actuators: Vec<Actuator>,
    /// Number of taxels in contact, `N_C`.
    pub contacts: u16,
    /// Number of taxels not used because of a fault other than a missing value.
    pub faulty: u16,
    /// Number of taxels whose value is missing or stale.
    pub missing: u16,
    /// Whether the baseline is still being measured; the image is empty then.
    pub calibrating: bool,
    /// Whether a value was repaired in this frame: unwrapped, or a glitch held back.
    pub repaired: bool,
    /// Whether a taxel that is used reads an end of its range ([`crate::ForceFrame::saturated`]).
    pub saturated: bool,
    /// Joint angles of the same instant, radians; empty where no joints are read.
    pub joints: Vec<f32>,
}

/// One actuator of the display, where and how hard it presses.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub struct Actuator {
    /// Number of the actuator, `0..K_A`; the `paper` method numbers them anew in each frame.
    pub id: u16,
    /// Column of the pixel it stands on.
    pub x: u16,
    /// Row of the pixel it stands on.
    pub y: u16,
    /// Force level, `1..=levels.len()`.
    pub level: u16,
    /// Force of that level, in the unit of [`TactileImage::levels`].
    pub force: f64,
}

impl TactileImage {
    /// Counts the taxels that a set of faults takes out: those without a value, and those broken otherwise.
    pub fn count_faults(&mut self, faults: &[Faults]) {
        // Of most hands, none has any.
        let any = faults.iter().fold(Faults::NONE, |any, faults| any.union(*faults));
        let count = |has: fn(&Faults) -> bool| faults.iter().filter(|f| has(f)).count();
        let (missing, taken_out) = if any.is_empty() {
            (0, 0)
        } else {
            (count(|f| f.contains(Fault::Missing)), count(|f| !f.is_empty()))
        };
        self.missing = missing as u16;
        self.faulty = (taken_out - missing) as u16;
    }
}
