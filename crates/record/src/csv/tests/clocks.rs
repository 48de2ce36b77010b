//! Columns of times, and names of columns that stand in a comment.

use super::*;

#[test]
fn names_in_the_comment_right_before_the_first_frame_are_those_of_its_columns() {
    let none = ReadOptions::default();
    for text in [
        "# time,a,b\n0.5,1,2\n1.5,3,4\n",
        "\u{feff}# recorded by me\r\n# rate: 100 Hz\r\n#time,a,b\r\n0.5,1,2\r\n1.5,3,4\r\n",
        "# t_s a b\n\n0.5 1 2\n1.5 3 4\n",
        "# time\ta\tb\n0.5\t1\t2\t\n1.5\t3\t4\t\n",
        "# a,b,time\n1,2,0.5\n3,4,1.5\n",
    ] {
        let recording = read_text(text, &none).unwrap();
        assert_eq!(recording.magnitudes(1).unwrap(), [3.0, 4.0], "{text:?}");
        assert!(
            recording.has_times() && recording.t_ns(1) == 1_500_000_000,
            "{text:?}"
        );
        assert!(recording.names_comment().is_some_and(|names| names.contains('b')));
    }
    let recording = read_text("# 0B0X,0B0Y,0B0Z\n1,2,3\n", &none).unwrap();
    assert_eq!(recording.counts(0).unwrap(), [Some([1, 2, 3])]);
    // A sentence, other numbers, another number of names, and one before the names.
    for text in [
        "# rate: 100 Hz\n0.5 1 2\n",
        "# 7,8,9\n0.5,1,2\n",
        "# time,a\n0.5,1,2\n",
        "# time,a,b\np,q,r\n0.5,1,2\n",
        "# time,a,b\n# by me\n0.5,1,2\n",
    ] {
        let recording = read_text(text, &none).unwrap();
        assert_eq!(recording.magnitudes(0).unwrap(), [0.5, 1.0, 2.0], "{text:?}");
        assert_eq!(recording.names_comment(), None, "{text:?}");
    }
}

#[test]
fn a_column_without_a_name_that_rises_like_a_clock_counts_no_frames() {
    let none = ReadOptions::default();
    let seconds = ReadOptions {
        time_column: Some(TimeUnit::S),
        ..Default::default()
    };
    let rated = ReadOptions {
        rate_hz: Some(50.0),
        ..Default::default()
    };
    for text in [",a,b\n0.5,1,2\n1.5,3,4\n", "sep=,\n\"\",a,b\n0.5,1,2\n1.5,3,4\n"] {
        let message = read_text(text, &none).unwrap_err();
        assert!(
            message.contains("column 1, which has no name, rises like a clock")
                && message.contains("--time-column s"),
            "{message}"
        );
        let recording = read_text(text, &seconds).unwrap();
        assert_eq!(recording.magnitudes(1).unwrap(), [3.0, 4.0]);
        assert_eq!(recording.t_ns(1), 1_500_000_000);
        let recording = read_text(text, &rated).unwrap();
        assert_eq!(
            (recording.magnitudes(1).unwrap(), recording.t_ns(1)),
            (&[3.0, 4.0][..], 20_000_000)
        );
    }
    // Of one that has a name, too, it is the other.
    let recording = read_text(",t_s,a,b\n0.5,1,1,2\n1.5,2,3,4\n", &none).unwrap();
    assert_eq!(
        (recording.t_ns(1), recording.left_out_columns()),
        (2_000_000_000, &[String::new()][..])
    );
    for text in [
        ",a,b\n0,1,2\n2,3,4\n",
        ",a,b\n0.0,1,2\n1.0,3,4\n",
        ",a,b\n1.5,1,2\n0.5,3,4\n",
    ] {
        let recording = read_text(text, &none).unwrap();
        assert_eq!(recording.magnitudes(1).unwrap(), [3.0, 4.0], "{text:?}");
        assert!(!recording.has_times());
    }
    let message = read_text("t,a\n0 days 00:00:00.010000,1\n", &none).unwrap_err();
    assert!(message.contains("pandas.to_timedelta(df.NAME)"), "{message}");
}

#[test]
fn a_column_of_the_time_since_1970_is_no_taxel() {
    let none = ReadOptions::default();
    for (text, wanted) in [
        (
            "1624371430.9 0 0\n1624371431.9 1 0\n",
            "column 1 rises like a clock since 1970, and is no taxel: --time-column s",
        ),
        (
            "1624371430900,0\n1624371430900,1\n1624371431900,1\n",
            "--time-column ms",
        ),
        (
            "clk,a\n1624371430900000,0\n1624371431900000,1\n",
            "column 1, \"clk\", rises like a clock since 1970",
        ),
        (
            "436 1624903035.7\n437 1624903035.8\n",
            "column 2 rises like a clock since 1970, and is no taxel: put it first",
        ),
        (
            "t_s,a,clk\n0,1,1624903035\n1,1,1624903036\n",
            "column 3, \"clk\", rises like a clock since 1970, and is no taxel: cut it out",
        ),
    ] {
        let message = read_text(text, &none).unwrap_err();
        assert!(message.contains(wanted), "{message}");
    }
    // Great numbers that are none.
    for text in [
        "1624371430,0\n1624371429,1\n",
        "1624371430,0\n1624371430,1\n",
        "1624371430,0\n",
        "5e9,0\n6e9,0\n",
    ] {
        assert!(read_text(text, &none).is_ok(), "{text:?}");
    }
    let seconds = ReadOptions {
        time_column: Some(TimeUnit::S),
        ..Default::default()
    };
    let message = read_text("436 1.7\n435 1.8\n", &seconds).unwrap_err();
    assert!(
        message.contains("the time of frame 1, column 1 of its line, is before")
            && message.contains("--time-column takes the first"),
        "{message}"
    );
}
