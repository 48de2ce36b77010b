//! Boards that are in no sweep of a known skin, and in a layout: a fingertip with a few chips, or those that are mounted.

use super::fit::are_few;
use super::found::Recognition;
use crate::layout::Layout;
use crate::protocol::recognised::RecognisedBoard;

impl Recognition {
    /// Takes ids that belong to nothing recognised for those of boards of a layout. A board is there where no more of its ids are
    /// silent than [`RecognisedBoard::fit`] allows, and has the taxels that were heard. Boards that put several taxels into a
    /// frame are left to what they send.
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
                let id_of = |k: u16| wiring.protocol.can_id(wiring.board, k).map(u32::from);
                let is_heard = |k: &u8| id_of((*k).into()).is_some_and(|id| bus.others.contains(&id));
                let taxels: Vec<u8> = k
                    .iter()
                    .filter_map(|k| u8::try_from(*k).ok())
                    .filter(is_heard)
                    .collect();
                if !are_few(k.len() - taxels.len(), k.len()) {
                    continue;
                }
                let ids: Vec<u32> = k.iter().filter_map(|k| id_of(*k)).collect();
                bus.others.retain(|id| !ids.contains(id));
                bus.boards.push(RecognisedBoard {
                    protocol: wiring.protocol,
                    or_protocol: None,
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
