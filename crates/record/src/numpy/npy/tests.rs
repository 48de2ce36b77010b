use super::*;
use crate::{Columns, Recording};
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
    // Also where the shape is none of a recording.
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("a.npy");
    let text = "{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': (10,)}";
    let records = [
        &file("|O", "(10,)", &[])[..10],
        format!("{text:117}\n").as_bytes(),
    ]
    .concat();
    for (bytes, wanted) in [
        (
            file("|O", "(10,)", &[0; 16]),
            "elements are O; a recording has bool",
        ),
        (file("|O", "(10,)", &[0; 16]), "numpy.stack("),
        (records, "name a field of them"),
    ] {
        std::fs::write(&path, bytes).unwrap();
        let error = open(&path).unwrap_err().to_string();
        assert!(error.contains(wanted), "{error}");
    }
    let long = numbers(&file("<f16", "(1, 1)", &[0; 16])).unwrap_err();
    assert!(long.to_string().contains("elements are 128-bit floats"), "{long}");
}

#[test]
fn times_that_are_no_whole_nanoseconds_are_refused_with_what_makes_such_of_them() {
    let refused = |descriptor: &str| {
        let bytes = file(descriptor, "(1,)", &[0; 8]);
        let times = Array::open("test".into(), &bytes[..]).unwrap().times(1);
        times.unwrap_err().to_string()
    };
    for (descriptor, made) in [
        ("<f8", "not 1 of f64: numpy.round(t).astype(\"int64\")"),
        ("<f4", "not 1 of f32: numpy.round(t).astype(\"int64\")"),
        (
            "<M8[m]",
            "not 1 of M8[m]: t.astype(\"datetime64[ns]\").astype(\"int64\")",
        ),
        (
            "<m8[h]",
            "not 1 of m8[h]: t.astype(\"timedelta64[ns]\").astype(\"int64\")",
        ),
        ("|O", "not 1 of O: t.astype(\"int64\")"),
    ] {
        let message = refused(descriptor);
        assert!(message.ends_with(made), "{descriptor}: {message}");
    }
    let times = |descriptor: &str, bytes: &[u8]| {
        let bytes = file(descriptor, "(1,)", bytes);
        let times = Array::open("test".into(), &bytes[..]).unwrap().times(1);
        times.map_err(|error| error.to_string())
    };
    for (descriptor, times_ns) in [
        ("<i8", 7),
        ("<M8[ns]", 7),
        ("<m8[us]", 7000),
        ("<M8[ms]", 7_000_000),
        ("<m8[s]", 7_000_000_000),
    ] {
        assert_eq!(
            times(descriptor, &7u64.to_le_bytes()),
            Ok(vec![times_ns]),
            "{descriptor}"
        );
        let big = descriptor.replace('<', ">");
        assert_eq!(times(&big, &7u64.to_be_bytes()), Ok(vec![times_ns]), "{big}");
    }
    for (descriptor, time, wanted) in [
        ("<M8[ns]", i64::MIN, "frame 0 has no time (NaT)"),
        (
            "<i8",
            i64::MIN,
            "time -9223372036854775808 is negative; times begin at 0 or later: t - t.min()",
        ),
        ("<m8[s]", -1, "time -1 is negative; times begin at 0 or later"),
        (
            "<M8[s]",
            i64::MAX,
            "time 9223372036854775807 is beyond what nanoseconds of 64 bits hold",
        ),
    ] {
        let message = times(descriptor, &time.to_le_bytes()).unwrap_err();
        assert!(message.contains(wanted), "{descriptor}: {message}");
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
    let array = Array2::from_shape_fn((3, 6).f(), |(t, n)| (t * 6 + n) as u16);
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
    assert_eq!(recording.counts(1).unwrap(), [[6, 7, 8], [9, 10, 11]].map(Some));
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
            header("{'descr': '<f8', 'fortran_order': False, 'shape': (0, 9999999999999, 9999999999999)}"),
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
