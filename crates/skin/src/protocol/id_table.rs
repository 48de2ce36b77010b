//! Which board's frames have which standard id on a bus, and what decodes them.

use super::board_decoder::{BoardDecoder, BoardFrame, NOBODY};
use super::cpm_finger::decode::Finger;
use super::cyskin::decode::Hub;
use super::cyskin::setup::{CyskinHub, CyskinSetup, HubIds};
use super::icub::decode::Triangle;
use super::pressure_array::decode::Array;
use crate::reading::Readings;
use taxel_can::IdFilter;

/// The kinds of boards that have a decoder of their own, in a list and not behind a pointer: they
/// are asked with every frame.
#[derive(Debug, Clone)]
pub(crate) enum KindDecoder {
    Icub(Triangle),
    CpmFinger(Finger),
    PressureArray(Array),
}

impl BoardDecoder for KindDecoder {
    #[inline]
    fn decode(&mut self, id: u16, data: &[u8], readings: &mut Readings) -> BoardFrame {
        match self {
            KindDecoder::Icub(triangle) => triangle.decode(id, data, readings),
            KindDecoder::CpmFinger(finger) => finger.decode(id, data, readings),
            KindDecoder::PressureArray(array) => array.decode(id, data, readings),
        }
    }

    fn auxiliary(&self, channel: u8) -> Option<u16> {
        match self {
            KindDecoder::Icub(triangle) => triangle.auxiliary(channel),
            KindDecoder::CpmFinger(finger) => finger.auxiliary(channel),
            KindDecoder::PressureArray(array) => array.auxiliary(channel),
        }
    }
}

/// What the frames of an id are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Nobody,
    /// One taxel in eight bytes, as the uSkin boards send it.
    Taxel,
    /// Something that the board's own decoder reads.
    Board,
    /// A part of a CySkin hub's packet.
    Hub,
    /// What all CySkin hubs are told.
    HubCommand,
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct IdEntry {
    pub(crate) kind: Kind,
    /// Keeps the status byte where the protocol has one.
    pub(crate) status_mask: u8,
    /// Index of the module.
    pub(crate) board: u16,
    /// The taxel, or the place of the decoder or hub, as `kind` says.
    pub(crate) index: u16,
}

/// The ids of one bus. Protocols enter their boards one after another; who comes later takes an id over.
#[derive(Debug, Clone)]
pub(crate) struct IdTable {
    pub(crate) ids: Box<[IdEntry; 0x800]>,
    /// The boards' own decoders, with their modules.
    pub(crate) decoders: Vec<(u16, KindDecoder)>,
    pub(crate) hubs: Vec<Hub>,
    /// Ids that mean what another one means, unless they have a meaning of their own.
    aliases: Vec<(u16, u16)>,
    /// What the kernel lets through.
    pub(crate) filters: Vec<IdFilter>,
}

impl IdTable {
    pub(crate) fn new() -> Self {
        let nobody = IdEntry {
            kind: Kind::Nobody,
            status_mask: 0xFF,
            board: NOBODY,
            index: NOBODY,
        };
        Self {
            ids: Box::new([nobody; 0x800]),
            decoders: Vec::new(),
            hubs: Vec::new(),
            aliases: Vec::new(),
            filters: Vec::new(),
        }
    }

    /// The frames of this id carry one taxel of a board (index of its module).
    pub(crate) fn enter_taxel(&mut self, id: u16, board: u16, taxel: u16, status_mask: u8) {
        self.ids[usize::from(id) & 0x7FF] = IdEntry {
            kind: Kind::Taxel,
            status_mask,
            board,
            index: taxel,
        };
    }

    /// The frames of these ids are read by a decoder of the board's own.
    pub(crate) fn enter_decoder(
        &mut self,
        ids: impl IntoIterator<Item = u16>,
        board: u16,
        decoder: KindDecoder,
    ) {
        let entry = IdEntry {
            kind: Kind::Board,
            status_mask: 0xFF,
            board,
            index: self.decoders.len() as u16,
        };
        self.decoders.push((board, decoder));
        for id in ids {
            self.ids[usize::from(id) & 0x7FF] = entry;
        }
    }

    /// An id whose frames are those of another one, if nobody has it as its own.
    pub(crate) fn enter_alias(&mut self, alias: u16, id: u16) {
        self.aliases.push((alias & 0x7FF, id & 0x7FF));
    }

    /// The hub of a CySkin module (index in the layout).
    pub(crate) fn enter_hub(&mut self, setup: &CyskinSetup, hub: &CyskinHub, board: u16) -> &mut Hub {
        let known = self.hubs.iter().position(|h| h.address == hub.address);
        let place = known.unwrap_or_else(|| {
            let place = self.hubs.len();
            let entry = |kind| IdEntry {
                kind,
                status_mask: 0xFF,
                board,
                index: place as u16,
            };
            for id in setup.ids.standard_ids(setup.ids.everybody()) {
                self.ids[usize::from(id) & 0x7FF] = entry(Kind::HubCommand);
            }
            for id in setup.ids.standard_ids(hub.address) {
                self.ids[usize::from(id) & 0x7FF] = entry(Kind::Hub);
            }
            self.hubs.push(Hub::new(setup, hub.address));
            let (address, everybody) = (hub.address, setup.ids.everybody());
            self.let_through(match setup.ids {
                HubIds::Standard => IdFilter::standard(address as u16, everybody as u16),
                HubIds::Extended => IdFilter::extended(address, everybody),
            });
            place
        });
        &mut self.hubs[place]
    }

    /// Lets frames through that are not those of taxels.
    pub(crate) fn let_through(&mut self, filter: IdFilter) {
        if !self.filters.contains(&filter) {
            self.filters.push(filter);
        }
    }

    /// Gives the aliases that nobody has as an id of its own their meaning, once every board was entered.
    pub(crate) fn settle_aliases(&mut self) {
        let mut aliases = std::mem::take(&mut self.aliases);
        aliases.sort_unstable();
        for (alias, id) in aliases {
            let entry = self.ids[usize::from(id)];
            if entry.kind == Kind::Board && self.ids[usize::from(alias)].kind == Kind::Nobody {
                self.ids[usize::from(alias)] = entry;
                self.let_through(IdFilter::standard(alias & 0x7F0, 0x7F0));
            }
        }
    }
}
