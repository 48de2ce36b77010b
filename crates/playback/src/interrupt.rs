//! Ctrl-C as a question that loops ask.

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// The longest sleep between two looks at the flag.
const LOOK: Duration = Duration::from_millis(50);

/// Whether the work has taken over what ends a process.
static TAKEN_OVER: AtomicBool = AtomicBool::new(false);

/// Does `last` before Ctrl-C or SIGTERM ends the process, as they do without, until an [`Ending`] or an [`Interrupt`] has
/// taken them over and sees to its own end. SIGHUP is left alone: `nohup` has it ignored.
pub fn before_the_end(last: fn()) -> std::io::Result<()> {
    let mut signals = Signals::new([SIGINT, SIGTERM])?;
    std::thread::Builder::new()
        .name("before the end".into())
        .spawn(move || {
            for signal in signals.forever() {
                if !TAKEN_OVER.load(Ordering::Relaxed) {
                    last();
                    let _ = signal_hook::low_level::emulate_default_handler(signal);
                }
            }
        })?;
    Ok(())
}

/// Ctrl-C, SIGTERM and SIGHUP for work that does not look at an [`Interrupt`]: from when they are caught until the work is
/// told what to remove, they wait.
#[derive(Debug)]
pub struct Ending(Signals);

impl Ending {
    /// Takes the signals over.
    pub fn catch() -> std::io::Result<Self> {
        TAKEN_OVER.store(true, Ordering::Relaxed);
        Ok(Self(Signals::new([SIGINT, SIGTERM, SIGHUP])?))
    }

    /// Ends the process at the first of them, once these files of half a result are removed, and `last` is done.
    pub fn remove(mut self, parts: Vec<PathBuf>, last: fn()) -> std::io::Result<()> {
        std::thread::Builder::new()
            .name("signals".into())
            .spawn(move || {
                if let Some(signal) = self.0.forever().next() {
                    for part in parts {
                        let _ = std::fs::remove_file(part);
                    }
                    last();
                    std::process::exit(128 + signal);
                }
            })?;
        Ok(())
    }
}

/// Whether the user asked to stop. The first Ctrl-C (or SIGTERM) sets it, the second ends the
/// process; SIGHUP only sets it.
#[derive(Debug, Clone)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Takes over SIGINT, SIGTERM, and SIGHUP, which a closed terminal sends.
    pub fn install() -> std::io::Result<Self> {
        TAKEN_OVER.store(true, Ordering::Relaxed);
        let flag = Arc::new(AtomicBool::new(false));
        for signal in [SIGINT, SIGTERM] {
            // In this order: the second signal finds the flag that the first has set.
            signal_hook::flag::register_conditional_shutdown(signal, 128 + signal, flag.clone())?;
            signal_hook::flag::register(signal, flag.clone())?;
        }
        // A closed terminal may send it twice, and nobody is impatient there.
        signal_hook::flag::register(SIGHUP, flag.clone())?;
        Ok(Self(flag))
    }

    /// Whether to stop.
    pub fn is_set(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// Sleeps until `deadline`; returns early, and false, when asked to stop.
    pub fn sleep_until(&self, deadline: Instant) -> bool {
        loop {
            if self.is_set() {
                return false;
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return true;
            }
            std::thread::sleep(left.min(LOOK));
        }
    }
}
