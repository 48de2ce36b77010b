//! Arrays of numpy's `.npz`: a zip archive of npy files.

use crate::error::{RecordError, show_shape};
use crate::npy::{MAX_HEADER_BYTES, dtype, header, numbers, times};
use crate::table::Table;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

/// The array that gives the time of each frame, nanoseconds.
const TIMES: &str = "t_ns";
/// Bytes of the widest elements there are in a recording.
const WIDEST: usize = 8;

/// Reads the named array of an npz file, or its only one, and the times that belong to it.
pub(crate) fn read(path: &Path, array: Option<&str>) -> Result<Table, RecordError> {
    let mut npz = Npz::open(path)?;
    let frames: Vec<&String> = npz.names.iter().filter(|n| *n != TIMES).collect();
    let name = match (array, frames.as_slice()) {
        (Some(name), _) if npz.names.iter().any(|n| n == name) => name.to_owned(),
        (Some(name), _) => {
            let holds = format!("has no array {name:?}; it holds:\n{}", npz.list());
            return Err(RecordError::unfit(path.display(), holds));
        }
        (None, [only]) => (*only).clone(),
        (None, []) => {
            let but = if npz.names.is_empty() { "" } else { " but t_ns" };
            return Err(unreadable(path, &format!("it holds no array{but}")));
        }
        (None, _) => {
            let holds = format!(
                "holds several arrays; name one with --array NAME:\n{}",
                npz.list()
            );
            return Err(RecordError::unfit(path.display(), holds));
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
        columns: None,
    })
}

fn unreadable(path: &Path, reason: &str) -> RecordError {
    RecordError::unreadable(path.display(), format!("not a readable npz (zip) file: {reason}"))
}

/// An npz file: a zip archive of npy members.
struct Npz<'a> {
    path: &'a Path,
    zip: zip::ZipArchive<BufReader<File>>,
    names: Vec<String>,
}

impl<'a> Npz<'a> {
    fn open(path: &'a Path) -> Result<Self, RecordError> {
        let file = File::open(path).map_err(RecordError::io(path))?;
        let zip = zip::ZipArchive::new(BufReader::new(file)).map_err(|e| unreadable(path, &e.to_string()))?;
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
        let bad = |reason: String| unreadable(self.path, &format!("array {name}: {reason}"));
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

    /// The arrays, one a line, as error messages list them.
    fn list(&mut self) -> String {
        let names = self.names.clone();
        let width = names.iter().map(String::len).max().unwrap_or(0);
        let describe = |name: &String| {
            let what = self.beginning(name, |_| 0).and_then(|bytes| {
                let header = header(name, &bytes)?.0;
                Ok(format!("{} {}", show_shape(&header.shape), dtype(&header)))
            });
            let what = what.unwrap_or_else(|e| format!("unreadable: {e}"));
            format!("  {name:width$}  {what}")
        };
        let lines: Vec<String> = names.iter().map(describe).collect();
        lines.join("\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ReadOptions, Recording};
    use ndarray::{Array1, Array2, Array3};
    use ndarray_npy::NpzWriter;
    use std::io::Write;
    use tempfile::TempDir;

    fn open(path: &Path) -> Result<Recording, RecordError> {
        Recording::open(path, &ReadOptions::default())
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
        assert!(npz.list().contains("y  4000 x 5000 u8"), "{}", npz.list());
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
}
