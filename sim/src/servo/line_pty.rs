//! A microcontroller that prints lines on a serial port, as one that reads potentiometers does.

use super::pty::servo_clock_ns;
use nix::fcntl::{FcntlArg, OFlag, fcntl};
use nix::pty::{OpenptyResult, openpty};
use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};
use nix::unistd::{ttyname, write};
use std::io;
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// A terminal on which a line comes again and again. Dropping it is pulling the plug.
#[derive(Debug)]
pub struct LinePty {
    path: PathBuf,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl LinePty {
    /// Opens a pseudo terminal in raw mode, and writes what `line` gives for the time ([`servo_clock_ns`]) every `period`,
    /// with its line end. What nobody reads is lost, as on a real wire.
    pub fn open(period: Duration, mut line: impl FnMut(u64) -> Vec<u8> + Send + 'static) -> io::Result<Self> {
        let OpenptyResult { master, slave } = openpty(None, None)?;
        let mut raw = tcgetattr(&slave)?;
        cfmakeraw(&mut raw);
        tcsetattr(&slave, SetArg::TCSANOW, &raw)?;
        let path = ttyname(&slave)?;
        fcntl(&master, FcntlArg::F_SETFL(OFlag::O_NONBLOCK))?;
        let stop = Arc::new(AtomicBool::new(false));
        let thread = std::thread::Builder::new().name("lines".into()).spawn({
            let stop = stop.clone();
            move || {
                // Held open, so that lines may be written while no client is there.
                let held: (OwnedFd, OwnedFd) = (master, slave);
                while !stop.load(Ordering::Relaxed) {
                    let _ = write(&held.0, &line(servo_clock_ns()));
                    std::thread::sleep(period);
                }
            }
        })?;
        Ok(Self {
            path,
            stop,
            thread: Some(thread),
        })
    }

    /// The device a client opens, such as `/dev/pts/7`.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for LinePty {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
