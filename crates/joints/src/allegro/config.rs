//! Which Allegro hand it is: the table `[joints.allegro]`.

use crate::error::JointsConfigError;
use serde::{Deserialize, Serialize};
use taxel_hand::{WholeList, check_range};

/// Joints of the hand.
pub const ALLEGRO_JOINTS: usize = 16;
/// Its fingers, in the order of their joints, of which each has four.
pub const ALLEGRO_FINGERS: [&str; 4] = ["index", "middle", "ring", "thumb"];

/// Which Allegro hand it is.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct AllegroConfig {
    /// 1 to 5.
    pub version: u8,
    /// Versions 4 and 5: the hand's device id on the bus, 0 to 3.
    #[serde(default)]
    pub device: u8,
    /// Sign of each encoder, 1 or -1, as in the hand's `zero.yaml`.
    #[serde(default = "all_forward", deserialize_with = "WholeList::read")]
    pub enc_dir: [i8; ALLEGRO_JOINTS],
    /// Offset of each encoder, counts, as in the hand's `zero.yaml`. Versions 1 to 3 read wrong
    /// angles without it.
    #[serde(default, deserialize_with = "WholeList::read")]
    pub enc_offset: [i32; ALLEGRO_JOINTS],
    /// Whether no other program controls the hand, so that it has to be started. Without it nothing
    /// is ever sent.
    #[serde(default)]
    pub own_bus: bool,
}

fn all_forward() -> [i8; ALLEGRO_JOINTS] {
    [1; ALLEGRO_JOINTS]
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

    /// Whether the hand has the ids of version 4, with a device id in them; those before have others.
    pub fn has_ids_of_4(&self) -> bool {
        self.version >= 4
    }

    /// Refuses what cannot be.
    pub fn check(&self) -> Result<(), JointsConfigError> {
        if !(1..=5).contains(&self.version) {
            return Err(JointsConfigError::AllegroVersion(self.version));
        }
        let devices = if self.has_ids_of_4() { 3.0 } else { 0.0 };
        check_range(
            "joints.",
            "allegro.device",
            self.device,
            0.0..=devices,
            "with this version",
        )?;
        for (joint, value) in self.enc_dir.into_iter().enumerate() {
            if value != 1 && value != -1 {
                return Err(JointsConfigError::EncoderDirection { joint, value });
            }
        }
        for (joint, value) in self.enc_offset.into_iter().enumerate() {
            let key = format!("allegro.enc_offset[{joint}]");
            check_range("joints.", key, value, -131_072.0..=131_072.0, "counts")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
