//! From the frames of one bus to taxel readings, by identifier and length alone.
//!
//! Byte 7 is `sda + 1` in the Waseda firmware and unused elsewhere, so it is not checked. In L2 that leaves one false
//! reading possible: a board that boots answers its own set-up under `0x7b0 | chip`, which for boards 0 to 3 are ids of
//! board 7's taxels (protocols.md 2.3, 2.6).

use crate::counters::BoardCounters;
use crate::protocol::cpm_finger::{self, PROXIMITY, PROXIMITY_ID};
use crate::protocol::cyskin::{self, Hub};
use crate::protocol::icub::{self, PADS, Triangle};
use crate::protocol::mtb::{self, SET_TXMODE};
use crate::uskin::payload;
use crate::{Layout, Protocol, TaxelReading};
use std::ops::Deref;
use taxel_can::{CanFrame, IdFilter};

/// Most readings that one frame of any board carries: those of a CySkin packet of 255 data bytes, which come with its
/// last frame.
pub const MAX_READINGS: usize = 128;

const NOBODY: u16 = u16::MAX;

/// The readings of one frame: a small array without a heap.
#[derive(Debug, Clone, Copy)]
pub struct Readings {
    len: u8,
    items: [TaxelReading; MAX_READINGS],
}

impl Readings {
    /// No readings.
    pub const fn new() -> Self {
        const NONE: TaxelReading = TaxelReading {
            taxel: 0,
            counts: [0; 3],
            status: 0,
        };
        Self {
            len: 0,
            items: [NONE; MAX_READINGS],
        }
    }

    fn set_one(&mut self, reading: TaxelReading) {
        self.items[0] = reading;
        self.len = 1;
    }

    fn push(&mut self, reading: TaxelReading) {
        if let Some(place) = self.items.get_mut(self.len as usize) {
            *place = reading;
            self.len += 1;
        }
    }
}

impl Default for Readings {
    fn default() -> Self {
        Self::new()
    }
}

impl Deref for Readings {
    type Target = [TaxelReading];

    fn deref(&self) -> &[TaxelReading] {
        &self.items[..self.len as usize]
    }
}

/// What one frame was. `board` is the index of the board's module in [`Layout::modules`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Decoded {
    /// It carried readings; those of taxels of the layout are in the [`Readings`] given, which may be none (thermal
    /// pads, pads that the layout leaves out).
    Readings,
    /// It is the beginning or the middle of a packet of several frames: its readings come with the last of them.
    Partial,
    /// Its id is a board's, its length or content is not what the board's protocol says. For CySkin it is counted to
    /// the first module of the hub.
    Malformed {
        /// The board the id belongs to.
        board: u16,
    },
    /// The board's transmit queue was full and the board threw it away (id `0x700 | board << 4 | 5` without data,
    /// protocols.md 1.9): a part of its sweep is lost.
    QueueOverflow {
        /// The board.
        board: u16,
    },
    /// A command to a board: of another reader on the bus, of whoever made the recording, or our own where the source
    /// hears itself. Also an iCub board's answer to a question, and a CySkin packet that carries no values.
    Command,
    /// A standard or extended data frame that is nothing of this hand's.
    Unknown,
    /// A remote or error frame.
    NotData,
}

/// Frames of one bus by what they were; each frame is in exactly one count, or in a board's.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct BusCounters {
    /// Frames given to the decoder.
    pub frames: u64,
    /// Frames that carried readings.
    pub readings: u64,
    /// Data frames that are nothing of this hand's.
    pub unknown: u64,
    /// Remote and error frames.
    pub not_data: u64,
    /// Commands to boards, their answers, and CySkin packets without values.
    pub commands: u64,
    /// Frames that are the beginning or the middle of a packet.
    pub partial: u64,
    /// Packets, not frames, that were begun and given up: a frame was lost, came late or did not belong to them.
    pub abandoned: u64,
}

/// Decodes the frames of one bus with a table over the 2048 standard ids: constant time per frame, no allocation.
/// Frames with extended ids are looked up among the bus's CySkin hubs.
#[derive(Debug, Clone)]
pub struct Decoder {
    bus: u8,
    ids: Box<[IdEntry; 0x800]>,
    /// Board (module index) by MTB address, for queue overflows.
    mtb: [u16; 16],
    /// iCub boards among them, by address: they take more commands than start and stop.
    icub: [bool; 16],
    triangles: Vec<Triangle>,
    /// Taxels of each `cpm-finger` by channel.
    fingers: Vec<[u16; 16]>,
    hubs: Vec<Hub>,
    filters: Vec<IdFilter>,
    counters: BusCounters,
    boards: Vec<OfBoard>,
}

/// What is kept of one board, by module index.
#[derive(Debug, Default, Clone, Copy)]
struct OfBoard {
    malformed: u64,
    queue_overflows: u64,
    recalibrations: u64,
    /// Proximity values of a `cpm-finger`.
    proximity: [Option<u16>; 2],
}

#[derive(Debug, Clone, Copy)]
struct IdEntry {
    kind: Kind,
    /// Keeps the status byte where the protocol has one; L3 does not use it.
    status_mask: u8,
    board: u16,
    /// The taxel, or the place in `triangles` or `fingers`, as `kind` says.
    index: u16,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Nobody,
    Taxel,
    Triangle,
    Finger,
    Proximity,
}

impl Decoder {
    /// A decoder for bus number `bus` of a layout, an index into [`Layout::buses`].
    pub fn new(layout: &Layout, bus: u8) -> Self {
        let nobody = IdEntry {
            kind: Kind::Nobody,
            status_mask: 0xFF,
            board: NOBODY,
            index: NOBODY,
        };
        let mut decoder = Self {
            bus,
            ids: Box::new([nobody; 0x800]),
            mtb: [NOBODY; 16],
            icub: [false; 16],
            triangles: Vec::new(),
            fingers: Vec::new(),
            hubs: Vec::new(),
            filters: Vec::new(),
            counters: BusCounters::default(),
            boards: vec![OfBoard::default(); layout.modules.len()],
        };
        let mut hub_of = Vec::new();
        if let Some(setup) = &layout.cyskin {
            for hub in &setup.hubs {
                hub_of.push(decoder.hubs.len());
                if hub.bus == bus {
                    decoder.hubs.push(Hub::new(setup, hub.address));
                }
            }
        }
        for (board, module, wiring) in layout.boards() {
            if wiring.bus != bus || wiring.protocol == Protocol::Offline {
                continue;
            }
            decoder.filters.extend(wiring.protocol.filter(wiring.board));
            if wiring.protocol.takes_commands() {
                let address = (wiring.board & 15) as usize;
                decoder.mtb[address] = board;
                decoder.icub[address] = wiring.protocol.is_icub();
                if wiring.protocol.is_icub() {
                    let answer = 0x200 | u16::from(wiring.board & 15) << 4;
                    decoder.filters.push(IdFilter::standard(answer, 0x7FF));
                }
            }
            for (taxel, &k) in (module.first_taxel..).zip(layout.k_of(module)) {
                match wiring.hub {
                    Some(hub) => decoder.hubs[hub_of[hub as usize]].add_taxel(board, wiring.board, k, taxel),
                    None => decoder.add_taxel(wiring.protocol, board, wiring.board, k, taxel),
                }
            }
        }
        // Boards set up by obsolete commands send under class 3 (protocols.md 1.3); whoever has such an id as its own
        // keeps it.
        for id in 0x410..0x4F0 {
            let entry = decoder.ids[id];
            let alias = id - 0x100;
            if entry.kind == Kind::Triangle && decoder.ids[alias].kind == Kind::Nobody {
                decoder.ids[alias] = entry;
                let filter = IdFilter::standard(alias as u16 & 0x7F0, 0x7F0);
                if !decoder.filters.contains(&filter) {
                    decoder.filters.push(filter);
                }
            }
        }
        if decoder.mtb != [NOBODY; 16] {
            decoder.filters.push(IdFilter::standard(0x700, 0x700));
        }
        decoder.hubs.retain(|hub| hub.first_board != NOBODY);
        for hub in &decoder.hubs {
            decoder
                .filters
                .push(IdFilter::extended(hub.address, cyskin::LARGEST_ADDRESS | 1));
        }
        decoder
    }

    fn add_taxel(&mut self, protocol: Protocol, board: u16, address: u8, k: u8, taxel: u16) {
        let Some(id) = protocol.frame_id(address, k) else {
            return;
        };
        let entry = &mut self.ids[id as usize];
        if protocol.is_icub() {
            if entry.kind != Kind::Triangle {
                *entry = IdEntry {
                    kind: Kind::Triangle,
                    status_mask: 0xFF,
                    board,
                    index: self.triangles.len() as u16,
                };
                self.triangles.push(Triangle::new(protocol));
            }
            self.triangles[entry.index as usize].taxels[(k % PADS) as usize] = taxel;
        } else if protocol == Protocol::CpmFinger {
            if self.ids[PROXIMITY_ID as usize].board != board {
                let finger = |kind| IdEntry {
                    kind,
                    status_mask: 0xFF,
                    board,
                    index: self.fingers.len() as u16,
                };
                for id in [0x405, 0x407, 0x409, 0x40B] {
                    self.ids[id] = finger(Kind::Finger);
                }
                self.ids[PROXIMITY_ID as usize] = finger(Kind::Proximity);
                self.filters.push(IdFilter::standard(PROXIMITY_ID, 0x7FF));
                self.fingers.push([NOBODY; 16]);
            }
            if let Some(finger) = self.fingers.last_mut() {
                finger[k as usize] = taxel;
            }
        } else {
            *entry = IdEntry {
                kind: Kind::Taxel,
                status_mask: if protocol == Protocol::UskinL3 { 0 } else { 0xFF },
                board,
                index: taxel,
            };
        }
    }

    /// Reads one frame. What was in `readings` is replaced where the answer is [`Decoded::Readings`] and emptied
    /// otherwise.
    ///
    /// Without a time, a packet of several frames is never given up for being late; see [`Decoder::decode_at`].
    #[inline]
    pub fn decode(&mut self, frame: &CanFrame, readings: &mut Readings) -> Decoded {
        self.decode_at(0, frame, readings)
    }

    /// Reads one frame that was received at `t_ns`, as [`Decoder::decode`] does. The time is used by protocols with
    /// packets of several frames, to give up those whose next frame does not come.
    #[inline]
    pub fn decode_at(&mut self, t_ns: u64, frame: &CanFrame, readings: &mut Readings) -> Decoded {
        self.counters.frames += 1;
        readings.len = 0;
        let Some(id) = frame.standard_id() else {
            return self.without_standard_id(t_ns, frame, readings);
        };
        let entry = self.ids[id as usize & 0x7FF];
        let data: &[u8] = frame.data();
        if entry.kind == Kind::Taxel
            && let Ok(data) = <&[u8; 8]>::try_from(data)
        {
            let (status, counts) = payload(data);
            readings.set_one(TaxelReading {
                taxel: entry.index,
                counts,
                status: status & entry.status_mask,
            });
            self.counters.readings += 1;
            return Decoded::Readings;
        }
        match entry.kind {
            Kind::Triangle => self.triangle(id, entry, data, readings),
            Kind::Finger => {
                let Ok(data) = <&[u8; 8]>::try_from(data) else {
                    return self.no_reading(id, entry.board, data);
                };
                let taxels = &self.fingers[entry.index as usize];
                cpm_finger::hear(id, data, taxels, |reading| readings.push(reading));
                self.counters.readings += 1;
                Decoded::Readings
            }
            Kind::Proximity => self.proximity(id, entry.board, data),
            Kind::Taxel | Kind::Nobody => self.no_reading(id, entry.board, data),
        }
    }

    #[inline]
    fn triangle(&mut self, id: u16, entry: IdEntry, data: &[u8], readings: &mut Readings) -> Decoded {
        let triangle = &mut self.triangles[entry.index as usize];
        match triangle.hear(data, |reading| readings.push(reading)) {
            icub::Heard::Pads => {}
            icub::Heard::Recalibrated => self.boards[entry.board as usize].recalibrations += 1,
            icub::Heard::Malformed => return self.no_reading(id, entry.board, data),
        }
        self.counters.readings += 1;
        Decoded::Readings
    }

    fn proximity(&mut self, id: u16, board: u16, data: &[u8]) -> Decoded {
        let [a, b, c, d, ..] = *data else {
            return self.no_reading(id, board, data);
        };
        let values = [u16::from_le_bytes([a, b]), u16::from_le_bytes([c, d])];
        self.boards[board as usize].proximity = values.map(Some);
        self.counters.readings += 1;
        Decoded::Readings
    }

    #[inline]
    fn without_standard_id(&mut self, t_ns: u64, frame: &CanFrame, readings: &mut Readings) -> Decoded {
        if frame.is_remote() || frame.is_error() {
            self.counters.not_data += 1;
            return Decoded::NotData;
        }
        let address = frame.id() & (cyskin::LARGEST_ADDRESS | 1);
        let Some(hub) = self.hubs.iter_mut().find(|hub| hub.address == address) else {
            self.counters.unknown += 1;
            return Decoded::Unknown;
        };
        let board = hub.first_board;
        let (heard, abandoned) = hub.hear(frame, t_ns, |reading| readings.push(reading));
        self.counters.abandoned += abandoned as u64;
        match heard {
            cyskin::Heard::Values => {
                self.counters.readings += 1;
                Decoded::Readings
            }
            cyskin::Heard::Partial => {
                self.counters.partial += 1;
                Decoded::Partial
            }
            cyskin::Heard::Other => {
                self.counters.commands += 1;
                Decoded::Command
            }
            cyskin::Heard::Malformed => {
                self.boards[board as usize].malformed += 1;
                Decoded::Malformed { board }
            }
        }
    }

    /// A standard data frame without readings.
    #[cold]
    fn no_reading(&mut self, id: u16, board_of_id: u16, data: &[u8]) -> Decoded {
        if data.is_empty() && id & 0x70F == 0x705 {
            let board = self.mtb[(id >> 4 & 15) as usize];
            if board != NOBODY {
                self.boards[board as usize].queue_overflows += 1;
                return Decoded::QueueOverflow { board };
            }
        }
        let start_or_stop = matches!(data, [SET_TXMODE, 0 | 1]);
        let to_icub = self.icub[(id & 15) as usize] || (id & 15 == 15 && self.icub.contains(&true));
        if id & 0x7F0 == 0x200 && (start_or_stop || (to_icub && mtb::is_command(data))) {
            self.counters.commands += 1;
            return Decoded::Command;
        }
        let answer = data.len() == 8 && data[0] == mtb::GET_FW_VERSION;
        if id & 0x70F == 0x200 && answer && self.icub[(id >> 4 & 15) as usize] {
            self.counters.commands += 1;
            return Decoded::Command;
        }
        if board_of_id != NOBODY {
            self.boards[board_of_id as usize].malformed += 1;
            return Decoded::Malformed { board: board_of_id };
        }
        self.counters.unknown += 1;
        Decoded::Unknown
    }

    /// The bus this decoder is for.
    pub fn bus(&self) -> u8 {
        self.bus
    }

    /// What has been decoded on this bus.
    pub fn counters(&self) -> &BusCounters {
        &self.counters
    }

    /// Adds this bus's malformed frames, queue overflows and re-calibrations of a board (module index) to its counters.
    pub fn add_to(&self, board: u16, counters: &mut BoardCounters) {
        if let Some(of_board) = self.boards.get(board as usize) {
            counters.malformed += of_board.malformed;
            counters.queue_overflows += of_board.queue_overflows;
            counters.recalibrations += of_board.recalibrations;
        }
    }

    /// How often a board (module index) has calibrated a triangle anew by itself, as an MTB4 does after five errors in
    /// a row (protocols.md 1.8). Each time the baseline of that triangle has jumped and holds no longer: a re-zero is
    /// due. Only ever grows.
    pub fn recalibrations(&self, board: u16) -> u64 {
        self.boards.get(board as usize).map_or(0, |b| b.recalibrations)
    }

    /// Newest raw value of a channel that is no taxel of the hand: a thermal pad of an iCub board (`triangle * 12 + pad`,
    /// 0 to 255), the temperature of a CySkin module (0), the proximity values of a `cpm-finger` (16 and 17). iCub pads
    /// that are taxels can be asked for too. `None` where nothing was heard, and for other channels.
    pub fn auxiliary(&self, layout: &Layout, board: u16, channel: u8) -> Option<u16> {
        let wiring = layout.wiring.get(board as usize)?;
        if wiring.bus != self.bus {
            return None;
        }
        match wiring.protocol {
            Protocol::IcubMtb3 | Protocol::IcubMtb4 => {
                let id = wiring.protocol.frame_id(wiring.board, channel)?;
                let entry = self.ids[id as usize & 0x7FF];
                let own = entry.kind == Kind::Triangle && entry.board == board;
                let triangle = own.then(|| &self.triangles[entry.index as usize])?;
                triangle.value(channel % PADS).map(u16::from)
            }
            Protocol::Cyskin if channel == 0 => self.hubs.iter().find_map(|hub| hub.temperature(board)),
            Protocol::CpmFinger => {
                let place = channel.checked_sub(PROXIMITY)?;
                *self.boards.get(board as usize)?.proximity.get(place as usize)?
            }
            _ => None,
        }
    }

    /// What to let through a kernel filter. The filters pass every taxel frame of the bus (exactly these for L1 and
    /// L2), every frame of its CySkin hubs and, where there is an MTB, its class-7 frames (queue overflow, replies to
    /// discovery).
    pub fn filters(&self) -> &[IdFilter] {
        &self.filters
    }
}
