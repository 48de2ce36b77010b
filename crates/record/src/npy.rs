//! Arrays of numpy's `.npy`.

use crate::error::{RecordError, SOMETHING, show_shape};
use crate::table::Table;
use ndarray::ArrayD;
use ndarray_npy::npy::header::Header;
use ndarray_npy::{ReadNpyExt, ReadableElement};
use std::path::Path;

/// Headers longer than numpy itself accepts are not read.
pub(crate) const MAX_HEADER_BYTES: usize = 10_000;
/// Brackets in a header; a recording's has three. The parser of the header recurses on them.
const MAX_HEADER_BRACKETS: usize = 16;

/// Reads an npy file.
pub(crate) fn read(path: &Path) -> Result<Table, RecordError> {
    let bytes = std::fs::read(path).map_err(RecordError::io(path))?;
    let at = path.display().to_string();
    let (shape, values) = numbers(&at, &bytes)?;
    Ok(Table {
        at,
        shape,
        values,
        times_ns: None,
        columns: None,
    })
}

fn unreadable(at: &str, reason: &str) -> RecordError {
    RecordError::unreadable(at, format!("not a readable npy array: {reason}"))
}

/// The header of an npy file, and the bytes after it.
pub(crate) fn header<'a>(at: &str, bytes: &'a [u8]) -> Result<(Header, &'a [u8]), RecordError> {
    let bad = |reason: &str| unreadable(at, reason);
    if !bytes.starts_with(b"\x93NUMPY") {
        return Err(bad("it does not begin with the npy signature"));
    }
    let length = match bytes.get(6..12) {
        Some(&[1, _, a, b, ..]) => u32::from(u16::from_le_bytes([a, b])),
        Some(&[2 | 3, _, a, b, c, d]) => u32::from_le_bytes([a, b, c, d]),
        _ => return Err(bad("it is of no known npy version")),
    };
    let brackets = |bytes: &[u8]| bytes.iter().filter(|b| b"([{".contains(b)).count();
    if length as usize > MAX_HEADER_BYTES
        || brackets(&bytes[..bytes.len().min(MAX_HEADER_BYTES).min(12 + length as usize)])
            > MAX_HEADER_BRACKETS
    {
        return Err(bad("its header is not that of a plain array of numbers"));
    }
    let mut rest = bytes;
    let header = Header::from_reader(&mut rest).map_err(|e| bad(&e.to_string()))?;
    Ok((header, rest))
}

/// The type of an array's elements, as a recording may have it, else in numpy's notation.
pub(crate) fn dtype(header: &Header) -> String {
    match header.type_descriptor.as_string() {
        Some(descriptor) => match &descriptor[1.min(descriptor.len())..] {
            "u1" => "u8".into(),
            "i1" => "i8".into(),
            "u2" => "u16".into(),
            "i2" => "i16".into(),
            "u4" => "u32".into(),
            "i4" => "i32".into(),
            "u8" => "u64".into(),
            "i8" => "i64".into(),
            "f4" => "f32".into(),
            "f8" => "f64".into(),
            _ => descriptor.clone(),
        },
        None => "structured".into(),
    }
}

/// Refuses a header that promises more or less data than follows it, before memory is taken for it.
fn check_size(at: &str, header: &Header, data: &[u8], element_bytes: usize) -> Result<(), RecordError> {
    let promised = header
        .shape
        .iter()
        .try_fold(element_bytes, |bytes, &n| bytes.checked_mul(n));
    // A zero dimension beside huge ones multiplies to nothing here and overflows elsewhere.
    if header.shape.contains(&0) {
        return Err(RecordError::shape(at, &header.shape, SOMETHING));
    }
    if promised == Some(data.len()) {
        return Ok(());
    }
    let reason = format!(
        "shape {} of {} does not fit the {} bytes of data; the file is damaged or was cut off",
        show_shape(&header.shape),
        dtype(header),
        data.len()
    );
    Err(unreadable(at, &reason))
}

/// The array's shape, and its elements in row-major order whatever their order in the file.
fn elements<T: ReadableElement>(
    at: &str,
    bytes: &[u8],
    to_f64: impl Fn(&T) -> f64,
) -> Result<(Vec<usize>, Vec<f64>), RecordError> {
    let array = ArrayD::<T>::read_npy(bytes).map_err(|e| unreadable(at, &e.to_string()))?;
    Ok((array.shape().to_vec(), array.iter().map(to_f64).collect()))
}

/// The shape and the values of an array of numbers.
pub(crate) fn numbers(at: &str, bytes: &[u8]) -> Result<(Vec<usize>, Vec<f64>), RecordError> {
    let (header, data) = header(at, bytes)?;
    let dtype = dtype(&header);
    let size = match dtype.as_str() {
        "u8" => 1,
        "u16" | "i16" => 2,
        "u32" | "i32" | "f32" => 4,
        "f64" => 8,
        _ => {
            let reason = format!("elements are {dtype}; a recording has u8, u16, i16, i32, u32, f32 or f64");
            return Err(RecordError::unreadable(at, reason));
        }
    };
    check_size(at, &header, data, size)?;
    match dtype.as_str() {
        "u8" => elements::<u8>(at, bytes, |v| f64::from(*v)),
        "u16" => elements::<u16>(at, bytes, |v| f64::from(*v)),
        "i16" => elements::<i16>(at, bytes, |v| f64::from(*v)),
        "u32" => elements::<u32>(at, bytes, |v| f64::from(*v)),
        "i32" => elements::<i32>(at, bytes, |v| f64::from(*v)),
        "f32" => elements::<f32>(at, bytes, |v| f64::from(*v)),
        _ => elements::<f64>(at, bytes, |v| *v),
    }
}

/// The values of an array of times, nanoseconds.
pub(crate) fn times(at: &str, bytes: &[u8]) -> Result<Vec<u64>, RecordError> {
    let (header, data) = header(at, bytes)?;
    let bad = |reason: String| RecordError::unreadable(at, reason);
    let dtype = dtype(&header);
    if header.shape.len() != 1 || !matches!(dtype.as_str(), "u64" | "i64") {
        let shape = show_shape(&header.shape);
        return Err(bad(format!(
            "times are one u64 or i64 per frame, nanoseconds, not {shape} of {dtype}"
        )));
    }
    check_size(at, &header, data, 8)?;
    let unreadable = |e: ndarray_npy::ReadNpyError| bad(e.to_string());
    if dtype == "u64" {
        return Ok(ArrayD::<u64>::read_npy(bytes)
            .map_err(unreadable)?
            .into_iter()
            .collect());
    }
    let signed = ArrayD::<i64>::read_npy(bytes).map_err(unreadable)?;
    let times = signed
        .iter()
        .map(|&t| u64::try_from(t).map_err(|_| bad(format!("time {t} is negative"))));
    times.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Columns, ReadOptions, Recording};
    use ndarray::{Array2, ShapeBuilder};
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
                "does not fit",
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
            let _ = numbers("fuzz", &bytes);
        }
    }
}
