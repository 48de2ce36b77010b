//! Questions, and who answers them: a person at a terminal, the lines of stdin, or nobody (`--yes`).

use crate::wrap::wrap;
use anyhow::{Context, bail};
use std::io::{IsTerminal, Write};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, TryRecvError};
use std::time::Duration;
use taxel_playback::interrupt::Interrupt;

/// Between two looks whether the user wants to stop.
const LOOK: Duration = Duration::from_millis(50);
const WIDTH: usize = 80;

/// The answers, as they come.
#[derive(Debug)]
pub(super) struct Answers {
    lines: Receiver<String>,
    /// Every question is answered by what it proposes.
    yes: bool,
    is_typed: bool,
    interrupt: Interrupt,
}

/// What is there of the next answer.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Line {
    Text(String),
    NotYet,
    /// Nobody answers any more.
    Ended,
}

impl Answers {
    pub(super) fn new(yes: bool, interrupt: Interrupt) -> anyhow::Result<Self> {
        let (sender, lines) = mpsc::channel();
        if !yes {
            // On a thread of its own, which ends with the process: the buses are heard meanwhile.
            let read = move || {
                for line in std::io::stdin().lines().map_while(Result::ok) {
                    if sender.send(line).is_err() {
                        return;
                    }
                }
            };
            std::thread::Builder::new()
                .name("answers".into())
                .spawn(read)
                .context("a thread for the answers")?;
        }
        Ok(Self {
            lines,
            yes,
            is_typed: std::io::stdin().is_terminal(),
            interrupt,
        })
    }

    /// These lines, of a pipe.
    #[cfg(test)]
    pub(super) fn of_lines(given: &[&str]) -> Self {
        let (sender, lines) = mpsc::channel();
        for line in given {
            let _ = sender.send((*line).to_owned());
        }
        Self {
            lines,
            yes: false,
            is_typed: false,
            interrupt: Interrupt::install().unwrap(),
        }
    }

    /// Whether a person types the answers.
    pub(super) fn are_typed(&self) -> bool {
        self.is_typed && !self.yes
    }

    /// Asks; an empty answer is the proposal.
    pub(super) fn ask(&self, question: &str, proposal: &str) -> anyhow::Result<String> {
        let shown = match proposal {
            "" => String::new(),
            _ => format!(" [{proposal}]"),
        };
        prompt(&format!("{question}{shown}: "));
        if self.yes {
            say!("{proposal}");
            return Ok(proposal.into());
        }
        loop {
            if self.interrupt.is_set() {
                bail!(STOPPED);
            }
            match self.lines.recv_timeout(LOOK) {
                Ok(line) => {
                    self.echo(&line);
                    let line = line.trim();
                    return Ok(if line.is_empty() { proposal } else { line }.into());
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => {
                    say!("");
                    bail!(
                        "stdin ended where `{question}` is asked; --yes answers every question with what stands in [ ]"
                    );
                }
            }
        }
    }

    /// Asks for a yes or no.
    pub(super) fn confirm(&self, question: &str, proposal: bool) -> anyhow::Result<bool> {
        loop {
            let answer = self.ask(question, if proposal { "yes" } else { "no" })?;
            match answer.to_ascii_lowercase().as_str() {
                "y" | "yes" => return Ok(true),
                "n" | "no" => return Ok(false),
                _ => self.refuse(&format!("`{answer}` is neither yes nor no"))?,
            }
        }
    }

    /// An answer that makes no sense: a person is asked again, a script has failed.
    pub(super) fn refuse(&self, why: &str) -> anyhow::Result<()> {
        if !self.are_typed() {
            bail!("{why}");
        }
        say(why);
        Ok(())
    }

    /// The next answer if it is there.
    pub(super) fn poll(&self) -> Line {
        match self.lines.try_recv() {
            Ok(line) => {
                self.echo(&line);
                Line::Text(line.trim().into())
            }
            Err(TryRecvError::Empty) => Line::NotYet,
            Err(TryRecvError::Disconnected) => Line::Ended,
        }
    }

    /// What nobody has typed is shown behind its question all the same.
    fn echo(&self, line: &str) {
        if !self.is_typed {
            say!("{line}");
        }
    }
}

/// What is said where the user stops it.
pub(super) const STOPPED: &str = "stopped; nothing was written";

/// A sentence for the user.
pub(super) fn say(text: &str) {
    for line in wrap(text, WIDTH) {
        say!("{line}");
    }
}

/// The beginning of a line on which an answer is awaited.
pub(super) fn prompt(text: &str) {
    let mut err = std::io::stderr();
    let _ = write!(err, "{text}").and_then(|()| err.flush());
}
