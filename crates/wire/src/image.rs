//! The payload of an IMAGE message.

use crate::error::{DecodeError, EncodeError};
use crate::fields::{f32_at, u16_at, u32_at};
use crate::format::{HEADER_LEN, MAX_MESSAGE};
use crate::header::{Flags, Header};
use taxel_hand::{Actuator, TactileImage};

const FIXED_LEN: usize = 24;
const ACTUATOR_LEN: usize = 12;

/// Length in bytes of an image's payload: the fixed part, codebook, actuators, joints, pixels, and
/// zeros up to a multiple of four.
///
/// With a display's largest numbers this tells whether its messages stay below [`MAX_MESSAGE`].
pub fn image_payload_len(width: u16, height: u16, levels: usize, actuators: usize, joints: usize) -> usize {
    let pixels = usize::from(width) * usize::from(height);
    FIXED_LEN + 4 * levels + ACTUATOR_LEN * actuators + 4 * joints + pixels.next_multiple_of(4)
}

/// Writes the payload of an image into `out`, replacing what was there.
///
/// Once `out` has grown to the largest image, it allocates no more. What is encoded decodes again; an image
/// whose parts contradict each other is refused and leaves `out` empty.
pub fn encode_image_payload(image: &TactileImage, out: &mut Vec<u8>) -> Result<(), EncodeError> {
    out.clear();
    check(image)?;
    let TactileImage {
        width,
        height,
        pixels,
        levels,
        actuators,
        joints,
        ..
    } = image;
    let len = image_payload_len(*width, *height, levels.len(), actuators.len(), joints.len());
    if HEADER_LEN + len > MAX_MESSAGE {
        return Err(EncodeError::TooLong {
            len: HEADER_LEN + len,
        });
    }
    out.reserve(len);
    for value in [
        *width,
        *height,
        levels.len() as u16,
        actuators.len() as u16,
        joints.len() as u16,
        FIXED_LEN as u16,
    ] {
        out.extend_from_slice(&value.to_le_bytes());
    }
    for count in [image.contacts, image.faulty, image.missing] {
        out.extend_from_slice(&u32::from(count).to_le_bytes());
    }
    for level in levels {
        out.extend_from_slice(&(*level as f32).to_le_bytes());
    }
    for actuator in actuators {
        for value in [actuator.id, actuator.x, actuator.y, actuator.level] {
            out.extend_from_slice(&value.to_le_bytes());
        }
        out.extend_from_slice(&(actuator.force as f32).to_le_bytes());
    }
    for joint in joints {
        out.extend_from_slice(&joint.to_le_bytes());
    }
    out.extend_from_slice(pixels);
    out.resize(len, 0);
    Ok(())
}

fn check(image: &TactileImage) -> Result<(), EncodeError> {
    let expected = usize::from(image.width) * usize::from(image.height);
    if image.pixels.len() != expected {
        return Err(EncodeError::Length {
            section: "pixels",
            len: image.pixels.len(),
            expected,
        });
    }
    for (section, len) in [
        ("levels", image.levels.len()),
        ("actuators", image.actuators.len()),
        ("joints", image.joints.len()),
    ] {
        let max = usize::from(u16::MAX);
        if len > max {
            return Err(EncodeError::TooMany { section, len, max });
        }
    }
    for (index, &force) in image.levels.iter().enumerate() {
        if !is_force(force as f32) {
            return Err(EncodeError::Force {
                section: "level",
                index,
                force,
            });
        }
    }
    for (index, actuator) in image.actuators.iter().enumerate() {
        let Actuator {
            x, y, level, force, ..
        } = *actuator;
        if x >= image.width || y >= image.height || !is_level(level, image.levels.len()) {
            return Err(EncodeError::Actuator { index, x, y, level });
        }
        if !is_force(force as f32) {
            return Err(EncodeError::Force {
                section: "actuator",
                index,
                force,
            });
        }
    }
    Ok(())
}

fn is_force(force: f32) -> bool {
    force.is_finite() && force >= 0.0
}

fn is_level(level: u16, levels: usize) -> bool {
    level >= 1 && usize::from(level) <= levels
}

/// A tactile image in the bytes of its message. Everything in it has been checked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImageView<'a> {
    /// Width, pixels.
    pub width: u16,
    /// Height, pixels.
    pub height: u16,
    /// Number of taxels in contact.
    pub contacts: u32,
    /// Number of taxels not used because of a fault other than a missing value.
    pub faulty: u32,
    /// Number of taxels whose value is missing or stale.
    pub missing: u32,
    levels: &'a [u8],
    actuators: &'a [u8],
    joints: &'a [u8],
    pixels: &'a [u8],
}

/// One actuator as it stands in an IMAGE message.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WireActuator {
    /// Number of the actuator.
    pub id: u16,
    /// Column, below the image's width.
    pub x: u16,
    /// Row, below the image's height.
    pub y: u16,
    /// Force level, from 1 to the number of levels.
    pub level: u16,
    /// Force of that level, in HELLO's unit of force; finite and not negative.
    pub force: f32,
}

impl<'a> ImageView<'a> {
    /// Reads the payload of an IMAGE message.
    pub fn decode(payload: &'a [u8]) -> Result<Self, DecodeError> {
        let len = payload.len();
        if len < FIXED_LEN {
            return Err(DecodeError::SectionShort {
                len,
                needed: FIXED_LEN,
            });
        }
        let fixed_len = u16_at(payload, 10);
        if usize::from(fixed_len) < FIXED_LEN || !fixed_len.is_multiple_of(4) {
            return Err(DecodeError::FixedLen {
                field: "fixed_len",
                value: fixed_len,
                min: FIXED_LEN as u16,
            });
        }
        let (width, height) = (u16_at(payload, 0), u16_at(payload, 2));
        let levels = usize::from(u16_at(payload, 4));
        let actuators = usize::from(u16_at(payload, 6));
        let joints = usize::from(u16_at(payload, 8));
        // At most 65535 * (65535 + 4 + 12 + 4) + 65535, which fits 64 bits, and 32 bits only when saturated.
        let needed = usize::from(fixed_len)
            .saturating_add(4 * levels)
            .saturating_add(ACTUATOR_LEN * actuators)
            .saturating_add(4 * joints)
            .saturating_add(usize::from(width).saturating_mul(usize::from(height)));
        if needed > len {
            return Err(DecodeError::SectionShort { len, needed });
        }
        let rest = &payload[usize::from(fixed_len)..];
        let (levels, rest) = rest.split_at(4 * levels);
        let (actuators, rest) = rest.split_at(ACTUATOR_LEN * actuators);
        let (joints, rest) = rest.split_at(4 * joints);
        let view = Self {
            width,
            height,
            contacts: u32_at(payload, 12),
            faulty: u32_at(payload, 16),
            missing: u32_at(payload, 20),
            levels,
            actuators,
            joints,
            pixels: &rest[..usize::from(width) * usize::from(height)],
        };
        view.check()?;
        Ok(view)
    }

    fn check(&self) -> Result<(), DecodeError> {
        if let Some(index) = self.levels().position(|force| !is_force(force)) {
            return Err(DecodeError::BadForce {
                section: "level",
                index,
            });
        }
        let levels = self.levels().len();
        for (
            index,
            WireActuator {
                x, y, level, force, ..
            },
        ) in self.actuators().enumerate()
        {
            if x >= self.width || y >= self.height || !is_level(level, levels) {
                return Err(DecodeError::BadActuator { index, x, y, level });
            }
            if !is_force(force) {
                return Err(DecodeError::BadForce {
                    section: "actuator",
                    index,
                });
            }
        }
        Ok(())
    }

    /// The force of each level, ascending, in HELLO's unit of force.
    pub fn levels(&self) -> impl ExactSizeIterator<Item = f32> + use<'a> {
        self.levels.chunks_exact(4).map(|bytes| f32_at(bytes, 0))
    }

    /// The actuators that press.
    pub fn actuators(&self) -> impl ExactSizeIterator<Item = WireActuator> + use<'a> {
        self.actuators
            .chunks_exact(ACTUATOR_LEN)
            .map(|bytes| WireActuator {
                id: u16_at(bytes, 0),
                x: u16_at(bytes, 2),
                y: u16_at(bytes, 4),
                level: u16_at(bytes, 6),
                force: f32_at(bytes, 8),
            })
    }

    /// The joint angles, radians; not a number where an angle could not be read.
    pub fn joints(&self) -> impl ExactSizeIterator<Item = f32> + use<'a> {
        self.joints.chunks_exact(4).map(|bytes| f32_at(bytes, 0))
    }

    /// The greys, row by row from the top left; 0 is no contact. Shape `height x width`.
    pub fn pixels(&self) -> &'a [u8] {
        self.pixels
    }

    /// The grey of one pixel, where the image has it.
    pub fn pixel(&self, x: u16, y: u16) -> Option<u8> {
        (x < self.width && y < self.height)
            .then(|| self.pixels[usize::from(y) * usize::from(self.width) + usize::from(x)])
    }

    /// The image with memory of its own; counts above 65535 become 65535.
    pub fn to_image(&self, header: &Header) -> TactileImage {
        let count = |count: u32| u16::try_from(count).unwrap_or(u16::MAX);
        TactileImage {
            seq: header.seq,
            t_ns: header.t_ns,
            width: self.width,
            height: self.height,
            pixels: self.pixels.to_vec(),
            levels: self.levels().map(f64::from).collect(),
            actuators: self
                .actuators()
                .map(|a| Actuator {
                    id: a.id,
                    x: a.x,
                    y: a.y,
                    level: a.level,
                    force: a.force.into(),
                })
                .collect(),
            contacts: count(self.contacts),
            faulty: count(self.faulty),
            missing: count(self.missing),
            calibrating: header.flags.contains(Flags::CALIBRATING),
            repaired: header.flags.contains(Flags::REPAIRED),
            saturated: header.flags.contains(Flags::SATURATED),
            joints: self.joints().collect(),
        }
    }
}
