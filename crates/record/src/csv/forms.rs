//! Tables of a form that is refused with what makes another of it.

use super::columns::cell;
use super::lines::Lines;
use csv::ByteRecord;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use taxel_hand::shell_word;

/// Lines in which names are looked for.
const LINES: usize = 4;

/// Refuses a table whose columns have several lines of names, as pandas writes those of a `MultiIndex`.
pub(super) fn refuse_lines_of_names(path: &Path, delimiter: u8) -> Result<(), String> {
    let Some(levels) = first_lines(path, delimiter).as_deref().and_then(levels) else {
        return Ok(());
    };
    Err(format!(
        "its columns have {levels} lines of names; make one of them: in pandas df.columns = [\"_\".join(map(str, c)) for c in \
         df.columns]"
    ))
}

/// The first lines of a file; none of what is no file.
fn first_lines(path: &Path, delimiter: u8) -> Option<Vec<Vec<String>>> {
    let mut lines = Lines::of_file(path, delimiter).ok()??;
    let mut first = Vec::new();
    while first.len() < LINES && lines.read().ok()? {
        let cells = lines.record.iter().map(|bytes| cell(bytes).map(str::to_owned));
        if !lines.record[0].starts_with(b"sep=") {
            first.push(cells.collect::<Result<_, _>>().ok()?);
        }
    }
    Some(first)
}

/// How many lines of names a table begins with, where these are several: names that repeat, and below them others, or whole
/// numbers from 0 or 1 on, until no column is called as another is.
fn levels(lines: &[Vec<String>]) -> Option<usize> {
    let (first, others) = lines.split_first()?;
    let mut names: Vec<Vec<&str>> = first.iter().map(|cell| vec![cell.as_str()]).collect();
    let is_text = |cell: &str| !cell.is_empty() && !is_number(cell);
    let mut has_text = first.iter().any(|cell| is_text(cell));
    for line in others.iter().take_while(|line| line.len() == first.len()) {
        let mut below: BTreeMap<&[&str], Vec<&str>> = BTreeMap::new();
        for (names, cell) in names.iter().zip(line) {
            below.entry(names).or_default().push(cell);
        }
        let (single, repeated): (Vec<_>, Vec<_>) = below.into_values().partition(|cells| cells.len() == 1);
        // Where no index is first, numbers below one name, and below a name that does not repeat, may be a frame.
        let has_index = !is_number(&line[0]);
        let are_names = (has_index || repeated.len() > 1)
            && (repeated.iter()).all(|cells| cells.iter().all(|cell| is_text(cell)) || count_on(cells))
            && (single.iter()).all(|cells| has_index || !is_number(cells[0]));
        if repeated.is_empty() || !are_names {
            break;
        }
        has_text |= line.iter().any(|cell| is_text(cell));
        names
            .iter_mut()
            .zip(line)
            .for_each(|(names, cell)| names.push(cell));
    }
    let levels = names.first().map_or(0, Vec::len);
    let are_distinct = names.iter().collect::<BTreeSet<_>>().len() == names.len();
    (levels > 1 && are_distinct && has_text).then_some(levels)
}

/// Whether these are whole numbers from 0 or 1 on, some perhaps more than once.
fn count_on(cells: &[&str]) -> bool {
    let numbers = cells.iter().map(|cell| cell.parse().ok());
    let Some(numbers) = numbers.collect::<Option<BTreeSet<usize>>>() else {
        return false;
    };
    let first = numbers.first().copied().unwrap_or_default();
    let count = numbers.len();
    first <= 1 && numbers.into_iter().eq(first..first + count)
}

/// Whether a second line begins with a name, and the first has none behind its first cell: those of a table whose lines are
/// taxels.
pub(super) fn is_turned(first: &ByteRecord, second: &ByteRecord) -> bool {
    let has_numbers = |record: &ByteRecord| {
        record
            .iter()
            .skip(1)
            .all(|bytes| cell(bytes).is_ok_and(is_number))
    };
    let begins_with_number = |record: &ByteRecord| cell(&record[0]).is_ok_and(is_number);
    let lines = [first, second];
    first.len() > 2
        && first.len() == second.len()
        && lines.into_iter().all(has_numbers)
        && !lines.into_iter().any(begins_with_number)
}

fn is_number(cell: &str) -> bool {
    cell.parse::<f64>().is_ok()
}

/// Why a file that begins so has no lines of UTF-8, as some programs write text, and what makes them of it.
pub(super) fn of_another_program(head: &[u8], path: &Path) -> Option<String> {
    let file = shell_word(path.display());
    match head {
        [0xFF, 0xFE, ..] | [0xFE, 0xFF, ..] => Some(format!(
            "UTF-16 text; `iconv -f utf-16 -t utf-8 {file} > new.csv` makes a file of it that is read"
        )),
        _ if head.contains(&b'\r') && !head.contains(&b'\n') => Some(format!(
            "its lines end with a carriage return alone; `tr '\\r' '\\n' < {file} > new.csv` makes a file of it that is read"
        )),
        _ => None,
    }
}

/// Refuses the headers of logs of CAN frames: those of python-can's `CSVWriter`, `can/io/csv.py`, and of SavvyCAN's own,
/// `framefileio.cpp`.
pub(super) fn refuse_log_of_can(header: &ByteRecord, path: &Path) -> Result<(), String> {
    let begins_with = |names: [&str; 2]| {
        let cells = header.iter().map(|cell| cell.trim_ascii().to_ascii_lowercase());
        cells.take(2).eq(names.map(|name| name.as_bytes().to_vec()))
    };
    let (program, way) = if begins_with(["timestamp", "arbitration_id"]) {
        let (file, log) = (
            shell_word(path.display()),
            shell_word(path.with_extension("log").display()),
        );
        let way = format!("`can_logconvert {file} {log}` of python-can makes a .log of it");
        ("python-can", way)
    } else if begins_with(["time stamp", "id"]) {
        let way = "have SavvyCAN save it as \"Candump/Kayak (*.log)\"".to_owned();
        ("SavvyCAN", way)
    } else {
        return Ok(());
    };
    Err(format!(
        "a log of CAN frames, as {program} writes them, and no table of numbers; {way}"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn levels_of(text: &str) -> Option<usize> {
        let line = |line: &str| line.split(',').map(str::to_owned).collect();
        levels(&text.lines().map(line).collect::<Vec<Vec<String>>>())
    }

    #[test]
    fn several_lines_of_names_are_told_from_frames() {
        for (text, wanted) in [
            // Finger and taxel, with the name of an index and without one.
            ("finger,a,a,b,b\ntaxel,0,1,0,1\ntime,,,,\n0.02,1,2,3,4", Some(2)),
            (",a,a,b,b\n,0,1,0,1\n0,1,2,3,4", Some(2)),
            ("a,a,b,b\n1,2,1,2\n0,5,7,9", Some(2)),
            // Taxel and axis.
            (",s0,s0,s0,s1,s1,s1\n,x,y,z,x,y,z\n0,5,7,9,5,7,9", Some(2)),
            (",0,0,0,1,1,1\n,x,y,z,x,y,z\n0,5,7,9,5,7,9", Some(2)),
            ("t_s,s0,s0,s0\n,x,y,z\n0.02,5,7,9", Some(2)),
            // Three lines.
            (",a,a,a,a,b,b\n,0,0,1,1,0,0\n,x,z,x,z,x,z\n0,5,7,9,5,7,9", Some(3)),
            // Frames.
            ("t,a,b,b\n0,1,0,1\n1,0,1,2", None),
            ("s,s\n0,1\n0,1", None),
            ("a,a,b,b\n0,0,0,0\n0,0,0,0\n0,0,0,0", None),
            ("a,a,b,b\n0,1.5,0,1\n0,1,0,1", None),
            ("0,0,1,1\n0,1,0,1\n0,1,0,1", None),
            (",0,0,1,1\n,0,1,0,1\n,0,1,0,1", None),
            // Names that do not repeat, units, and a line of another width.
            ("t_s,a,b\ns,N,N\n0,1,2", None),
            ("t_s,a,a\ns,N,N\n0,1,2", None),
            ("a,a,b,b\n0,1,0\n0,1,0,1", None),
        ] {
            assert_eq!(levels_of(text), wanted, "{text}");
        }
    }
}
