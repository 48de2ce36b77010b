//! Arrays of numpy's `.npy` and `.npz`.

use crate::error::{ArrayList, RecordError, show_shape};
use crate::recording::Table;
use ndarray::ArrayD;
use ndarray_npy::npy::header::Header;
use ndarray_npy::{ReadNpyExt, ReadableElement};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

/// The array of an npz that gives the time of each frame, nanoseconds.
const TIMES: &str = "t_ns";

/// Headers longer than numpy itself accepts are not read.
const MAX_HEADER_BYTES: usize = 10_000;
/// Bytes of the widest elements there are in a recording.
const WIDEST: usize = 8;
/// Brackets in a header; a recording's has three. The parser of the header recurses on them.
const MAX_HEADER_BRACKETS: usize = 16;

pub(crate) fn read_npy(path: &Path) -> Result<Table, RecordError> {
    let bytes = std::fs::read(path).map_err(|source| RecordError::Io {
        path: path.into(),
        source,
    })?;
    let at = path.display().to_string();
    let (shape, values) = numbers(&at, &bytes)?;
    Ok(Table {
        at,
        shape,
        values,
        times_ns: None,
    })
}

pub(crate) fn read_npz(path: &Path, array: Option<&str>) -> Result<Table, RecordError> {
    let mut npz = Npz::open(path)?;
    let frames: Vec<&String> = npz.names.iter().filter(|n| *n != TIMES).collect();
    let name = match (array, frames.as_slice()) {
        (Some(name), _) if npz.names.iter().any(|n| n == name) => name.to_owned(),
        (Some(name), _) => {
            let arrays = npz.list();
            return Err(RecordError::NoSuchArray {
                path: path.into(),
                name: name.into(),
                arrays,
            });
        }
        (None, [only]) => (*only).clone(),
        (None, []) => {
            return Err(RecordError::BadNpz {
                path: path.into(),
                reason: format!(
                    "it holds no array{}",
                    if npz.names.is_empty() { "" } else { " but t_ns" }
                ),
            });
        }
        (None, _) => {
            let arrays = npz.list();
            return Err(RecordError::WhichArray {
                path: path.into(),
                arrays,
            });
        }
    };
    let at = format!("{} [{name}]", path.display());
    let (shape, values) = numbers(&at, &npz.member(&name)?)?;
    let times_ns = if name != TIMES && npz.names.iter().any(|n| n == TIMES) {
        let at = format!("{} [{TIMES}]", path.display());
        let times = times(&at, &npz.member(TIMES)?)?;
        // Times of another length belong to another array of the file.
        (shape.first() == Some(&times.len())).then_some(times)
    } else {
        None
    };
    Ok(Table {
        at,
        shape,
        values,
        times_ns,
    })
}

/// An npz file: a zip archive of npy members.
struct Npz<'a> {
    path: &'a Path,
    zip: zip::ZipArchive<BufReader<File>>,
    names: Vec<String>,
}

impl<'a> Npz<'a> {
    fn open(path: &'a Path) -> Result<Self, RecordError> {
        let file = File::open(path).map_err(|source| RecordError::Io {
            path: path.into(),
            source,
        })?;
        let zip = zip::ZipArchive::new(BufReader::new(file)).map_err(|e| RecordError::BadNpz {
            path: path.into(),
            reason: e.to_string(),
        })?;
        let names = zip
            .file_names()
            .map(|n| n.strip_suffix(".npy").unwrap_or(n).to_owned())
            .collect();
        Ok(Self { path, zip, names })
    }

    /// An array's bytes: no more of them than its header promises, and one to tell that there are more.
    fn member(&mut self, name: &str) -> Result<Vec<u8>, RecordError> {
        self.beginning(name, |bytes| {
            let promised = header(name, bytes).ok().and_then(|(header, data)| {
                let values = header
                    .shape
                    .iter()
                    .try_fold(WIDEST, |bytes, &n| bytes.checked_mul(n))?;
                values.checked_add(bytes.len() - data.len())
            });
            promised.unwrap_or(0)
        })
    }

    /// The first bytes of an array, enough for its header, and then up to so many as `most` tells from them.
    fn beginning(&mut self, name: &str, most: impl Fn(&[u8]) -> usize) -> Result<Vec<u8>, RecordError> {
        let bad = |reason: String| RecordError::BadNpz {
            path: self.path.into(),
            reason: format!("array {name}: {reason}"),
        };
        let with_suffix = format!("{name}.npy");
        let index = self
            .zip
            .index_for_name(&with_suffix)
            .or_else(|| self.zip.index_for_name(name));
        let mut bytes = Vec::new();
        let mut member = self
            .zip
            .by_index(index.ok_or_else(|| bad("gone".into()))?)
            .map_err(|e| bad(e.to_string()))?;
        let mut read = |bytes: &mut Vec<u8>, most: usize| {
            let more = most.saturating_sub(bytes.len());
            let took = member.by_ref().take(more as u64).read_to_end(bytes);
            took.map_err(|e| bad(e.to_string()))
        };
        read(&mut bytes, MAX_HEADER_BYTES + 12)?;
        let most = most(&bytes).saturating_add(1);
        read(&mut bytes, most)?;
        Ok(bytes)
    }

    fn list(&mut self) -> ArrayList {
        let describe = |npz: &mut Self, name: &str| {
            let bytes = npz.beginning(name, |_| 0).map_err(|e| e.to_string())?;
            let header = header(name, &bytes).map_err(|e| e.to_string())?.0;
            Ok(format!("{} {}", show_shape(&header.shape), dtype(&header)))
        };
        let names = self.names.clone();
        let describe = |name: String| {
            let what: Result<String, String> = describe(self, &name);
            (name, what.unwrap_or_else(|e| format!("unreadable: {e}")))
        };
        ArrayList(names.into_iter().map(describe).collect())
    }
}

/// The header of an npy file, and the bytes after it.
fn header<'a>(at: &str, bytes: &'a [u8]) -> Result<(Header, &'a [u8]), RecordError> {
    let bad = |reason: &str| RecordError::BadNpy {
        at: at.into(),
        reason: reason.into(),
    };
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

fn dtype(header: &Header) -> String {
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
        return Err(RecordError::Shape {
            at: at.into(),
            shape: header.shape.clone(),
            expected: "at least one frame of at least one taxel",
        });
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
    Err(RecordError::BadNpy {
        at: at.into(),
        reason,
    })
}

/// The array's shape, and its elements in row-major order whatever their order in the file.
fn elements<T: ReadableElement>(
    at: &str,
    bytes: &[u8],
    to_f64: impl Fn(&T) -> f64,
) -> Result<(Vec<usize>, Vec<f64>), RecordError> {
    let array = ArrayD::<T>::read_npy(bytes).map_err(|e| RecordError::BadNpy {
        at: at.into(),
        reason: e.to_string(),
    })?;
    Ok((array.shape().to_vec(), array.iter().map(to_f64).collect()))
}

fn numbers(at: &str, bytes: &[u8]) -> Result<(Vec<usize>, Vec<f64>), RecordError> {
    let (header, data) = header(at, bytes)?;
    let dtype = dtype(&header);
    let size = match dtype.as_str() {
        "u8" => 1,
        "u16" | "i16" => 2,
        "u32" | "i32" | "f32" => 4,
        "f64" => 8,
        _ => return Err(RecordError::Dtype { at: at.into(), dtype }),
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

fn times(at: &str, bytes: &[u8]) -> Result<Vec<u64>, RecordError> {
    let (header, data) = header(at, bytes)?;
    let bad = |reason: String| RecordError::BadTimes {
        at: at.into(),
        reason,
    };
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
    use ndarray::{Array1, Array2, Array3, ShapeBuilder};
    use ndarray_npy::{NpzWriter, WritableElement, write_npy};
    use proptest::prelude::*;
    use std::io::Write;
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

    fn npz(path: &Path) {
        let mut writer = NpzWriter::new_compressed(File::create(path).unwrap());
        writer
            .add_array("grasp", &Array3::<u16>::from_elem((2, 5, 3), 7))
            .unwrap();
        writer
            .add_array("slip", &Array2::<f32>::from_elem((4, 5), 0.5))
            .unwrap();
        writer.add_array("names", &Array1::<i64>::zeros(3)).unwrap();
        writer
            .add_array("t_ns", &Array1::<i64>::from(vec![10, 20, 30, 40]))
            .unwrap();
        writer.finish().unwrap();
    }

    #[test]
    fn an_npz_of_several_arrays_lists_them_until_one_is_named() {
        let dir = TempDir::new().unwrap();
        let path = dir.path().join("many.npz");
        npz(&path);
        let message = open(&path).unwrap_err().to_string();
        for part in ["--array", "grasp  2 x 5 x 3 u16", "slip   4 x 5 f32"] {
            assert!(message.contains(part), "{message}");
        }
        let named = |name: &str| {
            Recording::open(
                &path,
                &ReadOptions {
                    array: Some(name.into()),
                    ..Default::default()
                },
            )
        };
        assert!(named("grasp").unwrap().has_counts());
        let message = named("grip").unwrap_err().to_string();
        assert!(
            message.contains("\"grip\"") && message.contains("grasp"),
            "{message}"
        );
        let message = named("names").unwrap_err().to_string();
        assert!(
            message.contains("i64") && message.contains("[names]"),
            "{message}"
        );
    }

    #[test]
    fn times_of_an_npz_belong_to_the_array_of_their_length() {
        let dir = TempDir::new().unwrap();
        let path = dir.path().join("many.npz");
        npz(&path);
        let named = |name: &str| {
            Recording::open(
                &path,
                &ReadOptions {
                    array: Some(name.into()),
                    ..Default::default()
                },
            )
            .unwrap()
        };
        assert_eq!(named("slip").t_ns(3), 40);
        assert!(!named("grasp").has_times());
    }

    #[test]
    fn the_only_array_of_an_npz_needs_no_name() {
        let dir = TempDir::new().unwrap();
        let path = dir.path().join("one.npz");
        let mut writer = NpzWriter::new(File::create(&path).unwrap());
        writer
            .add_array("slip", &Array2::<f32>::from_elem((4, 5), 0.5))
            .unwrap();
        writer
            .add_array("t_ns", &Array1::<u64>::from(vec![10, 20, 30, 40]))
            .unwrap();
        writer.finish().unwrap();
        let recording = open(&path).unwrap();
        assert_eq!((recording.taxels(), recording.t_ns(1)), (5, 20));
        assert!(recording.name().ends_with("one.npz [slip]"));
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

    #[test]
    fn a_member_that_is_longer_than_its_header_says_is_not_unpacked_to_its_end() {
        let dir = TempDir::new().unwrap();
        let path = dir.path().join("bomb.npz");
        let mut zip = zip::ZipWriter::new(File::create(&path).unwrap());
        let deflated = zip::write::SimpleFileOptions::default();
        for (name, shape) in [("x", "(2, 3)"), ("y", "(4000, 5000)")] {
            zip.start_file(format!("{name}.npy"), deflated).unwrap();
            let text = format!("{{'descr': '|u1', 'fortran_order': False, 'shape': {shape}}}");
            let header = [
                b"\x93NUMPY\x01\x00\x76\x00".to_vec(),
                format!("{text:117}\n").into_bytes(),
            ]
            .concat();
            zip.write_all(&header).unwrap();
            zip.write_all(&vec![0; 20_000_000]).unwrap();
        }
        zip.finish().unwrap();
        let mut npz = Npz::open(&path).unwrap();
        assert!(npz.member("x").unwrap().len() <= MAX_HEADER_BYTES + 12 + 1);
        assert_eq!(npz.member("y").unwrap().len(), 20_000_128);
        assert!(npz.beginning("y", |_| 0).unwrap().len() <= MAX_HEADER_BYTES + 12);
        let array = |name: &str| ReadOptions {
            array: Some(name.into()),
            ..Default::default()
        };
        let message = Recording::open(&path, &array("x")).unwrap_err().to_string();
        assert!(message.contains("does not fit"), "{message}");
        assert!(
            npz.list().to_string().contains("y  4000 x 5000 u8"),
            "{}",
            npz.list()
        );
    }

    #[test]
    fn an_npz_without_frames_says_so() {
        let dir = TempDir::new().unwrap();
        let path = dir.path().join("none.npz");
        NpzWriter::new(File::create(&path).unwrap()).finish().unwrap();
        let message = open(&path).unwrap_err().to_string();
        assert!(message.contains("holds no array"), "{message}");
        let mut writer = NpzWriter::new(File::create(&path).unwrap());
        writer.add_array("t_ns", &Array1::<u64>::zeros(3)).unwrap();
        writer.finish().unwrap();
        let message = open(&path).unwrap_err().to_string();
        assert!(message.contains("no array but t_ns"), "{message}");
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
