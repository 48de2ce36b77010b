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
fn times_are_read_in_the_unit_that_their_name_says_and_refused_without_one() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("a.npz");
    let read = |name: &str, times: Vec<f64>, rate_hz: Option<f64>| {
        let mut writer = NpzWriter::new(File::create(&path).unwrap());
        writer
            .add_array("counts", &Array3::<u16>::zeros((3, 16, 3)))
            .unwrap();
        writer.add_array(name, &Array1::from(times)).unwrap();
        writer.finish().unwrap();
        let options = ReadOptions {
            rate_hz,
            ..Default::default()
        };
        Recording::open(&path, &options).map_err(|error| error.to_string())
    };
    for (name, step) in [("t_s", 0.01), ("T_ms", 10.0), ("time_us", 10_000.0)] {
        let recording = read(name, vec![0.0, step, 2.0 * step], None).unwrap();
        assert_eq!(
            (recording.t_ns(1), recording.t_ns(2)),
            (10_000_000, 20_000_000),
            "{name}"
        );
    }
    for name in ["time", "timestamps", "t"] {
        let message = read(name, vec![0.0, 0.01, 0.02], None).unwrap_err();
        let wanted = format!("[{name}] is not read, since its name says no unit: call it t_s");
        assert!(message.contains(&wanted), "{message}");
        assert!(!read(name, vec![0.0, 0.01, 0.02], Some(10.0)).unwrap().has_times());
    }
    for (times, wanted) in [
        (vec![0.0, f64::NAN, 1.0], "[t_s]: NaN is no time"),
        (
            vec![-1.0, 0.0, 1.0],
            "[t_s]: -1 is no time; times begin at 0 or later: t - t.min()",
        ),
        (vec![0.0, 1.0], "[t_s] has shape 2; expected 3"),
    ] {
        let message = read("t_s", times, None).unwrap_err();
        assert!(message.contains(wanted), "{message}");
    }
}

#[test]
fn times_that_know_their_unit_need_no_name_that_says_it() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("a.npz");
    let datetimes = |unit: &str, step: i64| {
        let text = format!("{{'descr': '<M8[{unit}]', 'fortran_order': False, 'shape': (3,)}}");
        let mut bytes = b"\x93NUMPY\x01\x00v\x00".to_vec();
        bytes.extend(format!("{text:117}\n").bytes());
        bytes.extend((1..4).flat_map(|frame: i64| (frame * step).to_le_bytes()));
        bytes
    };
    let read = |arrays: &[(&str, Vec<u8>)]| {
        let mut values = Vec::new();
        crate::write_npy(&mut values, &[3, 4], vec![0f32; 12]).unwrap();
        let mut zip = zip::ZipWriter::new(File::create(&path).unwrap());
        let options = zip::write::SimpleFileOptions::default();
        for (name, bytes) in [("values", values)].iter().chain(arrays) {
            zip.start_file(format!("{name}.npy"), options).unwrap();
            zip.write_all(bytes).unwrap();
        }
        zip.finish().unwrap();
        open(&path).map(|recording| recording.t_ns(1))
    };
    for (name, unit, step) in [
        ("time", "us", 1000),
        ("timestamps", "ns", 1_000_000),
        ("t_s", "ms", 1),
    ] {
        assert_eq!(
            read(&[(name, datetimes(unit, step))]).unwrap(),
            2_000_000,
            "{name}"
        );
    }
    // It is preferred to one whose unit is not known.
    let plain = file_of_u8(3);
    assert_eq!(
        read(&[("t", plain), ("time", datetimes("ms", 5))]).unwrap(),
        10_000_000
    );
}

/// An array of so many bytes.
fn file_of_u8(length: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    crate::write_npy(&mut bytes, &[length], vec![0u8; length]).unwrap();
    bytes
}

#[test]
fn of_several_arrays_called_times_one_with_a_unit_and_of_the_frames_gives_them() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("a.npz");
    let read = |array: &str, times: &[(&str, &[usize], f64)]| {
        let mut writer = NpzWriter::new(File::create(&path).unwrap());
        for (name, frames) in [("a", 4), ("b", 2)] {
            writer
                .add_array(name, &Array3::<u16>::zeros((frames, 16, 3)))
                .unwrap();
        }
        for (name, shape, step) in times {
            let steps = (0..shape.iter().product()).map(|n| n as f64 * step).collect();
            let times = ndarray::ArrayD::from_shape_vec(*shape, steps).unwrap();
            writer.add_array(*name, &times).unwrap();
        }
        writer.finish().unwrap();
        let options = ReadOptions {
            array: Some(array.into()),
            ..Default::default()
        };
        let read = Recording::open(&path, &options).map_err(|error| error.to_string())?;
        Ok::<_, String>(read.has_times().then(|| read.t_ns(1)))
    };
    let s = 1_000_000_000;
    for (array, times, second) in [
        ("a", &[("time", &[4][..], 1.0), ("t_ms", &[4], 2000.0)][..], 2 * s),
        ("b", &[("t_s", &[4], 1.0), ("time_s", &[2], 2.0)], 2 * s),
        ("a", &[("t_s", &[4], 1.0), ("time_s", &[2], 2.0)], s),
        ("a", &[("t_s", &[4, 1], 1.0)], s),
        ("a", &[("t_s", &[1, 4], 1.0)], s),
    ] {
        assert_eq!(read(array, times), Ok(Some(second)), "{times:?}");
    }
    for (times, wanted) in [
        (
            &[("t_s", &[4][..], 1.0), ("time", &[2], 1.0)][..],
            "[time] is not read",
        ),
        (&[("time", &[2, 1], 1.0)], "[time] is not read"),
        (
            &[("time", &[3], 1.0), ("t_s", &[1, 3], 1.0)],
            "[t_s] has shape 1 x 3; expected 2",
        ),
    ] {
        let message = read("b", times).unwrap_err();
        assert!(message.contains(wanted), "{message}");
    }
    assert_eq!(read("b", &[("t_s", &[1, 4], 1.0)]), Ok(None));
    let mut writer = NpzWriter::new(File::create(&path).unwrap());
    writer.add_array("a", &Array2::<f32>::zeros((2, 5))).unwrap();
    writer.add_array("t_s", &Array1::<f64>::zeros(2)).unwrap();
    writer.add_array("t_ns", &Array2::<i64>::ones((2, 1))).unwrap();
    writer.finish().unwrap();
    assert_eq!(open(&path).unwrap().t_ns(1), 1);
}

#[test]
fn times_in_whole_numbers_are_read_to_the_nanosecond() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("epoch.npz");
    for (name, decimals) in [("t_us", 3), ("t_ms", 6), ("t_s", 9)] {
        // 2012, of which a double holds 256 nanoseconds.
        let first = 1_330_000_000_100_000_000 / 10i64.pow(decimals);
        let mut writer = NpzWriter::new(File::create(&path).unwrap());
        writer.add_array("a", &Array2::<f32>::zeros((2, 5))).unwrap();
        let times = Array1::from_vec(vec![first, first + 7]);
        writer.add_array(name, &times).unwrap();
        writer.finish().unwrap();
        let read = open(&path).unwrap();
        let wanted = [first, first + 7].map(|time| time as u64 * 10u64.pow(decimals));
        assert_eq!([0, 1].map(|frame| read.t_ns(frame)), wanted, "{name}");
    }
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
    let message = read(&counts, without(5)).unwrap_err();
    let wanted = "[without_value] has shape 2 x 5; expected 2 x 4";
    assert!(message.contains(wanted), "{message}");
    // Magnitudes of a grid.
    let recording = read(&Array3::from_elem((2, 2, 2), 7), without(4)).unwrap();
    assert_eq!((recording.taxels(), recording.cells()), (4, None));
    assert_eq!(recording.magnitudes(0).unwrap(), [7.0; 4]);
    let magnitudes = recording.magnitudes(1).unwrap();
    let [a, b, missing, c] = magnitudes else {
        panic!("{magnitudes:?}")
    };
    assert!([*a, *b, *c] == [7.0; 3] && missing.is_nan(), "{magnitudes:?}");
}

#[test]
fn an_array_that_has_no_numbers_is_told_as_that_and_not_by_its_shape() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("ragged.npz");
    let mut zip = zip::ZipWriter::new(File::create(&path).unwrap());
    let header = "{'descr': '|O', 'fortran_order': False, 'shape': (3,)}";
    let bytes = [b"\x93NUMPY\x01\x00\x76\x00", format!("{header:117}\n").as_bytes()].concat();
    zip.start_file("frames.npy", zip::write::SimpleFileOptions::default())
        .unwrap();
    zip.write_all(&bytes).unwrap();
    zip.finish().unwrap();
    let message = open(&path).unwrap_err().to_string();
    assert!(
        message.contains("[frames]: elements are O") && message.contains("numpy.stack("),
        "{message}"
    );
}
