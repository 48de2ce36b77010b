//! The log: lines for standard error, written by a thread of their own. Also those of a program beside the daemon that
//! must not wait.
//!
//! Whoever reads standard error may stop reading (a stopped terminal, a pipe into a program that
//! hangs, a journal that waits for its disk), may have gone, or may have no room left. None of that
//! may hold up images or end the daemon, so lines wait in a queue of fixed size, those that find it
//! full are lost and counted, and what cannot be written is given up.

use nix::sys::signal::{SigSet, SigmaskHow};
use std::io::{self, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::time::{Duration, Instant};
use taxel_journal::Priority;
use tracing_subscriber::fmt::MakeWriter;

/// Lines that may wait to be written.
const LINES: usize = 1024;
/// How long the end of the program waits for the last lines to be written.
const PATIENCE: Duration = Duration::from_millis(500);

/// Where lines are put. It never waits and never fails.
#[derive(Debug, Clone)]
pub struct Log {
    lines: SyncSender<Vec<u8>>,
    lost: Arc<AtomicU64>,
}

/// Waits for the last lines when it is dropped, but not for long.
#[derive(Debug)]
pub struct Flush {
    log: Log,
    written: Receiver<()>,
}

impl Log {
    /// Starts the thread that writes to `to`. It takes no signals.
    pub fn start(to: impl Write + Send + 'static) -> io::Result<(Self, Flush)> {
        let (lines, received) = sync_channel::<Vec<u8>>(LINES);
        let (sender, written) = sync_channel(1);
        let log = Self {
            lines,
            lost: Arc::default(),
        };
        let lost = log.lost.clone();
        let mask = SigSet::all().thread_swap_mask(SigmaskHow::SIG_SETMASK)?;
        let thread = std::thread::Builder::new().name("log".into()).spawn(move || {
            write_lines(to, &received, &lost);
            let _ = sender.send(());
        });
        mask.thread_set_mask()?;
        thread?;
        let flush = Flush {
            log: log.clone(),
            written,
        };
        Ok((log, flush))
    }
}

/// Writes until an empty line comes.
fn write_lines(mut to: impl Write, lines: &Receiver<Vec<u8>>, lost: &AtomicU64) {
    for line in lines {
        // Nobody can be told that the log cannot be written.
        let _ = to.write_all(&line);
        match lost.swap(0, Ordering::Relaxed) {
            0 => {}
            lost => {
                let said =
                    format!("{lost} lines are lost here: nobody read them as fast as they were written");
                let _ = to.write_all(Priority::Warning.lines(&said).as_bytes());
            }
        }
        if line.is_empty() {
            return;
        }
    }
}

impl Log {
    /// Takes a text as it is, with the lines it has.
    pub fn say(&self, text: String) {
        if self.lines.try_send(text.into_bytes()).is_err() {
            self.lost.fetch_add(1, Ordering::Relaxed);
        }
    }
}

impl Write for &Log {
    /// Takes a whole line at once, as the formatter of `tracing` hands them over.
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        let mut whole = line.to_vec();
        // What a client has said begins no line of its own. Other control characters the formatter writes as text.
        for byte in whole
            .iter_mut()
            .rev()
            .skip(1)
            .filter(|byte| b"\n\r".contains(byte))
        {
            *byte = b' ';
        }
        if !line.is_empty() && self.lines.try_send(whole).is_err() {
            self.lost.fetch_add(1, Ordering::Relaxed);
        }
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl<'a> MakeWriter<'a> for Log {
    type Writer = &'a Log;

    fn make_writer(&'a self) -> Self::Writer {
        self
    }
}

impl Drop for Flush {
    fn drop(&mut self) {
        let deadline = Instant::now() + PATIENCE;
        let mut end = Vec::new();
        while let Err(TrySendError::Full(again)) = self.log.lines.try_send(end) {
            if Instant::now() >= deadline {
                return;
            }
            end = again;
            std::thread::sleep(Duration::from_millis(5));
        }
        let _ = self
            .written
            .recv_timeout(deadline.saturating_duration_since(Instant::now()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    /// Takes lines only while it is unlocked.
    #[derive(Clone, Default)]
    struct Paper(Arc<Mutex<Vec<u8>>>);

    impl Write for Paper {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.lock().unwrap().write(bytes)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_line_stays_one_whatever_is_told_in_it() {
        let paper = Paper::default();
        let (log, flush) = Log::start(paper.clone()).unwrap();
        (&log)
            .write_all(b"refused: no joint a\r\nERROR all is lost\n")
            .unwrap();
        drop(flush);
        let written = String::from_utf8(paper.0.lock().unwrap().clone()).unwrap();
        assert_eq!(written, "refused: no joint a  ERROR all is lost\n");
    }

    #[test]
    fn lines_come_in_order_and_the_last_before_the_end() {
        let paper = Paper::default();
        let (log, flush) = Log::start(paper.clone()).unwrap();
        for n in 0..500 {
            writeln!(&log, "{n}").unwrap();
        }
        drop(flush);
        let expected: String = (0..500).map(|n| format!("{n}\n")).collect();
        assert_eq!(
            String::from_utf8(paper.0.lock().unwrap().clone()).unwrap(),
            expected
        );
    }

    #[test]
    fn nobody_waits_for_a_log_that_is_not_read_and_what_is_lost_is_counted() {
        let paper = Paper::default();
        let stuck = paper.0.lock().unwrap();
        let (log, flush) = Log::start(paper.clone()).unwrap();
        let total = 10 * LINES as u64;
        for _ in 0..total {
            (&log).write_all(b"x\n").unwrap();
        }
        drop(stuck);
        // Read again: what waited is written, and how much did not.
        drop(flush);
        let text = String::from_utf8(paper.0.lock().unwrap().clone()).unwrap();
        let kept = text.lines().filter(|line| *line == "x").count() as u64;
        let lost: u64 = (text.lines())
            .filter_map(|line| {
                line.strip_suffix(" lines are lost here: nobody read them as fast as they were written")
            })
            .map(|lost| lost.parse::<u64>().unwrap())
            .sum();
        assert_eq!(kept + lost, total, "{kept} written, {lost} lost");
        assert!(lost > 0);
    }
}
