//! A pressure array in a recording: its frames are never on a bus (docs/protocols.md, "Pressure arrays").

use crate::protocol::recognised::{FEWEST, HeardIds, RecognisedBus};
use taxel_can::ArrayHead;

/// The sizes that heads of an array have named on a bus.
#[derive(Debug, Default, Clone, Copy)]
pub(super) struct Heads {
    count: u64,
    head: Option<ArrayHead>,
    vary: bool,
}

impl Heads {
    /// Takes the data of a frame with id 0.
    pub(super) fn add(&mut self, data: &[u8]) {
        let head = ArrayHead::of_frame(data);
        let size = |head: ArrayHead| [head.rows, head.columns];
        self.vary |= head.is_none() || (self.count > 0 && head.map(size) != self.head.map(size));
        self.head = head;
        self.count += 1;
    }

    /// Takes an array out of what was heard: every head names one size, and the ids are those of its taxels and no others.
    pub(super) fn take(&self, heard: &mut HeardIds, bus: &mut RecognisedBus) {
        let Some(head) = self.head.filter(|_| !self.vary && self.count >= FEWEST) else {
            return;
        };
        let ids = 0u16..head.frames() as u16;
        if heard.ids.keys().copied().eq(ids) {
            heard.ids.clear();
            bus.array = Some([head.rows, head.columns]);
        }
    }
}
