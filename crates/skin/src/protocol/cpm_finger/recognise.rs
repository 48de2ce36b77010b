//! The published finger in unknown traffic: all four of its ids with full frames.

use super::CpmFinger;
use super::decode::{IDS, PROXIMITY_ID};
use crate::protocol::board_protocol::Protocol;
use crate::protocol::recognised::{FEWEST, HeardIds, RecognisedBoard, RecognisedBus};

/// Takes the finger out of what was heard.
pub(crate) fn take_boards(heard: &mut HeardIds, bus: &mut RecognisedBus) {
    let left = &mut heard.ids;
    let whole = |id: &u16| left.get(id).is_some_and(|heard| heard.full >= FEWEST);
    if !IDS.iter().all(whole) {
        return;
    }
    let rate_hz = left
        .get(&IDS[0])
        .and_then(|heard| heard.rate_hz(heard.full as f64));
    for id in IDS.iter().chain([&PROXIMITY_ID]) {
        left.remove(id);
    }
    bus.boards.push(RecognisedBoard {
        protocol: Protocol(&CpmFinger),
        or_protocol: None,
        board: 0,
        hub: None,
        taxels: (0..16).collect(),
        rate_hz,
    });
}
