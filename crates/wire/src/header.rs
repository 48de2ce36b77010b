//! The 40 bytes in front of every message.

use crate::error::DecodeError;
use crate::fields::{u16_at, u32_at, u64_at};
use crate::format::{HEADER_LEN, MAGIC, MAJOR, MAX_MESSAGE, MINOR};
use std::ops::{BitOr, BitOrAssign};
use taxel_hand::{Fault, ForceFrame, TactileFrame, TactileImage};

/// What a message is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Kind {
    /// Self-description of hand and display, JSON ([`crate::Hello`]).
    Hello,
    /// A tactile image ([`crate::ImageView`]).
    Image,
    /// Status report, JSON; only where subscribed.
    Status,
    /// Something to tell people, JSON ([`crate::Event`]).
    Event,
    /// Raw counts of every taxel ([`crate::RawView`]); only where subscribed.
    Raw,
    /// A completed touch and its category, JSON; from programs beside the daemon.
    Touch,
    /// An estimate of where on the forearm the hand holds, JSON; from programs beside the daemon.
    Estimate,
    /// From client to daemon: what to send, JSON ([`crate::Subscribe`]).
    Subscribe,
    /// A type of a later version; skipped.
    Other(u16),
}

impl Kind {
    /// The number of the type in the header.
    pub fn number(self) -> u16 {
        match self {
            Self::Hello => 1,
            Self::Image => 2,
            Self::Status => 3,
            Self::Event => 4,
            Self::Raw => 5,
            Self::Touch => 6,
            Self::Estimate => 7,
            Self::Subscribe => 16,
            Self::Other(number) => number,
        }
    }

    /// The type of a number; [`Kind::Other`] where this version knows none.
    pub fn from_number(number: u16) -> Self {
        match number {
            1 => Self::Hello,
            2 => Self::Image,
            3 => Self::Status,
            4 => Self::Event,
            5 => Self::Raw,
            6 => Self::Touch,
            7 => Self::Estimate,
            16 => Self::Subscribe,
            other => Self::Other(other),
        }
    }
}

/// What is remarkable about a message, as bits. Bits of later versions are kept and ignored.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Flags(pub u16);

impl Flags {
    /// No remark.
    pub const NONE: Self = Self(0);
    /// At least one taxel's value is missing or stale.
    pub const MISSING: Self = Self(1 << 0);
    /// At least one taxel is not used because of another fault.
    pub const FAULTY: Self = Self(1 << 1);
    /// The baseline is being measured; the image is empty.
    pub const CALIBRATING: Self = Self(1 << 2);
    /// At least one value was repaired in this frame: unwrapped, or a glitch held back.
    pub const REPAIRED: Self = Self(1 << 3);
    /// This reader was not given at least one message of this type before this one; set with
    /// [`Header::skipped`].
    pub const GAP: Self = Self(1 << 4);
    /// At least one usable taxel reads an end of its range: it may be pressed harder than it can tell.
    pub const SATURATED: Self = Self(1 << 5);
    /// The text goes on in the next message, which is of the same type.
    pub const MORE: Self = Self(1 << 15);

    /// The flags of these bits, unknown ones included.
    pub fn from_bits(bits: u16) -> Self {
        Self(bits)
    }

    /// The flags as bits, as they go over the wire.
    pub fn bits(self) -> u16 {
        self.0
    }

    /// Whether every bit of `other` is set.
    pub fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// These flags with the bits of `other` set or cleared.
    pub fn with(self, other: Self, set: bool) -> Self {
        if set {
            self | other
        } else {
            Self(self.0 & !other.0)
        }
    }

    /// The flags that an image itself tells: missing, faulty, calibrating, repaired, saturated.
    pub fn of_image(image: &TactileImage) -> Self {
        Self::NONE
            .with(Self::MISSING, image.missing > 0)
            .with(Self::FAULTY, image.faulty > 0)
            .with(Self::CALIBRATING, image.calibrating)
            .with(Self::REPAIRED, image.repaired)
            .with(Self::SATURATED, image.saturated)
    }

    /// The flags that a frame tells: those of [`Flags::of_image`].
    pub fn of_frame(force: &ForceFrame) -> Self {
        let mut flags = Self::NONE
            .with(Self::CALIBRATING, force.calibrating)
            .with(Self::REPAIRED, force.repaired.contains(&true))
            .with(Self::SATURATED, force.saturated.contains(&true));
        for faults in &force.faults {
            if faults.contains(Fault::Missing) {
                flags |= Self::MISSING;
            } else if !faults.is_empty() {
                flags |= Self::FAULTY;
            }
        }
        flags
    }
}

impl BitOr for Flags {
    type Output = Self;

    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl BitOrAssign for Flags {
    fn bitor_assign(&mut self, other: Self) {
        self.0 |= other.0;
    }
}

/// The header of a message. It is made once per tick and patched per reader; the payload is shared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Header {
    /// Major version of the sender.
    pub major: u8,
    /// Minor version of the sender.
    pub minor: u8,
    /// Length of the header, bytes; where the payload starts.
    pub header_len: u16,
    /// What the message is about.
    pub kind: Kind,
    /// What is remarkable about it.
    pub flags: Flags,
    /// Length of the payload, bytes.
    pub payload_len: u32,
    /// Number of the tactile frame; for text the number of the newest frame when it was written.
    pub seq: u64,
    /// Time of validity of that frame, nanoseconds on the clock that HELLO names.
    pub t_ns: u64,
    /// How many messages of this type the reader was not given since its last one or, in the first, since it asked for them.
    pub skipped: u32,
}

impl Header {
    /// A header of this version with everything else zero.
    ///
    /// `payload_len` is what an encoder of this crate produced, which is below [`MAX_MESSAGE`].
    pub fn new(kind: Kind, payload_len: usize) -> Self {
        Self {
            major: MAJOR,
            minor: MINOR,
            header_len: HEADER_LEN as u16,
            kind,
            flags: Flags::NONE,
            payload_len: payload_len as u32,
            seq: 0,
            t_ns: 0,
            skipped: 0,
        }
    }

    /// The header of an image whose payload has `payload_len` bytes.
    pub fn of_image(image: &TactileImage, payload_len: usize) -> Self {
        Self {
            flags: Flags::of_image(image),
            seq: image.seq,
            t_ns: image.t_ns,
            ..Self::new(Kind::Image, payload_len)
        }
    }

    /// The header of a frame's raw counts whose payload has `payload_len` bytes.
    pub fn of_frame(frame: &TactileFrame, force: &ForceFrame, payload_len: usize) -> Self {
        Self {
            flags: Flags::of_frame(force),
            seq: frame.seq,
            t_ns: frame.t_ns,
            ..Self::new(Kind::Raw, payload_len)
        }
    }

    /// The same header for a reader that was not given `skipped` messages before this one.
    pub fn with_skipped(self, skipped: u32) -> Self {
        Self {
            skipped,
            flags: self.flags.with(Flags::GAP, skipped > 0),
            ..self
        }
    }

    /// The 40 bytes; `header_len` is always this version's.
    pub fn to_bytes(&self) -> [u8; HEADER_LEN] {
        let mut bytes = [0; HEADER_LEN];
        bytes[0..4].copy_from_slice(&MAGIC);
        bytes[4] = self.major;
        bytes[5] = self.minor;
        bytes[6..8].copy_from_slice(&(HEADER_LEN as u16).to_le_bytes());
        bytes[8..10].copy_from_slice(&self.kind.number().to_le_bytes());
        bytes[10..12].copy_from_slice(&self.flags.0.to_le_bytes());
        bytes[12..16].copy_from_slice(&self.payload_len.to_le_bytes());
        bytes[16..24].copy_from_slice(&self.seq.to_le_bytes());
        bytes[24..32].copy_from_slice(&self.t_ns.to_le_bytes());
        bytes[32..36].copy_from_slice(&self.skipped.to_le_bytes());
        bytes
    }

    /// Reads the header at the start of `bytes`; the payload need not be there yet.
    pub fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        if bytes.len() < HEADER_LEN {
            return Err(DecodeError::ShortHeader { len: bytes.len() });
        }
        if bytes[0..4] != MAGIC {
            return Err(DecodeError::BadMagic {
                found: u32_at(bytes, 0),
            });
        }
        if bytes[4] != MAJOR {
            return Err(DecodeError::MajorVersion { found: bytes[4] });
        }
        let header_len = u16_at(bytes, 6);
        if usize::from(header_len) < HEADER_LEN {
            return Err(DecodeError::HeaderLen { header_len });
        }
        let payload_len = u32_at(bytes, 12);
        if u64::from(header_len) + u64::from(payload_len) > MAX_MESSAGE as u64 {
            return Err(DecodeError::TooLong {
                header_len,
                payload_len,
            });
        }
        Ok(Self {
            major: bytes[4],
            minor: bytes[5],
            header_len,
            kind: Kind::from_number(u16_at(bytes, 8)),
            flags: Flags(u16_at(bytes, 10)),
            payload_len,
            seq: u64_at(bytes, 16),
            t_ns: u64_at(bytes, 24),
            skipped: u32_at(bytes, 32),
        })
    }

    /// Length of the whole message in bytes.
    pub fn message_len(&self) -> usize {
        usize::from(self.header_len) + self.payload_len as usize
    }
}
