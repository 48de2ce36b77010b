//! The frames of the buses of a recording, as a daemon takes them.

use super::frame_file::{Entry, FrameFile};
use super::traffic::Traffic;
use crate::mcap::daemon_changes::{DaemonChange, DaemonChanges};
use crate::progress::Progress;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;
use std::vec::IntoIter;
use taxel_can::{LogClock, Received};
use taxel_engine::Recorded;

/// How far the frames of a file may be from the order of their times, nanoseconds: as far as a [`LogClock`] goes back.
const DISORDER_NS: u64 = 1_000_000_000;
/// Times of a file that are put in order at once, nanoseconds.
const STRETCH_NS: u64 = DISORDER_NS;
/// Frames that wait to be put in order at most, so that a file whose times stand still is not held whole. Sixteen full
/// buses bring less than a third of it in the time that is waited for.
const MOST_WAITING: usize = 1 << 20;
/// Stretches that are read ahead.
const AHEAD: usize = 2;

/// A frame and the number of its bus.
type BusFrame = (u8, Received);

/// What was read at once.
struct Stretch {
    /// What the daemon did, up to a second ahead of the frames.
    changes: Vec<DaemonChange>,
    frames: Vec<BusFrame>,
}

/// Reads the frames of the buses that have these names in the recording, on a thread of its own, and shows them to `take` in
/// the order of their times, and of their buses where these are equal. What its daemon did is there before the frames of that
/// time. Says what of the recording was not taken as it
/// stands there.
pub(crate) fn read_ahead<T>(
    traffic: &Traffic,
    names: &[String],
    changes: Option<DaemonChanges>,
    take: impl FnOnce(Stretches) -> anyhow::Result<T>,
) -> anyhow::Result<T> {
    thread::scope(|scope| {
        let (sender, stretches) = sync_channel(AHEAD);
        let reading = thread::Builder::new()
            .name("recording".into())
            .spawn_scoped(scope, move || Buses::open(traffic, names, changes)?.read(&sender))?;
        let taken = take(Stretches {
            stretches,
            changes: Vec::new().into_iter(),
            frames: Vec::new().into_iter(),
        });
        let read = reading
            .join()
            .unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        taken.and_then(|taken| read.map(|()| taken))
    })
}

/// What was read, stretch after stretch; what reads it ends when this is dropped.
pub(crate) struct Stretches {
    stretches: Receiver<Stretch>,
    changes: IntoIter<DaemonChange>,
    frames: IntoIter<BusFrame>,
}

impl Iterator for Stretches {
    type Item = Recorded;

    #[inline]
    fn next(&mut self) -> Option<Recorded> {
        loop {
            if let Some((t_ns, change)) = self.changes.next() {
                return Some(Recorded::Change(t_ns, change));
            }
            if let Some((bus, received)) = self.frames.next() {
                return Some(Recorded::Frame(bus, received));
            }
            let stretch = self.stretches.recv().ok()?;
            (self.changes, self.frames) = (stretch.changes.into_iter(), stretch.frames.into_iter());
        }
    }
}

/// The buses of a recording while it is read.
struct Buses<'a> {
    traffic: &'a Traffic,
    file: FrameFile<'a>,
    clock: LogClock,
    /// The buses of each interface: one, unless several are to hear the same.
    of_interface: Vec<Vec<usize>>,
    /// Time up to which each interface was read.
    newest_ns: Vec<u64>,
    /// The time of the frame that was read last, as it stands there, and since the first.
    last: Option<[u64; 2]>,
    progress: Progress,
}

impl<'a> Buses<'a> {
    fn open(
        traffic: &'a Traffic,
        names: &'a [String],
        changes: Option<DaemonChanges>,
    ) -> anyhow::Result<Self> {
        let file = FrameFile::open_with(traffic, Some(names), changes)?;
        let of_name = |name: &String| (0..names.len()).filter(|bus| names[*bus] == *name).collect();
        Ok(Self {
            traffic,
            file,
            clock: LogClock::default(),
            of_interface: names.iter().map(of_name).collect(),
            newest_ns: vec![0; names.len()],
            last: None,
            progress: Progress::bytes(traffic.bytes()),
        })
    }

    /// Hands stretch after stretch over until the end, or until nobody takes them.
    fn read(mut self, to: &SyncSender<Stretch>) -> anyhow::Result<()> {
        let (mut waiting, mut changes): (Vec<BusFrame>, _) = (Vec::new(), Vec::new());
        let mut ended = false;
        while !ended {
            let mut newest_ns = waiting.last().map_or(0, |(_, received)| received.t_ns);
            let enough_ns = newest_ns.saturating_add(DISORDER_NS + STRETCH_NS);
            while newest_ns < enough_ns && waiting.len() < MOST_WAITING && !ended {
                match self.next()? {
                    Some((interface, received)) => {
                        newest_ns = newest_ns.max(received.t_ns);
                        let buses = &self.of_interface[interface];
                        waiting.extend(buses.iter().map(|bus| (*bus as u8, received)));
                    }
                    None => ended = true,
                }
                self.take_changes(&mut changes);
            }
            if let Some(position) = self.file.position() {
                self.progress.advance_to(position);
            }
            // Of equal ones the first stays the first.
            waiting.sort_by_key(|(bus, received)| (received.t_ns, *bus));
            // Nothing can come before these any more.
            let safe_ns = newest_ns.saturating_sub(DISORDER_NS);
            let ready = match ended || waiting.len() >= MOST_WAITING {
                true => waiting.len(),
                false => waiting.partition_point(|(_, received)| received.t_ns < safe_ns),
            };
            let later = waiting.split_off(ready);
            let stretch = Stretch {
                changes: std::mem::take(&mut changes),
                frames: std::mem::replace(&mut waiting, later),
            };
            if to.send(stretch).is_err() {
                return Ok(());
            }
        }
        drop(self.progress);
        self.file.tell();
        if let Some(sentence) = self.file.another_hand() {
            remark!("taxel: {sentence}");
        }
        self.file.tell_left_out_lines();
        let path = self.traffic.path().display();
        if self.clock.jumps().count() > 0 {
            remark!("taxel: {path}: {}", self.clock.jumps());
        }
        Ok(())
    }

    /// What the daemon did, its times as those of the frames beside it are played.
    fn take_changes(&mut self, to: &mut Vec<DaemonChange>) {
        let Some([stamp_ns, since_ns]) = self.last else {
            return;
        };
        while let Some((t_ns, change)) = self.file.next_change() {
            let ahead_ns = t_ns.wrapping_sub(stamp_ns) as i64;
            to.push((since_ns.saturating_add_signed(ahead_ns), change));
        }
    }

    /// The next frame of one of the interfaces, at a time that is not before that of its last.
    fn next(&mut self) -> anyhow::Result<Option<(usize, Received)>> {
        while let Some(entry) = self.file.next_entry()? {
            if self.file.another_hand().is_some() {
                return Ok(None);
            }
            let Entry::Frame(place, received) = entry else {
                continue;
            };
            let since_ns = self.clock.since_first_ns(received.t_ns, self.file.number());
            self.last = Some([received.t_ns, since_ns]);
            if let Some(place) = place {
                let newest = &mut self.newest_ns[place];
                *newest = since_ns.max(*newest);
                let t_ns = *newest;
                return Ok(Some((place, Received { t_ns, ..received })));
            }
        }
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fmt::Write;
    use taxel_can::{CanSource, FrameMerge, LogSource};

    /// The frames as a daemon takes them that plays the buses of a log.
    fn as_played(path: &std::path::Path, names: &[String]) -> Vec<BusFrame> {
        let open = |name: &String| LogSource::open(path, Some(name), 0).unwrap();
        let mut sources: Vec<LogSource> = names.iter().map(open).collect();
        let mut merge = FrameMerge::new(names.len(), 16, false);
        let mut frames = Vec::new();
        loop {
            for (bus, source) in sources.iter_mut().enumerate() {
                merge.fill(bus, u64::MAX, |frames| source.receive(u64::MAX, frames));
            }
            let before = frames.len();
            frames.extend(std::iter::from_fn(|| merge.pop()));
            if frames.len() == before {
                return frames;
            }
        }
    }

    #[test]
    fn a_file_whose_times_stand_still_is_not_held_whole() {
        let dir = tempfile::TempDir::new().unwrap();
        let path = dir.path().join("still.log");
        let lines = MOST_WAITING + 1000;
        std::fs::write(&path, "(1.000000) can0 001#\n".repeat(lines)).unwrap();
        let (sender, stretches) = sync_channel(AHEAD);
        let (traffic, names) = (Traffic::candump(&path), ["can0".to_owned()]);
        Buses::open(&traffic, &names, None)
            .unwrap()
            .read(&sender)
            .unwrap();
        drop(sender);
        let lengths: Vec<usize> = stretches.iter().map(|stretch| stretch.frames.len()).collect();
        assert_eq!(lengths, [MOST_WAITING, 1000]);
    }

    #[test]
    fn frames_come_as_a_daemon_takes_them_whatever_their_order_in_the_file() {
        let (mut text, mut t_us, mut random) = (String::new(), 20_000_000_000_u64, 1_u64);
        for number in 0..3000_u64 {
            random = random
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            let dice = random >> 40;
            // On, and now and then back by up to a second; the clock is set by hours; some come together.
            t_us = match dice % 100 {
                0 => t_us - dice % 1_000_000,
                1 if number % 7 == 0 => t_us + 7_200_000_000,
                2 if number % 7 == 1 => t_us - 3_000_000,
                3..20 => t_us,
                _ => t_us + dice % 5000,
            };
            let (bus, id) = (dice % 3, number % 0x700);
            writeln!(
                text,
                "({:010}.{:06}) can{bus} {id:03X}#",
                t_us / 1_000_000,
                t_us % 1_000_000
            )
            .unwrap();
            if dice.is_multiple_of(50) {
                text.push_str("no frame\n");
            }
        }
        let dir = tempfile::TempDir::new().unwrap();
        let path = dir.path().join("any.log");
        std::fs::write(&path, text).unwrap();
        // Two buses may hear one interface, and one may hear none that there is.
        let names = ["can1", "can0", "can1", "can9"].map(str::to_owned);
        let read: Vec<BusFrame> = read_ahead(&Traffic::candump(&path), &names, None, |recorded| {
            let frame = |recorded| match recorded {
                Recorded::Frame(bus, received) => (bus, received),
                Recorded::Change(..) => unreachable!("no daemon was there"),
            };
            Ok(recorded.map(frame).collect())
        })
        .unwrap();
        let played = as_played(&path, &names);
        assert!(read.len() > 2000 && read.iter().any(|(bus, _)| *bus == 2));
        assert!(read == played, "not the same frames");
    }
}
