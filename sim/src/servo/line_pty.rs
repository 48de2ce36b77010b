//! A microcontroller that prints lines on a serial port, as one that reads potentiometers does.

use super::pty::servo_clock_ns;
use super::terminal::{self, Behind};
use nix::unistd::write;
use std::io;
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Duration;

/// A terminal on which a line comes again and again. Dropping it is pulling the plug.
#[derive(Debug)]
pub struct LinePty {
    path: PathBuf,
    _behind: Behind,
}

impl LinePty {
    /// Opens a pseudo terminal in raw mode, and writes what `line` gives for the time ([`servo_clock_ns`]) every `period`,
    /// with its line end. What nobody reads is lost, as on a real wire.
    pub fn open(period: Duration, mut line: impl FnMut(u64) -> Vec<u8> + Send + 'static) -> io::Result<Self> {
        let (master, slave, path) = terminal::open()?;
        let behind = Behind::start("lines", move |stop| {
            // Held open, so that lines may be written while no client is there.
            let held: (OwnedFd, OwnedFd) = (master, slave);
            while !stop.load(Ordering::Relaxed) {
                let _ = write(&held.0, &line(servo_clock_ns()));
                std::thread::sleep(period);
            }
        })?;
        Ok(Self {
            path,
            _behind: behind,
        })
    }

    /// The device a client opens, such as `/dev/pts/7`.
    pub fn path(&self) -> &Path {
        &self.path
    }
}
