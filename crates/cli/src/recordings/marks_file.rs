//! Marks as `.csv` (RFC 4180): seconds and text, a mark a line.

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
        let seconds = first
            .parse()
            .ok()
            .filter(|seconds: &f64| (0.0..1e9).contains(seconds));
        let (Some(seconds), true) = (seconds, line.len() > 1) else {
            let number = line.position().map_or(0, csv::Position::line);
            let line = line.iter().collect::<Vec<_>>().join(",");
            bail!("{}:{number}: {line:?} is no mark; a mark is SECONDS,TEXT", at());
        };
        marks.push(Mark {
            t_ns: (seconds * 1e9).round() as u64,
            text: text.trim().to_owned(),
        });
    }
    Ok(marks)
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
        ] {
            std::fs::write(&path, text).unwrap();
            let message = read(&path).unwrap_err().to_string();
            assert!(message.contains(wanted), "{message}");
        }
    }
}
