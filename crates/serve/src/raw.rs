//! Raw frames, made while somebody reads them.

use crate::delivery::stream::{OverTicks, Stream, stream};
use crate::profiles::output_slots::{Output, SlotControl, cost_per_tick};
use crate::profiles::profile_maker::ProfileMaker;
use std::cell::RefCell;
use std::rc::Rc;

/// The stream of raw frames. One slot of the table, empty while there are no readers.
#[derive(Debug, Default)]
pub(crate) struct RawStream(RefCell<Option<Made>>);

#[derive(Debug)]
struct Made {
    slot: usize,
    stream: Rc<Stream>,
}

impl RawStream {
    /// The stream, made from the next tick on if it is not yet. The error is fit for an EVENT.
    pub(crate) fn open<M: ProfileMaker>(
        &self,
        maker: &M,
        slots: &SlotControl<M::Frames>,
    ) -> Result<Rc<Stream>, String> {
        if let Some(made) = &*self.0.borrow() {
            return Ok(made.stream.clone());
        }
        let (encoder, payload_len) = maker.raw().ok_or("no raw frames are made here")?;
        let (publisher, stream) = stream(payload_len, maker.rate_hz());
        let output = Output {
            encoder,
            publisher,
            cost_ns: cost_per_tick(),
        };
        let slot = slots.insert(Box::new(output)).map_err(|e| e.to_string())?;
        let stream = Rc::new(stream.open());
        *self.0.borrow_mut() = Some(Made {
            slot,
            stream: stream.clone(),
        });
        Ok(stream)
    }

    /// [`OverTicks`] of the frames, where any are made.
    pub(crate) fn over_ticks(&self) -> Option<OverTicks> {
        self.0.borrow().as_ref().map(|made| OverTicks::of(&made.stream))
    }

    /// Has no more raw frames made where nobody reads them.
    pub(crate) fn tidy<F>(&self, slots: &SlotControl<F>) {
        let mut made = self.0.borrow_mut();
        let unread = |made: &&Made| Rc::strong_count(&made.stream) == 1;
        // Kept where the table cannot be changed now, and tried again.
        if made
            .as_ref()
            .filter(unread)
            .is_some_and(|made| slots.remove(made.slot).is_ok())
        {
            *made = None;
        }
    }
}
