//! Packets written, cut up, damaged and buried in noise come back out, or are counted.

use proptest::prelude::*;
use taxel_joints::protocol2::{Assignment, Encoder, Instruction, Packet, Parser};

/// Everything a parser gives for these bytes, pushed in pieces of these sizes: id, instruction, parameters.
fn parsed(parser: &mut Parser, bytes: &[u8], pieces: &[usize]) -> Vec<(u8, u8, Vec<u8>)> {
    let mut found = Vec::new();
    let mut rest = bytes;
    let mut sizes = pieces.iter().copied().cycle();
    while !rest.is_empty() {
        let piece = sizes.next().unwrap_or(1).clamp(1, rest.len());
        let taken = parser.push(&rest[..piece]);
        assert!(taken > 0, "an emptied parser has room");
        rest = &rest[taken..];
        drain(parser, &mut found);
    }
    found
}

fn drain(parser: &mut Parser, found: &mut Vec<(u8, u8, Vec<u8>)>) {
    while let Some(result) = parser.next_packet() {
        if let Ok(Packet {
            id,
            instruction,
            parameters,
            ..
        }) = result
        {
            found.push((id, instruction, parameters.to_vec()));
        }
    }
}

/// Bytes in which the header's pattern is frequent.
fn nasty_bytes(longest: usize) -> impl Strategy<Value = Vec<u8>> {
    let byte = prop_oneof![
        4 => Just(0xFF_u8),
        3 => Just(0xFD),
        2 => Just(0x00),
        1 => Just(0x55),
        3 => any::<u8>()
    ];
    prop::collection::vec(byte, 0..longest)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn what_is_written_is_read_however_it_is_cut(
        packets in prop::collection::vec((0..=252_u8, nasty_bytes(60)), 1..6),
        pieces in prop::collection::vec(1..20_usize, 1..8),
    ) {
        let mut encoder = Encoder::default();
        let mut bytes = Vec::new();
        for (id, parameters) in &packets {
            bytes.extend_from_slice(
                encoder.packet(*id, Instruction::Status, parameters.iter().copied()).unwrap(),
            );
        }
        let mut parser = Parser::new(128);
        let found = parsed(&mut parser, &bytes, &pieces);
        let sent: Vec<_> = packets.into_iter().map(|(id, p)| (id, 0x55, p)).collect();
        prop_assert_eq!(found, sent);
        prop_assert_eq!(parser.counters().skipped_bytes, 0);
    }

    #[test]
    fn noise_before_a_packet_costs_nothing_but_itself(noise in nasty_bytes(200), pieces in prop::collection::vec(1..50_usize, 1..5)) {
        let mut encoder = Encoder::default();
        let packet = encoder.status(7, 0, &[1, 2, 3]).unwrap().to_vec();
        let mut parser = Parser::new(64);
        let mut found = parsed(&mut parser, &[noise.clone(), packet.clone()].concat(), &pieces);
        while parser.give_up() {
            drain(&mut parser, &mut found);
        }
        // A false header may just fit over the true one with a CRC that happens to be right, once in 65,536.
        prop_assert!(found.contains(&(7, 0x55, vec![0, 1, 2, 3])), "noise {noise:x?}");
    }

    #[test]
    fn random_bytes_never_panic_and_memory_stays_bounded(
        bytes in nasty_bytes(4000),
        longest in 0..600_usize,
        pieces in prop::collection::vec(1..700_usize, 1..5),
    ) {
        let mut parser = Parser::new(longest);
        let room = parser.space().len();
        let found = parsed(&mut parser, &bytes, &pieces);
        prop_assert!(found.iter().map(|f| f.2.len()).sum::<usize>() <= bytes.len());
        prop_assert!(parser.space().len() <= room);
        let counters = parser.counters();
        prop_assert!(counters.skipped_bytes <= bytes.len() as u64);
        while parser.give_up() {
            drain(&mut parser, &mut Vec::new());
        }
        parser.clear();
        prop_assert_eq!(parser.space().len(), room);
    }

    #[test]
    fn one_damaged_byte_costs_one_packet(at in 0..45_usize, bit in 0..8_u32) {
        let mut encoder = Encoder::default();
        let packets: Vec<Vec<u8>> = (1..=3)
            .map(|id| encoder.status(id, 0, &[id; 4]).unwrap().to_vec())
            .collect();
        let mut bytes = packets.concat();
        prop_assert_eq!(bytes.len(), 45);
        bytes[at] ^= 1 << bit;
        let mut parser = Parser::new(64);
        let mut found = parsed(&mut parser, &bytes, &[5]);
        while parser.give_up() {
            drain(&mut parser, &mut found);
        }
        let hit = 1 + (at / 15) as u8;
        let ids: Vec<u8> = found.iter().map(|f| f.0).collect();
        let others: Vec<u8> = (1..=3).filter(|id| *id != hit).collect();
        prop_assert_eq!(ids, others);
    }
}

#[test]
fn a_packet_that_broke_off_does_not_swallow_the_next() {
    let mut encoder = Encoder::default();
    let long = encoder.status(1, 0, &[7; 40]).unwrap().to_vec();
    let short = encoder.status(2, 0, &[]).unwrap().to_vec();
    for cut in 1..long.len() {
        let mut parser = Parser::new(64);
        let mut found = parsed(&mut parser, &[&long[..cut], &short[..]].concat(), &[3]);
        while parser.give_up() {
            drain(&mut parser, &mut found);
        }
        assert_eq!(found, [(2, 0x55, vec![0])], "cut at {cut}");
    }
}

#[test]
fn a_length_over_the_bound_is_noise_at_once() {
    let mut parser = Parser::new(20);
    let mut encoder = Encoder::default();
    let good = encoder.status(1, 0, &[1]).unwrap().to_vec();
    let bytes = [&[0xFF, 0xFF, 0xFD, 0x00, 0x01, 21, 0, 0x55], &good[..]].concat();
    assert_eq!(parsed(&mut parser, &bytes, &[1]).len(), 1);
    assert_eq!(parser.counters().bad_crc, 0);
    assert_eq!(parser.counters().skipped_bytes, 8);
}

#[test]
fn a_damaged_packet_names_the_servo_it_claims() {
    let mut encoder = Encoder::default();
    let mut packet = encoder.status(9, 0, &[1, 2]).unwrap().to_vec();
    packet[9] ^= 1;
    let mut parser = Parser::new(20);
    assert_eq!(parser.push(&packet), packet.len());
    let bad = parser.next_packet().unwrap().unwrap_err();
    assert_eq!((bad.id, bad.raw), (9, &packet[..]));
    assert!(parser.next_packet().is_none());
}

#[test]
fn a_device_reads_what_a_host_writes() {
    let mut e = Encoder::default();
    let mut bytes = e
        .packet(0xFE, Instruction::BulkRead, [1, 144, 0, 2, 0, 2, 0xFF, 1, 1, 0])
        .unwrap()
        .to_vec();
    let rows = [
        Assignment { id: 3, data: &[1, 2] },
        Assignment { id: 4, data: &[3, 4] },
    ];
    bytes.extend_from_slice(e.sync_write(100, &rows).unwrap());
    bytes.extend_from_slice(e.fast_sync_read(124, 12, &[5, 6]).unwrap());
    let found = parsed(&mut Parser::new(64), &bytes, &[4]);
    assert_eq!(
        found,
        [
            (0xFE, 0x92, vec![1, 144, 0, 2, 0, 2, 0xFF, 1, 1, 0]),
            (0xFE, 0x83, vec![100, 0, 2, 0, 3, 1, 2, 4, 3, 4]),
            (0xFE, 0x8A, vec![124, 0, 12, 0, 5, 6]),
        ]
    );
}
