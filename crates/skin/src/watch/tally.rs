//! Who sent how much on one bus since a window began.

use taxel_can::CanFrame;

/// Bits of a frame beside its data, the pause after it included, without stuff bits (ISO 11898-1).
const STANDARD_BITS: u32 = 47;
const EXTENDED_BITS: u32 = 67;
/// Different extended ids that are told apart within one window; further ones are only counted to the whole.
const EXTENDED_IDS: usize = 16;

/// Frames and bits of one id.
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct OfId {
    pub(crate) frames: u32,
    pub(crate) bits: u32,
}

impl OfId {
    fn add(&mut self, bits: u32) {
        self.frames += 1;
        self.bits += bits;
    }
}

/// Constant time and memory per frame.
#[derive(Debug, Clone)]
pub(crate) struct Tally {
    pub(crate) ids: Box<[OfId; 0x800]>,
    extended: [(u32, OfId); EXTENDED_IDS],
    pub(crate) all: OfId,
}

impl Tally {
    pub(crate) fn new() -> Self {
        Self {
            ids: Box::new([OfId::default(); 0x800]),
            extended: [(0, OfId::default()); EXTENDED_IDS],
            all: OfId::default(),
        }
    }

    /// Error frames never were on the bus and do not count.
    #[inline]
    pub(crate) fn count(&mut self, frame: &CanFrame) {
        if frame.is_error() {
            return;
        }
        let data_bits = 8 * frame.data().len() as u32;
        if frame.is_extended() {
            let bits = EXTENDED_BITS + data_bits;
            self.all.add(bits);
            let id = frame.id();
            let known = self
                .extended
                .iter_mut()
                .find(|(other, of)| *other == id || of.frames == 0);
            if let Some((place, of)) = known {
                *place = id;
                of.add(bits);
            }
        } else {
            let bits = STANDARD_BITS + data_bits;
            self.all.add(bits);
            self.ids[frame.id() as usize & 0x7FF].add(bits);
        }
    }

    /// The id that took most of the bus: whether it is extended, the id, what it sent.
    pub(crate) fn loudest(&self) -> Option<(bool, u32, OfId)> {
        let standard = (0u32..).zip(self.ids.iter()).map(|(id, of)| (false, id, *of));
        let extended = self.extended.iter().map(|(id, of)| (true, *id, *of));
        let spoken = standard.chain(extended).filter(|(_, _, of)| of.frames > 0);
        spoken.max_by_key(|(_, _, of)| of.bits)
    }

    pub(crate) fn clear(&mut self) {
        self.ids.fill(OfId::default());
        self.extended.fill((0, OfId::default()));
        self.all = OfId::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_count_with_their_bits_under_their_id_and_error_frames_not_at_all() {
        let mut tally = Tally::new();
        tally.count(&CanFrame::standard(0x123, &[0; 8]).unwrap());
        tally.count(&CanFrame::standard(0x123, &[]).unwrap());
        tally.count(&CanFrame::extended(0x123, &[0; 8]).unwrap());
        tally.count(&CanFrame::error(0x123, [0; 8]));
        assert_eq!((tally.ids[0x123].frames, tally.ids[0x123].bits), (2, 111 + 47));
        assert_eq!((tally.all.frames, tally.all.bits), (3, 111 + 47 + 131));
        let (extended, id, of) = tally.loudest().unwrap();
        assert_eq!((extended, id, of.frames), (false, 0x123, 2));
    }

    #[test]
    fn more_extended_ids_than_there_is_room_for_still_count_to_the_whole() {
        let mut tally = Tally::new();
        for id in 0..100 {
            tally.count(&CanFrame::extended(id, &[]).unwrap());
        }
        assert_eq!(tally.all.frames, 100);
        tally.clear();
        assert!(tally.loudest().is_none());
    }
}
