//! A thread that reads a serial port until it is told to end.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// How long after it was told to end a thread is waited for: longer than a cycle and the release of motors take. A driver
/// that does not return from a call keeps its thread for ever.
const PATIENCE: Duration = Duration::from_secs(3);
/// How often a thread that ends is looked at.
const LOOK: Duration = Duration::from_millis(1);

/// The thread. When this is dropped it is told to end, and waited for, but not for ever.
#[derive(Debug)]
pub(crate) struct ReadingThread {
    stop: Arc<AtomicBool>,
    /// When it was told to end.
    told: OnceLock<Instant>,
    handle: JoinHandle<()>,
}

impl ReadingThread {
    /// Starts a thread that ends once `stop` is set.
    pub(crate) fn start(
        name: &str,
        stop: Arc<AtomicBool>,
        main: impl FnOnce() + Send + 'static,
    ) -> io::Result<Self> {
        let handle = std::thread::Builder::new().name(name.into()).spawn(main)?;
        let told = OnceLock::new();
        Ok(Self { stop, told, handle })
    }

    /// Tells it to end, and does not wait.
    pub(crate) fn stop(&self) {
        self.told.get_or_init(Instant::now);
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Tells it to end and waits until it has, but not for ever; says whether it has.
    pub(crate) fn end(&self) -> bool {
        self.stop();
        self.ends_by(*self.told.get_or_init(Instant::now) + PATIENCE)
    }

    fn ends_by(&self, end: Instant) -> bool {
        while !self.handle.is_finished() {
            if Instant::now() >= end {
                return false;
            }
            std::thread::sleep(LOOK);
        }
        true
    }
}

impl Drop for ReadingThread {
    fn drop(&mut self) {
        self.end();
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
        let thread = ReadingThread::start("hangs", Arc::default(), main).unwrap();
        thread.stop();
        assert!(!thread.ends_by(Instant::now()));
        drop(returns);
        assert!(thread.end());
    }
}
