//! A force frame in, a tactile image out.

use taxel_hand::{ForceFrame, Geometry, Grey, Profile, ProfileError, TactileImage};

use crate::actuators::Actuators;
use crate::contacts::Contacts;
use crate::levels::Levels;

/// Compresses the force frames of one hand for one display profile.
///
/// The same frames in the same order give the same images, to the bit, on every platform.
///
/// ```
/// use taxel_hand::{ForceFrame, Geometry, Profile};
/// use taxel_compress::Compressor;
///
/// let geometry = Geometry::grid(4, 1)?;
/// let mut compressor = Compressor::new(Profile { levels: 2, ..Profile::default() }, &geometry)?;
/// let mut image = compressor.new_image();
///
/// let mut frame = ForceFrame::new(4);
/// frame.force = vec![0.0, 10.0, 12.0, 50.0];
/// frame.contact = vec![false, true, true, true];
/// compressor.compress(&frame, &mut image);
/// assert_eq!(image.levels, [11.0, 50.0]);
/// assert_eq!(image.pixels, [0, 128, 128, 255]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Compressor {
    profile: Profile,
    width: u16,
    height: u16,
    contacts: Contacts,
    levels: Levels,
    actuators: Actuators,
    refused: u64,
}

/// What the two stages made of a frame; one entry per contact, in raster order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stages<'a> {
    /// Column and row.
    pub pixel: &'a [[u16; 2]],
    /// Measured force.
    pub force: &'a [f64],
    /// Force level, as an index into [`TactileImage::levels`].
    pub level: &'a [u16],
    /// Id of the actuator that stands for it.
    pub actuator: &'a [u16],
}

impl Compressor {
    /// Takes all the memory that frames of this hand will need.
    ///
    /// # Errors
    ///
    /// A profile that describes no display ([`Profile::check`]) or asks for what the geometry does
    /// not have (parts, places in millimetres); a geometry whose taxels do not each have a pixel of
    /// their own inside its image.
    pub fn new(profile: Profile, geometry: &Geometry) -> Result<Self, ProfileError> {
        profile.check()?;
        check_pixels(geometry)?;
        let taxels = geometry.taxels.len();
        let places = crate::actuator_groups::places(geometry, profile.coordinates)?;
        let contacts = Contacts::new(geometry, &places);
        let actuators = Actuators::new(&profile, geometry, &places, &contacts)?;
        let profile = Profile {
            levels: profile.level_count(),
            ..profile
        };
        Ok(Self {
            width: geometry.width,
            height: geometry.height,
            contacts,
            levels: Levels::new(&profile, taxels),
            actuators,
            refused: 0,
            profile,
        })
    }

    /// The profile it compresses for; `levels` is the number of levels, also where the profile gave
    /// a JND instead.
    pub fn profile(&self) -> &Profile {
        &self.profile
    }

    /// An empty image with memory for anything [`Compressor::compress`] can put into it.
    pub fn new_image(&self) -> TactileImage {
        TactileImage {
            width: self.width,
            height: self.height,
            pixels: vec![0; usize::from(self.width) * usize::from(self.height)],
            levels: Vec::with_capacity(self.profile.levels.into()),
            actuators: Vec::with_capacity(self.profile.actuators.into()),
            ..TactileImage::default()
        }
    }

    /// Forces refused since the start: not a number, infinite, or a contact with a force that is not from
    /// [`FORCE_MIN`](taxel_hand::FORCE_MIN) to [`FORCE_MAX`](taxel_hand::FORCE_MAX). Each is treated as no contact and
    /// counted in [`TactileImage::faulty`].
    pub fn refused(&self) -> u64 {
        self.refused
    }

    /// Compresses a frame into an image; `docs/algorithm.md` says how, to the bit.
    ///
    /// Everything in the image is overwritten except `joints`, which belong to the caller. An image
    /// from [`Compressor::new_image`], or one used before, is filled without allocating. Taxels
    /// that the frame lacks count as missing, taxels that the geometry lacks are ignored.
    pub fn compress(&mut self, frame: &ForceFrame, image: &mut TactileImage) {
        self.contacts.collect(frame);
        self.refused += self.contacts.refused as u64;
        self.levels.quantise(&self.profile, &self.contacts);
        self.actuators
            .place(&self.profile, &self.contacts, &self.levels, &mut image.actuators);
        self.describe(frame, image);
        self.paint(image);
    }

    /// What the two stages made of the last frame, contact by contact.
    pub fn stages(&self) -> Stages<'_> {
        Stages {
            pixel: &self.contacts.pixel,
            force: &self.contacts.force,
            level: &self.levels.level,
            actuator: self.actuators.cluster(),
        }
    }

    /// Fills in everything that is copied or counted.
    fn describe(&self, frame: &ForceFrame, image: &mut TactileImage) {
        let taxels = self.contacts.taxels();
        image.seq = frame.seq;
        image.t_ns = frame.t_ns;
        image.width = self.width;
        image.height = self.height;
        image.levels.clear();
        image.levels.extend_from_slice(&self.levels.codebook);
        image.contacts = saturate(self.contacts.len());
        image.calibrating = frame.calibrating;
        image.repaired = any(&frame.repaired);
        image.saturated = any(&frame.saturated);
        let known = taxels.min(frame.faults.len());
        image.count_faults(&frame.faults[..known]);
        image.missing = saturate(usize::from(image.missing) + (taxels - known));
        image.faulty = saturate(usize::from(image.faulty) + self.contacts.refused);
    }

    /// Paints the actuators, eqs (7) and (12): grey at their pixels, 0 everywhere else.
    fn paint(&self, image: &mut TactileImage) {
        image.pixels.clear();
        image
            .pixels
            .resize(usize::from(self.width) * usize::from(self.height), 0);
        let greatest = image.levels.last().copied().unwrap_or(1.0);
        for actuator in &image.actuators {
            let pixel = usize::from(actuator.y) * usize::from(self.width) + usize::from(actuator.x);
            image.pixels[pixel] = match self.profile.grey {
                Grey::Level => grey_of_level(actuator.level, self.profile.levels),
                Grey::Centroid => grey_of_force(actuator.force, greatest),
            };
        }
    }
}

/// `floor(255 k / K_D + 1/2)`.
fn grey_of_level(level: u16, levels: u16) -> u8 {
    let (level, levels) = (u32::from(level), u32::from(levels));
    ((510 * level + levels) / (2 * levels)) as u8
}

/// `floor(255 mu_k / mu_max + 1/2)`, but never 0, which is no contact.
fn grey_of_force(force: f64, greatest: f64) -> u8 {
    (((255.0 * force) / greatest + 0.5).floor() as u8).max(1)
}

/// Looks at all, which is faster than to stop at the first: of most hands there is none.
fn any(marks: &[bool]) -> bool {
    marks.iter().fold(false, |any, mark| any | mark)
}

fn saturate(count: usize) -> u16 {
    u16::try_from(count).unwrap_or(u16::MAX)
}

/// Refuses a geometry in which a taxel lies outside the image or two share a pixel.
fn check_pixels(geometry: &Geometry) -> Result<(), ProfileError> {
    let (width, height) = (geometry.width, geometry.height);
    let mut taken = vec![None; usize::from(width) * usize::from(height)];
    for (taxel, place) in geometry.taxels.iter().enumerate() {
        let (x, y) = (place.x, place.y);
        if x >= width || y >= height {
            return Err(ProfileError::TaxelOutsideImage {
                taxel,
                x,
                y,
                width,
                height,
            });
        }
        let pixel = &mut taken[usize::from(y) * usize::from(width) + usize::from(x)];
        if let Some(first) = pixel.replace(taxel) {
            return Err(ProfileError::PixelShared {
                first,
                second: taxel,
                x,
                y,
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grey_levels_span_the_display_and_halves_round_up() {
        for (level, levels, want) in [
            (1, 1, 255),
            (1, 2, 128),
            (2, 2, 255),
            (1, 6, 43),
            (1, 8, 32),
            (8, 8, 255),
            (1, 255, 1),
            (254, 255, 254),
        ] {
            assert_eq!(grey_of_level(level, levels), want, "{level} of {levels}");
        }
    }

    #[test]
    fn grey_of_a_force_keeps_ratios_and_is_never_no_contact() {
        for (force, greatest, want) in [
            (10.0, 10.0, 255),
            (5.0, 10.0, 128),
            (1.0, 1000.0, 1),
            (1e-300, 1e100, 1),
            (12_884_508_675.0, 12_884_508_675.0, 255),
        ] {
            assert_eq!(grey_of_force(force, greatest), want, "{force} of {greatest}");
        }
    }
}
