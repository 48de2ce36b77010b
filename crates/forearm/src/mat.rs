//! MATLAB's level 5 MAT-files ("MAT-File Format", The MathWorks): real matrices, read and written.

use flate2::read::ZlibDecoder;
use std::io::{self, Read};

/// A real matrix of a MAT-file.
#[derive(Debug, Clone, PartialEq)]
pub struct Matrix {
    /// The variable's name.
    pub name: String,
    /// How many rows it has.
    pub rows: usize,
    /// Its columns, one after another, `rows` numbers each.
    pub values: Vec<f64>,
}

/// Why bytes are no MAT-file with a matrix, and where.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("byte {offset}: {reason}")]
pub struct TornMat {
    /// The byte of the file; of what is wrong in a compressed element, where that begins.
    pub offset: usize,
    /// What is wrong, and what to do.
    pub reason: String,
}

impl TornMat {
    /// The same of what a compressed element unpacks to.
    fn within(self, element: &Element<'_>) -> Self {
        Self {
            offset: element.begins,
            ..self
        }
    }
}

/// Length of the header.
const HEADER: usize = 128;
/// Bytes to which the compressed element of a matrix that is read may unpack.
const MOST_UNPACKED: u64 = 16 << 20;
/// Bytes of a compressed element in which its kind, flags, dimensions and name are.
const HEAD: u64 = 4096;
/// Numbers of a matrix that is read, of which the file may have each in one byte, and memory has it in eight: a hundred
/// thousand rows of twenty.
const MOST_NUMBERS: usize = 2 << 20;
const INT8: u32 = 1;
const INT32: u32 = 5;
const UINT32: u32 = 6;
const DOUBLE: u32 = 9;
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;
/// How files begin that Octave saves where nothing is said of their format, as text and as numbers.
const OCTAVES_OWN: [&[u8]; 2] = [b"# Created by Octave", b"Octave-1-"];
/// The class of a matrix of doubles.
const DOUBLE_CLASS: u32 = 6;
/// Classes of matrices of numbers: double to uint64.
const NUMBERS: std::ops::RangeInclusive<u32> = 6..=15;

/// Reads the matrix called `name`, or the only one. What else the file holds is not looked at further than its name.
///
/// # Errors
/// Bytes of another kind or cut off; no such matrix; one that is complex, of more than two dimensions, of more than two
/// million numbers, or compressed and of more than 16 MB; a variable of this name that is no matrix of numbers.
pub fn read_mat(bytes: &[u8], name: &str) -> Result<Matrix, TornMat> {
    let whole = Bytes::open(bytes)?;
    let mut at = HEADER;
    let mut names = Vec::new();
    // What is read where there is no other, and the file may call it as it likes.
    let mut first = None;
    while at < bytes.len() {
        let element = whole.element(at)?;
        if let Some(head) = whole.head(&element)? {
            let is_number = NUMBERS.contains(&head.class);
            if head.name == name && !is_number {
                return torn(
                    element.begins,
                    format!("{name:?} is no matrix of numbers; save it as rows and columns"),
                );
            }
            if head.name == name {
                return whole.matrix(&element);
            }
            if is_number {
                first.get_or_insert(at);
                names.push(head.name);
            }
        }
        // Only what is compressed is not filled up to eight bytes.
        at = if element.kind == COMPRESSED {
            element.ends
        } else {
            element.next
        };
    }
    let torn = |reason| {
        Err(TornMat {
            offset: bytes.len(),
            reason,
        })
    };
    match first {
        Some(at) if names.len() == 1 => whole.matrix(&whole.element(at)?),
        None => torn(format!(
            "the file ends without a matrix of numbers; it should hold {name:?}"
        )),
        Some(_) => torn(format!(
            "the file has no {name:?} among its matrices {}",
            names.join(", ")
        )),
    }
}

/// Writes a matrix of doubles as a MAT-file, not compressed.
///
/// # Panics
/// If values are no whole columns, or the name is longer than MATLAB's 63 letters.
pub fn write_mat(matrix: &Matrix) -> Vec<u8> {
    let columns = matrix.values.len() / matrix.rows.max(1);
    assert!(
        columns * matrix.rows == matrix.values.len() && matrix.name.len() <= 63,
        "{}",
        matrix.name
    );
    let size = |n: usize| u32::try_from(n).expect("less than 4 GB").to_le_bytes();
    let mut body = Vec::new();
    let mut element = |kind: u32, data: &[u8]| {
        body.extend(kind.to_le_bytes());
        body.extend(size(data.len()));
        body.extend(data);
        body.resize(body.len().next_multiple_of(8), 0);
    };
    element(UINT32, &[DOUBLE_CLASS.to_le_bytes(), [0; 4]].concat());
    element(INT32, &[size(matrix.rows), size(columns)].concat());
    element(INT8, matrix.name.as_bytes());
    let values: Vec<u8> = matrix.values.iter().flat_map(|v| v.to_le_bytes()).collect();
    element(DOUBLE, &values);
    let mut file = b"MATLAB 5.0 MAT-file, written by taxel".to_vec();
    file.resize(HEADER - 12, b' ');
    file.extend([0; 8]);
    file.extend([0x00, 0x01, b'I', b'M']);
    file.extend(MATRIX.to_le_bytes());
    file.extend(size(body.len()));
    file.extend(body);
    file
}

/// A matrix of numbers, as it stands in the file.
struct Numbers<'a> {
    name: String,
    rows: usize,
    kind: u32,
    data: &'a [u8],
    begins: usize,
    big_endian: bool,
}

impl Numbers<'_> {
    fn widened(&self) -> Result<Matrix, TornMat> {
        let bytes = number_bytes(self.kind).unwrap_or(1);
        let count = self.data.len() / bytes;
        if count > MOST_NUMBERS {
            let reason = format!(
                "{:?} has {count} numbers, and {MOST_NUMBERS} are the most; this is no squeeze",
                self.name
            );
            return torn(self.begins, reason);
        }
        let numbers = self.data.chunks_exact(bytes);
        Ok(Matrix {
            name: self.name.clone(),
            rows: self.rows,
            values: numbers.map(|n| number(self.kind, n, self.big_endian)).collect(),
        })
    }
}

/// What a variable is, and what it is called.
struct Head {
    class: u32,
    name: String,
}

/// A run of elements.
#[derive(Clone, Copy)]
struct Bytes<'a> {
    bytes: &'a [u8],
    big_endian: bool,
}

struct Element<'a> {
    kind: u32,
    data: &'a [u8],
    /// Where its data begin and end, and where the next element begins.
    begins: usize,
    ends: usize,
    next: usize,
}

fn torn<T>(offset: usize, reason: impl Into<String>) -> Result<T, TornMat> {
    let reason = reason.into();
    Err(TornMat { offset, reason })
}

impl<'a> Bytes<'a> {
    /// The bytes of a file, whose header says their order.
    fn open(bytes: &'a [u8]) -> Result<Self, TornMat> {
        if OCTAVES_OWN.iter().any(|begin| bytes.starts_with(begin)) {
            return torn(
                0,
                "a file of Octave's own format; save it with `save -v7 FILE.mat datos`",
            );
        }
        let Some(order) = bytes.get(HEADER - 2..HEADER) else {
            return torn(
                bytes.len(),
                "cut off within the header of a MAT-file; get the file again",
            );
        };
        let big_endian = match order {
            b"IM" => false,
            b"MI" => true,
            // Level 4 has no header: its first number is the kind of the first matrix, 0 to 4052.
            _ if bytes[..4].contains(&0) => {
                return torn(
                    0,
                    "no level 5 MAT-file, and maybe one of level 4; save it in MATLAB or Octave with -v7, in scipy without \
                     format=\"4\"",
                );
            }
            _ => {
                return torn(
                    HEADER - 2,
                    "no level 5 MAT-file; save it in MATLAB or Octave with -v7 or -v6",
                );
            }
        };
        // MATLAB 7.3 writes HDF5 behind the same header.
        let version = [bytes[HEADER - 4], bytes[HEADER - 3]];
        if version[usize::from(!big_endian)] == 2 {
            return torn(
                HEADER - 4,
                "a MAT-file of version 7.3, which is HDF5; save it in MATLAB with -v7",
            );
        }
        Ok(Self { bytes, big_endian })
    }

    fn word(&self, at: usize) -> Result<u32, TornMat> {
        let Some(bytes) = at.checked_add(4).and_then(|end| self.bytes.get(at..end)) else {
            return torn(self.bytes.len(), "cut off within an element; get the file again");
        };
        let bytes = [bytes[0], bytes[1], bytes[2], bytes[3]];
        Ok(if self.big_endian {
            u32::from_be_bytes(bytes)
        } else {
            u32::from_le_bytes(bytes)
        })
    }

    fn element(&self, at: usize) -> Result<Element<'a>, TornMat> {
        let tag = self.word(at)?;
        // A small element has its size in the upper half of the tag and at most four bytes behind it.
        let small = (tag >> 16) as usize;
        let (kind, size, begins) = if small > 0 {
            (tag & 0xFFFF, small, at + 4)
        } else {
            (tag, self.word(at + 4)? as usize, at + 8)
        };
        if small > 4 {
            return torn(
                at,
                format!("a small element of {small} bytes; the file is damaged"),
            );
        }
        let ends = begins.checked_add(size).filter(|end| *end <= self.bytes.len());
        let Some(ends) = ends else {
            let rest = self.bytes.len().saturating_sub(begins);
            let reason = format!("an element of {size} bytes is cut off after {rest}; get the file again");
            return torn(at, reason);
        };
        let next = if small > 0 {
            at + 8
        } else {
            ends.next_multiple_of(8)
        };
        Ok(Element {
            kind,
            data: &self.bytes[begins..ends],
            begins,
            ends,
            next,
        })
    }

    /// What the variable of an element is; none where it is something else. Of a compressed one no more is unpacked than
    /// that takes.
    fn head(&self, element: &Element<'_>) -> Result<Option<Head>, TornMat> {
        let mut unpacked = Vec::new();
        let (run, begins) = match element.kind {
            COMPRESSED => {
                let mut packed = ZlibDecoder::new(element.data).take(HEAD);
                (packed.read_to_end(&mut unpacked)).or_else(|error| cannot_unpack(element.begins, &error))?;
                let run = Bytes {
                    bytes: &unpacked,
                    ..*self
                };
                if run.word(0).map_err(|torn| torn.within(element))? != MATRIX {
                    return Ok(None);
                }
                (run, 8)
            }
            MATRIX => (*self, element.begins),
            _ => return Ok(None),
        };
        let head = || {
            let flags = run.flags(begins)?;
            let dimensions = run.element(flags.next)?;
            let name = run.element(dimensions.next)?;
            Ok(Head {
                class: run.word(flags.begins)? & 0xFF,
                name: String::from_utf8_lossy(name.data).into_owned(),
            })
        };
        let told = |torn: TornMat| match element.kind {
            COMPRESSED => torn.within(element),
            _ => torn,
        };
        head().map(Some).map_err(told)
    }

    /// The matrix of numbers that an element is.
    fn matrix(&self, element: &Element<'_>) -> Result<Matrix, TornMat> {
        if element.kind != COMPRESSED {
            return self.numbers(element)?.widened();
        }
        let unpacked = unpack(element.data, element.begins)?;
        let inner = Bytes {
            bytes: &unpacked,
            ..*self
        };
        let matrix = || inner.numbers(&inner.element(0)?)?.widened();
        matrix().map_err(|torn| torn.within(element))
    }

    fn flags(&self, at: usize) -> Result<Element<'a>, TornMat> {
        let flags = self.element(at)?;
        if flags.kind != UINT32 || flags.data.len() != 8 {
            return torn(flags.begins, "a matrix without its flags; the file is damaged");
        }
        Ok(flags)
    }

    fn numbers(&self, whole: &Element<'_>) -> Result<Numbers<'a>, TornMat> {
        let inner = Self {
            bytes: &self.bytes[..whole.ends],
            ..*self
        };
        let flags = inner.flags(whole.begins)?;
        let flag_word = inner.word(flags.begins)?;
        let dimensions = inner.element(flags.next)?;
        if dimensions.kind != INT32 || dimensions.data.len() != 8 {
            return torn(
                dimensions.begins,
                "a matrix that is not of two dimensions; save it as rows and columns",
            );
        }
        let [rows, columns] = [0, 4].map(|n| inner.word(dimensions.begins + n));
        let (rows, columns) = (rows? as usize, columns? as usize);
        let name = inner.element(dimensions.next)?;
        let text = String::from_utf8_lossy(name.data).into_owned();
        if flag_word >> 8 & 8 != 0 {
            return torn(flags.begins, format!("{text:?} is complex; save its real part"));
        }
        let real = inner.element(name.next)?;
        let Some(bytes) = number_bytes(real.kind) else {
            return torn(
                real.begins,
                format!("{text:?} has elements of unknown kind {}", real.kind),
            );
        };
        if rows.checked_mul(columns).and_then(|n| n.checked_mul(bytes)) != Some(real.data.len()) {
            let reason = format!(
                "{text:?} is {rows} x {columns} and has {} bytes of numbers",
                real.data.len()
            );
            return torn(real.begins, reason);
        }
        Ok(Numbers {
            name: text,
            rows,
            kind: real.kind,
            data: real.data,
            begins: real.begins,
            big_endian: self.big_endian,
        })
    }
}

fn number(kind: u32, bytes: &[u8], big_endian: bool) -> f64 {
    let mut little = [0; 8];
    little[..bytes.len()].copy_from_slice(bytes);
    if big_endian {
        little[..bytes.len()].reverse();
    }
    let bits = u64::from_le_bytes(little);
    match kind {
        1 => f64::from(bits as i8),
        3 => f64::from(bits as i16),
        5 => f64::from(bits as i32),
        7 => f64::from(f32::from_bits(bits as u32)),
        9 => f64::from_bits(bits),
        12 => bits as i64 as f64,
        _ => bits as f64,
    }
}

/// Bytes of a number of a kind: signed and unsigned integers, single and double.
fn number_bytes(kind: u32) -> Option<usize> {
    Some(match kind {
        1 | 2 => 1,
        3 | 4 => 2,
        5..=7 => 4,
        9 | 12 | 13 => 8,
        _ => return None,
    })
}

fn cannot_unpack<T>(offset: usize, error: &io::Error) -> Result<T, TornMat> {
    torn(
        offset,
        format!("a compressed element cannot be unpacked: {error}"),
    )
}

fn unpack(data: &[u8], offset: usize) -> Result<Vec<u8>, TornMat> {
    let mut unpacked = Vec::new();
    let mut packed = ZlibDecoder::new(data).take(MOST_UNPACKED + 1);
    match packed.read_to_end(&mut unpacked) {
        Err(error) => cannot_unpack(offset, &error),
        Ok(n) if n as u64 > MOST_UNPACKED => torn(
            offset,
            "a compressed matrix of more than 16 MB; this is no squeeze",
        ),
        Ok(_) => Ok(unpacked),
    }
}

#[cfg(test)]
mod tests;
