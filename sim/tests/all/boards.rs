//! Boards and buses as docs/protocols.md, "MTB3 firmware", "uSkin commands" and "Bus timing" describe them.

use crate::support::{Bench, boards, of_board, scene};
use std::collections::BTreeSet;
use taxel_can::CanFrame;
use taxel_sim::Simulator;
use taxel_skin::Layout;

#[test]
fn a_board_is_silent_until_it_is_started_and_after_it_is_stopped() {
    let layout = boards("uskin-l2", &[3]);
    let mut bench = Bench::new(&scene(10, ""), &layout);
    assert_eq!(bench.until_ms(1000).len(), 0);
    assert_eq!(bench.sim.next_at_ns(), None);
    bench.command(1000, 0x203, &[0x07, 0x00]);
    assert!(
        (780..=816).contains(&bench.until_ms(2000).len()),
        "{}",
        bench.frames.len()
    );
    bench.command(2000, 0x203, &[0x07, 0x01]);
    bench.until_ms(2020);
    assert_eq!(bench.until_ms(3000).len(), 0);
    bench.command(3000, 0x203, &[0x07, 0x00]);
    bench.command(3500, 0x703, &[0x17, 0x00]);
    assert!(
        (380..=416).contains(&bench.until_ms(4000).len()),
        "{}",
        bench.frames.len()
    );
    assert_eq!(bench.until_ms(5000).len(), 0);
}

#[test]
fn the_transmit_stack_turns_each_group_around() {
    let layout = boards("uskin-l1", &[1]);
    let mut bench = Bench::streaming(&scene(1, ""), &layout);
    let sweep: Vec<u16> = bench
        .until_ms(100)
        .iter()
        .take(16)
        .filter_map(|f| f.frame.standard_id())
        .collect();
    let k: Vec<u16> = sweep.iter().map(|id| id - 0x710).collect();
    assert_eq!(k, [0, 12, 8, 4, 1, 13, 9, 5, 2, 14, 10, 6, 3, 15, 11, 7]);
    let first = bench.frames[0].frame;
    assert_eq!((first.dlc(), first.data()[0], first.data()[7]), (8, 0x83, 1));
    assert_eq!(bench.frames[1].frame.data()[7], 4);
}

#[test]
fn xela_controllers_stream_from_power_up_and_take_no_commands() {
    let text = "name = \"x\"\nimage = { width = 4, height = 4 }\nbuses = [\"can0\"]\n[[module]]\nname = \"m\"\npart = \"p\"\n\
        bus = \"can0\"\nboard = 1\nprotocol = \"uskin-l3\"\nat = [0, 0]\n\
        order = [[0, 1, 2, 3], [16, 17, 18, 19], [32, 33, 34, 35], [48, 49, 50, 51]]\n";
    let layout = taxel_skin::Layout::parse(text, "x.toml").unwrap();
    let mut bench = Bench::new(&scene(2, "[boards]\nrate_hz = 80\n"), &layout);
    bench.command(500, 0x201, &[0x07, 0x01]);
    bench.command(510, 0x701, &[0xFF]);
    assert!(
        (2500..=2576).contains(&bench.until_ms(2000).len()),
        "{}",
        bench.frames.len()
    );
    assert!(bench.frames.iter().any(|f| f.frame.id() == 0x331));
}

#[test]
fn rates_follow_the_arithmetic_of_the_bus() {
    // docs/protocols.md, "Bus timing": modules, nominal rate, sweeps per second of the whole bus that come
    // through.
    let l2 = [0, 1, 2, 3, 4, 5, 6, 7];
    let l1: Vec<u8> = (0..15).collect();
    let cases = [
        ("uskin-l2", &l2[..1], 100, 1590..1610, false),
        ("uskin-l2", &l2[..2], 100, 3180..3210, false),
        ("uskin-l2", &l2[..4], 100, 6360..6420, false),
        ("uskin-l2", &l2[..], 50, 6360..6420, false),
        ("uskin-l2", &l2[..], 100, 7400..9009, true),
        ("uskin-l1", &l1[..], 100, 7400..9009, true),
        ("uskin-l1", &l1[..], 30, 7100..7230, false),
    ];
    for (protocol, addresses, rate_hz, per_second, overflows) in cases {
        let layout = boards(protocol, addresses);
        let mut bench = Bench::streaming(&scene(3, &format!("[boards]\nrate_hz = {rate_hz}\n")), &layout);
        bench.until_ms(1000);
        let second = bench.until_ms(2000).to_vec();
        let taxels = second.iter().filter(|f| f.frame.dlc() == 8).count();
        let label = format!("{} {protocol} boards at {rate_hz} Hz: {taxels}", addresses.len());
        assert!(per_second.contains(&taxels), "{label}");
        let counts = bench.sim.board_counts();
        assert_eq!(
            counts.overflows > 0,
            overflows,
            "{label}, {} overflows",
            counts.overflows
        );
        if overflows {
            // Arbitration gives the bus to the lowest ids, so the first board loses nothing and the
            // last starves.
            assert!(of_board(&layout, &second, addresses[0]) >= 1584, "{label}");
            assert!(
                of_board(&layout, &second, addresses[addresses.len() - 1]) < 800,
                "{label}"
            );
        }
    }
}

#[test]
fn frames_on_a_bus_never_overlap() {
    let layout = boards("uskin-l2", &[0, 1, 2, 3, 4, 5, 6, 7]);
    let mut bench = Bench::streaming(&scene(1, "[boards]\nrate_hz = 100\n"), &layout);
    for pair in bench.until_ms(500).windows(2) {
        let gap_ns = pair[1].t_ns - pair[0].t_ns;
        let least = 47 + 8 * u64::from(pair[1].frame.dlc());
        assert!(gap_ns >= least * 1000, "{gap_ns} ns before {}", pair[1].frame);
    }
}

#[test]
fn a_full_stack_is_emptied_and_says_so_with_an_empty_frame() {
    let layout = boards("uskin-l1", &[6]);
    let fault = "[[fault]]\nkind = \"overflow\"\non = [\"m6\"]\nfrom = 1\nto = 2\n";
    let mut bench = Bench::streaming(&scene(4, fault), &layout);
    bench.until_ms(1000);
    bench.until_ms(2000);
    assert!(bench.frames.len() <= 1, "{}", bench.frames.len());
    let overflows = bench.sim.board_counts().overflows;
    // 800 frames through a stack of 20: each overflow throws away 20 and the frame that found it full.
    assert!((35..=42).contains(&overflows), "{overflows}");
    let after = bench.until_ms(2100);
    let notices: Vec<_> = after.iter().filter(|f| f.frame.dlc() == 0).collect();
    assert_eq!(notices.len(), 1);
    assert_eq!(notices[0].frame.to_string(), "765#");
    assert!((780..=816).contains(&bench.until_ms(3100).len()));
}

#[test]
fn commands_back_to_back_during_a_sweep_are_obeyed_newest_first() {
    let layout = boards("uskin-l2", &[3]);
    for (gap_ns, streams) in [(0, false), (10_000_000, true)] {
        let mut bench = Bench::streaming(&scene(9, ""), &layout);
        let first_ns = bench.until_ms(50)[0].t_ns;
        let sweeping_ns = first_ns + 100_000_000 + 300_000;
        for (data, t_ns) in [([0x07, 0x01], sweeping_ns), ([0x07, 0x00], sweeping_ns + gap_ns)] {
            let command = CanFrame::standard(0x203, &data).unwrap();
            bench.sim.command(0, &command, t_ns).unwrap();
        }
        bench.until_ms(300);
        assert_eq!(
            !bench.until_ms(1000).is_empty(),
            streams,
            "{gap_ns} ns between stop and start"
        );
    }
}

#[test]
fn in_l1_the_hazard_makes_boards_stop_each_other() {
    let layout = boards("uskin-l1", &[1, 2, 3]);
    for (hazard, frames) in [(false, 2300..2500), (true, 16..150)] {
        let mut bench = Bench::new(
            &scene(3, &format!("[boards]\nclass7_hazard = {hazard}\n")),
            &layout,
        );
        for board in 1..=3 {
            bench.command(0, 0x200 | board, &[0x07, 0x00]);
        }
        let n = bench.until_ms(1000).len();
        assert!(frames.contains(&n), "hazard {hazard}: {n} frames");
        assert_eq!(bench.sim.board_counts().streaming <= 1, hazard);
    }
    // Re-sending start before every sweep keeps them going, as the Waseda readers do.
    let mut bench = Bench::new(&scene(3, "[boards]\nclass7_hazard = true\n"), &layout);
    let mut taxels = [0; 3];
    for ms in (0..1000).step_by(5) {
        for board in 1..=3 {
            bench.command(ms, 0x200 | board, &[0x07, 0x00]);
        }
        let frames = bench.until_ms(ms + 5).to_vec();
        for (board, taxels) in (1..).zip(&mut taxels) {
            *taxels += of_board(&layout, &frames, board);
        }
    }
    assert!(taxels.iter().all(|n| *n >= 700), "{taxels:?}");
}

#[test]
fn in_l2_the_hazard_lets_board_7_stop_boards_0_to_3() {
    let layout = boards("uskin-l2", &[0, 1, 2, 3, 4, 5, 6, 7]);
    let mut bench = Bench::new(&scene(3, "[boards]\nclass7_hazard = true\n"), &layout);
    for board in 0..8 {
        bench.command(0, 0x200 | board, &[0x07, 0x00]);
    }
    bench.until_ms(1000);
    let second = bench.until_ms(2000).to_vec();
    for board in 0..8 {
        let n = of_board(&layout, &second, board);
        assert_eq!(n == 0, board <= 3, "board {board}: {n} frames");
    }
}

#[test]
fn a_dead_chip_makes_the_board_of_its_number_answer_a_discovery() {
    // Status 0xFF in 0x753 reads as discovery to board 3, which answers 0x735, DLC 5 (docs/protocols.md,
    // "uSkin commands").
    let layout = boards("uskin-l1", &[3, 5]);
    let more = "[boards]\nclass7_hazard = true\n[[fault]]\nkind = \"dead\"\non = [\"m5\"]\ntaxels = [3]\n";
    let mut bench = Bench::new(&scene(3, more), &layout);
    bench.command(0, 0x205, &[0x07, 0x00]);
    let frames = bench.until_ms(500);
    assert!(
        frames.iter().any(|f| f.frame.to_string() == "735#FF05021100"),
        "{frames:?}"
    );
}

#[test]
fn management_replies_and_stops_whatever_was_asked() {
    let layout = boards("uskin-l1", &[5]);
    let cases: [(u16, &[u8], &str, bool); 5] = [
        (0x70F, &[0xFF], "750#FF05021100", true),
        (0x705, &[0x04], "750#0401", true),
        (0x705, &[0x00], "750#0001", true),
        (0x205, &[0x1C, 1, 0], "250#1C05021100010001", false),
        (0x205, &[0x1C, 2, 0], "250#1C05021100010000", false),
    ];
    for (id, data, reply, stops) in cases {
        let mut bench = Bench::streaming(&scene(5, ""), &layout);
        bench.until_ms(1000);
        bench.command(1000, id, data);
        let frames = bench.until_ms(1100).to_vec();
        let found = frames.iter().any(|f| f.frame.to_string().starts_with(reply));
        assert!(found, "{id:X} {data:?}: no {reply}");
        bench.until_ms(1200);
        assert_eq!(bench.until_ms(2000).is_empty(), stops, "{id:X} {data:?}");
    }
    // From the bootloader no start command brings it back.
    let mut bench = Bench::streaming(&scene(5, ""), &layout);
    bench.command(0, 0x705, &[0x00]);
    bench.command(100, 0x205, &[0x07, 0x00]);
    bench.until_ms(200);
    assert_eq!(bench.until_ms(1000).len(), 0);
}

#[test]
fn a_board_that_lost_power_comes_back_stopped() {
    let layout = boards("uskin-l1", &[1, 2]);
    let more = "[boards]\nboot_replies = true\nboot_sweeps = 2\n[[fault]]\nkind = \"silent\"\non = [\"m2\"]\nfrom = 1\nto = 2\n";
    let mut bench = Bench::new(&scene(6, more), &layout);
    let boot: Vec<String> = bench.until_ms(10).iter().map(|f| f.frame.to_string()).collect();
    assert_eq!(boot.len(), 8, "{boot:?}");
    assert!(boot.contains(&"723#0000000000000000".to_string()), "{boot:?}");
    bench.command(10, 0x201, &[0x07, 0x00]);
    bench.command(10, 0x202, &[0x07, 0x00]);
    let first = bench.until_ms(900).to_vec();
    let dead = |frames: &[taxel_can::Received]| frames.iter().filter(|f| f.frame.data() == [0xFF; 8]).count();
    assert_eq!(dead(&first), 0);
    let status_ff = first.iter().filter(|f| f.frame.data()[..7] == [0xFF; 7]).count();
    assert_eq!(status_ff, 2 * 2 * 16);
    bench.until_ms(1030);
    let gone = bench.until_ms(2000).to_vec();
    assert_eq!(
        (of_board(&layout, &gone, 2), of_board(&layout, &gone, 1) > 700),
        (0, true)
    );
    let back = bench.until_ms(3000).to_vec();
    assert_eq!(of_board(&layout, &back, 2), 4, "boot replies only");
    bench.command(3000, 0x202, &[0x07, 0x00]);
    let started = bench.until_ms(4000).to_vec();
    assert!(of_board(&layout, &started, 2) > 760);
}

#[test]
fn a_board_that_reboots_comes_back_unstarted() {
    let layout = boards("uskin-l2", &[1, 2]);
    let more = "[[fault]]\nkind = \"reboot\"\non = [\"m2\"]\nfrom = 1\n";
    let mut bench = Bench::new(&scene(4, more), &layout);
    for id in [0x201, 0x202] {
        bench.command(0, id, &[0x07, 0x00]);
    }
    bench.until_ms(1030);
    let gone = bench.until_ms(2000).to_vec();
    assert_eq!(
        (of_board(&layout, &gone, 2), of_board(&layout, &gone, 1) > 700),
        (0, true)
    );
    bench.command(2000, 0x202, &[0x07, 0x00]);
    let back = bench.until_ms(3000).to_vec();
    assert!(of_board(&layout, &back, 2) > 760);
}

#[test]
fn a_board_of_the_hand_can_babble_on_its_own_bus() {
    let layout = boards("uskin-l2", &[1, 2]);
    let more = "[[fault]]\nkind = \"babble\"\non = [\"m2\"]\nrate_hz = 3000\nfrom = 1\nto = 2\n";
    let mut bench = Bench::streaming(&scene(4, more), &layout);
    bench.until_ms(1000);
    let frames = bench.until_ms(2000).to_vec();
    let babble = frames.iter().filter(|f| f.frame.data() == [0xBA; 8]).count();
    assert!((2700..=3000).contains(&babble), "{babble}");
    let id = taxel_skin::Protocol::USKIN_L2.frame_id(2, 0);
    assert!(
        frames
            .iter()
            .filter(|f| f.frame.data() == [0xBA; 8])
            .all(|f| f.frame.standard_id() == id)
    );
    assert!(of_board(&layout, &frames, 1) > 760, "the other board goes on");
}

#[test]
fn a_controller_that_flaps_is_passive_and_active_in_turn() {
    let layout = boards("uskin-l2", &[1]);
    let more = "[[fault]]\nkind = \"error-frames\"\nerror = \"flapping\"\nrate_hz = 50\nfrom = 1\nto = 2\n";
    let mut bench = Bench::new(&scene(4, more), &layout);
    let states: Vec<u8> = bench.until_ms(3000).iter().map(|f| f.frame.data()[1]).collect();
    assert!((49..=51).contains(&states.len()), "{states:?}");
    assert!(
        states.chunks(2).all(|pair| [0x10, 0x40].starts_with(pair)),
        "{states:?}"
    );
}

#[test]
fn a_command_given_while_the_controller_is_off_the_bus_waits_until_it_is_back() {
    let layout = boards("uskin-l2", &[3]);
    let mut bench = Bench::new(
        &scene(9, "[[fault]]\nkind = \"bus-off\"\nfrom = 1\nto = 2\n"),
        &layout,
    );
    bench.until_ms(1500);
    bench.command(1500, 0x203, &[0x07, 0x00]);
    assert_eq!(bench.until_ms(1999).len(), 0);
    assert!(bench.until_ms(3000).len() > 780, "{}", bench.frames.len());
}

#[test]
fn the_bus_can_go_wrong_in_every_way_a_scene_names() {
    let layout = boards("uskin-l2", &[1, 2]);
    let run = |fault: &str| {
        let more = if fault.is_empty() {
            String::new()
        } else {
            format!("[[fault]]\n{fault}\n")
        };
        let mut bench = Bench::streaming(&scene(4, &more), &layout);
        bench.until_ms(3000).to_vec()
    };
    let clean = run("");
    let n = clean.len();
    assert!((4700..=4832).contains(&n), "{n}");
    let count = |frames: &[taxel_can::Received], text: &str| {
        frames
            .iter()
            .filter(|f| f.frame.to_string().starts_with(text))
            .count()
    };

    let lost = run("kind = \"lost\"\nprobability = 0.1");
    assert!(
        (n * 87 / 100..n * 93 / 100).contains(&lost.len()),
        "{}",
        lost.len()
    );
    let twice = run("kind = \"duplicate\"\nprobability = 0.1");
    assert!(
        (n * 107 / 100..n * 113 / 100).contains(&twice.len()),
        "{}",
        twice.len()
    );

    let turned = run("kind = \"reorder\"\nprobability = 0.1");
    assert!(turned.windows(2).all(|w| w[0].t_ns <= w[1].t_ns));
    assert!(turned.len().abs_diff(n) <= 1);
    let swaps = turned.windows(2).filter(|w| w[0].t_ns == w[1].t_ns).count();
    assert!(swaps > n / 20, "{swaps} swaps of {n}");

    let short = run("kind = \"short\"\nprobability = 0.5");
    let seven = short.iter().filter(|f| f.frame.dlc() == 7).count();
    assert!((n * 45 / 100..n * 55 / 100).contains(&seven), "{seven}");

    let babble = run("kind = \"babble\"\nid = 5\nrate_hz = 1000\nfrom = 1\nto = 2");
    assert!(
        (995..=1000).contains(&count(&babble, "005#")),
        "{}",
        count(&babble, "005#")
    );

    let errors = run("kind = \"error-frames\"\nerror = \"no-acknowledge\"\nrate_hz = 20\nfrom = 1\nto = 2");
    assert_eq!(count(&errors, "20000020#"), 20);

    let off = run("kind = \"bus-off\"\nfrom = 1\nto = 2");
    assert_eq!((count(&off, "20000040#"), count(&off, "20000100#")), (1, 1));
    let during = off
        .iter()
        .filter(|f| (1_000_000_001..2_000_000_000).contains(&f.t_ns))
        .count();
    assert_eq!(during, 0);

    let other = run("kind = \"wrong-id\"\non = [\"m2\"]\nboard = 1");
    assert_eq!(
        (of_board(&layout, &other, 2), of_board(&layout, &other, 1)),
        (0, other.len())
    );

    let elsewhere = boards("uskin-l2", &[1]);
    let mut bench = Bench::streaming(
        &scene(2, "[[fault]]\nkind = \"lost\"\nbus = 0\nprobability = 1\n"),
        &elsewhere,
    );
    assert_eq!(bench.until_ms(1000).len(), 0);
}

#[test]
fn every_kind_of_board_with_several_addresses_can_send_under_a_wrong_one() {
    let mut kinds = BTreeSet::new();
    for name in Layout::builtin_names() {
        let layout = Layout::builtin(name).unwrap();
        let (module, wiring) = (&layout.modules[0], &layout.wiring[0]);
        let taken = |board: &u8| {
            layout
                .wiring
                .iter()
                .any(|w| w.board == *board && w.bus == wiring.bus)
        };
        let Some(other) = wiring.protocol.addresses().find(|board| !taken(board)) else {
            continue;
        };
        let ids = |fault: &str| -> BTreeSet<(u8, u32)> {
            let mut sim = Simulator::new(&scene(1, fault), &layout, 1).unwrap();
            sim.start_all();
            let mut frames = Vec::new();
            sim.advance(500_000_000, &mut frames);
            frames.iter().map(|(bus, f)| (*bus, f.frame.id())).collect()
        };
        let fault = format!(
            "[[fault]]\nkind = \"wrong-id\"\non = [\"{}\"]\nboard = {other}\n",
            module.name
        );
        let (own, wrong) = (ids(""), ids(&fault));
        assert!(!own.is_empty() && own.len() == wrong.len(), "{name}");
        assert_ne!(own, wrong, "{name}");
        kinds.insert(wiring.protocol.name());
    }
    assert!(kinds.len() >= 3, "{kinds:?}");
}

#[test]
fn a_module_of_four_by_six_sends_all_its_taxels_once_it_was_started() {
    let text = "name = \"tip\"\nbuses = [\"can0\"]\nimage = { width = 6, height = 4 }\n[[module]]\nname = \"m\"\npart = \"p\"\n\
                bus = \"can0\"\nboard = 1\nprotocol = \"uskin-l2\"\nat = [0, 0]\n\
                order = [[0, 1, 2, 3, 16, 17], [4, 5, 6, 7, 18, 19], [8, 9, 10, 11, 20, 21], [12, 13, 14, 15, 22, 23]]\n";
    let layout = taxel_skin::Layout::parse(text, "tip.toml").unwrap();
    let mut bench = Bench::new(&scene(2, ""), &layout);
    assert!(bench.until_ms(200).iter().all(|f| f.frame.data()[0] != 0x83));
    let start = taxel_can::CanFrame::standard(0x201, &[7, 0]).unwrap();
    bench.sim.command(0, &start, 200_000_000).unwrap();
    let frames = bench.until_ms(1_200).to_vec();
    // `0x100 | sda << 4 | chip`, chips 0 to 5; byte 7 is the line.
    for id in (0..4u32).flat_map(|sda| (0..6).map(move |chip| 0x100 | sda << 4 | chip)) {
        let of_id: Vec<_> = frames.iter().filter(|f| f.frame.id() == id).collect();
        assert!(of_id.len() >= 49, "{id:03X}: {}", of_id.len());
        assert!(
            of_id
                .iter()
                .all(|f| u32::from(f.frame.data()[7]) == (id >> 4 & 3) + 1)
        );
    }
    assert!(frames.iter().all(|f| f.frame.id() & 0x7C8 == 0x100));
}
