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
            [b'[', rest @ ..] if rest.trim_ascii_start().first().is_none_or(|byte| !byte.is_ascii_alphabetic()) => ", a list, which a .csv holds as text; of the table that was written, numpy.savez(\"grasp.npz\", frames=numpy.stack(df.NAME), t_s=df.TIME) makes a recording",
            _ if text.split([' ', '\t', ';', '|']).all(|cell| cell.parse::<f64>().is_ok()) => NO_SEPARATOR,
            _ if text.contains(',') && text.contains('.') => {
                "; thousands are not set apart: in pandas pandas.read_csv(NAME, thousands=\",\").to_csv(NEW, index=False)"
            }
            _ if are_thousands(text) => {
                "; numbers have no comma: in pandas pandas.read_csv(NAME, thousands=\",\").to_csv(NEW, index=False), or with \
                 sep=None, engine=\"python\", decimal=\",\" where it begins the decimals"
            }
            [b'0', b'x' | b'X', digits @ ..] if digits.iter().all(u8::is_ascii_hexdigit) => {
                "; it is hexadecimal: in pandas df.NAME.map(lambda cell: int(cell, 16))"
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

/// Whether a text without a point may be a number whose thousands are set apart by commas.
fn are_thousands(text: &str) -> bool {
    let digits = text.trim_start_matches(['-', '+']);
    let mut groups = digits.split(',');
    let first = groups.next().unwrap_or_default();
    let are_digits = |group: &str| group.bytes().all(|byte| byte.is_ascii_digit());
    digits.contains(',')
        && (1..=3).contains(&first.len())
        && are_digits(first)
        && groups.all(|group| group.len() == 3 && are_digits(group))
}
