//! Arrays of numpy's `.npy`.

use super::npy_header::Header;
use crate::error::{RecordError, SOMETHING, show_shape};
use crate::meaning::Meaning;
use crate::table::{ColumnNames, ReadOptions, Table};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

/// Headers longer than numpy itself accepts are not read.
const MAX_HEADER_BYTES: usize = 10_000;
/// Numbers of an array that are read: they take a gigabyte, and are an hour and a half of 240 three-axis taxels at 30 Hz.
pub(crate) const MAX_NUMBERS: usize = 1 << 27;
/// Bytes of an array that are read at once.
const CHUNK_BYTES: usize = 64 * 1024;

/// Reads an npy file.
pub(crate) fn read(path: &Path, options: &ReadOptions) -> Result<Table, RecordError> {
    let file = File::open(path).map_err(RecordError::io(path))?;
    let array = Array::open(path.display().to_string(), BufReader::new(file))?;
    array.check_numbers()?;
    Meaning::of(&array.at, array.shape(), None, options)?;
    let (at, shape) = (array.at.clone(), array.shape().to_vec());
    Ok(Table {
        is_half: array.is_half(),
        at,
        shape,
        values: array.numbers()?,
        times_ns: None,
        joints: None,
        columns: None,
        unitless_time: None,
        names: ColumnNames::default(),
        void: None,
        without_value: None,
    })
}

/// An npy array whose header has been read, and its numbers not yet.
pub(crate) struct Array<R> {
    /// File, and name where there is one, for messages.
    pub(crate) at: String,
    header: Header,
    element: Option<Element>,
    data: R,
}

/// How a number stands in the file.
#[derive(Debug, Clone, Copy)]
struct Element {
    kind: Kind,
    bytes: usize,
    big_endian: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Bool,
    Unsigned,
    Signed,
    Float,
}

/// What mends times that begin before 0.
pub(crate) const FROM_0: &str = "; times begin at 0 or later: t - t.min()";
/// Units of numpy's `datetime64` and `timedelta64` that are read as times, as they end their notation, and their nanoseconds.
const DATETIME_UNITS: [(&str, u64); 4] = [
    ("s]", 1_000_000_000),
    ("ms]", 1_000_000),
    ("us]", 1000),
    ("ns]", 1),
];
/// What numpy keeps for a time that is none, `NaT`.
const NOT_A_TIME: u64 = 1 << 63;

/// numpy's notation of the numbers that are read, without the byte order, and their names.
const ELEMENTS: [(&str, &str, Kind); 12] = [
    ("b1", "bool", Kind::Bool),
    ("u1", "u8", Kind::Unsigned),
    ("i1", "i8", Kind::Signed),
    ("u2", "u16", Kind::Unsigned),
    ("i2", "i16", Kind::Signed),
    ("u4", "u32", Kind::Unsigned),
    ("i4", "i32", Kind::Signed),
    ("u8", "u64", Kind::Unsigned),
    ("i8", "i64", Kind::Signed),
    ("f2", "f16", Kind::Float),
    ("f4", "f32", Kind::Float),
    ("f8", "f64", Kind::Float),
];

impl Element {
    fn of(header: &Header) -> Option<Self> {
        let descriptor = header.descriptor.as_deref()?;
        let notation = descriptor.get(1..)?;
        let (_, _, kind) = ELEMENTS.iter().find(|(n, ..)| *n == notation)?;
        Self::of_bytes(descriptor, *kind, usize::from(notation.as_bytes()[1] - b'0'))
    }

    /// So many bytes in the order that a descriptor begins with.
    fn of_bytes(descriptor: &str, kind: Kind, bytes: usize) -> Option<Self> {
        Some(Self {
            kind,
            bytes,
            big_endian: match descriptor.as_bytes()[0] {
                b'<' | b'|' => false,
                b'>' => true,
                b'=' => cfg!(target_endian = "big"),
                _ => return None,
            },
        })
    }

    fn bits(self, bytes: &[u8]) -> u64 {
        let mut little = [0; 8];
        little[..self.bytes].copy_from_slice(bytes);
        if self.big_endian {
            little[..self.bytes].reverse();
        }
        u64::from_le_bytes(little)
    }

    /// The number, as the nearest that a double holds.
    fn number(self, bytes: &[u8]) -> f64 {
        let bits = self.bits(bytes);
        match (self.kind, self.bytes) {
            (Kind::Bool, _) => f64::from(bits != 0),
            (Kind::Unsigned, _) => bits as f64,
            (Kind::Signed, n) => {
                let above = 64 - 8 * n as u32;
                ((bits << above) as i64 >> above) as f64
            }
            (Kind::Float, 2) => half(bits as u16),
            (Kind::Float, 4) => f64::from(f32::from_bits(bits as u32)),
            (Kind::Float, _) => f64::from_bits(bits),
        }
    }
}

/// A number of IEEE 754's 16 bits.
fn half(bits: u16) -> f64 {
    let (exponent, fraction) = (i32::from(bits >> 10 & 0x1F), f64::from(bits & 0x3FF));
    let magnitude = match exponent {
        0 => fraction * 2f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1024.0 + fraction) * 2f64.powi(exponent - 25),
    };
    if bits >> 15 == 0 { magnitude } else { -magnitude }
}

/// Numbers whose first index moves fastest, in the order in which the last does.
fn by_last_index(shape: &[usize], values: &[f64]) -> Vec<f64> {
    let value = |mut n: usize| {
        let (mut at, mut stride) = (0, values.len());
        for size in shape.iter().rev() {
            stride /= size;
            at += n % size * stride;
            n /= size;
        }
        values[at]
    };
    (0..values.len()).map(value).collect()
}

impl<R: Read> Array<R> {
    /// Reads the header; no more of the file is touched.
    pub(crate) fn open(at: String, mut data: R) -> Result<Self, RecordError> {
        let bad = |reason: &str| RecordError::unreadable(&at, format!("not a readable npy array: {reason}"));
        let mut bytes = Vec::new();
        let mut read = |bytes: &mut Vec<u8>, more: usize| {
            let took = data.by_ref().take(more as u64).read_to_end(bytes);
            took.map_err(|e| bad(&e.to_string()))
        };
        read(&mut bytes, 12)?;
        if !bytes.starts_with(b"\x93NUMPY") {
            return Err(bad("it does not begin with the npy signature"));
        }
        let (begins, length) = match bytes.get(6..12) {
            Some(&[1, _, a, b, ..]) => (10, u32::from(u16::from_le_bytes([a, b]))),
            Some(&[2 | 3, _, a, b, c, d]) => (12, u32::from_le_bytes([a, b, c, d])),
            _ => return Err(bad("it is of no known npy version")),
        };
        let length = length as usize;
        let no_recording = || bad("its header is not that of a plain array of numbers");
        if !(2..=MAX_HEADER_BYTES).contains(&length) {
            return Err(no_recording());
        }
        read(&mut bytes, begins + length - 12)?;
        let text = bytes.get(begins..begins + length);
        let header = text.and_then(|text| Header::parse(std::str::from_utf8(text).ok()?));
        let header = header.ok_or_else(no_recording)?;
        Ok(Self {
            element: Element::of(&header),
            at,
            header,
            data,
        })
    }

    pub(crate) fn shape(&self) -> &[usize] {
        &self.header.shape
    }

    /// The type of its elements, in numpy's notation where it is none that is read.
    pub(crate) fn dtype(&self) -> String {
        let descriptor = self.header.descriptor.as_deref();
        let Some(notation) = descriptor.map(|d| d.get(1..).unwrap_or(d)) else {
            return "structured".into();
        };
        let known = ELEMENTS.iter().find(|(n, ..)| *n == notation);
        // numpy counts bytes, the names here bits.
        let other = if notation == "f16" {
            "128-bit floats"
        } else {
            notation
        };
        known.map_or(other, |(_, name, _)| *name).to_owned()
    }

    /// Its shape and the type of its elements, as messages list them.
    pub(crate) fn description(&self) -> String {
        format!("{} {}", show_shape(self.shape()), self.dtype())
    }

    /// Whether its elements are integers.
    pub(crate) fn has_whole_numbers(&self) -> bool {
        let kind = self.element.map(|element| element.kind);
        matches!(kind, Some(Kind::Unsigned | Kind::Signed))
    }

    /// Whether its elements are floats of 16 bits.
    pub(crate) fn is_half(&self) -> bool {
        self.element
            .is_some_and(|element| (element.kind, element.bytes) == (Kind::Float, 2))
    }

    /// Whether its elements are numbers.
    pub(crate) fn has_numbers(&self) -> bool {
        self.element.is_some()
    }

    /// Refuses elements that are no numbers, whatever their shape.
    pub(super) fn check_numbers(&self) -> Result<(), RecordError> {
        self.of_numbers().map(drop)
    }

    /// What its elements are, which are numbers.
    fn of_numbers(&self) -> Result<Element, RecordError> {
        self.element.ok_or_else(|| {
            let names: Vec<&str> = ELEMENTS.iter().map(|(_, name, _)| *name).collect();
            let made = match self.dtype().as_str() {
                "O" => "; where they are frames of one shape, numpy.stack([numpy.asarray(v, float) for v in a]) makes such of them",
                "structured" => "; name a field of them, a[\"NAME\"]",
                _ => "",
            };
            let reason = format!("elements are {}; a recording has {}{made}", self.dtype(), names.join(", "));
            RecordError::unreadable(&self.at, reason)
        })
    }

    /// All numbers, row by row whatever their order in the file.
    pub(crate) fn numbers(mut self) -> Result<Vec<f64>, RecordError> {
        let element = self.of_numbers()?;
        let mut values = Vec::new();
        self.read(element, &mut values, |bytes| element.number(bytes))?;
        Ok(match self.header.fortran_order {
            false => values,
            true => by_last_index(self.shape(), &values),
        })
    }

    /// numpy's times of a unit of their own, and the nanoseconds of one.
    fn datetimes(&self) -> Option<(Element, u64)> {
        let descriptor = self.header.descriptor.as_deref()?;
        let notation = descriptor.get(1..)?;
        let of_unit = notation
            .strip_prefix("M8[")
            .or_else(|| notation.strip_prefix("m8["))?;
        let (_, unit_ns) = DATETIME_UNITS.iter().find(|(unit, _)| of_unit == *unit)?;
        Some((Element::of_bytes(descriptor, Kind::Signed, 8)?, *unit_ns))
    }

    /// Whether its elements are times of a unit of their own.
    pub(crate) fn has_datetimes(&self) -> bool {
        self.datetimes().is_some()
    }

    /// Its whole numbers of 64 bits, which a double need not hold.
    fn long(&self) -> Option<Element> {
        self.element
            .filter(|e| e.bytes == 8 && matches!(e.kind, Kind::Unsigned | Kind::Signed))
    }

    /// Whether its elements are whole numbers of 64 bits.
    pub(crate) fn is_long(&self) -> bool {
        self.long().is_some()
    }

    /// Its numbers, of so many nanoseconds each, or its times of a unit of their own, in nanoseconds.
    pub(crate) fn times(mut self, unit_ns: u64) -> Result<Vec<u64>, RecordError> {
        let whole = self.long();
        let of_numbers = whole.map(|element| (element, unit_ns));
        let Some((element, unit_ns)) = of_numbers.or_else(|| self.datetimes()) else {
            let dtype = self.dtype();
            let made = match dtype.get(..2) {
                Some("M8") => "t.astype(\"datetime64[ns]\").astype(\"int64\")",
                Some("m8") => "t.astype(\"timedelta64[ns]\").astype(\"int64\")",
                _ if self.element.is_some() => "numpy.round(t).astype(\"int64\")",
                _ => "t.astype(\"int64\")",
            };
            let reason = format!(
                "times are one u64 or i64 per frame, nanoseconds, not {} of {dtype}: {made}",
                show_shape(self.shape())
            );
            return Err(RecordError::unreadable(&self.at, reason));
        };
        let mut times = Vec::new();
        self.read(element, &mut times, |bytes| element.bits(bytes))?;
        for (frame, time) in times.iter_mut().enumerate() {
            let is_negative = element.kind == Kind::Signed && *time > i64::MAX as u64;
            let reason = match time.checked_mul(unit_ns).filter(|_| !is_negative) {
                Some(time_ns) => {
                    *time = time_ns;
                    continue;
                }
                None if !is_negative => format!("time {time} is beyond what nanoseconds of 64 bits hold"),
                None if *time == NOT_A_TIME && whole.is_none() => format!("frame {frame} has no time (NaT)"),
                None => format!("time {} is negative{FROM_0}", *time as i64),
            };
            return Err(RecordError::unreadable(&self.at, reason));
        }
        Ok(times)
    }

    /// Reads exactly what the header promises. Memory is taken for no more than [`MAX_NUMBERS`].
    fn read<T>(
        &mut self,
        element: Element,
        values: &mut Vec<T>,
        value: impl Fn(&[u8]) -> T,
    ) -> Result<(), RecordError> {
        if self.shape().contains(&0) {
            return Err(RecordError::shape(&self.at, self.shape(), SOMETHING));
        }
        let numbers = self.shape().iter().try_fold(1usize, |all, &n| all.checked_mul(n));
        let Some(numbers) = numbers.filter(|n| *n <= MAX_NUMBERS) else {
            let reason = format!(
                "{} of {} are more than the {MAX_NUMBERS} numbers that are read; cut the array into pieces, or the \
                 file is damaged",
                show_shape(self.shape()),
                self.dtype()
            );
            return Err(RecordError::unreadable(&self.at, reason));
        };
        let io_error = |e: std::io::Error| RecordError::unreadable(&self.at, e.to_string());
        let promised = (numbers * element.bytes) as u64;
        let mut chunk = Vec::with_capacity(CHUNK_BYTES);
        let mut have = 0;
        while have < promised {
            chunk.clear();
            let most = (promised - have).min(CHUNK_BYTES as u64);
            let took = self
                .data
                .by_ref()
                .take(most)
                .read_to_end(&mut chunk)
                .map_err(io_error)?;
            have += took as u64;
            if took as u64 != most {
                return Err(self.does_not_fit(&format!("the {have} bytes of data")));
            }
            if values.is_empty() {
                values.reserve_exact(numbers);
            }
            values.extend(chunk.chunks_exact(element.bytes).map(&value));
        }
        chunk.clear();
        match self
            .data
            .by_ref()
            .take(1)
            .read_to_end(&mut chunk)
            .map_err(io_error)?
        {
            0 => Ok(()),
            _ => Err(self.does_not_fit("the data, which is longer")),
        }
    }

    fn does_not_fit(&self, data: &str) -> RecordError {
        let reason = format!(
            "not a readable npy array: shape {} of {} does not fit {data}; the file is damaged or was cut off",
            show_shape(self.shape()),
            self.dtype(),
        );
        RecordError::unreadable(&self.at, reason)
    }
}

#[cfg(test)]
mod tests;
