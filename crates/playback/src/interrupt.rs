//! Ctrl-C as a question that loops ask.

use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM};
use signal_hook::iterator::Signals;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// The longest sleep between two looks at the flag.
const LOOK: Duration = Duration::from_millis(50);

/// How soon behind a Ctrl-C another signal is the same one: `timeout` sends it to the command and to its group.
const SAME: Duration = Duration::from_millis(500);

/// What is to end a program and leaves it time to do so: a terminal that is raw is to be put right again.
const ENDING: [i32; 4] = [SIGINT, SIGTERM, SIGQUIT, SIGHUP];

/// Whether the work has taken over what ends a process.
static TAKEN_OVER: AtomicBool = AtomicBool::new(false);

/// Does `last` before Ctrl-C, SIGTERM or SIGQUIT ends the process, as they do without, until an [`Ending`] or an [`Interrupt`] has
/// taken them over and sees to its own end. SIGHUP is left alone: `nohup` has it ignored.
pub fn before_the_end(last: fn()) -> std::io::Result<()> {
    let mut signals = Signals::new([SIGINT, SIGTERM, SIGQUIT])?;
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

/// Ctrl-C, SIGTERM, SIGQUIT and SIGHUP for work that does not look at an [`Interrupt`]: from when they are caught until the work is
/// told what to remove, they wait.
#[derive(Debug)]
pub struct Ending(Signals);

impl Ending {
    /// Takes the signals over.
    pub fn catch() -> std::io::Result<Self> {
        TAKEN_OVER.store(true, Ordering::Relaxed);
        Ok(Self(Signals::new(ENDING)?))
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

/// Whether the user asked to stop. The first Ctrl-C (or SIGTERM, or SIGQUIT) sets it, the second, half a second later or more, ends
/// the process; SIGHUP only sets it.
#[derive(Debug, Clone)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Takes over SIGINT, SIGTERM, SIGQUIT, and SIGHUP, which a closed terminal sends.
    pub fn install() -> std::io::Result<Self> {
        let flag = Arc::new(AtomicBool::new(false));
        let mut signals = Signals::new(ENDING)?;
        TAKEN_OVER.store(true, Ordering::Relaxed);
        let asked = Arc::clone(&flag);
        std::thread::Builder::new()
            .name("signals".into())
            .spawn(move || {
                let mut patience = Patience::default();
                for signal in signals.forever() {
                    asked.store(true, Ordering::Relaxed);
                    // A closed terminal may send it twice, and nobody is impatient there.
                    if signal != SIGHUP && patience.has_ended(Instant::now()) {
                        signal_hook::low_level::exit(128 + signal);
                    }
                }
            })?;
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

/// That of somebody who has asked once.
#[derive(Debug, Default)]
struct Patience {
    asked: Option<Instant>,
}

impl Patience {
    /// Whether who asks at this time has asked before.
    fn has_ended(&mut self, now: Instant) -> bool {
        let asked = *self.asked.get_or_insert(now);
        now.saturating_duration_since(asked) >= SAME
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signal_that_comes_twice_at_once_is_one_and_the_next_ends_the_process() {
        let began = Instant::now();
        for (times_ms, ended) in [
            (&[0, 0][..], &[false, false][..]),
            (&[0, 1, 499], &[false, false, false]),
            (&[0, 500], &[false, true]),
            (&[0, 3, 2000], &[false, false, true]),
        ] {
            let mut patience = Patience::default();
            let at = |ms: &u64| patience.has_ended(began + Duration::from_millis(*ms));
            assert_eq!(times_ms.iter().map(at).collect::<Vec<_>>(), ended, "{times_ms:?}");
        }
    }
}
