//! An Allegro hand as a source of joint angles.

use super::config::{ALLEGRO_FINGERS, ALLEGRO_JOINTS, AllegroConfig};
use super::decoder::{AllegroDecoder, AllegroFrame};
use super::ids::overlapping_ids;
use super::starter::AllegroStarter;
use crate::error::{JointSourceError, JointsConfigError};
use crate::source::{CanJoints, JointReadings, SourceConfig};
use taxel_can::{CanFrame, IdFilter, Received, SourceAddress};
use taxel_skin::Layout;

/// Readings kept per joint: a fifth of a second at 333 Hz.
const READINGS_KEPT: usize = 64;

/// An Allegro hand and its bus.
#[derive(Debug, Clone, PartialEq)]
pub struct AllegroSource {
    /// The bus: one of the skin's, or its own.
    pub bus: SourceAddress,
    /// Which hand it is; `None` where that is not said, and no angles can be read.
    pub hand: Option<AllegroConfig>,
}

impl AllegroSource {
    /// What stands behind `allegro:`.
    pub(crate) fn at(bus: &str) -> Result<Self, JointSourceError> {
        let bus = match bus.contains(':') {
            true => bus.parse()?,
            false => format!("can:{bus}").parse()?,
        };
        Ok(Self { bus, hand: None })
    }

    fn known_hand(&self) -> Result<&AllegroConfig, JointsConfigError> {
        self.hand.as_ref().ok_or(JointsConfigError::NoAllegro)
    }
}

impl SourceConfig for AllegroSource {
    fn device(&self) -> &'static str {
        "Allegro hand"
    }

    fn check(&self) -> Result<(), JointsConfigError> {
        self.known_hand()?.check()
    }

    fn joint_names(&self) -> Vec<String> {
        (0..ALLEGRO_JOINTS)
            .map(|j| format!("{} {}", ALLEGRO_FINGERS[j / 4], j % 4))
            .collect()
    }

    fn readings_kept(&self) -> usize {
        READINGS_KEPT
    }

    fn can_bus(&self) -> Option<&SourceAddress> {
        Some(&self.bus)
    }

    fn filters(&self) -> Vec<IdFilter> {
        self.hand.as_ref().map_or_else(Vec::new, AllegroConfig::filters)
    }

    fn overlapping_ids(&self, layout: &Layout, bus: u8) -> Vec<u16> {
        let hand = self.hand.as_ref();
        hand.map_or_else(Vec::new, |hand| overlapping_ids(layout, bus, hand))
    }

    fn can_joints(&self) -> Result<Option<Box<dyn CanJoints>>, JointsConfigError> {
        let hand = self.known_hand()?;
        Ok(Some(Box::new(AllegroJoints {
            decoder: AllegroDecoder::new(hand)?,
            starter: AllegroStarter::new(hand),
        })))
    }
}

/// A hand's frames into readings, and what the hand is sent.
struct AllegroJoints {
    decoder: AllegroDecoder,
    starter: AllegroStarter,
}

impl CanJoints for AllegroJoints {
    fn handle_frame(&mut self, received: &Received, readings: &mut JointReadings) -> bool {
        match self.decoder.push(&received.frame, received.t_ns) {
            AllegroFrame::Position { finger } => {
                self.starter.heard(received.t_ns);
                for joint in 4 * finger..4 * finger + 4 {
                    if let Some((angle_rad, t_ns)) = self.decoder.joint(joint) {
                        readings.push(joint, t_ns, angle_rad);
                    }
                }
                true
            }
            AllegroFrame::Error => {
                readings.motor_errors = *self.decoder.motor_errors();
                true
            }
            AllegroFrame::Malformed { .. } => {
                readings.malformed += 1;
                true
            }
            AllegroFrame::Other => false,
        }
    }

    fn handle_link(&mut self, is_up: bool) {
        self.starter.handle_link(is_up);
    }

    fn poll_command(&mut self, now_ns: u64) -> Option<CanFrame> {
        self.starter.poll_command(now_ns)
    }

    fn command_not_sent(&mut self) {
        self.starter.command_not_sent();
    }

    fn poll_due_ns(&self) -> Option<u64> {
        self.starter.poll_due_ns()
    }

    fn stop(&mut self) {
        self.starter.stop();
    }
}
