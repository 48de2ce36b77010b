//! A recording as a CAN source.

use crate::{
    CanFrame, CanSource, LinkState, LogError, LogFrame, LogReader, OpenError, Received, SendError,
    SourceCounters, Wakeup,
};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use std::sync::Arc;

/// When the frames of a recording are due.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Playback {
    /// When the first frame of the file is due, nanoseconds on the caller's clock.
    pub start_ns: u64,
    /// How fast the recorded clock runs: 1 as recorded, 2 twice as fast. Finite and over 0.
    ///
    /// There is no speed for "as fast as possible", because it needs none: a caller that sets its own clock to
    /// [`Wakeup::at_ns`] instead of waiting for it is driven by the recorded clock, at speed 1, as fast as it can
    /// go, and two such runs give the same times to the nanosecond.
    pub speed: f64,
}

impl Default for Playback {
    /// From time 0, as recorded.
    fn default() -> Self {
        Self {
            start_ns: 0,
            speed: 1.0,
        }
    }
}

/// A candump recording, each frame due at its own absolute time.
///
/// Times are shifted so that the first frame of the file, on whatever interface, is due at
/// [`Playback::start_ns`]; two sources over one file with the same playback therefore keep the two buses in step.
/// A frame that was recorded earlier than the one before it is due together with that one. Lines that hold no
/// classic frame are counted as `undecodable` and stop nothing. There is nobody to send to.
pub struct LogSource {
    reader: LogReader<BufReader<File>>,
    interface: Option<Arc<str>>,
    playback: Playback,
    first_ns: u64,
    newest_ns: u64,
    next: Option<Received>,
    counters: SourceCounters,
    failure: Option<LogError>,
}

impl LogSource {
    /// Opens a recording, of which only frames recorded on `interface` are played if one is given.
    ///
    /// Fails if the file cannot be read, if nothing in it is a CAN frame, or if the speed is not a positive number.
    pub fn open(path: &Path, interface: Option<&str>, playback: Playback) -> Result<Self, OpenError> {
        if !(playback.speed.is_finite() && playback.speed > 0.0) {
            return Err(OpenError::BadSpeed {
                speed: playback.speed,
            });
        }
        let file = File::open(path).map_err(|source| OpenError::Log {
            path: path.to_owned(),
            source,
        })?;
        let mut source = Self {
            reader: LogReader::new(BufReader::with_capacity(64 * 1024, file)),
            interface: interface.map(Arc::from),
            playback,
            first_ns: 0,
            newest_ns: playback.start_ns,
            next: None,
            counters: SourceCounters::default(),
            failure: None,
        };
        let mut first_problem = None;
        let first = loop {
            match source.reader.next() {
                Some(Ok(frame)) => break frame,
                Some(Err(LogError::Io { source, .. })) => {
                    return Err(OpenError::Log {
                        path: path.to_owned(),
                        source,
                    });
                }
                Some(Err(problem)) => {
                    source.counters.undecodable += 1;
                    first_problem.get_or_insert(problem);
                }
                None => {
                    return Err(OpenError::EmptyLog {
                        path: path.to_owned(),
                        lines: source.reader.line_number(),
                        problem: first_problem
                            .map_or_else(|| "it holds no line with text".to_owned(), |p| p.to_string()),
                    });
                }
            }
        };
        source.first_ns = first.t_ns;
        if source.is_wanted(&first) {
            source.schedule(&first);
        } else {
            source.advance();
        }
        Ok(source)
    }

    /// Why the recording ended before its end, if it did: the file could not be read any further.
    pub fn failure(&self) -> Option<&LogError> {
        self.failure.as_ref()
    }

    fn is_wanted(&self, frame: &LogFrame) -> bool {
        self.interface
            .as_ref()
            .is_none_or(|wanted| *wanted == frame.interface)
    }

    fn schedule(&mut self, frame: &LogFrame) {
        let since_first = frame.t_ns.saturating_sub(self.first_ns);
        let since_start = if self.playback.speed == 1.0 {
            since_first
        } else {
            (since_first as f64 / self.playback.speed) as u64
        };
        self.newest_ns = self
            .newest_ns
            .max(self.playback.start_ns.saturating_add(since_start));
        self.next = Some(Received {
            t_ns: self.newest_ns,
            frame: frame.frame,
        });
    }

    /// Reads on to the next frame that is wanted.
    fn advance(&mut self) {
        self.next = None;
        loop {
            match self.reader.next() {
                Some(Ok(frame)) if self.is_wanted(&frame) => return self.schedule(&frame),
                Some(Ok(_)) => {}
                Some(Err(LogError::Line { .. })) => self.counters.undecodable += 1,
                Some(Err(failure)) => {
                    self.failure = Some(failure);
                    return;
                }
                None => return,
            }
        }
    }
}

impl CanSource for LogSource {
    fn wakeup(&self) -> Wakeup<'_> {
        Wakeup {
            fd: None,
            at_ns: self.next.map(|next| next.t_ns),
        }
    }

    fn receive(&mut self, now_ns: u64, batch: &mut Vec<Received>) -> bool {
        while let Some(next) = self.next.filter(|next| next.t_ns <= now_ns) {
            if batch.len() == batch.capacity() {
                return true;
            }
            batch.push(next);
            self.counters.count(&next.frame);
            self.advance();
        }
        false
    }

    fn send(&mut self, _frame: &CanFrame) -> Result<(), SendError> {
        self.counters.send_failures += 1;
        Err(SendError::ReceiveOnly)
    }

    fn counters(&self) -> &SourceCounters {
        &self.counters
    }

    /// Up until the last frame has been taken.
    fn link(&self) -> LinkState {
        if self.is_finished() {
            LinkState::Down
        } else {
            LinkState::Up
        }
    }

    fn is_finished(&self) -> bool {
        self.next.is_none()
    }
}
