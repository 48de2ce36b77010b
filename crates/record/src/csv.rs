//! Tables of numbers as `.csv`.

use crate::error::RecordError;
use crate::recording::{Columns, ReadOptions, Recording, Table, TimeUnit};
use std::collections::BTreeMap;
use std::path::Path;

/// Reads a csv file: one frame a line, separated by commas.
///
/// A first line that does not begin with a number is a header. Columns called `{board}B{taxel}X`, `..Y`, `..Z`, with or
/// without a leading `{finger}F` (protocols.md 2.7), are raw counts: taxels are numbered by finger, board and
/// taxel, whatever the order of the columns. A first column called `time` or `t` is time in seconds; the suffixes
/// `_s`, `_ms`, `_us` and `_ns` say otherwise. Any other header, and none, leaves plain numbers.
pub(crate) fn read(path: &Path, options: &ReadOptions) -> Result<Recording, RecordError> {
    let bytes = std::fs::read(path).map_err(|source| RecordError::Io {
        path: path.into(),
        source,
    })?;
    let line_error = |line: usize, reason: String| RecordError::CsvLine {
        path: path.into(),
        line,
        reason,
    };
    let text = std::str::from_utf8(&bytes).map_err(|e| {
        let line = 1 + bytes[..e.valid_up_to()].iter().filter(|b| **b == b'\n').count();
        line_error(line, "not UTF-8 text".into())
    })?;
    let mut lines = text
        .trim_start_matches('\u{feff}')
        .lines()
        .enumerate()
        .map(|(i, line)| (i + 1, line.trim()))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
        .peekable();
    let header = match lines.peek() {
        Some((_, line))
            if cells(line)
                .next()
                .is_some_and(|cell| cell.parse::<f64>().is_err()) =>
        {
            lines.next()
        }
        _ => None,
    };
    let mut meaning = Meaning::of_plain(options.time_column);
    if let Some((line, names)) = header {
        meaning = Meaning::of_header(names, options).map_err(|reason| line_error(line, reason))?;
    }

    let (mut values, mut times_ns, mut row) = (Vec::new(), Vec::new(), Vec::new());
    let (mut frames, mut width) = (0, meaning.columns);
    for (line, text) in lines {
        row.clear();
        for (column, cell) in cells(text).enumerate() {
            let number = cell.parse::<f64>().map_err(|_| {
                line_error(
                    line,
                    format!("column {} is {cell:?}, which is not a number", column + 1),
                )
            })?;
            row.push(number);
        }
        let expected = *width.get_or_insert(row.len());
        if row.len() != expected {
            let reason = format!("{} columns, where the lines before have {expected}", row.len());
            return Err(line_error(line, reason));
        }
        let mut numbers = row.as_slice();
        if let Some(unit) = meaning.time {
            let time_ns = (numbers[0] * unit.nanoseconds()).round();
            if !(0.0..1.8e19).contains(&time_ns) {
                return Err(line_error(line, format!("{} is no time from 0 on", numbers[0])));
            }
            times_ns.push(time_ns as u64);
            numbers = &numbers[1..];
        }
        match &meaning.order {
            Some(order) => values.extend(order.iter().map(|&column| numbers[column])),
            None => values.extend_from_slice(numbers),
        }
        frames += 1;
    }
    if frames == 0 {
        return Err(line_error(1, "no line of numbers in the file".into()));
    }
    let table = Table {
        at: path.display().to_string(),
        shape: vec![frames, values.len() / frames],
        values,
        times_ns: meaning.time.is_some().then_some(times_ns),
    };
    let columns = meaning.order.map(|_| Columns::XyzInterleaved).or(options.columns);
    Recording::from_table(
        table,
        &ReadOptions {
            columns,
            ..options.clone()
        },
    )
}

fn cells(line: &str) -> impl Iterator<Item = &str> {
    line.split(',').map(|cell| cell.trim().trim_matches('"'))
}

/// What the columns of a csv file are.
struct Meaning {
    /// Number of columns the header promises.
    columns: Option<usize>,
    /// Unit of the first column where it is time.
    time: Option<TimeUnit>,
    /// Where in a line, after the time, to find x1, y1, z1, x2, ...; `None` for plain numbers.
    order: Option<Vec<usize>>,
}

impl Meaning {
    fn of_plain(time: Option<TimeUnit>) -> Self {
        Self {
            columns: None,
            time,
            order: None,
        }
    }

    fn of_header(line: &str, options: &ReadOptions) -> Result<Self, String> {
        let mut names: Vec<&str> = cells(line).collect();
        let columns = Some(names.len());
        let time = options.time_column.or_else(|| time_unit(names[0]));
        if time.is_some() {
            names.remove(0);
        }
        let axes: Vec<Option<Axis>> = names.iter().map(|name| Axis::of_name(name)).collect();
        if axes.iter().all(Option::is_none) {
            return Ok(Self {
                columns,
                time,
                order: None,
            });
        }
        if options.columns.is_some() {
            return Err("the header names each column's taxel and axis; leave --columns out".into());
        }
        let mut taxels: BTreeMap<(u32, u32, u32), [Option<usize>; 3]> = BTreeMap::new();
        for (column, axis) in axes.into_iter().enumerate() {
            let name = names[column];
            let Axis { taxel, axis } = axis.ok_or_else(|| {
                format!("column {name:?} is not named {{board}}B{{taxel}}X, Y or Z as the others are")
            })?;
            if taxels.entry(taxel).or_default()[axis].replace(column).is_some() {
                return Err(format!("column {name:?} comes twice"));
            }
        }
        let mut order = Vec::with_capacity(taxels.len() * 3);
        for ((_, board, taxel), axes) in taxels {
            for (axis, column) in ["X", "Y", "Z"].into_iter().zip(axes) {
                order.push(column.ok_or_else(|| format!("taxel {board}B{taxel} has no column {axis}"))?);
            }
        }
        Ok(Self {
            columns,
            time,
            order: Some(order),
        })
    }
}

fn time_unit(name: &str) -> Option<TimeUnit> {
    match name.to_ascii_lowercase().as_str() {
        "t" | "time" | "timestamp" | "t_s" | "time_s" => Some(TimeUnit::S),
        "t_ms" | "time_ms" => Some(TimeUnit::Ms),
        "t_us" | "time_us" => Some(TimeUnit::Us),
        "t_ns" | "time_ns" => Some(TimeUnit::Ns),
        _ => None,
    }
}

/// A column's taxel (finger, board, taxel) and axis.
struct Axis {
    taxel: (u32, u32, u32),
    axis: usize,
}

impl Axis {
    fn of_name(name: &str) -> Option<Self> {
        let axis = match name.chars().last()? {
            'X' | 'x' => 0,
            'Y' | 'y' => 1,
            'Z' | 'z' => 2,
            _ => return None,
        };
        let rest = &name[..name.len() - 1];
        let (finger, rest) = match rest.split_once('F') {
            Some((finger, rest)) => (finger.parse().ok()?, rest),
            None => (0, rest),
        };
        let (board, taxel) = rest.split_once('B')?;
        Some(Self {
            taxel: (finger, board.parse().ok()?, taxel.parse().ok()?),
            axis,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tempfile::TempDir;

    fn read_text(text: &str, options: &ReadOptions) -> Result<Recording, String> {
        let dir = TempDir::new().unwrap();
        let path = dir.path().join("frames.csv");
        std::fs::write(&path, text).unwrap();
        Recording::open(&path, options).map_err(|e| e.to_string())
    }

    #[test]
    fn plain_numbers_are_magnitudes() {
        let recording = read_text("1,2.5,3\n4,5,-6\n\n", &ReadOptions::default()).unwrap();
        assert_eq!(recording.magnitudes(1).unwrap(), [4.0, 5.0, -6.0]);
        assert!(!recording.has_times());
    }

    #[test]
    fn named_columns_are_counts_in_the_order_of_their_taxels() {
        let text =
            "\u{feff}time_ms,0B1X,0B1Y,0B1Z,0B0Z,0B0Y,0B0X\r\n0,1,2,3,4,5,6\r\n10.5,7,8,9,10,11,12\r\n";
        let recording = read_text(text, &ReadOptions::default()).unwrap();
        assert_eq!(recording.counts(0).unwrap(), [[6, 5, 4], [1, 2, 3]]);
        assert_eq!(recording.t_ns(1), 10_500_000);
    }

    #[test]
    fn boards_of_different_fingers_are_different_taxels() {
        let names = "1F0B0X,1F0B0Y,1F0B0Z,0F1B0X,0F1B0Y,0F1B0Z\n1,2,3,4,5,6\n";
        let recording = read_text(names, &ReadOptions::default()).unwrap();
        assert_eq!(recording.counts(0).unwrap(), [[4, 5, 6], [1, 2, 3]]);
    }

    #[test]
    fn other_names_say_nothing_and_options_say_the_rest() {
        let options = ReadOptions {
            columns: Some(Columns::XyzBlocks),
            time_column: Some(TimeUnit::S),
            ..Default::default()
        };
        let recording = read_text("clock,a,b,c,d,e,f\n1.5,0,1,2,3,4,5\n", &options).unwrap();
        assert_eq!(recording.counts(0).unwrap(), [[0, 2, 4], [1, 3, 5]]);
        assert_eq!(recording.t_ns(0), 1_500_000_000);
        let recording = read_text("1.5,0,1,2,3,4,5\n", &options).unwrap();
        assert_eq!(recording.taxels(), 2);
    }

    #[test]
    fn errors_name_the_line() {
        let columns = ReadOptions {
            columns: Some(Columns::XyzBlocks),
            ..Default::default()
        };
        let none = ReadOptions::default();
        for (text, options, wanted) in [
            ("1,2\n3\n", &none, ":2: 1 columns"),
            ("1,2\n\n3,x\n", &none, ":3: column 2 is \"x\""),
            ("1,x\n2,3\n", &none, ":1: column 2 is \"x\""),
            ("", &none, ":1: no line"),
            ("a,b\n", &none, ":1: no line"),
            ("0B0X,0B0Y,0B0Z,a\n1,2,3,4\n", &none, ":1: column \"a\""),
            (
                "0B0X,0B0Y,0B0Y\n1,2,3\n",
                &none,
                ":1: column \"0B0Y\" comes twice",
            ),
            ("0B0X,0B0Y\n1,2\n", &none, ":1: taxel 0B0 has no column Z"),
            ("0B0X,0B0Y,0B0Z\n1,2,3\n", &columns, ":1: the header names"),
            ("t,a\n-1,2\n", &none, ":2: -1 is no time"),
            ("0B0X,0B0Y,0B0Z\n1,2,70000\n", &none, "70000"),
            ("1,2\n3,nan\n", &none, "frame 1, taxel 1"),
        ] {
            let message = read_text(text, options).unwrap_err();
            assert!(message.contains(wanted), "{text:?}: {message}");
        }
        let dir = TempDir::new().unwrap();
        let path = dir.path().join("latin.csv");
        std::fs::write(&path, b"1,2\n3,\xff\n").unwrap();
        let message = Recording::open(&path, &none).unwrap_err().to_string();
        assert!(message.contains(":2: not UTF-8"), "{message}");
    }
}
