//! One classic CAN frame, as it is on the bus.

use std::fmt;

/// Bit of a raw identifier that marks an extended (29 bit) frame, as in `linux/can.h`.
pub const EXTENDED_FLAG: u32 = 0x8000_0000;
/// Bit of a raw identifier that marks a remote transmission request, as in `linux/can.h`.
pub(crate) const REMOTE_FLAG: u32 = 0x4000_0000;
/// Bit of a raw identifier that marks an error frame made by the local controller, as in `linux/can.h`.
pub(crate) const ERROR_FLAG: u32 = 0x2000_0000;

/// An identifier as candump writes it: 3 digits, or 8 where it has [`EXTENDED_FLAG`].
pub fn id_text(id: u32) -> String {
    match id & EXTENDED_FLAG {
        0 => format!("{id:03X}"),
        flag => format!("{:08X}", id & !flag),
    }
}

/// A classic CAN frame: 0 to 8 data bytes under an 11 or 29 bit identifier.
///
/// It is 16 bytes, `Copy`, and holds the identifier with the flag bits of `linux/can.h`, so that every
/// frame a source can deliver (data, remote, error) fits in it without loss.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct CanFrame {
    raw_id: u32,
    len: u8,
    data: [u8; 8],
}

/// Why bytes do not make a CAN frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum FrameError {
    /// The identifier needs more bits than its format has.
    #[error("CAN id {id:#X} is over the largest {bits} bit id")]
    IdTooLarge {
        /// The identifier given.
        id: u32,
        /// 11 or 29.
        bits: u8,
    },
    /// More data than a classic frame carries.
    #[error("a classic CAN frame carries at most 8 data bytes, not {len}")]
    TooLong {
        /// The number of bytes given.
        len: usize,
    },
}

impl CanFrame {
    /// A data frame with a standard (11 bit) identifier.
    pub const fn standard(id: u16, data: &[u8]) -> Result<Self, FrameError> {
        if id > 0x7FF {
            return Err(FrameError::IdTooLarge {
                id: id as u32,
                bits: 11,
            });
        }
        Self::from_raw(id as u32, data)
    }

    /// A data frame with an extended (29 bit) identifier.
    pub const fn extended(id: u32, data: &[u8]) -> Result<Self, FrameError> {
        if id > 0x1FFF_FFFF {
            return Err(FrameError::IdTooLarge { id, bits: 29 });
        }
        Self::from_raw(id | EXTENDED_FLAG, data)
    }

    /// A remote transmission request for `len` bytes (0 to 8) under a standard or extended identifier.
    pub const fn remote(id: u32, extended: bool, len: u8) -> Result<Self, FrameError> {
        if len > 8 {
            return Err(FrameError::TooLong { len: len as usize });
        }
        let frame = if extended {
            Self::extended(id, &[])
        } else if id > 0x7FF {
            Err(FrameError::IdTooLarge { id, bits: 11 })
        } else {
            Self::standard(id as u16, &[])
        };
        match frame {
            Ok(f) => Ok(Self {
                raw_id: f.raw_id | REMOTE_FLAG,
                len,
                data: [0; 8],
            }),
            Err(e) => Err(e),
        }
    }

    /// An error frame as the kernel makes it: `class` is the error class mask of `linux/can/error.h`.
    pub const fn error(class: u32, data: [u8; 8]) -> Self {
        Self {
            raw_id: (class & 0x1FFF_FFFF) | ERROR_FLAG,
            len: 8,
            data,
        }
    }

    /// A frame from an identifier with its flag bits already set, as SocketCAN delivers it.
    pub const fn from_raw(raw_id: u32, data: &[u8]) -> Result<Self, FrameError> {
        if data.len() > 8 {
            return Err(FrameError::TooLong { len: data.len() });
        }
        let mut bytes = [0; 8];
        let mut i = 0;
        while i < data.len() {
            bytes[i] = data[i];
            i += 1;
        }
        Ok(Self {
            raw_id,
            len: data.len() as u8,
            data: bytes,
        })
    }

    /// The identifier with the flag bits of `linux/can.h`.
    #[inline]
    pub const fn raw_id(&self) -> u32 {
        self.raw_id
    }

    /// The identifier without flag bits: 11 or 29 bits, or the error class of an error frame.
    #[inline]
    pub const fn id(&self) -> u32 {
        self.raw_id & 0x1FFF_FFFF
    }

    /// The 11 bit identifier of a standard data frame; `None` for extended, remote and error frames.
    #[inline]
    pub const fn standard_id(&self) -> Option<u16> {
        if self.raw_id & (EXTENDED_FLAG | REMOTE_FLAG | ERROR_FLAG) == 0 {
            Some((self.raw_id & 0x7FF) as u16)
        } else {
            None
        }
    }

    /// Whether the identifier has 29 bits.
    #[inline]
    pub const fn is_extended(&self) -> bool {
        self.raw_id & EXTENDED_FLAG != 0
    }

    /// Whether this is a remote transmission request.
    #[inline]
    pub const fn is_remote(&self) -> bool {
        self.raw_id & REMOTE_FLAG != 0
    }

    /// Whether the local controller made this frame to report an error.
    #[inline]
    pub const fn is_error(&self) -> bool {
        self.raw_id & ERROR_FLAG != 0
    }

    /// The data length code, 0 to 8. A remote frame has a length and no data.
    #[inline]
    pub const fn dlc(&self) -> u8 {
        self.len
    }

    /// The data bytes; empty for a remote frame.
    #[inline]
    pub fn data(&self) -> &[u8] {
        if self.is_remote() {
            &[]
        } else {
            &self.data[..self.len as usize]
        }
    }
}

/// Most bytes of a frame in candump's notation.
const LONGEST_TEXT: usize = 8 + 1 + 16;

/// Each byte in hexadecimal digits.
const HEX: [[u8; 2]; 256] = {
    let mut hex = [[0; 2]; 256];
    let mut byte = 0;
    while byte < 256 {
        hex[byte] = [b"0123456789ABCDEF"[byte >> 4], b"0123456789ABCDEF"[byte & 0xF]];
        byte += 1;
    }
    hex
};

/// A frame in candump's notation, without the machinery of formatting: a recording writes millions.
pub(crate) struct FrameText {
    bytes: [u8; LONGEST_TEXT],
    len: usize,
}

impl FrameText {
    pub(crate) fn of(frame: &CanFrame) -> Self {
        let mut text = Self {
            bytes: [0; LONGEST_TEXT],
            len: 0,
        };
        if frame.is_error() {
            text.hex(frame.raw_id & (ERROR_FLAG | 0x1FFF_FFFF), 8);
        } else if frame.is_extended() {
            text.hex(frame.id(), 8);
        } else if frame.id() > 0xFFF {
            // None that a bus has: its flags are wrong.
            text.hex(frame.id(), 8 - frame.id().leading_zeros() / 4);
        } else {
            text.hex(frame.id(), 3);
        }
        text.push(b'#');
        if frame.is_remote() {
            text.push(b'R');
            match frame.len {
                0 => {}
                len => text.push(b'0' + len % 10),
            }
        }
        for byte in frame.data() {
            let digits = HEX[usize::from(*byte)];
            text.bytes[text.len..text.len + 2].copy_from_slice(&digits);
            text.len += 2;
        }
        text
    }

    fn push(&mut self, byte: u8) {
        self.bytes[self.len] = byte;
        self.len += 1;
    }

    fn hex(&mut self, number: u32, digits: u32) {
        for digit in (0..digits).rev() {
            self.push(b"0123456789ABCDEF"[(number >> (4 * digit) & 0xF) as usize]);
        }
    }

    pub(crate) fn as_bytes(&self) -> &[u8] {
        &self.bytes[..self.len]
    }
}

/// The frame in candump's notation, such as `20B#0700` or `00000123#R4`.
impl fmt::Display for CanFrame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        FrameText::of(self)
            .as_bytes()
            .iter()
            .try_for_each(|byte| fmt::Write::write_char(f, char::from(*byte)))
    }
}

impl fmt::Debug for CanFrame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "CanFrame({self})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prints_as_candump_does() {
        let cases = [
            (CanFrame::standard(0x20B, &[0x07, 0x00]).unwrap(), "20B#0700"),
            (CanFrame::standard(0x001, &[]).unwrap(), "001#"),
            (CanFrame::extended(0x123, &[0xAB]).unwrap(), "00000123#AB"),
            (CanFrame::remote(0x123, false, 4).unwrap(), "123#R4"),
            (CanFrame::error(0x40, [0; 8]), "20000040#0000000000000000"),
        ];
        for (frame, text) in cases {
            assert_eq!(frame.to_string(), text);
        }
        assert_eq!(id_text(0x001), "001");
        assert_eq!(id_text(0x123 | EXTENDED_FLAG), "00000123");
    }

    #[test]
    fn refuses_what_does_not_fit() {
        assert_eq!(
            CanFrame::standard(0x800, &[]),
            Err(FrameError::IdTooLarge { id: 0x800, bits: 11 })
        );
        assert_eq!(
            CanFrame::extended(0x2000_0000, &[]),
            Err(FrameError::IdTooLarge {
                id: 0x2000_0000,
                bits: 29
            })
        );
        assert_eq!(
            CanFrame::standard(1, &[0; 9]),
            Err(FrameError::TooLong { len: 9 })
        );
    }

    #[test]
    fn only_a_standard_data_frame_has_a_standard_id() {
        assert_eq!(CanFrame::standard(0x7FF, &[]).unwrap().standard_id(), Some(0x7FF));
        assert_eq!(CanFrame::extended(0x7FF, &[]).unwrap().standard_id(), None);
        assert_eq!(CanFrame::remote(0x7FF, false, 0).unwrap().standard_id(), None);
        assert_eq!(CanFrame::error(0x40, [0; 8]).standard_id(), None);
    }
}
