//! How far a long job has come, on stderr, where somebody is looking.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Whether the terminal shows something else.
static HIDDEN: AtomicBool = AtomicBool::new(false);

/// Shows no progress from now on: the terminal is drawn on.
pub(crate) fn hide() {
    HIDDEN.store(true, Ordering::Relaxed);
}

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

    /// Of a file of this many bytes.
    pub(crate) fn bytes(total: u64) -> Self {
        Self::with(Some(total), "{bar:40} {percent:>3}% of {total_bytes}, {eta} left")
    }

    /// Of something that takes `total_ms` milliseconds, or less.
    pub(crate) fn waiting(total_ms: u64, what: &str) -> Self {
        Self::with(Some(total_ms), &format!("{{bar:40}} {what}, {{eta}} left"))
    }

    /// Of a job whose size is not known.
    pub(crate) fn counting(what: &str) -> Self {
        Self::with(None, &format!("{{spinner}} {{pos}} {what}, {{elapsed}}"))
    }

    /// Of something that is done in one piece, such as writing a file.
    pub(crate) fn busy(what: String) -> Self {
        let progress = Self::with(None, "{spinner} {msg}, {elapsed}");
        progress.0.set_message(what);
        progress.0.enable_steady_tick(Duration::from_millis(100));
        progress
    }

    /// Of something that says itself how far it has come.
    pub(crate) fn none() -> Self {
        Self(ProgressBar::hidden())
    }

    fn with(total: Option<u64>, template: &str) -> Self {
        // Draws to stderr, and to nothing when that is no terminal.
        let target = match HIDDEN.load(Ordering::Relaxed) {
            true => ProgressDrawTarget::hidden(),
            false => ProgressDrawTarget::stderr(),
        };
        let bar = ProgressBar::with_draw_target(total, target);
        bar.set_style(ProgressStyle::with_template(template).expect("a template of known fields"));
        Self(bar)
    }

    /// A reader that counts what is read.
    pub(crate) fn reading<R: std::io::Read>(&self, reader: R) -> impl std::io::Read + use<R> {
        self.0.wrap_read(reader)
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
