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

    /// What to do where what is taken for the header may be none, as in a preamble.
    fn advice(&self) -> String {
        let (cells, columns) = (self.record.len(), self.frames.meaning.columns);
        let is_behind_header = self.frames.frames == 0 && columns.is_some();
        let is_text = is_behind_header && self.reason.ends_with(NO_NUMBER);
        if is_text && let Some(begin) = table_begin(self.path, self.delimiter, cells) {
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
            Some(names) if has_number && names == cells => "; cut that column out".into(),
            _ => "; where the table begins further down, cut off what is before it (`tail -n +N`)".into(),
        }
    }
}
