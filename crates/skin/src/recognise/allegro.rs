//! An Allegro hand on a bus of which nothing is known: it is no skin, and its ids are no strangers'.

use crate::protocol::recognised::{FEWEST, HeardIds, RecognisedBus};

/// The position frames of all four fingers (docs/protocols.md, "Allegro hand").
pub(super) fn take(heard: &mut HeardIds, bus: &mut RecognisedBus) {
    let left = &mut heard.ids;
    // The destination in bits 3 to 5 is documented nowhere.
    let v3 = |id: u16| (id >> 6 == 0x0F && matches!(id & 7, 3..=6)).then(|| usize::from(id & 7) - 3);
    let v4 = |id: u16| (id >> 4 == 0x08).then_some(usize::from(id >> 2 & 3));
    let mut take = |version: u8, finger_of: &dyn Fn(u16) -> Option<usize>| {
        let mut fingers = [false; 4];
        for (id, heard) in left.iter() {
            if let Some(finger) = finger_of(*id) {
                fingers[finger] |= heard.full >= FEWEST && heard.full == heard.count;
            }
        }
        if fingers == [true; 4] {
            left.retain(|id, _| finger_of(*id).is_none());
            bus.allegro = Some(version);
            // What the hand's controller and the hand say beside.
            if version == 4 {
                left.retain(|id, _| !matches!(id >> 2, 0x30 | 0x38..=0x3B | 0x40 | 0x41 | 0x60..=0x63 | 0x68 | 0x80 | 0x81 | 0x88 | 0xE0..=0xE3));
                // Version 5 beside: grasps, calibration, errors, pressure of fingertips and palm.
                left.retain(|id, _| {
                    !matches!(
                        id >> 2,
                        0x11 | 0x12 | 0x50 | 0x52 | 0x54..=0x57 | 0x89 | 0x92 | 0xEE | 0xF0 | 0xF2
                    )
                });
            } else {
                left.retain(|id, _| !(id & 7 == 2 && (0x01..=0x15).contains(&(id >> 6))));
            }
        }
    };
    take(3, &v3);
    take(4, &v4);
}
