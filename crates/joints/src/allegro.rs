//! The Allegro hand: sixteen joint angles from the position frames that it puts on its CAN bus.
//!
//! The hand is controlled by another program; this one listens. Frames are those of protocols.md 3.1 (versions 1 to 3)
//! and 3.2 (version 4). Joints are numbered `4 * finger + j`: index, middle, ring, thumb, from base to tip.

use crate::config::JointsConfigError;
use serde::Deserialize;
use std::f64::consts::PI;
use taxel_can::{CanFrame, IdFilter};
use taxel_skin::{Layout, Protocol};

/// Joints of the hand.
pub const ALLEGRO_JOINTS: usize = 16;
/// One count of the encoder, radians: 333.3 degrees in 65,536 counts.
const COUNT_RAD: f64 = 333.3 / 65_536.0 * (PI / 180.0);
const FINGERS: [&str; 4] = ["index", "middle", "ring", "thumb"];

/// QUERY_CONTROL_DATA of versions 1 to 3: a finger's position report.
const V3_POSITION: u16 = 0x0F;
/// FINGER_POSE_1 of version 4.
const V4_POSITION: u16 = 0x20;

/// Which Allegro hand it is.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AllegroConfig {
    /// 1 to 4.
    pub version: u8,
    /// Version 4: the hand's device id on the bus, 0 to 3.
    #[serde(default)]
    pub device: u8,
    /// Sign of each encoder, 1 or -1, as in the hand's `zero.yaml`.
    #[serde(default = "all_forward")]
    pub enc_dir: [i8; ALLEGRO_JOINTS],
    /// Offset of each encoder, counts, as in the hand's `zero.yaml`. Versions 1 to 3 read wrong angles without it.
    #[serde(default)]
    pub enc_offset: [i32; ALLEGRO_JOINTS],
    /// Whether no other program controls the hand, so that it has to be started. Without it nothing is ever sent.
    #[serde(default)]
    pub own_bus: bool,
}

fn all_forward() -> [i8; ALLEGRO_JOINTS] {
    [1; ALLEGRO_JOINTS]
}

/// Names of the joints: `index 0`, `index 1`, ..., `thumb 3`.
pub(crate) fn joint_names() -> Vec<String> {
    (0..ALLEGRO_JOINTS)
        .map(|j| format!("{} {}", FINGERS[j / 4], j % 4))
        .collect()
}

impl AllegroConfig {
    /// A hand of this version with encoders as they are, listened to only.
    pub fn new(version: u8) -> Self {
        Self {
            version,
            device: 0,
            enc_dir: all_forward(),
            enc_offset: [0; ALLEGRO_JOINTS],
            own_bus: false,
        }
    }

    /// What a CAN source has to let through for [`AllegroDecoder`].
    pub fn filter(&self) -> IdFilter {
        if self.version == 4 {
            // Four fingers, bits 2 and 3, of one device, bits 0 and 1.
            IdFilter::standard(V4_POSITION << 2 | u16::from(self.device), 0x7F3)
        } else {
            IdFilter::standard(V3_POSITION << 6, 0x7C0)
        }
    }

    /// Refuses what cannot be.
    pub fn check(&self) -> Result<(), JointsConfigError> {
        if !(1..=4).contains(&self.version) {
            return Err(JointsConfigError::AllegroVersion(self.version));
        }
        let range = |key: String, value: f64, low: f64, high: f64, unit| {
            if (low..=high).contains(&value) {
                return Ok(());
            }
            Err(JointsConfigError::Range {
                key,
                value,
                low,
                high,
                unit,
            })
        };
        let devices = if self.version == 4 { 3.0 } else { 0.0 };
        range(
            "allegro.device".into(),
            f64::from(self.device),
            0.0,
            devices,
            "with this version",
        )?;
        for (joint, value) in self.enc_dir.into_iter().enumerate() {
            if value != 1 && value != -1 {
                return Err(JointsConfigError::EncoderDirection { joint, value });
            }
        }
        for (joint, value) in self.enc_offset.into_iter().enumerate() {
            let key = format!("allegro.enc_offset[{joint}]");
            range(key, f64::from(value), -131_072.0, 131_072.0, "counts")?;
        }
        Ok(())
    }
}

/// What one CAN frame was to the decoder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AllegroFrame {
    /// A finger's four angles.
    Position {
        /// 0 index, 1 middle, 2 ring, 3 thumb.
        finger: usize,
    },
    /// A position frame whose length is not 8; its angles are not taken.
    Malformed {
        /// 0 index, 1 middle, 2 ring, 3 thumb.
        finger: usize,
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
    /// Position frames with a length other than 8.
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
            counters: AllegroCounters::default(),
        })
    }

    /// Takes one frame, received at `t_ns`.
    pub fn push(&mut self, frame: &CanFrame, t_ns: u64) -> AllegroFrame {
        let seen = self.finger_of(frame);
        match seen {
            AllegroFrame::Position { finger } => {
                for j in 0..4 {
                    let bytes = [frame.data()[2 * j], frame.data()[2 * j + 1]];
                    self.angles_rad[4 * finger + j] = self.angle_rad(4 * finger + j, bytes);
                }
                self.t_ns[finger] = Some(t_ns);
                self.counters.positions[finger] += 1;
            }
            AllegroFrame::Malformed { .. } => self.counters.malformed += 1,
            AllegroFrame::Other => self.counters.other += 1,
        }
        seen
    }

    /// Newest angle of a joint (0 to 15), radians, and when its frame came; `None` before the first.
    pub fn joint(&self, joint: usize) -> Option<(f64, u64)> {
        Some((*self.angles_rad.get(joint)?, self.t_ns[joint / 4]?))
    }

    /// What it has seen.
    pub fn counters(&self) -> &AllegroCounters {
        &self.counters
    }

    fn finger_of(&self, frame: &CanFrame) -> AllegroFrame {
        let Some(id) = frame.standard_id() else {
            return AllegroFrame::Other;
        };
        let finger = if self.config.version == 4 {
            let msg = (id >> 2).wrapping_sub(V4_POSITION);
            (id & 3 == u16::from(self.config.device) && msg < 4).then_some(usize::from(msg))
        } else {
            // The destination in bits 3 to 5 is documented nowhere, so it is not looked at.
            let from = (id & 7).wrapping_sub(3);
            (id >> 6 & 0x1F == V3_POSITION && from < 4).then_some(usize::from(from))
        };
        match finger {
            Some(finger) if frame.dlc() == 8 => AllegroFrame::Position { finger },
            Some(finger) => AllegroFrame::Malformed {
                finger,
                len: frame.dlc(),
            },
            None => AllegroFrame::Other,
        }
    }

    fn angle_rad(&self, joint: usize, bytes: [u8; 2]) -> f64 {
        let dir = f64::from(self.config.enc_dir[joint]);
        let offset = f64::from(self.config.enc_offset[joint]);
        if self.config.version == 4 {
            (f64::from(i16::from_le_bytes(bytes)) * dir - offset) * COUNT_RAD
        } else {
            (f64::from(u16::from_le_bytes(bytes)) * dir - 32_768.0 - offset) * COUNT_RAD
        }
    }
}

/// What has to be sent so that a hand without another controller reports its positions, in this order; nothing
/// unless `own_bus` is set.
///
/// For versions 1 to 3 it is the start of the public driver (protocols.md 3.1); no torque is sent. For version 4 the
/// reporting period is set and the hand switched on. Not tried on a hand.
pub fn start_commands(config: &AllegroConfig) -> Vec<CanFrame> {
    let frames: &[(u16, &[u8])] = match (config.own_bus, config.version) {
        (false, _) => &[],
        (true, 4) => &[(0x81 << 2, &[3, 0, 0, 0, 0, 0]), (0x40 << 2, &[])],
        (true, _) => &[
            (0x08A, &[]),
            (0x0CA, &[3]),
            (0x14A, &[]),
            (0x04A, &[]),
            (0x38A, &[]),
        ],
    };
    frames_of(config, frames)
}

/// What has to be sent at the end; nothing unless `own_bus` is set.
pub fn stop_commands(config: &AllegroConfig) -> Vec<CanFrame> {
    let frames: &[(u16, &[u8])] = match (config.own_bus, config.version) {
        (false, _) => &[],
        (true, 4) => &[(0x41 << 2, &[])],
        (true, _) => &[(0x08A, &[])],
    };
    frames_of(config, frames)
}

fn frames_of(config: &AllegroConfig, frames: &[(u16, &[u8])]) -> Vec<CanFrame> {
    let device = if config.version == 4 {
        u16::from(config.device & 3)
    } else {
        0
    };
    frames
        .iter()
        .filter_map(|(id, data)| CanFrame::standard(id | device, data).ok())
        .collect()
}

/// Whether a standard id belongs to this hand: what it sends, and what its controller sends to it.
fn is_hand_id(config: &AllegroConfig, id: u16) -> bool {
    if config.version == 4 {
        let known = matches!(id >> 2,
            0x20..=0x23 | 0x30 | 0x38..=0x3B | 0x40 | 0x41 | 0x60..=0x63 | 0x68 | 0x80 | 0x81 | 0x88 | 0xE0..=0xE3);
        known && id & 3 == u16::from(config.device)
    } else {
        let (cmd, dst, src) = (id >> 6, id >> 3 & 7, id & 7);
        let from_host = src == 2 && dst == 1 && (0x01..=0x11).contains(&cmd);
        let from_hand = (3..=6).contains(&src) && (0x0E..=0x15).contains(&cmd);
        from_host || from_hand
    }
}

/// The standard ids that both this hand and the skin's boards on bus `bus` (index into [`Layout::buses`]) use, in
/// order; empty if they may share the bus.
///
/// A board uses the ids of its taxels' frames and, if it is an MTB, the one by which it is started, `0x200 | board`;
/// CySkin's ids are extended and never overlap. Hand and skin are best on different buses (protocols.md 0, fact 10).
pub fn overlapping_ids(layout: &Layout, bus: u8, config: &AllegroConfig) -> Vec<u16> {
    let mut ids: Vec<u16> = (0..layout.len())
        .filter(|taxel| layout.wiring_of(*taxel).bus == bus)
        .flat_map(|taxel| {
            let wiring = layout.wiring_of(taxel);
            let frame = wiring.protocol.frame_id(wiring.board, layout.k[taxel]);
            let is_mtb = matches!(
                wiring.protocol,
                Protocol::UskinL1 | Protocol::UskinL2 | Protocol::IcubMtb3 | Protocol::IcubMtb4
            );
            [frame, is_mtb.then_some(0x200 | u16::from(wiring.board))]
        })
        .flatten()
        .filter(|id| is_hand_id(config, *id))
        .collect();
    ids.sort_unstable();
    ids.dedup();
    ids
}

#[cfg(test)]
mod tests {
    use super::*;

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
            (
                3,
                frame(0x3D3, &[0; 6]),
                AllegroFrame::Malformed { finger: 0, len: 6 },
            ),
            (4, frame(0x090, &[0; 8]), AllegroFrame::Other),
            (4, frame(0x081, &[0; 8]), AllegroFrame::Other),
            (4, frame(0x180, &[0; 8]), AllegroFrame::Other),
            (
                4,
                frame(0x08C, &[]),
                AllegroFrame::Malformed { finger: 3, len: 0 },
            ),
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
        for version in 1..=4 {
            let mut d = decoder(version);
            for id in 0..=0x7FF {
                for len in 0..=8 {
                    d.push(&frame(id, &[0xA5; 8][..len]), 1);
                }
            }
            let c = d.counters();
            assert_eq!(c.positions.iter().sum::<u64>() + c.malformed + c.other, 0x800 * 9);
        }
    }

    #[test]
    fn the_filter_lets_every_position_frame_through_and_nothing_of_another_hand() {
        for (version, device) in [(1, 0), (3, 0), (4, 0), (4, 3)] {
            let config = AllegroConfig {
                device,
                ..AllegroConfig::new(version)
            };
            let (d, filter) = (AllegroDecoder::new(&config).unwrap(), config.filter());
            for id in 0..=0x7FF {
                let f = frame(id, &[0; 8]);
                let passes = u32::from(id) & filter.mask & 0x7FF == filter.id & filter.mask & 0x7FF;
                let position = matches!(d.finger_of(&f), AllegroFrame::Position { .. });
                // Senders 3 to 6 are no range that a mask can name, so versions 1 to 3 let four more through.
                assert!(passes || !position, "version {version}: {id:03X}");
                assert!(version != 4 || passes == position, "version 4: {id:03X}");
            }
        }
    }

    #[test]
    fn nothing_is_sent_unless_the_bus_is_its_own() {
        for version in 1..=4 {
            let mut config = AllegroConfig::new(version);
            assert!(start_commands(&config).is_empty());
            assert!(stop_commands(&config).is_empty());
            config.own_bus = true;
            let ids: Vec<u32> = start_commands(&config).iter().map(CanFrame::id).collect();
            if version == 4 {
                assert_eq!(ids, [0x204, 0x100]);
            } else {
                assert_eq!(ids, [0x08A, 0x0CA, 0x14A, 0x04A, 0x38A]);
            }
        }
    }

    #[test]
    fn a_hand_and_a_skin_that_share_ids_are_told() {
        let layout = Layout::builtin("allegro-uskin-15").unwrap();
        for version in [3, 4] {
            let config = AllegroConfig::new(version);
            let ids = overlapping_ids(&layout, 0, &config);
            assert!(!ids.is_empty());
            assert!(ids.windows(2).all(|w| w[0] < w[1]));
            assert!(ids.iter().all(|id| is_hand_id(&config, *id)));
            // A bus the layout does not have carries nothing.
            assert!(overlapping_ids(&layout, 200, &config).is_empty());
        }
        // Version 4's set-period is the start command of board 4 (protocols.md 0, fact 10).
        assert!(overlapping_ids(&layout, 0, &AllegroConfig::new(4)).contains(&0x204));
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let mut config = AllegroConfig::new(4);
        config.device = 4;
        assert!(config.check().is_err());
        config = AllegroConfig::new(3);
        config.device = 1;
        assert!(config.check().is_err());
        config = AllegroConfig::new(3);
        config.enc_dir[7] = 0;
        assert!(config.check().unwrap_err().to_string().contains("enc_dir[7] = 0"));
    }
}
