//! What is said of tables that are refused.

use super::*;
use crate::csv::lines::MAX_COLUMNS;

#[test]
fn a_line_without_end_is_refused_before_it_takes_the_memory() {
    let endless = |begin: &str, again: &str| {
        let text = begin.to_owned() + &again.repeat(2 * LINE_BYTES as usize / again.len());
        read_text(&text, &ReadOptions::default()).unwrap_err()
    };
    for (begin, again, line) in [
        ("1,2\n3,", "4,", 2),
        ("1,2\n3,\"", "4\n", LINE_BYTES),
        ("#", "#", 1),
        ("", "x", 1),
        ("", "# nothing\n", 1),
    ] {
        let message = endless(begin, again);
        assert!(message.contains("longer than 4 MiB"), "{begin:?}: {message}");
        let place: Vec<&str> = message.split(':').collect();
        assert!(place[1].parse::<u64>().unwrap() >= line.min(1_000), "{message}");
    }
}

#[test]
fn a_header_again_and_a_last_line_that_is_cut_off_are_told() {
    let end =
        "; it is the last line: where it was cut off, as when a program was killed, `sed '$d'` leaves it out";
    for (text, wanted, is_end) in [
        (
            "t_s,a,b\n0,1,2\n1,3,4\nt_s,a,b\n0,1,2\n",
            ":4: the header stands here again, as where another recording begins; take them apart: `head -n 3` is what is \
             before it, `tail -n +4` the rest",
            false,
        ),
        (
            "t_s,a,b\n0,1,2\n1,3",
            ":3: 2 columns, where the lines before have 3",
            true,
        ),
        (
            "1,2,3\n4,5\n",
            ":2: 2 columns, where the lines before have 3",
            true,
        ),
        (
            "1,2,3\n4,5\n6,7,8\n",
            ":2: 2 columns, where the lines before have 3",
            false,
        ),
        (
            "a,b\n1,2\n3,4e",
            ":3: column 2 is \"4e\", which is not a number",
            true,
        ),
        (
            "a,b\n1,2\n3,4e\n5,6\n",
            ":3: column 2 is \"4e\", which is not a number",
            false,
        ),
        (
            "a,b\n1,2e\n",
            ":2: column 2 is \"2e\", which is not a number",
            false,
        ),
    ] {
        let message = read_text(text, &ReadOptions::default()).unwrap_err();
        assert!(message.contains(wanted), "{text:?}: {message}");
        assert_eq!(message.ends_with(end), is_end, "{text:?}: {message}");
    }
}

#[test]
fn errors_name_the_line() {
    let columns = ReadOptions {
        columns: Some(Columns::XyzBlocks),
        ..Default::default()
    };
    let none = ReadOptions::default();
    for (text, options, wanted) in [
        ("1,2\n3\n", &none, ":2: 1 column, where the lines before have 2"),
        (
            "shape,2,2\n1,2,3,4\n1,2,3,5\n",
            &none,
            ":2: 4 columns, where the lines before have 3",
        ),
        (
            "shape,2,3\n1,2,3,4,5,6\n",
            &none,
            ":2: 6 columns, where the lines before have 3; where the table begins here, cut off what is before it (`tail -n +2`)",
        ),
        (
            "\n2,3\n\n1,2,3,4,5,6\n",
            &none,
            ":4: 6 columns, where the lines before have 2; where the table begins here, cut off what is before it (`tail -n +4`)",
        ),
        (
            "1,2\n1,2\n3,4,5\n",
            &none,
            ":3: 3 columns, where the lines before have 2",
        ),
        (
            "\"a\" \"b\"\n\"1\" 3 4\n",
            &none,
            ":2: 3 columns, where the lines before have 2; where the first has no name, as R's names of rows, give it one",
        ),
        ("1,2\n\n3,x\n", &none, ":3: column 2 is \"x\""),
        ("1,x\n2,3\n", &none, ":1: column 2 is \"x\""),
        ("# c\r\n\r\n1;2\r\n# c\r\n3;x", &none, ":5: column 2 is \"x\""),
        (
            "1;2\n1,5;2\n",
            &none,
            ":2: column 1 is \"1,5\", which is not a number; decimals",
        ),
        (
            "1\n640\n0 472.75 640 38135 851 852 853 854 855 856\n",
            &none,
            ":3: column 1 is \"0 472.75 640 38135 851 852 853 854 855 8..\", which is not a number, but several, which the first \
             line does not separate so; where the table begins here, cut off what is before it (`tail -n +3`)",
        ),
        (
            "a,b,c,label\n1,2,hand\n",
            &none,
            ":2: column 3 is \"hand\", which is not a number; the header has 4 names, and this line 3 cells",
        ),
        ("", &none, ":1: no line"),
        ("a,b\n", &none, ":1: no line"),
        ("0B0X,0B0Y,0B0Z,a\n1,2,3,4\n", &none, ":1: column \"a\""),
        (
            "0B0X,0B0Y,0B0Y\n1,2,3\n",
            &none,
            ":1: column \"0B0Y\" comes twice",
        ),
        ("0B0X,0B0Y\n1,2\n", &none, ":1: taxel 0B0 has no column Z"),
        ("0B0X,0B0Y,0B0Z\n1,2,3\n", &columns, ":1: the header names"),
        (
            "t,a\n-1,2\n",
            &none,
            ":2: -1 is no time from 0 on; take the least from each: in pandas",
        ),
        (
            "timestamp,a\n1581072654214,2\n",
            &none,
            ":2: 1581072654214 is no time in seconds, which a column \"timestamp\" is taken for; say its unit: --time-column ms",
        ),
        ("t,a\n1581072654214000000,2\n", &none, "--time-column ns"),
        (
            "t_s,a\n1700000000000000000,2\n",
            &none,
            ":2: 1700000000000000000 is no time in s; where it is in ns, call the column t_ns, or say --time-column ns",
        ),
        (
            "secs,nsecs,a\n1,2,3\n",
            &none,
            ":1: times are in two columns, \"secs\" and \"nsecs\"",
        ),
        (
            "t,a\n1,\"[2, 3]\"\n",
            &none,
            "a list, which a .csv holds as text; of the table that was written, numpy.savez(",
        ),
        ("0B0X,0B0Y,0B0Z\n1,2,70000\n", &none, "70000"),
        (
            "t,a\n[s],[kPa]\n0,2\n",
            &none,
            ":2: column 1 is \"[s]\", which is not a number; where it is a line of units, leave it out (`sed 2d`)",
        ),
        (
            "t,a\n0,\"1,023\"\n",
            &none,
            "pandas.read_csv(NAME, thousands=\",\")",
        ),
        ("t;a\n0;1,02\n", &none, "; decimals are written with a point"),
        (
            "t,a\n0,0x17\n",
            &none,
            "; it is hexadecimal: in pandas df.NAME.map(",
        ),
        (
            "t,variable,value\n0,s0,1\n0,s1,2\n",
            &none,
            "; where each line has one value of a frame, pandas df.pivot(",
        ),
        (
            "t,hand,a\n0,left,1\n",
            &none,
            "make a file of each: in pandas df[df.NAME == ..]",
        ),
        (
            "t,a\r0,1\r",
            &none,
            "frames.csv:1: its lines end with a carriage return alone; `tr '\\r' '\\n' <",
        ),
        (
            "1,2024-05-01 12:00\n",
            &none,
            "in pandas t = pandas.to_datetime(df[1]); df[1] = (t - t[0]).dt.total_seconds()",
        ),
        (
            "a,b\n1,2024-05-01\n",
            &none,
            "pandas.to_datetime(df.NAME); df.NAME =",
        ),
        ("1,2\n3,nan\n", &none, "frame 1, taxel 1"),
    ] {
        let message = read_text(text, options).unwrap_err();
        assert!(message.contains(wanted), "{text:?}: {message}");
    }
    let wide = "a,".repeat(MAX_COLUMNS) + "a\n";
    let message = read_text(&wide, &none).unwrap_err();
    assert!(
        message.contains(":1: 200001 columns, more than 200000"),
        "{message}"
    );
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("latin.csv");
    std::fs::write(&path, b"1,2\n3,\xff\n").unwrap();
    let message = Recording::open(&path, &none).unwrap_err().to_string();
    assert!(message.contains(":2: not UTF-8"), "{message}");
    let wide: Vec<u8> = "\u{feff}1,2\n"
        .encode_utf16()
        .flat_map(u16::to_le_bytes)
        .collect();
    std::fs::write(&path, wide).unwrap();
    let message = Recording::open(&path, &none).unwrap_err().to_string();
    assert!(
        message.contains(":1: UTF-16 text; `iconv -f utf-16 -t utf-8"),
        "{message}"
    );
}

#[test]
fn of_a_heading_of_keys_and_values_the_line_is_told_at_which_the_table_begins() {
    let heading = "##Session\ndevice,001\nrows,13\nmode,12 bit\n\n##Data\n";
    let table = |rows: usize| "t_s,a,b,c\n".to_owned() + &"0.1,1,2,3\n".repeat(rows);
    for (text, wanted) in [
        (
            format!("{heading}{}", table(1)),
            "line 7: cut off what is before it (`tail -n +7`)",
        ),
        (
            format!("{heading}{}", table(9)),
            "line 7: cut off what is before it (`tail -n +7`)",
        ),
        // A few notes of other widths in it.
        (
            format!("{heading}by,me,at home\nnote,5\n{}", table(9)),
            "line 9: cut off what is before it (`tail -n +9`)",
        ),
        // A table with a column of words, and notes behind it.
        ("label,a\nsoft,1\nhard,2\n".into(), "cut that column out"),
        (
            "label,a\nsoft,1\nhard,2\nmade by,me,today\n".into(),
            "cut that column out",
        ),
    ] {
        let message = super::read_text(&text, &ReadOptions::default()).unwrap_err();
        assert!(message.contains(wanted), "{message}\n{text}");
    }
}

#[test]
fn tables_of_pandas_that_have_several_lines_of_names_or_stand_on_their_side_are_told() {
    let lines = "its columns have 2 lines of names; make one of them: in pandas df.columns = [\"_\".join(map(str, c)) for c in df.columns]";
    let turned = "where lines are taxels, and columns frames, turn the table: in pandas df.T; else cut that column out";
    for (text, wanted) in [
        (
            "finger,thumb,thumb,index,index\ntaxel,0,1,0,1\ntime,,,,\n0.0,1,2,3,4\n0.02,1,2,3,4\n",
            lines,
        ),
        (
            ",thumb,thumb,index,index\n,0,1,0,1\n0,1,2,3,4\n1,1,2,3,4\n",
            lines,
        ),
        (
            ",s0,s0,s0,s1,s1,s1\n,x,y,z,x,y,z\n0,1,2,3,1,2,3\n1,1,2,3,1,2,3\n",
            lines,
        ),
        (
            ",s0,s0,s0,s1,s1,s1\n,x,y,z,x,y,z\nt_s,,,,,,\n0.0,1,2,3,1,2,3\n",
            lines,
        ),
        ("t_s,0.0,0.02,0.04\ns0,1,2,3\ns1,1,2,3\n", turned),
        (",0,1,2\nt_s,0.0,0.02,0.04\ns0,1,2,3\n", turned),
        (",0.0,0.02,0.04\ns0,1,2,3\ns1,1,2,3\n", turned),
    ] {
        let message = read_text(text, &ReadOptions::default()).unwrap_err();
        assert!(message.contains(wanted), "{text:?}: {message}");
    }
    // What is advised is read.
    for text in [
        "time,thumb_0,thumb_1,index_0,index_1\n0.0,1,2,3,4\n0.02,1,2,3,4\n",
        ",s0_x,s0_y,s0_z,s1_x,s1_y,s1_z\n0,1,2,3,1,2,3\n1,1,2,3,1,2,3\n",
    ] {
        assert!(read_text(text, &ReadOptions::default()).is_ok(), "{text:?}");
    }
}
