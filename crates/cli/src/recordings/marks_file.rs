//! Marks as `.csv` (RFC 4180): seconds and text, a mark a line.

use super::own_clock::{CLOCK_S, LATE_NS, instant_ns};
use anyhow::{Context, bail};
use std::path::Path;
use taxel_sequence::Mark;

/// The name of the first column, where there is a line of names.
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

/// Reads marks in the order of the file. Commas behind the first belong to the text, quoted or not.
pub(crate) fn read(path: &Path) -> anyhow::Result<Vec<Mark>> {
    let at = || path.display().to_string();
    let lines = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .from_path(path);
    let mut marks = Vec::new();
    for line in lines.with_context(at)?.records() {
        let line = line.with_context(at)?;
        let (first, text) = (line[0].trim(), line.iter().skip(1).collect::<Vec<_>>().join(","));
        if first == SECONDS || first.is_empty() && line.len() == 1 {
            continue;
        }
        let number = line.position().map_or(0, csv::Position::line);
        let seconds = first.parse().ok().filter(|seconds: &f64| *seconds >= 0.0);
        let (Some(seconds), true) = (seconds, line.len() > 1) else {
            let line = line.iter().collect::<Vec<_>>().join(",");
            bail!("{}:{number}: {line:?} is no mark; a mark is SECONDS,TEXT", at());
        };
        if !CLOCK_S.contains(&seconds) {
            bail!(
                "{}:{number}: {first} is too great for a mark's seconds, which are up to {:.0}; is it in another unit?",
                at(),
                CLOCK_S.end()
            );
        }
        marks.push(Mark {
            t_ns: instant_ns(seconds),
            text: text.trim().to_owned(),
        });
    }
    Ok(marks)
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
