//! What a board protocol is to the rest of the skin: some facts, and what its own folder does.
//!
//! Everything here is asked when tables are built, or now and then. What is done with every frame is a
//! [`BoardDecoder`](super::board_decoder::BoardDecoder), which [`BoardProtocol::enter`] makes.

use super::commands::Sequences;
use super::icub::setup::IcubSetup;
use super::id_table::IdTable;
use super::mtb::{BoardKind, MtbCommand};
use super::wired_board::WiredBoard;
use crate::reading::TaxelReading;
use std::ops::Range;
use taxel_can::{CanFrame, IdFilter};

/// How a board speaks on the bus: one entry of the list in `protocol/mod.rs` (docs/protocols.md, "iCub skin",
/// "uSkin ids" and "CySkin").
#[derive(Clone, Copy)]
pub struct Protocol(pub(crate) &'static dyn BoardProtocol);

/// What holds for every board of a protocol.
#[derive(Debug, Clone)]
pub(crate) struct Properties {
    /// Its name in layout files.
    pub(crate) name: &'static str,
    pub(crate) addresses: Range<u8>,
    /// A board has taxel numbers `k = 0..taxel_numbers`.
    pub(crate) taxel_numbers: u16,
    pub(crate) measures: Measures,
    /// The keys of a module in a layout file that say where its board is and how it is set up:
    /// `bus` and `board`, or none for what is no board; beside them `icub`, `hub`, or `rows` and `columns`.
    pub(crate) keys: &'static [&'static str],
    /// What kind of MTB its boards are, if they are MTBs.
    pub(crate) mtb: Option<Mtb>,
    /// Whether the first values after power-up are no measurements.
    pub(crate) settles: bool,
    /// The bit rate of its bus, where that is public.
    pub(crate) bit_rate: Option<u32>,
    /// What a board is called in a proposed layout file.
    pub(crate) board_word: &'static str,
}

impl Properties {
    /// What most protocols have in common: 16 taxels of three axes on a bus of 1 Mbit/s.
    pub(crate) const USUAL: Self = Self {
        name: "",
        addresses: 0..1,
        taxel_numbers: 16,
        measures: Measures {
            axes: 3,
            bits: 16,
            rests_at_zero: false,
        },
        keys: &["bus", "board"],
        mtb: None,
        settles: true,
        bit_rate: Some(1_000_000),
        board_word: "board",
    };
}

/// What a taxel measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Measures {
    /// 3 for x, y and z. 1 where the only value is z, with x = y = 0; such counts do not wrap.
    pub axes: u8,
    /// Bits of a value. With 8 the steps are so coarse that a healthy taxel at rest keeps one value
    /// for seconds.
    pub bits: u8,
    /// Whether 0 is what a taxel reads that nothing presses, and no sign that it is dead.
    pub rests_at_zero: bool,
}

impl Measures {
    /// Whether the steps are so coarse that a healthy taxel at rest keeps one value for seconds.
    pub(crate) const fn has_coarse_steps(self) -> bool {
        self.bits <= 8
    }
}

/// What kind of MTB speaks a protocol. An MTB is started and stopped by `SET_TXMODE`, and says who it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Mtb {
    /// What a board that speaks the protocol answers to be.
    pub kinds: &'static [BoardKind],
    /// Whether it has to be configured before it is started, and sends on a period of its own from
    /// then on. Such a board answers questions while it sends; the others can be started for every
    /// sweep.
    pub configured: bool,
}

/// The arrangement of a board's taxels on its tile: rows of taxel numbers, -1 for an empty cell.
pub(crate) type Order = Vec<Vec<i16>>;

/// One protocol. Addresses and taxel numbers that it is asked about are within its [`Properties`].
pub(crate) trait BoardProtocol: Sync {
    fn properties(&self) -> &Properties;

    /// Standard id of the frames that carry taxel `k` of a board, alone or with others.
    fn frame_id(&self, _board: u8, _k: u16) -> Option<u16> {
        None
    }

    /// The board and taxel number `(board, k)` that an id means, if its frames carry one taxel and
    /// nothing else.
    fn taxel_of(&self, _id: u16) -> Option<(u8, u16)> {
        None
    }

    /// The board whose taxels' frames have an id.
    fn board_of(&self, id: u16) -> Option<u8> {
        self.taxel_of(id).map(|(board, _)| board)
    }

    /// The bits of an id that are the same in all frames of a board's taxels.
    fn board_mask(&self) -> Option<u16> {
        None
    }

    /// The frame of one taxel's value, if it has one of its own.
    fn frame(&self, _board: u8, _k: u16, _counts: [u16; 3], _status: u8) -> Option<CanFrame> {
        None
    }

    /// How many frames a sweep of the taxels `k` of a board takes.
    fn frames_per_sweep(&self, k: &[u16]) -> usize {
        k.len()
    }

    /// Enters the ids of a board into the table of its bus, with what decodes their frames.
    fn enter(&self, _table: &mut IdTable, _board: &WiredBoard<'_>) {}

    /// What the board, or the hub that it is on, is sent; `None` where it sends from power-up on.
    fn sequences(&self, _board: &WiredBoard<'_>) -> Option<Sequences> {
        None
    }

    /// Sweeps per second of a board that runs by itself, by what is public of it.
    fn nominal_hz(&self, _icub: Option<&IcubSetup>) -> Option<f64> {
        None
    }

    /// The order of the taxels on a module, where it need not be written.
    fn default_order(&self) -> Option<Order> {
        None
    }

    /// Whether number `k` measures temperature and is no taxel.
    fn is_temperature(&self, _k: u16, _icub: Option<&IcubSetup>) -> bool {
        false
    }

    /// The same, or whether it may be so: it is not missed where a layout leaves it out.
    fn may_be_temperature(&self, k: u16, icub: Option<&IcubSetup>) -> bool {
        self.is_temperature(k, icub)
    }

    /// Whether a reading is at the end of its range, but not that of a silent chip. It has a count of 0 or 65535 then, if
    /// only on an axis that is not measured.
    fn is_saturated(&self, reading: &TaxelReading) -> bool {
        match self.properties().measures.axes {
            1 => at_end(reading.counts[2]),
            _ => !reading.counts.into_iter().all(at_end) && reading.counts.into_iter().any(at_end),
        }
    }

    /// The arrangement to propose for a board with these taxels, ascending: as the makers draw it
    /// where they do.
    fn proposed_order(&self, taxels: &[u8]) -> Order {
        vec![taxels.iter().map(|k| i16::from(*k)).collect()]
    }
}

/// Whether a count is 0 or 65535.
pub(crate) const fn at_end(count: u16) -> bool {
    matches!(count, 0 | u16::MAX)
}

impl PartialEq for Protocol {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl Eq for Protocol {}

impl std::fmt::Debug for Protocol {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl Protocol {
    /// Its name in layout files.
    pub fn name(self) -> &'static str {
        self.0.properties().name
    }

    /// Its board addresses.
    ///
    /// MTBs have four address bits, of which 15 is the broadcast; to the iCub's, 0 is the host.
    /// L3's address is `group << 4 | controller`, that of `cyskin` the module's number on its hub.
    pub fn addresses(self) -> Range<u8> {
        self.0.properties().addresses.clone()
    }

    /// How many taxel numbers a board has, `k = 0..taxel_numbers()`.
    ///
    /// In L1 and L2 `k = sda << 2 | chip`, and in L2 `16 + 2 * sda + chip - 4` for chips 4 and 5 of a
    /// XELA 4x6 module. In L3 `k = sda << 4 | taxel`; the manual's module uses
    /// taxels 0 to 5 of each SDA line, so the numbers of a 4x6 module have gaps. iCub: `k =
    /// triangle * 12 + pad`, where some pads are no taxels; CySkin: `k = sensor`, where 0 is the
    /// temperature ([`crate::Decoder::auxiliary`] has those).
    pub(crate) fn taxel_numbers(self) -> u16 {
        self.0.properties().taxel_numbers
    }

    /// What its taxels measure.
    pub fn measures(self) -> Measures {
        self.0.properties().measures
    }

    /// What kind of MTB its boards are; `None` where they are no MTBs. XELA controllers (L3) send
    /// from power-up on and no command is known (docs/protocols.md, "uSkin commands").
    pub fn mtb(self) -> Option<Mtb> {
        self.0.properties().mtb
    }

    /// Whether a board that says it is of this kind speaks the protocol.
    pub fn is_spoken_by(self, kind: BoardKind) -> bool {
        self.mtb().is_some_and(|mtb| mtb.kinds.contains(&kind))
    }

    /// Whether there is a board at all: not for an array in a file.
    pub fn has_board(self) -> bool {
        self.takes_key("bus")
    }

    /// Whether a module of this protocol may have a key in its layout file: one of `bus`, `board`,
    /// `icub`, `hub`, `rows` and `columns`.
    pub(crate) fn takes_key(self, key: &str) -> bool {
        self.0.properties().keys.contains(&key)
    }

    /// Whether the first values after power-up are no measurements. An iCub board is calibrated
    /// before it speaks.
    pub(crate) fn settles(self) -> bool {
        self.0.properties().settles
    }

    /// What a board is called in a proposed layout file.
    pub(crate) fn board_word(self) -> &'static str {
        self.0.properties().board_word
    }

    /// The address of a board, or of the hub it is on, as messages write it: hubs' in hexadecimal.
    pub fn address_text(self, address: u32) -> String {
        match self.takes_key("hub") {
            true => format!("{address:#X}"),
            false => address.to_string(),
        }
    }

    /// The bit rate of its bus, bit/s; `None` where it is not public.
    pub fn bit_rate(self) -> Option<u32> {
        self.0.properties().bit_rate
    }

    /// Whether two protocols number their boards in one list, so that equal addresses mean the same board.
    pub(crate) fn has_addresses_of(self, other: Self) -> bool {
        self == other || (self.mtb().is_some() && other.mtb().is_some())
    }

    /// Standard id of the frames that carry taxel `k` of a board and nothing else; `None` if the
    /// protocol has no such board or taxel, or puts several taxels into a frame.
    pub fn can_id(self, board: u8, k: u16) -> Option<u16> {
        self.frame_id(board, k)
            .filter(|id| self.taxel_of(*id) == Some((board, k)))
    }

    /// Standard id of the frames that carry taxel `k` of a board, alone or with others; `None` if
    /// there is no such board or taxel, and for `cyskin`, which has extended ids.
    pub fn frame_id(self, board: u8, k: u16) -> Option<u16> {
        let known = self.addresses().contains(&board) && k < self.taxel_numbers();
        known.then(|| self.0.frame_id(board, k)).flatten()
    }

    /// The board and taxel number `(board, k)` a standard id means; `None` if no taxel has frames
    /// of its own with this id. It undoes [`Protocol::can_id`].
    pub fn taxel_of(self, id: u16) -> Option<(u8, u16)> {
        let known = |(board, _): &(u8, u16)| self.addresses().contains(board);
        self.0.taxel_of(id).filter(known)
    }

    /// The board whose taxels' frames have this standard id; `None` if there is none. Several
    /// boards may claim one under different protocols.
    pub fn board_of(self, id: u16) -> Option<u8> {
        let board = self.0.board_of(id).filter(|_| id <= 0x7FF);
        board.filter(|board| self.addresses().contains(board))
    }

    /// Standard id of the frames that start and stop a board; `None` where no such frame is sent.
    pub fn command_id(self, board: u8) -> Option<u16> {
        self.mtb().map(|_| MtbCommand::start(board).id())
    }

    /// A filter that passes the taxel frames of one board: exact for L1 and the iCub; for L2 it passes
    /// eight chips on a line, for L3 every taxel number, used or not, and for `cpm-finger` every id
    /// from 0x400 to 0x40F. `None` if the protocol has no such board, and for `cyskin`, whose ids are the hub's.
    pub fn filter(self, board: u8) -> Option<IdFilter> {
        let mask = self.0.board_mask()?;
        self.frame_id(board, 0)
            .map(|id| IdFilter::standard(id & mask, mask))
    }

    /// The frame that carries one taxel's value, as the board would send it: status, then x, y, z
    /// with the most significant byte first, then `sda + 1` (docs/protocols.md, "uSkin payload").
    /// `None` if there is no such board or taxel, or the protocol puts several taxels into a frame.
    pub fn frame(self, board: u8, k: u16, counts: [u16; 3], status: u8) -> Option<CanFrame> {
        self.can_id(board, k)?;
        self.0.frame(board, k, counts, status)
    }

    /// Whether a reading is at the end of its range: pressed beyond what the board can say, drifted
    /// or damaged. Not that of a chip that does not answer ([`Protocol::is_silent_chip`]).
    pub fn is_saturated(self, reading: &TaxelReading) -> bool {
        self.0.is_saturated(reading)
    }

    /// Whether a reading is what a chip gives that does not answer: all axes 0 or 65535. Taxels of
    /// one axis do not tell.
    pub fn is_silent_chip(self, reading: &TaxelReading) -> bool {
        self.measures().axes > 1 && reading.counts.into_iter().all(at_end)
    }
}
