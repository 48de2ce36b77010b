//! The datagrams of python-can's `udp_multicast` interface (4.6.1): one CAN frame, one msgpack map.

use crate::frame::ERROR_FLAG;
use crate::frame::REMOTE_FLAG;
use crate::{CanFrame, EXTENDED_FLAG};
use rmp::Marker;
use rmp::encode::{self, ValueWriteError};
use std::io;

/// More than the largest datagram that [`encode`] writes: 162 bytes with eight of data.
pub(crate) const LARGEST: usize = 192;

/// Why a datagram is no classic CAN frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Undecodable {
    /// Not one complete msgpack map, or a key with a value of the wrong type.
    Malformed,
    /// The values contradict each other or are too large, by the rules of python-can's `Message`.
    Invalid,
    /// A CAN FD frame.
    CanFd,
}

/// Reads a datagram as python-can would: any subset of the keys in any order, with its defaults for
/// the others. Other than python-can, unknown keys are skipped. [`crate::UdpMulticast`] does this
/// with every datagram.
pub fn decode(bytes: &[u8]) -> Result<CanFrame, Undecodable> {
    let mut input = Input { bytes };
    let mut id = 0;
    let mut is_extended = true;
    let (mut is_remote, mut is_error, mut is_fd) = (false, false, false);
    let mut dlc = None;
    let mut data = Data {
        bytes: [0; 8],
        len: 0,
    };
    for _ in 0..input.map_len()? {
        match input.key()? {
            b"arbitration_id" => id = input.uint()?,
            b"is_extended_id" => is_extended = input.bool()?,
            b"is_remote_frame" => is_remote = input.bool()?,
            b"is_error_frame" => is_error = input.bool()?,
            b"dlc" => dlc = input.uint_or_nil()?,
            b"data" => data = input.data()?,
            b"is_fd" => is_fd = input.bool()?,
            _ => input.skip()?,
        }
    }
    if !input.bytes.is_empty() {
        return Err(Undecodable::Malformed);
    }
    if is_fd {
        return Err(Undecodable::CanFd);
    }
    let len = data.len as u64;
    let largest = if is_extended { 0x1FFF_FFFF } else { 0x7FF };
    let contradiction = is_remote && (is_error || len != 0);
    let dlc = dlc.unwrap_or(len);
    if contradiction || id > largest || dlc > 8 || (!is_remote && dlc != len) {
        return Err(Undecodable::Invalid);
    }
    let id = id as u32;
    if is_error {
        return Ok(CanFrame::error(id, data.bytes));
    }
    let frame = if is_remote {
        CanFrame::remote(id, is_extended, dlc as u8)
    } else {
        let flags = if is_extended { EXTENDED_FLAG } else { 0 };
        CanFrame::from_raw(id | flags, &data.bytes[..data.len])
    };
    frame.map_err(|_| Undecodable::Invalid)
}

struct Data {
    bytes: [u8; 8],
    len: usize,
}

/// What is left of a datagram.
struct Input<'a> {
    bytes: &'a [u8],
}

type Read<T> = Result<T, Undecodable>;

impl<'a> Input<'a> {
    fn take(&mut self, count: usize) -> Read<&'a [u8]> {
        let (taken, rest) = self.bytes.split_at_checked(count).ok_or(Undecodable::Malformed)?;
        self.bytes = rest;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Read<[u8; N]> {
        let (taken, rest) = self.bytes.split_first_chunk().ok_or(Undecodable::Malformed)?;
        self.bytes = rest;
        Ok(*taken)
    }

    fn marker(&mut self) -> Read<Marker> {
        Ok(Marker::from_u8(self.array::<1>()?[0]))
    }

    fn len8(&mut self) -> Read<usize> {
        Ok(usize::from(self.array::<1>()?[0]))
    }

    fn len16(&mut self) -> Read<usize> {
        Ok(usize::from(u16::from_be_bytes(self.array()?)))
    }

    fn len32(&mut self) -> Read<usize> {
        usize::try_from(u32::from_be_bytes(self.array()?)).map_err(|_| Undecodable::Malformed)
    }

    fn map_len(&mut self) -> Read<usize> {
        match self.marker()? {
            Marker::FixMap(len) => Ok(usize::from(len)),
            Marker::Map16 => self.len16(),
            Marker::Map32 => self.len32(),
            _ => Err(Undecodable::Malformed),
        }
    }

    /// A key; one that is no text cannot be one of ours, and is given as empty.
    fn key(&mut self) -> Read<&'a [u8]> {
        let before = self.bytes;
        let len = match self.marker()? {
            Marker::FixStr(len) => usize::from(len),
            Marker::Str8 => self.len8()?,
            Marker::Str16 => self.len16()?,
            Marker::Str32 => self.len32()?,
            _ => {
                self.bytes = before;
                self.skip()?;
                return Ok(b"");
            }
        };
        self.take(len)
    }

    fn bool(&mut self) -> Read<bool> {
        match self.marker()? {
            Marker::True => Ok(true),
            Marker::False => Ok(false),
            _ => Err(Undecodable::Malformed),
        }
    }

    fn uint(&mut self) -> Read<u64> {
        self.uint_or_nil()?.ok_or(Undecodable::Malformed)
    }

    fn uint_or_nil(&mut self) -> Read<Option<u64>> {
        let signed = match self.marker()? {
            Marker::Null => return Ok(None),
            Marker::FixPos(n) => return Ok(Some(n.into())),
            Marker::U8 => return Ok(Some(self.array::<1>()?[0].into())),
            Marker::U16 => return Ok(Some(u16::from_be_bytes(self.array()?).into())),
            Marker::U32 => return Ok(Some(u32::from_be_bytes(self.array()?).into())),
            Marker::U64 => return Ok(Some(u64::from_be_bytes(self.array()?))),
            Marker::I8 => i64::from(i8::from_be_bytes(self.array()?)),
            Marker::I16 => i64::from(i16::from_be_bytes(self.array()?)),
            Marker::I32 => i64::from(i32::from_be_bytes(self.array()?)),
            Marker::I64 => i64::from_be_bytes(self.array()?),
            Marker::FixNeg(n) => i64::from(n),
            _ => return Err(Undecodable::Malformed),
        };
        // Some encoders write every integer as a signed one.
        u64::try_from(signed).map(Some).map_err(|_| Undecodable::Invalid)
    }

    /// The data as bytes, or as python-can also takes it: a list of numbers up to 255, or nil for none.
    fn data(&mut self) -> Read<Data> {
        let mut data = Data {
            bytes: [0; 8],
            len: 0,
        };
        let binary_len = match self.marker()? {
            Marker::Null => return Ok(data),
            Marker::Bin8 => self.len8()?,
            Marker::Bin16 => self.len16()?,
            Marker::Bin32 => self.len32()?,
            Marker::FixArray(len) => return self.numbers(usize::from(len)),
            Marker::Array16 => {
                let len = self.len16()?;
                return self.numbers(len);
            }
            Marker::Array32 => {
                let len = self.len32()?;
                return self.numbers(len);
            }
            _ => return Err(Undecodable::Malformed),
        };
        let bytes = self.take(binary_len)?;
        // Over eight bytes the frame is CAN FD or nonsense; the length is kept to tell, the bytes
        // are not needed.
        data.len = bytes.len();
        let kept = bytes.len().min(8);
        data.bytes[..kept].copy_from_slice(&bytes[..kept]);
        Ok(data)
    }

    fn numbers(&mut self, len: usize) -> Read<Data> {
        let mut data = Data {
            bytes: [0; 8],
            len: 0,
        };
        for index in 0..len {
            let number = u8::try_from(self.uint()?).map_err(|_| Undecodable::Invalid)?;
            if let Some(byte) = data.bytes.get_mut(index) {
                *byte = number;
            }
        }
        data.len = len;
        Ok(data)
    }

    /// Skips one value with everything inside it. Each value takes at least one byte, so this ends
    /// with the input.
    fn skip(&mut self) -> Read<()> {
        let mut values: u64 = 1;
        while values > 0 {
            values -= 1;
            let bytes = match self.marker()? {
                Marker::FixPos(_) | Marker::FixNeg(_) | Marker::Null | Marker::True | Marker::False => 0,
                Marker::U8 | Marker::I8 => 1,
                Marker::U16 | Marker::I16 | Marker::FixExt1 => 2,
                Marker::FixExt2 => 3,
                Marker::U32 | Marker::I32 | Marker::F32 => 4,
                Marker::FixExt4 => 5,
                Marker::U64 | Marker::I64 | Marker::F64 => 8,
                Marker::FixExt8 => 9,
                Marker::FixExt16 => 17,
                Marker::FixStr(len) => usize::from(len),
                Marker::Str8 | Marker::Bin8 => self.len8()?,
                Marker::Str16 | Marker::Bin16 => self.len16()?,
                Marker::Str32 | Marker::Bin32 => self.len32()?,
                Marker::Ext8 => self.len8()? + 1,
                Marker::Ext16 => self.len16()? + 1,
                Marker::Ext32 => self.len32()?.saturating_add(1),
                Marker::FixArray(len) => self.inside(&mut values, len.into(), 1),
                Marker::Array16 => {
                    let len = self.len16()?;
                    self.inside(&mut values, len, 1)
                }
                Marker::Array32 => {
                    let len = self.len32()?;
                    self.inside(&mut values, len, 1)
                }
                Marker::FixMap(len) => self.inside(&mut values, len.into(), 2),
                Marker::Map16 => {
                    let len = self.len16()?;
                    self.inside(&mut values, len, 2)
                }
                Marker::Map32 => {
                    let len = self.len32()?;
                    self.inside(&mut values, len, 2)
                }
                Marker::Reserved => return Err(Undecodable::Malformed),
            };
            self.take(bytes)?;
        }
        Ok(())
    }

    /// Adds the values inside an array or a map to those to skip; no bytes beside them.
    fn inside(&self, values: &mut u64, len: usize, each: u64) -> usize {
        *values = values.saturating_add((len as u64).saturating_mul(each));
        0
    }
}

/// Writes a frame as python-can does: these eleven keys, in this order. Returns the used part of `buffer`.
///
/// `timestamp_s` is the wall clock in seconds; receivers replace it by their own.
pub(crate) fn encode<'b>(
    frame: &CanFrame,
    timestamp_s: f64,
    buffer: &'b mut [u8; LARGEST],
) -> io::Result<&'b [u8]> {
    let mut rest = &mut buffer[..];
    write(&mut rest, frame, timestamp_s).map_err(io::Error::from)?;
    let left = rest.len();
    Ok(&buffer[..LARGEST - left])
}

fn write(out: &mut &mut [u8], frame: &CanFrame, timestamp_s: f64) -> Result<(), ValueWriteError<io::Error>> {
    let is_error = frame.is_error();
    // python-can refuses a standard identifier of more than 11 bits, which an error class may have.
    let is_extended = frame.raw_id() & EXTENDED_FLAG != 0 || (is_error && frame.id() > 0x7FF);
    encode::write_map_len(out, 11)?;
    encode::write_str(out, "timestamp")?;
    encode::write_f64(out, timestamp_s)?;
    encode::write_str(out, "arbitration_id")?;
    encode::write_uint(out, frame.id().into())?;
    encode::write_str(out, "is_extended_id")?;
    write_bool(out, is_extended)?;
    encode::write_str(out, "is_remote_frame")?;
    write_bool(out, frame.raw_id() & (REMOTE_FLAG | ERROR_FLAG) == REMOTE_FLAG)?;
    encode::write_str(out, "is_error_frame")?;
    write_bool(out, is_error)?;
    encode::write_str(out, "channel")?;
    encode::write_nil(out).map_err(ValueWriteError::InvalidMarkerWrite)?;
    encode::write_str(out, "dlc")?;
    encode::write_uint(out, frame.dlc().into())?;
    encode::write_str(out, "data")?;
    encode::write_bin(out, frame.data())?;
    for key in ["is_fd", "bitrate_switch", "error_state_indicator"] {
        encode::write_str(out, key)?;
        write_bool(out, false)?;
    }
    Ok(())
}

fn write_bool(out: &mut &mut [u8], value: bool) -> Result<(), ValueWriteError<io::Error>> {
    encode::write_bool(out, value).map_err(ValueWriteError::InvalidMarkerWrite)
}

#[cfg(test)]
mod tests;
