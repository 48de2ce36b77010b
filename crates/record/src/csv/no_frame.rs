//! What is said of a line that is no frame.

use super::Frames;
use super::forms::is_turned;
use super::number::{NO_NUMBER, NO_SEPARATOR};
use super::preamble::{has_number, table_begin};
use crate::error::RecordError;
use csv::ByteRecord;
use std::path::Path;

/// What is to be done with a last line that was not written to its end.
const CUT_OFF: &str =
    "; it is the last line: where it was cut off, as when a program was killed, `sed '$d'` leaves it out";

/// A line that is no frame, and what is known of the table it is in.
pub(super) struct NoFrame<'a> {
    pub(super) path: &'a Path,
    pub(super) delimiter: u8,
    pub(super) record: ByteRecord,
    /// Its number, from 1 on.
    pub(super) line: u64,
    /// Lines before it that say something.
    pub(super) lines_before: usize,
    /// The first of them.
    pub(super) first: &'a ByteRecord,
    /// Those taken so far.
    pub(super) frames: &'a Frames,
    /// What is wrong with it.
    pub(super) reason: String,
}

impl NoFrame<'_> {
    /// What is wrong, and what to do. `go_on` reads on, and says whether there is another line.
    pub(super) fn told(
        &self,
        go_on: impl FnOnce() -> Result<bool, RecordError>,
    ) -> Result<String, RecordError> {
        let (line, reason) = (self.line, &self.reason);
        if self.lines_before > 0 && *self.first == self.record {
            return Ok(format!(
                "the header stands here again, as where another recording begins; take them apart: `head -n {}` is what is \
                 before it, `tail -n +{line}` the rest",
                line - 1
            ));
        }
        let advice = if self.lines_before == 1 && is_turned(self.first, &self.record) {
            "; where lines are taxels, and columns frames, turn the table: in pandas df.T; else cut that column out".into()
        } else if self.may_be_cut_off() {
            if go_on()? { String::new() } else { CUT_OFF.into() }
        } else {
            self.advice()
        };
        Ok(format!("{reason}{advice}"))
    }

    /// Whether it may be a line that was not written to its end.
    fn may_be_cut_off(&self) -> bool {
        let columns = self.frames.meaning.columns.unwrap_or_default();
        let is_short = self.record.len() < columns && !self.reason.contains(NO_SEPARATOR);
        self.frames.frames > 0 && (is_short || self.reason.ends_with(NO_NUMBER))
    }

    /// Whether the columns are called as those of a table that pandas melted.
    fn is_melted(&self) -> bool {
        let has = |name: &[u8]| {
            self.first
                .iter()
                .any(|cell| cell.trim_ascii().eq_ignore_ascii_case(name))
        };
        has(b"variable") && has(b"value")
    }

    /// What to do where what is taken for the header may be none, as in a preamble.
    fn advice(&self) -> String {
        let (cells, columns) = (self.record.len(), self.frames.meaning.columns);
        let is_behind_header = self.frames.frames == 0 && columns.is_some();
        let is_text = is_behind_header && self.reason.ends_with(NO_NUMBER);
        let begin = is_text
            .then(|| table_begin(self.path, self.delimiter, cells))
            .flatten();
        if is_text && self.lines_before == 1 && self.record.iter().all(is_unit) {
            return format!(
                "; where it is a line of units, leave it out (`sed {}d`)",
                self.line
            );
        }
        if is_text && self.is_melted() {
            return "; where each line has one value of a frame, pandas df.pivot(index=.., columns=.., values=..) makes a line of \
                    each frame"
                .into();
        }
        if let Some(begin) = begin {
            return format!(
                "; the table seems to begin at line {begin}: cut off what is before it (`tail -n +{begin}`)"
            );
        }
        let narrower = columns.filter(|columns| self.lines_before == 1 && *columns < cells);
        if !is_text && is_behind_header && narrower == Some(cells - 1) {
            return "; where the first has no name, as R's names of rows, give it one".into();
        }
        if cells == 1 && self.reason.contains(NO_SEPARATOR) || !is_text && narrower.is_some() {
            return format!(
                "; where the table begins here, cut off what is before it (`tail -n +{}`)",
                self.line
            );
        }
        let has_number = has_number(&self.record);
        match columns {
            _ if !is_text => String::new(),
            Some(names) if has_number && names > cells => {
                format!("; the header has {names} names, and this line {cells} cells")
            }
            Some(names) if has_number && names == cells => {
                "; cut that column out, or, where it says which sensor a line is of, make a file of each: in pandas df[df.NAME == ..]"
                    .into()
            }
            _ => "; where the table begins further down, cut off what is before it (`tail -n +N`)".into(),
        }
    }
}

/// Whether a cell is a unit, as under the name of a column: in brackets, or one that is usual.
fn is_unit(cell: &[u8]) -> bool {
    const UNITS: [&str; 14] = [
        "", "-", "s", "ms", "us", "ns", "rad", "deg", "n", "mn", "kpa", "pa", "v", "counts",
    ];
    match cell.trim_ascii() {
        [b'[', .., b']'] | [b'(', .., b')'] => true,
        cell => UNITS
            .iter()
            .any(|unit| cell.eq_ignore_ascii_case(unit.as_bytes())),
    }
}
