//! The table `[joints.analogue]`.

use crate::error::JointsConfigError;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use taxel_hand::{FromMap, WholeList, check_range};

/// Readings kept per joint: a third of a second at 100 lines a second.
pub(crate) const READINGS_KEPT: usize = 32;

/// Potentiometers that a microcontroller reads and prints, beside another source of angles: `[joints]` needs its `source`
/// all the same, and potentiometers alone are refused.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct AnalogueConfig {
    /// The serial device. A name under `/dev/serial/by-id` stays the same when it is unplugged and comes back.
    pub device: PathBuf,
    /// Bits per second, 9600 to 10,000,000.
    #[serde(default = "default_baud")]
    pub baud: u32,
    /// What the converter gives at its two ends, counts. A count at an end or beyond is no angle: it is what a wire that is
    /// off gives.
    #[serde(default = "default_ends", deserialize_with = "WholeList::read")]
    pub ends: [f64; 2],
    /// The joints, in the order in which their angles are given, behind those of the other source.
    #[serde(deserialize_with = "FromMap::list")]
    pub joint: Vec<AnalogueJointConfig>,
}

/// One joint with a potentiometer.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct AnalogueJointConfig {
    /// The joint's name.
    pub name: String,
    /// Where its counts are in a line: a place from 0, or the name in front of them.
    pub channel: Channel,
    /// Two counts for which the angle is known; they differ.
    #[serde(deserialize_with = "WholeList::read")]
    pub counts: [f64; 2],
    /// The angles there, degrees.
    #[serde(deserialize_with = "WholeList::read")]
    pub degrees: [f64; 2],
}

/// Which number of a line.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, Serialize)]
#[serde(untagged)]
pub enum Channel {
    /// The n-th, from 0.
    Place(u8),
    /// The one behind this name.
    Name(String),
}

impl std::fmt::Display for Channel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Channel::Place(place) => write!(f, "{place}"),
            Channel::Name(name) => f.write_str(name),
        }
    }
}

fn default_baud() -> u32 {
    115_200
}

fn default_ends() -> [f64; 2] {
    [0.0, 1023.0]
}

impl AnalogueJointConfig {
    /// The angle at this count, radians.
    pub fn angle_rad(&self, counts: f64) -> f64 {
        let [low, high] = self.counts;
        let [at_low, at_high] = self.degrees;
        (at_low + (counts - low) / (high - low) * (at_high - at_low)).to_radians()
    }
}

impl AnalogueConfig {
    /// Refuses what cannot be.
    pub fn check(&self) -> Result<(), JointsConfigError> {
        check_range("joints.analogue.", "baud", self.baud, 9600.0..=1e7, "bit/s")?;
        if self.joint.is_empty() {
            return Err(JointsConfigError::NoPotentiometer);
        }
        let [low, high] = self.ends;
        if !(low.is_finite() && high.is_finite() && low < high) {
            return Err(JointsConfigError::ConverterEnds { low, high });
        }
        for (i, joint) in self.joint.iter().enumerate() {
            let key = |name: &str| format!("joint[{i}].{name}");
            for n in 0..2 {
                let counts = key(&format!("counts[{n}]"));
                check_range("joints.analogue.", counts, joint.counts[n], low..=high, "counts")?;
                let degrees = key(&format!("degrees[{n}]"));
                check_range(
                    "joints.analogue.",
                    degrees,
                    joint.degrees[n],
                    -3600.0..=3600.0,
                    "degrees",
                )?;
            }
            if joint.counts[0] == joint.counts[1] {
                let (name, counts) = (joint.name.clone(), joint.counts[0]);
                return Err(JointsConfigError::SameCounts { name, counts });
            }
            if let Channel::Name(name) = &joint.channel
                && (name.is_empty()
                    || !name.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_')
                    || name.bytes().next().is_some_and(|b| b.is_ascii_digit()))
            {
                return Err(JointsConfigError::ChannelName(name.clone()));
            }
            if let Some(other) = self.joint[..i]
                .iter()
                .find(|other| other.channel == joint.channel)
            {
                return Err(JointsConfigError::SameChannel {
                    channel: joint.channel.to_string(),
                    first: other.name.clone(),
                    second: joint.name.clone(),
                });
            }
        }
        Ok(())
    }

    /// Names of the joints, in the order in which their angles are given.
    pub fn joint_names(&self) -> Vec<String> {
        self.joint.iter().map(|joint| joint.name.clone()).collect()
    }
}
