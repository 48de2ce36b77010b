//! Which of the three uSkin id layouts explains the ids of a bus best, and which boards there are under it.

use super::{L1, L2, L3, Uskin};
use crate::protocol::board_protocol::Protocol;
use crate::protocol::recognised::{FEWEST, HeardIds, IdTraffic, RecognisedBoard, RecognisedBus};
use std::collections::BTreeMap;

const LAYOUTS: [&Uskin; 3] = [&L2, &L1, &L3];
/// Byte 7 must be `sda + 1` for this share of the ids to speak for a layout.
const MATCHES: f64 = 0.9;
/// What byte 7 is worth against how well the ids fit.
const WORTH: f64 = 1.3;
/// A layout that explains the ids this well compared with the best one is named as possible.
const NEARLY: f64 = 0.9;

/// A reading of the bus's ids under one layout.
struct Reading {
    uskin: &'static Uskin,
    /// The boards that are whole, with their ids by taxel number.
    boards: BTreeMap<u8, BTreeMap<u8, u16>>,
    /// How many ids are in whole boards, less for those that are not quite whole.
    fit: f64,
    /// Whether byte 7 is `sda + 1` under this layout, and not the same everywhere.
    last_byte: bool,
}

impl Reading {
    fn protocol(&self) -> Protocol {
        Protocol(self.uskin)
    }
}

/// Takes the boards of the best layout out of what was heard.
pub(crate) fn take_boards(heard: &mut HeardIds, bus: &mut RecognisedBus) {
    let left = &mut heard.ids;
    let mut readings: Vec<Reading> = LAYOUTS.iter().map(|uskin| read(uskin, left)).collect();
    readings.retain(|reading| !reading.boards.is_empty());
    let worth = |reading: &Reading| reading.fit * if reading.last_byte { WORTH } else { 1.0 };
    // Equals stay in the order of LAYOUTS.
    readings.sort_by(|a, b| worth(b).total_cmp(&worth(a)));
    let Some((best, others)) = readings.split_first() else {
        return;
    };
    for other in others.iter().filter(|other| other.fit >= NEARLY * best.fit) {
        let why = match (best.last_byte, other.last_byte) {
            (true, false) => "byte 7 is sda + 1 under the first, as in the Waseda firmware, and decides",
            _ => "nothing in the frames decides, so the first is a guess: press one taxel after the other",
        };
        bus.doubts.push(format!(
            "the ids are those of {} boards of {} and as well of {} of {}; {why}",
            best.boards.len(),
            best.protocol().name(),
            other.boards.len(),
            other.protocol().name()
        ));
    }
    for (board, ids) in &best.boards {
        let heard = ids.values().filter_map(|id| left.get(id));
        let rate_hz = heard
            .filter_map(|h| h.rate_hz(h.full as f64))
            .max_by(f64::total_cmp);
        let taxels: Vec<u8> = ids.keys().copied().collect();
        let missing: Vec<String> = best
            .uskin
            .ids
            .expected(&taxels)
            .into_iter()
            .filter(|k| !taxels.contains(k))
            .map(|k| k.to_string())
            .collect();
        if !missing.is_empty() {
            bus.doubts.push(format!(
                "board {board}: no frame of taxels k = {} was heard, so they are left out",
                missing.join(", ")
            ));
        }
        bus.boards.push(RecognisedBoard {
            protocol: best.protocol(),
            or_protocol: None,
            board: *board,
            hub: None,
            taxels,
            rate_hz,
        });
    }
    let protocol = best.protocol();
    let whole: Vec<u8> = best.boards.keys().copied().collect();
    left.retain(|id, heard| {
        let mine = protocol
            .taxel_of(*id)
            .is_some_and(|(board, _)| whole.contains(&board));
        // Queue overflows of an L1 board have the id of a taxel and no data.
        !(mine && (heard.full > 0 || heard.count > 0))
    });
}

fn read(uskin: &'static Uskin, ids: &BTreeMap<u16, IdTraffic>) -> Reading {
    let protocol = Protocol(uskin);
    let mut boards: BTreeMap<u8, BTreeMap<u8, u16>> = BTreeMap::new();
    for (id, heard) in ids.iter().filter(|(_, heard)| heard.full >= FEWEST) {
        // A board that boots answers under ids of taxels, a few times; a start of each sweep may have the id of another's.
        if heard.full * 3 > heard.count
            && let Some((board, k)) = protocol.taxel_of(*id)
        {
            boards.entry(board).or_default().insert(k as u8, *id);
        }
    }
    let mut fit = 0.0;
    boards.retain(|_, taxels| {
        let numbers: Vec<u8> = taxels.keys().copied().collect();
        let whole = uskin.ids.expected(&numbers).len();
        let share = numbers.len() as f64 / whole as f64;
        let is_board = numbers.len() >= 4 && share >= 0.75;
        if is_board {
            fit += numbers.len() as f64 * share;
        }
        is_board
    });
    let taxels = || boards.values().flat_map(BTreeMap::iter);
    let right = taxels().filter(|(k, id)| {
        let heard = &ids[id];
        !heard.varies && heard.last_byte == Some(uskin.ids.line(**k).0 + 1)
    });
    let (right, all) = (right.count() as f64, taxels().count() as f64);
    let lines: Vec<u8> = taxels().map(|(k, _)| uskin.ids.line(*k).0).collect();
    let several = lines.iter().any(|line| *line != lines[0]);
    Reading {
        uskin,
        last_byte: several && right >= MATCHES * all,
        boards,
        fit,
    }
}
