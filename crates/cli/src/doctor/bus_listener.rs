//! The buses while the doctor listens to them: opened without filters, read in turns, written to
//! only where asked.

use anyhow::Context;
use std::time::Duration;
use taxel_can::{
    CanFrame, CanSource, FrameMerge, LinkState, Received, SourceAddress, SourceCounters, SourceOptions,
    monotonic_ns,
};
use taxel_playback::interrupt::Interrupt;
use taxel_playback::progress::Progress;
use taxel_sim::SimSource;
use taxeld::Config;

/// Between two looks at the buses; the smallest kernel queue holds 30 ms of a full bus.
const TURN: Duration = Duration::from_millis(1);
const BATCH: usize = 4096;

/// The buses of a hand, or a recording of them.
pub(crate) struct BusListener {
    sources: Vec<Option<Box<dyn CanSource>>>,
    /// Whether the clock is the machine's; recordings bring their own.
    live: bool,
    /// The clock of recordings.
    recorded_ns: u64,
    interrupt: Interrupt,
}

/// Who listens.
pub(crate) trait Listener {
    /// A frame of a bus; frames of one turn come in the order of their times.
    fn handle_frame(&mut self, bus: u8, received: &Received);

    /// Called after each turn with the time; ends the listening by returning false.
    fn handle_turn(&mut self, bus_listener: &mut BusListener, now_ns: u64) -> bool;
}

impl BusListener {
    /// Opens the sources. What cannot be opened stays deaf; the reason is returned with the number
    /// of the bus.
    ///
    /// `config` has the layout that a `sim:` source simulates, and makes the sockets of pressure arrays.
    pub(crate) fn open(
        addresses: &[SourceAddress],
        config: Option<&Config>,
        receive_buffer: usize,
        interrupt: Interrupt,
    ) -> (Self, Vec<(usize, anyhow::Error)>) {
        let live = !addresses.iter().all(|a| matches!(a, SourceAddress::Log { .. }));
        let start_ns = if live { monotonic_ns() } else { 0 };
        let mut failures = Vec::new();
        let mut sources = Vec::new();
        for (bus, address) in addresses.iter().enumerate() {
            let source = match address {
                SourceAddress::Sim { scene } => {
                    // Without a layout, a scene named several times is its buses one after the other.
                    let bus = match config {
                        Some(_) => bus,
                        None => addresses[..bus]
                            .iter()
                            .filter(|before| *before == address)
                            .count(),
                    };
                    SimSource::open(scene, config.map(|config| &config.layout), bus as u8, start_ns)
                        .map(|source| Box::new(source) as Box<dyn CanSource>)
                        .map_err(anyhow::Error::from)
                }
                SourceAddress::Pressure { path }
                    if config.is_some_and(|c| c.layout.array_on(bus).is_some()) =>
                {
                    let made = config.map(|config| taxeld::open_array(config, bus, path));
                    made.context("no configuration").and_then(|made| Ok(made?))
                }
                address => {
                    let bus = config.and_then(|config| config.layout.buses.get(bus));
                    let options = SourceOptions {
                        bus: bus.cloned().unwrap_or_default(),
                        receive_buffer,
                        start_ns,
                        ..SourceOptions::default()
                    };
                    taxel_can::open(address, &options).map_err(anyhow::Error::from)
                }
            };
            sources.push(source.map_err(|e| failures.push((bus, e))).ok());
        }
        let bus_listener = Self {
            sources,
            live,
            recorded_ns: start_ns,
            interrupt,
        };
        (bus_listener, failures)
    }

    /// The time of the buses, nanoseconds.
    pub(crate) fn now_ns(&self) -> u64 {
        if self.live {
            monotonic_ns()
        } else {
            self.recorded_ns
        }
    }

    pub(crate) fn is_live(&self) -> bool {
        self.live
    }

    /// The source of a bus, where it could be opened.
    pub(crate) fn source(&self, bus: usize) -> Option<&dyn CanSource> {
        self.sources.get(bus)?.as_deref()
    }

    pub(crate) fn counters(&self, bus: usize) -> SourceCounters {
        self.source(bus)
            .map_or_else(SourceCounters::default, |s| *s.counters())
    }

    pub(crate) fn link(&self, bus: usize) -> LinkState {
        self.source(bus).map_or(LinkState::Absent, |s| s.link())
    }

    /// Sends a frame; says whether the bus took it.
    pub(crate) fn send(&mut self, bus: u8, frame: &CanFrame) -> bool {
        match self.sources.get_mut(usize::from(bus)) {
            Some(Some(source)) => source.send(frame).is_ok(),
            _ => false,
        }
    }

    /// Listens for `length_ns`, or to the end of a recording. Returns false if the user asked to stop.
    pub(crate) fn listen(&mut self, length_ns: u64, what: &str, listener: &mut dyn Listener) -> bool {
        let progress = match self.live {
            true => Progress::waiting(length_ns / 1_000_000, what),
            false => Progress::counting("ms of the recording"),
        };
        self.run(length_ns, true, &progress, listener)
    }

    /// Listens until the listener ends it. Returns false if the user asked to stop.
    pub(crate) fn attend(&mut self, listener: &mut dyn Listener) -> bool {
        self.run(u64::MAX / 2, true, &Progress::none(), listener)
    }

    /// As [`BusListener::listen`], for what has to be done even if the user asked to stop, such as stopping boards.
    pub(crate) fn finish(&mut self, length_ns: u64, listener: &mut dyn Listener) {
        let progress = Progress::waiting(length_ns / 1_000_000, "stopping the boards");
        self.run(length_ns, false, &progress, listener);
    }

    fn run(
        &mut self,
        length_ns: u64,
        heed_interrupt: bool,
        progress: &Progress,
        listener: &mut dyn Listener,
    ) -> bool {
        let begin_ns = self.now_ns();
        let end_ns = begin_ns.saturating_add(length_ns);
        let mut shown_ns = begin_ns;
        let mut merge = FrameMerge::new(self.sources.len(), BATCH, self.live);
        loop {
            if heed_interrupt && self.interrupt.is_set() {
                return false;
            }
            let now_ns = self.now_ns();
            loop {
                for (bus, source) in self.sources.iter_mut().enumerate() {
                    let Some(source) = source else { continue };
                    merge.fill(bus, now_ns, |frames| source.receive(now_ns, frames));
                }
                while let Some((bus, received)) = merge.pop() {
                    listener.handle_frame(bus, &received);
                }
                if !merge.has_more() {
                    break;
                }
            }
            progress.advance((now_ns - shown_ns) / 1_000_000);
            shown_ns += (now_ns - shown_ns) / 1_000_000 * 1_000_000;
            if !listener.handle_turn(self, now_ns) || now_ns >= end_ns || self.is_finished() {
                return true;
            }
            self.wait();
        }
    }

    fn is_finished(&self) -> bool {
        self.sources.iter().flatten().all(|s| s.is_finished())
    }

    fn wait(&mut self) {
        if self.live {
            std::thread::sleep(TURN);
            return;
        }
        let next = self
            .sources
            .iter()
            .flatten()
            .filter_map(|s| s.wakeup().at_ns)
            .min();
        self.recorded_ns = next
            .unwrap_or(self.recorded_ns)
            .max(self.recorded_ns + TURN.as_nanos() as u64);
    }
}
