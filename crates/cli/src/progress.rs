//! How far a long job has come, on stderr, where somebody is looking.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// A progress bar, or nothing when stderr is not a terminal.
#[derive(Debug)]
pub(crate) struct Progress(ProgressBar);

impl Progress {
    /// Of a job of `total` things.
    pub(crate) fn new(total: u64, what: &str) -> Self {
        Self::with(
            Some(total),
            &format!("{{bar:40}} {{percent:>3}}% of {{len}} {what}, {{eta}} left"),
        )
    }

    /// Of something that takes `total_ms` milliseconds, or less.
    pub(crate) fn waiting(total_ms: u64, what: &str) -> Self {
        Self::with(Some(total_ms), &format!("{{bar:40}} {what}, {{eta}} left"))
    }

    /// Of a job whose size is not known.
    pub(crate) fn counting(what: &str) -> Self {
        Self::with(None, &format!("{{spinner}} {{pos}} {what}, {{elapsed}}"))
    }

    fn with(total: Option<u64>, template: &str) -> Self {
        // Draws to stderr, and to nothing when that is no terminal.
        let bar = ProgressBar::with_draw_target(total, ProgressDrawTarget::stderr());
        bar.set_style(ProgressStyle::with_template(template).expect("a template of known fields"));
        Self(bar)
    }

    /// So many more are done.
    pub(crate) fn advance(&self, done: u64) {
        self.0.inc(done);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}
