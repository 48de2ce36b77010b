//! Frames and packets per second through the decoders of joint angles, from memory.
//!
//! `cargo bench -p taxel-joints --bench decoders`; the goal is 5 million per second on one core,
//! for each. An Allegro frame carries four angles. A Dynamixel packet is a servo's answer to a sync
//! read of 12 bytes, found in a stream of bytes, its CRC checked; a bus of 4.5 Mbit/s carries
//! 20,000 of them per second.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use taxel_can::CanFrame;
use taxel_joints::protocol2::{Encoder, Parser};
use taxel_joints::{AllegroConfig, AllegroDecoder, AllegroFrame};

fn main() {
    divan::main();
}

const ITEMS: usize = 24_000;

#[divan::bench(args = [1, 2, 3, 4])]
fn allegro(bencher: Bencher<'_, '_>, version: u8) {
    let id = |finger: u16| match version {
        4 => 0x080 + 4 * finger,
        _ => 0x3C0 | 2 << 3 | (3 + finger),
    };
    let frames: Vec<CanFrame> = (0..ITEMS as u16)
        .map(|n| {
            let count = (n % 4001).to_le_bytes();
            let data = [count[0], count[1], 0, 1, 0, 2, 0, 3];
            CanFrame::standard(id(n % 4), &data).expect("eight bytes")
        })
        .collect();
    let mut decoder = AllegroDecoder::new(&AllegroConfig::new(version)).expect("a version");
    bencher.counter(ItemsCount::new(ITEMS)).bench_local(|| {
        for (t_ns, frame) in (0..).zip(&frames) {
            let what = decoder.push(frame, t_ns);
            debug_assert!(matches!(what, AllegroFrame::Position { .. }));
            black_box(what);
        }
        black_box(decoder.joint(0));
    });
    let positions: u64 = decoder.counters().positions.iter().sum();
    assert!(
        positions > 0 && positions.is_multiple_of(ITEMS as u64),
        "every frame was understood"
    );
}

#[divan::bench]
fn dynamixel(bencher: Bencher<'_, '_>) {
    let mut encoder = Encoder::with_capacity(64);
    let stream: Vec<u8> = (0..ITEMS as u32)
        .flat_map(|n| {
            let position = n.to_le_bytes();
            let data = [0, 0, 7, 0, 0, 0, 0, 0, position[0], position[1], 0, 0];
            encoder
                .status((n % 16 + 1) as u8, 0, &data)
                .expect("twelve bytes")
                .to_vec()
        })
        .collect();
    let mut parser = Parser::new(64);
    bencher.counter(ItemsCount::new(ITEMS)).bench_local(|| {
        let (mut left, mut packets) = (stream.as_slice(), 0);
        while !left.is_empty() {
            left = &left[parser.push(left)..];
            while let Some(packet) = parser.next_packet() {
                packets += usize::from(black_box(packet).is_ok());
            }
        }
        assert_eq!(packets, ITEMS, "every packet was understood");
    });
}
