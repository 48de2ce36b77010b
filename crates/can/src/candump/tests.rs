use super::error::LONGEST_LINE;
use super::line::parse_line;
use super::*;
use crate::CanFrame;
use proptest::prelude::*;
use std::io;

fn read(text: &[u8]) -> Vec<Result<LogFrame, LogError>> {
    LogReader::new(text).collect()
}

fn read_one(line: &str) -> LogFrame {
    let mut frames = read(line.as_bytes());
    assert_eq!(frames.len(), 1, "{line}");
    frames.remove(0).unwrap_or_else(|e| panic!("{line}: {e}"))
}

fn problem(line: &[u8]) -> (usize, LineProblem) {
    match read(line).remove(0) {
        Err(LogError::Line { column, problem, .. }) => (column, problem),
        other => panic!("{}: {other:?}", line.escape_ascii()),
    }
}

#[test]
fn every_dialect_of_a_frame_is_read() {
    let standard = |id, data: &[u8]| CanFrame::standard(id, data).unwrap();
    let extended = |id, data: &[u8]| CanFrame::extended(id, data).unwrap();
    let remote = |id, ext, len| CanFrame::remote(id, ext, len).unwrap();
    let eight = [1, 2, 3, 4, 5, 6, 7, 8];
    let cases = [
        ("044#2A366C2BBA", standard(0x44, &[0x2A, 0x36, 0x6C, 0x2B, 0xBA])),
        ("044#2a366c2bba", standard(0x44, &[0x2A, 0x36, 0x6C, 0x2B, 0xBA])),
        ("044#2A.36.6C", standard(0x44, &[0x2A, 0x36, 0x6C])),
        ("7FF#", standard(0x7FF, &[])),
        ("00000044#01", extended(0x44, &[1])),
        ("1FFFFFFF#0102030405060708", extended(0x1FFF_FFFF, &eight)),
        ("123#0102030405060708_E", standard(0x123, &eight)),
        ("123#01.02.03.04.05.06.07.08_9", standard(0x123, &eight)),
        ("123#R", remote(0x123, false, 0)),
        ("123#R4", remote(0x123, false, 4)),
        ("123#r8", remote(0x123, false, 8)),
        ("123#R8_F", remote(0x123, false, 8)),
        ("00000123#R2", remote(0x123, true, 2)),
        ("20000080#0000000000000000", CanFrame::error(0x80, [0; 8])),
        (
            "20000240#0000000000000908",
            CanFrame::error(0x240, [0, 0, 0, 0, 0, 0, 9, 8]),
        ),
        ("20000004#0001", CanFrame::error(4, [0, 1, 0, 0, 0, 0, 0, 0])),
    ];
    for (text, frame) in cases {
        let endings = [
            ("", None),
            ("\r\n", None),
            (" \n", None),
            (" R\n", Some(Direction::Received)),
            (" T\r\n", Some(Direction::Transmitted)),
        ];
        for (ending, direction) in endings {
            let line = format!("(1436509052.249713) vcan0 {text}{ending}");
            let expected = LogFrame {
                t_ns: 1_436_509_052_249_713_000,
                interface: "vcan0".into(),
                frame,
                direction,
            };
            assert_eq!(read_one(&line), expected, "{line}");
        }
    }
}

#[test]
fn what_candump_shows_on_the_screen_is_read_as_well() {
    let frame = |id, data: &[u8]| CanFrame::standard(id, data).unwrap();
    let cases = [
        (
            "  can0  044   [5]  2A 36 6C 2B BA",
            frame(0x44, &[0x2A, 0x36, 0x6C, 0x2B, 0xBA]),
        ),
        ("  can0       044   [2]  2a 36   '*6'", frame(0x44, &[0x2A, 0x36])),
        ("  can0  7FF   [0] ", frame(0x7FF, &[])),
        (
            "  can0  00000044   [1]  01",
            CanFrame::extended(0x44, &[1]).unwrap(),
        ),
        (
            "  can0  123   [4]  remote request",
            CanFrame::remote(0x123, false, 4).unwrap(),
        ),
        (
            "  can0  20000080   [8]  00 00 00 00 00 00 00 00   ERRORFRAME",
            CanFrame::error(0x80, [0; 8]),
        ),
    ];
    for (text, frame) in cases {
        let got = read_one(&format!(" (1436509052.249713){text}"));
        assert_eq!(
            (got.t_ns, got.frame),
            (1_436_509_052_249_713_000, frame),
            "{text}"
        );
        assert_eq!(&*read_one(text).interface, "can0", "{text}");
        assert_eq!(read_one(text).frame, frame, "{text}");
    }
    for (text, column) in [
        ("(1.0)  can0  123   [9]  00", 21),
        ("(1.0)  can0  123   [2]  00", 27),
        ("(1.0)  can0  123   [2]  00 0", 28),
        ("(1.0)  can0  123   [1]  001", 25),
    ] {
        assert_eq!(problem(text.as_bytes()).0, column, "{text}");
    }
    assert_eq!(
        problem(b"  can0  123  [64]  00").1.to_string(),
        "expected `(` before the time, found `c`"
    );
    assert_eq!(problem(b"(1.0) can0  123  [64]  00").1, LineProblem::CanFd);
}

#[test]
fn each_shown_byte_is_two_digits_and_there_are_as_many_as_the_length_says() {
    for text in [
        "can0  621   [8]  1000 0011 10 00 00 00 00 00",
        "can0  621   [2]  1 0 0 0",
        "can0  621   [2]  10 00 00",
        "can0  621   [2]  1000 ",
        "can0  621   [1]  100",
    ] {
        assert!(parse_line(format!("(1.0)  {text}").as_bytes()).is_err(), "{text}");
        assert!(parse_line(text.as_bytes()).is_err(), "{text}");
    }
}

#[test]
fn what_options_of_candump_change_on_the_screen_is_read_or_refused_by_name() {
    let bits = "10000011 10000000 00000000 00000000 00000000 00000000 00000000 00000001";
    for (text, option) in [
        (format!("can0  621   [8]  {bits}"), "-i"),
        (format!("(1.5)  can0  621   [8]  {bits}   '...'"), "-i"),
        ("(1.5)  can0  621   [1]  10000011".into(), "-i"),
        ("  can0  621   [2]  22`11".into(), "-S"),
        ("(1.5)  can0  621   {F}  11 22 33 44 55 66 77 88".into(), "-8"),
        ("(2026-11-23 10:00:00.123456)  can0  621   [1]  01".into(), "-tA"),
    ] {
        let said = problem(text.as_bytes()).1.to_string();
        assert!(said.starts_with(&format!("`candump {option}` shows ")), "{said}");
        assert!(said.ends_with("; record with `candump -l`"), "{said}");
    }
    let one = CanFrame::standard(0x123, &[1]).unwrap();
    for (text, direction) in [
        ("  can0  RX - -  123   [1]  01", Some(Direction::Received)),
        (
            "(1.5)  can0  TX B E  123   [1]  01   '.'",
            Some(Direction::Transmitted),
        ),
        (" (1.5)  \x1b[1m\x1b[31mcan0\x1b[0m  123   [1]  01", None),
        (" \x1b[34mcan0  123   [1]  01\x1b[0m\r\n", None),
    ] {
        let read = read_one(text);
        assert_eq!((read.frame, read.direction), (one, direction), "{text}");
        assert_eq!(&*read.interface, "can0", "{text}");
    }
}

#[test]
fn differences_of_times_are_refused_and_times_are_not() {
    let read = |times: &[f64]| {
        let line = |time| format!(" ({time:010.6})  can0  123   [1]  01\n");
        let text: String = times.iter().map(line).collect();
        LogReader::new(text.as_bytes()).collect::<Result<Vec<_>, _>>()
    };
    let bursts = [0.000041, 0.000050, 0.000043, 0.033].repeat(9);
    let error = read(&bursts).unwrap_err().to_string();
    assert!(error.starts_with("after line 13: "), "{error}");
    assert!(error.contains("`candump -td`"), "{error}");
    let mut since_first: Vec<f64> = bursts;
    for n in 1..since_first.len() {
        since_first[n] += since_first[n - 1];
    }
    assert_eq!(read(&since_first).unwrap().len(), 36);
    let overtaken = [0.0, 0.1, 0.2, 0.199_99, 0.3, 0.4, 0.399_99, 0.5, 0.499_9];
    assert_eq!(read(&overtaken).unwrap().len(), 9);
}

#[test]
fn frames_without_a_time_follow_each_other_as_on_a_full_bus() {
    let line = "can0  044   [8]  00 11 22 33 44 55 66 77\n";
    let text = line.repeat(3);
    let mut reader = LogReader::new(text.as_bytes());
    let times: Vec<u64> = reader.by_ref().map(|frame| frame.unwrap().t_ns).collect();
    let bits = u64::from(read_one(line).frame.bits());
    assert_eq!(times, [1, 2, 3].map(|n| n * bits * 1000));
    assert_eq!(reader.without_time(), 3);
}

#[test]
fn a_time_may_have_any_number_of_digits() {
    let cases = [
        ("1436509052.249713", 1_436_509_052_249_713_000),
        ("1436509052.249713123", 1_436_509_052_249_713_123),
        ("1436509052.2497131239", 1_436_509_052_249_713_123),
        ("000.000001", 1_000),
        ("0.5", 500_000_000),
        ("12", 12_000_000_000),
        (" 7.25", 7_250_000_000),
        ("18446744073.709551615", u64::MAX),
    ];
    for (time, t_ns) in cases {
        assert_eq!(read_one(&format!("({time}) can0 001#")).t_ns, t_ns, "{time}");
    }
}

#[test]
fn an_error_names_the_column_and_what_was_expected() {
    let cases = [
        ("1.0 can0 001#", 1, "expected `(` before the time, found `1`"),
        ("() can0 001#", 2, "expected the seconds of the time, found `)`"),
        ("(-1.0) can0 001#", 2, "the seconds"),
        ("(1.) can0 001#", 4, "digits after the decimal point"),
        ("(1.0 can0 001#", 5, "expected `)` after the time, found ` `"),
        ("(1.0e3) can0 001#", 5, "expected `)` after the time, found `e`"),
        ("(18446744073.709551616) can0 001#", 2, "does not fit"),
        ("(99999999999999999999999) can0 001#", 2, "does not fit"),
        ("(1.0)can0 001#", 6, "a blank after the time"),
        ("(1.0) ", 7, "an interface name, found the end of the line"),
        ("(1.0) can0", 11, "a blank after the interface"),
        ("(1.0) can0 ", 12, "a CAN id of 3 or 8"),
        ("(1.0) can0 01#", 14, "a CAN id of 3 or 8"),
        ("(1.0) can0 0001#", 16, "a CAN id of 3 or 8"),
        ("(1.0) can0 000000001#", 20, "`#` after the CAN id"),
        ("(1.0) can0 800#", 12, "CAN id 800 is too large"),
        ("(1.0) can0 80000001#", 12, "CAN id 80000001 is too large"),
        ("(1.0) can0 001 01", 15, "expected `#`"),
        ("(1.0) can0 001#1", 17, "the second hexadecimal digit"),
        (
            "(1.0) can0 001#0G",
            17,
            "the second hexadecimal digit of a data byte, found `G`",
        ),
        ("(1.0) can0 001#010203040506070809", 32, "up to 8 data bytes"),
        ("(1.0) can0 001#01_9", 18, "up to 8 data bytes"),
        ("(1.0) can0 001#0102030405060708_8", 34, "a raw length code"),
        ("(1.0) can0 001#R9", 17, "a length of 0 to 8"),
        ("(1.0) can0 001#R44", 18, "a length of 0 to 8"),
        (
            "(1.0) can0 20000001#R",
            21,
            "an error frame cannot be a remote frame",
        ),
        ("(1.0) can0 001#01 X", 19, "expected `R`, `T` or the end"),
        (
            "(1.0) can0 001#01 R R",
            21,
            "expected the end of the line, found `R`",
        ),
        ("\u{1}", 1, "found `\\x01`"),
    ];
    for (line, column, says) in cases {
        let (at, problem) = problem(line.as_bytes());
        assert!(problem.to_string().contains(says), "{line}: {problem}");
        assert!(
            !matches!(problem, LineProblem::CanFd | LineProblem::CanXl),
            "{line}"
        );
        assert_eq!(at, column, "{line}: {problem}");
    }
}

#[test]
fn fd_and_xl_frames_are_told_from_nonsense() {
    let fd = problem(b"(1.0) can0 123##1A0B0C0D\n");
    assert_eq!(fd, (16, LineProblem::CanFd));
    let xl = problem(b"(1.0) can0 242:00:00#81:00:00000242#3A3A\n");
    assert_eq!(xl, (12, LineProblem::CanXl));
}

#[test]
fn reading_goes_on_after_a_bad_line_and_keeps_count_of_lines() {
    let text = b"\n(1.0) can0 001#01\r\n   \nnonsense\n(1.1) can0 123##1A0B\n(1.2) can1 002#";
    let results = read(text);
    let lines: Vec<String> = results
        .iter()
        .map(|r| match r {
            Ok(f) => format!("{} {}", f.interface, f.frame),
            Err(e) => e.to_string(),
        })
        .collect();
    assert_eq!(
        lines,
        [
            "can0 001#01",
            "line 4, column 1: expected `(` before the time, found `n`",
            "line 5, column 16: a CAN FD frame; only classic CAN is supported",
            "can1 002#",
        ]
    );
}

#[test]
fn what_an_editor_puts_before_the_first_line_costs_no_frame() {
    let frames = |text: &[u8]| -> Vec<Option<String>> {
        let frame = |read: &Result<LogFrame, LogError>| read.as_ref().ok().map(|read| read.frame.to_string());
        read(text).iter().map(frame).collect()
    };
    let there = |frame: &str| Some(frame.to_owned());
    assert_eq!(
        frames(b"\xEF\xBB\xBF(1.0) can0 001#01\n(1.1) can0 002#\n"),
        [there("001#01"), there("002#")]
    );
    // Elsewhere it is what it is.
    assert_eq!(
        frames(b"(1.0) can0 001#01\n\xEF\xBB\xBF(1.1) can0 002#\n"),
        [there("001#01"), None]
    );
}

#[test]
fn an_endless_line_is_one_error_and_no_memory() {
    let mut text = vec![b'x'; 50_000_000];
    text.extend(b"\n(1.0) can0 001#01\n");
    let mut reader = LogReader::new(&text[..]);
    let first = reader.next().unwrap().unwrap_err().to_string();
    assert!(
        first.starts_with("line 1, column 16385: longer than 16384 bytes"),
        "{first}"
    );
    assert!(reader.line.capacity() <= 2 * LONGEST_LINE);
    assert!(reader.next().unwrap().is_ok());
    assert!(reader.next().is_none());
}

#[test]
fn a_file_without_an_end_or_a_frame_is_given_up() {
    let blank_lines = format!("{:63}\n", "").repeat(2 << 20).into_bytes();
    let files: [Box<dyn io::Read>; 2] = [Box::new(io::repeat(0)), Box::new(io::Cursor::new(blank_lines))];
    for file in files {
        let mut reader = LogReader::new(io::BufReader::with_capacity(1 << 16, file));
        let last = reader.by_ref().last().unwrap().unwrap_err().to_string();
        assert!(
            last.ends_with("64 MiB without a CAN frame; this is no candump log"),
            "{last}"
        );
        assert!(reader.next().is_none());
    }
    // As much of it is passed over where frames are in between.
    let mut text = Vec::new();
    for _ in 0..3 {
        text.resize(text.len() + (30 << 20), 0);
        text.extend(b"\n(1.0) can0 001#01\n");
    }
    assert_eq!(LogReader::new(&text[..]).filter(Result::is_ok).count(), 3);
}

#[test]
fn an_interface_name_that_is_no_utf8_is_kept_readable() {
    let frame = read(b"(1.0) c\xE4n0 001#01\n").remove(0).unwrap();
    assert_eq!(&*frame.interface, "c\u{FFFD}n0");
}

#[test]
fn a_failing_file_ends_the_reading_with_its_error() {
    struct Failing;
    impl io::Read for Failing {
        fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
            Err(io::Error::other("pulled out"))
        }
    }
    let mut reader = LogReader::new(io::BufReader::new(io::Read::chain(
        &b"(1.0) can0 001#\n"[..],
        Failing,
    )));
    assert!(reader.next().unwrap().is_ok());
    assert_eq!(
        reader.next().unwrap().unwrap_err().to_string(),
        "after line 1: pulled out"
    );
    assert!(reader.next().is_none());
}

#[test]
fn the_writer_writes_what_every_reader_understands() {
    let mut writer = LogWriter::new(Vec::new());
    let frame = CanFrame::standard(0x44, &[0x2A]).unwrap();
    writer.write(1_436_509_052_249_713_999, "vcan0", &frame).unwrap();
    writer
        .write(5, "can1", &CanFrame::remote(0x1, true, 3).unwrap())
        .unwrap();
    for name in ["", "a b", "a\n"] {
        let error = writer.write(5, name, &frame).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::InvalidInput);
    }
    writer.flush().unwrap();
    let text = String::from_utf8(writer.into_inner()).unwrap();
    assert_eq!(
        text,
        "(1436509052.249713) vcan0 044#2A\n(0000000000.000000) can1 00000001#R3\n"
    );
}

/// Any frame at all.
pub(crate) fn any_frame() -> impl Strategy<Value = CanFrame> {
    let data = proptest::collection::vec(any::<u8>(), 0..=8);
    prop_oneof![
        (0u16..=0x7FF, data.clone()).prop_map(|(id, data)| CanFrame::standard(id, &data).unwrap()),
        (0u32..=0x1FFF_FFFF, data).prop_map(|(id, data)| CanFrame::extended(id, &data).unwrap()),
        (0u32..=0x7FF, 0u8..=8).prop_map(|(id, len)| CanFrame::remote(id, false, len).unwrap()),
        (0u32..=0x1FFF_FFFF, 0u8..=8).prop_map(|(id, len)| CanFrame::remote(id, true, len).unwrap()),
        (0u32..=0x1FFF_FFFF, any::<[u8; 8]>()).prop_map(|(class, data)| CanFrame::error(class, data)),
    ]
}

proptest! {
    #[test]
    fn what_is_written_reads_back_to_the_microsecond(t_ns: u64, frame in any_frame()) {
        let mut writer = LogWriter::new(Vec::new());
        writer.write(t_ns, "can0", &frame).unwrap();
        let back = read(&writer.into_inner()).remove(0).unwrap();
        prop_assert_eq!(back.t_ns, t_ns / 1000 * 1000);
        prop_assert_eq!(back.frame, frame);
        prop_assert_eq!(back.direction, None);
    }

    #[test]
    fn each_line_gives_at_most_one_result_whatever_its_bytes(
        text in proptest::collection::vec(any::<u8>(), 0..200)
    ) {
        let lines = text.split(|b| *b == b'\n').count();
        prop_assert!(read(&text).len() <= lines);
    }

    /// Bytes that look enough like a log to get deep into the parser.
    #[test]
    fn a_damaged_log_never_stops_the_reader(
        damage in proptest::collection::vec((0usize..120, any::<u8>()), 1..6)
    ) {
        let mut text = b"(1436509052.249713) vcan0 123#0102030405060708_E R\n\
            (1436509052.249713) vcan0 00000123#R4\n(1.5) can1 20000080#00 T\n".to_vec();
        for (at, byte) in damage {
            let at = at % text.len();
            text[at] = byte;
        }
        let lines = text.split(|b| *b == b'\n').count();
        prop_assert!(read(&text).len() <= lines);
    }
}
