//! Arrays of numpy's `.npz`: a zip archive of npy files.

use crate::error::{RecordError, show_shape};
use crate::meaning::Meaning;
use crate::npy::Array;
use crate::table::{ReadOptions, Table, Void};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

/// The array that gives the time of each frame, nanoseconds.
const TIMES: &str = "t_ns";
/// The array that gives the joint angles of each frame, radians.
const JOINTS: &str = "joints";
/// The array that is not zero where a taxel had no value of the time of a frame.
pub(crate) const WITHOUT_VALUE: &str = "without_value";
/// Arrays that say something of each frame of another one.
const OF_FRAMES: [&str; 3] = [TIMES, JOINTS, WITHOUT_VALUE];

/// Reads the named array of an npz file, or its only one, and what belongs to its frames.
pub(crate) fn read(path: &Path, options: &ReadOptions) -> Result<Table, RecordError> {
    let mut npz = Npz::open(path)?;
    let mask = match &options.void {
        Some(Void::Mask(mask)) => Some(mask),
        _ => None,
    };
    let frames: Vec<&String> = npz
        .names
        .iter()
        .filter(|n| *n != TIMES && Some(*n) != mask)
        .collect();
    let alone: Vec<&String> = (frames.iter().copied())
        .filter(|n| !OF_FRAMES.contains(&n.as_str()))
        .collect();
    let frames = if alone.is_empty() { frames } else { alone };
    let name = match (options.array.as_deref(), frames.as_slice()) {
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
    let array = npz.array(&name)?;
    let (at, shape) = (array.at.clone(), array.shape().to_vec());
    let meaning = Meaning::of(&at, &shape, None, options)?;
    let values = array.numbers()?;
    let times_ns = match name != TIMES && npz.has(TIMES) && options.rate_hz.is_none() {
        true if npz.belongs(TIMES, &name, &shape, meaning)? => Some(npz.array(TIMES)?.times()?),
        _ => None,
    };
    let joints = match name != JOINTS && npz.has(JOINTS) {
        true if npz.belongs(JOINTS, &name, &shape, meaning)? => Some(npz.array(JOINTS)?.numbers()?),
        _ => None,
    };
    let without_value = match name != WITHOUT_VALUE && npz.has(WITHOUT_VALUE) {
        true if npz.belongs(WITHOUT_VALUE, &name, &shape, meaning)? => {
            let cells = npz.array(WITHOUT_VALUE)?.numbers()?;
            Some(cells.into_iter().map(|cell| cell != 0.0).collect())
        }
        _ => None,
    };
    let void = mask
        .map(|mask| npz.mask(mask, &shape[1..], meaning))
        .transpose()?;
    Ok(Table {
        at,
        shape,
        values,
        times_ns,
        joints: joints.map(|angles| angles.into_iter().map(|angle| angle as f32).collect()),
        columns: None,
        unitless_time: None,
        void,
        without_value,
    })
}

fn unreadable(path: &Path, reason: &str) -> RecordError {
    RecordError::unreadable(path.display(), format!("not a readable npz (zip) file: {reason}"))
}

/// An npz file: a zip archive of npy members.
pub(crate) struct Npz<'a> {
    path: &'a Path,
    zip: zip::ZipArchive<BufReader<File>>,
    names: Vec<String>,
}

impl<'a> Npz<'a> {
    pub(crate) fn open(path: &'a Path) -> Result<Self, RecordError> {
        let file = File::open(path).map_err(RecordError::io(path))?;
        let zip = zip::ZipArchive::new(BufReader::new(file)).map_err(|e| unreadable(path, &e.to_string()))?;
        let names = zip
            .file_names()
            .map(|n| n.strip_suffix(".npy").unwrap_or(n).to_owned())
            .collect();
        Ok(Self { path, zip, names })
    }

    /// Whether it holds an array of this name.
    pub(crate) fn has(&self, array: &str) -> bool {
        self.names.iter().any(|name| name == array)
    }

    /// An array, of which no more than the header is unpacked.
    pub(crate) fn array(&mut self, name: &str) -> Result<Array<impl Read + '_>, RecordError> {
        let at = format!("{} [{name}]", self.path.display());
        let index = self
            .zip
            .index_for_name(&format!("{name}.npy"))
            .or_else(|| self.zip.index_for_name(name));
        let Some(index) = index else {
            return Err(RecordError::unreadable(at, "there is no array of this name"));
        };
        let member = self.zip.by_index(index);
        Array::open(
            at,
            member.map_err(|e| unreadable(self.path, &format!("array {name}: {e}")))?,
        )
    }

    /// Whether what an array says of each frame is said of those of the array `name`, which has this shape. What is of another
    /// length may be of another array, where the file has one of that length.
    fn belongs(
        &mut self,
        each: &str,
        name: &str,
        shape: &[usize],
        meaning: Meaning,
    ) -> Result<bool, RecordError> {
        let array = self.array(each)?;
        let (at, found) = (array.at.clone(), array.shape().to_vec());
        drop(array);
        let fits = match each {
            TIMES => found == [shape[0]],
            WITHOUT_VALUE => found == [shape[0], meaning.taxels],
            _ => found.len() == 2 && found[0] == shape[0],
        };
        if fits {
            return Ok(true);
        }
        for other in self.names.clone() {
            let is_frames = other != name && !OF_FRAMES.contains(&other.as_str());
            if is_frames && !found.is_empty() && self.array(&other)?.shape().first() == found.first() {
                return Ok(false);
            }
        }
        let (wanted, advice) = match each {
            TIMES => (format!("{}", shape[0]), "; --rate HZ ignores the times"),
            WITHOUT_VALUE => (format!("{} x {}", shape[0], meaning.taxels), ""),
            _ => (format!("{} x joints", shape[0]), ""),
        };
        let expected = format!("{wanted}, since {name} has {} frames{advice}", shape[0]);
        Err(RecordError::shape(at, &found, &expected))
    }

    /// Which cells of a frame an array says are no taxels: those that are not zero in it.
    fn mask(&mut self, name: &str, frame: &[usize], meaning: Meaning) -> Result<Vec<bool>, RecordError> {
        if !self.has(name) {
            let holds = format!("has no array {name:?} for --void; it holds:\n{}", self.list());
            return Err(RecordError::unfit(self.path.display(), holds));
        }
        let array = self.array(name)?;
        if array.shape() != frame && array.shape() != [meaning.taxels] {
            let expected = format!("{}, a frame's, since --void names it", show_shape(frame));
            return Err(RecordError::shape(&array.at, array.shape(), &expected));
        }
        Ok(array.numbers()?.into_iter().map(|cell| cell != 0.0).collect())
    }

    /// The arrays, one a line, as error messages list them.
    pub(crate) fn list(&mut self) -> String {
        let names = self.names.clone();
        let width = names.iter().map(String::len).max().unwrap_or(0);
        let describe = |name: &String| {
            let what = match self.array(name) {
                Ok(array) => array.description(),
                Err(error) => format!("unreadable: {error}"),
            };
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
            message.contains("has shape 3;") && message.contains("[names]"),
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
    fn times_and_joints_of_no_array_of_the_npz_are_refused() {
        let dir = TempDir::new().unwrap();
        let path = dir.path().join("short.npz");
        let read = |times: usize, joints: (usize, usize), rate_hz: Option<f64>| {
            let mut writer = NpzWriter::new(File::create(&path).unwrap());
            let counts = Array3::<u16>::zeros((60, 16, 3));
            writer.add_array("counts", &counts).unwrap();
            writer.add_array("t_ns", &Array1::<i64>::zeros(times)).unwrap();
            writer.add_array("joints", &Array2::<f32>::zeros(joints)).unwrap();
            writer.finish().unwrap();
            let options = ReadOptions {
                rate_hz,
                ..Default::default()
            };
            Recording::open(&path, &options).map_err(|error| error.to_string())
        };
        assert_eq!(read(60, (60, 2), None).unwrap().joints(59).len(), 2);
        assert!(!read(59, (60, 2), Some(10.0)).unwrap().has_times());
        for (times, joints, wanted) in [
            (
                59,
                (60, 2),
                "[t_ns] has shape 59; expected 60, since counts has 60 frames; --rate HZ",
            ),
            (
                60,
                (59, 2),
                "[joints] has shape 59 x 2; expected 60 x joints, since counts has 60 frames",
            ),
            (59, (59, 2), "[t_ns] has shape 59; expected 60"),
        ] {
            let message = read(times, joints, None).unwrap_err();
            assert!(message.contains(wanted), "{message}");
        }
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
        assert_eq!(npz.array("y").unwrap().numbers().unwrap().len(), 20_000_000);
        let array = |name: &str| ReadOptions {
            array: Some(name.into()),
            ..Default::default()
        };
        let message = Recording::open(&path, &array("x")).unwrap_err().to_string();
        assert!(message.contains("does not fit"), "{message}");
        assert!(npz.list().contains("y  4000 x 5000 u8"), "{}", npz.list());
    }

    #[test]
    fn an_array_of_the_npz_names_the_cells_that_are_no_taxels() {
        let dir = TempDir::new().unwrap();
        let path = dir.path().join("holes.npz");
        let mut writer = NpzWriter::new(File::create(&path).unwrap());
        let frames = Array3::<i64>::from_shape_fn((2, 2, 3), |(t, y, x)| (100 * t + 10 * y + x) as i64);
        writer.add_array("frames", &frames).unwrap();
        let holes = Array2::from_shape_fn((2, 3), |(y, x)| (y, x) == (0, 1));
        writer.add_array("holes", &holes).unwrap();
        writer.add_array("small", &Array2::<u8>::zeros((2, 2))).unwrap();
        writer.finish().unwrap();
        let read = |mask: &str| {
            let options = ReadOptions {
                array: Some("frames".into()),
                void: Some(Void::Mask(mask.into())),
                ..Default::default()
            };
            Recording::open(&path, &options)
        };
        let recording = read("holes").unwrap();
        assert_eq!((recording.taxels(), recording.image_shape()), (5, Some((2, 3))));
        assert_eq!(
            recording.magnitudes(1).unwrap(),
            [100.0, 102.0, 110.0, 111.0, 112.0]
        );
        for (mask, wanted) in [
            ("small", "[small] has shape 2 x 2; expected 2 x 3"),
            ("none", "no array \"none\" for --void"),
        ] {
            let message = read(mask).unwrap_err().to_string();
            assert!(message.contains(wanted), "{message}");
        }
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

    #[test]
    fn an_array_says_where_taxels_have_no_value() {
        let dir = TempDir::new().unwrap();
        let path = dir.path().join("a.npz");
        let read = |frames: &Array3<u16>, without: Array2<bool>| {
            let mut writer = NpzWriter::new(File::create(&path).unwrap());
            writer.add_array("frames", frames).unwrap();
            writer.add_array("without_value", &without).unwrap();
            writer.finish().unwrap();
            open(&path).map_err(|e| e.to_string())
        };
        let without = |taxels| Array2::from_shape_fn((2, taxels), |place| place == (1, 2));
        let counts = Array3::from_elem((2, 4, 3), 7);
        let recording = read(&counts, without(4)).unwrap();
        assert_eq!(recording.counts(0).unwrap(), [Some([7; 3]); 4]);
        let wanted = [Some([7; 3]), Some([7; 3]), None, Some([7; 3])];
        assert_eq!(recording.counts(1).unwrap(), wanted);
        for (frames, taxels, wanted) in [
            (counts, 5, "[without_value] has shape 2 x 5; expected 2 x 4"),
            (Array3::from_elem((2, 2, 2), 7), 4, "frame 1, taxel 2 is NaN"),
        ] {
            let message = read(&frames, without(taxels)).unwrap_err();
            assert!(message.contains(wanted), "{message}");
        }
    }
}
