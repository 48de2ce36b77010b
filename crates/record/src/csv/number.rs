//! The number of a cell, and why it is none.

use super::columns::cell;

/// How it is said that a cell has several numbers: what separates is taken from the first line.
pub(super) const NO_SEPARATOR: &str = ", but several, which the first line does not separate so";
/// How it is said that a cell is text.
pub(super) const NO_NUMBER: &str = "which is not a number";
/// Characters of a cell that are quoted.
const QUOTED: usize = 40;
/// What others write where there is no value.
const NO_VALUE: [&str; 7] = ["na", "n/a", "#n/a", "null", "none", "-", "nil"];

/// The number of a cell; not a number where it is empty.
pub(super) fn number(column: usize, bytes: &[u8]) -> Result<f64, String> {
    let text = cell(bytes)?;
    if text.is_empty() {
        return Ok(f64::NAN);
    }
    text.parse().map_err(|_| {
        let quoted = match text.char_indices().nth(QUOTED) {
            Some((end, _)) => format!("{}..", &text[..end]),
            None => text.into(),
        };
        let advice = match text.as_bytes() {
            [a, b, c, d, b'-', ..] if [a, b, c, d].iter().all(|digit| digit.is_ascii_digit()) => {
                ", but a date; times are numbers: in pandas t = pandas.to_datetime(df.NAME); df.NAME = (t - t[0]).dt.total_seconds()"
            }
            [b'0'..=b'9', ..] if text.contains(':') => {
                ", but a time of day; times are numbers: in pandas t = pandas.to_timedelta(df.NAME); df.NAME = (t - t[0]).dt.total_seconds()"
            }
            [b'[', ..] => ", a list; write its values to columns of their own: in pandas pandas.DataFrame(df.NAME.tolist())",
            _ if text.split([' ', '\t', ';', '|']).all(|cell| cell.parse::<f64>().is_ok()) => NO_SEPARATOR,
            _ if text.contains(',') && text.contains('.') => {
                "; thousands are not set apart: in pandas pandas.read_csv(NAME, thousands=\",\").to_csv(NEW, index=False)"
            }
            _ if text.contains(',') => {
                "; decimals are written with a point: in pandas pandas.read_csv(NAME, sep=None, engine=\"python\", \
                 decimal=\",\").to_csv(NEW, index=False)"
            }
            _ if NO_VALUE.iter().any(|word| word.eq_ignore_ascii_case(text)) => "; a cell without a value is left empty",
            _ => "",
        };
        format!("column {} is {quoted:?}, {NO_NUMBER}{advice}", column + 1)
    })
}
