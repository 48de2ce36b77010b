//! Arrays of numpy's `.npy`.

use crate::error::{RecordError, SOMETHING, show_shape};
use crate::meaning::Meaning;
use crate::table::{ReadOptions, Table};
use ndarray::{ArrayView, IxDyn, ShapeBuilder};
use ndarray_npy::npy::header::{Header, Layout};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

/// Headers longer than numpy itself accepts are not read.
pub(crate) const MAX_HEADER_BYTES: usize = 10_000;
/// Brackets in a header; a recording's has three. The parser of the header recurses on them.
const MAX_HEADER_BRACKETS: usize = 16;
/// Numbers of an array that are read: they take a gigabyte, and are an hour and a half of 240 three-axis taxels at 30 Hz.
pub(crate) const MAX_NUMBERS: usize = 1 << 27;
/// Bytes of an array that are read at once.
const CHUNK_BYTES: usize = 64 * 1024;

/// Reads an npy file.
pub(crate) fn read(path: &Path, options: &ReadOptions) -> Result<Table, RecordError> {
    let file = File::open(path).map_err(RecordError::io(path))?;
    let array = Array::open(path.display().to_string(), BufReader::new(file))?;
    Meaning::of(&array.at, array.shape(), None, options)?;
    let (at, shape) = (array.at.clone(), array.shape().to_vec());
    Ok(Table {
        at,
        shape,
        values: array.numbers()?,
        times_ns: None,
        joints: None,
        columns: None,
        void: None,
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
        let descriptor = header.type_descriptor.as_string()?;
        let notation = descriptor.get(1..)?;
        let (_, _, kind) = ELEMENTS.iter().find(|(n, ..)| *n == notation)?;
        Some(Self {
            kind: *kind,
            bytes: usize::from(notation.as_bytes()[1] - b'0'),
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
        let no_recording = "its header is not that of a plain array of numbers";
        if !(2..=MAX_HEADER_BYTES).contains(&length) {
            return Err(bad(no_recording));
        }
        read(&mut bytes, begins + length - 12)?;
        if bytes[begins..].iter().filter(|b| b"([{".contains(b)).count() > MAX_HEADER_BRACKETS {
            return Err(bad(no_recording));
        }
        let header = Header::from_reader(&mut bytes.as_slice()).map_err(|e| bad(&e.to_string()))?;
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
    fn dtype(&self) -> String {
        let descriptor = self.header.type_descriptor.as_string();
        let Some(notation) = descriptor.map(|d| d.get(1..).unwrap_or(d)) else {
            return "structured".into();
        };
        let known = ELEMENTS.iter().find(|(n, ..)| *n == notation);
        known.map_or(notation, |(_, name, _)| *name).to_owned()
    }

    /// Its shape and the type of its elements, as messages list them.
    pub(crate) fn description(&self) -> String {
        format!("{} {}", show_shape(self.shape()), self.dtype())
    }

    /// All numbers, row by row whatever their order in the file.
    pub(crate) fn numbers(mut self) -> Result<Vec<f64>, RecordError> {
        let Some(element) = self.element else {
            let names: Vec<&str> = ELEMENTS.iter().map(|(_, name, _)| *name).collect();
            let reason = format!(
                "elements are {}; a recording has {}",
                self.dtype(),
                names.join(", ")
            );
            return Err(RecordError::unreadable(&self.at, reason));
        };
        let mut values = Vec::new();
        self.read(element, &mut values, |bytes| element.number(bytes))?;
        match self.header.layout {
            Layout::Standard => Ok(values),
            Layout::Fortran => {
                let shape = IxDyn(self.shape()).f();
                let rows = ArrayView::from_shape(shape, &values);
                Ok(rows.expect("as many as the shape has").iter().copied().collect())
            }
        }
    }

    /// Its numbers as times, nanoseconds.
    pub(crate) fn times(mut self) -> Result<Vec<u64>, RecordError> {
        let whole = self
            .element
            .filter(|e| e.bytes == 8 && matches!(e.kind, Kind::Unsigned | Kind::Signed));
        let (1, Some(element)) = (self.shape().len(), whole) else {
            let reason = format!(
                "times are one u64 or i64 per frame, nanoseconds, not {} of {}",
                show_shape(self.shape()),
                self.dtype()
            );
            return Err(RecordError::unreadable(&self.at, reason));
        };
        let mut times = Vec::new();
        self.read(element, &mut times, |bytes| element.bits(bytes))?;
        let negative = |time: &&u64| element.kind == Kind::Signed && **time > i64::MAX as u64;
        match times.iter().find(negative) {
            Some(time) => Err(RecordError::unreadable(
                &self.at,
                format!("time {} is negative", *time as i64),
            )),
            None => Ok(times),
        }
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
mod tests {
    use super::*;
    use crate::{Columns, Recording};
    use ndarray::Array2;
    use ndarray_npy::{WritableElement, write_npy};
    use proptest::prelude::*;
    use tempfile::TempDir;

    fn open(path: &Path) -> Result<Recording, RecordError> {
        Recording::open(path, &ReadOptions::default())
    }

    fn reads_back<T: WritableElement + From<u8>>(dtype: &str) {
        let dir = TempDir::new().unwrap();
        let path = dir.path().join(format!("{dtype}.npy"));
        let array = Array2::from_shape_fn((3, 4), |(t, n)| T::from((t * 4 + n) as u8));
        write_npy(&path, &array).unwrap();
        let recording = open(&path).unwrap();
        assert_eq!(
            recording.magnitudes(2).unwrap(),
            [8.0, 9.0, 10.0, 11.0],
            "{dtype}"
        );
    }

    #[test]
    fn every_element_type_reads_as_its_value() {
        reads_back::<u8>("u8");
        reads_back::<u16>("u16");
        reads_back::<i16>("i16");
        reads_back::<i32>("i32");
        reads_back::<u32>("u32");
        reads_back::<f32>("f32");
        reads_back::<f64>("f64");
        reads_back::<u64>("u64");
        reads_back::<i64>("i64");
    }

    /// An npy file.
    fn file(descriptor: &str, shape: &str, data: &[u8]) -> Vec<u8> {
        let text = format!("{{'descr': '{descriptor}', 'fortran_order': False, 'shape': {shape}}}");
        [
            b"\x93NUMPY\x01\x00\x76\x00",
            format!("{text:117}\n").as_bytes(),
            data,
        ]
        .concat()
    }

    fn numbers(bytes: &[u8]) -> Result<Vec<f64>, RecordError> {
        Array::open("test".into(), bytes)?.numbers()
    }

    #[test]
    fn numbers_of_every_width_sign_and_byte_order_are_their_values() {
        let cases: [(&str, &[u8], f64); 22] = [
            ("|b1", &[1], 1.0),
            ("|b1", &[0], 0.0),
            ("|i1", &[0xFE], -2.0),
            ("|u1", &[0xFE], 254.0),
            (">i2", &[0xFF, 0xFE], -2.0),
            ("<i4", &[0xFE, 0xFF, 0xFF, 0xFF], -2.0),
            ("<i8", &[0xFE, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF], -2.0),
            (">i8", &[0, 0, 0, 0, 0, 0, 1, 2], 258.0),
            ("<u8", &[0xFF; 8], 18_446_744_073_709_551_615.0),
            (">u8", &[0, 0, 0, 0, 0, 0, 1, 2], 258.0),
            (
                ">f8",
                &[0x40, 0x09, 0x21, 0xFB, 0x54, 0x44, 0x2D, 0x18],
                std::f64::consts::PI,
            ),
            ("<f4", &[0, 0, 0xC0, 0xBF], -1.5),
            // IEEE 754-2008, binary16: one, the largest, the least normal and subnormal numbers, a third.
            ("<f2", &[0x00, 0x3C], 1.0),
            ("<f2", &[0x00, 0xC0], -2.0),
            ("<f2", &[0xFF, 0x7B], 65_504.0),
            ("<f2", &[0x00, 0x04], 6.103_515_625e-5),
            ("<f2", &[0x01, 0x00], 5.960_464_477_539_063e-8),
            ("<f2", &[0xFF, 0x03], 6.097_555_160_522_461e-5),
            (">f2", &[0x35, 0x55], 0.333_251_953_125),
            ("<f2", &[0x00, 0x80], -0.0),
            ("<f2", &[0x00, 0x7C], f64::INFINITY),
            ("<f2", &[0x00, 0xFC], f64::NEG_INFINITY),
        ];
        for (descriptor, data, value) in cases {
            assert_eq!(
                numbers(&file(descriptor, "(1, 1)", data)).unwrap(),
                [value],
                "{descriptor} {data:?}"
            );
        }
        assert!(numbers(&file("<f2", "(1, 1)", &[0x01, 0x7C])).unwrap()[0].is_nan());
        for descriptor in ["<c16", "<U3", "|O", "|V8", "<m8[ns]", "<f16", ""] {
            let message = numbers(&file(descriptor, "(1, 1)", &[0; 16]))
                .unwrap_err()
                .to_string();
            assert!(
                message.contains("a recording has bool, u8, i8, u16"),
                "{descriptor}: {message}"
            );
        }
    }

    #[test]
    fn an_array_that_is_too_large_is_refused_before_it_is_read() {
        struct Untouched;
        impl Read for Untouched {
            fn read(&mut self, _: &mut [u8]) -> std::io::Result<usize> {
                panic!("read past the header");
            }
        }
        for (shape, wanted) in [
            ("(2, 300000, 300000)", "numbers that are read"),
            (
                "(200000000, 1)",
                "200000000 x 1 of u8 are more than the 134217728 numbers",
            ),
        ] {
            let header = file("|u1", shape, &[]);
            let array = Array::open("test".into(), header.as_slice().chain(Untouched)).unwrap();
            let message = array.numbers().unwrap_err().to_string();
            assert!(message.contains(wanted), "{message}");
        }
        let dir = TempDir::new().unwrap();
        let path = dir.path().join("wide.npy");
        std::fs::write(&path, file("|u1", "(300, 1000, 1000)", &[])).unwrap();
        let message = open(&path).unwrap_err().to_string();
        assert!(
            message.contains("300 x 1000 x 1000") && message.contains("65535 taxels"),
            "{message}"
        );
    }

    #[test]
    fn a_fortran_ordered_array_is_read_by_its_indices() {
        let dir = TempDir::new().unwrap();
        let path = dir.path().join("fortran.npy");
        let mut array = Array2::<u16>::zeros((3, 6).f());
        array
            .indexed_iter_mut()
            .for_each(|((t, n), v)| *v = (t * 6 + n) as u16);
        write_npy(&path, &array).unwrap();
        assert!(
            std::fs::read(&path)
                .unwrap()
                .windows(21)
                .any(|w| w == b"'fortran_order': True")
        );
        let options = ReadOptions {
            columns: Some(Columns::XyzInterleaved),
            ..Default::default()
        };
        let recording = Recording::open(&path, &options).unwrap();
        assert_eq!(recording.counts(1).unwrap(), [[6, 7, 8], [9, 10, 11]]);
    }

    #[test]
    fn big_endian_arrays_are_read() {
        let dir = TempDir::new().unwrap();
        let path = dir.path().join("big.npy");
        let mut bytes = b"\x93NUMPY\x01\x00\x3c\x00".to_vec();
        bytes.extend(
            format!(
                "{:59}\n",
                "{'descr': '>u2', 'fortran_order': False, 'shape': (1, 2)}"
            )
            .bytes(),
        );
        bytes.extend([0x12, 0x34, 0x00, 0x01]);
        std::fs::write(&path, bytes).unwrap();
        assert_eq!(open(&path).unwrap().magnitudes(0).unwrap(), [0x1234 as f64, 1.0]);
    }

    #[test]
    fn damaged_files_are_refused_and_not_believed() {
        let header = |text: &str| {
            let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
            bytes.extend(format!("{text:117}\n").bytes());
            bytes
        };
        let cut_off = [
            header("{'descr': '<u2', 'fortran_order': False, 'shape': (9, 9)}"),
            vec![0; 20],
        ]
        .concat();
        let cases: [(&str, Vec<u8>, &str); 7] = [
            ("empty.npy", vec![], "signature"),
            ("text.npy", b"1,2,3".to_vec(), "signature"),
            ("cut.npy", cut_off, "cut off"),
            (
                "huge.npy",
                header("{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999, 99999999999)}"),
                "at most 65535 taxels",
            ),
            (
                "void.npy",
                header(
                    "{'descr': '<f8', 'fortran_order': False, 'shape': (0, 9999999999999, 9999999999999)}",
                ),
                "at least one frame",
            ),
            ("deep.npy", header(&"(".repeat(100)), "plain array"),
            ("not.npz", b"PK no".to_vec(), "npz"),
        ];
        let dir = TempDir::new().unwrap();
        for (name, bytes, wanted) in cases {
            let path = dir.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            let message = open(&path).unwrap_err().to_string();
            assert!(
                message.contains(wanted) && message.contains(name),
                "{name}: {message}"
            );
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]
        #[test]
        fn any_bytes_after_the_signature_give_a_recording_or_an_error(tail in proptest::collection::vec(any::<u8>(), 0..200)) {
            let bytes = [b"\x93NUMPY\x01\x00".to_vec(), tail].concat();
            let _ = numbers(&bytes);
        }
    }
}
