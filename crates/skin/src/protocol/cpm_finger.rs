//! The published finger with CySkin-type sensors (protocols.md 5.3): four standard frames of four values, no command.

use crate::TaxelReading;
use taxel_can::CanFrame;

/// Channel of each value in the order in which the four frames carry them.
const CHANNELS: [u8; 16] = [11, 15, 14, 12, 9, 13, 8, 10, 6, 7, 4, 5, 2, 0, 3, 1];
/// Id of the frame with both proximity values.
pub(crate) const PROXIMITY_ID: u16 = 0x601;
/// Auxiliary channel of the first proximity value.
pub(crate) const PROXIMITY: u8 = 16;

/// Id of the frame that carries a channel: 0x405, 0x407, 0x409 or 0x40B.
pub(crate) const fn id(channel: u8) -> u16 {
    let mut place = 0;
    while place < 15 && CHANNELS[place as usize] != channel {
        place += 1;
    }
    0x405 + 2 * (place / 4)
}

/// Gives the values of a frame to `push`; `taxels` are the layout's taxels by channel.
#[inline]
pub(crate) fn hear(id: u16, data: &[u8; 8], taxels: &[u16; 16], mut push: impl FnMut(TaxelReading)) {
    let first = (id.wrapping_sub(0x405) / 2 * 4) as usize & 12;
    for (i, bytes) in data.chunks_exact(2).enumerate() {
        let taxel = taxels[CHANNELS[first + i] as usize];
        if taxel != u16::MAX {
            push(TaxelReading {
                taxel,
                counts: [0, 0, u16::from_le_bytes([bytes[0], bytes[1]])],
                status: 0,
            });
        }
    }
}

/// The five frames of one sweep of the finger, as it sends them: 16 values by channel, two of proximity. For simulators
/// and tests.
pub fn cpm_finger_frames(values: [u16; 16], proximity: [u16; 2]) -> [CanFrame; 5] {
    let frame = |id: u16, values: &[u16]| {
        let mut data = [0; 8];
        for (bytes, value) in data.chunks_exact_mut(2).zip(values) {
            bytes.copy_from_slice(&value.to_le_bytes());
        }
        CanFrame::standard(id, &data[..2 * values.len()]).expect("11 bits and up to eight bytes make a frame")
    };
    let of = |i: usize| {
        let channels: [u8; 4] = std::array::from_fn(|j| CHANNELS[4 * i + j]);
        frame(0x405 + 2 * i as u16, &channels.map(|c| values[c as usize]))
    };
    [of(0), of(1), of(2), of(3), frame(PROXIMITY_ID, &proximity)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_of_a_sweep_carry_every_channel_back() {
        let values: [u16; 16] = std::array::from_fn(|c| 1000 + 17 * c as u16);
        let taxels: [u16; 16] = std::array::from_fn(|c| c as u16);
        let mut back = [0; 16];
        let frames = cpm_finger_frames(values, [3, 0x0405]);
        for frame in &frames[..4] {
            let id = frame.standard_id().expect("11 bits");
            hear(id, frame.data().try_into().expect("eight bytes"), &taxels, |r| {
                back[r.taxel as usize] = r.counts[2];
            });
        }
        assert_eq!(back, values);
        assert_eq!(frames[4].to_string(), "601#03000504");
    }

    #[test]
    fn every_channel_is_in_one_of_the_four_frames() {
        let mut seen = [0; 16];
        for channel in 0..16 {
            assert!([0x405, 0x407, 0x409, 0x40B].contains(&id(channel)), "{channel}");
        }
        for channel in CHANNELS {
            seen[channel as usize] += 1;
        }
        assert_eq!(seen, [1; 16]);
        assert_eq!(
            [id(11), id(12), id(9), id(10), id(6), id(1)],
            [0x405, 0x405, 0x407, 0x407, 0x409, 0x40B]
        );
    }
}
