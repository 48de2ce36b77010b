//! Which kind of recording a file is.

use crate::packed::Packed;
use std::path::Path;

/// What kind of recording a file is, which the ending of its name tells, in small letters or capitals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    /// One array of numpy.
    Npy,
    /// Several arrays of numpy.
    Npz,
    /// A frame a line.
    Csv,
    /// CAN traffic as candump writes it.
    Log,
    /// What `taxel record` writes.
    Mcap,
}

/// What a file's name ends in behind the dot, in small letters; empty where there is none.
pub fn ending_of(path: &Path) -> String {
    let ending = path.extension().and_then(|ending| ending.to_str());
    ending.unwrap_or_default().to_ascii_lowercase()
}

impl FileKind {
    const ALL: [Self; 5] = [Self::Log, Self::Mcap, Self::Csv, Self::Npy, Self::Npz];

    /// All endings, in words.
    pub const ENDINGS: &str = ".log, .mcap, .csv, .npy or .npz";

    /// The kind of a file; `None` where its name ends otherwise.
    pub fn of(path: &Path) -> Option<Self> {
        let ending = ending_of(path);
        Self::ALL.into_iter().find(|kind| kind.ending() == ending)
    }

    /// What its name ends in, behind the dot.
    pub const fn ending(self) -> &'static str {
        match self {
            Self::Npy => "npy",
            Self::Npz => "npz",
            Self::Csv => "csv",
            Self::Log => "log",
            Self::Mcap => "mcap",
        }
    }

    /// The kind of a file that begins so, some thousand bytes of it, whatever its name.
    ///
    /// # Errors
    /// Where it is packed: by what.
    pub fn of_bytes(head: &[u8]) -> Result<Self, Packed> {
        const MAGIC: [(&[u8], FileKind); 3] = [
            (b"\x89MCAP", FileKind::Mcap),
            (b"\x93NUMPY", FileKind::Npy),
            (b"PK\x03\x04", FileKind::Npz),
        ];
        if let Some(packed) = Packed::of_bytes(head) {
            return Err(packed);
        }
        if let Some((_, kind)) = MAGIC.iter().find(|(magic, _)| head.starts_with(magic)) {
            return Ok(*kind);
        }
        let text = String::from_utf8_lossy(head);
        let mut lines = text.lines().map(str::trim);
        let line = lines.find(|line| !line.is_empty()).unwrap_or_default();
        // `(1.5) can0 123#00`, or candump's own `  can0  123   [1]  00`, in colours or with ` RX - -` before the id.
        let mut words = line.split_whitespace().take(6);
        let is_candump = line.starts_with(['(', '\x1b']) || words.any(|word| word.starts_with(['[', '{']));
        Ok(match is_candump {
            true => Self::Log,
            false => Self::Csv,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_bytes_tell_the_kind_of_a_recording() {
        for (head, ending) in [
            (&b"\x89MCAP0\r\n"[..], "mcap"),
            (b"\x93NUMPY\x01\x00", "npy"),
            (b"PK\x03\x04....", "npz"),
            (b"(1436509052.249713) vcan0 044#2A366C2BBA\n", "log"),
            (b"\n  vcan0  044   [5]  2A 36 6C 2B BA\n", "log"),
            (b" (000.000041)  vcan0  044   [1]  2A\n", "log"),
            (b"  vcan0  RX - -  044   [1]  2A\n", "log"),
            (b"  \x1b[31mvcan0\x1b[0m  044   [1]  2A\n", "log"),
            (b"t,a,b\n0,1,2\n", "csv"),
            (b"1;2;3\n", "csv"),
            (b"", "csv"),
        ] {
            let kind = FileKind::of_bytes(head).unwrap();
            assert_eq!(kind.ending(), ending, "{}", String::from_utf8_lossy(head));
        }
    }
}
