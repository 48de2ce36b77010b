//! What a program publishes: a table of outputs, filled and emptied by the serving thread, worked
//! through by the thread that has the frames.
//!
//! An output is frames in, bytes out ([`Encode`]), with the stream its messages go to and a record
//! of what they cost. It is built on the serving thread with all its memory, sent over, and sent
//! back to be dropped, so that the thread that has the frames neither allocates nor frees.

use crate::delivery::stream::Publisher;
use hdrhistogram::Histogram;
use std::cell::RefCell;
use std::sync::atomic::{
    AtomicU64,
    Ordering::{Acquire, Release},
};
use std::sync::{Arc, Mutex, mpsc};
use std::time::Instant;
use taxel_wire::Encode;

/// Time that an output's messages took on the thread that made them, nanoseconds. That thread only
/// ever tries to lock it.
pub(crate) type CostPerTick = Arc<Mutex<Histogram<u64>>>;

/// A record of costs up to 1 s, at two significant digits.
pub(crate) fn cost_per_tick() -> CostPerTick {
    let histogram = Histogram::new_with_bounds(1, 1_000_000_000, 2).expect("bounds of a histogram");
    Arc::new(Mutex::new(histogram))
}

/// One output at work.
pub(crate) struct Output<F> {
    pub(crate) encoder: Box<dyn Encode<F> + Send>,
    pub(crate) publisher: Publisher,
    pub(crate) cost_ns: CostPerTick,
}

/// What the serving thread asks of the table.
enum Change<F> {
    Insert(usize, Box<Output<F>>),
    Remove(usize),
}

/// The table, on the thread that has the frames. After it was made, no method allocates, frees or waits.
pub struct OutputSlots<F> {
    slots: Box<[Option<Box<Output<F>>>]>,
    changes: mpsc::Receiver<Change<F>>,
    /// Where outputs go that were taken out. It holds as many as there are slots, and a slot is
    /// filled again only after its output has arrived, so there is always room.
    returned: mpsc::SyncSender<(usize, Box<Output<F>>)>,
    /// Messages that outputs no longer there could not hand over.
    unpublished: u64,
    /// The last tick of which every output's message was handed over.
    newest_tick: Arc<AtomicU64>,
}

/// The serving thread's hold on the table.
pub(crate) struct SlotControl<F> {
    free: RefCell<Vec<usize>>,
    changes: mpsc::SyncSender<Change<F>>,
    returned: mpsc::Receiver<(usize, Box<Output<F>>)>,
    newest_tick: Arc<AtomicU64>,
    /// Has the other thread look at the table soon.
    wake: Box<dyn Fn() + Send>,
}

/// An empty table of N slots and the hold on it. `wake` is called from the serving thread after each change.
pub(crate) fn output_slots<F>(slots: usize, wake: Box<dyn Fn() + Send>) -> (OutputSlots<F>, SlotControl<F>) {
    let (returned, receiver) = mpsc::sync_channel(slots);
    // Each slot can be filled and emptied before the other thread looks.
    let (sender, changes) = mpsc::sync_channel(2 * slots);
    let newest_tick = Arc::new(AtomicU64::new(0));
    let table = OutputSlots {
        slots: (0..slots).map(|_| None).collect(),
        changes,
        returned,
        unpublished: 0,
        newest_tick: newest_tick.clone(),
    };
    let control = SlotControl {
        free: RefCell::new((0..slots).rev().collect()),
        changes: sender,
        returned: receiver,
        newest_tick,
        wake,
    };
    (table, control)
}

impl<F> OutputSlots<F> {
    /// Puts outputs in and takes them out, as the serving thread has asked meanwhile.
    pub fn handle_changes(&mut self) {
        while let Ok(change) = self.changes.try_recv() {
            match change {
                Change::Insert(slot, output) => {
                    debug_assert!(self.slots[slot].is_none(), "slot {slot} is taken");
                    self.slots[slot] = Some(output);
                }
                Change::Remove(slot) => {
                    if let Some(output) = self.slots[slot].take() {
                        self.unpublished += output.publisher.unpublished();
                        // Refused only when the serving thread is gone, and the program with it.
                        let _ = self.returned.try_send((slot, output));
                    }
                }
            }
        }
    }

    /// Makes, encodes and hands over every output's message of a tick that was due at `due`, each
    /// before the next is begun.
    pub fn publish(&mut self, tick: u64, due: Instant, frames: &F) {
        let mut before = Instant::now();
        for output in self.slots.iter_mut().flatten() {
            let Output {
                encoder,
                publisher,
                cost_ns,
            } = &mut **output;
            publisher.publish(tick, due, |payload| encoder.encode(frames, payload));
            let now = Instant::now();
            // A status report being written at this moment loses one sample of many.
            if let Ok(mut cost_ns) = cost_ns.try_lock() {
                let ns = now.duration_since(before).as_nanos() as u64;
                cost_ns.saturating_record(ns.max(1));
            }
            before = now;
        }
        self.newest_tick.store(tick, Release);
    }

    /// Messages that could not be handed over since the start. Only ever grows.
    pub fn unpublished(&self) -> u64 {
        let outputs = self.slots.iter().flatten();
        self.unpublished + outputs.map(|output| output.publisher.unpublished()).sum::<u64>()
    }
}

/// Why an output is not made.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum SlotError {
    #[error("profiles change too fast; ask again in a second")]
    NoneFree,
    #[error("the daemon is busy with other commands; try again")]
    Busy,
    #[error("the daemon is stopping")]
    Stopping,
}

impl<F> SlotControl<F> {
    /// Has an output made from the next tick on, and returns the number of its slot.
    pub(crate) fn insert(&self, output: Box<Output<F>>) -> Result<usize, SlotError> {
        self.take_back();
        let slot = self.free.borrow_mut().pop().ok_or(SlotError::NoneFree)?;
        match self.change(Change::Insert(slot, output)) {
            Ok(()) => Ok(slot),
            Err(error) => {
                self.free.borrow_mut().push(slot);
                Err(error)
            }
        }
    }

    /// Has an output made no longer.
    pub(crate) fn remove(&self, slot: usize) -> Result<(), SlotError> {
        self.change(Change::Remove(slot))
    }

    /// The last tick that was published, of whichever outputs there were; 0 before the first. While one is being
    /// published it is the one before.
    pub(crate) fn newest_tick(&self) -> u64 {
        self.newest_tick.load(Acquire)
    }

    /// Frees what came back.
    pub(crate) fn take_back(&self) {
        while let Ok((slot, output)) = self.returned.try_recv() {
            drop(output);
            self.free.borrow_mut().push(slot);
        }
    }

    fn change(&self, change: Change<F>) -> Result<(), SlotError> {
        self.changes.try_send(change).map_err(|error| match error {
            mpsc::TrySendError::Full(_) => SlotError::Busy,
            mpsc::TrySendError::Disconnected(_) => SlotError::Stopping,
        })?;
        (self.wake)();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::delivery::stream::stream;
    use taxel_wire::{EncodeError, Header, Kind};

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

    /// Encodes small numbers alone.
    struct Small;

    impl Encode<u8> for Small {
        fn encode(&mut self, of: &u8, payload: &mut Vec<u8>) -> Result<Header, EncodeError> {
            payload.clear();
            payload.push(*of);
            match *of {
                0..10 => Ok(Header::new(Kind::Image, 1)),
                _ => Err(EncodeError::TooLong { len: 1 }),
            }
        }
    }

    fn small() -> (Box<Output<u8>>, crate::delivery::stream::Stream) {
        let (publisher, stream) = stream(1, 1.0);
        let output = Output {
            encoder: Box::new(Small),
            publisher,
            cost_ns: cost_per_tick(),
        };
        (Box::new(output), stream.open())
    }

    #[test]
    fn what_was_not_handed_over_is_still_counted_when_the_output_is_gone() {
        let (mut table, control) = output_slots::<u8>(2, Box::new(|| {}));
        let (output, stream) = small();
        let slot = control.insert(output).unwrap();
        table.handle_changes();
        table.publish(1, Instant::now(), &3);
        assert_eq!(stream.newest.borrow().payload, [3]);
        table.publish(2, Instant::now(), &30);
        assert_eq!((stream.newest.borrow().tick, table.unpublished()), (1, 1));
        control.remove(slot).unwrap();
        table.handle_changes();
        assert_eq!(table.unpublished(), 1);
    }

    #[test]
    fn a_slot_is_filled_again_only_after_its_output_came_back() {
        let (mut table, control) = output_slots::<u8>(1, Box::new(|| {}));
        let slot = control.insert(small().0).unwrap();
        assert_eq!(control.insert(small().0), Err(SlotError::NoneFree));
        table.handle_changes();
        control.remove(slot).unwrap();
        assert_eq!(control.insert(small().0), Err(SlotError::NoneFree));
        table.handle_changes();
        control.insert(small().0).unwrap();
        drop(table);
        assert_eq!(control.remove(slot), Err(SlotError::Stopping));
    }
}
