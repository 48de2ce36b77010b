//! The displays that the tick thread compresses for: a table of fixed size, filled and emptied from elsewhere.

use crate::display::Display;
use crate::hub::Publisher;
use crate::pipeline::Frames;
use hdrhistogram::Histogram;
use std::sync::{Arc, Mutex, mpsc};
use taxel_can::monotonic_ns;

/// One display profile at work: made on the socket thread, used on the tick thread, and given back to be dropped.
#[derive(Debug)]
pub(crate) struct Stream {
    pub(crate) display: Display,
    pub(crate) publisher: Publisher,
    pub(crate) cost_ns: CostPerTick,
}

/// Time that a stream's images took on the tick thread, nanoseconds. The tick thread only ever tries to lock it.
pub(crate) type CostPerTick = Arc<Mutex<Histogram<u64>>>;

/// A record of costs up to 1 s, at two significant digits.
pub(crate) fn cost_per_tick() -> CostPerTick {
    let histogram = Histogram::new_with_bounds(1, 1_000_000_000, 2).expect("bounds of a histogram");
    Arc::new(Mutex::new(histogram))
}

/// The table. No method allocates or frees.
#[derive(Debug)]
pub(crate) struct Displays {
    slots: Box<[Option<Box<Stream>>]>,
    /// Where streams go that were taken out. It holds as many as there are slots, and a slot is filled again only
    /// after its stream has arrived, so there is always room.
    returned: mpsc::SyncSender<(usize, Box<Stream>)>,
}

/// What comes back from the table.
pub(crate) type Returned = mpsc::Receiver<(usize, Box<Stream>)>;

impl Displays {
    /// An empty table of so many slots.
    pub(crate) fn new(slots: usize) -> (Self, Returned) {
        let (returned, receiver) = mpsc::sync_channel(slots);
        let slots = (0..slots).map(|_| None).collect();
        (Self { slots, returned }, receiver)
    }

    /// Makes, encodes and hands over every display's image of a tick, each before the next is begun.
    pub(crate) fn publish(&mut self, tick: u64, frames: &Frames) {
        let mut before_ns = monotonic_ns();
        for stream in self.slots.iter_mut().flatten() {
            let Stream {
                display,
                publisher,
                cost_ns,
            } = &mut **stream;
            publisher.publish(tick, |payload| display.encode(frames, payload));
            let now_ns = monotonic_ns();
            // A status report being written at this moment loses one sample of many.
            if let Ok(mut cost_ns) = cost_ns.try_lock() {
                cost_ns.saturating_record(now_ns.saturating_sub(before_ns).max(1));
            }
            before_ns = now_ns;
        }
    }

    /// Puts a stream into an empty slot.
    pub(crate) fn insert(&mut self, slot: usize, stream: Box<Stream>) {
        debug_assert!(self.slots[slot].is_none(), "slot {slot} is taken");
        self.slots[slot] = Some(stream);
    }

    /// Takes a stream out and gives it back.
    pub(crate) fn remove(&mut self, slot: usize) {
        if let Some(stream) = self.slots[slot].take() {
            // Refused only when the socket thread is gone, and the daemon with it.
            let _ = self.returned.try_send((slot, stream));
        }
    }

    /// Images that could not be handed over.
    pub(crate) fn unpublished(&self) -> u64 {
        let streams = self.slots.iter().flatten();
        streams.map(|stream| stream.publisher.unpublished()).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cost_that_never_changes_is_still_told_after_years() {
        let cost_ns = cost_per_tick();
        let mut cost_ns = cost_ns.lock().unwrap();
        // At 1 kHz, what 32 bits count is over in fifty days.
        for _ in 0..2 {
            cost_ns.record_n(10_000, u32::MAX.into()).unwrap();
        }
        for quantile in [0.5, 0.99] {
            assert!(cost_ns.value_at_quantile(quantile).abs_diff(10_000) < 100);
        }
    }
}
