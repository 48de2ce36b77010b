//! Addresses that the layout does not have on a bus: where boards on the wrong bus, or with a wrong
//! address, would be.

use super::tally::Tally;
use crate::layout::{Layout, Wiring};
use crate::protocol::Protocol;
use crate::protocol::cyskin::setup::{CyskinHub, CyskinSetup};
use crate::protocol::mtb::BoardKind;

/// In place of the module of an id: there is none.
pub(super) const NOBODY: u16 = u16::MAX;

/// An iCub board that answers on the wrong bus is taken to be there for this many windows more. It
/// is asked every 300 ms, and not for 0.9 s while it is configured blindly on its own bus.
pub(super) const ANSWER_WINDOWS: u8 = 5;

/// A condition that has to hold, or not to hold, twice in a row.
#[derive(Debug, Clone, Copy)]
pub(super) struct Held<T> {
    pub(super) is: Option<T>,
    pub(super) next: Option<T>,
}

impl<T> Default for Held<T> {
    fn default() -> Self {
        Self { is: None, next: None }
    }
}

impl<T: Copy + PartialEq> Held<T> {
    /// Takes whether it holds now, and returns whether it counts as held.
    pub(super) fn update(&mut self, now: Option<T>) -> Option<T> {
        if self.next == now {
            self.is = now;
        }
        self.next = now;
        self.is
    }
}

/// An address that the layout does not have on this bus.
#[derive(Debug, Clone)]
pub(super) struct Stray {
    pub(super) bus: u8,
    pub(super) protocol: Protocol,
    pub(super) address: u32,
    /// Its standard ids; a CySkin hub is told by its address.
    pub(super) ids: Vec<u16>,
    /// The module that has this address, on another bus.
    pub(super) module: Option<u16>,
    /// Whether a board is there: `module`, if nothing comes of that on its own bus, or else one that the layout does not have.
    pub(super) there: Held<Option<u16>>,
    /// Whether that held for a window more and holds now: until it does, other boards may be about to follow it.
    pub(super) is_settled: bool,
    /// It answered a question within this many windows to come.
    pub(super) answered: u8,
}

impl Stray {
    /// Judges a window by what its bus carried and what each address there answered to be. Nothing came of its module
    /// `elsewhere`.
    pub(super) fn end_window(
        &mut self,
        tally: &Tally,
        answers: &[Option<BoardKind>; 16],
        elsewhere: Option<u16>,
    ) {
        let speaks = if self.protocol == Protocol::CYSKIN {
            tally.hub(self.address).packets > 0
        } else {
            2 * self.spoken(tally).count() >= self.ids.len()
        };
        if self.module.is_some() && answers_questions(self.protocol) {
            let answer = answers[self.address as usize & 15];
            self.answered = if elsewhere.is_none() {
                0
            } else if answer.is_some_and(|kind| self.protocol.is_spoken_by(kind)) {
                ANSWER_WINDOWS
            } else {
                self.answered.saturating_sub(1)
            };
        }
        let before = self.there.is;
        if speaks || self.answered > 0 {
            self.there.update(Some(elsewhere));
        } else {
            // One window without most of a board's ids is proof enough that it is gone.
            self.there = Held::default();
        }
        // In the window in which boards change their bus, some speak on both and some not yet on the other.
        self.is_settled = [before, Some(elsewhere)] == [self.there.is; 2];
    }

    /// Its ids that were heard in this window.
    fn spoken<'a>(&'a self, tally: &'a Tally) -> impl Iterator<Item = u16> + 'a {
        self.ids
            .iter()
            .copied()
            .filter(|id| tally.ids[usize::from(*id)].frames > 0)
    }

    /// Whether all that was heard of it are ids of this other one, of which more were heard: boards of different kinds have
    /// ids in common.
    pub(super) fn is_another(&self, other: &Self, tally: &Tally) -> bool {
        let heard = self.spoken(tally).count();
        self.bus == other.bus
            && other.is_settled
            && heard > 0
            && heard < other.spoken(tally).count()
            && self.spoken(tally).all(|id| other.ids.contains(&id))
    }
}

/// Whether boards of a protocol say whether they are there while they send: such an answer is no stranger's.
pub(super) fn answers_questions(protocol: Protocol) -> bool {
    protocol.mtb().is_some_and(|mtb| mtb.configured)
}

/// Two buses that could be swapped, and the strays on either that are boards of the other.
#[derive(Debug, Clone)]
pub(super) struct Pair {
    pub(super) buses: [u8; 2],
    pub(super) strays: Vec<usize>,
}

/// The standard ids of a board's frames.
pub(super) fn ids_of(protocol: Protocol, address: u8, k: &[u16]) -> Vec<u16> {
    let mut ids: Vec<u16> = k.iter().filter_map(|k| protocol.frame_id(address, *k)).collect();
    ids.sort_unstable();
    ids.dedup();
    ids
}

/// Every address that a bus could have and does not, for the protocols of the hand that number
/// their boards. A board is told by at least half of the ids that a module of its kind uses;
/// addresses whose ids others on the bus use too cannot be told. `owners` are the modules of each
/// standard id, by bus.
pub(super) fn strays(layout: &Layout, owners: &[&[u16; 0x800]]) -> Vec<Stray> {
    let mut strays: Vec<Stray> = Vec::new();
    let kinds = kinds(layout);
    for (bus, owners) in (0u8..).zip(owners) {
        let of_hubs = hub_ids(layout, bus);
        for &(protocol, k) in &kinds {
            for address in protocol.addresses() {
                let ids = ids_of(protocol, address, k);
                let known = |id: &u16| owners[usize::from(*id)] != NOBODY || of_hubs.contains(id);
                let there = strays
                    .iter()
                    .any(|s| (s.bus, s.protocol, s.address) == (bus, protocol, address.into()));
                if there || ids.is_empty() || ids.iter().any(known) {
                    continue;
                }
                let of_hand = |m: &&Wiring| (m.protocol, m.board) == (protocol, address) && m.bus != bus;
                let module = (0u16..).zip(&layout.wiring).find(|(_, m)| of_hand(m));
                strays.push(Stray {
                    bus,
                    protocol,
                    address: address.into(),
                    ids,
                    module: module.map(|(index, _)| index),
                    there: Held::default(),
                    is_settled: false,
                    answered: 0,
                });
            }
        }
    }
    for bus in 0..owners.len() as u8 {
        strays.extend(stray_hubs(layout, bus));
    }
    strays
}

/// The kinds of modules whose boards have numbers: protocol and taxel numbers, each once, as a hand has a thousand modules
/// of few kinds.
fn kinds(layout: &Layout) -> Vec<(Protocol, &[u16])> {
    let mut kinds = Vec::new();
    for (_, module, wiring) in layout.boards() {
        let kind = (wiring.protocol, layout.k_of(module));
        if kind.0.addresses().len() >= 2 && !kinds.contains(&kind) {
            kinds.push(kind);
        }
    }
    kinds
}

/// The standard ids of what the hubs of a bus say and are told, among which are those of some other boards.
fn hub_ids(layout: &Layout, bus: u8) -> Vec<u16> {
    let of_setup = |setup: &CyskinSetup| -> Vec<u16> {
        let hubs = setup.hubs.iter().filter(|hub| hub.bus == bus);
        let mut addresses: Vec<u32> = hubs.map(|hub| hub.address).collect();
        if !addresses.is_empty() {
            addresses.push(setup.ids.everybody());
        }
        let ids = addresses
            .into_iter()
            .flat_map(|address| setup.ids.standard_ids(address));
        ids.collect()
    };
    layout.cyskin.as_ref().map(of_setup).unwrap_or_default()
}

/// The hubs of other buses, whose address no hub of this bus has.
fn stray_hubs(layout: &Layout, bus: u8) -> impl Iterator<Item = Stray> {
    let hubs = || layout.cyskin.iter().flat_map(|setup| &setup.hubs);
    let ids = layout.cyskin.as_ref().map(|setup| setup.ids);
    let elsewhere = (0u8..).zip(hubs()).filter(move |(_, hub)| {
        let here = |other: &CyskinHub| (other.bus, other.address) == (bus, hub.address);
        hub.bus != bus && !hubs().any(here)
    });
    elsewhere.filter_map(move |(number, hub)| {
        let ids = ids.into_iter().flat_map(|ids| ids.standard_ids(hub.address));
        let of_hub = |m: &Wiring| m.hub == Some(number);
        let module = (0u16..).zip(&layout.wiring).find(|(_, m)| of_hub(m));
        module.map(|(index, wiring)| Stray {
            bus,
            protocol: wiring.protocol,
            address: hub.address,
            ids: ids.collect(),
            module: Some(index),
            there: Held::default(),
            is_settled: false,
            answered: 0,
        })
    })
}

/// The buses that could be swapped.
pub(super) fn pairs(layout: &Layout, strays: &[Stray]) -> Vec<Pair> {
    let mut pairs: Vec<Pair> = Vec::new();
    for (index, stray) in strays.iter().enumerate() {
        let Some(module) = stray.module else { continue };
        let own = layout.wiring[usize::from(module)].bus;
        let buses = [own.min(stray.bus), own.max(stray.bus)];
        match pairs.iter_mut().find(|pair| pair.buses == buses) {
            Some(pair) => pair.strays.push(index),
            None => pairs.push(Pair {
                buses,
                strays: vec![index],
            }),
        }
    }
    pairs
}
