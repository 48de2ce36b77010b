//! One bus as its traffic shows it.

use super::finding::BusLoad;
use super::hub_modules::HubModules;
use super::stray::{Held, NOBODY};
use super::tally::{FOREIGN_HUBS, Tally};
use crate::layout::Layout;
use crate::protocol::mtb::BoardKind;

/// Length of a window.
pub(super) const WINDOW_NS: u64 = 250_000_000;
/// How long a bus is another's on which a node of none spoke. Rare speakers are on it all the while; somebody who sent a
/// frame by hand is not.
pub(super) const STRANGER_NS: u64 = 600_000_000_000;
/// What a bus carries, bits per second: every public hand runs at this rate (docs/protocols.md,
/// "Bus timing").
const BIT_RATE: f64 = 1e6;
/// This many packets of values in a window make a hub of what is not the hand's; hubs send twenty
/// in a second.
const FOREIGN_PACKETS: u32 = 2;

#[derive(Debug, Clone)]
pub(super) struct Bus {
    pub(super) tally: Tally,
    /// Module of each standard id, `u16::MAX` for none.
    pub(super) owners: Box<[u16; 0x800]>,
    /// Whether each standard id is a module's, a stray's, or a command.
    pub(super) familiar: Box<[bool; 0x800]>,
    /// When a node that is nothing like the hand's spoke last, by the newest frame of that window.
    pub(super) stranger_ns: Option<u64>,
    pub(super) load: BusLoad,
    pub(super) babbles: Held<(bool, u32)>,
    /// What each address answered to be in this window.
    pub(super) answers: [Option<BoardKind>; 16],
    /// Hubs whose address no hub of the hand has.
    pub(super) foreign_hubs: Vec<ForeignHub>,
    /// What speaks on hubs of the hand.
    pub(super) hub_modules: HubModules,
    /// Whether it is the socket of a pressure array, which no frame keeps another from and whose rate is its program's.
    pub(super) is_array: bool,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct ForeignHub {
    pub(super) address: u32,
    pub(super) speaks: Held<()>,
}

impl Bus {
    pub(super) fn new(layout: &Layout, bus: u8) -> Self {
        let mut familiar = Box::new(std::array::from_fn(|id| matches!(id >> 4, 0x20 | 0x70)));
        let hub_ids = layout.cyskin.as_ref().map(|setup| setup.ids);
        let addresses = || {
            layout
                .cyskin
                .iter()
                .flat_map(|setup| setup.hubs.iter().map(|hub| hub.address))
        };
        if let Some(ids) = hub_ids {
            // What all hubs are told, and what any of them says.
            for id in addresses()
                .chain([ids.everybody()])
                .flat_map(|to| ids.standard_ids(to))
            {
                familiar[usize::from(id)] = true;
            }
        }
        Self {
            tally: Tally::new(hub_ids, addresses()),
            owners: Box::new([NOBODY; 0x800]),
            familiar,
            stranger_ns: None,
            load: BusLoad::default(),
            babbles: Held::default(),
            answers: [None; 16],
            foreign_hubs: Vec::with_capacity(FOREIGN_HUBS),
            hub_modules: HubModules::new(layout, bus),
            is_array: layout.array_on(bus.into()).is_some(),
        }
    }

    /// A hub of no layout speaks if most of what begins a packet under its address begins one of
    /// values: other nodes with extended ids do so by chance only.
    pub(super) fn find_foreign_hubs(&mut self) {
        for heard in self.tally.foreign_hubs() {
            let known = self.foreign_hubs.iter().any(|hub| hub.address == heard.address);
            if !known && heard.packets > 0 && self.foreign_hubs.len() < FOREIGN_HUBS {
                self.foreign_hubs.push(ForeignHub {
                    address: heard.address,
                    speaks: Held::default(),
                });
            }
        }
        let tally = &self.tally;
        self.foreign_hubs.retain_mut(|hub| {
            let mut heard = tally.foreign_hubs().filter(|of| of.address == hub.address);
            let speaks = heard.any(|of| of.packets >= FOREIGN_PACKETS && 2 * of.packets > of.begun);
            hub.speaks.update(speaks.then_some(()));
            hub.speaks.is.is_some() || hub.speaks.next.is_some()
        });
    }
}

/// Frames per second and share of a bus, of what came in a window.
pub(super) fn figures(frames: u32, bits: u32) -> (f64, f64) {
    (
        per_second(f64::from(frames)),
        per_second(f64::from(bits)) / BIT_RATE,
    )
}

/// A count of a window as a rate.
pub(super) fn per_second(count: f64) -> f64 {
    count * 1e9 / WINDOW_NS as f64
}
