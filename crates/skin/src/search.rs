//! The search for a board on the other buses of the hand.

use crate::boards::TxMode;
use crate::start::Order;
use crate::{CyskinSetup, Layout, Wiring};

/// Of the attempts to start a board that was never heard, every so manieth is made on the other buses too.
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
    command: Option<(TxMode, Order)>,
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
    /// The search for a board: on every bus without a board of its address.
    pub(crate) fn of(layout: &Layout, board: &Wiring) -> Self {
        let has = |bus: u8| {
            let mut others = layout.wiring.iter().filter(|other| other.bus == bus);
            others.any(|other| other.board == board.board && other.protocol.has_addresses_of(board.protocol))
        };
        let mut search = Self::default();
        for bus in 0..layout.buses.len() as u8 {
            search.buses.set(bus, !has(bus));
        }
        search
    }

    /// The search for an iCub board: the same, but it is asked whether it is there and never configured or started.
    pub(crate) fn by_question(layout: &Layout, board: &Wiring) -> Self {
        Self {
            asks_only: true,
            ..Self::of(layout, board)
        }
    }

    /// The search for a CySkin hub: on every bus without a hub of its address.
    pub(crate) fn of_hub(setup: &CyskinSetup, address: u32, buses: u8) -> Self {
        let mut search = Self::default();
        for bus in 0..buses {
            let has = setup
                .hubs
                .iter()
                .any(|hub| (hub.bus, hub.address) == (bus, address));
            search.buses.set(bus, !has);
        }
        search
    }

    /// An attempt to start the board was made, with this order. `tries` counts them.
    pub(crate) fn try_again(&mut self, tries: u32, order: Order, allowed: BusSet) {
        if tries.is_multiple_of(EVERY) && (order.is_question() || !self.asks_only) {
            self.pending = BusSet(self.buses.0 & allowed.0);
            self.asked.0 |= self.pending.0;
            self.command = Some((TxMode::Start, order));
        }
    }

    /// The board is stopped with this order: where it was looked for too.
    pub(crate) fn stop(&mut self, order: Order) {
        if self.asks_only {
            return;
        }
        self.pending = self.asked;
        self.command = Some((TxMode::Stop, order));
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
    pub(crate) fn take(&mut self) -> Option<(u8, TxMode, Order)> {
        let (mode, order) = self.command?;
        let bus = self.pending.first()?;
        self.pending.set(bus, false);
        Some((bus, mode, order))
    }
}
