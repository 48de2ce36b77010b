//! The thread that reads potentiometers, and what it shows.

use super::config::{AnalogueConfig, READINGS_KEPT};
use super::lines::{AnalogueCounters, AnalogueLines, HeardChannel, NoAngle};
use crate::serial::{
    Port, PortError, PortStatus, ReadingThread, ReadingThreadError, StartError, history_since, lock,
};
use crate::synchrony::JointHistory;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use taxel_can::monotonic_ns;

/// Pause before a port is opened again.
const PAUSE: Duration = Duration::from_millis(200);
/// How often the thread looks whether it shall end.
const LOOK: Duration = Duration::from_millis(20);

/// What is known of the potentiometers, one entry per joint in the order of the configuration.
#[derive(Debug, Clone, PartialEq)]
pub struct AnalogueSnapshot {
    /// Angles of the newest good line, radians, or why there is none.
    pub angles: Vec<Result<f64, NoAngle>>,
    /// The same of the newest good line that has the joint's channel; `None` where none has had it.
    pub heard: Vec<Option<HeardChannel>>,
    /// What happened on the port.
    pub counters: AnalogueCounters,
    /// The serial port.
    pub port: PortStatus,
    /// Since when it is open, nanoseconds; 0 before.
    pub open_ns: u64,
}

#[derive(Debug)]
struct Shared {
    snapshot: AnalogueSnapshot,
    history: JointHistory,
}

impl AnalogueSnapshot {
    /// Why a joint has no angle at `now_ns`; `None` where it has one. A program may print its channels on lines of their own:
    /// one that is not in the newest line is missing only where it was in none for longer than `hold_ns`.
    pub fn lost(&self, joint: usize, now_ns: u64, hold_ns: u64) -> Option<NoAngle> {
        let lost = self.angles.get(joint)?.err()?;
        let heard = self.heard.get(joint).copied().flatten();
        match heard.filter(|heard| now_ns.saturating_sub(heard.t_ns) <= hold_ns) {
            Some(heard) if lost == NoAngle::Missing => heard.angle.err(),
            _ => Some(lost),
        }
    }
}

/// Reads potentiometers on a serial port in a thread of its own, for ever: a port that goes away is opened again. Nothing
/// is ever written to it. Dropping it ends the thread and waits for that, but not for ever.
#[derive(Debug)]
pub struct AnalogueReader {
    shared: Arc<Mutex<Shared>>,
    /// Good lines whose angles are in the history. It grows while `shared` is locked.
    published: Arc<AtomicU64>,
    thread: ReadingThread,
}

impl AnalogueReader {
    /// Starts the thread, which calls `first` before anything else. A port that is not there yet is no error.
    pub fn start(config: &AnalogueConfig, first: impl FnOnce() + Send + 'static) -> Result<Self, StartError> {
        config.check()?;
        let lines = AnalogueLines::new(config);
        let shared = Arc::new(Mutex::new(Shared {
            snapshot: AnalogueSnapshot {
                angles: lines.angles().to_vec(),
                heard: lines.heard().to_vec(),
                counters: lines.counters(),
                port: PortStatus::starting(config.device.clone()),
                open_ns: 0,
            },
            history: JointHistory::new(config.joint.len(), READINGS_KEPT),
        }));
        let (stop, published) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicU64::new(0)));
        let thread = Thread {
            lines,
            path: config.device.clone(),
            baud: config.baud,
            shared: shared.clone(),
            published: published.clone(),
            stop: stop.clone(),
        };
        Ok(Self {
            shared,
            published,
            thread: ReadingThread::start("analogue", stop, first, move || thread.run())?,
        })
    }

    /// Has the thread end, and does not wait.
    pub fn stop(&self) {
        self.thread.stop();
    }

    /// Does so and waits until the thread has ended. It is not waited for for ever: a serial driver that does not return from a
    /// call keeps it.
    pub fn end(&self) -> Result<(), ReadingThreadError> {
        self.thread.end()
    }

    /// A copy of what is known.
    pub fn snapshot(&self) -> AnalogueSnapshot {
        let mut snapshot = lock(&self.shared).snapshot.clone();
        snapshot.port.abandoned = self.thread.has_panicked();
        snapshot
    }

    /// Copies the readings that are kept, as [`crate::ServoReader::try_history_since`] does.
    pub fn try_history_since(&self, seen: u64, into: &mut JointHistory) -> u64 {
        history_since(
            &self.shared,
            &self.published,
            |shared| &shared.history,
            seen,
            into,
        )
    }
}

struct Thread {
    lines: AnalogueLines,
    path: PathBuf,
    baud: u32,
    shared: Arc<Mutex<Shared>>,
    published: Arc<AtomicU64>,
    stop: Arc<AtomicBool>,
}

impl Thread {
    fn run(mut self) {
        let mut terminal = None;
        while !self.stopped() {
            let lost = match Port::open(&self.path, self.baud, terminal) {
                Ok(mut port) => {
                    self.lines.port_opened();
                    {
                        let mut shared = lock(&self.shared);
                        shared.snapshot.port.opened(port.device(), port.latency());
                        shared.snapshot.open_ns = monotonic_ns();
                    }
                    let lost = self.read(&mut port);
                    terminal = port.terminal();
                    lost
                }
                Err(error) => Err(error),
            };
            if let Err(error) = lost {
                self.away(&error);
            }
            for _ in 0..PAUSE.as_millis() / LOOK.as_millis() {
                if !self.stopped() {
                    std::thread::sleep(LOOK);
                }
            }
        }
    }

    /// Line after line until the port is lost or the thread shall end.
    fn read(&mut self, port: &mut Port) -> Result<(), PortError> {
        let mut buffer = [0; 256];
        while !self.stopped() {
            let count = port.read(&mut buffer, LOOK)?;
            if count == 0 {
                continue;
            }
            let now_ns = monotonic_ns();
            let mut shared = lock(&self.shared);
            let Shared { snapshot, history } = &mut *shared;
            let before = self.lines.counters().lines;
            self.lines.push(&buffer[..count], now_ns, |joint, angle| {
                history.push(joint, now_ns, angle);
            });
            snapshot.counters = self.lines.counters();
            snapshot.angles.copy_from_slice(self.lines.angles());
            snapshot.heard.copy_from_slice(self.lines.heard());
            let lines = snapshot.counters.lines - before;
            self.published.fetch_add(lines, Ordering::Release);
        }
        Ok(())
    }

    fn away(&mut self, error: &PortError) {
        lock(&self.shared).snapshot.port.lost(error);
    }

    fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}
