//! Position frames of an Allegro hand into angles, and what it reports of its motors. Frames are those of the public drivers of
//! versions 1 to 3, of version 4 and of version 5.

use super::config::{ALLEGRO_JOINTS, AllegroConfig};
use super::ids::{V3_POSITION, V4_POSITION, V5_ERROR};
use super::motor_errors::MotorErrors;
use crate::error::JointsConfigError;
use std::f64::consts::PI;
use taxel_can::CanFrame;

/// One count of the encoder, radians: 333.3 degrees in 65,536 counts.
const COUNT_RAD: f64 = 333.3 / 65_536.0 * (PI / 180.0);

/// One count of version 5, radians: 0.088 degrees, 17 times as much.
const V5_COUNT_RAD: f64 = 0.088 * (PI / 180.0);

/// What one CAN frame was to the decoder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AllegroFrame {
    /// A finger's four angles.
    Position {
        /// 0 index, 1 middle, 2 ring, 3 thumb.
        finger: usize,
    },
    /// An error of a motor: its number and bits.
    Error,
    /// A position frame whose length is not 8, or an error of less than two bytes; nothing of it is taken.
    Malformed {
        /// Its data bytes.
        len: u8,
    },
    /// Anything else on the bus.
    Other,
}

/// What an Allegro decoder has seen.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct AllegroCounters {
    /// Position frames of each finger.
    pub positions: [u64; 4],
    /// Position frames with a length other than 8, and errors with less than two bytes.
    pub malformed: u64,
    /// All other frames.
    pub other: u64,
}

/// Turns position frames into angles. It keeps the newest of each finger, and cannot send.
#[derive(Debug, Clone)]
pub struct AllegroDecoder {
    config: AllegroConfig,
    angles_rad: [f64; ALLEGRO_JOINTS],
    t_ns: [Option<u64>; 4],
    motor_errors: MotorErrors,
    counters: AllegroCounters,
}

impl AllegroDecoder {
    /// A decoder for this hand.
    pub fn new(config: &AllegroConfig) -> Result<Self, JointsConfigError> {
        config.check()?;
        Ok(Self {
            config: config.clone(),
            angles_rad: [0.0; ALLEGRO_JOINTS],
            t_ns: [None; 4],
            motor_errors: MotorErrors::default(),
            counters: AllegroCounters::default(),
        })
    }

    /// Takes one frame, received at `t_ns`.
    pub fn push(&mut self, frame: &CanFrame, t_ns: u64) -> AllegroFrame {
        let seen = self.kind_of(frame);
        match seen {
            AllegroFrame::Position { finger } => {
                for j in 0..4 {
                    let bytes = [frame.data()[2 * j], frame.data()[2 * j + 1]];
                    self.angles_rad[4 * finger + j] = self.angle_rad(4 * finger + j, bytes);
                }
                self.t_ns[finger] = Some(t_ns);
                self.counters.positions[finger] += 1;
            }
            AllegroFrame::Error => self.motor_errors.push(frame.data()[0], frame.data()[1], t_ns),
            AllegroFrame::Malformed { .. } => self.counters.malformed += 1,
            AllegroFrame::Other => self.counters.other += 1,
        }
        seen
    }

    /// Newest angle of a joint (0 to 15), radians, and when its frame came; `None` before the first.
    pub fn joint(&self, joint: usize) -> Option<(f64, u64)> {
        Some((*self.angles_rad.get(joint)?, self.t_ns[joint / 4]?))
    }

    /// What the hand has reported of its motors.
    pub fn motor_errors(&self) -> &MotorErrors {
        &self.motor_errors
    }

    /// What it has seen.
    pub fn counters(&self) -> &AllegroCounters {
        &self.counters
    }

    fn kind_of(&self, frame: &CanFrame) -> AllegroFrame {
        let Some(id) = frame.standard_id() else {
            return AllegroFrame::Other;
        };
        let len = frame.dlc();
        if self.config.version == 5 && id == V5_ERROR << 2 | u16::from(self.config.device) {
            return match len {
                0 | 1 => AllegroFrame::Malformed { len },
                _ => AllegroFrame::Error,
            };
        }
        let finger = if self.config.has_ids_of_4() {
            let msg = (id >> 2).wrapping_sub(V4_POSITION);
            (id & 3 == u16::from(self.config.device) && msg < 4).then_some(usize::from(msg))
        } else {
            // The destination in bits 3 to 5 is documented nowhere, so it is not looked at.
            let from = (id & 7).wrapping_sub(3);
            (id >> 6 & 0x1F == V3_POSITION && from < 4).then_some(usize::from(from))
        };
        match finger {
            Some(finger) if len == 8 => AllegroFrame::Position { finger },
            Some(_) => AllegroFrame::Malformed { len },
            None => AllegroFrame::Other,
        }
    }

    fn angle_rad(&self, joint: usize, bytes: [u8; 2]) -> f64 {
        let dir = f64::from(self.config.enc_dir[joint]);
        let offset = f64::from(self.config.enc_offset[joint]);
        let signed = f64::from(i16::from_le_bytes(bytes)) * dir - offset;
        match self.config.version {
            5 => signed * V5_COUNT_RAD,
            4 => signed * COUNT_RAD,
            _ => (f64::from(u16::from_le_bytes(bytes)) * dir - 32_768.0 - offset) * COUNT_RAD,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MotorError;
    use taxel_can::IdFilter;

    fn frame(id: u16, data: &[u8]) -> CanFrame {
        CanFrame::standard(id, data).unwrap()
    }

    fn decoder(version: u8) -> AllegroDecoder {
        AllegroDecoder::new(&AllegroConfig::new(version)).unwrap()
    }

    #[test]
    fn version_4_angles_are_signed_and_little_endian() {
        let mut d = decoder(4);
        let data = [0x00, 0x00, 0xFF, 0xFF, 0x00, 0x40, 0x00, 0xC0];
        assert_eq!(
            d.push(&frame(0x084, &data), 77),
            AllegroFrame::Position { finger: 1 }
        );
        let quarter = (333.3_f64 / 4.0).to_radians();
        for (joint, rad) in [(4, 0.0), (5, -COUNT_RAD), (6, quarter), (7, -quarter)] {
            let (angle, t_ns) = d.joint(joint).unwrap();
            assert!((angle - rad).abs() < 1e-12, "joint {joint}: {angle}");
            assert_eq!(t_ns, 77);
        }
        assert_eq!(d.joint(0), None);
        assert_eq!(d.joint(16), None);
        assert_eq!(d.counters().positions, [0, 1, 0, 0]);
    }

    #[test]
    fn version_5_has_the_frames_of_4_with_counts_of_0_088_degrees() {
        let data = [0xE8, 0x03, 0x18, 0xFC, 0, 0, 1, 0];
        let angles = |version| {
            let mut d = decoder(version);
            assert_eq!(
                d.push(&frame(0x08C, &data), 1),
                AllegroFrame::Position { finger: 3 }
            );
            [12, 13, 14, 15].map(|joint| d.joint(joint).unwrap().0)
        };
        for (angle, degrees) in angles(5).into_iter().zip([88.0_f64, -88.0, 0.0, 0.088]) {
            assert!((angle - degrees.to_radians()).abs() < 1e-12, "{angle} {degrees}");
        }
        assert!(
            (angles(5)[0] / angles(4)[0] - 17.3).abs() < 0.01,
            "read as 4 they are 17.3 times too small"
        );
    }

    #[test]
    fn version_5_reports_errors_of_its_motors() {
        let of = |version, device| AllegroConfig {
            device,
            ..AllegroConfig::new(version)
        };
        for (config, id, data, seen) in [
            (of(5, 0), 0x3B8, &[3, 0x04][..], AllegroFrame::Error),
            (of(5, 2), 0x3BA, &[3, 0x04, 0, 0], AllegroFrame::Error),
            (of(5, 0), 0x3B8, &[3], AllegroFrame::Malformed { len: 1 }),
            (of(5, 2), 0x3B8, &[3, 0x04], AllegroFrame::Other),
            (of(4, 0), 0x3B8, &[3, 0x04], AllegroFrame::Other),
        ] {
            let mut d = AllegroDecoder::new(&config).unwrap();
            assert_eq!(d.push(&frame(id, data), 7), seen, "{id:03X}");
            let current: Vec<_> = d.motor_errors().current(8).collect();
            let error = MotorError {
                motor: 3,
                bits: 0x04,
                heard_ns: 7,
            };
            let wanted = (seen == AllegroFrame::Error).then_some(error);
            assert_eq!(current, wanted.as_slice(), "{id:03X}");
        }
    }

    #[test]
    fn versions_1_to_3_use_the_hand_s_own_offsets_and_signs() {
        let mut config = AllegroConfig::new(3);
        config.enc_dir[8] = -1;
        config.enc_offset[8] = -65_536;
        config.enc_offset[9] = 100;
        let mut d = AllegroDecoder::new(&config).unwrap();
        // Centre, centre, smallest and largest of the ring finger (src 5), to any destination.
        for (t_ns, dst) in (0..8).enumerate() {
            let id = 0x3C0 | dst << 3 | 5;
            let data = [0x00, 0x80, 0x00, 0x80, 0x00, 0x00, 0xFF, 0xFF];
            assert_eq!(
                d.push(&frame(id, &data), t_ns as u64),
                AllegroFrame::Position { finger: 2 }
            );
        }
        for (joint, counts) in [(8, 0.0), (9, -100.0), (10, -32_768.0), (11, 32_767.0)] {
            let (angle, t_ns) = d.joint(joint).unwrap();
            assert!(
                (angle - counts * COUNT_RAD).abs() < 1e-12,
                "joint {joint}: {angle}"
            );
            assert_eq!(t_ns, 7);
        }
    }

    #[test]
    fn other_frames_and_odd_lengths_are_counted_and_change_nothing() {
        let cases = [
            (3, frame(0x3D2, &[0; 8]), AllegroFrame::Other),
            (3, frame(0x3D7, &[0; 8]), AllegroFrame::Other),
            (3, frame(0x20A, &[0; 8]), AllegroFrame::Other),
            (3, frame(0x3D3, &[0; 6]), AllegroFrame::Malformed { len: 6 }),
            (4, frame(0x090, &[0; 8]), AllegroFrame::Other),
            (4, frame(0x081, &[0; 8]), AllegroFrame::Other),
            (4, frame(0x180, &[0; 8]), AllegroFrame::Other),
            (4, frame(0x08C, &[]), AllegroFrame::Malformed { len: 0 }),
            (
                4,
                CanFrame::extended(0x080, &[0; 8]).unwrap(),
                AllegroFrame::Other,
            ),
            (4, CanFrame::remote(0x080, false, 8).unwrap(), AllegroFrame::Other),
        ];
        for (version, f, seen) in cases {
            let mut d = decoder(version);
            assert_eq!(d.push(&f, 1), seen, "{f}");
            assert!((0..16).all(|j| d.joint(j).is_none()));
        }
    }

    #[test]
    fn every_id_and_length_is_decoded_or_counted_without_panic() {
        for version in 1..=5 {
            let mut d = decoder(version);
            for id in 0..=0x7FF {
                for len in 0..=8 {
                    d.push(&frame(id, &[0xA5; 8][..len]), 1);
                }
            }
            let c = d.counters();
            let read = c.positions.iter().sum::<u64>() + d.motor_errors().reports;
            assert_eq!(read + c.malformed + c.other, 0x800 * 9, "version {version}");
        }
    }

    #[test]
    fn the_filters_let_everything_through_that_is_read_and_nothing_of_another_hand() {
        for (version, device) in [(1, 0), (3, 0), (4, 0), (4, 3), (5, 0), (5, 2)] {
            let config = AllegroConfig {
                device,
                ..AllegroConfig::new(version)
            };
            let (d, filters) = (AllegroDecoder::new(&config).unwrap(), config.filters());
            for id in 0..=0x7FF {
                let f = frame(id, &[0; 8]);
                let matches = |filter: &IdFilter| (u32::from(id) ^ filter.id) & filter.mask & 0x7FF == 0;
                let passes = filters.iter().any(matches);
                let is_read = d.kind_of(&f) != AllegroFrame::Other;
                // Senders 3 to 6 are no range that a mask can name, so versions 1 to 3 let four more through.
                assert!(passes || !is_read, "version {version}: {id:03X}");
                assert!(version < 4 || passes == is_read, "version {version}: {id:03X}");
            }
        }
    }
}
