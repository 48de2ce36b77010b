//! No byte string on any bus makes a decoder panic, take memory, or give more than it may.

use proptest::prelude::*;
use std::sync::LazyLock;
use taxel_can::{CanFrame, Received};
use taxel_skin::{
    BoardSupervisor, BoardsConfig, BusMonitor, Decoded, Decoder, Discovery, Layout, MAX_READINGS, Readings,
};

#[global_allocator]
static ALLOCATOR: taxel_allocations::Counting = taxel_allocations::Counting;

/// Every built-in hand, and what none of them has.
static LAYOUTS: LazyLock<Vec<Layout>> = LazyLock::new(layouts);

fn layouts() -> Vec<Layout> {
    let mut layouts: Vec<Layout> = Layout::builtin_names()
        .map(|name| Layout::builtin(name).unwrap())
        .collect();
    layouts.push(crate::support::icub("icub-mtb4", "icub = { skin_type = 0 }"));
    for parameters in [
        crate::support::CYSKIN.to_string(),
        crate::support::CYSKIN
            .replace("\"sum\"", "\"unchecked\"")
            .replace("above = 5", "above = 255"),
        crate::support::CYSKIN
            .replace("\"sum\"", "\"unchecked\"")
            .replace("above = 5", "above = 0"),
        crate::support::CYSKIN
            .replace("module = 12", "module = 1")
            .replace("\"sum\"", "\"unchecked\""),
    ] {
        layouts.push(crate::support::cyskin(&parameters, 248));
    }
    layouts
}

/// Any frame a bus can carry; often one with an id and a beginning that some board knows.
fn any_frame() -> impl Strategy<Value = CanFrame> {
    let id = prop_oneof![
        4 => 0u32..0x800,
        1 => 0x400u32..0x4F0,
        4 => (0u32..8, 0x123u32..0x126).prop_map(|(assembly, address)| 1 << 31 | assembly << 26 | address),
        1 => any::<u32>(),
    ];
    let data = prop_oneof![
        4 => prop::collection::vec(any::<u8>(), 0..=8),
        1 => prop::collection::vec(any::<u8>(), 7).prop_map(|mut d| { d.insert(0, 0x40); d }),
        1 => prop::collection::vec(any::<u8>(), 7).prop_map(|mut d| { d.insert(0, 0xC0); d }),
        4 => (prop::collection::vec(any::<u8>(), 0..=6)).prop_map(|mut d| { d.insert(0, 0x43); d }),
        2 => (0u8..17, prop::collection::vec(any::<u8>(), 0..=7)).prop_map(|(n, mut d)| { d.insert(0, n); d }),
    ];
    (id, data).prop_map(|(id, data)| CanFrame::from_raw(id, &data).unwrap())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn any_frames_are_decoded_without_memory_and_each_is_in_one_count(
        frames in prop::collection::vec((any_frame(), 0u64..30_000_000), 0..300),
    ) {
        for layout in LAYOUTS.iter() {
            let mut decoder = Decoder::new(layout, 0);
            let mut readings = Readings::new();
            let mut monitor = BusMonitor::new(layout);
            let (mut t_ns, mut most, mut wrong) = (0, 0, 0);
            let ((), allocations) = taxel_allocations::during(|| {
                for (frame, step_ns) in &frames {
                    t_ns += step_ns;
                    monitor.handle_frame(0, &Received { t_ns, frame: *frame });
                    let decoded = decoder.decode_at(t_ns, frame, &mut readings);
                    readings.iter().for_each(|reading| monitor.handle_reading(reading));
                    wrong += (decoded != Decoded::Readings && !readings.is_empty()) as u32;
                    wrong += readings.iter().filter(|r| r.taxel as usize >= layout.len()).count() as u32;
                    most = most.max(readings.len());
                }
            });
            prop_assert_eq!(allocations, 0, "{}", layout.name);
            prop_assert!(most <= MAX_READINGS);
            prop_assert_eq!(wrong, 0, "readings only with Decoded::Readings, of taxels of the layout");
            let bus = *decoder.counters();
            let mut board = taxel_skin::BoardStatus::default();
            (0..layout.modules.len()).for_each(|b| decoder.add_to(b as u16, &mut board));
            let counted = bus.readings + bus.unknown + bus.not_data + bus.commands + bus.partial
                + board.malformed + board.queue_overflows;
            prop_assert_eq!(counted, bus.frames);
            prop_assert!(bus.abandoned <= bus.partial, "a packet that is given up had been begun");
        }
    }

    #[test]
    fn any_answers_end_a_discovery_in_time(
        frames in prop::collection::vec((0u8..3, any_frame()), 0..400),
    ) {
        let layout = Layout::builtin("allegro-uskin-15").unwrap();
        let supervisor = BoardSupervisor::new(&layout, &BoardsConfig::default());
        let mut discovery = supervisor.discover(&layout).unwrap();
        let mut scan = Discovery::scan(2);
        let mut frames = frames.iter().cycle();
        for ms in 0..4_000u64 {
            let now = ms * 1_000_000;
            for _ in 0..2 {
                if let Some((bus, frame)) = frames.next() {
                    let received = Received { t_ns: now, frame: *frame };
                    discovery.handle_frame(*bus, &received);
                    scan.handle_frame(*bus, &received);
                }
            }
            while discovery.poll_command(now).is_some() {}
            while scan.poll_command(now).is_some() {}
        }
        prop_assert!(discovery.is_done() && scan.is_done());
        prop_assert!(discovery.finish().0.boards.len() <= 32, "sixteen addresses on two buses");
    }

    #[test]
    fn any_change_of_a_layout_file_is_a_layout_or_an_error(
        which in any::<prop::sample::Index>(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), "[ -~\n]{0,3}"), 1..6),
    ) {
        let names: Vec<&str> = Layout::builtin_names().collect();
        let mut text: String = Layout::builtin_text(names[which.index(names.len())]).unwrap().replace("#!", "");
        prop_assume!(text.is_ascii());
        for (at, with) in &changes {
            let at = at.index(text.len());
            let end = (at + 2).min(text.len());
            text.replace_range(at..end, with);
        }
        if let Ok(layout) = Layout::parse(&text, "changed.toml") {
            for bus in 0..layout.buses.len() {
                Decoder::new(&layout, bus as u8);
            }
            BoardSupervisor::new(&layout, &BoardsConfig::default());
        }
    }
}

#[test]
fn findings_come_and_go_without_memory() {
    let layout = Layout::builtin("allegro-uskin-15").unwrap();
    let mut monitor = BusMonitor::new(&layout);
    let protocol = taxel_skin::Protocol::USKIN_L2;
    let mut most = 0;
    let ((), allocations) = taxel_allocations::during(|| {
        for second in 0..6u64 {
            for n in 0..2_000u64 {
                let t_ns = second * 1_000_000_000 + n * 500_000;
                monitor.advance(t_ns);
                // Every other second: both buses babble, and every address is on both.
                if second % 2 == 0 {
                    for bus in 0..2 {
                        let frame = CanFrame::standard(5, &[0; 8]).unwrap();
                        monitor.handle_frame(bus, &Received { t_ns, frame });
                        let (board, k) = ((n % 8) as u8, (n / 8 % 16) as u16);
                        let frame = protocol.frame(board, k, [0; 3], 0).unwrap();
                        monitor.handle_frame(bus, &Received { t_ns, frame });
                    }
                }
                most = most.max(monitor.findings().len());
            }
        }
    });
    assert_eq!((allocations, monitor.findings().len()), (0, 0));
    assert!(most >= 3, "{most}");
}
