//! The frames of the published finger: four of four values, and one of two proximity values.

use crate::protocol::board_decoder::{BoardDecoder, BoardFrame, NOBODY};
use crate::protocol::wired_board::WiredBoard;
use crate::reading::{Readings, TaxelReading};
use taxel_can::CanFrame;

/// Channel of each value in the order in which the four frames carry them.
const CHANNELS: [u8; 16] = [11, 15, 14, 12, 9, 13, 8, 10, 6, 7, 4, 5, 2, 0, 3, 1];
/// Ids of the frames with taxels.
pub(super) const IDS: [u16; 4] = [0x405, 0x407, 0x409, 0x40B];
/// Id of the frame with both proximity values.
pub(super) const PROXIMITY_ID: u16 = 0x601;
/// Auxiliary channel of the first proximity value.
const PROXIMITY: u8 = 16;

/// Id of the frame that carries a channel.
pub(super) fn id(channel: u8) -> u16 {
    let place = CHANNELS.iter().position(|c| *c == channel);
    IDS[place.unwrap_or(15) / 4]
}

/// One finger: its taxels, and its newest proximity values.
#[derive(Debug, Clone)]
pub(crate) struct Finger {
    /// Taxel of each channel.
    taxels: [u16; 16],
    proximity: Option<[u16; 2]>,
}

impl Finger {
    pub(super) fn new(board: &WiredBoard<'_>) -> Self {
        let mut taxels = [NOBODY; 16];
        for (k, taxel) in board.taxels() {
            taxels[usize::from(k & 15)] = taxel;
        }
        Self {
            taxels,
            proximity: None,
        }
    }
}

impl BoardDecoder for Finger {
    #[inline]
    fn decode(&mut self, id: u16, data: &[u8], readings: &mut Readings) -> BoardFrame {
        if id == PROXIMITY_ID {
            let [a, b, c, d, ..] = *data else {
                return BoardFrame::Malformed;
            };
            self.proximity = Some([u16::from_le_bytes([a, b]), u16::from_le_bytes([c, d])]);
            return BoardFrame::Readings;
        }
        let Ok(data) = <&[u8; 8]>::try_from(data) else {
            return BoardFrame::Malformed;
        };
        let first = (id.wrapping_sub(IDS[0]) / 2 * 4) as usize & 12;
        for (i, bytes) in data.chunks_exact(2).enumerate() {
            let taxel = self.taxels[CHANNELS[first + i] as usize];
            if taxel != NOBODY {
                readings.push(TaxelReading {
                    taxel,
                    counts: [0, 0, u16::from_le_bytes([bytes[0], bytes[1]])],
                    status: 0,
                });
            }
        }
        BoardFrame::Readings
    }

    /// The proximity values, 16 and 17.
    fn auxiliary(&self, channel: u8) -> Option<u16> {
        let place = channel.checked_sub(PROXIMITY)?;
        self.proximity?.get(usize::from(place)).copied()
    }
}

/// The five frames of one sweep of the finger, as it sends them: 16 values by channel, two of
/// proximity. For simulators and tests.
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
        frame(IDS[i], &channels.map(|c| values[c as usize]))
    };
    [of(0), of(1), of(2), of(3), frame(PROXIMITY_ID, &proximity)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_of_a_sweep_carry_every_channel_back() {
        let values: [u16; 16] = std::array::from_fn(|c| 1000 + 17 * c as u16);
        let mut finger = Finger {
            taxels: std::array::from_fn(|c| c as u16),
            proximity: None,
        };
        let mut back = [0; 16];
        let mut readings = Readings::new();
        let frames = cpm_finger_frames(values, [3, 0x0405]);
        for frame in &frames {
            let id = frame.standard_id().expect("11 bits");
            readings.clear();
            assert_eq!(
                finger.decode(id, frame.data(), &mut readings),
                BoardFrame::Readings
            );
            for r in readings.iter() {
                back[r.taxel as usize] = r.counts[2];
            }
        }
        assert_eq!(back, values);
        assert_eq!(
            [16, 17, 15].map(|c| finger.auxiliary(c)),
            [Some(3), Some(0x0405), None]
        );
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
