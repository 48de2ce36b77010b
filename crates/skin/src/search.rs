//! The search for a board on the other buses of the hand.

use crate::boards::TxMode;
use crate::start::Order;
use crate::{Layout, Module};

/// Of the attempts to start a board that was never heard, every so manieth is made on the other buses too.
const EVERY: u32 = 3;

/// The buses on which a board may be by mistake, and what it is told there.
#[derive(Debug, Clone, Default)]
pub(crate) struct Search {
    /// Buses that have no board of its address.
    buses: Vec<u8>,
    /// The command to hand out, and the place in `buses` where it goes next.
    next: Option<(TxMode, Order, usize)>,
    /// Whether it was ever looked for.
    begun: bool,
}

impl Search {
    /// The search for the board of a module: on every bus without a board of its address.
    pub(crate) fn of(layout: &Layout, module: &Module) -> Self {
        let has = |bus: u8| {
            let mut others = layout.modules.iter().filter(|m| m.bus == bus);
            others.any(|m| m.board == module.board && m.protocol.has_addresses_of(module.protocol))
        };
        Self {
            buses: (0..layout.buses.len() as u8).filter(|bus| !has(*bus)).collect(),
            ..Self::default()
        }
    }

    /// An attempt to start the board was made, with this order. `tries` counts them.
    pub(crate) fn try_again(&mut self, tries: u32, order: Order) {
        if tries.is_multiple_of(EVERY) && !self.buses.is_empty() {
            self.begun = true;
            self.next = Some((TxMode::Start, order, 0));
        }
    }

    /// The board is stopped with this order: where it was looked for too.
    pub(crate) fn stop(&mut self, order: Order) {
        if self.begun {
            self.next = Some((TxMode::Stop, order, 0));
        }
    }

    /// Forgets what was to be sent.
    pub(crate) fn give_up(&mut self) {
        self.next = None;
    }

    pub(crate) fn is_over(&self) -> bool {
        self.next.is_none()
    }

    /// When the next command may be handed out, given when each bus is free.
    pub(crate) fn at_ns(&self, bus_free_ns: &[u64]) -> Option<u64> {
        let (_, _, place) = self.next?;
        Some(bus_free_ns[usize::from(self.buses[place])])
    }

    /// The bus and the command to hand out now.
    pub(crate) fn take(&mut self) -> Option<(u8, TxMode, Order)> {
        let (mode, order, place) = self.next?;
        self.next = (place + 1 < self.buses.len()).then_some((mode, order, place + 1));
        Some((self.buses[place], mode, order))
    }
}
