//! What a check says: one finding about one thing.

use serde_json::{Value, json};
use std::borrow::Cow;
use taxel_diagnose::{Problem, Severity};
use taxel_wire::status::ProblemStatus;

/// How it stands with what was looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum State {
    /// As it should be.
    Ok,
    /// It works, but not as well as it could.
    Warning,
    /// It does not work.
    Error,
    /// Not looked at; `found` says why.
    Skipped,
}

impl State {
    pub(crate) const fn name(self) -> &'static str {
        match self {
            State::Ok => "ok",
            State::Warning => "warning",
            State::Error => "error",
            State::Skipped => "skipped",
        }
    }
}

/// What to do about it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Mend {
    /// A command, as it is typed.
    Run(String),
    /// Something that no command does.
    Do(String),
}

/// One finding.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Check {
    /// Which part of the whole: `machine`, `link`, `daemon`, `hand`, `servos`.
    pub(crate) area: &'static str,
    /// What was looked at, in a word or two that scripts can compare.
    pub(crate) name: Cow<'static, str>,
    /// Of which thing: an interface, a bus, a board, a servo; empty where there is one only.
    pub(crate) object: String,
    pub(crate) state: State,
    /// What was found.
    pub(crate) found: String,
    /// What should have been found; empty where there is nothing to add.
    pub(crate) wanted: String,
    pub(crate) mend: Vec<Mend>,
}

impl Check {
    /// All that mends it.
    #[cfg(test)]
    pub(crate) fn mend_text(&self) -> String {
        let text = |mend: &Mend| match mend {
            Mend::Run(text) | Mend::Do(text) => format!("{text}\n"),
        };
        self.mend.iter().map(text).collect()
    }

    fn new(
        state: State,
        area: &'static str,
        name: impl Into<Cow<'static, str>>,
        object: impl Into<String>,
        found: impl Into<String>,
    ) -> Self {
        Self {
            area,
            name: name.into(),
            object: object.into(),
            state,
            found: found.into(),
            wanted: String::new(),
            mend: Vec::new(),
        }
    }

    pub(crate) fn ok(
        area: &'static str,
        name: &'static str,
        object: impl Into<String>,
        found: impl Into<String>,
    ) -> Self {
        Self::new(State::Ok, area, name, object, found)
    }

    pub(crate) fn warning(
        area: &'static str,
        name: &'static str,
        object: impl Into<String>,
        found: impl Into<String>,
    ) -> Self {
        Self::new(State::Warning, area, name, object, found)
    }

    pub(crate) fn error(
        area: &'static str,
        name: &'static str,
        object: impl Into<String>,
        found: impl Into<String>,
    ) -> Self {
        Self::new(State::Error, area, name, object, found)
    }

    pub(crate) fn skipped(
        area: &'static str,
        name: &'static str,
        object: impl Into<String>,
        why: impl Into<String>,
    ) -> Self {
        Self::new(State::Skipped, area, name, object, why)
    }

    /// A problem: what is wrong in its words, and what to do.
    pub(crate) fn of_problem(area: &'static str, object: impl Into<String>, problem: &Problem) -> Self {
        let state = match problem.severity() {
            Severity::Warning => State::Warning,
            Severity::Error => State::Error,
        };
        let check = Self::new(state, area, problem.kind.name(), object, problem.found.as_str());
        match problem.advice.as_str() {
            "" => check,
            advice => check.advise(advice),
        }
    }

    /// A problem that a daemon tells, in its own sentence.
    pub(crate) fn told(area: &'static str, object: impl Into<String>, problem: &ProblemStatus) -> Self {
        let state = match problem.severe {
            true => State::Error,
            false => State::Warning,
        };
        Self::new(
            state,
            area,
            problem.kind.clone(),
            object,
            problem.sentence.as_str(),
        )
    }

    /// The same, without what it says on how to mend it.
    #[must_use]
    pub(crate) fn without_mend(mut self) -> Self {
        self.mend.clear();
        self
    }

    #[must_use]
    pub(crate) fn wanted(mut self, wanted: impl Into<String>) -> Self {
        self.wanted = wanted.into();
        self
    }

    /// A command that mends it.
    #[must_use]
    pub(crate) fn run(mut self, command: impl Into<String>) -> Self {
        self.mend.push(Mend::Run(command.into()));
        self
    }

    /// Advice.
    #[must_use]
    pub(crate) fn advise(mut self, advice: impl Into<String>) -> Self {
        self.mend.push(Mend::Do(advice.into()));
        self
    }

    /// As `--json` has it; `mend` is one text, a line per step, or null.
    pub(crate) fn json(&self) -> Value {
        let steps: Vec<&str> = self
            .mend
            .iter()
            .map(|mend| match mend {
                Mend::Run(text) | Mend::Do(text) => text.as_str(),
            })
            .collect();
        json!({
            "area": self.area,
            "name": self.name,
            "object": self.object,
            "state": self.state.name(),
            "found": self.found,
            "wanted": (!self.wanted.is_empty()).then_some(&self.wanted),
            "mend": (!steps.is_empty()).then(|| steps.join("\n")),
        })
    }
}
