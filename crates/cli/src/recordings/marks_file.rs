//! Marks as `.csv` (RFC 4180): seconds and text, a mark a line.

use super::own_clock::{CLOCK_S, LATE_NS, instant_ns};
use anyhow::{Context, bail};
use std::path::Path;
use taxel_sequence::Mark;

/// The name of the first column in files that are written.
const SECONDS: &str = "t_s";

/// The text of a file of these marks.
pub(crate) fn text(marks: &[Mark]) -> anyhow::Result<Vec<u8>> {
    let mut lines = csv::Writer::from_writer(Vec::new());
    lines.write_record([SECONDS, "text"])?;
    for mark in marks {
        let seconds = mark.t_ns as f64 / 1e9;
        lines.write_record([&seconds.to_string(), &mark.text])?;
    }
    Ok(lines.into_inner()?)
}

/// Words that the first column may be called by.
const NAMES: [&str; 10] = [
    "t",
    "time",
    "timestamp",
    "stamp",
    "elapsed",
    "s",
    "sec",
    "secs",
    "second",
    "seconds",
];

/// Reads marks in the order of the file: seconds, then a comma, semicolon or tab, and a text. Commas behind the first belong to
/// the text, quoted or not. Columns may have names, and lines with a `#` are comments. Behind semicolons and tabs, decimals may
/// have a comma.
///
/// # Errors
/// Where a line is no mark, or every text begins with what may be the decimals of the seconds.
pub(crate) fn read(path: &Path) -> anyhow::Result<Vec<Mark>> {
    let at = || path.display().to_string();
    let text = std::fs::read(path).with_context(at)?;
    let text = text.strip_prefix("\u{feff}".as_bytes()).unwrap_or(&text);
    let delimiter = delimiter_of(text);
    let mut lines = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .comment(Some(b'#'))
        .delimiter(delimiter)
        .from_reader(text);
    let mut marks = Vec::new();
    let (mut with_decimals, mut first_of_them) = (0, None);
    for line in lines.records() {
        let line = line.with_context(at)?;
        let first = line[0].trim();
        let rest: Vec<&str> = line.iter().skip(1).collect();
        if first.is_empty() && rest.is_empty() || !rest.is_empty() && is_name(first) {
            continue;
        }
        let number = line.position().map_or(0, csv::Position::line);
        let whole = || {
            line.iter()
                .collect::<Vec<_>>()
                .join(&char::from(delimiter).to_string())
        };
        let seconds = seconds(first, delimiter).filter(|seconds| *seconds >= 0.0);
        let (Some(seconds), false) = (seconds, rest.is_empty()) else {
            bail!(
                "{}:{number}: {:?} is no mark; a mark is SECONDS,TEXT",
                at(),
                whole()
            );
        };
        if !CLOCK_S.contains(&seconds) {
            bail!(
                "{}:{number}: {first} is too great for a mark's seconds, which are up to {:.0}; is it in another unit?",
                at(),
                CLOCK_S.end()
            );
        }
        if delimiter == b',' && rest.len() > 1 && are_digits(first) && are_digits(rest[0]) {
            with_decimals += 1;
            first_of_them.get_or_insert_with(|| format!("{}:{number}: {:?}", at(), whole()));
        }
        marks.push(Mark {
            t_ns: instant_ns(seconds),
            text: rest.join(&char::from(delimiter).to_string()).trim().to_owned(),
        });
    }
    match first_of_them.filter(|_| with_decimals == marks.len()) {
        Some(line) => bail!(
            "{line} may be seconds with a decimal comma: write them with a point, or put the text into quotes"
        ),
        None => Ok(marks),
    }
}

/// What separates the seconds of the first line from its text.
fn delimiter_of(text: &[u8]) -> u8 {
    let is_mark = |line: &&[u8]| !line.trim_ascii().is_empty() && line[0] != b'#';
    let line = text
        .split(|byte| *byte == b'\n')
        .find(is_mark)
        .unwrap_or_default();
    let line = String::from_utf8_lossy(line);
    let separates = |delimiter: &u8| {
        let first = line
            .split_once(char::from(*delimiter))
            .map(|(first, _)| first.trim());
        first.is_some_and(|first| is_name(first) || seconds(first, *delimiter).is_some())
    };
    *b";\t"
        .iter()
        .find(|delimiter| separates(delimiter))
        .unwrap_or(&b',')
}

/// A number of seconds before this delimiter.
fn seconds(text: &str, delimiter: u8) -> Option<f64> {
    match delimiter {
        b',' => text.parse().ok(),
        _ => text.replace(',', ".").parse().ok(),
    }
}

/// Whether the column of the seconds may be called so.
fn is_name(text: &str) -> bool {
    let words = text.split(|letter: char| !letter.is_alphanumeric());
    let mut words = words.filter(|word| !word.is_empty()).peekable();
    words.peek().is_some() && words.all(|word| NAMES.contains(&word.to_lowercase().as_str()))
}

fn are_digits(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit())
}

/// On the clock of a recording whose frames have these times, ahead of whose first all marks are that begin a touch: counted
/// from that frame, where the recording is long enough, and what is said of it. None where marks are on its clock.
pub(crate) fn counted_from_first(
    marks: &[Mark],
    times_ns: &[u64],
    until: &str,
) -> Option<(Vec<Mark>, String)> {
    let (first, last) = (*times_ns.first()?, *times_ns.last()?);
    let begins = marks.iter().filter(|mark| mark.text != until);
    let latest = begins.map(|mark| mark.t_ns).max()?;
    if latest + LATE_NS > first || latest > last - first {
        return None;
    }
    let shifted = marks.iter().map(|mark| Mark {
        t_ns: first.saturating_add(mark.t_ns),
        text: mark.text.clone(),
    });
    let told = format!(
        "its frames begin at {} s and its marks before that; they are taken as counted from its first frame",
        first as f64 / 1e9
    );
    Some((shifted.collect(), told))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_of_any_text_read_back_as_they_were() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("marks.csv");
        let texts = ["touch 5 SS", "away, \"quoted\" ü", "two\nlines", "\"", ""];
        let marks: Vec<Mark> = (texts.iter().zip(1..))
            .map(|(text, n)| Mark {
                t_ns: n * 1_500_000_000,
                text: (*text).to_owned(),
            })
            .collect();
        let written = String::from_utf8(text(&marks).unwrap()).unwrap();
        std::fs::write(&path, &written).unwrap();
        let begin = "t_s,text\n1.5,touch 5 SS\n3,\"away, \"\"quoted\"\" ü\"\n4.5,\"two\nlines\"\n";
        assert!(written.starts_with(begin), "{written}");
        assert_eq!(read(&path).unwrap(), marks);
    }

    #[test]
    fn marks_written_by_hand_need_no_quotes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("marks.csv");
        std::fs::write(&path, "\n 1 , touch 0, left NA\n  \n2,away, \"x\"\n").unwrap();
        let texts = read(&path)
            .unwrap()
            .into_iter()
            .map(|mark| (mark.t_ns, mark.text));
        let wanted = [
            (1_000_000_000, "touch 0, left NA"),
            (2_000_000_000, "away, \"x\""),
        ];
        assert!(texts.eq(wanted.map(|(t_ns, text)| (t_ns, text.to_owned()))));
        for (text, wanted) in [
            ("1,a\nx,b\n", "marks.csv:2: \"x,b\" is no mark"),
            ("1\n", "marks.csv:1: \"1\" is no mark"),
            ("-1,a\n", "marks.csv:1: \"-1,a\" is no mark"),
            ("nan,a\n", "marks.csv:1: \"nan,a\" is no mark"),
            (
                "1,a\n1700000001200,b\n",
                "marks.csv:2: 1700000001200 is too great",
            ),
        ] {
            std::fs::write(&path, text).unwrap();
            let message = read(&path).unwrap_err().to_string();
            assert!(message.contains(wanted), "{message}");
        }
    }

    #[test]
    fn marks_are_read_as_tables_are() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("marks.csv");
        let wanted = [(1_200_000_000, "touch 0, left C0"), (2_000_000_000, "away")];
        for text in [
            "seconds,text\n1.2,touch 0, left C0\n2,away\n",
            "\u{feff}# of the robot\r\nTime [s];text\r\n1,2;touch 0, left C0\r\n2,0;away\r\n",
            "1.2;touch 0, left C0\n# it goes up\n2;away\n",
            "1.2\ttouch 0, left C0\n\n2\taway\n",
            "\"time\",\"text\"\n1.2,\"touch 0, left C0\"\n2,away\n",
        ] {
            std::fs::write(&path, text).unwrap();
            let marks = read(&path).map_err(|error| format!("{text}: {error}")).unwrap();
            let marks: Vec<(u64, &str)> = marks.iter().map(|mark| (mark.t_ns, &*mark.text)).collect();
            assert_eq!(marks, wanted, "{text}");
        }
        std::fs::write(&path, "t_s,text\n1,200,touch 0 C0\n2,000,away\n").unwrap();
        let message = read(&path).unwrap_err().to_string();
        let told =
            "marks.csv:2: \"1,200,touch 0 C0\" may be seconds with a decimal comma: write them with a point";
        assert!(message.contains(told), "{message}");
        // Numbers in the texts of some.
        std::fs::write(&path, "1,200,left\n2,away\n3.5,7,right\n").unwrap();
        assert_eq!(read(&path).unwrap()[0].text, "200,left");
    }

    #[test]
    fn marks_ahead_of_the_first_frame_are_counted_from_it_where_the_recording_is_long_enough() {
        let marks: Vec<Mark> = [(1, "touch"), (9, "away")]
            .map(|(s, text)| Mark {
                t_ns: s * 1_000_000_000,
                text: text.into(),
            })
            .into();
        let at = |first_s: u64, length_s: u64| {
            let times = [first_s, first_s + length_s].map(|s| s * 1_000_000_000);
            let counted = counted_from_first(&marks, &times, "away");
            counted.map(|(marks, _)| marks[0].t_ns / 1_000_000_000)
        };
        // A withdrawal may be behind the end.
        assert_eq!(
            (at(20, 10), at(1_700_000_000, 5)),
            (Some(21), Some(1_700_000_001))
        );
        // On its clock; and of another, longer one.
        assert_eq!((at(0, 10), at(1, 10), at(2, 0)), (None, None, None));
        assert_eq!(counted_from_first(&[], &[5, 6], "away"), None);
    }
}
