//! A serial port: opened, made fast, read with a deadline.

use super::low_latency;
use nix::fcntl::{FcntlArg, OFlag, fcntl};
use serialport::{ClearBuffer, SerialPort, TTYPort};
use std::fs::{File, Metadata};
use std::io::{self, ErrorKind, Read, Write};
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use taxel_can::monotonic_ns;

/// What happened to a serial port.
#[derive(Debug, thiserror::Error)]
pub enum PortError {
    /// It could not be opened.
    #[error("cannot open {}{}: {source}; {}", .path.display(), rate(.source, *.baud), advice(.path, .source))]
    Open {
        /// The device as it was named.
        path: PathBuf,
        /// Bits per second.
        baud: u32,
        /// What the system said.
        source: io::Error,
    },
    /// The link leads to a pseudo terminal that was made after it, with a number that was free again: another program's.
    #[error(
        "{link} leads to {device}, a terminal that is younger than the link, as another program's is where a simulator has \
         ended without removing its link; start the simulator again, or make the link anew",
        link = .link.display(),
        device = .device.display()
    )]
    LeftOver {
        /// The last link on the way to the device.
        link: PathBuf,
        /// The terminal.
        device: PathBuf,
    },
    /// The pseudo terminal that was open is gone, and its number is that of one that was made since: another program's.
    #[error(
        "{path} is another terminal than the one that was lost, as another program's is that was given its number; start taxeld again if it is the servos', or name the link of a simulator, which is made anew with it", path = .path.display()
    )]
    Another {
        /// The terminal.
        path: PathBuf,
    },
    /// It was open and is gone, or does not take bytes.
    #[error("{path} is gone ({source}): unplugged, or its driver reset it; it is opened again as soon as it is back", path = .path.display())]
    Lost {
        /// The device as it was named.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

/// The bit rate, where it may be what is wrong.
fn rate(error: &io::Error, baud: u32) -> String {
    match error.kind() {
        ErrorKind::NotFound | ErrorKind::PermissionDenied | ErrorKind::ResourceBusy => String::new(),
        _ => format!(" at {baud} bit/s"),
    }
}

fn advice(path: &Path, error: &io::Error) -> &'static str {
    match error.kind() {
        ErrorKind::NotFound if path.components().count() == 1 => {
            "a device is named with its folder, as in /dev/ttyUSB0; `ls /dev/serial/by-id` shows those that are there"
        }
        _ if path
            .metadata()
            .is_ok_and(|file| !file.file_type().is_char_device()) =>
        {
            "it is no serial device; `ls /dev/serial/by-id` shows those that are there"
        }
        ErrorKind::NotFound => "is the adapter plugged in? `ls /dev/serial/by-id` shows those that are",
        ErrorKind::PermissionDenied => "add the user to the group dialout and log in anew",
        _ => "does another program have it open? `fuser` followed by the device tells",
    }
}

/// How fast a port hands over what it has received.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct PortLatency {
    /// Whether the driver took the low-latency flag; a pseudo terminal has none.
    pub low_latency: bool,
    /// An FTDI adapter's latency timer as it is now, ms; it should be 1. `None` for other adapters.
    pub ftdi_timer_ms: Option<u32>,
}

/// The longest a write may block before the port counts as lost.
const WRITE_TIMEOUT: Duration = Duration::from_millis(200);

/// Which pseudo terminal was open. Its number, and with it all else, is soon that of another; but not when it was made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Terminal {
    inode: (u64, u64),
    /// Seconds and nanoseconds.
    made: (i64, i64),
}

/// An open serial port, 8N1, no flow control, for this program alone.
#[derive(Debug)]
pub(crate) struct Port {
    tty: TTYPort,
    path: PathBuf,
    device: PathBuf,
    latency: PortLatency,
    taken_ns: Option<u64>,
}

impl Port {
    /// Opens it. `lost`, if given, is the terminal that was open before, which a path that is no link leads to again or not at
    /// all.
    pub(crate) fn open(path: &Path, baud: u32, lost: Option<Terminal>) -> Result<Self, PortError> {
        let failed = |source: io::Error| PortError::Open {
            path: path.to_path_buf(),
            baud,
            source,
        };
        // A link's end is looked up anew each time: the device may have come back under another number.
        let device = std::fs::canonicalize(path).map_err(failed)?;
        if let Some(link) = left_over(path, &device) {
            return Err(PortError::LeftOver { link, device });
        }
        if lost.is_some() && path.read_link().is_err() && Terminal::at(&device) != lost {
            return Err(PortError::Another { path: device });
        }
        let name = device.to_string_lossy();
        let tty = TTYPort::open(&serialport::new(name, baud)).map_err(|e| {
            failed(match e.kind {
                // What is there, and is none for us, is another's alone.
                serialport::ErrorKind::NoDevice => io::Error::new(ErrorKind::ResourceBusy, e.description),
                _ => e.into(),
            })
        })?;
        // Opened so that reads block. Another program may take the bytes between being told of them and reading them (one
        // that had the port open before, or root's), and this one would wait for others for ever.
        fcntl(
            low_latency::descriptor(&tty),
            FcntlArg::F_SETFL(OFlag::O_NONBLOCK),
        )
        .map_err(|e| failed(e.into()))?;
        let low_latency = low_latency::set_low_latency(low_latency::descriptor(&tty)).is_ok();
        tty.clear(ClearBuffer::All).map_err(|e| failed(e.into()))?;
        Ok(Self {
            tty,
            path: path.to_path_buf(),
            latency: PortLatency {
                low_latency,
                ftdi_timer_ms: ftdi_timer_ms(&device),
            },
            device,
            taken_ns: None,
        })
    }

    pub(crate) fn latency(&self) -> PortLatency {
        self.latency
    }

    /// Reads the adapter's timer anew; whether it has changed.
    pub(crate) fn look_at_latency(&mut self) -> bool {
        let Some(before) = self.latency.ftdi_timer_ms else {
            return false;
        };
        let now = ftdi_timer_ms(&self.device).unwrap_or(before);
        self.latency.ftdi_timer_ms = Some(now);
        now != before
    }

    pub(crate) fn device(&self) -> &Path {
        &self.device
    }

    /// Which terminal it is, also once that is gone; `None` where it is none, but an adapter.
    pub(crate) fn terminal(&self) -> Option<Terminal> {
        let file = File::from(low_latency::descriptor(&self.tty).try_clone_to_owned().ok()?);
        let metadata = file.metadata().ok()?;
        is_terminal(&self.device).then(|| Terminal::of(&metadata))
    }

    /// Bytes that have arrived and are not read.
    pub(crate) fn waiting(&self) -> Result<usize, PortError> {
        let n = self.tty.bytes_to_read().map_err(|e| self.lost(e.into()))?;
        Ok(n as usize)
    }

    /// When another program last took bytes that this one was told of, nanoseconds; `None` if none has.
    pub(crate) fn taken_ns(&self) -> Option<u64> {
        self.taken_ns
    }

    /// Reads what there is, waiting for the first byte; 0 if none came in time, or another program took it.
    pub(crate) fn read(&mut self, into: &mut [u8], timeout: Duration) -> Result<usize, PortError> {
        // Cannot fail: the port only notes it.
        let _ = self.tty.set_timeout(timeout);
        match self.tty.read(into) {
            Ok(0) if !into.is_empty() => Err(self.lost(ErrorKind::UnexpectedEof.into())),
            Ok(n) => Ok(n),
            Err(e) if matches!(e.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => Ok(0),
            Err(e) if e.kind() == ErrorKind::WouldBlock => {
                self.taken_ns = Some(monotonic_ns());
                Ok(0)
            }
            Err(e) => Err(self.lost(e)),
        }
    }

    /// Writes all of it within [`WRITE_TIMEOUT`].
    pub(crate) fn write(&mut self, mut bytes: &[u8]) -> Result<(), PortError> {
        let end = Instant::now() + WRITE_TIMEOUT;
        while !bytes.is_empty() {
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(self.lost(ErrorKind::TimedOut.into()));
            }
            let _ = self.tty.set_timeout(left);
            match self.tty.write(bytes) {
                Ok(n) => bytes = &bytes[n..],
                // Another program has filled it meanwhile.
                Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {}
                Err(e) => return Err(self.lost(e)),
            }
        }
        Ok(())
    }

    fn lost(&self, source: io::Error) -> PortError {
        PortError::Lost {
            path: self.path.clone(),
            source,
        }
    }
}

fn is_terminal(device: &Path) -> bool {
    device.starts_with("/dev/pts")
}

impl Terminal {
    fn of(metadata: &Metadata) -> Self {
        Self {
            inode: (metadata.dev(), metadata.ino()),
            made: (metadata.ctime(), metadata.ctime_nsec()),
        }
    }

    fn at(device: &Path) -> Option<Self> {
        device.metadata().as_ref().map(Self::of).ok()
    }
}

/// The link to a pseudo terminal, where that is younger by more than a second: some file systems keep whole seconds alone.
/// Of what is done to a terminal only a change of its mode or owner makes it younger.
fn left_over(path: &Path, device: &Path) -> Option<PathBuf> {
    if !is_terminal(device) {
        return None;
    }
    let (mut link, mut end) = (None, path.to_owned());
    while let Ok(target) = end.read_link() {
        let next = end.parent()?.join(target);
        link = Some(std::mem::replace(&mut end, next));
    }
    let link = link?;
    let made_s = link.symlink_metadata().ok()?.mtime();
    (made_s + 1 < device.metadata().ok()?.ctime()).then_some(link)
}

/// The latency timer of an FTDI adapter, ms; `None` for any other device.
fn ftdi_timer_ms(device: &Path) -> Option<u32> {
    let name = device.file_name()?;
    let file = Path::new("/sys/bus/usb-serial/devices")
        .join(name)
        .join("latency_timer");
    std::fs::read_to_string(file).ok()?.trim().parse().ok()
}
