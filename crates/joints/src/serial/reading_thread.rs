//! A thread that reads a serial port until it is told to end.

use crate::error::JointsConfigError;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// How long after it was told to end a thread is waited for: longer than a cycle and the release of motors take. A driver
/// that does not return from a call keeps its thread for ever.
const PATIENCE: Duration = Duration::from_secs(4);
/// How often a thread that ends is looked at.
const LOOK: Duration = Duration::from_millis(1);

/// Why a reader could not be started.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// The configuration makes no sense.
    #[error(transparent)]
    Config(#[from] JointsConfigError),
    /// No thread.
    #[error("cannot start the thread that reads joints: {0}")]
    Thread(io::Error),
}

/// How a thread that reads joints did not end as it should.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum ReadingThreadError {
    /// It has panicked, perhaps long ago: nobody has read the port since.
    #[error(
        "the thread that reads joints panicked, which is a fault of this program; motors stop by their own watchdogs"
    )]
    Panicked,
    /// It does not return from a call.
    #[error(
        "the thread that reads joints is left behind: the driver of its serial port does not return, and motors stop by \
         their own watchdogs"
    )]
    LeftBehind,
}

/// Notes, when it is dropped with all else of the thread, that the thread is over.
struct Over(Arc<OnceLock<Result<(), ReadingThreadError>>>);

impl Drop for Over {
    fn drop(&mut self) {
        let _ = self.0.set(match std::thread::panicking() {
            true => Err(ReadingThreadError::Panicked),
            false => Ok(()),
        });
    }
}

/// The thread. When this is dropped it is told to end, and waited for, but not for ever.
#[derive(Debug)]
pub(crate) struct ReadingThread {
    stop: Arc<AtomicBool>,
    /// When it was told to end.
    told: OnceLock<Instant>,
    /// How it ended; empty while it runs.
    over: Arc<OnceLock<Result<(), ReadingThreadError>>>,
}

impl ReadingThread {
    /// Starts a thread that calls `first`, and then `main`, which ends once `stop` is set.
    pub(crate) fn start(
        name: &str,
        stop: Arc<AtomicBool>,
        first: impl FnOnce() + Send + 'static,
        main: impl FnOnce() + Send + 'static,
    ) -> Result<Self, StartError> {
        let over = Arc::new(OnceLock::new());
        let at_end = Over(over.clone());
        let begun = std::thread::Builder::new().name(name.into()).spawn(move || {
            let _at_end = at_end;
            first();
            main();
        });
        begun.map_err(StartError::Thread)?;
        let told = OnceLock::new();
        Ok(Self { stop, told, over })
    }

    /// Tells it to end, and does not wait.
    pub(crate) fn stop(&self) {
        self.told.get_or_init(Instant::now);
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Whether it has panicked.
    pub(crate) fn has_panicked(&self) -> bool {
        self.over.get() == Some(&Err(ReadingThreadError::Panicked))
    }

    /// Tells it to end and waits until it has, but not for ever.
    pub(crate) fn end(&self) -> Result<(), ReadingThreadError> {
        self.stop();
        self.ends_by(*self.told.get_or_init(Instant::now) + PATIENCE)
    }

    fn ends_by(&self, end: Instant) -> Result<(), ReadingThreadError> {
        loop {
            if let Some(over) = self.over.get() {
                return *over;
            }
            if Instant::now() >= end {
                return Err(ReadingThreadError::LeftBehind);
            }
            std::thread::sleep(LOOK);
        }
    }
}

impl Drop for ReadingThread {
    fn drop(&mut self) {
        let _ = self.end();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc;

    #[test]
    fn a_thread_whose_driver_does_not_return_is_left_behind() {
        let (returns, hangs) = mpsc::channel::<()>();
        let main = move || {
            let _ = hangs.recv();
        };
        let thread = ReadingThread::start("hangs", Arc::default(), || {}, main).unwrap();
        thread.stop();
        assert_eq!(
            thread.ends_by(Instant::now()),
            Err(ReadingThreadError::LeftBehind)
        );
        drop(returns);
        assert_eq!(thread.end(), Ok(()));
    }

    #[test]
    fn a_thread_that_has_panicked_is_told_from_one_that_was_told_to_end() {
        for (panics, end) in [(true, Err(ReadingThreadError::Panicked)), (false, Ok(()))] {
            let thread =
                ReadingThread::start("panics", Arc::default(), move || assert!(!panics), || {}).unwrap();
            assert_eq!(thread.end(), end);
            assert_eq!(thread.has_panicked(), panics);
        }
    }
}
