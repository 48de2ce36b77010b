//! A recording as it is played: its frames in the order of the file, at times that never fall.

use super::frame_file::{Entry, FrameFile};
use super::traffic::Traffic;
use std::sync::{Arc, Mutex, PoisonError};
use taxel_can::{ClockJumps, LogClock, Received};

/// What a recording holds at one place.
pub(crate) enum Line {
    /// An interface whose frames follow, where every one is played. Its index is the number of those before it.
    Interface(Arc<str>),
    /// A frame, the index of its interface or bus, and its time from the beginning.
    Frame(usize, Received),
    /// Nothing that can be sent.
    Other,
    /// So many bytes of the file are read.
    Read(u64),
}

/// Lines between two looks at how far the file is read.
const SHOWN: u64 = 256;

/// The frames of a file as they stand there; times start at zero and never fall. Where they were not taken as they stand
/// there is noted in the end.
pub(crate) struct Pass<'a> {
    file: FrameFile<'a>,
    jumps: &'a Mutex<ClockJumps>,
    clock: LogClock,
    newest_ns: u64,
    /// Lines until it is looked how far the file is read.
    until_shown: u64,
}

impl Drop for Pass<'_> {
    fn drop(&mut self) {
        *self.jumps.lock().unwrap_or_else(PoisonError::into_inner) = self.clock.jumps();
    }
}

impl<'a> Pass<'a> {
    /// Of the interfaces of these names, or of all.
    pub(crate) fn open(
        traffic: &'a Traffic,
        names: Option<&'a [String]>,
        jumps: &'a Mutex<ClockJumps>,
    ) -> anyhow::Result<Self> {
        Ok(Self {
            file: FrameFile::open(traffic, names)?,
            jumps,
            clock: LogClock::default(),
            newest_ns: 0,
            until_shown: SHOWN,
        })
    }
}

impl Iterator for Pass<'_> {
    type Item = anyhow::Result<Line>;

    fn next(&mut self) -> Option<Self::Item> {
        self.until_shown -= 1;
        if self.until_shown == 0 {
            self.until_shown = SHOWN;
            if let Some(bytes) = self.file.position() {
                return Some(Ok(Line::Read(bytes)));
            }
        }
        let (place, received) = match self.file.next_entry() {
            Ok(Some(Entry::Frame(place, received))) => (place, received),
            Ok(Some(Entry::Interface(name))) => return Some(Ok(Line::Interface(name))),
            Ok(Some(Entry::NoFrame)) => return Some(Ok(Line::Other)),
            Ok(None) => {
                self.file.tell();
                return None;
            }
            Err(error) => return Some(Err(error)),
        };
        let since_ns = self.clock.since_first_ns(received.t_ns, self.file.number());
        self.newest_ns = since_ns.max(self.newest_ns);
        Some(Ok(match place {
            Some(place) if !received.frame.is_error() => {
                let t_ns = self.newest_ns;
                Line::Frame(place, Received { t_ns, ..received })
            }
            _ => Line::Other,
        }))
    }
}
