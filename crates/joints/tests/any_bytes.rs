//! No frame on any bus makes an Allegro decoder panic, count a frame twice or say an angle that is none.

use proptest::prelude::*;
use taxel_can::CanFrame;
use taxel_joints::{AllegroConfig, AllegroDecoder};

/// Often one of the ids that a hand has.
fn any_frame() -> impl Strategy<Value = CanFrame> {
    let id = prop_oneof![4 => 0u32..0x800, 1 => any::<u32>(), 2 => 0x3C0u32..0x400, 2 => 0x80u32..0x90];
    let data = prop_oneof![
        2 => prop::collection::vec(any::<u8>(), 0..=8),
        1 => prop::collection::vec(any::<u8>(), 8),
    ];
    (id, data).prop_map(|(id, data)| CanFrame::from_raw(id, &data).unwrap())
}

proptest! {
    #[test]
    fn any_frame_is_in_one_count(
        version in 1u8..=4,
        direction in prop::sample::select(vec![-1i8, 1]),
        offset in -40_000i32..40_000,
        frames in prop::collection::vec(any_frame(), 0..200),
    ) {
        let mut config = AllegroConfig::new(version);
        config.enc_dir.fill(direction);
        config.enc_offset.fill(offset);
        prop_assume!(config.check().is_ok());
        let mut hand = AllegroDecoder::new(&config).unwrap();
        for (t_ns, frame) in (0..).zip(&frames) {
            hand.push(frame, t_ns);
        }
        let counters = hand.counters();
        let counted = counters.positions.iter().sum::<u64>() + counters.malformed + counters.other;
        prop_assert_eq!(counted, frames.len() as u64);
        for joint in 0..=16 {
            let said = hand.joint(joint);
            prop_assert!(said.is_none_or(|(rad, t_ns)| rad.is_finite() && t_ns < frames.len() as u64));
            prop_assert_eq!(said.is_some(), joint < 16 && counters.positions[joint / 4 % 4] > 0);
        }
    }
}
