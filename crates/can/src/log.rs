//! A recording as a CAN source.

use crate::{
    CanFrame, CanSource, LineProblem, LinkState, LogClock, LogError, LogFrame, LogReader, OpenError,
    Received, SendError, SourceCounters, Wakeup,
};
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::sync::Arc;
use taxel_hand::shell_word;

/// What an MCAP file begins with.
const MCAP: &[u8] = b"\x89MCAP";

/// A candump recording, each frame due at its own absolute time.
///
/// Times are shifted so that the first frame of the file, on whatever interface, is due at
/// `start_ns`; two sources over one file with the same start therefore keep the two
/// buses in step. A frame that was recorded earlier than the one before it is due together with
/// that one, and time goes on where the clock was set or nothing came for more than a minute ([`LogClock`]); that is counted in
/// `jumps`. Lines that hold no classic
/// frame are counted as `undecodable` and stop nothing. There is nobody to send to.
///
/// A caller that sets its own clock to [`Wakeup::at_ns`] instead of waiting for it is driven by the recorded clock, as
/// fast as it can go, and two such runs give the same times to the nanosecond.
pub struct LogSource {
    reader: LogReader<BufReader<File>>,
    interface: Option<Arc<str>>,
    left_out: Vec<Arc<str>>,
    start_ns: u64,
    clock: LogClock,
    newest_ns: u64,
    next: Option<Received>,
    counters: SourceCounters,
    failure: Option<LogError>,
}

impl LogSource {
    /// Opens a recording, of which only frames recorded on `interface` are played if one is given. Its first frame is due at
    /// `start_ns`, nanoseconds on the caller's clock.
    ///
    /// Fails if the file cannot be read, or if nothing in it is a CAN frame.
    pub fn open(path: &Path, interface: Option<&str>, start_ns: u64) -> Result<Self, OpenError> {
        let unreadable = |source| OpenError::Io {
            what: format!("read {}", path.display()),
            source,
        };
        let mut file = BufReader::with_capacity(64 * 1024, File::open(path).map_err(unreadable)?);
        if file.fill_buf().is_ok_and(|begin| begin.starts_with(MCAP)) {
            return Err(OpenError::Refused(format!(
                "{} is an MCAP recording, and a bus is played from a candump log: `taxel convert {} {}` makes one of it",
                path.display(),
                shell_word(path.display()),
                shell_word(path.with_extension("log").display())
            )));
        }
        let mut source = Self {
            reader: LogReader::new(file),
            interface: interface.map(Arc::from),
            left_out: Vec::new(),
            start_ns,
            clock: LogClock::default(),
            newest_ns: start_ns,
            next: None,
            counters: SourceCounters::default(),
            failure: None,
        };
        let mut first_problem = None;
        let first = loop {
            match source.reader.next() {
                Some(Ok(frame)) => break frame,
                Some(Err(LogError::Io { source, .. })) => return Err(unreadable(source)),
                Some(Err(problem)) => {
                    source.count_undecodable(&problem);
                    first_problem.get_or_insert(problem);
                }
                None => {
                    let problem = first_problem
                        .map_or_else(|| "it holds no line with text".to_owned(), |p| p.to_string());
                    return Err(OpenError::Refused(format!(
                        "{} holds no CAN frame in its {} lines ({problem}); a candump log has lines such as \
                         `(1436509052.249713) can0 044#2A366C2B`, and `can_logconvert` makes one of other formats",
                        path.display(),
                        source.reader.line_number()
                    )));
                }
            }
        };
        let since_first_ns = source.since_first_ns(&first);
        if source.is_wanted(&first) {
            source.schedule(&first, since_first_ns);
        } else {
            source.advance();
        }
        Ok(source)
    }

    /// Opens a recording, of which the interface with the name of this bus is played, or the only one that it has.
    ///
    /// Fails as [`LogSource::open`] does, and where it has several interfaces of other names. To find that out, the whole
    /// file is read.
    pub fn open_bus(path: &Path, bus: &str, start_ns: u64) -> Result<Self, OpenError> {
        // What is no recording is refused before it is read whole.
        let whole = Self::open(path, None, start_ns)?;
        if !path.is_file() {
            // A pipe is read once: all of it is the bus.
            return Ok(whole);
        }
        let mut others = interfaces(path)?;
        let named = others.iter().position(|name| **name == *bus);
        let Some(place) = named.or((others.len() == 1).then_some(0)) else {
            let names: Vec<&str> = others.iter().map(|name| &**name).collect();
            return Err(OpenError::Refused(format!(
                "{path} has several interfaces ({names}), none of which has the bus's name: say which it is, such as \
                 log:{path}?interface={first}",
                path = path.display(),
                names = names.join(", "),
                first = names.first().unwrap_or(&"NAME"),
            )));
        };
        let own = others.remove(place);
        let source = Self::open(path, Some(&own), start_ns)?;
        Ok(Self {
            left_out: others,
            ..source
        })
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

    fn count_undecodable(&mut self, problem: &LogError) {
        let is_can_fd = matches!(
            problem,
            LogError::Line {
                problem: LineProblem::CanFd,
                ..
            }
        );
        self.counters.undecodable += 1;
        self.counters.can_fd += u64::from(is_can_fd);
    }

    fn since_first_ns(&mut self, frame: &LogFrame) -> u64 {
        let since_first_ns = self.clock.since_first_ns(frame.t_ns, self.reader.line_number());
        self.counters.jumps = self.clock.jumps();
        since_first_ns
    }

    fn schedule(&mut self, frame: &LogFrame, since_first_ns: u64) {
        self.newest_ns = self.newest_ns.max(self.start_ns.saturating_add(since_first_ns));
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
                Some(Ok(frame)) => {
                    let since_first_ns = self.since_first_ns(&frame);
                    if self.is_wanted(&frame) {
                        return self.schedule(&frame, since_first_ns);
                    }
                }
                Some(Err(problem @ LogError::Line { .. })) => self.count_undecodable(&problem),
                Some(Err(failure)) => {
                    self.counters.cut_off_line = self.reader.line_number().max(1);
                    self.failure = Some(failure);
                    return;
                }
                None => return,
            }
        }
    }
}

/// The interfaces that a candump recording has frames of, in the order in which they appear. The whole file is read.
///
/// Fails where the file cannot be opened.
pub fn interfaces(path: &Path) -> Result<Vec<Arc<str>>, OpenError> {
    let file = File::open(path).map_err(|source| OpenError::Io {
        what: format!("read {}", path.display()),
        source,
    })?;
    let mut reader = LogReader::new(BufReader::with_capacity(256 * 1024, file));
    let mut names = Vec::<Arc<str>>::new();
    loop {
        if reader.pass_over(&names).is_some() {
            continue;
        }
        match reader.next() {
            Some(Ok(frame)) if !names.contains(&frame.interface) => names.push(frame.interface),
            Some(Ok(_) | Err(LogError::Line { .. })) => {}
            // Where it cannot be read any further is told when it is played.
            Some(Err(_)) | None => return Ok(names),
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

    fn has_times(&self) -> bool {
        self.reader.without_time() == 0
    }

    fn left_out(&self) -> &[Arc<str>] {
        &self.left_out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    const LOG: &str = "(100.000000) can1 001#01\n\
        (100.000500) can0 002#02\n\
        (100.001000) can1 003#03\n\
        not a frame\n\
        (100.000900) can0 004#04\n\
        (100.001500) can0 123##1A0B\n\
        (100.002000) can0 005#05\n";

    fn file(text: &str) -> tempfile::NamedTempFile {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(text.as_bytes()).unwrap();
        file
    }

    /// Plays a whole recording with a clock that jumps from frame to frame.
    fn play(source: &mut LogSource) -> Vec<(u64, u32)> {
        let mut batch = Vec::with_capacity(64);
        while let Some(now_ns) = source.wakeup().at_ns {
            source.receive(now_ns, &mut batch);
        }
        batch.iter().map(|r| (r.t_ns, r.frame.id())).collect()
    }

    fn open(text: &str, interface: Option<&str>, start_ns: u64) -> LogSource {
        LogSource::open(file(text).path(), interface, start_ns).unwrap()
    }

    #[test]
    fn an_mcap_recording_is_refused_with_the_command_that_makes_a_log_of_it() {
        let file = file("");
        std::fs::write(file.path(), b"\x89MCAP0\r\n and so on").unwrap();
        let refused = LogSource::open(file.path(), None, 0).err().unwrap().to_string();
        assert!(refused.contains("`taxel convert /"), "{refused}");
    }

    #[test]
    fn times_are_shifted_so_that_the_first_frame_is_due_at_the_start() {
        let mut source = open(LOG, None, 7_000);
        let frames = play(&mut source);
        // Frame 4 was recorded before frame 3: it is due together with it, not in the past.
        let expected = [
            (7_000, 1),
            (507_000, 2),
            (1_007_000, 3),
            (1_007_000, 4),
            (2_007_000, 5),
        ];
        assert_eq!(frames, expected);
        assert!(source.is_finished());
        assert_eq!(source.link(), LinkState::Down);
        assert_eq!(
            (source.counters().received, source.counters().undecodable),
            (5, 2)
        );
        assert_eq!(source.counters().can_fd, 1);
    }

    #[test]
    fn a_recording_without_times_says_so_from_the_start() {
        assert!(open(LOG, None, 0).has_times());
        let screen = "  can0  001   [1]  01\n  can1  002   [1]  02\n";
        assert!(
            [None, Some("can1")]
                .iter()
                .all(|bus| !open(screen, *bus, 0).has_times())
        );
    }

    #[test]
    fn two_buses_of_one_recording_stay_in_step() {
        let frames = |interface| play(&mut open(LOG, Some(interface), 0));
        assert_eq!(frames("can0"), [(500_000, 2), (900_000, 4), (2_000_000, 5)]);
        assert_eq!(frames("can1"), [(0, 1), (1_000_000, 3)]);
        assert_eq!(frames("can7"), []);
    }

    #[test]
    fn a_bus_is_the_interface_of_its_name_or_the_only_one() {
        let log = file(LOG);
        let of_bus = |bus| LogSource::open_bus(log.path(), bus, 0);
        let mut can0 = of_bus("can0").unwrap();
        assert_eq!(can0.left_out(), [Arc::from("can1")]);
        assert_eq!(play(&mut can0), [(500_000, 2), (900_000, 4), (2_000_000, 5)]);
        let refused = of_bus("left").err().unwrap().to_string();
        let named = format!("log:{}?interface=can1", log.path().display());
        assert!(
            refused.contains("(can1, can0)") && refused.ends_with(&named),
            "{refused}"
        );

        let one = file(&LOG.replace("can1", "can0"));
        let mut only = LogSource::open_bus(one.path(), "left", 0).unwrap();
        assert_eq!((play(&mut only).len(), only.left_out().len()), (5, 0));
        // What is named is not looked for.
        assert!(
            LogSource::open(log.path(), Some("can1"), 0)
                .unwrap()
                .left_out()
                .is_empty()
        );
    }

    #[test]
    fn two_buses_stay_in_step_where_the_clock_was_set_while_they_were_recorded() {
        // Set forward by decades with a frame of can1, and back by a minute with one of can0.
        let log = "(100.000000) can0 001#\n\
                   (1795000000.000000) can1 002#\n\
                   (1795000000.010000) can0 003#\n\
                   (1794999940.000000) can0 004#\n\
                   (1794999940.020000) can1 005#\n";
        let frames = |interface| play(&mut open(log, Some(interface), 0));
        assert_eq!(frames("can0"), [(0, 1), (10_000_000, 3), (10_000_000, 4)]);
        assert_eq!(frames("can1"), [(0, 2), (30_000_000, 5)]);
    }

    #[test]
    fn nothing_comes_before_its_time_and_a_full_batch_leaves_the_rest() {
        let mut source = open(LOG, None, 0);
        let mut batch = Vec::with_capacity(2);
        assert!(!source.receive(499_999, &mut batch));
        assert_eq!(batch.len(), 1);
        assert_eq!(source.wakeup().at_ns, Some(500_000));
        assert!(source.receive(u64::MAX, &mut batch));
        assert_eq!((batch.len(), batch.capacity()), (2, 2));
        batch.clear();
        assert!(source.receive(u64::MAX, &mut batch));
        batch.clear();
        assert!(!source.receive(u64::MAX, &mut batch));
        assert_eq!(batch.len(), 1);
        assert!(!source.receive(u64::MAX, &mut batch));
    }

    #[test]
    fn a_recording_that_cannot_be_read_to_its_end_says_where_it_ends() {
        let mut log = LOG.to_owned().into_bytes();
        log.resize(log.len() + (65 << 20), 0);
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(&log).unwrap();
        let mut source = LogSource::open(file.path(), None, 0).unwrap();
        assert_eq!(play(&mut source).len(), 5);
        assert_eq!(source.counters().cut_off_line, 7);
        assert!(
            source
                .failure()
                .unwrap()
                .to_string()
                .contains("64 MiB without a CAN frame")
        );
        let mut whole = open(LOG, None, 0);
        play(&mut whole);
        assert_eq!(whole.counters().cut_off_line, 0);
    }

    #[test]
    fn a_recording_takes_no_commands_and_that_is_no_failure() {
        let mut source = open(LOG, None, 0);
        let frame = CanFrame::standard(1, &[]).unwrap();
        assert!(matches!(source.send(&frame), Err(SendError::ReceiveOnly)));
        assert_eq!(source.counters().send_failures, 0);
    }

    #[test]
    fn what_cannot_be_played_is_refused_with_the_reason() {
        let refused = |path: &Path| LogSource::open(path, None, 0).err().unwrap().to_string();
        let missing = refused(Path::new("no/such.log"));
        assert!(missing.contains("no/such.log") && missing.contains("No such file"));
        let empty = refused(file("\n\n").path());
        assert!(empty.contains("in its 2 lines"), "{empty}");
        let other = refused(file("BLF\x01\x02 binary\nmore\n").path());
        assert!(
            other.contains("line 1, column 1: expected `(`") && other.contains("can_logconvert"),
            "{other}"
        );
    }
}
