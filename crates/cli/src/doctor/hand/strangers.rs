//! Whoever speaks on the buses of the hand and is not of it.

use super::{AREA, BusFacts, HandFacts, Unclaimed};
use crate::doctor::finding::Check;
use std::collections::BTreeMap;
use taxel_can::{EXTENDED_FLAG, id_text};
use taxel_diagnose::speaks_on;
use taxel_hand::plural;
use taxel_joints::{AllegroConfig, AllegroDecoder, AllegroFrame};
use taxel_skin::{Finding, Layout, Protocol};

/// Ids that are nothing of the hand's, extended ones with [`EXTENDED_FLAG`], and what was heard of each.
type Strangers = Vec<(u32, Unclaimed)>;

/// Frames that are nothing of this hand's: boards of the same protocol at other addresses, an
/// Allegro hand, others.
pub(super) fn check(layout: &Layout, bus: u8, hand: &HandFacts) -> Vec<Check> {
    let facts = &hand.buses[usize::from(bus)];
    let mut strangers: Strangers = facts.unclaimed.iter().map(|(id, u)| (*id, *u)).collect();
    let mut checks = allegro_hands(facts, &mut strangers);
    for protocol in Protocol::boards() {
        let mut modules = layout.wiring.iter().filter(|m| m.bus == bus);
        if modules.any(|m| m.protocol == protocol) {
            checks.extend(boards(layout, bus, hand, protocol, &mut strangers));
        }
    }
    strangers.retain(|(id, _)| !is_told(hand, bus, *id));
    checks.extend(unknown(&facts.name, &strangers));
    checks
}

/// Takes out the Allegro hands.
fn allegro_hands(bus: &BusFacts, strangers: &mut Strangers) -> Vec<Check> {
    let mut checks = Vec::new();
    for version in [3, 4] {
        let Ok(mut allegro) = AllegroDecoder::new(&AllegroConfig::new(version)) else {
            continue;
        };
        let mut fingers = [0u64; 4];
        for (_, unclaimed) in &*strangers {
            if let AllegroFrame::Position { finger } = allegro.push(&unclaimed.last, 0) {
                fingers[finger] += unclaimed.count;
            }
        }
        if fingers.iter().any(|n| *n <= 1) {
            continue;
        }
        strangers.retain(|(_, u)| !matches!(allegro.push(&u.last, 0), AllegroFrame::Position { .. }));
        let version = if version == 4 { "4 or 5" } else { "1 to 3" };
        checks.push(
            Check::error(
                AREA,
                "Allegro hand",
                &bus.name,
                format!("an Allegro hand (version {version}) speaks on the bus of the skin"),
            )
            .wanted(format!(
                "a bus of its own, since ids of both may overlap, or `[joints]` in the configuration with the source of this \
                 very bus, \"allegro:{}\"",
                bus.source
            )),
        );
    }
    checks
}

/// Takes out the boards of a protocol that the bus has.
fn boards(
    layout: &Layout,
    bus: u8,
    hand: &HandFacts,
    protocol: Protocol,
    strangers: &mut Strangers,
) -> Vec<Check> {
    let facts = &hand.buses[usize::from(bus)];
    let address = |(id, heard): &(u32, Unclaimed)| board_of(protocol, *id).filter(|_| heard.last.dlc() == 8);
    let mut boards: BTreeMap<u8, (usize, u64)> = BTreeMap::new();
    for stranger in &*strangers {
        if let Some(board) = address(stranger) {
            let (ids, count) = boards.entry(board).or_default();
            *ids += 1;
            *count += stranger.1.count;
        }
    }
    // One id may be anybody's; several are a board.
    boards.retain(|_, (ids, count)| *ids > 1 && *count > *ids as u64);
    strangers.retain(|stranger| !address(stranger).is_some_and(|board| boards.contains_key(&board)));
    boards.retain(|board, _| {
        !is_displaced(layout, hand, bus, *board) && !hand.is_told_stranger(bus, (*board).into())
    });
    let check = |(board, (ids, count))| {
        let mut wiring = layout.wiring.iter();
        let ids = plural(ids, "id");
        let (name, found) = match wiring.any(|m| (m.bus, m.board, m.protocol) == (bus, board, protocol)) {
            true => (
                "unexpected ids",
                format!("sends {ids} that the layout leaves out"),
            ),
            false => (
                "unexpected board",
                format!(
                    "sends {} of {ids} and is not in the layout ({})",
                    plural(count, "frame"),
                    protocol.name()
                ),
            ),
        };
        Check::warning(AREA, name, format!("{} board {board}", facts.name), found).run(facts.scan())
    };
    boards.into_iter().map(check).collect()
}

/// What remains.
fn unknown(bus: &str, strangers: &Strangers) -> Option<Check> {
    if strangers.is_empty() {
        return None;
    }
    let ids: Vec<String> = strangers.iter().take(8).map(|(id, _)| id_text(*id)).collect();
    let more = if strangers.len() > ids.len() { ", ..." } else { "" };
    let frames: u64 = strangers.iter().map(|(_, heard)| heard.count).sum();
    let count = plural(strangers.len(), "id");
    let found = format!("{} of {count}: {}{more}", plural(frames, "frame"), ids.join(", "));
    Some(Check::warning(AREA, "unknown ids", bus, found).wanted("only boards of the hand on the bus"))
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
