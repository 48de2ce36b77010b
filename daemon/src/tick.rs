//! The tick thread: waits for the buses and the clock, drives the engine, and hands images over.
//!
//! It is the only thread that touches a bus. It never waits for another thread, never allocates
//! after its start, unless a recording that it plays does ([`CanSource`]), and never logs; what it
//! has to say goes into the shared [`Snapshot`].

use crate::gather::Gather;
use crate::snapshot::Snapshot;
use nix::poll::{PollFd, PollFlags, ppoll};
use nix::sys::eventfd::{EfdFlags, EventFd};
use nix::sys::time::TimeSpec;
use std::os::fd::AsFd;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, mpsc};
use std::time::{Duration, Instant};
use taxel_can::{BusState, CanSource, FrameMerge, LinkState, monotonic_ns};
use taxel_engine::{Engine, Frames};
use taxel_joints::JointReader;
use taxel_serve::OutputSlots;

/// Frames taken from a bus at once.
const BATCH: usize = 1024;
/// The thread wakes at least this often, to show that it lives and to keep the status fresh.
const HEARTBEAT_NS: u64 = 100_000_000;

/// What other threads ask of the tick thread.
pub(crate) enum Command {
    /// Measure the baseline anew.
    Rezero,
    /// Make images without contacts, or go on.
    Pause(bool),
}

/// Commands that may wait to be obeyed. The queue has its memory from the start, so that taking one
/// frees nothing.
pub(crate) const COMMANDS: usize = 64;

/// Asks something of the tick thread. The error is fit for whoever asked.
pub(crate) fn command(
    commands: &mpsc::SyncSender<Command>,
    shared: &Shared,
    command: Command,
) -> Result<(), String> {
    commands.try_send(command).map_err(|error| match error {
        mpsc::TrySendError::Full(_) => "the daemon is busy with other commands; try again".to_string(),
        mpsc::TrySendError::Disconnected(_) => "the daemon is stopping".to_string(),
    })?;
    let _ = shared.wake.write(1);
    Ok(())
}

/// What the tick thread shares with the others.
#[derive(Debug)]
pub(crate) struct Shared {
    pub(crate) stop: AtomicBool,
    /// Grows with every round of the thread; the watchdog looks at it.
    pub(crate) heartbeat: AtomicU64,
    /// Set when every recording has been played to its end.
    pub(crate) finished: AtomicBool,
    pub(crate) snapshot: Mutex<Snapshot>,
    pub(crate) wake: EventFd,
}

impl Shared {
    pub(crate) fn new(snapshot: Snapshot) -> nix::Result<Self> {
        Ok(Self {
            stop: false.into(),
            heartbeat: 0.into(),
            finished: false.into(),
            snapshot: Mutex::new(snapshot),
            wake: EventFd::from_flags(EfdFlags::EFD_NONBLOCK | EfdFlags::EFD_CLOEXEC)?,
        })
    }
}

/// The pipeline's time: `CLOCK_MONOTONIC` for live buses, time since the start for recordings and scenes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PipelineClock {
    /// `CLOCK_MONOTONIC` minus pipeline time, nanoseconds.
    pub(crate) offset_ns: u64,
    /// Whether images that come too late may be given up; never so when a recording sets the time.
    pub(crate) live: bool,
}

impl PipelineClock {
    pub(crate) fn now_ns(&self) -> u64 {
        monotonic_ns().saturating_sub(self.offset_ns)
    }
}

pub(crate) struct TickThread {
    /// Those of the skin in the layout's order, then that of joints on a bus of their own.
    pub(crate) sources: Vec<Box<dyn CanSource>>,
    pub(crate) engine: Engine,
    /// The thread that reads joints, where there is one, and which of its readings were taken.
    pub(crate) joint_reader: Option<JointReader>,
    pub(crate) joints_seen: [u64; JointReader::SOURCES],
    /// What is made of each tick.
    pub(crate) outputs: OutputSlots<Frames>,
    pub(crate) clock: PipelineClock,
    pub(crate) commands: mpsc::Receiver<Command>,
    pub(crate) shared: Arc<Shared>,
    pub(crate) gather: Gather,
}

/// What a round of the thread leaves to the next.
struct Rounds {
    /// Frames that were received, until they are handled.
    merge: FrameMerge,
    /// Ticks that were given up.
    overruns: u64,
    /// The newest tick that images were made of.
    images: u64,
    /// Until when the buses are left alone.
    quiet_until_ns: u64,
    /// When the snapshot is written next.
    snapshot_due_ns: u64,
}

impl TickThread {
    /// Runs until asked to stop, or until every recording has ended. Boards that were started are stopped.
    pub(crate) fn run(mut self) {
        // The kernel may otherwise round every wake-up up by 50 microseconds.
        let _ = nix::sys::prctl::set_timerslack(1);
        let mut rounds = Rounds {
            merge: FrameMerge::new(self.sources.len(), BATCH, self.clock.live),
            overruns: 0,
            images: 0,
            quiet_until_ns: 0,
            snapshot_due_ns: 0,
        };

        while !self.shared.stop.load(Ordering::Relaxed) {
            self.shared.heartbeat.fetch_add(1, Ordering::Relaxed);
            if rounds.merge.is_empty() {
                self.wait(rounds.quiet_until_ns);
            }
            self.handle_commands();

            let now_ns = self.clock.now_ns();
            let drained = self.drain(&mut rounds, now_ns);
            let more = rounds.merge.has_more();
            let ended = self.sources.iter().all(|s| s.is_finished());
            if self.clock.live {
                rounds.overruns += self.engine.skip_overdue(now_ns);
            }
            self.take_joints();
            self.make_images(&mut rounds, now_ns, ended, more);
            if drained {
                self.leave_buses_alone(&mut rounds, now_ns, more);
            }

            self.send_commands(now_ns);
            if now_ns >= rounds.snapshot_due_ns {
                rounds.snapshot_due_ns = now_ns + HEARTBEAT_NS / 2;
                self.update_snapshot(now_ns, &rounds);
            }
            if ended && !more {
                // The last one has all that the recordings held.
                if self.update_snapshot(now_ns, &rounds) {
                    self.shared.finished.store(true, Ordering::Release);
                    break;
                }
                // Somebody reads the one before, perhaps on this core: nothing is due but to try again.
                std::thread::sleep(Duration::from_millis(1));
            }
        }
        self.stop_hand();
    }

    /// Takes what the buses have, unless they are left alone and no tick is due; says whether it did.
    fn drain(&mut self, rounds: &mut Rounds, now_ns: u64) -> bool {
        let is_quiet = now_ns < rounds.quiet_until_ns;
        if is_quiet && self.engine.output_due_ns().is_none_or(|due| due > now_ns) {
            return false;
        }
        let merge = &mut rounds.merge;
        for (bus, source) in self.sources.iter_mut().enumerate() {
            merge.fill(bus, now_ns, |batch| source.receive(now_ns, batch));
        }
        true
    }

    /// Takes the joints' readings since those that were taken last.
    fn take_joints(&mut self) {
        let Some(reader) = &mut self.joint_reader else {
            return;
        };
        for (source, seen) in self.joints_seen.iter_mut().enumerate() {
            self.engine.handle_joints(source, |history| {
                *seen = reader.try_history_since(source, *seen, history);
            });
        }
    }

    /// Handles the frames that were taken, and the time, and hands over the images of the ticks that this makes. `ended`
    /// says that every recording has, `more` that a bus has more than could be taken.
    fn make_images(&mut self, rounds: &mut Rounds, now_ns: u64, ended: bool, more: bool) {
        let Rounds { merge, images, .. } = rounds;
        // The first tick of a round begins with it, and each that is due by then, too, where the one before ends.
        let mut begun_ns = now_ns;
        let mut emit = |frames: &Frames| {
            let late_ns = self.clock.now_ns().saturating_sub(frames.due_ns);
            let now = Instant::now();
            let due = now.checked_sub(Duration::from_nanos(late_ns)).unwrap_or(now);
            *images = frames.tick();
            self.outputs.publish(*images, due, frames);
            let done_ns = self.clock.now_ns();
            record_times(&self.shared, frames, begun_ns, done_ns);
            begun_ns = done_ns;
        };
        // What another bus has told beyond that waits: frames are given in the order of their
        // stamps however late they are taken.
        while let Some((bus, received)) = merge.pop() {
            self.engine.handle_frame(bus, &received);
            self.engine.drain(&mut emit);
        }
        // A recording ends with its last frame, so that it gives the same images however late
        // its end is seen. Where a bus has more than could be taken, ticks are made up to what
        // all buses have told: one that is flooded must not hold them up.
        let end_ns = match ended {
            true => merge.newest_ns().unwrap_or(0),
            false => now_ns,
        };
        let told_ns = match more {
            true => merge.horizon_ns().saturating_sub(1),
            false => u64::MAX,
        };
        self.engine.handle_time(end_ns.min(told_ns));
        self.engine.drain(&mut emit);
    }

    /// Sets how long the buses, which were drained, are left alone.
    fn leave_buses_alone(&mut self, rounds: &mut Rounds, now_ns: u64, more: bool) {
        let frames = rounds.merge.taken().take(self.engine.skin_buses()).sum();
        let ended_ns = self.engine.frames().tactile.t_ns;
        let awaited = self.engine.sweep().awaited();
        let pause_ns = self.gather.pause_ns(now_ns, frames, awaited, ended_ns);
        rounds.quiet_until_ns = if more { 0 } else { now_ns + pause_ns };
    }

    /// Waits for the next thing to do: a frame, a tick, a command to a board, or another thread.
    fn wait(&self, quiet_until_ns: u64) {
        let now_ns = self.clock.now_ns();
        let mut until_ns = now_ns + HEARTBEAT_NS;
        let mut sooner = |at_ns: Option<u64>| until_ns = at_ns.map_or(until_ns, |at| until_ns.min(at));
        sooner(self.engine.poll_due_ns());
        let quiet = quiet_until_ns > now_ns;
        if quiet {
            sooner(Some(quiet_until_ns));
        }

        // POLLERR is always reported, asked for or not: that is how a vanished CAN interface shows itself.
        let mut fds = [self.shared.wake.as_fd(); 1 + taxel_config::MAX_BUSES];
        let mut used = 1;
        let skin = self.engine.skin_buses();
        if let Some(joints) = self.sources.get(skin) {
            // Nothing is due with a joint's frame: those that came are taken with the next of the
            // skin. Nor is their bus looked at during a pause, so that waking up for it would only
            // be to wake up again at once.
            sooner(joints.wakeup().at_ns.map(|at| at.max(quiet_until_ns)));
        }
        for source in &self.sources[..skin] {
            let wakeup = source.wakeup();
            if quiet {
                sooner(wakeup.at_ns.map(|at| at.max(quiet_until_ns)));
            } else {
                sooner(wakeup.at_ns);
                if let Some(fd) = wakeup.fd {
                    fds[used] = fd;
                    used += 1;
                }
            }
        }
        if until_ns <= now_ns {
            return;
        }
        let mut polled = fds.map(|fd| PollFd::new(fd, PollFlags::POLLIN));
        let pause = TimeSpec::from_duration(Duration::from_nanos(until_ns - now_ns));
        let _ = ppoll(&mut polled[..used], Some(pause), None);
        if polled[0].any().unwrap_or(true) {
            let _ = self.shared.wake.read();
        }
    }

    fn handle_commands(&mut self) {
        while let Ok(command) = self.commands.try_recv() {
            match command {
                Command::Rezero => self.engine.rezero(),
                Command::Pause(paused) => self.engine.set_paused(paused),
            }
        }
        self.outputs.handle_changes();
    }

    /// Sends what boards and joints are to be told now.
    fn send_commands(&mut self, now_ns: u64) {
        for (bus, source) in self.sources.iter().enumerate() {
            let is_up = source.link() == LinkState::Up;
            let is_active = source.counters().bus_state != BusState::BusOff;
            self.engine.handle_link(bus as u8, is_up, is_active, now_ns);
        }
        while let Some(command) = self.engine.poll_command(now_ns) {
            let sent = self.sources[usize::from(command.bus)].send(&command.frame);
            if sent.is_err() {
                self.engine.handle_unsent(&command, now_ns);
            }
        }
    }

    /// Leaves the boards, and a hand that was started, as they were found: silent. Bounded in time,
    /// since a bus may be gone.
    fn stop_hand(&mut self) {
        let deadline_ns = self.clock.now_ns() + 500_000_000;
        self.engine.stop();
        loop {
            let now_ns = self.clock.now_ns();
            self.send_commands(now_ns);
            match self.engine.command_due_ns() {
                Some(at_ns) if at_ns < deadline_ns => {
                    std::thread::sleep(Duration::from_nanos(at_ns.saturating_sub(now_ns)));
                }
                _ => return,
            }
        }
    }

    /// Tells the other threads how the hand is; false where one of them reads what was told before.
    fn update_snapshot(&self, now_ns: u64, rounds: &Rounds) -> bool {
        let Ok(mut snapshot) = self.shared.snapshot.try_lock() else {
            return false;
        };
        let engine = &self.engine;
        snapshot.written = true;
        snapshot.now_ns = now_ns;
        snapshot.overruns = rounds.overruns;
        snapshot.images = rounds.images;
        snapshot.unpublished = self.outputs.unpublished();
        for ((bus, source), decoder) in snapshot
            .buses
            .iter_mut()
            .zip(&self.sources)
            .zip(engine.decoders())
        {
            bus.source = *source.counters();
            bus.link = source.link();
            bus.decoder = *decoder.counters();
            bus.load = engine.bus_monitor().load(decoder.bus());
        }
        snapshot.take_findings(engine.bus_monitor().findings());
        for (module, board) in snapshot.boards.iter_mut().enumerate() {
            *board = engine.board(module as u16);
        }
        let frames = engine.frames();
        snapshot.take_felt(frames);
        for (taxel, unchanging) in snapshot.unchanging.iter_mut().enumerate() {
            *unchanging = engine.conditioner().is_unchanging(taxel);
        }
        snapshot.conditioning = engine.conditioner().counters();
        snapshot.paused = engine.is_paused();
        engine.joints_into(&mut snapshot.joints);
        let joints_bus = engine.joints_bus().map(usize::from);
        if let Some(source) = joints_bus.and_then(|bus| self.sources.get(bus)) {
            snapshot.joints_source = *source.counters();
            snapshot.joints_link = source.link();
        }
        true
    }
}

/// Notes how long a tick's images took, until the last of them was handed over. A status report
/// being written at this moment loses one sample of many.
fn record_times(shared: &Shared, frames: &Frames, begun_ns: u64, done_ns: u64) {
    if let Ok(mut snapshot) = shared.snapshot.try_lock() {
        snapshot.images = frames.tick();
        snapshot.record_times(frames.tactile.t_ns, frames.due_ns, begun_ns, done_ns);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_can::{CanFrame, Received};

    /// A bus that always has more, and never a frame.
    #[derive(Default)]
    struct Flooded(taxel_can::SourceCounters);

    impl CanSource for Flooded {
        fn wakeup(&self) -> taxel_can::Wakeup<'_> {
            taxel_can::Wakeup::default()
        }

        fn receive(&mut self, _now_ns: u64, _batch: &mut Vec<Received>) -> bool {
            true
        }

        fn send(&mut self, _frame: &CanFrame) -> Result<(), taxel_can::SendError> {
            Ok(())
        }

        fn counters(&self) -> &taxel_can::SourceCounters {
            &self.0
        }
    }

    #[test]
    fn a_bus_flooded_with_what_is_no_frame_does_not_hold_up_the_images() {
        let layout = taxel_skin::Layout::builtin("uskin-module").unwrap();
        let config = crate::Config::new(layout, vec!["sim:idle".parse().unwrap()]);
        let shared = crate::start::shared(&config).unwrap();
        let mut thread = crate::start::open_pipeline(&config, &shared).unwrap().thread;
        thread.sources = vec![Box::new(Flooded::default())];
        let thread = std::thread::spawn(move || thread.run());
        let deadline = std::time::Instant::now() + Duration::from_secs(200);
        let images = || shared.snapshot.lock().unwrap().images;
        while images() < 5 && std::time::Instant::now() < deadline {
            std::thread::sleep(Duration::from_millis(10));
        }
        let made = images();
        shared.stop.store(true, Ordering::Relaxed);
        thread.join().unwrap();
        assert!(made >= 5, "{made} images");
    }

    #[test]
    fn what_recordings_held_is_told_though_somebody_reads_the_snapshot_when_they_end() {
        let folder = tempfile::tempdir().unwrap();
        let recording = folder.path().join("hand.log");
        std::fs::write(&recording, "(0.000000) can0 123#00\n(0.001000) can0 123#00\n").unwrap();
        let layout = taxel_skin::Layout::builtin("uskin-module").unwrap();
        let source = format!("log:{}", recording.display()).parse().unwrap();
        let config = crate::Config::new(layout, vec![source]);
        let shared = crate::start::shared(&config).unwrap();
        let thread = crate::start::open_pipeline(&config, &shared).unwrap().thread;
        let reading = shared.snapshot.lock().unwrap();
        let begun = Instant::now();
        let thread = std::thread::spawn(move || thread.run());
        // The recording is over long before.
        while shared.heartbeat.load(Ordering::Relaxed) < 1000 {
            assert!(!thread.is_finished(), "it ended without having told");
            std::thread::yield_now();
        }
        assert!(!shared.finished.load(Ordering::Acquire));
        // Whoever reads is let get on, on the same core too: a round takes a millisecond once nothing else is to be done.
        assert!(begun.elapsed() >= Duration::from_millis(500));
        drop(reading);
        thread.join().unwrap();
        assert!(shared.finished.load(Ordering::Acquire));
        let told = shared.snapshot.lock().unwrap();
        assert_eq!((told.written, told.buses[0].source.received), (true, 2));
    }
}
