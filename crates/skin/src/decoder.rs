//! From the frames of one bus to taxel readings, by identifier and length alone.
//!
//! Byte 7 is `sda + 1` in the Waseda firmware and unused elsewhere, so it is not checked. In L2 that leaves one false
//! reading possible: a board that boots answers its own set-up under `0x7b0 | chip`, which for boards 0 to 3 are ids of
//! board 7's taxels (protocols.md 2.3, 2.6).

use crate::counters::BoardCounters;
use crate::uskin::{SET_TXMODE, payload};
use crate::{Layout, Protocol, TaxelReading};
use std::ops::Deref;
use taxel_can::{CanFrame, IdFilter};

/// Most readings that one frame of any board carries.
pub const MAX_READINGS: usize = 8;

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
    /// It carried readings; they are in the [`Readings`] given.
    Readings,
    /// Its id belongs to a taxel, its length does not: a taxel frame has 8 data bytes.
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
    /// A start or stop command to a board: of another reader on the bus, of whoever made the recording, or our own
    /// where the source hears itself.
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
    /// Start and stop commands to boards.
    pub commands: u64,
}

/// Decodes the frames of one bus with a table over the 2048 standard ids: constant time per frame, no allocation.
#[derive(Debug, Clone)]
pub struct Decoder {
    bus: u8,
    ids: Box<[IdEntry; 0x800]>,
    /// Board (module index) by MTB address, for queue overflows.
    mtb: [u16; 16],
    filters: Vec<IdFilter>,
    counters: BusCounters,
    /// Malformed frames and queue overflows, by module index.
    boards: Vec<[u64; 2]>,
}

#[derive(Debug, Clone, Copy)]
struct IdEntry {
    taxel: u16,
    board: u16,
    /// Keeps the status byte where the protocol has one; L3 does not use it.
    status_mask: u8,
}

impl Decoder {
    /// A decoder for bus number `bus` of a layout, an index into [`Layout::buses`].
    pub fn new(layout: &Layout, bus: u8) -> Self {
        let mut ids = Box::new(
            [IdEntry {
                taxel: NOBODY,
                board: NOBODY,
                status_mask: 0xFF,
            }; 0x800],
        );
        let mut mtb = [NOBODY; 16];
        let mut filters = Vec::new();
        for (board, module) in layout.modules.iter().enumerate() {
            if module.bus != bus {
                continue;
            }
            filters.extend(module.protocol.filter(module.board));
            if module.protocol.takes_commands() {
                mtb[(module.board & 15) as usize] = board as u16;
            }
            for (k, taxel) in layout.taxels.iter().enumerate().skip(module.first_taxel as usize) {
                if taxel.module as usize != board {
                    break;
                }
                if let Some(id) = module.protocol.can_id(module.board, taxel.k) {
                    ids[id as usize] = IdEntry {
                        taxel: k as u16,
                        board: board as u16,
                        status_mask: if module.protocol == Protocol::UskinL3 {
                            0
                        } else {
                            0xFF
                        },
                    };
                }
            }
        }
        if mtb != [NOBODY; 16] {
            filters.push(IdFilter::standard(0x700, 0x700));
        }
        Self {
            bus,
            ids,
            mtb,
            filters,
            counters: BusCounters::default(),
            boards: vec![[0; 2]; layout.modules.len()],
        }
    }

    /// Reads one frame. What was in `readings` is replaced where the answer is [`Decoded::Readings`] and emptied
    /// otherwise.
    pub fn decode(&mut self, frame: &CanFrame, readings: &mut Readings) -> Decoded {
        self.counters.frames += 1;
        readings.len = 0;
        let Some(id) = frame.standard_id() else {
            return self.without_standard_id(frame);
        };
        let entry = self.ids[id as usize & 0x7FF];
        let data: &[u8] = frame.data();
        let Ok(data) = <&[u8; 8]>::try_from(data) else {
            return self.short(id, entry.board, data);
        };
        if entry.taxel == NOBODY {
            self.counters.unknown += 1;
            return Decoded::Unknown;
        }
        let (status, counts) = payload(data);
        readings.set_one(TaxelReading {
            taxel: entry.taxel,
            counts,
            status: status & entry.status_mask,
        });
        self.counters.readings += 1;
        Decoded::Readings
    }

    #[cold]
    fn without_standard_id(&mut self, frame: &CanFrame) -> Decoded {
        if frame.is_remote() || frame.is_error() {
            self.counters.not_data += 1;
            Decoded::NotData
        } else {
            self.counters.unknown += 1;
            Decoded::Unknown
        }
    }

    /// A standard data frame of fewer than 8 bytes.
    #[cold]
    fn short(&mut self, id: u16, board_of_id: u16, data: &[u8]) -> Decoded {
        if data.is_empty() && id & 0x70F == 0x705 {
            let board = self.mtb[(id >> 4 & 15) as usize];
            if board != NOBODY {
                self.boards[board as usize][1] += 1;
                return Decoded::QueueOverflow { board };
            }
        }
        if id & 0x7F0 == 0x200 && matches!(data, [SET_TXMODE, 0 | 1]) {
            self.counters.commands += 1;
            return Decoded::Command;
        }
        if board_of_id != NOBODY {
            self.boards[board_of_id as usize][0] += 1;
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

    /// Adds this bus's malformed frames and queue overflows of a board (module index) to its counters.
    pub fn add_to(&self, board: u16, counters: &mut BoardCounters) {
        if let Some([malformed, overflows]) = self.boards.get(board as usize) {
            counters.malformed += malformed;
            counters.queue_overflows += overflows;
        }
    }

    /// What to let through a kernel filter. The filters pass every taxel frame of the bus (exactly these for L1 and
    /// L2) and, where there is an MTB, its class-7 frames (queue overflow, replies to discovery).
    pub fn filters(&self) -> &[IdFilter] {
        &self.filters
    }
}
