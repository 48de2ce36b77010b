use super::*;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use proptest::prelude::*;
use std::io::Write;

#[test]
fn a_file_of_version_7_3_is_named_and_what_to_save_it_as() {
    for (version, order) in [(*b"\x00\x02", *b"IM"), (*b"\x02\x00", *b"MI")] {
        let mut file = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".to_vec();
        file.resize(HEADER - 4, b' ');
        file.extend(version);
        file.extend(order);
        file.resize(512, 0);
        file.extend(b"\x89HDF\r\n\x1a\n");
        let error = read_mat(&file, "datos").unwrap_err().to_string();
        assert!(error.contains("7.3") && error.contains("-v7"), "{error}");
    }
}

fn matrix() -> Matrix {
    let values = (0..30).map(|n| f64::from(n) / 7.0).collect();
    Matrix {
        name: "datos".into(),
        rows: 3,
        values,
    }
}

fn compressed(file: &[u8]) -> Vec<u8> {
    let mut packer = ZlibEncoder::new(Vec::new(), Compression::default());
    packer.write_all(&file[HEADER..]).unwrap();
    let packed = packer.finish().unwrap();
    let mut out = file[..HEADER].to_vec();
    out.extend(COMPRESSED.to_le_bytes());
    out.extend((packed.len() as u32).to_le_bytes());
    out.extend(packed);
    out
}

#[test]
fn a_matrix_comes_back_to_the_bit_packed_or_not() {
    let file = write_mat(&matrix());
    assert_eq!(read_mat(&file, "datos").unwrap(), matrix());
    assert_eq!(read_mat(&compressed(&file), "datos").unwrap(), matrix());
    assert_eq!(
        read_mat(&file, "other").unwrap(),
        matrix(),
        "the only matrix needs no name"
    );
}

#[test]
fn small_elements_integers_and_the_other_byte_order_are_read() {
    // One row of the numbers 1, -2 as int16 in a small element, most significant byte first.
    let mut file = vec![b' '; HEADER - 4];
    file.extend([1, 0, b'M', b'I']);
    let words = |words: &[u32]| words.iter().flat_map(|w| w.to_be_bytes()).collect::<Vec<u8>>();
    let mut body = words(&[6, 8, 6, 0, 5, 8, 1, 2, 1 << 16 | 1]);
    body.extend(b"x\0\0\0");
    body.extend(words(&[4 << 16 | 3, 0x0001_FFFE]));
    file.extend(words(&[14, body.len() as u32]));
    file.extend(body);
    let read = read_mat(&file, "datos").unwrap();
    assert_eq!(
        (read.name.as_str(), read.rows, read.values),
        ("x", 1, vec![1.0, -2.0])
    );
}

#[test]
fn a_file_that_is_cut_off_names_the_byte() {
    for file in [write_mat(&matrix()), compressed(&write_mat(&matrix()))] {
        for end in 0..file.len() {
            let torn = read_mat(&file[..end], "datos").unwrap_err();
            assert!(torn.offset <= end && !torn.reason.is_empty(), "{end}: {torn}");
        }
    }
    let file = write_mat(&matrix());
    let torn = read_mat(&file[..200], "datos").unwrap_err().to_string();
    assert_eq!(
        torn,
        "byte 128: an element of 296 bytes is cut off after 64; get the file again"
    );
}

#[test]
fn files_of_octave_and_of_level_4_are_told_what_to_save_them_as() {
    let text =
        "# Created by Octave 8.4.0, Thu Nov 26 10:00:00 2026 UTC <a@b>\n# name: datos\n# type: matrix\n";
    let level_4 = [0_u32, 3, 10, 0, 6].map(u32::to_le_bytes).concat();
    for (begin, words) in [
        (text.as_bytes(), "save -v7 FILE.mat datos"),
        (b"Octave-1-L\0", "save -v7 FILE.mat datos"),
        (&level_4, "level 4; save it in MATLAB or Octave with -v7"),
    ] {
        let mut file = begin.to_vec();
        file.resize(300, b'0');
        let error = read_mat(&file, "datos").unwrap_err().to_string();
        assert!(error.starts_with("byte 0: ") && error.contains(words), "{error}");
    }
    let short = read_mat(text.as_bytes(), "datos").unwrap_err().to_string();
    assert!(short.contains("save -v7"), "{short}");
}

#[test]
fn other_files_are_told_from_damaged_ones() {
    let mut hdf = write_mat(&matrix());
    hdf[HEADER - 2..HEADER].copy_from_slice(b"\0\0");
    assert!(read_mat(&hdf, "datos").unwrap_err().reason.contains("-v7"));
    let mut complex = write_mat(&matrix());
    complex[HEADER + 17] = 8;
    assert!(
        read_mat(&complex, "datos")
            .unwrap_err()
            .reason
            .contains("complex")
    );
    assert!(
        read_mat(&write_mat(&matrix())[..HEADER], "datos")
            .unwrap_err()
            .reason
            .contains("without a matrix")
    );
}

#[test]
fn what_unpacks_without_end_is_not_unpacked() {
    let head = &write_mat(&matrix())[..HEADER];
    let file = [head, &zeros("datos", 20 << 20)].concat();
    let torn = read_mat(&compressed(&file), "datos").unwrap_err();
    assert!(torn.reason.contains("16 MB"), "{torn}");
}

/// A matrix of so many zeros, each in one byte.
fn zeros(name: &str, count: u32) -> Vec<u8> {
    let element = |kind: u32, data: &[u8]| {
        let mut element = [kind, data.len() as u32].map(u32::to_le_bytes).concat();
        element.extend(data);
        element.resize(element.len().next_multiple_of(8), 0);
        element
    };
    let words = |a: u32, b: u32| [a, b].map(u32::to_le_bytes).concat();
    let body = [
        element(UINT32, &words(DOUBLE_CLASS, 0)),
        element(INT32, &words(count, 1)),
        element(INT8, name.as_bytes()),
        element(INT8, &vec![0; count as usize]),
    ];
    element(MATRIX, &body.concat())
}

#[test]
fn a_file_takes_no_more_memory_than_a_squeeze_however_many_matrices_it_packs() {
    let head = &write_mat(&matrix())[..HEADER];
    let file = |matrices: &[(&str, u32)]| {
        let packed = matrices.iter().map(|(name, count)| {
            let alone = [head, &zeros(name, *count)].concat();
            compressed(&alone)[HEADER..].to_vec()
        });
        [head.to_vec(), packed.flatten().collect()].concat()
    };
    const MB: u32 = 1 << 20;
    let (one, most) = ([("x", 7)], MOST_NUMBERS as u32);
    for (name, matrices, expected) in [
        ("x", &one[..], Ok(7)),
        ("other", &one, Ok(7)),
        ("x", &[("big", 9 * MB), ("x", 7)], Ok(7)),
        ("x", &[("x", 7), ("x", 9)], Ok(7)),
        ("x", &[("x", most)], Ok(most as usize)),
        ("x", &[("x", most + 1)], Err("2097153 numbers")),
        ("other", &[("x", most + 1)], Err("2097153 numbers")),
        ("x", &[("big", 9 * MB), ("big", 9 * MB), ("x", 7)], Ok(7)),
        ("x", &[("big", 20 * MB), ("x", 7), ("big", 20 * MB)], Ok(7)),
        ("x", &[("x", 20 * MB)], Err("16 MB")),
        ("other", &[("x", 20 * MB)], Err("16 MB")),
        (
            "z",
            &[("x", 1), ("y", 1)],
            Err("no \"z\" among its matrices x, y"),
        ),
    ] {
        let read = read_mat(&file(matrices), name);
        match (read, expected) {
            (Ok(matrix), Ok(count)) => assert_eq!(matrix.values.len(), count),
            (Err(torn), Err(says)) => assert!(torn.reason.contains(says), "{torn}"),
            (read, _) => panic!("{matrices:?}: {}", read.map_or_else(|e| e.reason, |m| m.name)),
        }
    }
}

#[test]
fn what_stands_beside_the_squeeze_is_not_looked_at() {
    let file = write_mat(&matrix());
    let alone = &file[HEADER..];
    let mut complex = alone.to_vec();
    complex[17] = 8;
    let mut cell = alone.to_vec();
    cell[16] = 1;
    // Three dimensions instead of two: 12 bytes, filled up to 16.
    let mut deep = alone.to_vec();
    deep[28] = 12;
    deep.splice(40..40, [1, 0, 0, 0, 0, 0, 0, 0]);
    let size = deep.len() as u32 - 8;
    deep[4..8].copy_from_slice(&size.to_le_bytes());
    for (other, words) in [
        (&complex, "\"datos\" is complex"),
        (&cell, "\"datos\" is no matrix of numbers"),
        (&deep, "a matrix that is not of two dimensions"),
    ] {
        let of_name = |name: &[u8; 5]| {
            let mut other = other.clone();
            let at = other.windows(5).position(|bytes| bytes == b"datos").unwrap();
            other[at..at + 5].copy_from_slice(name);
            other
        };
        let packed = |elements: [&[u8]; 2], pack: bool| -> Vec<u8> {
            let head = file[..HEADER].to_vec();
            let each = elements.into_iter().map(|element| match pack {
                true => compressed(&[&head, element].concat())[HEADER..].to_vec(),
                false => element.to_vec(),
            });
            [head.clone(), each.flatten().collect()].concat()
        };
        for pack in [false, true] {
            let other = of_name(b"touch");
            for elements in [[alone, &other], [&other, alone]] {
                assert_eq!(
                    read_mat(&packed(elements, pack), "datos").unwrap(),
                    matrix(),
                    "{words}"
                );
            }
            let torn = read_mat(&packed([&other, &of_name(b"datos")], pack), "datos").unwrap_err();
            assert!(torn.reason.contains(words) && torn.offset > HEADER, "{torn}");
        }
    }
}

proptest! {
    #[test]
    fn no_bytes_make_the_reader_fail_otherwise(changes in proptest::collection::vec((0usize..450, any::<u8>()), 1..12)) {
        for mut file in [write_mat(&matrix()), compressed(&write_mat(&matrix()))] {
            let length = file.len();
            for (at, byte) in &changes {
                file[at % length] = *byte;
            }
            if let Ok(matrix) = read_mat(&file, "datos") {
                prop_assert!(matrix.rows == 0 || matrix.values.len() % matrix.rows == 0);
            }
        }
    }
}
