//! The payload of a RAW message: every taxel as the board sent it, and what was made of it.

use crate::error::{DecodeError, EncodeError};
use crate::fields::{f32_at, u16_at, u32_at};
use crate::format::{HEADER_LEN, MAX_MESSAGE};
use taxel_hand::{Fault, ForceFrame, Freshness, TactileFrame};

/// Fixed part of version 1.0, and the least there may be.
const FIXED_LEN_1_0: usize = 16;
/// Fixed part with the bits of the sections.
const FIXED_LEN: usize = 20;
const RECORD_LEN: usize = 20;
const BASELINE_LEN: usize = 12;
const MARK_CONTACT: u8 = 1 << 0;
const MARK_REPAIRED: u8 = 1 << 1;
const HALF_A_TURN: f64 = 32_768.0;
/// Counts and baselines are within a few turns of each other; what is farther away than this is no baseline.
const FARTHEST: f64 = 16_777_216.0;

// What comes behind the joint angles, in this order.
const JOINT_AGES: u32 = 1 << 0;
const JOINT_VELOCITIES: u32 = 1 << 1;
const JOINT_CURRENTS: u32 = 1 << 2;
const BASELINES: u32 = 1 << 3;

/// The most bytes that the payload of N taxels and J joints has: with every section that fits into a message.
///
/// The baselines are left out where a message with everything would be longer than [`MAX_MESSAGE`],
/// from about 12,700 taxels on; the joints' sections where they alone would make it so.
pub fn raw_payload_len(taxels: usize, joints: usize) -> usize {
    payload_len(taxels, joints, sections_that_fit(taxels, joints))
}

fn payload_len(taxels: usize, joints: usize, sections: u32) -> usize {
    let of_joints = 1 + (sections & !BASELINES).count_ones() as usize;
    let baselines = if sections & BASELINES != 0 {
        BASELINE_LEN
    } else {
        0
    };
    FIXED_LEN + (RECORD_LEN + baselines) * taxels + 4 * joints * of_joints
}

fn sections_that_fit(taxels: usize, joints: usize) -> u32 {
    let of_joints = JOINT_AGES | JOINT_VELOCITIES | JOINT_CURRENTS;
    [of_joints | BASELINES, of_joints]
        .into_iter()
        .find(|sections| HEADER_LEN + payload_len(taxels, joints, *sections) <= MAX_MESSAGE)
        .unwrap_or(0)
}

/// Writes a frame's raw counts and what conditioning made of them into `out`, replacing what was there.
///
/// `baseline` is the value at rest of each taxel, counts x, y, z, on whatever turn of 65536 it is;
/// not a number where unknown. While the frame is calibrating, none is sent as known. The joints'
/// ages, velocities and currents are sent where the frame has any.
///
/// Once `out` has grown to [`raw_payload_len`] it allocates no more. Forces go as they are, not a number
/// included; a frame whose parts differ in length is refused and leaves `out` empty.
pub fn encode_raw_payload(
    frame: &TactileFrame,
    force: &ForceFrame,
    baseline: Option<&[[f32; 3]]>,
    out: &mut Vec<u8>,
) -> Result<(), EncodeError> {
    out.clear();
    let sections = check(frame, force, baseline)?;
    let (taxels, joints) = (frame.counts.len(), frame.joints.len());
    let sections = sections & sections_that_fit(taxels, joints);
    let len = payload_len(taxels, joints, sections);
    if HEADER_LEN + len > MAX_MESSAGE {
        return Err(EncodeError::TooLong {
            len: HEADER_LEN + len,
        });
    }
    // At once for every section there may be, also those that are known only later.
    out.reserve(raw_payload_len(taxels, joints));
    out.extend_from_slice(&(taxels as u32).to_le_bytes());
    out.extend_from_slice(&(RECORD_LEN as u16).to_le_bytes());
    out.extend_from_slice(&(FIXED_LEN as u16).to_le_bytes());
    out.extend_from_slice(&(force.threshold as f32).to_le_bytes());
    out.extend_from_slice(&(joints as u16).to_le_bytes());
    out.extend_from_slice(&[0; 2]);
    out.extend_from_slice(&sections.to_le_bytes());
    for taxel in 0..taxels {
        for counts in frame.counts[taxel] {
            out.extend_from_slice(&counts.to_le_bytes());
        }
        out.extend_from_slice(&force.faults[taxel].bits().to_le_bytes());
        out.extend_from_slice(&(force.force[taxel] as f32).to_le_bytes());
        out.extend_from_slice(&age_us(frame.age_ns[taxel]).to_le_bytes());
        let freshness = match frame.freshness[taxel] {
            Freshness::Missing => 0,
            Freshness::Stale => 1,
            Freshness::Fresh => 2,
        };
        let contact = if force.contact[taxel] { MARK_CONTACT } else { 0 };
        let repaired = if force.repaired[taxel] { MARK_REPAIRED } else { 0 };
        out.extend_from_slice(&[freshness, frame.status[taxel], contact | repaired, 0]);
    }
    put_floats(&frame.joints, out);
    if sections & JOINT_AGES != 0 {
        for age_ns in &frame.joint_age_ns {
            out.extend_from_slice(&age_us(*age_ns).to_le_bytes());
        }
    }
    if sections & JOINT_VELOCITIES != 0 {
        put_floats(&frame.joint_velocity_rad_s, out);
    }
    if sections & JOINT_CURRENTS != 0 {
        put_floats(&frame.joint_current_a, out);
    }
    if sections & BASELINES != 0 {
        for baseline in baseline.into_iter().flatten() {
            let known = if force.calibrating {
                &[f32::NAN; 3]
            } else {
                baseline
            };
            put_floats(known, out);
        }
    }
    Ok(())
}

/// The sections that are known, of a frame whose parts have the lengths they should.
fn check(
    frame: &TactileFrame,
    force: &ForceFrame,
    baseline: Option<&[[f32; 3]]>,
) -> Result<u32, EncodeError> {
    let (taxels, joints) = (frame.counts.len(), frame.joints.len());
    let optional = [
        (JOINT_AGES, "joint_age_ns", frame.joint_age_ns.len(), joints),
        (
            JOINT_VELOCITIES,
            "joint_velocity_rad_s",
            frame.joint_velocity_rad_s.len(),
            joints,
        ),
        (
            JOINT_CURRENTS,
            "joint_current_a",
            frame.joint_current_a.len(),
            joints,
        ),
        (BASELINES, "baseline", baseline.map_or(0, <[_]>::len), taxels),
    ];
    let required = [
        ("status", frame.status.len()),
        ("age_ns", frame.age_ns.len()),
        ("freshness", frame.freshness.len()),
        ("force", force.force.len()),
        ("contact", force.contact.len()),
        ("faults", force.faults.len()),
        ("repaired", force.repaired.len()),
    ];
    if joints > usize::from(u16::MAX) {
        return Err(EncodeError::TooMany {
            section: "joints",
            len: joints,
            max: u16::MAX.into(),
        });
    }
    let given = optional.into_iter().filter(|(_, _, len, _)| *len > 0);
    let lengths = given
        .clone()
        .map(|(_, section, len, expected)| (section, len, expected));
    let required = required.into_iter().map(|(section, len)| (section, len, taxels));
    match required.chain(lengths).find(|(_, len, expected)| len != expected) {
        Some((section, len, expected)) => Err(EncodeError::Length {
            section,
            len,
            expected,
        }),
        None => Ok(given.fold(0, |sections, (section, ..)| sections | section)),
    }
}

fn age_us(age_ns: u64) -> u32 {
    u32::try_from(age_ns / 1000).unwrap_or(u32::MAX)
}

fn put_floats(values: &[f32], out: &mut Vec<u8>) {
    for value in values {
        out.extend_from_slice(&value.to_le_bytes());
    }
}

/// The raw counts of a frame in the bytes of their message.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RawView<'a> {
    /// The contact threshold in force, in HELLO's unit of force.
    pub threshold: f32,
    record_len: usize,
    records: &'a [u8],
    joints: &'a [u8],
    joint_ages: Option<&'a [u8]>,
    joint_velocities: Option<&'a [u8]>,
    joint_currents: Option<&'a [u8]>,
    baselines: Option<&'a [u8]>,
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

    /// How far the counts x, y, z are from this baseline, each from -32768 up to below 32768: the
    /// signed press. Counts wrap around modulo 65536, and so does this; only [`RawTaxel::force`]
    /// tells a press of more than half a turn. Not a number where the baseline is none.
    pub fn press(&self, baseline: [f32; 3]) -> [f32; 3] {
        std::array::from_fn(|axis| {
            let difference = f64::from(self.counts[axis]) - f64::from(baseline[axis]);
            if difference.abs() < FARTHEST {
                ((difference + HALF_A_TURN).rem_euclid(2.0 * HALF_A_TURN) - HALF_A_TURN) as f32
            } else {
                f32::NAN
            }
        })
    }
}

impl<'a> RawView<'a> {
    /// Reads the payload of a RAW message.
    pub fn decode(payload: &'a [u8]) -> Result<Self, DecodeError> {
        let len = payload.len();
        if len < FIXED_LEN_1_0 {
            return Err(DecodeError::SectionShort {
                len,
                needed: FIXED_LEN_1_0,
            });
        }
        let (record_len, fixed_len) = (u16_at(payload, 4), u16_at(payload, 6));
        for (field, value, min) in [
            ("fixed_len", fixed_len, FIXED_LEN_1_0 as u16),
            ("record_len", record_len, RECORD_LEN as u16),
        ] {
            if value < min || !value.is_multiple_of(4) {
                return Err(DecodeError::FixedLen { field, value, min });
            }
        }
        let (record_len, fixed_len) = (usize::from(record_len), usize::from(fixed_len));
        let taxels = u32_at(payload, 0) as usize;
        let joints = 4 * usize::from(u16_at(payload, 12));
        // The bits are in the payload once its end is.
        let known = if fixed_len >= FIXED_LEN && len >= FIXED_LEN {
            u32_at(payload, FIXED_LEN_1_0)
        } else {
            0
        };
        let has = |section: u32| known & section != 0;
        let records = taxels.saturating_mul(record_len);
        let baselines = if has(BASELINES) {
            taxels.saturating_mul(BASELINE_LEN)
        } else {
            0
        };
        let of_joints = 1 + (known & (JOINT_AGES | JOINT_VELOCITIES | JOINT_CURRENTS)).count_ones() as usize;
        let needed = (fixed_len + joints * of_joints)
            .saturating_add(records)
            .saturating_add(baselines);
        if needed > len {
            return Err(DecodeError::SectionShort { len, needed });
        }
        let mut rest = &payload[fixed_len..needed];
        let mut take = |bytes: usize| {
            let (section, behind) = rest.split_at(bytes);
            rest = behind;
            section
        };
        Ok(Self {
            threshold: f32_at(payload, 8),
            record_len,
            records: take(records),
            joints: take(joints),
            joint_ages: has(JOINT_AGES).then(|| take(joints)),
            joint_velocities: has(JOINT_VELOCITIES).then(|| take(joints)),
            joint_currents: has(JOINT_CURRENTS).then(|| take(joints)),
            baselines: has(BASELINES).then(|| take(baselines)),
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
        floats(self.joints)
    }

    /// Time from the frame's to the reading nearest to it of each joint, microseconds; `u32::MAX`
    /// where unknown. None where the message has no ages.
    pub fn joint_ages_us(&self) -> Option<impl ExactSizeIterator<Item = u32> + use<'a>> {
        Some(self.joint_ages?.chunks_exact(4).map(|bytes| u32_at(bytes, 0)))
    }

    /// The joints' angular velocities, radians per second; not a number where unknown. None where
    /// the message has none.
    pub fn joint_velocities_rad_s(&self) -> Option<impl ExactSizeIterator<Item = f32> + use<'a>> {
        self.joint_velocities.map(floats)
    }

    /// The present currents of the joints' servos, amperes; not a number where unknown. None where
    /// the message has none.
    pub fn joint_currents_a(&self) -> Option<impl ExactSizeIterator<Item = f32> + use<'a>> {
        self.joint_currents.map(floats)
    }

    /// The value at rest of each taxel, counts x, y, z, for [`RawTaxel::press`]; it may lie outside
    /// 0 to 65535. Not a number while calibrating, and where unknown. None where the message has
    /// none.
    pub fn baselines(&self) -> Option<impl ExactSizeIterator<Item = [f32; 3]> + use<'a>> {
        let of_taxel = |bytes: &[u8]| [f32_at(bytes, 0), f32_at(bytes, 4), f32_at(bytes, 8)];
        Some(self.baselines?.chunks_exact(BASELINE_LEN).map(of_taxel))
    }
}

fn floats(bytes: &[u8]) -> impl ExactSizeIterator<Item = f32> + use<'_> {
    bytes.chunks_exact(4).map(|bytes| f32_at(bytes, 0))
}
