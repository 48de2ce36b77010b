//! What one display is given of a tick: the force frame, or the part of it that the display shows,
//! compressed.

use crate::frames::Frames;
use std::collections::HashSet;
use std::ops::Range;
use taxel_compress::Compressor;
use taxel_hand::{ForceFrame, Geometry, Module, Profile, ProfileError, TactileImage};
use taxel_joints::MAX_JOINTS;
use taxel_wire::{Encode, EncodeError, Header};

/// A compressor, the part of the hand it is shown, and the image it fills.
#[derive(Debug)]
pub struct Display {
    compressor: Compressor,
    region: Option<Mask>,
    image: TactileImage,
}

/// A force frame in which nothing is felt outside a region of the hand.
#[derive(Debug)]
struct Mask {
    /// The taxels inside.
    taxels: Vec<Range<usize>>,
    force: ForceFrame,
}

impl Display {
    /// Takes all the memory that frames of this hand will need. `region` names parts of the layout, as
    /// [`resolve_region`] returns them; `None` is the whole hand.
    pub fn new(profile: Profile, region: Option<&[String]>, hand: &Geometry) -> Result<Self, ProfileError> {
        let compressor = Compressor::new(profile, hand)?;
        let mut image = compressor.new_image();
        image.joints.reserve_exact(MAX_JOINTS);
        Ok(Self {
            region: region.map(|parts| Mask::new(parts, hand)),
            compressor,
            image,
        })
    }

    /// Compresses what a tick felt. Allocates nothing.
    pub fn compress(&mut self, frames: &Frames) -> &TactileImage {
        self.image_of(&frames.force, &frames.tactile.joints)
    }

    /// The image of what the skin feels, with the angles of the joints at that instant, radians. Allocates nothing.
    pub fn image_of(&mut self, force: &ForceFrame, joints: &[f32]) -> &TactileImage {
        let force = match &mut self.region {
            Some(mask) => mask.apply(force),
            None => force,
        };
        self.compressor.compress(force, &mut self.image);
        self.image.joints.clear();
        self.image.joints.extend_from_slice(joints);
        &self.image
    }
}

impl Encode<Frames> for Display {
    /// Compresses what a tick felt into the payload of an IMAGE message.
    fn encode(&mut self, frames: &Frames, payload: &mut Vec<u8>) -> Result<Header, EncodeError> {
        let image = self.compress(frames);
        taxel_wire::encode_image_payload(image, payload)?;
        Ok(Header::of_image(image, payload.len()))
    }
}

impl Mask {
    fn new(parts: &[String], hand: &Geometry) -> Self {
        let taxels = (hand.modules.iter())
            .filter(|module| parts.contains(&module.part))
            .map(Module::taxel_range)
            .collect();
        Self {
            taxels,
            force: ForceFrame::new(hand.len()),
        }
    }

    /// The frame as the region feels it. What lies outside never changes from what it was made with.
    fn apply(&mut self, whole: &ForceFrame) -> &ForceFrame {
        let masked = &mut self.force;
        masked.seq = whole.seq;
        masked.t_ns = whole.t_ns;
        masked.threshold = whole.threshold;
        masked.calibrating = whole.calibrating;
        for taxels in &self.taxels {
            let inside = || taxels.clone();
            masked.force[inside()].copy_from_slice(&whole.force[inside()]);
            masked.contact[inside()].copy_from_slice(&whole.contact[inside()]);
            masked.faults[inside()].copy_from_slice(&whole.faults[inside()]);
            masked.repaired[inside()].copy_from_slice(&whole.repaired[inside()]);
            masked.saturated[inside()].copy_from_slice(&whole.saturated[inside()]);
        }
        &self.force
    }
}

/// Why a region is none.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub enum RegionError {
    /// The hand has no part of this name.
    #[error("region: the hand has no part `{name}`; it has {}", parts.join(", "))]
    NoSuchPart {
        /// The name given, cut to 64 characters.
        name: String,
        /// The parts that the hand has.
        parts: Vec<String>,
    },
    /// No part is named.
    #[error("region: no part is named; leave it out for the whole hand, which has {}", parts.join(", "))]
    Empty {
        /// The parts that the hand has.
        parts: Vec<String>,
    },
}

/// The parts of a region, each once, in the order of the layout; `None` where they are the whole hand. Takes time in
/// proportion to the names and modules, since a client may name thousands.
pub fn resolve_region(names: &[String], hand: &Geometry) -> Result<Option<Vec<String>>, RegionError> {
    let mut seen = HashSet::new();
    let parts: Vec<&String> = (hand.modules.iter())
        .map(|module| &module.part)
        .filter(|part| seen.insert(*part))
        .collect();
    let owned = |parts: &[&String]| parts.iter().map(|part| part.to_string()).collect();
    if let Some(name) = names.iter().find(|name| !seen.contains(name)) {
        return Err(RegionError::NoSuchPart {
            name: name.chars().take(64).collect(),
            parts: owned(&parts),
        });
    }
    if names.is_empty() {
        return Err(RegionError::Empty { parts: owned(&parts) });
    }
    let named: HashSet<&String> = names.iter().collect();
    let region: Vec<&String> = (parts.iter().copied())
        .filter(|part| named.contains(part))
        .collect();
    Ok((region.len() < parts.len()).then(|| owned(&region)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_hand::{Fault, Faults};
    use taxel_skin::Layout;
    use taxel_wire::Flags;

    fn hand() -> Layout {
        Layout::builtin("allegro-uskin-15").unwrap()
    }

    fn names(names: &[&str]) -> Vec<String> {
        names.iter().map(|name| name.to_string()).collect()
    }

    #[test]
    fn a_region_is_its_parts_once_in_the_order_of_the_hand() {
        let resolve = |region: &[&str]| resolve_region(&names(region), &hand());
        assert_eq!(
            resolve(&["thumb", "index", "thumb"]).unwrap(),
            Some(names(&["index", "thumb"]))
        );
        assert_eq!(resolve(&["ring", "thumb", "middle", "index"]).unwrap(), None);
        let palm = resolve(&["index", "palm"]).unwrap_err().to_string();
        assert!(
            palm.contains("`palm`") && palm.contains("index, middle, ring, thumb"),
            "{palm}"
        );
        assert!(resolve(&[]).unwrap_err().to_string().contains("no part is named"));
    }

    /// Outside the region a taxel is neither felt nor missed, and says nothing through the flags.
    #[test]
    fn outside_a_region_nothing_is_felt_counted_or_flagged() {
        let layout = hand();
        let mut frames = Frames::new(layout.len());
        let mut fault = Faults::NONE;
        fault.insert(Fault::Stuck);
        let mut inside = 0;
        for taxel in 0..layout.len() {
            let thumb = layout.module_of(taxel).part == "thumb";
            inside += usize::from(thumb);
            frames.force.force[taxel] = if thumb { 100.0 } else { 9000.0 };
            frames.force.contact[taxel] = true;
            frames.force.repaired[taxel] = !thumb;
            frames.force.saturated[taxel] = !thumb;
        }
        let elsewhere = layout
            .taxels
            .iter()
            .position(|t| layout.modules[usize::from(t.module)].part == "ring");
        frames.force.faults[elsewhere.unwrap()] = fault;
        let encoded = |region: Option<&[String]>| {
            let mut display = Display::new(Profile::default(), region, &layout).unwrap();
            let header = display.encode(&frames, &mut Vec::new()).unwrap();
            (header.flags, display.image)
        };

        let (flags, image) = encoded(Some(&names(&["thumb"])));
        assert_eq!(flags, Flags::NONE);
        assert_eq!((usize::from(image.contacts), image.faulty), (inside, 0));
        assert_eq!(image.levels, [100.0; 8]);
        for actuator in &image.actuators {
            let under = |t: &&taxel_hand::Taxel| (t.x, t.y) == (actuator.x, actuator.y);
            let taxel = layout.taxels.iter().find(under).unwrap();
            assert_eq!(layout.modules[usize::from(taxel.module)].part, "thumb");
        }

        let (flags, image) = encoded(None);
        assert_eq!(flags, Flags::FAULTY | Flags::REPAIRED | Flags::SATURATED);
        assert_eq!((usize::from(image.contacts), image.faulty), (layout.len() - 1, 1));
    }
}
