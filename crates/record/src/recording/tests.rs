use super::*;
use crate::table::{Columns, ReadOptions, Table, Void};

fn table(shape: &[usize], values: Vec<f64>) -> Table {
    assert_eq!(values.len(), shape.iter().product::<usize>());
    Table {
        at: "test".into(),
        shape: shape.into(),
        values,
        times_ns: None,
        joints: None,
        columns: None,
        unitless_time: None,
        names: ColumnNames::default(),
        void: None,
        without_value: None,
        is_half: false,
    }
}

fn ramp(shape: &[usize]) -> Table {
    table(
        shape,
        (0..shape.iter().product::<usize>()).map(|v| v as f64).collect(),
    )
}

fn message(table: Table, options: &ReadOptions) -> String {
    Recording::from_table(table, options).unwrap_err().to_string()
}

#[test]
fn the_shape_decides_what_the_numbers_are() {
    let none = ReadOptions::default();
    let image = Recording::from_table(ramp(&[2, 3, 4]), &none).unwrap();
    assert_eq!(
        (image.len(), image.taxels(), image.image_shape()),
        (2, 12, Some((3, 4)))
    );
    assert_eq!(image.magnitudes(1).unwrap()[0], 12.0);
    assert_eq!(image.counts(1), None);

    let flat = Recording::from_table(ramp(&[2, 6]), &none).unwrap();
    assert_eq!(
        (flat.taxels(), flat.image_shape(), flat.has_counts()),
        (6, None, false)
    );

    let counts = Recording::from_table(ramp(&[2, 4, 3]), &none).unwrap();
    assert_eq!((counts.taxels(), counts.has_counts()), (4, true));
    assert_eq!(counts.counts(1).unwrap()[0], Some([12, 13, 14]));
    assert_eq!(counts.counts(2), None);

    let image = Recording::from_table(ramp(&[2, 2, 4, 3]), &none).unwrap();
    assert_eq!((image.taxels(), image.image_shape()), (8, Some((2, 4))));
    assert_eq!(image.counts(1).unwrap()[5], Some([39, 40, 41]));
}

#[test]
fn a_taxel_without_a_value_has_none_on_any_axis() {
    let nan = f64::NAN;
    let none = ReadOptions::default();
    let recording = Recording::from_table(table(&[1, 2, 3], vec![nan, nan, nan, 1.0, 2.0, 3.0]), &none);
    assert_eq!(recording.unwrap().counts(0).unwrap(), [None, Some([1, 2, 3])]);
    let message = message(table(&[1, 2, 3], vec![1.0, nan, nan, 1.0, 2.0, 3.0]), &none);
    assert!(
        message.contains("value 1 is NaN") && message.contains("none on all three axes"),
        "{message}"
    );
}

#[test]
fn three_columns_are_counts_unless_frames_are_said_to_be_images() {
    let read = |shape: &[usize], image| {
        let options = ReadOptions {
            image: Some(image),
            ..Default::default()
        };
        Recording::from_table(ramp(shape), &options).map_err(|e| e.to_string())
    };
    let magnitudes = read(&[2, 4, 3], (4, 3)).unwrap();
    assert_eq!(
        (magnitudes.taxels(), magnitudes.image_shape()),
        (12, Some((4, 3)))
    );
    assert!(read(&[2, 12, 3], (4, 3)).unwrap().has_counts());
    assert_eq!(read(&[2, 12], (4, 3)).unwrap().taxels(), 12);
    let message = read(&[2, 8, 8], (4, 16)).unwrap_err();
    assert!(
        message.contains("2 x 8 x 8") && message.contains("T x 4 x 16"),
        "{message}"
    );
    assert!(read(&[2, 4, 5, 3], (4, 5)).unwrap().has_counts());
    let message = read(&[2, 8, 8, 3], (4, 16)).unwrap_err();
    assert!(message.contains("T x 4 x 16 x 3"), "{message}");
}

#[test]
fn magnitudes_are_above_the_level_at_which_their_taxel_idles() {
    let idle = ReadOptions {
        idle_frames: Some(2),
        ..Default::default()
    };
    let recording = Recording::from_table(ramp(&[3, 2]), &idle).unwrap();
    assert_eq!(recording.magnitudes(2).unwrap(), [3.0, 3.0]);
    let message = message(ramp(&[3, 2, 3]), &idle);
    assert!(message.contains("--idle is for magnitudes"), "{message}");
}

#[test]
fn void_cells_are_no_taxels() {
    let nan = f64::NAN;
    let read = |values: &[f64], void, mask: Option<Vec<bool>>| {
        let table = Table {
            void: mask,
            ..table(&[2, 1, 3], values.into())
        };
        let options = ReadOptions {
            void,
            image: Some((1, 3)),
            ..Default::default()
        };
        Recording::from_table(table, &options).map_err(|e| e.to_string())
    };
    let recording = read(&[1.0, nan, 2.0, 3.0, nan, nan], Some(Void::Nan), None).unwrap();
    assert_eq!((recording.taxels(), recording.image_shape()), (2, Some((1, 3))));
    assert_eq!(recording.cells(), Some(&[true, false, true][..]));
    assert_eq!(recording.magnitudes(0).unwrap(), [1.0, 2.0]);
    // A taxel in the first frame, so it is missing in the second.
    let second = recording.magnitudes(1).unwrap();
    assert!(second[0] == 3.0 && second[1].is_nan(), "{second:?}");

    let mask = || Some(vec![false, true, false]);
    let named = || Some(Void::Mask("holes".into()));
    let recording = read(&[1.0, -1.0, 2.0, 3.0, -1.0, 4.0], named(), mask()).unwrap();
    assert_eq!(recording.magnitudes(1).unwrap(), [3.0, 4.0]);
    assert_eq!(read(&[1.0; 6], Some(Void::Nan), None).unwrap().cells(), None);
    let flat = ReadOptions {
        void: Some(Void::Nan),
        image: Some((2, 2)),
        ..Default::default()
    };
    let recording = Recording::from_table(table(&[1, 4], vec![1.0, nan, 2.0, 3.0]), &flat).unwrap();
    assert_eq!((recording.taxels(), recording.image_shape()), (3, Some((2, 2))));
    for (values, void, mask, wanted) in [
        (
            &[1.0, nan, 2.0, 3.0, nan, nan][..],
            named(),
            mask(),
            "frame 1, taxel 2 is NaN",
        ),
        (
            &[1.0, nan, 2.0, 3.0, nan, 4.0],
            None,
            None,
            "taxel 1 is NaN; a magnitude is a finite number",
        ),
        (
            &[1.0, f64::INFINITY, 2.0, 3.0, nan, 4.0],
            Some(Void::Nan),
            None,
            "taxel 1 is inf; a magnitude is a finite number",
        ),
        (&[nan; 6], Some(Void::Nan), None, "every cell is void"),
    ] {
        let message = read(values, void, mask).unwrap_err();
        assert!(message.contains(wanted), "{message}");
    }
}

#[test]
fn columns_of_counts_are_read_in_the_order_given_and_only_when_given() {
    let read = |columns| {
        let options = ReadOptions {
            columns,
            ..Default::default()
        };
        Recording::from_table(ramp(&[2, 6]), &options).unwrap()
    };
    assert!(!read(None).has_counts());
    let interleaved = read(Some(Columns::XyzInterleaved));
    assert_eq!(interleaved.counts(1).unwrap(), [[6, 7, 8], [9, 10, 11]].map(Some));
    let blocks = read(Some(Columns::XyzBlocks));
    assert_eq!(blocks.counts(0).unwrap(), [[0, 2, 4], [1, 3, 5]].map(Some));
}

#[test]
fn a_shape_that_fits_nothing_says_what_would() {
    let none = ReadOptions::default();
    let blocks = ReadOptions {
        columns: Some(Columns::XyzBlocks),
        ..Default::default()
    };
    for (shape, options, wanted) in [
        (vec![5], &none, "T x N x 3"),
        (vec![2, 2, 2, 2], &none, "T x H x W x 3"),
        (vec![2, 7], &blocks, "T x 3N"),
        (vec![2, 7, 3], &blocks, "T x 3N"),
        (vec![0, 7], &none, "at least one frame"),
    ] {
        let message = message(ramp(&shape), options);
        assert!(message.contains(wanted), "{message}");
    }
}

#[test]
fn values_that_are_no_counts_or_no_numbers_are_named() {
    let blocks = ReadOptions {
        columns: Some(Columns::XyzBlocks),
        ..Default::default()
    };
    for bad in [-1.0, 65536.0, 0.5, f64::NAN] {
        let mut values = vec![0.0; 12];
        values[8] = bad;
        let message = message(table(&[2, 6], values), &blocks);
        assert!(
            message.contains(&format!("frame 1, value 2 is {bad};")),
            "{message}"
        );
    }
    let mut values = vec![0.0; 12];
    values[7] = f64::INFINITY;
    let message = message(table(&[2, 6], values), &ReadOptions::default());
    assert!(message.contains("frame 1, taxel 1 is inf;"), "{message}");
}

#[test]
fn times_are_recorded_ones_unless_a_rate_is_given() {
    let mut timed = ramp(&[3, 2]);
    timed.times_ns = Some(vec![5, 5, 9]);
    let recording = Recording::from_table(timed, &ReadOptions::default()).unwrap();
    assert_eq!((recording.t_ns(1), recording.t_ns(2)), (5, 9));
    assert_eq!(recording.period_ns(), 4);

    let mut timed = ramp(&[3, 2]);
    timed.times_ns = Some(vec![5, 5, 9]);
    let at_1khz = ReadOptions {
        rate_hz: Some(1000.0),
        ..Default::default()
    };
    assert_eq!(Recording::from_table(timed, &at_1khz).unwrap().t_ns(2), 2_000_000);

    let untimed = Recording::from_table(ramp(&[3, 2]), &ReadOptions::default()).unwrap();
    assert_eq!((untimed.t_ns(1), untimed.period_ns()), (33_333_333, 33_333_333));
}

#[test]
fn times_that_run_backwards_or_do_not_fit_are_refused() {
    for (times, wanted) in [
        (
            vec![5, 4, 9],
            "frame 1 is before that of the frame before it; where the frames are only out of order, n = numpy.argsort(t,",
        ),
        (vec![1, 2], "2 times for 3 frames"),
    ] {
        let mut timed = ramp(&[3, 2]);
        timed.times_ns = Some(times);
        let message = message(timed, &ReadOptions::default());
        assert!(message.contains(wanted), "{message}");
    }
}

#[test]
fn what_is_advised_for_values_that_are_no_counts_makes_counts_of_them() {
    let nan = f64::NAN;
    for (values, wanted) in [
        (
            &[-3.0, 0.5, 2.0][..],
            Some("whole numbers, numpy.round(10 * a) + 30000"),
        ),
        (
            &[-141.0, 203.0, 17.0],
            Some("whole numbers, a.astype(float) + 32768"),
        ),
        (
            &[-32768.0, 32767.0, nan],
            Some("whole numbers, a.astype(float) + 32768"),
        ),
        (&[-3000.5, 3000.0, 0.0], Some("numpy.round(a) + 30000")),
        (&[-1000.0, 3553.5, 0.0], Some("numpy.round(a) + 30000")),
        (
            &[-40_000.0, 300_000.0, 0.0],
            Some("numpy.round(1e-1 * a) + 30000"),
        ),
        (&[-1e9, 1e12, 0.0], Some("numpy.round(1e-8 * a) + 30000")),
        (&[f64::INFINITY, 0.5, 0.0], Some("numpy.round(10 * a) + 30000")),
        // What is there are counts.
        (&[31_000.0, nan, 31_000.0], None),
    ] {
        let message = message(table(&[1, 1, 3], values.into()), &ReadOptions::default());
        match wanted {
            Some(wanted) => assert!(message.contains(wanted), "{message}"),
            None => assert!(!message.contains("numpy"), "{message}"),
        }
    }
}

#[test]
fn counts_from_floats_of_16_bits_have_the_steps_of_the_greatest() {
    for (greatest, wanted) in [
        (0, None),
        (2047, None),
        (2048, Some(2)),
        (16_384, Some(16)),
        (32_752, Some(16)),
        (32_768, Some(32)),
        (65_504, Some(32)),
    ] {
        let counts = |is_half| {
            let table = Table {
                is_half,
                ..table(&[1, 2, 3], vec![0.0, 1.0, 2.0, 3.0, 4.0, f64::from(greatest)])
            };
            Recording::from_table(table, &ReadOptions::default()).unwrap()
        };
        assert_eq!(counts(true).counts_step(), wanted, "{greatest}");
        assert_eq!(counts(false).counts_step(), None);
    }
}
