//! Boards that may be on another bus of the hand than the layout says, and the search for them.

use crate::layout::{Layout, Wiring};
use crate::protocol::commands::{BoardCommand, TxMode};

/// Of the attempts to start a board that was never heard, every third is made on the other buses too.
const EVERY: u32 = 3;

/// The buses on which a board may be by mistake, and what it is told there.
#[derive(Debug, Clone, Default)]
pub(crate) struct Search {
    /// Buses that have no board of its address.
    buses: BusSet,
    /// Buses on which it was looked for.
    asked: BusSet,
    /// Where the command has still to go.
    pending: BusSet,
    command: Option<(TxMode, BoardCommand)>,
    /// Whether it is asked for only: nothing else is sent to a bus on which it does not belong.
    asks_only: bool,
}

/// Some of the first 64 buses.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub(crate) struct BusSet(u64);

impl BusSet {
    pub(crate) fn set(&mut self, bus: u8, there: bool) {
        let bit = 1u64.checked_shl(bus.into()).unwrap_or(0);
        self.0 = if there { self.0 | bit } else { self.0 & !bit };
    }

    fn first(self) -> Option<u8> {
        (self.0 != 0).then(|| self.0.trailing_zeros() as u8)
    }
}

impl Search {
    /// The search for a board or hub: on every bus without one of its address, but those of pressure arrays,
    /// which are no buses that a board could be on. Where `asks_only`, it is asked there whether it is there, and
    /// never configured or started.
    pub(crate) fn new(layout: &Layout, board: &Wiring, asks_only: bool) -> Self {
        let mut search = Self {
            asks_only,
            ..Self::default()
        };
        for bus in 0..layout.buses.len() as u8 {
            let may_be_there = layout.array_on(bus.into()).is_none() && !layout.has_address_of(board, bus);
            search.buses.set(bus, may_be_there);
        }
        search
    }

    /// An attempt to start the board was made, with this command. `tries` counts them.
    pub(crate) fn try_again(&mut self, tries: u32, command: BoardCommand, allowed: BusSet) {
        if tries.is_multiple_of(EVERY) && (command.is_question() || !self.asks_only) {
            self.pending = BusSet(self.buses.0 & allowed.0);
            self.asked.0 |= self.pending.0;
            self.command = Some((TxMode::Start, command));
        }
    }

    /// The board is stopped with this command: where it was looked for too.
    pub(crate) fn stop(&mut self, command: BoardCommand) {
        if self.asks_only {
            return;
        }
        self.pending = self.asked;
        self.command = Some((TxMode::Stop, command));
    }

    /// Forgets what was to be sent.
    pub(crate) fn give_up(&mut self) {
        self.pending = BusSet::default();
    }

    pub(crate) fn is_over(&self) -> bool {
        self.pending == BusSet::default()
    }

    /// When the next command may be handed out, given when each bus is free.
    pub(crate) fn at_ns(&self, bus_free_ns: &[u64]) -> Option<u64> {
        bus_free_ns.get(usize::from(self.pending.first()?)).copied()
    }

    /// The bus and the command to hand out now.
    pub(crate) fn take(&mut self) -> Option<(u8, TxMode, BoardCommand)> {
        let (mode, command) = self.command?;
        let bus = self.pending.first()?;
        self.pending.set(bus, false);
        Some((bus, mode, command))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_board_is_looked_for_on_every_bus_without_its_address_that_is_no_pressure_arrays() {
        let text = "name = \"t\"\nbuses = [\"a\", \"mat\", \"b\", \"c\"]\nimage = { width = 9, height = 8 }\n\
            [[module]]\nname = \"m\"\npart = \"p\"\nbus = \"mat\"\nprotocol = \"pressure-array\"\nrows = 3\n\
            columns = 5\nat = [4, 0]\n";
        let board = |bus: &str, address: u8, at: u8| {
            format!(
                "[[module]]\nname = \"{bus}{address}\"\npart = \"q\"\nbus = \"{bus}\"\nboard = {address}\n\
                 protocol = \"uskin-l2\"\nat = [{}, {}]\n",
                at % 2 * 4,
                at / 2 * 4
            )
        };
        let text = text.to_owned() + &board("a", 1, 0) + &board("b", 1, 2) + &board("c", 2, 3);
        let layout = Layout::parse(&text, "t.toml").unwrap_or_else(|e| panic!("{e}"));
        let buses = |module: usize| {
            let search = Search::new(&layout, &layout.wiring[module], false);
            (0..4u8)
                .filter(|bus| search.buses.0 & 1 << bus != 0)
                .collect::<Vec<_>>()
        };
        assert_eq!((buses(1), buses(3)), (vec![3], vec![0, 2]));
    }
}
