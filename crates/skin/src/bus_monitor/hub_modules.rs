//! Modules that speak on a hub of the hand and that the layout does not have there.

use super::finding::Finding;
use super::stray::Held;
use crate::layout::Layout;
use crate::protocol::cyskin::packet::{begins_with_values, modules_of_values};
use crate::protocol::cyskin::setup::HubIds;
use taxel_can::CanFrame;

/// Some of the numbers that modules have on a hub.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
struct Numbers([u64; 4]);

impl Numbers {
    fn add(&mut self, number: usize) {
        self.0[number / 64] |= 1 << (number % 64);
    }

    fn without(self, other: Self) -> Self {
        Self(std::array::from_fn(|n| self.0[n] & !other.0[n]))
    }

    fn count(self) -> u32 {
        self.0.iter().map(|bits| bits.count_ones()).sum()
    }

    fn lowest(self) -> Option<u8> {
        let (n, bits) = (0u32..).zip(self.0).find(|(_, bits)| *bits != 0)?;
        u8::try_from(64 * n + bits.trailing_zeros()).ok()
    }
}

/// The hubs of one bus.
#[derive(Debug, Clone)]
pub(super) struct HubModules {
    /// Which ids they use, and how many sensors a module has; `None` where the hand has no hubs.
    rules: Option<(HubIds, u8)>,
    hubs: Vec<OfHub>,
}

#[derive(Debug, Clone)]
struct OfHub {
    /// Its index in the layout.
    hub: u8,
    address: u32,
    of_layout: Numbers,
    /// Modules of which values came in this window.
    heard: Numbers,
    /// A number that only a damaged frame names does not come twice in a row.
    strange: Held<Numbers>,
}

impl HubModules {
    pub(super) fn new(layout: &Layout, bus: u8) -> Self {
        let setup = layout.cyskin.as_ref();
        let hubs = (0u8..).zip(setup.iter().flat_map(|setup| &setup.hubs));
        let of_bus = hubs.filter(|(_, hub)| hub.bus == bus).map(|(index, hub)| {
            let mut of_layout = Numbers::default();
            for module in layout.wiring.iter().filter(|m| m.hub == Some(index)) {
                of_layout.add(usize::from(module.board));
            }
            OfHub {
                hub: index,
                address: hub.address,
                of_layout,
                heard: Numbers::default(),
                strange: Held::default(),
            }
        });
        Self {
            hubs: of_bus.collect(),
            rules: setup.map(|setup| (setup.ids, setup.sensors_per_module)),
        }
    }

    /// How many findings there can be at most.
    pub(super) fn len(&self) -> usize {
        self.hubs.len()
    }

    /// Takes note of the modules that a frame begins values of.
    #[inline]
    pub(super) fn note(&mut self, frame: &CanFrame) {
        if self.hubs.is_empty() {
            return;
        }
        let Some((ids, sensors_per_module)) = self.rules else {
            return;
        };
        let Some((place, address)) = ids.split(frame) else {
            return;
        };
        let hub = self.hubs.iter_mut().find(|hub| hub.address == address);
        if let (Some(hub), &[_, size, module, sensor, ..]) = (hub, frame.data())
            && begins_with_values(place, frame.data())
        {
            let values = usize::from(size).saturating_sub(2) / 2;
            let modules = modules_of_values([module, sensor], values, sensors_per_module);
            modules
                .into_iter()
                .flatten()
                .for_each(|number| hub.heard.add(number));
        }
    }

    /// Ends a window: what is found in it.
    pub(super) fn end_window(&mut self) -> impl Iterator<Item = Finding> {
        self.hubs.iter_mut().filter_map(|hub| {
            let strange = std::mem::take(&mut hub.heard).without(hub.of_layout);
            let held = hub.strange.update((strange.count() > 0).then_some(strange))?;
            Some(Finding::ModulesNotInLayout {
                hub: hub.hub,
                number: held.lowest()?,
                modules: held.count() as u16,
            })
        })
    }
}
