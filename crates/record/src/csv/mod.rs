//! Tables of numbers as `.csv`.

mod axes;
mod clock;
mod columns;
mod forms;
mod grid;
mod lines;
mod no_frame;
mod number;
mod preamble;

pub(crate) use columns::taxel_of;

use clock::{is_clock, time_ns, unit_beyond_seconds, unit_since_1970};
use columns::{LineColumns, cell, is_unnamed};
use forms::{of_another_program, refuse_lines_of_names, refuse_log_of_can};
use lines::{LINE_BYTES, Lines, unreadable};
use no_frame::NoFrame;
use number::number;

use crate::error::RecordError;
use crate::numpy::npy::MAX_NUMBERS;
use crate::table::{ColumnNames, Columns, ReadOptions, Table};
use csv::{ByteRecord, ReaderBuilder};
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;
use taxel_hand::plural;

/// What some spreadsheets begin a file with.
const BYTE_ORDER_MARK: &[u8] = "\u{feff}".as_bytes();
/// Numbers 0, 1, 2, ... from which on a first line of them may be pandas' names of columns.
const FEWEST_NUMBERS: usize = 4;

/// Reads a csv file: one frame a line, the numbers separated by commas, semicolons, tabs, bars or blanks, quoted or not.
///
/// The first line that is neither empty nor begins with `#` shows what separates: a semicolon if it has one, else a comma,
/// a tab, a bar, or one or more blanks. If its first cell that is not empty is no number, it is a header; if it is one, the
/// comment right before it is, where it has as many cells, as `numpy.savetxt` writes names. An empty cell is a
/// value that is not there, but for one that a separator at the end of a line leaves behind the last column: where names or
/// lines before do not say which that is, it is one of them that [`ReadOptions::columns`] needs for threes. Columns called
/// `{board}B{taxel}X`, `..Y`, `..Z`, with or without a leading `{finger}F` (docs/protocols.md, "uSkin on a hand"), are raw
/// counts: taxels are numbered by finger, board and taxel, whatever the order of the columns. Columns called `J{n}`,
/// `joint{n}` or `joint_{n}` are joint angles, radians, in the order of their numbers. The first column whose name says
/// no more than that it is time (`crate::clock_name`), where `t` has to be behind none but numbers of frames, is the time of
/// a frame, in seconds where the name has no unit, as
/// [`Recording::unitless_time`](crate::Recording::unitless_time) tells. Other columns of time, and those that count frames, are left out
/// ([`Recording::left_out_columns`](crate::Recording::left_out_columns)). Where most names are in threes x, y and z of a
/// taxel, as `txl1_x`, `Bx1` or `x_1`, all are raw counts, too, of taxels in the order of the columns, but of the number
/// where that is all by which their names differ. Any other header, and none, leaves plain numbers, of which the last may
/// be joint angles by [`ReadOptions::joint_columns`].
pub(crate) fn read(path: &Path, options: &ReadOptions) -> Result<Table, RecordError> {
    let io_error = RecordError::io(path);
    let mut file = BufReader::new(File::open(path).map_err(&io_error)?);
    let head = head(&mut file).map_err(&io_error)?;
    if let Some(reason) = of_another_program(&head, path) {
        return Err(unreadable(path, 1, reason));
    }
    // A last line without its end gets one, so that the line of a record is always the one before
    // the reader's.
    let whole = head.as_slice().chain(file).chain(&b"\n"[..]);
    let delimiter = delimiter(&head);
    let mut lines = Lines::new(path, whole, delimiter);
    let mut frames = Frames::new(LineColumns::of_plain(options));
    let mut lines_before = 0;
    let mut first: Option<ByteRecord> = None;
    while lines.read()? {
        let refuse = |reason| unreadable(path, lines.number, reason);
        let record = &mut lines.record;
        let is_first = first.is_none();
        // What tells spreadsheets how columns are separated.
        if is_first && record[0].starts_with(b"sep=") {
            continue;
        }
        if is_first {
            refuse_lines_of_names(path, delimiter).map_err(refuse)?;
            first = Some(record.clone());
        }
        if is_first && !is_header(record) {
            let columns = record.len() - usize::from(ends_with_separator(record));
            if let Some((comment, names)) = names_in_comment(&head, delimiter, columns) {
                frames.meaning = LineColumns::of_header(&names, options, false).map_err(refuse)?;
                frames.meaning.names.comment = Some(comment);
            }
        }
        let ends_behind_columns = match frames.meaning.columns {
            Some(columns) => record.len() == columns + 1,
            None => !are_counts(record.len(), options) || is_header(record),
        };
        let is_cut = ends_with_separator(record) && ends_behind_columns;
        if is_cut {
            record.truncate(record.len() - 1);
        }
        if is_first && is_header(record) {
            refuse_log_of_can(record, path).map_err(refuse)?;
            let is_index_time = has_index(record) && is_index_clock(path, delimiter)?;
            frames.meaning = LineColumns::of_header(record, options, is_index_time).map_err(refuse)?;
            if is_index_time && frames.meaning.time.is_none() && options.rate_hz.is_none() {
                return Err(refuse(
                    "column 1, which has no name, rises like a clock, and not as numbers of frames do: --time-column s, if it \
                     is in seconds; --rate HZ leaves it out"
                        .into(),
                ));
            }
        } else {
            if is_cut && frames.meaning.columns.is_none() {
                frames.empty_at_end = empty_at_end(record);
            }
            let begins_with_numbers = frames.meaning.columns.is_none()
                && record.len() >= FEWEST_NUMBERS
                && are_numbers(record.iter());
            if begins_with_numbers {
                frames.names_line = Some(lines.number);
            }
            if let Err(reason) = frames.take(record) {
                let no_frame = NoFrame {
                    path,
                    delimiter,
                    record: record.clone(),
                    line: lines.number,
                    lines_before,
                    first: &first.unwrap_or_default(),
                    frames: &frames,
                    reason,
                };
                return Err(unreadable(path, lines.number, no_frame.told(|| lines.read())?));
            }
        }
        lines_before += 1;
    }
    frames.table(path, options)
}

/// Whether the first column of a header has no name, as that of pandas' index.
fn has_index(header: &ByteRecord) -> bool {
    cell(&header[0]).is_ok_and(|name| is_unnamed(0, name))
}

/// Whether the first column of a file with a header is a clock by its first lines.
fn is_index_clock(path: &Path, delimiter: u8) -> Result<bool, RecordError> {
    let Some(mut lines) = Lines::of_file(path, delimiter).map_err(RecordError::io(path))? else {
        return Ok(false);
    };
    let mut records = Vec::new();
    while records.len() <= clock::LINES && lines.read()? {
        if !lines.record[0].starts_with(b"sep=") {
            records.push(ByteRecord::from(vec![&lines.record[0]]));
        }
    }
    Ok(is_clock(records.iter().skip(1)))
}

/// The frames of the lines so far.
struct Frames {
    meaning: LineColumns,
    frames: usize,
    /// The line of the first one, where that may be the numbers of its columns.
    names_line: Option<u64>,
    /// Empty cells at the end of the first of lines without names, where that ends with a separator, behind which may be one
    /// more.
    empty_at_end: usize,
    values: Vec<f64>,
    times_ns: Vec<u64>,
    joints: Vec<f32>,
    /// The numbers of a line.
    row: Vec<f64>,
}

impl Frames {
    fn new(meaning: LineColumns) -> Self {
        Self {
            meaning,
            frames: 0,
            names_line: None,
            empty_at_end: 0,
            values: Vec::new(),
            times_ns: Vec::new(),
            joints: Vec::new(),
            row: Vec::new(),
        }
    }

    /// Takes the numbers of a line.
    fn take(&mut self, record: &ByteRecord) -> Result<(), String> {
        self.row.clear();
        for (column, bytes) in record.iter().enumerate() {
            let number = number(column, bytes).map_err(|reason| match self.meaning.names.values.is_empty() {
                // As pandas calls columns without names.
                true => reason.replace("df.NAME", &format!("df[{column}]")),
                false => reason,
            });
            self.row.push(number?);
        }
        let row = &self.row;
        let expected = *self.meaning.columns.get_or_insert(row.len());
        if row.len() != expected {
            return Err(format!(
                "{}, where the lines before have {expected}",
                plural(row.len(), "column")
            ));
        }
        if let Some((time, unit)) = self.meaning.time {
            let time_ns = time_ns(&record[time], row[time], unit);
            let no_time = || match (row[time], &self.meaning.unitless) {
                (late, Some(name)) if late > 1e10 => format!(
                    "{late} is no time in seconds, which a column {name:?} is taken for; say its unit: --time-column {}",
                    unit_beyond_seconds(late)
                ),
                (late, None)
                    if (1e10..1.8e19).contains(&late) && unit.name() != unit_beyond_seconds(late) =>
                {
                    format!(
                        "{late} is no time in {}; where it is in {1}, call the column t_{1}, or say --time-column {1}",
                        unit.name(),
                        unit_beyond_seconds(late)
                    )
                }
                (time, _) if time < 0.0 => format!(
                    "{time} is no time from 0 on; take the least from each: in pandas df.NAME -= df.NAME.min()"
                ),
                (time, _) => format!("{time} is no time from 0 on"),
            };
            self.times_ns.push(time_ns.ok_or_else(no_time)?);
        }
        let columns = self.meaning.resolve(expected)?;
        self.values
            .extend(columns.values.iter().map(|&column| row[column]));
        self.joints
            .extend(columns.joints.iter().map(|&column| row[column] as f32));
        self.frames += 1;
        if self.values.len() > MAX_NUMBERS {
            return Err(format!(
                "more than {MAX_NUMBERS} numbers up to here; cut the file into pieces"
            ));
        }
        Ok(())
    }

    fn table(mut self, path: &Path, options: &ReadOptions) -> Result<Table, RecordError> {
        self.refuse_clocks(options)
            .map_err(|reason| RecordError::unreadable(path.display(), reason))?;
        let Self {
            meaning,
            frames,
            values,
            ..
        } = self;
        if frames == 0 {
            return Err(unreadable(path, 1, "no line of numbers in the file".into()));
        }
        Ok(Table {
            at: path.display().to_string(),
            shape: vec![frames, values.len() / frames],
            values,
            times_ns: meaning.time.is_some().then_some(self.times_ns),
            joints: (!self.joints.is_empty()).then_some(self.joints),
            columns: meaning.are_counts().then_some(Columns::XyzInterleaved),
            void: None,
            without_value: None,
            is_half: false,
            unitless_time: meaning.unitless,
            names: ColumnNames {
                may_be_line: self.names_line,
                empty_at_end: self.empty_at_end,
                ..meaning.names
            },
        })
    }

    /// Refuses a first or last column of values that is a clock, and times that run backwards in a column that has no name.
    fn refuse_clocks(&mut self, options: &ReadOptions) -> Result<(), String> {
        let falls = self.times_ns.windows(2).position(|pair| pair[1] < pair[0]);
        if let (Some((time, _)), Some(before), None, true) = (
            self.meaning.time,
            falls,
            options.rate_hz,
            self.meaning.names.values.is_empty(),
        ) {
            return Err(format!(
                "the time of frame {}, column {} of its line, is before that of the frame before it; of columns without names \
                 --time-column takes the first",
                before + 1,
                time + 1
            ));
        }
        if self.frames < 2 || self.meaning.are_counts() {
            return Ok(());
        }
        let wide = self.values.len() / self.frames;
        let columns = self
            .meaning
            .resolve(self.meaning.columns.unwrap_or(wide))?
            .values
            .clone();
        for place in [0, wide - 1] {
            let of_column = self.values.iter().skip(place).step_by(wide);
            let Some(unit) = unit_since_1970(&of_column.copied().collect::<Vec<f64>>()) else {
                continue;
            };
            let (column, unit) = (columns[place], unit.name());
            let is_first = column == 0 && self.meaning.time.is_none();
            let name = self.meaning.names.values.get(place);
            return Err(format!(
                "column {}{} rises like a clock since 1970, and is no taxel: {}",
                column + 1,
                name.map_or_else(String::new, |name| format!(", {name:?},")),
                match (is_first, self.meaning.time.is_some()) {
                    (true, _) => format!("--time-column {unit} takes it for time"),
                    (_, true) => "cut it out".into(),
                    (_, false) => format!("put it first, and --time-column {unit} takes it for time"),
                }
            ));
        }
        Ok(())
    }
}

/// The lines up to the first one that is neither empty nor a comment.
fn head(file: &mut impl BufRead) -> io::Result<Vec<u8>> {
    let mut head = Vec::new();
    loop {
        let begin = head.len();
        file.take(LINE_BYTES).read_until(b'\n', &mut head)?;
        let line = head[begin..].trim_ascii();
        let line = line.strip_prefix(BYTE_ORDER_MARK).unwrap_or(line);
        let says_nothing = line.is_empty() || line.starts_with(b"#");
        let is_long = head.len() as u64 > LINE_BYTES;
        if begin == head.len() || !head.ends_with(b"\n") || !says_nothing || is_long {
            return Ok(head);
        }
    }
}

/// The last comment before the last of these lines, and its cells, where these are names of so many columns.
fn names_in_comment(head: &[u8], delimiter: u8, columns: usize) -> Option<(String, ByteRecord)> {
    let head = head.strip_prefix(BYTE_ORDER_MARK).unwrap_or(head);
    let lines = head.split(|b| *b == b'\n').map(<[u8]>::trim_ascii);
    let mut before = lines.filter(|line| !line.is_empty()).rev().skip(1);
    let comment = before.next()?.strip_prefix(b"#")?.trim_ascii();
    let mut reader = ReaderBuilder::new()
        .has_headers(false)
        .delimiter(delimiter)
        .from_reader(comment);
    let names = reader.byte_records().next()?.ok()?;
    // Between blanks are words of a sentence, too, but none of them is a number where they are names.
    let names: ByteRecord = match delimiter {
        b' ' => names.iter().filter(|cell| !cell.is_empty()).collect(),
        _ => names,
    };
    let is_number = |name: &[u8]| cell(name).is_ok_and(|name| name.parse::<f64>().is_ok());
    let are_words = delimiter == b' ' && names.iter().any(is_number);
    let are_names = names.len() == columns && columns > 1 && is_header(&names) && !are_words;
    are_names.then(|| (String::from_utf8_lossy(comment).into_owned(), names))
}

/// What separates the columns of the last of these lines.
fn delimiter(lines: &[u8]) -> u8 {
    let line = lines
        .trim_ascii()
        .rsplit(|b| *b == b'\n')
        .next()
        .unwrap_or_default();
    let delimiters = *b";,\t| ";
    let has = |wanted: &u8| {
        let mut quoted = false;
        line.iter().any(|byte| {
            quoted ^= *byte == b'"';
            byte == wanted && !quoted
        })
    };
    delimiters.into_iter().find(has).unwrap_or(b',')
}

/// Whether columns without names are x, y and z of taxels by the options, if there are so many of them.
fn are_counts(columns: usize, options: &ReadOptions) -> bool {
    let others = options.joint_columns + usize::from(options.time_column.is_some());
    let values = columns.checked_sub(others);
    options.columns.is_some() && values.is_some_and(|values| values.is_multiple_of(3))
}

/// Whether a line, of more than one cell, has nothing in its last one.
fn ends_with_separator(record: &ByteRecord) -> bool {
    let last = record.len() - 1;
    last > 0 && record[last].trim_ascii().is_empty()
}

fn empty_at_end(record: &ByteRecord) -> usize {
    let cells = (0..record.len()).rev();
    cells
        .take_while(|cell| record[*cell].trim_ascii().is_empty())
        .count()
}

fn is_header(record: &ByteRecord) -> bool {
    let mut cells = record.iter().map(cell);
    let first = cells.find(|cell| *cell != Ok(""));
    first.is_some_and(|cell| cell.is_ok_and(|cell| cell.parse::<f64>().is_err()))
        || are_numbers_of_columns(record)
}

/// Whether it is how pandas names columns that have no names: nothing, 0, 1, 2, ...
fn are_numbers_of_columns(record: &ByteRecord) -> bool {
    record.len() > 2 && cell(&record[0]) == Ok("") && are_numbers(record.iter().skip(1))
}

/// Whether cells are 0, 1, 2, ...
fn are_numbers<'a>(cells: impl Iterator<Item = &'a [u8]>) -> bool {
    let mut cells = cells.map(cell).enumerate();
    cells.all(|(number, cell)| cell.is_ok_and(|cell| cell == number.to_string()))
}

#[cfg(test)]
mod tests;
