//! Which boards that were heard fit a layout: the one rule for a board, and for all of a hand where they are wired.

use super::found::Recognition;
use crate::layout::Layout;
use crate::protocol::recognised::{RecognisedBoard, RecognisedBus};

/// A board that was heard, as that of a module of a layout.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fit {
    /// The module's taxels of which nothing was heard, by their numbers.
    pub silent: Vec<u16>,
    /// How many taxels the board sends that the module does not have. Nobody reads them.
    pub unread: usize,
}

impl RecognisedBoard {
    /// How this board fits a module of a layout, wherever it is wired. It does where it is a board of the same kind, and at most
    /// a quarter of the module's taxels is silent, or one of several; what it sends beyond them is no hindrance. A taxel is
    /// silent where no frame was heard that carries it.
    pub fn fit(&self, layout: &Layout, module: usize) -> Option<Fit> {
        let wiring = layout.wiring.get(module)?;
        let taxels = layout.k_of(&layout.modules[module]);
        let [own, other] = [self.protocol, wiring.protocol].map(|protocol| protocol.0.properties());
        let is_same_kind = own.keys == other.keys && own.measures == other.measures;
        let is_heard = |k: u16| {
            let frame = self.protocol.frame_id(self.board, k);
            let mut sent = self.taxels.iter().copied().map(u16::from);
            sent.any(|own| own == k || frame.is_some() && self.protocol.frame_id(self.board, own) == frame)
        };
        let silent: Vec<u16> = taxels.iter().copied().filter(|k| !is_heard(*k)).collect();
        let (kind, icub) = (self.protocol.0, wiring.icub.as_ref());
        let is_read = |k: u16| taxels.contains(&k) || kind.may_be_temperature(k, icub);
        let unread = self.taxels.iter().filter(|k| !is_read(u16::from(**k))).count();
        let fits = is_same_kind && are_few(silent.len(), taxels.len());
        fits.then_some(Fit { silent, unread })
    }

    /// Whether this is where the board of a module is wired, on whichever bus, and speaks as the layout says.
    pub fn is_at(&self, layout: &Layout, module: usize) -> bool {
        let Some(wiring) = layout.wiring.get(module) else {
            return false;
        };
        let hub = wiring.hub.zip(layout.cyskin.as_ref());
        let hub = hub.map(|(hub, setup)| setup.hubs[usize::from(hub)].address);
        let speaks_so = [Some(self.protocol), self.or_protocol].contains(&Some(wiring.protocol));
        (self.board, self.hub) == (wiring.board, hub) && speaks_so
    }
}

/// Whether so many silent taxels make no other board of one with so many.
pub(super) fn are_few(silent: usize, taxels: usize) -> bool {
    silent < taxels.max(1) && silent <= (taxels / 4).max(1)
}

impl Recognition {
    /// For each bus of a layout the bus that was heard on which each of its boards is, where there is one: boards that fit, at
    /// their addresses. Others may be there, too. `names` are those of the buses that were heard: one of the same name comes
    /// first, then one with as few others as can be.
    pub fn wired_as(&self, layout: &Layout, names: &[String]) -> Option<Vec<usize>> {
        let mut buses = Vec::new();
        self.wire(layout, names, &mut buses).then_some(buses)
    }

    /// The board that a module of a layout has on buses that are [wired as](Self::wired_as) its buses, by its place among
    /// [`Self::boards`].
    pub fn board_of(&self, layout: &Layout, module: usize, buses: &[usize]) -> Option<usize> {
        let bus = *buses.get(usize::from(layout.wiring.get(module)?.bus))?;
        let before: usize = self.buses[..bus].iter().map(|bus| bus.boards.len()).sum();
        let at = self.buses[bus]
            .boards
            .iter()
            .position(|board| board.is_at(layout, module))?;
        Some(before + at)
    }

    /// The boards that were recognised, in the order in which their modules are in the file.
    pub fn boards(&self) -> impl Iterator<Item = &RecognisedBoard> {
        self.buses.iter().flat_map(|bus| &bus.boards)
    }

    fn wire(&self, layout: &Layout, names: &[String], buses: &mut Vec<usize>) -> bool {
        let bus = buses.len();
        let Some(name) = layout.buses.get(bus) else {
            return bus > 0;
        };
        let free = (0..self.buses.len()).filter(|heard| !buses.contains(heard));
        let mut free: Vec<usize> = free
            .filter(|heard| self.buses[*heard].has_boards_of(layout, bus))
            .collect();
        free.sort_by_key(|heard| (names.get(*heard) != Some(name), self.buses[*heard].boards.len()));
        free.into_iter().any(|heard| {
            buses.push(heard);
            let is_wired = self.wire(layout, names, buses);
            if !is_wired {
                buses.pop();
            }
            is_wired
        })
    }
}

impl RecognisedBus {
    /// Whether each board that a layout has on a bus is here.
    fn has_boards_of(&self, layout: &Layout, bus: usize) -> bool {
        let mut of_bus =
            (0..layout.wiring.len()).filter(|module| usize::from(layout.wiring[*module].bus) == bus);
        of_bus.all(|module| {
            let is_its =
                |board: &RecognisedBoard| board.is_at(layout, module) && board.fit(layout, module).is_some();
            self.boards.iter().any(is_its)
        })
    }
}
