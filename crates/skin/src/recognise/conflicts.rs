//! Boards that no layout can have side by side. Which of them stays is decided here, and the doubts tell of the others.

use crate::protocol::cyskin::recognise::CyskinGuess;
use crate::protocol::cyskin::setup::HubIds;
use crate::protocol::recognised::{RecognisedBoard, RecognisedBus};

/// Leaves out boards whose address a board with more taxels has, and boards beside hubs with standard ids.
pub(super) fn settle(bus: &mut RecognisedBus, cyskin: Option<&CyskinGuess>) {
    let is_hub = |b: &RecognisedBoard| b.hub.is_some();
    if cyskin.is_some_and(|guess| guess.ids == HubIds::Standard) && bus.boards.iter().any(is_hub) {
        let doubts = bus.boards.extract_if(.., |b| !is_hub(b)).map(|b| {
            format!(
                "{} is left out: hubs with standard ids use those of other boards and of commands to them; give hubs a \
                 bus of their own",
                called(&b)
            )
        });
        bus.doubts.extend(doubts);
    }
    let mut kept: Vec<RecognisedBoard> = Vec::with_capacity(bus.boards.len());
    for mut board in std::mem::take(&mut bus.boards) {
        let same = |b: &&mut RecognisedBoard| {
            (b.board, b.hub) == (board.board, board.hub) && b.protocol.has_addresses_of(board.protocol)
        };
        let Some(other) = kept.iter_mut().find(same) else {
            kept.push(board);
            continue;
        };
        if board.taxels.len() > other.taxels.len() {
            std::mem::swap(other, &mut board);
        }
        bus.doubts.push(format!(
            "{} is left out, since {} has the same address and more taxels: what is sent to one of them reaches both; \
             give one another address",
            called(&board),
            called(other)
        ));
    }
    bus.boards = kept;
}

fn called(board: &RecognisedBoard) -> String {
    format!(
        "{} {} {}",
        board.protocol.name(),
        board.protocol.board_word(),
        board.board
    )
}
