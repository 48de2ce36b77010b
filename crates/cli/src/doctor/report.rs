//! The findings for people: at most 80 columns but for commands, colour on a terminal only.

use super::finding::{Check, Mend, State};
use crate::wrap::wrap;
use std::io::{self, IsTerminal, Write};
use taxel_hand::plural;
use taxel_playback::stand_in::as_named;

const WIDTH: usize = 80;
/// Columns of a line before what was found.
const INDENT: usize = 10;
/// Stands for a blank at which no line is broken.
const GLUE: &str = "\u{1f}";
/// More findings than this are put together, if they are good ones of one kind or say the same.
const FEW: usize = 2;

/// How the findings are written.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Style {
    colour: bool,
}

impl Style {
    /// Without colour.
    #[cfg(test)]
    pub(crate) const PLAIN: Self = Self { colour: false };

    /// Colour where stdout is a terminal and nobody objects (`NO_COLOR`).
    pub(crate) fn of_stdout() -> Self {
        Self {
            colour: Self::may_colour(io::stdout().is_terminal()),
        }
    }

    /// The same for stderr.
    pub(crate) fn of_stderr() -> Self {
        Self {
            colour: Self::may_colour(io::stderr().is_terminal()),
        }
    }

    fn may_colour(is_terminal: bool) -> bool {
        let objects = std::env::var_os("NO_COLOR").is_some_and(|v| !v.is_empty())
            || std::env::var_os("TERM").is_some_and(|v| v == "dumb");
        is_terminal && !objects
    }

    fn paint(self, code: &str, text: &str) -> String {
        match self.colour {
            true => format!("\x1b[{code}m{text}\x1b[0m"),
            false => text.to_string(),
        }
    }

    fn state(self, state: State) -> String {
        self.paint(code(state), &format!("{:7}", state.name()))
    }
}

/// The colour of a state, as the terminal is told it.
fn code(state: State) -> &'static str {
    match state {
        State::Ok => "32",
        State::Warning => "33",
        State::Error => "1;31",
        State::Skipped => "2",
    }
}

/// Writes findings of one area after the other, as they come.
pub(crate) struct Report<W> {
    out: W,
    style: Style,
    area: &'static str,
}

impl<W: Write> Report<W> {
    pub(crate) fn new(out: W, style: Style) -> Self {
        Self { out, style, area: "" }
    }

    /// Writes these findings; those of one area follow one another.
    pub(crate) fn write(&mut self, checks: &[Check]) -> io::Result<()> {
        let mut rest = checks;
        while let Some(first) = rest.first() {
            if first.area != self.area {
                let gap = if self.area.is_empty() { "" } else { "\n" };
                writeln!(self.out, "{gap}{}", self.style.paint("1", first.area))?;
                self.area = first.area;
            }
            let alike = rest.iter().take_while(|c| is_alike(first, c)).count();
            let count = alike.max(1);
            if alike > FEW {
                self.together(&rest[..alike])?;
            } else {
                rest[..count].iter().try_for_each(|c| self.one(c))?;
            }
            // What mends the next ones as well is told after the last of them.
            if rest.get(count).is_none_or(|next| !is_mended_alike(first, next)) {
                self.mend(first)?;
            }
            rest = &rest[count..];
        }
        self.out.flush()
    }

    /// Writes lines as they are, such as a drawing.
    pub(crate) fn lines(&mut self, lines: &[String]) -> io::Result<()> {
        for line in lines {
            writeln!(self.out, "{:INDENT$}{line}", "")?;
        }
        self.out.flush()
    }

    fn one(&mut self, check: &Check) -> io::Result<()> {
        let found = found(check);
        // A sentence that names its object says it once.
        let text = match check.object.is_empty() || names(&found, &check.object) {
            true => format!("{}: {found}", check.name),
            false => format!("{} {}: {found}", check.object, check.name),
        };
        self.item(check.state, &text)
    }

    fn mend(&mut self, check: &Check) -> io::Result<()> {
        for mend in &check.mend {
            match mend {
                Mend::Run(command) => {
                    for line in as_named(command.clone()).lines() {
                        writeln!(self.out, "{:INDENT$}$ {}", "", self.style.paint("36", line))?;
                    }
                }
                Mend::Do(advice) => {
                    for line in wrap(advice, WIDTH - INDENT - 2) {
                        writeln!(self.out, "{:INDENT$}> {line}", "")?;
                    }
                }
            }
        }
        Ok(())
    }

    fn together(&mut self, checks: &[Check]) -> io::Result<()> {
        let first = &checks[0];
        let same = checks.iter().all(|c| c.found == first.found);
        let each: Vec<String> = checks
            .iter()
            .map(|c| match same {
                true => c.object.replace(' ', GLUE),
                false => format!("{} {}", c.object, c.found).replace(' ', GLUE),
            })
            .collect();
        let found = if same {
            format!(" {}", found(first))
        } else {
            String::new()
        };
        let text = format!("{} ({}){found}: {}", first.name, checks.len(), each.join(", "));
        self.item(first.state, &text)
    }

    fn item(&mut self, state: State, text: &str) -> io::Result<()> {
        let lines = wrap(text, WIDTH - INDENT);
        for (i, line) in lines.iter().enumerate() {
            let head = if i == 0 {
                format!("  {} ", self.style.state(state))
            } else {
                " ".repeat(INDENT)
            };
            writeln!(self.out, "{head}{}", line.replace(GLUE, " "))?;
        }
        Ok(())
    }
}

/// What was found and what should have been.
fn found(check: &Check) -> String {
    match check.state == State::Ok || check.wanted.is_empty() {
        true => check.found.clone(),
        false => format!("{}; wanted {}", check.found, check.wanted),
    }
}

/// Whether a sentence has this name in it, as a word or words of its own.
fn names(sentence: &str, name: &str) -> bool {
    let is_of_word = |c: char| c.is_alphanumeric() || c == '/';
    sentence.match_indices(name).any(|(at, _)| {
        !sentence[..at].ends_with(is_of_word) && !sentence[at + name.len()..].starts_with(is_of_word)
    })
}

fn is_mended_alike(a: &Check, b: &Check) -> bool {
    (a.state, a.area, &a.name, &a.mend) == (b.state, b.area, &b.name, &b.mend)
}

/// Whether findings can be put together: good ones of one kind, bad ones only if nothing but the
/// object differs.
fn is_alike(a: &Check, b: &Check) -> bool {
    let good = |c: &Check| matches!(c.state, State::Ok | State::Skipped) && c.mend.is_empty();
    let of_one_kind = (a.state, a.area, &a.name) == (b.state, b.area, &b.name) && !b.object.is_empty();
    let same = (&a.found, &a.wanted, &a.mend) == (&b.found, &b.wanted, &b.mend);
    of_one_kind && (same || good(a) && good(b))
}

/// The last line: how many of each.
pub(crate) fn summary(checks: &[Check], style: Style) -> String {
    let count = |state: State| checks.iter().filter(|c| c.state == state).count();
    let (errors, warnings) = (count(State::Error), count(State::Warning));
    let skipped = match count(State::Skipped) {
        0 => String::new(),
        n => format!(", {n} skipped"),
    };
    let lit = |state: State, n: usize| {
        let text = plural(n, state.name());
        if n == 0 {
            text
        } else {
            style.paint(code(state), &text)
        }
    };
    let bad = [lit(State::Error, errors), lit(State::Warning, warnings)].join(", ");
    format!("{bad}, {} ok{skipped}", count(State::Ok))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(checks: &[Check]) -> String {
        let mut report = Report::new(Vec::new(), Style::PLAIN);
        report.write(checks).unwrap();
        String::from_utf8(report.out).unwrap()
    }

    #[test]
    fn prose_stays_within_80_columns_and_commands_stay_whole() {
        let command =
            "sudo ip link set can0 down && sudo ip link set can0 up type can bitrate 1000000 restart-ms 100";
        let check = Check::warning("link", "restart-ms", "can0", "0 ".repeat(60))
            .wanted("100")
            .run(command)
            .advise("word ".repeat(40));
        let text = written(&[check]);
        assert!(text.contains(&format!("$ {command}\n")), "{text}");
        for line in text.lines().filter(|l| !l.contains('$')) {
            assert!(line.chars().count() <= 80, "{line}");
        }
        assert!(!text.contains('\x1b'), "{text}");
    }

    #[test]
    fn good_findings_of_one_kind_are_put_together_and_bad_ones_if_they_say_the_same() {
        let ok = |object: &str, found: &str| Check::ok("hand", "board", object, found);
        let bad = |object: &str, found: &str| {
            Check::error("hand", "board", object, found)
                .wanted("it")
                .advise("plug")
        };
        for (checks, lines) in [
            (
                vec![
                    ok("a", "50 Hz"),
                    ok("b", "50 Hz"),
                    ok("c", "50 Hz"),
                    bad("e", "silent"),
                ],
                &[
                    "  ok      board (3) 50 Hz: a, b, c",
                    "  error   e board: silent; wanted it",
                    "          > plug",
                ][..],
            ),
            (
                vec![ok("a", "50 Hz"), ok("b", "51 Hz"), ok("c", "52 Hz")],
                &["  ok      board (3): a 50 Hz, b 51 Hz, c 52 Hz"],
            ),
            (
                vec![
                    bad("a", "silent"),
                    bad("b", "silent"),
                    bad("c", "silent"),
                    bad("d", "late"),
                ],
                &[
                    "  error   board (3) silent; wanted it: a, b, c",
                    "  error   d board: late; wanted it",
                    "          > plug",
                ],
            ),
            (
                (1..=4)
                    .map(|n| bad(&format!("index middle (can0 board {n})"), "silent"))
                    .collect(),
                &[
                    "  error   board (4) silent; wanted it: index middle (can0 board 1),",
                    "          index middle (can0 board 2), index middle (can0 board 3),",
                    "          index middle (can0 board 4)",
                    "          > plug",
                ],
            ),
        ] {
            let text = written(&checks);
            assert_eq!(text.lines().skip(1).collect::<Vec<_>>(), lines);
        }
    }

    #[test]
    fn a_sentence_that_names_its_object_names_it_once() {
        let lines = [
            Check::error("hand", "bus-off", "can1", "can1: the controller is off the bus"),
            Check::error(
                "hand",
                "servo-silent",
                "servo 2",
                "joints: servo 21 (id 21) is silent",
            ),
        ];
        let text = written(&lines);
        assert_eq!(
            text.lines().skip(1).collect::<Vec<_>>(),
            [
                "  error   bus-off: can1: the controller is off the bus",
                "  error   servo 2 servo-silent: joints: servo 21 (id 21) is silent",
            ]
        );
    }

    #[test]
    fn the_summary_counts() {
        let checks = [
            Check::ok("a", "b", "", ""),
            Check::error("a", "b", "", ""),
            Check::warning("a", "b", "", ""),
            Check::warning("a", "b", "", ""),
            Check::skipped("a", "b", "", ""),
        ];
        assert_eq!(
            summary(&checks, Style::PLAIN),
            "1 error, 2 warnings, 1 ok, 1 skipped"
        );
        assert_eq!(
            summary(&checks[..2], Style { colour: true }),
            "\x1b[1;31m1 error\x1b[0m, 0 warnings, 1 ok"
        );
    }
}
