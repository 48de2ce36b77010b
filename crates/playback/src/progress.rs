//! How far a long job has come, on stderr, where somebody is looking.

use crate::remarks;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// A progress bar, or nothing when stderr is not a terminal.
#[derive(Debug)]
pub struct Progress {
    bar: ProgressBar,
    /// Things done that the bar was not told of.
    untold: AtomicU64,
    /// As many as make a difference that can be seen.
    step: u64,
}

/// Things done between two looks at a job whose size is not known.
const STEP: u64 = 1024;

impl Progress {
    /// Of a job of `total` things.
    pub fn new(total: u64, what: &str) -> Self {
        Self::with(
            Some(total),
            &format!("{{bar:40}} {{percent:>3}}% of {{len}} {what}, {{eta}} left"),
        )
    }

    /// Of a file of this many bytes.
    pub fn bytes(total: u64) -> Self {
        Self::with(Some(total), "{bar:40} {percent:>3}% of {total_bytes}, {eta} left")
    }

    /// Of something that takes `total_ms` milliseconds, or less.
    pub fn waiting(total_ms: u64, what: &str) -> Self {
        Self::with(Some(total_ms), &format!("{{bar:40}} {what}, {{eta}} left"))
    }

    /// Of a job whose size is not known.
    pub fn counting(what: &str) -> Self {
        Self::with(None, &format!("{{spinner}} {{pos}} {what}, {{elapsed}}"))
    }

    /// Of something that is done in one piece, such as writing a file.
    pub fn busy(what: String) -> Self {
        let progress = Self::with(None, "{spinner} {msg}, {elapsed}");
        progress.bar.set_message(what);
        progress.bar.enable_steady_tick(Duration::from_millis(100));
        progress
    }

    /// Of something that says itself how far it has come.
    pub fn none() -> Self {
        Self::of(ProgressBar::hidden(), None)
    }

    fn with(total: Option<u64>, template: &str) -> Self {
        // Draws to stderr, and to nothing when that is no terminal, or somebody else draws on it.
        let target = match remarks::are_gathered() {
            true => ProgressDrawTarget::hidden(),
            false => ProgressDrawTarget::stderr(),
        };
        let bar = ProgressBar::with_draw_target(total, target);
        bar.set_style(ProgressStyle::with_template(template).expect("a template of known fields"));
        Self::of(bar, total)
    }

    fn of(bar: ProgressBar, total: Option<u64>) -> Self {
        Self {
            bar,
            untold: AtomicU64::new(0),
            step: total.map_or(STEP, |total| (total / STEP).clamp(1, STEP)),
        }
    }

    /// A reader that counts what is read.
    pub fn reading<R: std::io::Read>(&self, reader: R) -> impl std::io::Read + use<R> {
        self.bar.wrap_read(reader)
    }

    /// So many more are done.
    pub fn advance(&self, done: u64) {
        // Each word to the bar asks for the time, millions of CAN frames would for most of it.
        if self.untold.fetch_add(done, Ordering::Relaxed) + done >= self.step {
            self.bar.inc(self.untold.swap(0, Ordering::Relaxed));
        }
    }

    /// What is left is told by how fast things are done from here on.
    pub(crate) fn time_anew(&self) {
        self.bar.reset_eta();
    }

    /// So many are done in all.
    pub fn advance_to(&self, done: u64) {
        self.bar.set_position(done);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
