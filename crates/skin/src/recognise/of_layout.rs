//! Boards that are in no sweep of a known skin, and in a layout: a fingertip with a few chips, or those that are mounted.

use super::found::Recognition;
use crate::layout::Layout;
use crate::protocol::recognised::RecognisedBoard;

impl Recognition {
    /// Takes ids that belong to nothing recognised for those of boards of a layout. A board is there where half of its ids are,
    /// and then has the taxels that the layout gives it. Boards that put several taxels into a frame are left to what they
    /// send.
    pub fn take_boards_of(&mut self, layout: &Layout) {
        for bus in &mut self.buses {
            let known = bus.boards.len();
            for (_, module, wiring) in layout.boards() {
                let is_there = |board: &RecognisedBoard| {
                    (board.protocol, board.board) == (wiring.protocol, wiring.board)
                };
                if bus.boards.iter().any(is_there) {
                    continue;
                }
                let k = layout.k_of(module);
                let ids: Vec<u32> = k
                    .iter()
                    .filter_map(|k| wiring.protocol.can_id(wiring.board, *k))
                    .map(u32::from)
                    .collect();
                let taxels: Vec<u8> = k.iter().filter_map(|k| u8::try_from(*k).ok()).collect();
                let heard = ids.iter().filter(|id| bus.others.contains(id)).count();
                if heard == 0 || 2 * heard < ids.len() || (ids.len(), taxels.len()) != (k.len(), k.len()) {
                    continue;
                }
                bus.others.retain(|id| !ids.contains(id));
                bus.boards.push(RecognisedBoard {
                    protocol: wiring.protocol,
                    board: wiring.board,
                    hub: None,
                    taxels,
                    rate_hz: None,
                });
            }
            if bus.boards.len() > known {
                bus.boards
                    .sort_by_key(|board| (board.protocol.name(), board.board, board.hub));
            }
        }
    }
}
