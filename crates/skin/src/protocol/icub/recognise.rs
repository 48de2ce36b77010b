//! The iCub's boards in unknown traffic: the two halves of a triangle cannot be taken for anything else.

use super::setup::PADS;
use super::{MTB3, MTB4};
use crate::protocol::board_protocol::Protocol;
use crate::protocol::recognised::{HeardIds, IdTraffic, RecognisedBoard, RecognisedBus};
use std::collections::BTreeMap;

/// iCub boards: ids of class 4 (or 3, from obsolete commands) whose frames are the two halves of a triangle.
pub(crate) fn take_boards(heard: &mut HeardIds, bus: &mut RecognisedBus) {
    let HeardIds { ids: left, kinds } = heard;
    let mut boards: BTreeMap<u8, Vec<(u8, IdTraffic)>> = BTreeMap::new();
    let mut obsolete = false;
    left.retain(|id, heard| {
        let [first, second] = heard.triangle;
        let both = first > 0 && second > 0 && (first + second) * 20 >= heard.count * 19;
        let board = (id >> 4 & 15) as u8;
        let is_triangle = matches!(id >> 8, 3 | 4) && (1..15).contains(&board) && both;
        if is_triangle {
            boards.entry(board).or_default().push(((id & 15) as u8, *heard));
            obsolete |= id >> 8 == 3;
        }
        !is_triangle
    });
    if boards.is_empty() {
        return;
    }
    let (mtb3, mtb4) = (Protocol(&MTB3), Protocol(&MTB4));
    for (board, mut triangles) in boards {
        // A scan switches all on, and those that the skin does not have say so.
        triangles.retain(|(_, heard)| heard.not_connected < heard.triangle[1]);
        if triangles.is_empty() {
            bus.doubts
                .push(format!("board {board}: no triangle is connected to it"));
            continue;
        }
        let (protocol, or_protocol) = match kinds.get(&board) {
            Some(kind) if mtb4.is_spoken_by(*kind) => (mtb4, None),
            Some(_) => (mtb3, None),
            None => {
                bus.doubts.push(format!(
                        "board {board}: MTB3 and MTB4 send the same frames; icub-mtb3 is a guess (discovery tells which)"
                    ));
                (mtb3, Some(mtb4))
            }
        };
        let mut taxels: Vec<u8> = triangles
            .iter()
            .flat_map(|(triangle, _)| (0..PADS).map(move |pad| triangle * PADS + pad))
            .filter(|k| !matches!(k % PADS, 6 | 10))
            .collect();
        taxels.sort_unstable();
        bus.boards.push(RecognisedBoard {
            protocol,
            or_protocol,
            board,
            hub: None,
            taxels,
            rate_hz: triangles
                .first()
                .and_then(|(_, heard)| heard.rate_hz(heard.count as f64 / 2.0)),
        });
    }
    bus.doubts.push(
            "pads 6 and 10 of each triangle are taken as thermal ones; a palm has others, a fingertip none (skin_type 1)".into(),
        );
    bus.doubts.push(
            "how the boards were configured is not in their frames; taxeld configures them with the defaults of `icub` \
             (period_ms = 50, noload = 245, skin_type = 0, shift = 2, cdc_offset = 0x2200) when it starts them"
                .into(),
        );
    if obsolete {
        bus.doubts
            .push("frames of class 3 were heard: a board was configured with the obsolete commands".into());
    }
}
