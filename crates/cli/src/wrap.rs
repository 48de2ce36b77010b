//! Prose in lines that fit.

use taxel_playback::stand_in::as_named;

/// Breaks a text into lines of at most `width` characters, at blanks where there are any.
pub(crate) fn wrap(text: &str, width: usize) -> Vec<String> {
    let mut lines = Vec::new();
    let mut line = String::new();
    for word in as_named(text.into()).split_whitespace() {
        if !line.is_empty() && line.chars().count() + 1 + word.chars().count() > width {
            lines.push(std::mem::take(&mut line));
        }
        if !line.is_empty() {
            line.push(' ');
        }
        line += word;
    }
    lines.push(line);
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_fit_and_no_word_is_lost() {
        let text = "a bb ccc ".repeat(60);
        let lines = wrap(&text, 100);
        assert!(lines.iter().all(|line| line.len() <= 100) && lines[0].len() > 95);
        assert!(lines.join(" ").split_whitespace().eq(text.split_whitespace()));
        let long = "x".repeat(130);
        assert_eq!(wrap(&format!("a {long} b"), 100), ["a", &long, "b"]);
    }
}
