//! The lines of a table, cut into cells.

use crate::error::RecordError;
use csv::{ByteRecord, Reader, ReaderBuilder, Terminator};
use std::fs::File;
use std::io::{self, BufRead, BufReader, Chain, Read, Take};
use std::path::Path;

/// Bytes that one line may have: 20 for each of 200,000 numbers.
pub(super) const LINE_BYTES: u64 = 4 << 20;
/// Columns that a line may have: three axes of as many taxels as a hand can have, and room for times and joints.
pub(super) const MAX_COLUMNS: usize = 200_000;

pub(super) fn unreadable(path: &Path, line: u64, reason: String) -> RecordError {
    RecordError::unreadable(format_args!("{}:{line}", path.display()), reason)
}

/// The lines of a file that say something, cut into cells.
pub(super) struct Lines<'a, R> {
    path: &'a Path,
    reader: Reader<Take<EmptyCells<R>>>,
    delimiter: u8,
    /// The newest line.
    pub(super) record: ByteRecord,
    /// Its number, from 1 on.
    pub(super) number: u64,
}

impl<'a> Lines<'a, Chain<BufReader<File>, &'static [u8]>> {
    /// Those of a file, to be looked at beside what is read; none of what is no file, and can be read only once.
    pub(super) fn of_file(path: &'a Path, delimiter: u8) -> io::Result<Option<Self>> {
        if !path.is_file() {
            return Ok(None);
        }
        let file = BufReader::new(File::open(path)?);
        Ok(Some(Self::new(path, file.chain(b"\n"), delimiter)))
    }
}

impl<'a, R: BufRead> Lines<'a, R> {
    pub(super) fn new(path: &'a Path, whole: R, delimiter: u8) -> Self {
        let reader = ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .delimiter(delimiter)
            .comment(Some(b'#'))
            .terminator(Terminator::Any(b'\n'))
            .from_reader(EmptyCells::new(whole, delimiter).take(LINE_BYTES));
        Self {
            path,
            reader,
            delimiter,
            record: ByteRecord::new(),
            number: 0,
        }
    }

    /// Reads the next line; false at the end of the file.
    pub(super) fn read(&mut self) -> Result<bool, RecordError> {
        loop {
            let has_record = self.reader.read_byte_record(&mut self.record);
            let has_record = has_record.map_err(|e| RecordError::io(self.path)(e.into()))?;
            let next_line = self.reader.position().line();
            if self.reader.get_ref().limit() == 0 {
                let reason = format!("longer than {} MiB, or a quote is not closed", LINE_BYTES >> 20);
                return Err(unreadable(self.path, next_line, reason));
            }
            if !has_record {
                return Ok(false);
            }
            self.reader.get_mut().set_limit(LINE_BYTES);
            self.number = next_line - 1;
            if self.delimiter == b' ' {
                self.record = self.record.iter().filter(|cell| !cell.is_empty()).collect();
            }
            if is_blank(&self.record) {
                continue;
            }
            if self.record.len() > MAX_COLUMNS {
                let reason = format!("{} columns, more than {MAX_COLUMNS}", self.record.len());
                return Err(unreadable(self.path, self.number, reason));
            }
            return Ok(true);
        }
    }
}

/// Whether a line holds nothing but blanks and perhaps a comment after them.
fn is_blank(record: &ByteRecord) -> bool {
    let Some(first) = record.get(0) else {
        return true;
    };
    (record.len() == 1 && first.trim_ascii().is_empty()) || first.trim_ascii().starts_with(b"#")
}

/// The bytes of a table. Where blanks separate, a cell `""` is two tabs, by which it is told from the nothing between two blanks.
struct EmptyCells<R> {
    whole: R,
    are_blanks_between: bool,
    line: Vec<u8>,
    /// How much of the line is given.
    given: usize,
}

impl<R> EmptyCells<R> {
    fn new(whole: R, delimiter: u8) -> Self {
        Self {
            whole,
            are_blanks_between: delimiter == b' ',
            line: Vec::new(),
            given: 0,
        }
    }
}

impl<R: BufRead> Read for EmptyCells<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if !self.are_blanks_between {
            return self.whole.read(buffer);
        }
        if self.given == self.line.len() {
            self.line.clear();
            self.given = 0;
            (&mut self.whole)
                .take(LINE_BYTES)
                .read_until(b'\n', &mut self.line)?;
            for at in 1..self.line.len() {
                let begins = at == 1 || self.line[at - 2] == b' ';
                let ends = self.line.get(at + 1).is_none_or(u8::is_ascii_whitespace);
                if begins && ends && self.line[at - 1..=at] == *b"\"\"" {
                    self.line[at - 1..=at].fill(b'\t');
                }
            }
        }
        let given = (&self.line[self.given..]).read(buffer)?;
        self.given += given;
        Ok(given)
    }
}
