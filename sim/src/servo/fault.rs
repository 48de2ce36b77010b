//! What a simulated servo does wrong.

use std::str::FromStr;

/// What a servo does wrong when it answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ServoFault {
    /// Says nothing.
    Silent,
    /// Its CRC is wrong.
    BadCrc,
    /// Its answer ends after so many bytes.
    Truncated {
        /// Bytes that still come.
        bytes: usize,
    },
    /// Its answer comes so much later.
    Late {
        /// By how long, nanoseconds.
        by_ns: u64,
    },
    /// So many random bytes come before its answer.
    Garbage {
        /// How many.
        bytes: usize,
    },
    /// It answers with an error number instead of what it was asked for; what it was told it does.
    Refuse {
        /// Error number, 1 to 127.
        number: u8,
    },
    /// Its answer comes twice, as of two servos with one id; in one packet with others the two spoil each other.
    Twice,
    /// So many random bytes come instead of an answer.
    Noise {
        /// How many.
        bytes: usize,
    },
}

/// As it is written on a command line: `silent`, `bad-crc`, `truncated:BYTES`, `late:MS`, `garbage:BYTES`,
/// `noise:BYTES`, `refuse:NUMBER`, `twice`.
impl FromStr for ServoFault {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let bad = || {
            format!(
                "`{text}` is no fault of a servo; there are silent, bad-crc, truncated:BYTES, late:MS, garbage:BYTES, noise:BYTES, refuse:NUMBER, twice"
            )
        };
        let (name, number) = match text.split_once(':') {
            Some((name, number)) => (name, Some(number.parse::<u32>().map_err(|_| bad())?)),
            None => (text, None),
        };
        Ok(match (name, number) {
            ("silent", None) => ServoFault::Silent,
            ("bad-crc", None) => ServoFault::BadCrc,
            ("twice", None) => ServoFault::Twice,
            ("truncated", Some(n)) => ServoFault::Truncated { bytes: n as usize },
            ("late", Some(ms)) => ServoFault::Late {
                by_ns: u64::from(ms) * 1_000_000,
            },
            ("garbage", Some(n)) if n <= 65_536 => ServoFault::Garbage { bytes: n as usize },
            ("noise", Some(n)) if n <= 65_536 => ServoFault::Noise { bytes: n as usize },
            ("refuse", Some(n @ 1..=127)) => ServoFault::Refuse { number: n as u8 },
            _ => return Err(bad()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_read_as_they_are_written() {
        for (text, fault) in [
            ("silent", Some(ServoFault::Silent)),
            ("bad-crc", Some(ServoFault::BadCrc)),
            ("truncated:9", Some(ServoFault::Truncated { bytes: 9 })),
            ("late:12", Some(ServoFault::Late { by_ns: 12_000_000 })),
            ("garbage:3", Some(ServoFault::Garbage { bytes: 3 })),
            ("noise:400", Some(ServoFault::Noise { bytes: 400 })),
            ("refuse:2", Some(ServoFault::Refuse { number: 2 })),
            ("twice", Some(ServoFault::Twice)),
            ("twice:2", None),
            ("refuse:128", None),
            ("noise", None),
            ("noise:4000000000", None),
            ("silent:1", None),
            ("", None),
        ] {
            assert_eq!(text.parse().ok(), fault, "{text}");
        }
    }
}
