//! What comes from servos and from an Allegro hand.

use crate::boards::frames;
use std::sync::LazyLock;
use taxel_joints::protocol2::{FastBlocks, Parser};
use taxel_joints::{AllegroConfig, AllegroDecoder};

/// Bytes of a servo bus, in pieces whose sizes the first byte chooses: every byte is in a packet or
/// skipped, and packets lie within what came.
pub fn dynamixel_stream(data: &[u8]) {
    let Some((choice, mut rest)) = data.split_first() else {
        return;
    };
    let longest = 3 + 4 * usize::from(choice >> 4);
    let piece = 1 + usize::from(choice & 15);
    let mut parser = Parser::new(longest);
    let (mut taken, mut in_packets) = (0u64, 0u64);
    while !rest.is_empty() {
        let n = parser.push(&rest[..piece.min(rest.len())]);
        assert!(n > 0, "an emptied parser has room");
        (taken, rest) = (taken + n as u64, &rest[n..]);
        in_packets += drain(&mut parser, longest);
    }
    while parser.give_up() {
        in_packets += drain(&mut parser, longest);
    }
    // What may still become a header counts as skipped, too.
    parser.clear();
    assert_eq!(in_packets + parser.counters().skipped_bytes, taken);
    for asked in [0, 1, 12] {
        let blocks = FastBlocks::new(data, asked).into_iter().flatten();
        assert!(blocks.map(|block| block.data.len()).sum::<usize>() <= data.len());
    }
}

/// Reads all whole packets and returns their bytes.
fn drain(parser: &mut Parser, longest: usize) -> u64 {
    let mut bytes = 0;
    while let Some(packet) = parser.next_packet() {
        if let Ok(packet) = packet {
            assert!(packet.raw.len() <= longest + 7 && packet.parameters.len() <= packet.raw.len());
            bytes += packet.raw.len() as u64;
        }
    }
    bytes
}

/// Any frames to decoders of Allegro hands of every version: each frame in one count, and every
/// angle a number.
pub fn allegro_frames(data: &[u8]) {
    static HANDS: LazyLock<Vec<AllegroDecoder>> = LazyLock::new(|| {
        let hand = |version| AllegroDecoder::new(&AllegroConfig::new(version)).expect("a hand");
        vec![hand(1), hand(3), hand(4), hand(5)]
    });
    for hand in HANDS.iter() {
        let mut hand = hand.clone();
        let mut count = 0;
        for (t_ns, frame) in (0..).zip(frames(data)) {
            hand.push(&frame, t_ns);
            count += 1;
        }
        let counters = hand.counters();
        let read = counters.positions.iter().sum::<u64>() + hand.motor_errors().reports;
        assert_eq!(read + counters.malformed + counters.other, count);
        for joint in 0..17 {
            assert!(
                hand.joint(joint)
                    .is_none_or(|(rad, t_ns)| rad.is_finite() && t_ns < count)
            );
        }
    }
}
