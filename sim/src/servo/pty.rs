//! A servo bus in real time behind a pseudo terminal.

use super::bus::ServoBus;
use super::terminal::{self, Behind};
use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, ppoll};
use nix::sys::prctl;
use nix::sys::time::TimeSpec;
use nix::time::{ClockId, clock_gettime};
use nix::unistd::{read, write};
use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// How often the thread looks whether it shall end, or whether a client has come.
const LOOK: Duration = Duration::from_millis(5);

/// The clock of a bus in real time: `CLOCK_MONOTONIC`, nanoseconds.
pub fn servo_clock_ns() -> u64 {
    clock_gettime(ClockId::CLOCK_MONOTONIC)
        .map_or(0, |t| t.tv_sec() as u64 * 1_000_000_000 + t.tv_nsec() as u64)
}

/// A servo bus that clients open as a serial port.
///
/// Answers come when their last byte would have come over a real wire. The speed that a client sets
/// is accepted and has no effect. A client may hang up and another come at any time. Dropping it is
/// pulling the plug: the client's next read fails.
#[derive(Debug)]
pub struct ServoPty {
    path: PathBuf,
    bus: Arc<Mutex<ServoBus>>,
    _behind: Behind,
}

impl ServoPty {
    /// Opens a pseudo terminal in raw mode and runs the bus behind it.
    pub fn open(bus: ServoBus) -> io::Result<Self> {
        let (master, slave, path) = terminal::open()?;
        drop(slave);
        let bus = Arc::new(Mutex::new(bus));
        let behind = Behind::start("servo bus", {
            let bus = bus.clone();
            move |stop| run(&master, &bus, stop)
        })?;
        Ok(Self {
            path,
            bus,
            _behind: behind,
        })
    }

    /// The device a client opens, such as `/dev/pts/7`.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The servos, to break, mend or look at.
    pub fn bus(&self) -> MutexGuard<'_, ServoBus> {
        lock(&self.bus)
    }
}

fn lock(bus: &Mutex<ServoBus>) -> MutexGuard<'_, ServoBus> {
    bus.lock().unwrap_or_else(PoisonError::into_inner)
}

fn run(master: &OwnedFd, bus: &Mutex<ServoBus>, stop: &AtomicBool) {
    // Sleep to the microsecond, not to the 50 that a thread may oversleep by default.
    let _ = prctl::set_timerslack(1);
    let mut out = Vec::new();
    let mut buffer = [0; 4096];
    while !stop.load(Ordering::Relaxed) {
        let due_ns = {
            let mut bus = lock(bus);
            let now_ns = servo_clock_ns();
            bus.handle_time(now_ns);
            bus.take_due(now_ns, &mut out);
            bus.next_due_ns()
        };
        send(master, &mut out);
        let now_ns = servo_clock_ns();
        let wait = due_ns.map_or(LOOK, |t| Duration::from_nanos(t.saturating_sub(now_ns)).min(LOOK));
        let mut poll = [PollFd::new(master.as_fd(), PollFlags::POLLIN)];
        let _ = ppoll(&mut poll, Some(TimeSpec::from_duration(wait)), None);
        match read(master, &mut buffer) {
            Ok(n) if n > 0 => lock(bus).receive(&buffer[..n], servo_clock_ns()),
            Err(Errno::EAGAIN | Errno::EINTR) => {}
            // EIO: nobody has the terminal open. What was under way is lost, as on a real wire.
            Ok(_) | Err(_) => {
                lock(bus).hang_up();
                out.clear();
                std::thread::sleep(LOOK);
            }
        }
    }
}

/// Writes what the terminal takes; a client that reads nothing loses the rest, as one whose buffer overruns.
fn send(master: &OwnedFd, out: &mut Vec<u8>) {
    let mut rest = &out[..];
    while !rest.is_empty() {
        match write(master, rest) {
            Ok(n) => rest = &rest[n..],
            Err(Errno::EINTR) => {}
            Err(_) => break,
        }
    }
    out.clear();
}
