//! From the frames of one bus to taxel readings, by identifier and length alone.
//!
//! Byte 7 is `sda + 1` in the Waseda firmware and unused elsewhere, so it is not checked. In L2
//! that leaves one false reading possible: a board that boots answers its own set-up under `0x7b0 |
//! chip`, which for boards 0 to 3 are ids of board 7's taxels (docs/protocols.md, "uSkin ids" and
//! "uSkin values").

use crate::board_status::BoardStatus;
use crate::layout::Layout;
use crate::protocol::board_decoder::{BoardDecoder, BoardFrame, NOBODY};
use crate::protocol::cyskin::decode::HubFrameKind;
use crate::protocol::cyskin::setup::HubIds;
use crate::protocol::id_table::{IdEntry, IdTable, Kind};
use crate::protocol::mtb::{MtbBoards, MtbFrame};
use crate::protocol::uskin::decode::payload;
use crate::reading::{Readings, TaxelReading};
use taxel_can::{CanFrame, IdFilter};

/// What one frame was. `board` is the index of the board's module in [`taxel_hand::Geometry::modules`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Decoded {
    /// It carried readings; those of taxels of the layout are in the [`Readings`] given, which may
    /// be none (thermal pads, pads that the layout leaves out).
    Readings,
    /// It is the beginning or the middle of a packet of several frames: its readings come with the
    /// last of them.
    Partial,
    /// Its id is a board's, its length or content is not what the board's protocol says. For CySkin
    /// it is counted to the first module of the hub.
    Malformed {
        /// The board the id belongs to.
        board: u16,
    },
    /// The board's transmit queue was full and the board threw it away (id `0x700 | board << 4 | 5`
    /// without data, docs/protocols.md, "MTB3 firmware"): a part of its sweep is lost.
    QueueOverflow {
        /// The board.
        board: u16,
    },
    /// A command to a board: of another reader on the bus, of whoever made the recording, or our
    /// own where the source hears itself. Also an iCub board's answer to a question, and a CySkin
    /// packet that carries no values.
    Command,
    /// A standard or extended data frame that is nothing of this hand's, or the end of a CySkin packet with
    /// values of modules that the layout does not have on that hub.
    Unknown,
    /// A remote or error frame.
    NotData,
}

/// Frames of one bus by what they were; each frame is in exactly one count, or in a board's.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct BusCounters {
    /// Frames given to the decoder.
    pub frames: u64,
    /// Frames that carried readings, be it of places that are no taxels.
    pub readings: u64,
    /// Data frames that are nothing of this hand's.
    pub unknown: u64,
    /// Remote and error frames.
    pub not_data: u64,
    /// Commands to boards, their answers, and CySkin packets without values.
    pub commands: u64,
    /// Of these, commands that a board obeys. A source does not hear what this program sends: they are of another program on
    /// the bus, or in the recording.
    pub obeyed: u64,
    /// Frames that are the beginning or the middle of a packet.
    pub partial: u64,
    /// Packets, not frames, that were begun and given up: a frame was lost, came late or did not
    /// belong to them.
    pub abandoned: u64,
}

/// Decodes the frames of one bus with a table over the 2048 standard ids: constant time per frame,
/// no allocation. Frames with extended ids are looked up among the bus's CySkin hubs, if these use such.
#[derive(Debug, Clone)]
pub struct Decoder {
    bus: u8,
    table: IdTable,
    mtbs: MtbBoards,
    counters: BusCounters,
    boards: Vec<OfBoard>,
}

/// What is kept of one board, by module index.
#[derive(Debug, Default, Clone, Copy)]
struct OfBoard {
    malformed: u64,
    queue_overflows: u64,
    recalibrations: u64,
}

impl Decoder {
    /// A decoder for bus number `bus` of a layout, an index into [`Layout::buses`].
    pub fn new(layout: &Layout, bus: u8) -> Self {
        let (mut table, mut mtbs) = (IdTable::new(), MtbBoards::new());
        for (board, _, wiring) in layout.boards() {
            let protocol = wiring.protocol;
            if wiring.bus != bus || !protocol.has_board() {
                continue;
            }
            table.filters.extend(protocol.filter(wiring.board));
            if let Some(mtb) = protocol.mtb() {
                mtbs.add(wiring.board, board, mtb.configured);
            }
            protocol.0.enter(&mut table, &layout.wired_board(board));
        }
        table.settle_aliases();
        if !mtbs.is_empty() {
            table.let_through(IdFilter::standard(0x700, 0x700));
        }
        Self {
            bus,
            table,
            mtbs,
            counters: BusCounters::default(),
            boards: vec![OfBoard::default(); layout.modules.len()],
        }
    }

    /// Reads one frame. What was in `readings` is replaced where the answer is
    /// [`Decoded::Readings`] and emptied otherwise.
    ///
    /// Without a time, a packet of several frames is never given up for being late; see
    /// [`Decoder::decode_at`].
    #[inline]
    pub fn decode(&mut self, frame: &CanFrame, readings: &mut Readings) -> Decoded {
        self.decode_at(0, frame, readings)
    }

    /// Reads one frame that was received at `t_ns`, as [`Decoder::decode`] does. The time is used
    /// by protocols with packets of several frames, to give up those whose next frame does not
    /// come.
    #[inline]
    pub fn decode_at(&mut self, t_ns: u64, frame: &CanFrame, readings: &mut Readings) -> Decoded {
        self.counters.frames += 1;
        readings.clear();
        let Some(id) = frame.standard_id() else {
            return self.without_standard_id(t_ns, frame, readings);
        };
        let entry = self.table.ids[id as usize & 0x7FF];
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
            Kind::Board => self.board_frame(id, entry, data, readings),
            Kind::Hub => {
                let place = HubIds::Standard.place(id.into());
                self.hub_frame(entry.index, place, data, t_ns, readings)
            }
            Kind::HubCommand => {
                self.counters.commands += 1;
                self.counters.obeyed += 1;
                Decoded::Command
            }
            Kind::Taxel | Kind::Nobody => self.no_reading(id, entry.board, data),
        }
    }

    #[inline]
    fn board_frame(&mut self, id: u16, entry: IdEntry, data: &[u8], readings: &mut Readings) -> Decoded {
        let (_, decoder) = &mut self.table.decoders[entry.index as usize];
        match decoder.decode(id, data, readings) {
            BoardFrame::Readings => {}
            BoardFrame::Recalibrated => self.boards[entry.board as usize].recalibrations += 1,
            BoardFrame::Malformed => return self.no_reading(id, entry.board, data),
        }
        self.counters.readings += 1;
        Decoded::Readings
    }

    #[inline]
    fn without_standard_id(&mut self, t_ns: u64, frame: &CanFrame, readings: &mut Readings) -> Decoded {
        if frame.is_remote() || frame.is_error() {
            self.counters.not_data += 1;
            return Decoded::NotData;
        }
        let address = frame.id() & HubIds::Extended.everybody();
        let mut hubs = self.table.hubs.iter();
        let known = hubs.position(|hub| hub.ids == HubIds::Extended && hub.address == address);
        let Some(hub) = known else {
            self.counters.unknown += 1;
            return Decoded::Unknown;
        };
        let place = HubIds::Extended.place(frame.id());
        self.hub_frame(hub as u16, place, frame.data(), t_ns, readings)
    }

    /// A frame of a hub of this bus, at a place of its packet.
    #[inline]
    fn hub_frame(
        &mut self,
        hub: u16,
        place: u32,
        data: &[u8],
        t_ns: u64,
        readings: &mut Readings,
    ) -> Decoded {
        let hub = &mut self.table.hubs[hub as usize];
        let board = hub.first_board;
        let (heard, abandoned) = hub.handle_frame(place, data, t_ns, readings);
        self.counters.abandoned += abandoned as u64;
        match heard {
            HubFrameKind::Values => {
                self.counters.readings += 1;
                Decoded::Readings
            }
            HubFrameKind::OfNobody => {
                self.counters.unknown += 1;
                Decoded::Unknown
            }
            HubFrameKind::Partial => {
                self.counters.partial += 1;
                Decoded::Partial
            }
            HubFrameKind::Other => {
                self.counters.commands += 1;
                Decoded::Command
            }
            HubFrameKind::Malformed => {
                self.boards[board as usize].malformed += 1;
                Decoded::Malformed { board }
            }
        }
    }

    /// A standard data frame without readings.
    #[cold]
    fn no_reading(&mut self, id: u16, board_of_id: u16, data: &[u8]) -> Decoded {
        match self.mtbs.frame(id, data) {
            Some(MtbFrame::QueueOverflow(board)) => {
                self.boards[board as usize].queue_overflows += 1;
                return Decoded::QueueOverflow { board };
            }
            Some(kind @ (MtbFrame::Command | MtbFrame::Question)) => {
                self.counters.commands += 1;
                self.counters.obeyed += u64::from(kind == MtbFrame::Command);
                return Decoded::Command;
            }
            None => {}
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

    /// Adds this bus's malformed frames, queue overflows and re-calibrations of a board (module
    /// index) to its counters.
    pub fn add_to(&self, board: u16, counters: &mut BoardStatus) {
        if let Some(of_board) = self.boards.get(board as usize) {
            counters.malformed += of_board.malformed;
            counters.queue_overflows += of_board.queue_overflows;
            counters.recalibrations += of_board.recalibrations;
        }
    }

    /// How often a board (module index) has calibrated a triangle anew by itself, as an MTB4 does
    /// after five errors in a row (docs/protocols.md, "MTB4"). Each time the baseline of that
    /// triangle has jumped and holds no longer: a re-zero is due. Only ever grows.
    pub fn recalibrations(&self, board: u16) -> u64 {
        self.boards.get(board as usize).map_or(0, |b| b.recalibrations)
    }

    /// Newest raw value of a channel that is no taxel of the hand: a thermal pad of an iCub board
    /// (`triangle * 12 + pad`, 0 to 255), the temperature of a CySkin module (0), the proximity
    /// values of a `cpm-finger` (16 and 17). iCub pads that are taxels can be asked for too. `None`
    /// where nothing was heard, and for other channels.
    pub fn auxiliary(&self, board: u16, channel: u8) -> Option<u16> {
        let mut decoders = self.table.decoders.iter().filter(|(of, _)| *of == board);
        let mut hubs = self.table.hubs.iter().filter(|_| channel == 0);
        decoders
            .find_map(|(_, decoder)| decoder.auxiliary(channel))
            .or_else(|| hubs.find_map(|hub| hub.temperature(board)))
    }

    /// What to let through a kernel filter. The filters pass every taxel frame of the bus (exactly
    /// these for L1), every frame of its CySkin hubs and, where there is an MTB, its class-7
    /// frames (queue overflow, replies to discovery).
    pub fn filters(&self) -> &[IdFilter] {
        &self.table.filters
    }
}
