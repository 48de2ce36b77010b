//! What stands before a table in its file: lines of a key and a value, as loggers write them.

use super::columns::cell;
use super::lines::Lines;
use csv::ByteRecord;
use std::path::Path;

/// Lines that are looked at.
const LINES: usize = 1000;
/// Lines of one width, the names of its columns among them, that are a table; of a shorter one as many as there are.
const TABLE: usize = 4;

/// The line at which a table wider than `width` seems to begin in a file; `None` where none does, and for what is no file.
pub(super) fn table_begin(path: &Path, delimiter: u8, width: usize) -> Option<u64> {
    let mut lines = Lines::of_file(path, delimiter).ok()??;
    // Where lines of one width began, how wide they are, and how many there were.
    let (mut begin, mut columns, mut count) = (0, 0, 0);
    for _ in 0..LINES {
        if !lines.read().ok()? {
            return (count > 1).then_some(begin);
        }
        let record = &lines.record;
        if record.len() <= width || record.len() == columns && !has_number(record) {
            (columns, count) = (0, 0);
        } else if record.len() == columns {
            count += 1;
        } else {
            (begin, columns, count) = (lines.number, record.len(), 1);
        }
        if count == TABLE {
            return Some(begin);
        }
    }
    None
}

/// Whether any cell of a line is a number.
pub(super) fn has_number(record: &ByteRecord) -> bool {
    let is_number = |bytes| cell(bytes).is_ok_and(|cell| cell.parse::<f64>().is_ok());
    record.iter().any(is_number)
}
