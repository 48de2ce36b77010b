//! The payload of a RAW message: every taxel as the board sent it, and what was made of it.

use crate::error::{DecodeError, EncodeError};
use crate::fields::{f32_at, u16_at, u32_at};
use crate::header::{HEADER_LEN, MAX_MESSAGE};
use taxel_hand::{Fault, ForceFrame, Freshness, TactileFrame};

const FIXED_LEN: usize = 16;
const RECORD_LEN: usize = 20;
const MARK_CONTACT: u8 = 1 << 0;
const MARK_REPAIRED: u8 = 1 << 1;

/// Length in bytes of the payload for so many taxels and joints.
pub fn raw_payload_len(taxels: usize, joints: usize) -> usize {
    FIXED_LEN + RECORD_LEN * taxels + 4 * joints
}

/// Writes a frame's raw counts and what conditioning made of them into `out`, replacing what was there.
///
/// Once `out` has grown to the frame's size, it allocates no more. Forces go as they are, not a number
/// included; a frame whose parts differ in length is refused and leaves `out` empty.
pub fn encode_raw_payload(
    frame: &TactileFrame,
    force: &ForceFrame,
    out: &mut Vec<u8>,
) -> Result<(), EncodeError> {
    out.clear();
    let taxels = frame.counts.len();
    for (section, len) in [
        ("status", frame.status.len()),
        ("age_ns", frame.age_ns.len()),
        ("freshness", frame.freshness.len()),
        ("force", force.force.len()),
        ("contact", force.contact.len()),
        ("faults", force.faults.len()),
        ("repaired", force.repaired.len()),
    ] {
        if len != taxels {
            return Err(EncodeError::Length {
                section,
                len,
                expected: taxels,
            });
        }
    }
    let joints = frame.joints.len();
    if joints > usize::from(u16::MAX) {
        return Err(EncodeError::TooMany {
            section: "joints",
            len: joints,
            max: u16::MAX.into(),
        });
    }
    let len = raw_payload_len(taxels, joints);
    if HEADER_LEN + len > MAX_MESSAGE {
        return Err(EncodeError::TooLong {
            len: HEADER_LEN + len,
        });
    }
    out.reserve(len);
    out.extend_from_slice(&(taxels as u32).to_le_bytes());
    out.extend_from_slice(&(RECORD_LEN as u16).to_le_bytes());
    out.extend_from_slice(&(FIXED_LEN as u16).to_le_bytes());
    out.extend_from_slice(&(force.threshold as f32).to_le_bytes());
    out.extend_from_slice(&(joints as u16).to_le_bytes());
    out.extend_from_slice(&[0; 2]);
    for taxel in 0..taxels {
        for counts in frame.counts[taxel] {
            out.extend_from_slice(&counts.to_le_bytes());
        }
        out.extend_from_slice(&force.faults[taxel].bits().to_le_bytes());
        out.extend_from_slice(&(force.force[taxel] as f32).to_le_bytes());
        let age_us = u32::try_from(frame.age_ns[taxel] / 1000).unwrap_or(u32::MAX);
        out.extend_from_slice(&age_us.to_le_bytes());
        let freshness = match frame.freshness[taxel] {
            Freshness::Missing => 0,
            Freshness::Stale => 1,
            Freshness::Fresh => 2,
        };
        let contact = if force.contact[taxel] { MARK_CONTACT } else { 0 };
        let repaired = if force.repaired[taxel] { MARK_REPAIRED } else { 0 };
        out.extend_from_slice(&[freshness, frame.status[taxel], contact | repaired, 0]);
    }
    for joint in &frame.joints {
        out.extend_from_slice(&joint.to_le_bytes());
    }
    Ok(())
}

/// The raw counts of a frame in the bytes of their message.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RawView<'a> {
    /// The contact threshold in force, in HELLO's unit of force.
    pub threshold: f32,
    record_len: usize,
    records: &'a [u8],
    joints: &'a [u8],
}

/// One taxel as it stands in a RAW message.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RawTaxel {
    /// Raw counts of x, y, z; zeros where the value is missing.
    pub counts: [u16; 3],
    /// Why the taxel is not used, as the bits of [`taxel_hand::Faults`]; 0 where it is.
    pub faults: u16,
    /// Magnitude above baseline, in HELLO's unit of force.
    pub force: f32,
    /// Age of the value, microseconds; `u32::MAX` where missing or older than that.
    pub age_us: u32,
    /// Whether the value belongs to this frame.
    pub freshness: Freshness,
    /// The status byte the board sent with it.
    pub status: u8,
    /// Whether the taxel is in contact.
    pub contact: bool,
    /// Whether the value was repaired in this frame.
    pub repaired: bool,
}

impl RawTaxel {
    /// The reasons why the taxel is not used; bits of later versions are left out.
    pub fn faults(&self) -> impl Iterator<Item = Fault> + use<> {
        let bits = self.faults;
        Fault::ALL
            .into_iter()
            .filter(move |fault| bits & *fault as u16 != 0)
    }
}

impl<'a> RawView<'a> {
    /// Reads the payload of a RAW message.
    pub fn decode(payload: &'a [u8]) -> Result<Self, DecodeError> {
        let len = payload.len();
        if len < FIXED_LEN {
            return Err(DecodeError::SectionShort {
                len,
                needed: FIXED_LEN,
            });
        }
        let (record_len, fixed_len) = (u16_at(payload, 4), u16_at(payload, 6));
        for (field, value, min) in [
            ("fixed_len", fixed_len, FIXED_LEN as u16),
            ("record_len", record_len, RECORD_LEN as u16),
        ] {
            if value < min || !value.is_multiple_of(4) {
                return Err(DecodeError::FixedLen { field, value, min });
            }
        }
        let (record_len, fixed_len) = (usize::from(record_len), usize::from(fixed_len));
        let records = (u32_at(payload, 0) as usize).saturating_mul(record_len);
        let joints = 4 * usize::from(u16_at(payload, 12));
        let needed = fixed_len.saturating_add(records).saturating_add(joints);
        if needed > len {
            return Err(DecodeError::SectionShort { len, needed });
        }
        Ok(Self {
            threshold: f32_at(payload, 8),
            record_len,
            records: &payload[fixed_len..fixed_len + records],
            joints: &payload[fixed_len + records..needed],
        })
    }

    /// The taxels, in the order of their numbers.
    pub fn taxels(&self) -> impl ExactSizeIterator<Item = RawTaxel> + use<'a> {
        self.records.chunks_exact(self.record_len).map(|bytes| RawTaxel {
            counts: [u16_at(bytes, 0), u16_at(bytes, 2), u16_at(bytes, 4)],
            faults: u16_at(bytes, 6),
            force: f32_at(bytes, 8),
            age_us: u32_at(bytes, 12),
            freshness: match bytes[16] {
                1 => Freshness::Stale,
                2 => Freshness::Fresh,
                _ => Freshness::Missing,
            },
            status: bytes[17],
            contact: bytes[18] & MARK_CONTACT != 0,
            repaired: bytes[18] & MARK_REPAIRED != 0,
        })
    }

    /// The joint angles, radians; not a number where an angle could not be read.
    pub fn joints(&self) -> impl ExactSizeIterator<Item = f32> + use<'a> {
        self.joints.chunks_exact(4).map(|bytes| f32_at(bytes, 0))
    }
}
