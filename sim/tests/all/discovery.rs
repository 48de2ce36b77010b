//! Simulated boards answer as `taxel doctor` and the daemon ask.

use crate::support::scene;
use taxel_can::Received;
use taxel_sim::{Scene, Simulator};
use taxel_skin::{BoardKind, BoardSupervisor, BoardsConfig, Discovery, DiscoveryReport, Firmware, Layout};

const MS: u64 = 1_000_000;

/// Two MTB3s of the iCub, an MTB4 and a uSkin board on one bus.
fn mixed() -> Layout {
    let mut text = "name = \"mixed\"\nimage = { width = 16, height = 4 }\nbuses = [\"can0\"]\n".to_string();
    for (i, (board, protocol)) in [
        (2, "icub-mtb3"),
        (3, "icub-mtb3"),
        (4, "icub-mtb4"),
        (6, "uskin-l1"),
    ]
    .into_iter()
    .enumerate()
    {
        let order = if protocol == "uskin-l1" {
            ""
        } else {
            "order = [[0, 1, 2, 3]]\n"
        };
        text += &format!(
            "[[module]]\nname = \"m{board}\"\npart = \"p\"\nbus = \"can0\"\nboard = {board}\nprotocol = \"{protocol}\"\n\
             at = [{}, 0]\n{order}",
            4 * i
        );
    }
    Layout::parse(&text, "mixed.toml").unwrap()
}

/// Asks, from `now_ns` on, and says when it was done.
fn ask<T>(mut discovery: Discovery<T>, sim: &mut Simulator, mut now_ns: u64) -> (DiscoveryReport, T, u64) {
    let mut frames: Vec<(u8, Received)> = Vec::new();
    while !discovery.is_done() {
        while let Some(command) = discovery.poll_command(now_ns) {
            sim.command(command.bus, &command.frame, now_ns).unwrap();
        }
        now_ns += MS;
        frames.clear();
        sim.advance(now_ns, &mut frames);
        for (bus, received) in &frames {
            discovery.handle_frame(*bus, received);
        }
    }
    let (report, then) = discovery.finish();
    (report, then, now_ns)
}

fn supervisor(layout: &Layout) -> BoardSupervisor {
    BoardSupervisor::new(layout, &BoardsConfig::default())
}

#[test]
fn every_mtb_is_found_with_its_kind_and_firmware_and_starts_afterwards() {
    let layout = mixed();
    let mut sim = Simulator::new(&scene(20, ""), &layout, 1).unwrap();
    let discovery = supervisor(&layout).discover(&layout).unwrap();
    let (report, mut supervisor, mut now_ns) = ask(discovery, &mut sim, 0);
    let found: Vec<_> = report
        .boards
        .iter()
        .map(|b| {
            (
                b.address,
                b.kind,
                b.firmware.minor,
                b.protocol_version,
                b.answers,
                b.module,
            )
        })
        .collect();
    let protocol = Some([1, 0]);
    assert_eq!(
        found,
        [
            (2, BoardKind::Mtb3, 17, protocol, 1, Some(0)),
            (3, BoardKind::Mtb3, 17, protocol, 1, Some(1)),
            (4, BoardKind::Mtb4, 9, protocol, 1, Some(2)),
            (6, BoardKind::Mtb3, 17, protocol, 1, Some(3)),
        ]
    );
    assert_eq!(report.mismatches(&layout).count(), 0);
    assert!(report.missing.is_empty() && report.busy.is_empty());
    let end_ns = now_ns + 2_000 * MS;
    let mut frames = Vec::new();
    while now_ns < end_ns {
        while let Some(command) = supervisor.poll_command(now_ns, |_| None) {
            sim.command(command.bus, &command.frame(), now_ns).unwrap();
        }
        now_ns += MS;
        sim.advance(now_ns, &mut frames);
        if sim.board_counts().streaming == 4 {
            return;
        }
    }
    panic!("only {} of 4 boards stream", sim.board_counts().streaming);
}

#[test]
fn boards_that_are_off_are_missing_and_one_in_its_bootloader_is_said_to_be_there() {
    let layout = mixed();
    let off = "[[fault]]\nkind = \"silent\"\non = [\"m3\"]\n";
    let mut sim = Simulator::new(&scene(20, off), &layout, 1).unwrap();
    let reset = taxel_can::CanFrame::standard(0x704, &[0x00]).unwrap();
    sim.command(0, &reset, 0).unwrap();
    sim.advance(10 * MS, &mut Vec::new());
    let discovery = supervisor(&layout).discover(&layout).unwrap();
    let (report, _, _) = ask(discovery, &mut sim, 10 * MS);
    assert_eq!(report.missing, [1]);
    let bootloader: Vec<u8> = report
        .boards
        .iter()
        .filter(|b| b.in_bootloader)
        .map(|b| b.address)
        .collect();
    assert_eq!(bootloader, [4]);
    let firmware = Firmware {
        major: 2,
        minor: 9,
        build: None,
    };
    assert_eq!(
        report.boards.iter().find(|b| b.address == 4).unwrap().firmware,
        firmware
    );
}

#[test]
fn a_scan_leaves_streaming_boards_alone() {
    let layout = mixed();
    let mut sim = Simulator::new(&scene(20, ""), &layout, 1).unwrap();
    sim.start_all();
    let (report, (), now_ns) = ask(Discovery::scan(1), &mut sim, 0);
    assert_eq!(report.busy.len(), 1, "{report:?}");
    assert!(report.boards.is_empty());
    let mut frames = Vec::new();
    sim.advance(now_ns + 1_000 * MS, &mut frames);
    assert_eq!(sim.board_counts().streaming, 4);
}

#[test]
fn a_hand_of_fifteen_modules_answers_on_both_buses() {
    let layout = Layout::builtin("allegro-uskin-15").unwrap();
    let mut sim = Simulator::new(&Scene::builtin("idle").unwrap(), &layout, 1).unwrap();
    let discovery = supervisor(&layout).discover(&layout).unwrap();
    let (report, _, _) = ask(discovery, &mut sim, 0);
    assert_eq!(report.boards.len(), 15);
    assert!(report.missing.is_empty());
}
