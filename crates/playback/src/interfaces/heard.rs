//! What an interface of a log carries, read as each bus of a hand.

use crate::buses::traffic::Wanted;
use std::collections::BTreeSet;
use taxel_can::{CanFrame, EXTENDED_FLAG, LogFrame, Received};
use taxel_skin::{BusMonitor, Decoded, Decoder, Finding, Layout, Readings};

/// Frames of an interface that are looked at, or more until one is a board's.
const SURVEYED: u64 = 50_000;
/// Ids of nobody that are told apart.
const MOST_IDS: usize = 4096;
/// A board that is not heard speaks against a bus as so many ids of nobody do.
const BOARD_IDS: usize = 4;

/// One interface of a log.
pub(crate) struct Heard {
    pub(crate) name: String,
    pub(crate) frames: u64,
    /// By bus of the layout.
    pub(crate) as_bus: Vec<AsBus>,
}

/// What an interface carries, read as a bus of the layout.
pub(crate) struct AsBus {
    decoder: Decoder,
    pub(crate) modules: BTreeSet<u16>,
    /// Taxels that have a value.
    pub(crate) taxels: BTreeSet<u16>,
    /// Frames of nobody on that bus.
    pub(crate) unknown: u64,
    /// From the first reading on.
    monitor: Option<BusMonitor>,
    /// Modules under whose address two boards send.
    pub(crate) doubled: BTreeSet<u16>,
    /// Frames that have a board's id and not what its protocol says, and the first of them with its board.
    pub(crate) malformed: u64,
    pub(crate) first_malformed: Option<(u16, CanFrame)>,
    /// Ids of nobody on that bus, extended ones with their flag.
    pub(crate) foreign: BTreeSet<u32>,
}

impl Heard {
    pub(crate) fn new(name: &str, layout: &Layout) -> Self {
        let as_bus = |bus| AsBus {
            decoder: Decoder::new(layout, bus),
            modules: BTreeSet::new(),
            taxels: BTreeSet::new(),
            unknown: 0,
            monitor: None,
            doubled: BTreeSet::new(),
            malformed: 0,
            first_malformed: None,
            foreign: BTreeSet::new(),
        };
        Self {
            name: name.into(),
            frames: 0,
            as_bus: (0..layout.buses.len() as u8).map(as_bus).collect(),
        }
    }

    pub(crate) fn carries_boards(&self) -> bool {
        self.as_bus.iter().any(|bus| !bus.modules.is_empty())
    }

    pub(crate) fn is_known(&self) -> bool {
        self.frames > SURVEYED && self.carries_boards()
    }

    /// Whether all of its frames are looked at.
    pub(crate) fn is_whole(&self) -> bool {
        self.frames <= SURVEYED
    }

    pub(crate) fn take(&mut self, frame: &LogFrame, layout: &Layout, readings: &mut Readings) -> Wanted {
        self.frames += 1;
        if self.is_known() {
            return Wanted::Others;
        }
        for (index, bus) in (0u8..).zip(&mut self.as_bus) {
            match bus.decoder.decode_at(frame.t_ns, &frame.frame, readings) {
                Decoded::Readings => {
                    bus.watch(index, frame, layout, readings);
                    let modules = readings
                        .iter()
                        .map(|r| layout.taxels[usize::from(r.taxel)].module);
                    bus.modules.extend(modules);
                    bus.taxels.extend(readings.iter().map(|reading| reading.taxel));
                }
                Decoded::Malformed { board } => {
                    bus.malformed += 1;
                    bus.first_malformed.get_or_insert((board, frame.frame));
                }
                Decoded::Unknown => {
                    bus.unknown += 1;
                    let flag = if frame.frame.is_extended() {
                        EXTENDED_FLAG
                    } else {
                        0
                    };
                    if bus.foreign.len() < MOST_IDS {
                        bus.foreign.insert(frame.frame.id() | flag);
                    }
                }
                _ => {}
            }
        }
        Wanted::More
    }

    /// How much speaks against its being this bus.
    pub(crate) fn misfit(&self, bus: usize, boards: &[usize]) -> usize {
        let as_bus = &self.as_bus[bus];
        as_bus.foreign.len() + BOARD_IDS * boards[bus].saturating_sub(as_bus.modules.len())
    }
}

impl AsBus {
    /// Looks whether two boards send as one.
    fn watch(&mut self, index: u8, frame: &LogFrame, layout: &Layout, readings: &Readings) {
        let monitor = self.monitor.get_or_insert_with(|| BusMonitor::new(layout));
        let (t_ns, frame) = (frame.t_ns, frame.frame);
        monitor.handle_frame(index, &Received { t_ns, frame });
        readings
            .iter()
            .for_each(|reading| monitor.handle_reading(reading));
        let doubled = monitor.findings().iter().filter_map(|finding| match finding {
            Finding::TwoBoards { module, .. } => Some(*module),
            _ => None,
        });
        self.doubled.extend(doubled);
    }
}
