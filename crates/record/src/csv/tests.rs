use super::*;
use crate::{Recording, TimeUnit, Void};
use tempfile::TempDir;

mod clocks;
mod refused;

fn read_text(text: &str, options: &ReadOptions) -> Result<Recording, String> {
    recording_of(text, options).map_err(|e| e.to_string())
}

fn recording_of(text: &str, options: &ReadOptions) -> Result<Recording, RecordError> {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("frames.csv");
    std::fs::write(&path, text).unwrap();
    Recording::open(&path, options)
}

#[test]
fn plain_numbers_are_magnitudes() {
    let recording = read_text("1,2.5,3\n4,5,-6\n\n", &ReadOptions::default()).unwrap();
    assert_eq!(recording.magnitudes(1).unwrap(), [4.0, 5.0, -6.0]);
    assert!(!recording.has_times());
}

#[test]
fn named_columns_are_counts_in_the_order_of_their_taxels() {
    let text = "\u{feff}time_ms,0B1X,0B1Y,0b1z,0B0Z,0b0y,0B0X\r\n0,1,2,3,4,5,6\r\n10.5,7,8,9,10,11,12\r\n";
    let recording = read_text(text, &ReadOptions::default()).unwrap();
    assert_eq!(recording.counts(0).unwrap(), [[6, 5, 4], [1, 2, 3]].map(Some));
    assert_eq!(recording.t_ns(1), 10_500_000);
}

#[test]
fn the_publications_rows_are_readings_and_joint_angles_named_or_in_its_order() {
    let order = ReadOptions {
        columns: Some(Columns::XyzInterleaved),
        joint_columns: 2,
        ..Default::default()
    };
    let none = ReadOptions::default();
    for (text, options) in [
        ("1,2,3,4,5,6,0.5,-1\n", &order),
        ("1 2  3 4 5 6 0.5 -1 \n   \n  # no more \n", &order),
        ("1|2|3|4|5|6|0.5|-1", &order),
        ("a;b;c;d;e;f;g;h\n1;2;3;4;5;6;0.5;-1\n", &order),
        (
            "J1,0B0X,0B0Y,0B0Z,joint_0,0B1X,0B1Y,0B1Z\n-1,1,2,3,0.5,4,5,6\n",
            &none,
        ),
    ] {
        let recording = read_text(text, options).unwrap();
        assert_eq!(
            recording.counts(0).unwrap(),
            [[1, 2, 3], [4, 5, 6]].map(Some),
            "{text:?}"
        );
        assert_eq!(recording.joints(0), [0.5, -1.0], "{text:?}");
        assert!(recording.joints(1).is_empty());
    }
    for (text, options, wanted) in [
        ("J0,J0,0B0X\n1,2,3\n", &none, "joint 0 has two columns"),
        ("J0,J1\n1,2\n", &none, "no column of a taxel"),
        (
            "0B0X,0B0Y,0B0Z,J0,J1,J3\n1,2,3,4,5,6\n",
            &none,
            "joint 2 has no column, and 1 and 3 have one",
        ),
        ("1,2\n", &order, "2 columns, of which 2 are joint angles"),
        (
            "0B0X,0B0Y,0B0Z,J0,J1\n1,2,3,4,5\n",
            &order,
            "leave --joint-columns out",
        ),
    ] {
        let message = read_text(text, options).unwrap_err();
        assert!(message.contains(wanted), "{message}");
    }
}

#[test]
fn boards_of_different_fingers_are_different_taxels() {
    let names = "1F0B0X,1F0B0Y,1F0B0Z,0F1B0X,0F1B0Y,0F1B0Z\n1,2,3,4,5,6\n";
    let recording = read_text(names, &ReadOptions::default()).unwrap();
    assert_eq!(recording.counts(0).unwrap(), [[4, 5, 6], [1, 2, 3]].map(Some));
}

#[test]
fn a_log_of_can_frames_is_told_from_a_table_of_numbers() {
    for (log, way) in [
        (
            "timestamp,arbitration_id,extended,remote,error,dlc,data\n0.002437,0x600,0,0,0,8,g4A5gAYyhgE=\n",
            "frames.log` of python-can makes a .log of it",
        ),
        (
            "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n2437,00000600,false,Rx,0,2,80,39,\n",
            "have SavvyCAN save it as \"Candump/Kayak (*.log)\"",
        ),
    ] {
        let message = read_text(log, &ReadOptions::default()).unwrap_err();
        assert!(message.contains("frames.csv:1: a log of CAN frames"), "{message}");
        assert!(message.contains(way), "{message}");
    }
}

#[test]
fn other_names_say_nothing_and_options_say_the_rest() {
    let options = ReadOptions {
        columns: Some(Columns::XyzBlocks),
        time_column: Some(TimeUnit::S),
        ..Default::default()
    };
    let recording = read_text("clock,a,b,c,d,e,f\n1.5,0,1,2,3,4,5\n", &options).unwrap();
    assert_eq!(recording.counts(0).unwrap(), [[0, 2, 4], [1, 3, 5]].map(Some));
    assert_eq!(recording.t_ns(0), 1_500_000_000);
    let recording = read_text("1.5,0,1,2,3,4,5\n", &options).unwrap();
    assert_eq!(recording.taxels(), 2);
}

#[test]
fn times_of_a_wall_clock_are_exact_in_every_unit() {
    for (unit, text, wanted) in [
        ("ns", "1700000000123456789", 1_700_000_000_123_456_789),
        ("us", "1700000000123457", 1_700_000_000_123_457_000),
        ("us", "1700000000123456.789", 1_700_000_000_123_456_789),
        ("ms", "1700000000123.456789", 1_700_000_000_123_456_789),
        ("s", "1700000000.123456789", 1_700_000_000_123_456_789),
        ("s", " 1700000000.1234567894 ", 1_700_000_000_123_456_789),
        ("s", "1700000000.1234567895", 1_700_000_000_123_456_790),
        // As numpy.savetxt writes them.
        ("s", "1.700000000123456789e+09", 1_700_000_000_123_456_789),
        ("us", "+1.700000000123457E15", 1_700_000_000_123_457_000),
        ("s", ".5", 500_000_000),
        ("s", "2.", 2_000_000_000),
        ("s", "1e-400", 0),
        ("s", "-0.0", 0),
        ("s", "0.0000000000000000000000000000000000000000005", 0),
    ] {
        let recording = read_text(&format!("t_{unit},a\n{text},1\n"), &ReadOptions::default()).unwrap();
        assert_eq!(recording.t_ns(0), wanted, "{text} {unit}");
    }
    for text in ["1e400", "1e30", "inf", "-1e-9"] {
        let message = read_text(&format!("t_s,a\n{text},1\n"), &ReadOptions::default()).unwrap_err();
        assert!(message.contains("is no time from 0 on"), "{text}: {message}");
    }
}

#[test]
fn semicolons_and_tabs_separate_like_commas_and_quotes_hide_them() {
    let none = ReadOptions::default();
    let wanted = read_text("t_ms,a,b\n0,1.5,-2\n10,3,4\n", &none).unwrap();
    for text in [
        "t_ms;a;b\r\n0;1.5;-2\r\n10;3;4\r\n",
        "\u{feff}# made by hand, today\n\nt_ms\ta\tb\n0\t1.5\t-2\n \n10\t3\t4",
        "\"t_ms\",\"a;b\",\"c, \"\"d\"\"\"\n\"0\",\"1.5\", -2\n  # half time\n10,3,\"4\"",
        "t_ms,\ta,\tb\n0,\t1.5,\t-2\n10,\t3,\t4\n",
    ] {
        let recording = read_text(text, &none).unwrap();
        assert_eq!(recording.frames(), wanted.frames(), "{text:?}");
        assert_eq!(recording.t_ns(1), 10_000_000, "{text:?}");
    }
}

#[test]
fn an_empty_quoted_cell_is_one_between_blanks_too() {
    let named = "\"\" \"t_s\" \"a\"  \"b\"\r\n\"0\" \"0.5\" \"1\" \"2\"\r\n1 0.6  3 4\r\n";
    let recording = read_text(named, &ReadOptions::default()).unwrap();
    assert_eq!(recording.magnitudes(1).unwrap(), [3.0, 4.0]);
    assert_eq!(recording.t_ns(0), 500_000_000);
    assert_eq!(recording.left_out_columns(), [""]);
    let counts = "0B0X 0B0Y 0B0Z 0B1X 0B1Y 0B1Z\n1 2 3 \"\" \"\" \"\"\n\"\" \"\" \"\" 4 5 6";
    let recording = read_text(counts, &ReadOptions::default()).unwrap();
    assert_eq!(recording.counts(0).unwrap(), [Some([1, 2, 3]), None]);
    assert_eq!(recording.counts(1).unwrap(), [None, Some([4, 5, 6])]);
}

#[test]
fn an_empty_cell_is_a_value_that_is_not_there() {
    let none = ReadOptions::default();
    let counts = ReadOptions {
        columns: Some(Columns::XyzInterleaved),
        joint_columns: 1,
        ..Default::default()
    };
    for (text, options) in [
        (
            "0B0X,0B0Y,0B0Z,0B1X,0B1Y,0B1Z,J0\n,,,4,5,6,0.5\n1,2,3,,nan,\"\",\n",
            &none,
        ),
        (",,,4,5,6,0.5\n1,2,3,, , ,\n", &counts),
    ] {
        let recording = read_text(text, options).unwrap();
        assert_eq!(recording.counts(0).unwrap(), [None, Some([4, 5, 6])], "{text:?}");
        assert_eq!(recording.counts(1).unwrap(), [Some([1, 2, 3]), None], "{text:?}");
        assert_eq!(recording.joints(0), [0.5]);
        assert!(recording.joints(1)[0].is_nan());
    }
    let void = ReadOptions {
        void: Some(Void::Nan),
        ..Default::default()
    };
    let magnitudes = read_text("1,,3\n4,,\n", &void).unwrap();
    assert_eq!((magnitudes.taxels(), magnitudes.missing()), (2, 1));
    for (text, options, wanted) in [
        ("1,,3,4,5,6,0.5\n", &counts, "frame 0, value 1 is NaN"),
        ("1,2\n3,\n", &none, "frame 1, taxel 1 is NaN"),
        ("t,a\n,2\n", &none, ":2: NaN is no time"),
        ("1,2\n3,4,5,\n", &none, ":2: 4 columns"),
    ] {
        let message = read_text(text, options).unwrap_err();
        assert!(message.contains(wanted), "{text:?}: {message}");
    }
}

#[test]
fn a_separator_at_the_end_of_lines_is_no_column() {
    let none = ReadOptions::default();
    let wanted = read_text("t_ms,a,b\n0,1,2\n10,3,4\n", &none).unwrap();
    for text in [
        "t_ms,a,b,\n0,1,2,\n10,3,4,\n",
        "t_ms;a;b\r\n0;1;2;\r\n10;3;4;\r\n",
        "t_ms,a,b,\n0,1,2\n10,3,4, \n",
        "t_ms\ta\tb\t\n0\t1\t2\t\n10\t3\t4\t\n",
    ] {
        let recording = read_text(text, &none).unwrap();
        assert_eq!(recording.frames(), wanted.frames(), "{text:?}");
        assert_eq!(recording.t_ns(1), 10_000_000, "{text:?}");
    }
    let plain = read_text("1,2,\n3,4,\n", &none).unwrap();
    assert_eq!(plain.magnitudes(1).unwrap(), [3.0, 4.0]);
}

#[test]
fn an_empty_cell_at_the_end_is_the_z_of_the_last_taxel_where_threes_need_it() {
    let options = |joint_columns, time_column| ReadOptions {
        columns: Some(Columns::XyzInterleaved),
        joint_columns,
        time_column,
        ..ReadOptions::default()
    };
    for (text, joint_columns, time_column) in [
        ("1,2,3,,,\n4,5,6,,,\n", 0, None),
        ("1,2,3,,,,\n4,5,6,,,,\n", 0, None),
        ("0,1,2,3,,,\n1,4,5,6,,,\n", 0, Some(TimeUnit::Ms)),
        ("1,2,3,,,,\n4,5,6,,,,\n", 1, None),
        ("1,2,3,,,,0.5\n4,5,6,,,,0.5\n", 1, None),
    ] {
        let recording = read_text(text, &options(joint_columns, time_column)).unwrap();
        assert_eq!(recording.counts(1).unwrap(), [Some([4, 5, 6]), None], "{text:?}");
        assert_eq!(recording.joints(1).len(), joint_columns, "{text:?}");
    }
    for (text, wanted) in [
        ("1,2,,\n", 1),
        ("1,,,\n", 2),
        ("1,,3,\n", 0),
        ("1,,3\n", 0),
        ("a,b,c,\n1,2,,\n", 0),
    ] {
        match recording_of(text, &ReadOptions::default()).unwrap_err() {
            RecordError::NotFinite {
                cells, empty_at_end, ..
            } => assert_eq!((cells, empty_at_end), (3, wanted), "{text:?}"),
            error => panic!("{text:?}: {error}"),
        }
    }
}

#[test]
fn columns_that_are_no_taxels_are_left_out_and_told() {
    let none = ReadOptions::default();
    let seconds = ReadOptions {
        time_column: Some(TimeUnit::S),
        ..Default::default()
    };
    for (text, options, left_out) in [
        (",timestamp,a,b\n0,0.5,1,2\n1,1.5,3,4\n", &none, &[""][..]),
        (
            "timestamp,elapsed,frame_index,a,b\n0.5,0,7,1,2\n1.5,1,8,3,4\n",
            &none,
            &["elapsed", "frame_index"],
        ),
        ("frame,a,b,t_ms\n7,1,2,500\n8,3,4,1500\n", &none, &["frame"]),
        (
            "sep=;\r\nseq;time;a;b\r\n7;0.5;1;2\r\n8;1.5;3;4\r\n",
            &none,
            &["seq"],
        ),
        (",clock,a,b\n0,0.5,1,2\n1,1.5,3,4\n", &seconds, &[""]),
        (",t,a,b\n0,0.5,1,2\n1,1.5,3,4\n", &none, &[""]),
        (
            ",frame,t,a,b\n0,7,0.5,1,2\n1,8,1.5,3,4\n",
            &seconds,
            &["", "frame"],
        ),
        ("frame,a,t,b\n7,1,0.5,2\n8,3,1.5,4\n", &seconds, &["frame"]),
        ("frame,a,ts,b\n7,1,0.5,2\n8,3,1.5,4\n", &seconds, &["frame"]),
        (",frame,a,b\n0,0.5,1,2\n1,1.5,3,4\n", &seconds, &[""]),
        ("frame,a,b\n0.5,1,2\n1.5,3,4\n", &seconds, &[]),
        // What PlotJuggler, `rostopic echo -p` and measuring programs call theirs.
        ("__time,a,b\n0.5,1,2\n1.5,3,4\n", &none, &[]),
        (
            "%time,field.header.seq,field.header.stamp,a,b\n500000000,7,3,1,2\n1500000000,8,4,3,4\n",
            &none,
            &["field.header.seq", "field.header.stamp"],
        ),
        ("Time [ms],a,b\n500,1,2\n1500,3,4\n", &none, &[]),
        (
            "grasp_time,a,time,b\n9,1,0.5,2\n9,3,1.5,4\n",
            &none,
            &["grasp_time"],
        ),
    ] {
        let recording = read_text(text, options).unwrap();
        assert_eq!(recording.magnitudes(1).unwrap(), [3.0, 4.0], "{text:?}");
        assert_eq!(recording.left_out_columns(), left_out, "{text:?}");
        assert_eq!(recording.column_names(), ["a", "b"], "{text:?}");
        assert_eq!(recording.t_ns(1), 1_500_000_000, "{text:?}");
    }
    // What pandas calls columns without names.
    let recording = read_text(",0,1,2\n0,7,8,9\n", &none).unwrap();
    assert_eq!(recording.magnitudes(0).unwrap(), [7.0, 8.0, 9.0]);
    for (text, names_line) in [
        ("0,1,2,3\n7,8,9,10\n", Some(1)),
        ("\"0\";\"1\";\"2\";\"3\"\n7;8;9;10\n", Some(1)),
        ("# mine\n\n0,1,2,3\n7,8,9,10\n", Some(3)),
        ("sep=,\n0,1,2,3\n7,8,9,10\n", Some(2)),
        ("0,1,2\n7,8,9\n", None),
        ("0.0,1.0,2.0,3.0\n7,8,9,10\n", None),
        ("7,8,9,10\n0,1,2,3\n", None),
        ("a,b,c,d\n0,1,2,3\n", None),
        (",0,1,2,3\n0,7,8,9,10\n", None),
    ] {
        let recording = read_text(text, &none).unwrap();
        assert_eq!(recording.names_line(), names_line, "{text:?}");
    }
    let recording = read_text("index,middle,ring,thumb\n7,8,9,10\n", &none).unwrap();
    assert_eq!(recording.magnitudes(0).unwrap(), [7.0, 8.0, 9.0, 10.0]);
    let recording = read_text("Index_tip,index,palm_left\n7,8,9\n", &none).unwrap();
    assert_eq!(recording.magnitudes(0).unwrap(), [7.0, 8.0, 9.0]);
    // A taxel may be called t.
    let recording = read_text("s,t,u\n7,8,9\n", &none).unwrap();
    assert_eq!(recording.magnitudes(0).unwrap(), [7.0, 8.0, 9.0]);
    for (text, wanted) in [
        (
            "t,a\n2025-11-20 17:00:00.01,1\n",
            "but a date; times are numbers: in pandas",
        ),
        (
            "made by,me\nt_s,a\n0,1\n",
            "cut off what is before it (`tail -n +N`)",
        ),
        ("t_s,a\n0,1,x\n", "cut off what is before it (`tail -n +N`)"),
        (
            "t_s,a,label\n0,1,hand\n",
            ":2: column 3 is \"hand\", which is not a number; cut that column out",
        ),
        (
            "object,slipped,a\nmetal_pen_case,0,3\n",
            ":2: column 1 is \"metal_pen_case\", which is not a number; cut that column out",
        ),
        (
            "t_s;a\n0,1;2,5\n",
            "decimals are written with a point: in pandas pandas.read_csv(NAME, sep=None, engine=\"python\", decimal=\",\")",
        ),
        ("t_s;a\n0.1;1,234.5\n", "thousands are not set apart: in pandas"),
        (
            "t_s,a\n0,1\n1,NA\n",
            ":3: column 2 is \"NA\", which is not a number; a cell without a value is left empty",
        ),
        (
            "made by,me,in 2024\nt_s,a,b\n0,1,2\n",
            "cut off what is before it (`tail -n +N`)",
        ),
    ] {
        let message = read_text(text, &none).unwrap_err();
        assert!(message.contains(wanted), "{message}");
    }
}

#[test]
fn names_that_end_in_axes_are_counts() {
    let none = ReadOptions::default();
    for text in [
        "txl1_x,txl1_y,txl1_z,txl2_x,txl2_y,txl2_z\n1,2,3,4,5,6\n",
        "t_s,x1,x2,y1,y2,z1,z2,J0\n0,1,4,2,5,3,6,0.5\n",
        ",Bx0,By0,Bz0,Bx1,By1,Bz1\n0,1,2,3,4,5,6\n",
    ] {
        let recording = read_text(text, &none).unwrap();
        assert_eq!(
            recording.counts(0).unwrap(),
            [[1, 2, 3], [4, 5, 6]].map(Some),
            "{text}"
        );
    }
    let blocks = ReadOptions {
        columns: Some(Columns::XyzBlocks),
        ..Default::default()
    };
    let recording = read_text("ax,ay,az,bx,by,bz\n1,2,3,4,5,6\n", &blocks).unwrap();
    assert_eq!(recording.counts(0).unwrap(), [[1, 3, 5], [2, 4, 6]].map(Some));
    // Two of three are no axes.
    assert!(!read_text("x,y,strip1\n1,2,3\n", &none).unwrap().has_counts());
    for (text, wanted) in [
        (
            "X,Y,Z,strip1\n1,2,3,4\n",
            ":1: column \"strip1\" is neither x, y nor z of a taxel, as \"X\" is; cut it out",
        ),
        ("Bx0,By0,Bz0\n0.5,-3,4\n", "numpy.round(10 * a) + 30000"),
        (
            "strip,x1,y1,z1\n1,2,3,4\n",
            ":1: column \"strip\" is neither x, y nor z of a taxel, as \"x1\" is; cut it out, and all others like it, or say \
             with --columns",
        ),
        (
            "time,x1,y1,z1,q0,q1\n0,2,3,4,0.5,0.6\n",
            "column \"q0\" is neither x, y nor z of a taxel, as \"x1\" is; cut it out, and all others like it, say with \
             --joint-columns 2 that",
        ),
        (
            "x,y,z,x,y,z\n1,2,3,4,5,6\n",
            ":1: column \"x\" comes twice; say with --columns xyz-interleaved or xyz-blocks",
        ),
    ] {
        let message = read_text(text, &none).unwrap_err();
        assert!(message.contains(wanted), "{message}");
    }
    let one_joint = ReadOptions {
        joint_columns: 1,
        ..Default::default()
    };
    let recording = read_text("x1,y1,z1,q0\n2,3,4,0.5\n", &one_joint).unwrap();
    assert_eq!(recording.counts(0).unwrap(), [Some([2, 3, 4])]);
    // Three axes among more taxels are of something else, and letters are no axes.
    let letters: Vec<String> = ('a'..='z').map(String::from).collect();
    for (names, taxels) in [
        ("pos_x,pos_y,pos_z,taxel0,taxel1,taxel2,taxel3", 7),
        (&letters.join(","), 26),
    ] {
        let text = format!("{names}\n{}\n", vec!["7"; taxels].join(","));
        let recording = read_text(&text, &none).unwrap();
        assert_eq!(recording.taxels(), taxels);
        assert!(!recording.has_counts(), "{names}");
    }
}

#[test]
fn taxels_whose_names_differ_by_a_number_are_in_its_order() {
    let counts = |taxels: &[&str]| {
        let names: Vec<String> = taxels
            .iter()
            .flat_map(|name| ["x", "y", "z"].map(|axis| name.replace('*', axis)))
            .collect();
        let values: Vec<String> = (0..names.len()).map(|column| (column / 3).to_string()).collect();
        let text = format!("{}\n{}\n", names.join(","), values.join(","));
        let recording = read_text(&text, &ReadOptions::default()).unwrap();
        let counts = recording.counts(0).unwrap();
        counts.iter().map(|xyz| xyz.unwrap()[0]).collect::<Vec<u16>>()
    };
    assert_eq!(counts(&["txl1_*", "txl10_*", "txl11_*", "txl2_*"]), [0, 3, 1, 2]);
    assert_eq!(counts(&["B*10", "B*9"]), [1, 0]);
    assert_eq!(counts(&["*", "*.1", "*.10", "*.2"]), [0, 1, 3, 2]);
    // Of each finger for itself, in the places that it has.
    assert_eq!(
        counts(&["thumb10_*", "thumb2_*", "ring10_*", "ring2_*"]),
        [1, 0, 3, 2]
    );
    assert_eq!(counts(&["a2_*", "b1_*", "a1_*", "b2_*"]), [2, 1, 0, 3]);
    let of_two = [
        "f0t0_*", "f0t10_*", "f0t2_*", "f10t0_*", "f10t10_*", "f10t2_*", "f2t0_*", "f2t10_*", "f2t2_*",
    ];
    assert_eq!(counts(&of_two), [0, 2, 1, 6, 8, 7, 3, 5, 4]);
    // Columns and rows, row by row.
    assert_eq!(
        counts(&["t_0_0_*", "t_1_0_*", "t_0_1_*", "t_1_1_*"]),
        [0, 1, 2, 3]
    );
    assert_eq!(counts(&["palm_*", "thumb_*"]), [0, 1]);
}
