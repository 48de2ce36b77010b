//! Whatever comes over the bus, every frame is in exactly one count, and every frame taken shows
//! the newest values.

use proptest::prelude::*;
use std::collections::HashSet;
use taxel_can::CanFrame;
use taxel_hand::{Freshness, TactileFrame};
use taxel_skin::{BoardStatus, Decoded, Decoder, Layout, Push, Readings, SweepAssembler, SweepConfig};

const MS: u64 = 1_000_000;
const START: u64 = 1_000 * MS;

/// Three boards of 16 taxels on one bus.
fn layout() -> Layout {
    let mut text = "name = \"t\"\nimage = { width = 12, height = 4 }\nbuses = [\"can0\"]\n".to_string();
    for b in [1, 2, 7] {
        text += &format!(
            "[[module]]\nname = \"m{b}\"\npart = \"p\"\nbus = \"can0\"\nboard = {b}\nprotocol = \"uskin-l2\"\nat = [{}, 0]\n",
            4 * [1, 2, 7].iter().position(|x| *x == b).unwrap()
        );
    }
    Layout::parse(&text, "t.toml").unwrap()
}

/// Anything a bus can carry, often enough something of this hand's.
fn any_frame() -> impl Strategy<Value = CanFrame> {
    let id = prop_oneof![
        8 => (prop::sample::select(vec![1u16, 2, 7]), 0u16..16).prop_map(|(b, k)| b << 8 | k >> 2 << 4 | k & 3),
        1 => 0u16..0x800,
        1 => (0u16..8).prop_map(|b| 0x705 | b << 4),
    ];
    let data = prop_oneof![
        8 => prop::collection::vec(any::<u8>(), 8),
        1 => prop::collection::vec(any::<u8>(), 0..8),
        1 => Just(vec![7, 0]),
    ];
    prop_oneof![
        20 => (id, data).prop_map(|(id, data)| CanFrame::standard(id, &data).unwrap()),
        1 => (0u32..0x800).prop_map(|id| CanFrame::extended(id, &[0; 8]).unwrap()),
        1 => (0u32..0x800).prop_map(|id| CanFrame::remote(id, false, 8).unwrap()),
        1 => any::<u32>().prop_map(|class| CanFrame::error(class, [0; 8])),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn every_frame_is_in_exactly_one_count(
        frames in prop::collection::vec((any_frame(), -2i64..5), 0..800),
        sweep_mode in any::<bool>(),
        settle_ms in prop::sample::select(vec![0.0, 20.0]),
        take_every in 1usize..100,
    ) {
        let layout = layout();
        let config = SweepConfig { settle_ms, ..SweepConfig::default() };
        let mut decoder = Decoder::new(&layout, 0);
        let mut assembler = SweepAssembler::new(&layout, &config, sweep_mode);
        let mut readings = Readings::new();
        let mut frame = TactileFrame::new(layout.len());
        let mut newest = vec![None; layout.len()];
        // Time mostly goes on, and sometimes back.
        let mut t_ns = START;
        for (i, (can_frame, step)) in frames.iter().enumerate() {
            t_ns = t_ns.saturating_add_signed(step * MS as i64 / 2);
            if decoder.decode(can_frame, &mut readings) == Decoded::Readings {
                for reading in readings.iter() {
                    if assembler.overtaken_by(reading, t_ns) {
                        prop_assert!(sweep_mode && !assembler.is_complete());
                        assembler.take(t_ns, &mut frame);
                    }
                    let push = assembler.push(reading, t_ns);
                    prop_assert_ne!(push, Push::NoSuchTaxel);
                    let value = &mut newest[reading.taxel as usize];
                    if push != Push::Settling && value.is_none_or(|(t, _)| t <= t_ns) {
                        *value = Some((t_ns, reading.counts));
                    }
                }
            }
            if i % take_every == 0 {
                assembler.take(t_ns, &mut frame);
                for (taxel, value) in newest.iter().enumerate() {
                    let shown = (frame.freshness[taxel] != Freshness::Missing).then_some(frame.counts[taxel]);
                    prop_assert_eq!(shown, value.map(|(_, counts)| counts));
                    if let Some((t, _)) = value {
                        prop_assert_eq!(frame.age_ns[taxel], frame.t_ns.saturating_sub(*t));
                    }
                }
            }
        }

        let bus = *decoder.counters();
        let boards: Vec<BoardStatus> = (0..3)
            .map(|board| BoardStatus::gather(board, &assembler, std::slice::from_ref(&decoder), None))
            .collect();
        let of_boards: u64 = boards.iter().map(BoardStatus::frames).sum();
        prop_assert_eq!(bus.frames, frames.len() as u64);
        prop_assert_eq!(of_boards + bus.unknown + bus.not_data + bus.commands, bus.frames);
        let read: u64 = boards.iter().map(|b| b.used + b.duplicate + b.late + b.settling).sum();
        prop_assert_eq!(read, bus.readings);
    }

    /// Sweeps in any order, with losses and repetitions, of three boards that each keep their own time.
    #[test]
    fn what_the_bus_lost_is_missed_and_what_it_repeated_is_a_duplicate(
        sweeps in prop::collection::vec(
            (Just((0..48u16).collect::<Vec<_>>()).prop_shuffle(), prop::collection::vec(0u8..20, 48)),
            1..20,
        ),
        board_period_ms in prop::sample::select(vec![Some(10.0), None]),
    ) {
        let layout = layout();
        let config = SweepConfig { settle_ms: 0.0, board_period_ms, ..SweepConfig::default() };
        let mut assembler = SweepAssembler::new(&layout, &config, true);
        let mut frame = TactileFrame::new(layout.len());
        // Two whole sweeps, to measure the period from.
        for before in [2, 1] {
            for taxel in 0..48 {
                let reading = taxel_skin::TaxelReading { taxel, counts: [0; 3], status: 0x82 };
                assembler.push(&reading, START - before * 10 * MS + taxel as u64 * 20_000);
            }
            assembler.take(START - before * 10 * MS + MS, &mut frame);
        }
        let (mut lost, mut repeated) = (0, 0);
        for (n, (order, fates)) in sweeps.iter().enumerate() {
            let start = START + n as u64 * 10 * MS;
            let mut came = HashSet::new();
            for (place, &taxel) in order.iter().enumerate() {
                // Fate 0 loses a reading, 1 repeats it. A board that is lost altogether would miss
                // nothing, since it had no sweep; the first taxel of each board always comes.
                let fate = if taxel % 16 == 0 { 2 } else { fates[taxel as usize] };
                let t_ns = start + place as u64 * 20_000;
                let reading = taxel_skin::TaxelReading { taxel, counts: [n as u16; 3], status: 0x82 };
                if fate == 0 {
                    lost += 1;
                    continue;
                }
                prop_assert_eq!(assembler.push(&reading, t_ns), Push::Used);
                came.insert(taxel as usize);
                if fate == 1 {
                    repeated += 1;
                    prop_assert_eq!(assembler.push(&reading, t_ns + 10_000), Push::Duplicate);
                }
            }
            let complete = assembler.is_complete();
            prop_assert!(!complete || came.len() == 48 || n >= 3, "only a taxel lost three times is not awaited");
            prop_assert!(complete || came.len() < 48);
            assembler.take(start + 9 * MS, &mut frame);
            for taxel in 0..48 {
                prop_assert_eq!(frame.freshness[taxel] == Freshness::Fresh, came.contains(&taxel));
            }
        }
        // One more reading of each board ends the last sweep.
        for taxel in [0, 16, 32] {
            let reading = taxel_skin::TaxelReading { taxel, counts: [0; 3], status: 0x82 };
            assembler.push(&reading, START + sweeps.len() as u64 * 10 * MS + MS);
        }
        let boards: Vec<BoardStatus> = (0..3).map(|board| assembler.board(board)).collect();
        prop_assert_eq!(boards.iter().map(|b| b.missed).sum::<u64>(), lost);
        prop_assert_eq!(boards.iter().map(|b| b.duplicate).sum::<u64>(), repeated);
        prop_assert!(boards.iter().all(|b| b.sweeps == sweeps.len() as u64 + 2 && b.late == 0));
    }
}
