use super::*;
use crate::candump::any_frame;
use proptest::prelude::*;

/// What python-can 4.6.1 sends for id 0x135, data 01..08, timestamp 1.5.
const FROM_PYTHON: &[u8] = b"\x8b\xa9timestamp\xcb\x3f\xf8\0\0\0\0\0\0\xaearbitration_id\xcd\x01\x35\
    \xaeis_extended_id\xc2\xafis_remote_frame\xc2\xaeis_error_frame\xc2\xa7channel\xc0\xa3dlc\x08\
    \xa4data\xc4\x08\x01\x02\x03\x04\x05\x06\x07\x08\xa5is_fd\xc2\xaebitrate_switch\xc2\
    \xb5error_state_indicator\xc2";

fn written(frame: &CanFrame) -> Vec<u8> {
    encode(frame, 1.5, &mut [0; LARGEST]).unwrap().to_vec()
}

#[test]
fn a_frame_is_byte_for_byte_what_python_can_sends() {
    let frame = CanFrame::standard(0x135, &[1, 2, 3, 4, 5, 6, 7, 8]).unwrap();
    assert_eq!(FROM_PYTHON.len(), 162);
    assert_eq!(written(&frame), FROM_PYTHON);
    assert_eq!(decode(FROM_PYTHON), Ok(frame));
}

#[test]
fn every_cut_of_a_datagram_is_malformed() {
    for len in 0..FROM_PYTHON.len() {
        assert_eq!(
            decode(&FROM_PYTHON[..len]),
            Err(Undecodable::Malformed),
            "{len} bytes"
        );
    }
    assert_eq!(
        decode(&[FROM_PYTHON, b"\0"].concat()),
        Err(Undecodable::Malformed)
    );
}

/// A value of a hand-made datagram.
enum V {
    U(u64),
    I(i64),
    B(bool),
    Nil,
    Bin(&'static [u8]),
    Raw(&'static [u8]),
}

type Entry = (&'static str, V);

fn datagram(entries: &[Entry]) -> Vec<u8> {
    let mut out = Vec::new();
    encode::write_map_len(&mut out, entries.len() as u32).unwrap();
    for (key, value) in entries {
        encode::write_str(&mut out, key).unwrap();
        match value {
            V::U(n) => {
                encode::write_uint(&mut out, *n).unwrap();
            }
            V::I(n) => encode::write_i64(&mut out, *n).unwrap(),
            V::B(b) => encode::write_bool(&mut out, *b).unwrap(),
            V::Nil => encode::write_nil(&mut out).unwrap(),
            V::Bin(b) => encode::write_bin(&mut out, b).unwrap(),
            V::Raw(b) => out.extend_from_slice(b),
        }
    }
    out
}

#[test]
fn a_subset_of_the_keys_takes_python_cans_defaults_for_the_rest() {
    let cases = [
        (datagram(&[]), CanFrame::extended(0, &[]).unwrap()),
        (
            datagram(&[
                ("arbitration_id", V::U(0x20B)),
                ("is_extended_id", V::B(false)),
                ("data", V::Bin(&[7, 0])),
            ]),
            CanFrame::standard(0x20B, &[7, 0]).unwrap(),
        ),
        (
            datagram(&[
                ("data", V::Raw(b"\x92\x01\xcc\xff")),
                ("arbitration_id", V::I(0x1234)),
            ]),
            CanFrame::extended(0x1234, &[1, 255]).unwrap(),
        ),
        (
            datagram(&[
                ("dlc", V::U(3)),
                ("is_remote_frame", V::B(true)),
                ("arbitration_id", V::U(0x10)),
                ("data", V::Nil),
                ("is_extended_id", V::B(false)),
            ]),
            CanFrame::remote(0x10, false, 3).unwrap(),
        ),
        (
            datagram(&[
                ("is_error_frame", V::B(true)),
                ("arbitration_id", V::U(0x240)),
                ("data", V::Bin(&[0, 0, 0, 0, 0, 0, 9])),
                ("dlc", V::Nil),
            ]),
            CanFrame::error(0x240, [0, 0, 0, 0, 0, 0, 9, 0]),
        ),
    ];
    for (bytes, frame) in cases {
        assert_eq!(decode(&bytes), Ok(frame), "{frame}");
    }
}

#[test]
fn unknown_keys_are_skipped_whatever_their_value() {
    let values: &[&[u8]] = &[
        b"\x05",
        b"\xff",
        b"\xc0",
        b"\xc3",
        b"\xca\0\0\0\0",
        b"\xcb\0\0\0\0\0\0\0\0",
        b"\xcc\x01",
        b"\xcd\0\x01",
        b"\xce\0\0\0\x01",
        b"\xcf\0\0\0\0\0\0\0\x01",
        b"\xd0\x01",
        b"\xd1\0\x01",
        b"\xd2\0\0\0\x01",
        b"\xd3\0\0\0\0\0\0\0\x01",
        b"\xa2ab",
        b"\xd9\x02ab",
        b"\xda\0\x02ab",
        b"\xdb\0\0\0\x02ab",
        b"\xc4\x01a",
        b"\xc5\0\x01a",
        b"\xc6\0\0\0\x01a",
        b"\x92\x01\x91\x02",
        b"\xdc\0\x02\x01\x02",
        b"\xdd\0\0\0\x02\x01\x02",
        b"\x81\xa1a\x82\x01\x02\x03\x90",
        b"\xde\0\x01\x01\x02",
        b"\xdf\0\0\0\x01\x01\x02",
        b"\xd4\x01\0",
        b"\xd5\x01\0\0",
        b"\xd6\x01\0\0\0\0",
        b"\xd7\x01\0\0\0\0\0\0\0\0",
        b"\xd8\x01\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0",
        b"\xc7\x01\x05a",
        b"\xc8\0\x01\x05a",
        b"\xc9\0\0\0\x01\x05a",
    ];
    for value in values {
        let bytes = datagram(&[
            ("is_rx", V::Raw(value)),
            ("arbitration_id", V::U(9)),
            ("is_extended_id", V::B(false)),
        ]);
        assert_eq!(
            decode(&bytes),
            Ok(CanFrame::standard(9, &[]).unwrap()),
            "{value:x?}"
        );
        for cut in 0..value.len() {
            let short = [&b"\x81\xa5is_rx"[..], &value[..cut]].concat();
            assert_eq!(decode(&short), Err(Undecodable::Malformed), "{short:x?}");
        }
    }
    // Keys that are no text, even ones that hold other values.
    assert!(decode(b"\x82\x01\x02\x92\x01\x02\xc0").is_ok());
}

#[test]
fn contradictions_are_refused_as_python_can_refuses_them() {
    let bin9: &'static [u8] = &[0; 9];
    let cases: Vec<(&str, Vec<Entry>, Undecodable)> = vec![
        (
            "remote error",
            vec![("is_remote_frame", V::B(true)), ("is_error_frame", V::B(true))],
            Undecodable::Invalid,
        ),
        (
            "remote with data",
            vec![("is_remote_frame", V::B(true)), ("data", V::Bin(&[1]))],
            Undecodable::Invalid,
        ),
        (
            "dlc is not the length",
            vec![("dlc", V::U(3)), ("data", V::Bin(&[1]))],
            Undecodable::Invalid,
        ),
        ("nine bytes", vec![("data", V::Bin(bin9))], Undecodable::Invalid),
        (
            "nine bytes said to be eight",
            vec![("data", V::Bin(bin9)), ("dlc", V::U(8))],
            Undecodable::Invalid,
        ),
        (
            "remote of nine",
            vec![("is_remote_frame", V::B(true)), ("dlc", V::U(9))],
            Undecodable::Invalid,
        ),
        (
            "standard over 7FF",
            vec![("arbitration_id", V::U(0x800)), ("is_extended_id", V::B(false))],
            Undecodable::Invalid,
        ),
        (
            "extended over 1FFFFFFF",
            vec![("arbitration_id", V::U(0x2000_0000))],
            Undecodable::Invalid,
        ),
        (
            "an id of 33 bits",
            vec![("arbitration_id", V::U(0x1_0000_0001))],
            Undecodable::Invalid,
        ),
        (
            "a negative id",
            vec![("arbitration_id", V::I(-1))],
            Undecodable::Invalid,
        ),
        (
            "a number over 255",
            vec![("data", V::Raw(b"\x91\xcd\x01\0"))],
            Undecodable::Invalid,
        ),
        (
            "an id that is nil",
            vec![("arbitration_id", V::Nil)],
            Undecodable::Malformed,
        ),
        (
            "an id that is text",
            vec![("arbitration_id", V::Raw(b"\xa11"))],
            Undecodable::Malformed,
        ),
        (
            "a flag that is 1",
            vec![("is_fd", V::U(1))],
            Undecodable::Malformed,
        ),
        (
            "data that is text",
            vec![("data", V::Raw(b"\xa11"))],
            Undecodable::Malformed,
        ),
        (
            "FD",
            vec![("is_fd", V::B(true)), ("dlc", V::U(64))],
            Undecodable::CanFd,
        ),
    ];
    for (name, entries, error) in cases {
        assert_eq!(decode(&datagram(&entries)), Err(error), "{name}");
    }
    for not_a_map in [&b""[..], b"\xc0", b"\x93\x01\x02\x03", b"hello"] {
        assert_eq!(decode(not_a_map), Err(Undecodable::Malformed));
    }
}

#[test]
fn a_datagram_that_promises_more_than_it_holds_ends_at_once() {
    // A map of 2^32 - 1 entries; a value of 2^32 - 1 arrays, and that again inside it.
    assert_eq!(decode(b"\xdf\xff\xff\xff\xff"), Err(Undecodable::Malformed));
    let mut nested = b"\x81\xa1a".to_vec();
    for _ in 0..800 {
        nested.extend(b"\xdd\xff\xff\xff\xff");
    }
    assert_eq!(decode(&nested), Err(Undecodable::Malformed));
}

proptest! {
    #[test]
    fn every_frame_comes_back_as_it_was(frame in any_frame()) {
        prop_assert_eq!(decode(&written(&frame)), Ok(frame));
    }

    #[test]
    fn random_bytes_are_decoded_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        let _: Result<CanFrame, Undecodable> = decode(&bytes);
    }

    #[test]
    fn a_damaged_datagram_is_decoded_or_refused(damage in proptest::collection::vec((0usize..162, any::<u8>()), 1..8)) {
        let mut bytes = FROM_PYTHON.to_vec();
        for (at, byte) in damage {
            bytes[at] = byte;
        }
        if let Ok(frame) = decode(&bytes) {
            prop_assert!(frame.dlc() <= 8 && frame.id() <= 0x1FFF_FFFF);
        }
    }
}
