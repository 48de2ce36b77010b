//! Files that are packed, which are unpacked by another program first.

/// What has packed a file, and what unpacks it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Packed {
    ending: &'static str,
    begin: &'static [u8],
    program: &'static str,
}

const ALL: [Packed; 4] = [
    packed("gz", b"\x1f\x8b", "zcat"),
    packed("bz2", b"BZh", "bzcat"),
    packed("xz", b"\xfd7zXZ\0", "xzcat"),
    packed("zst", b"\x28\xb5\x2f\xfd", "zstdcat"),
];

const fn packed(ending: &'static str, begin: &'static [u8], program: &'static str) -> Packed {
    Packed {
        ending,
        begin,
        program,
    }
}

impl Packed {
    /// By the ending of a file's name, in small letters.
    pub(crate) fn of_ending(ending: &str) -> Option<Self> {
        ALL.into_iter().find(|packed| packed.ending == ending)
    }

    /// By how a file begins.
    pub(crate) fn of_bytes(head: &[u8]) -> Option<Self> {
        let packed = ALL.into_iter().find(|packed| head.starts_with(packed.begin))?;
        // The first column of a table may be called so.
        let is_text = packed.ending == "bz2" && head.get(4..10) != Some(b"1AY&SY");
        (!is_text).then_some(packed)
    }

    /// How a file of this name is read, in words.
    pub fn is_read_by(self, file: &str) -> String {
        let program = self.program;
        format!("`{program} {file} | taxel COMMAND -` reads what is packed in it")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_bytes_tell_what_unpacks_a_file() {
        for (head, program) in [
            (&b"\x1f\x8b\x08\0"[..], Some("zcat")),
            (b"\xfd7zXZ\0\0\x04", Some("xzcat")),
            (b"\x28\xb5\x2f\xfd\x04", Some("zstdcat")),
            (b"BZh91AY&SY\x12", Some("bzcat")),
            (b"BZh,b\n0,1,2\n", None),
            (b"PK\x03\x04....", None),
            (b"", None),
        ] {
            let found = Packed::of_bytes(head).map(|packed| packed.program);
            assert_eq!(found, program, "{}", String::from_utf8_lossy(head));
        }
    }
}
