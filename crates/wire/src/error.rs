//! Why bytes are not a message, or values cannot become one.

use crate::format::{HEADER_LEN, MAJOR, MAX_MESSAGE};

/// Why bytes are not a message this reader can use. The checks are made in the order of the variants.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum DecodeError {
    /// Fewer bytes than a header; on a stream, wait for more.
    #[error("{len} bytes are no message: a header has {HEADER_LEN}")]
    ShortHeader {
        /// Bytes there are.
        len: usize,
    },
    /// The first four bytes are not `TCT1`.
    #[error("not a taxeld message: it starts with {found:#010x} instead of `TCT1`; check the socket path")]
    BadMagic {
        /// The first four bytes, as a little-endian number.
        found: u32,
    },
    /// The sender speaks another major version.
    #[error(
        "the sender speaks version {found} of the format and this reader version {MAJOR}; update the older"
    )]
    MajorVersion {
        /// Major version of the message.
        found: u8,
    },
    /// The header claims to be shorter than this version's.
    #[error("header_len {header_len} is below {HEADER_LEN}")]
    HeaderLen {
        /// The header's own length.
        header_len: u16,
    },
    /// Longer than any message may be.
    #[error(
        "header_len {header_len} + payload_len {payload_len} is above the {MAX_MESSAGE} bytes of a message"
    )]
    TooLong {
        /// The header's own length.
        header_len: u16,
        /// Length of the payload.
        payload_len: u32,
    },
    /// Fewer bytes than the header announces; on a stream, wait for more.
    #[error("{len} bytes of a message of {expected}: enlarge the receive buffer, or wait for the rest")]
    Truncated {
        /// Bytes there are.
        len: usize,
        /// Bytes the message has.
        expected: usize,
    },
    /// A packet with bytes behind its message.
    #[error("{extra} bytes follow a message of {expected} bytes in the same packet")]
    Trailing {
        /// Bytes of the message.
        expected: usize,
        /// Bytes behind it.
        extra: usize,
    },
    /// The fixed part or a record claims to be shorter than this version's, or not a multiple of four.
    #[error("the payload's {field} is {value}; at least {min} and a multiple of 4 expected")]
    FixedLen {
        /// Name of the field.
        field: &'static str,
        /// Its value.
        value: u16,
        /// Smallest value.
        min: u16,
    },
    /// The payload is too short for the sections it announces.
    #[error("the payload has {len} bytes and its sections need {needed}")]
    SectionShort {
        /// Bytes of the payload.
        len: usize,
        /// Bytes the sections need.
        needed: usize,
    },
    /// A force that is negative, infinite or not a number.
    #[error("{section} {index} has a force that is not a finite number from 0 up")]
    BadForce {
        /// `level` or `actuator`.
        section: &'static str,
        /// Its place in the section.
        index: usize,
    },
    /// An actuator outside the image, or with a level outside the codebook.
    #[error("actuator {index} (x {x}, y {y}, level {level}) lies outside the image or the codebook")]
    BadActuator {
        /// Its place in the section.
        index: usize,
        /// Column.
        x: u16,
        /// Row.
        y: u16,
        /// Force level.
        level: u16,
    },
}

impl DecodeError {
    /// Whether the bytes may be the start of a good message that has not wholly arrived.
    pub fn needs_more(&self) -> bool {
        matches!(self, Self::ShortHeader { .. } | Self::Truncated { .. })
    }

    /// The error's name, the same in all three readers.
    pub fn name(&self) -> &'static str {
        match self {
            Self::ShortHeader { .. } => "short_header",
            Self::BadMagic { .. } => "bad_magic",
            Self::MajorVersion { .. } => "major_version",
            Self::HeaderLen { .. } => "header_len",
            Self::TooLong { .. } => "too_long",
            Self::Truncated { .. } => "truncated",
            Self::Trailing { .. } => "trailing",
            Self::FixedLen { .. } => "fixed_len",
            Self::SectionShort { .. } => "section_short",
            Self::BadForce { .. } => "bad_force",
            Self::BadActuator { .. } => "bad_actuator",
        }
    }
}

/// Why values cannot become a message. Whatever encodes also decodes.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EncodeError {
    /// The parts of the frame or image do not belong together.
    #[error("{section} has {len} entries where {expected} are expected")]
    Length {
        /// Name of the part.
        section: &'static str,
        /// Its length.
        len: usize,
        /// The length the other parts call for.
        expected: usize,
    },
    /// More entries than the message can count.
    #[error("{section} has {len} entries; a message holds at most {max}")]
    TooMany {
        /// Name of the part.
        section: &'static str,
        /// Its length.
        len: usize,
        /// The most there may be.
        max: usize,
    },
    /// A force that is negative, or not finite as a 32-bit float.
    #[error("{section} {index} has force {force}, which is not a finite 32-bit float from 0 up")]
    Force {
        /// `level` or `actuator`.
        section: &'static str,
        /// Its place in the section.
        index: usize,
        /// The force.
        force: f64,
    },
    /// An actuator outside the image, or with a level outside the codebook.
    #[error("actuator {index} (x {x}, y {y}, level {level}) lies outside the image or the codebook")]
    Actuator {
        /// Its place in the section.
        index: usize,
        /// Column.
        x: u16,
        /// Row.
        y: u16,
        /// Force level.
        level: u16,
    },
    /// The message would be longer than a Unix socket carries.
    #[error("a message of {len} bytes is above the {MAX_MESSAGE} a message may have; use a smaller image")]
    TooLong {
        /// Bytes of the whole message.
        len: usize,
    },
}
