//! Text files that people write, read into memory.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Most bytes of a layout, configuration or scene; a layout of 65,535 taxels with a place each has two million.
const MOST_BYTES: u64 = 4 << 20;

/// The text of a layout, configuration or scene file. More than 4 MiB are refused before they are parsed, which takes a
/// hundred times their memory.
pub fn read_text_file(path: &Path) -> io::Result<String> {
    let mut bytes = Vec::new();
    File::open(path)?.take(MOST_BYTES + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > MOST_BYTES {
        let reason = format!(
            "longer than {} MiB; this is no text that somebody wrote",
            MOST_BYTES >> 20
        );
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, reason));
    }
    String::from_utf8(bytes).map_err(|_| io::Error::new(io::ErrorKind::InvalidData, "not UTF-8 text"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_without_an_end_is_refused() {
        let error = read_text_file(Path::new("/dev/zero")).unwrap_err().to_string();
        assert!(error.contains("longer than 4 MiB"), "{error}");
    }
}
