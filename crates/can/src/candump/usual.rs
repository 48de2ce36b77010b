//! Lines as `candump -l` writes them, which nearly all are, read without looking at each byte for what else it may be.

use super::line::Line;
use crate::{CanFrame, EXTENDED_FLAG};

/// Bytes of `(1436509052.249713) `.
const TIME_LEN: usize = 20;
/// What of [`DIGITS`] is no hexadecimal digit.
const NO_DIGIT: u8 = 0xF0;
/// The value of each hexadecimal digit.
const DIGITS: [u8; 256] = {
    let mut digits = [NO_DIGIT; 256];
    let mut value = 0;
    while value < 16 {
        digits[b"0123456789ABCDEF"[value] as usize] = value as u8;
        digits[b"0123456789abcdef"[value] as usize] = value as u8;
        value += 1;
    }
    digits
};

/// Reads `(SECONDS.MICROSECONDS) INTERFACE ID#DATA` with ten digits of seconds, six of microseconds and single blanks. None
/// of everything else, which may be a frame all the same.
pub(super) fn parse_usual(bytes: &[u8]) -> Option<Line<'_>> {
    let (time, rest) = bytes.split_first_chunk::<TIME_LEN>()?;
    let microseconds = microseconds(time)?;
    let (interface, frame) = split_word(rest)?;
    let hash = match frame {
        [_, _, _, b'#', ..] => 3,
        [_, _, _, _, _, _, _, _, b'#', ..] => 8,
        _ => return None,
    };
    let (mut id, mut seen) = (0, 0);
    for byte in &frame[..hash] {
        let digit = DIGITS[usize::from(*byte)];
        seen |= digit;
        id = id << 4 | u32::from(digit & 0xF);
    }
    let raw_id = match hash {
        3 if id <= 0x7FF => id,
        8 if id <= 0x1FFF_FFFF => id | EXTENDED_FLAG,
        _ => return None,
    };
    let (pairs, rest) = frame[hash + 1..].as_chunks::<2>();
    if pairs.len() > 8 || !rest.is_empty() {
        return None;
    }
    let mut data = [0; 8];
    for (byte, [high, low]) in data.iter_mut().zip(pairs) {
        let digits = [DIGITS[usize::from(*high)], DIGITS[usize::from(*low)]];
        seen |= digits[0] | digits[1];
        *byte = digits[0] << 4 | digits[1];
    }
    if seen & NO_DIGIT != 0 {
        return None;
    }
    Some(Line {
        t_ns: Some(microseconds * 1000),
        interface,
        frame: CanFrame::from_raw(raw_id, &data[..pairs.len()]).ok()?,
        direction: None,
    })
}

/// The interface of a line that begins with a time as above.
pub(super) fn interface_of_usual(bytes: &[u8]) -> Option<&[u8]> {
    let (time, rest) = bytes.split_first_chunk::<TIME_LEN>()?;
    ([time[0], time[11], time[18], time[19]] == *b"(.) ").then(|| split_word(rest).map(|(word, _)| word))?
}

/// What stands before the first blank, and behind it.
fn split_word(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let len = bytes.iter().position(|byte| *byte <= b' ')?;
    (len > 0 && bytes[len] == b' ').then(|| (&bytes[..len], &bytes[len + 1..]))
}

/// The microseconds that `(1436509052.249713) ` stands for.
fn microseconds(time: &[u8; TIME_LEN]) -> Option<u64> {
    let [
        b'(',
        a,
        b,
        c,
        d,
        e,
        f,
        g,
        h,
        i,
        j,
        b'.',
        k,
        l,
        m,
        n,
        o,
        p,
        b')',
        b' ',
    ] = *time
    else {
        return None;
    };
    let (high, low) = (
        eight_digits([a, b, c, d, e, f, g, h])?,
        eight_digits([i, j, k, l, m, n, o, p])?,
    );
    Some(high * 100_000_000 + low)
}

/// The number that eight decimal digits stand for, all of them taken at once.
fn eight_digits(text: [u8; 8]) -> Option<u64> {
    let digits = u64::from_le_bytes(text) ^ u64::from_ne_bytes([b'0'; 8]);
    // Neither over 127, nor over 9, which 118 more brings over 127.
    let over = digits | digits.wrapping_add(u64::from_ne_bytes([118; 8]));
    if over & u64::from_ne_bytes([128; 8]) != 0 {
        return None;
    }
    let pairs = (digits * 10 + (digits >> 8)) & 0x00FF_00FF_00FF_00FF;
    let fours = (pairs * 100 + (pairs >> 16)) & 0x0000_FFFF_0000_FFFF;
    Some((fours * 10_000 + (fours >> 32)) & 0xFFFF_FFFF)
}

#[cfg(test)]
mod tests {
    use super::super::line::parse_line;
    use super::*;
    use proptest::prelude::*;

    /// Whatever it takes for a frame is the frame that reading byte by byte finds.
    fn agrees(line: &[u8]) -> bool {
        let Some(usual) = parse_usual(line) else {
            return false;
        };
        let text = line.escape_ascii();
        let read = parse_line(line)
            .unwrap_or_else(|problem| panic!("{text}: {problem:?}"))
            .unwrap_or_else(|| panic!("{text}: empty"));
        assert_eq!(
            (usual.t_ns, usual.interface, usual.frame, usual.direction),
            (read.t_ns, read.interface, read.frame, read.direction),
            "{text}"
        );
        assert_eq!(interface_of_usual(line), Some(read.interface), "{text}");
        true
    }

    #[test]
    fn what_candump_logs_is_read_here_and_the_rest_is_left_to_others() {
        for frame in ["044#2A366C2BBA", "7FF#", "1FFFFFFF#0102030405060708", "044#2a"] {
            assert!(
                agrees(format!("(1436509052.249713) vcan0 {frame}").as_bytes()),
                "{frame}"
            );
        }
        for frame in [
            "800#",
            "20000080#00",
            "123#R4",
            "123##1A0B",
            "044#2A.36",
            "044#2",
            "044#2G",
            "044#01 R",
            "044#01\r",
        ] {
            assert!(
                !agrees(format!("(1436509052.249713) vcan0 {frame}").as_bytes()),
                "{frame}"
            );
        }
        for line in [
            "(1436509052.2497130) vcan0 044#",
            "(143650905.2497133) vcan0 044#",
            "(1436509052.249713)  can0 044#",
            "(1436509052.24971x) can0 044#",
            "(1436509052.249713) can0\t044#",
            "(1436509052.249713) can0",
            "",
        ] {
            assert!(!agrees(line.as_bytes()), "{line}");
        }
    }

    #[test]
    fn no_byte_makes_it_another_frame_than_it_is() {
        let line = b"(1436509052.249713) vcan0 0000012A#01020304CDeFabF9";
        let taken = (0..line.len()).flat_map(|at| (0..=255).map(move |byte| (at, byte)));
        let taken = taken.filter(|(at, byte)| {
            let mut line = *line;
            line[*at] = *byte;
            agrees(&line)
        });
        // Ten for each decimal digit, 22 for each hexadecimal one but the first of the id, all but blanks in the name.
        assert_eq!(taken.count(), 16 * 10 + 23 * 22 + 2 + 5 * 223 + 6);
    }

    proptest! {
        #[test]
        fn damage_makes_it_no_other_frame_than_it_is(damage in proptest::collection::vec((0usize..48, any::<u8>()), 0..3)) {
            let mut line = b"(1436509052.249713) vcan0 00000123#0102030405ABCD".to_vec();
            for (at, byte) in damage {
                line[at] = byte;
            }
            agrees(&line);
        }
    }
}
