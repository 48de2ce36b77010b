//! Whoever speaks on the buses of the hand and is not of it.

use super::{AREA, HandFacts, Unclaimed};
use crate::doctor::finding::Check;
use std::collections::BTreeMap;
use taxel_can::{EXTENDED_FLAG, id_text};
use taxel_diagnose::speaks_on;
use taxel_hand::plural;
use taxel_joints::{AllegroConfig, AllegroDecoder, AllegroFrame};
use taxel_skin::{Finding, Layout, Protocol};

/// Frames that are nothing of this hand's: boards of the same protocol at other addresses, an
/// Allegro hand, others.
pub(super) fn check(layout: &Layout, bus: u8, hand: &HandFacts) -> Vec<Check> {
    let facts = &hand.buses[usize::from(bus)];
    let mut checks = Vec::new();
    let mut rest: Vec<(u32, Unclaimed)> = facts.unclaimed.iter().map(|(id, u)| (*id, *u)).collect();
    for version in [3, 4] {
        let Ok(mut allegro) = AllegroDecoder::new(&AllegroConfig::new(version)) else {
            continue;
        };
        let mut fingers = [0u64; 4];
        for (_, unclaimed) in &rest {
            if let AllegroFrame::Position { finger } = allegro.push(&unclaimed.last, 0) {
                fingers[finger] += unclaimed.count;
            }
        }
        if fingers.iter().all(|n| *n > 1) {
            rest.retain(|(_, u)| !matches!(allegro.push(&u.last, 0), AllegroFrame::Position { .. }));
            let version = if version == 4 { "4 or 5" } else { "1 to 3" };
            checks.push(
                Check::error(
                    AREA,
                    "Allegro hand",
                    &facts.name,
                    format!("an Allegro hand (version {version}) speaks on the bus of the skin"),
                )
                .wanted("a bus of its own: its ids and those of the boards overlap"),
            );
        }
    }
    let modules = || layout.wiring.iter().filter(|m| m.bus == bus);
    for protocol in Protocol::boards() {
        if !modules().any(|m| m.protocol == protocol) {
            continue;
        }
        let mut boards: BTreeMap<u8, (usize, u64)> = BTreeMap::new();
        for (id, unclaimed) in &rest {
            let of = board_of(protocol, *id).filter(|_| unclaimed.last.dlc() == 8);
            if let Some(board) = of {
                let entry = boards.entry(board).or_default();
                entry.0 += 1;
                entry.1 += unclaimed.count;
            }
        }
        // One id may be anybody's; several are a board.
        boards.retain(|_, (ids, count)| *ids > 1 && *count > *ids as u64);
        rest.retain(|(id, u)| {
            u.last.dlc() != 8 || !board_of(protocol, *id).is_some_and(|board| boards.contains_key(&board))
        });
        for (board, (ids, count)) in boards {
            if is_displaced(layout, hand, bus, board) || hand.is_told_stranger(bus, board.into()) {
                continue;
            }
            let known = modules().any(|m| m.board == board && m.protocol == protocol);
            let object = format!("{} board {board}", facts.name);
            checks.push(
                match known {
                    true => Check::warning(
                        AREA,
                        "unexpected ids",
                        object,
                        format!("sends {} that the layout leaves out", plural(ids, "id")),
                    ),
                    false => Check::warning(
                        AREA,
                        "unexpected board",
                        object,
                        format!(
                            "sends {count} frames of {} and is not in the layout ({})",
                            plural(ids, "id"),
                            protocol.name()
                        ),
                    ),
                }
                .run(facts.scan()),
            );
        }
    }
    rest.retain(|(id, _)| !is_told(hand, bus, *id));
    if !rest.is_empty() {
        let ids: Vec<String> = rest.iter().take(8).map(|(id, _)| id_text(*id)).collect();
        let more = if rest.len() > ids.len() { ", ..." } else { "" };
        let frames: u64 = rest.iter().map(|(_, u)| u.count).sum();
        checks.push(
            Check::warning(
                AREA,
                "unknown ids",
                &facts.name,
                format!(
                    "{frames} frames of {}: {}{more}",
                    plural(rest.len(), "id"),
                    ids.join(", ")
                ),
            )
            .wanted("only boards of the hand on the bus"),
        );
    }
    checks
}

/// Whether it is known whose board speaks on a bus under an address that the bus does not have.
fn is_displaced(layout: &Layout, hand: &HandFacts, bus: u8, address: u8) -> bool {
    let mut boards = layout.wiring.iter().enumerate();
    boards.any(|(module, wiring)| {
        wiring.board == address && speaks_on(layout, &hand.findings, module) == Some(bus)
    })
}

/// Whether an id was told as babbling.
fn is_told(hand: &HandFacts, bus: u8, id: u32) -> bool {
    hand.findings.iter().any(|finding| match *finding {
        Finding::IdBabbles {
            bus: b,
            id: babbling,
            extended,
            ..
        } => (b, babbling, extended) == (bus, id & !EXTENDED_FLAG, id & EXTENDED_FLAG != 0),
        _ => false,
    })
}

/// The address of the board that would send this id.
fn board_of(protocol: Protocol, id: u32) -> Option<u8> {
    let id = u16::try_from(id).ok().filter(|id| *id < 0x800)?;
    protocol.board_of(id)
}
