//! A terminal that is drawn on again and again, and its keys.

use anyhow::Context;
use ratatui::backend::{Backend, CrosstermBackend};
use ratatui::crossterm::event::{self, Event, KeyEvent};
use ratatui::{Frame, Terminal};
use std::io::{IsTerminal, Stdout, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant};
use taxel_playback::interrupt::Interrupt;
use taxel_playback::remarks::Remarks;

/// Time between two pictures, at least.
const REDRAW: Duration = Duration::from_millis(50);
/// What pictures may take of a connection, bytes per second, where the terminal is far away.
const FAR_BYTES_PER_S: f64 = 24e3;
/// And where it is on this machine.
const NEAR_BYTES_PER_S: f64 = 400e3;

/// What is drawn.
pub(crate) trait Shown {
    /// Draws a picture; returns false when there is nothing more to see.
    fn draw(&mut self, frame: &mut Frame<'_>) -> bool;
    /// Does what a key asks; returns whether to go on.
    fn key(&mut self, key: KeyEvent) -> bool;
    /// Shows what happened by itself, which is printed again when the terminal is given back. It does not take the place
    /// of what became of a key.
    fn tell(&mut self, words: String);
}

/// Whether stdout is a terminal that can be drawn on.
pub(crate) fn can_draw() -> bool {
    let dumb = std::env::var_os("TERM").is_none_or(|term| term.is_empty() || term == "dumb");
    std::io::stdout().is_terminal() && !dumb
}

/// Draws until the deadline, Ctrl-C, the key that ends it, or until there is nothing more to see.
///
/// A connection takes only so many bytes: the next picture waits until the one before is paid for. What is said
/// meanwhile is shown, and printed behind the last picture.
pub(crate) fn show(
    shown: &mut dyn Shown,
    interrupt: &Interrupt,
    deadline: Option<Instant>,
    mut remarks: Remarks,
) -> anyhow::Result<()> {
    let keys = keys()?;
    // Restores the terminal on panic, too; the one that is drawn on counts its bytes.
    drop(ratatui::try_init().context("the terminal; --headless or a pipe does without")?);
    let sent = Arc::new(AtomicU64::new(0));
    let out = Counting {
        out: std::io::stdout(),
        sent: sent.clone(),
    };
    let mut terminal = Terminal::new(CrosstermBackend::new(out)).context("the terminal")?;
    // Where there is no alternate screen, as on the console of Linux, the lines before are still there.
    terminal.backend_mut().clear().context("the terminal")?;
    let is_far = ["SSH_CONNECTION", "SSH_TTY"]
        .iter()
        .any(|name| std::env::var_os(name).is_some());
    let bytes_per_s = if is_far { FAR_BYTES_PER_S } else { NEAR_BYTES_PER_S };
    let mut drawn = || -> anyhow::Result<()> {
        while !interrupt.is_set() && deadline.is_none_or(|deadline| Instant::now() < deadline) {
            let (began, before) = (Instant::now(), sent.load(Ordering::Relaxed));
            let mut go_on = true;
            let news = remarks.news();
            if !news.is_empty() {
                let words = news
                    .iter()
                    .map(|line| line.strip_prefix("taxel: ").unwrap_or(line));
                shown.tell(words.collect::<Vec<_>>().join("; "));
            }
            terminal
                .draw(|frame| go_on = shown.draw(frame))
                .context("the terminal")?;
            if !go_on {
                break;
            }
            let bytes = sent.load(Ordering::Relaxed) - before;
            let paid = Duration::from_secs_f64(bytes as f64 / bytes_per_s);
            let next = began + REDRAW.max(paid.min(Duration::from_secs(1)));
            let next = deadline.map_or(next, |deadline| next.min(deadline));
            loop {
                match keys.recv_timeout(next.saturating_duration_since(Instant::now())) {
                    Ok(key) if shown.key(key) => {}
                    Ok(_) => return Ok(()),
                    Err(RecvTimeoutError::Timeout) => break,
                    Err(RecvTimeoutError::Disconnected) => {
                        interrupt.sleep_until(next);
                        break;
                    }
                }
            }
        }
        Ok(())
    };
    let outcome = drawn();
    if ratatui::try_restore().is_err() {
        // The terminal was closed. Dropped, it would complain on it, and panic.
        std::mem::forget(terminal);
    }
    outcome
}

/// Stdout, and how many bytes went there.
struct Counting {
    out: Stdout,
    sent: Arc<AtomicU64>,
}

impl Write for Counting {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let written = self.out.write(bytes)?;
        self.sent.fetch_add(written as u64, Ordering::Relaxed);
        Ok(written)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.out.flush()
    }
}

/// The keys pressed from now on.
///
/// They are read on a thread of their own, which ends with the process: reading from a terminal
/// that was closed may never return.
fn keys() -> anyhow::Result<mpsc::Receiver<KeyEvent>> {
    let (sender, keys) = mpsc::channel();
    let read = move || {
        while let Ok(event) = event::read() {
            if let Event::Key(key) = event
                && sender.send(key).is_err()
            {
                return;
            }
        }
    };
    std::thread::Builder::new()
        .name("keys".into())
        .spawn(read)
        .context("a thread for the keyboard")?;
    Ok(keys)
}
