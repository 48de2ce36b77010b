//! The keys of the `[joints]` table that are for servos.

use crate::dynamixel::bus::{DEFAULT_MARGIN_NS, FACTORY_RETURN_DELAY_NS, PRESENT_BYTES, wire_ns};
use crate::dynamixel::protocol2::STATUS_OVERHEAD;
use crate::error::{JointSourceError, JointsConfigError, MAX_JOINTS};
use crate::joint_name::why_no_joint_name;
use crate::source::SourceConfig;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use taxel_hand::check_range;

/// A sync read without the ids.
const REQUEST_BYTES: usize = 14;
/// Readings kept per joint: a third of a second at 100 Hz.
pub(super) const READINGS_KEPT: usize = 32;

/// Servos on one serial bus.
#[derive(Debug, Clone, PartialEq)]
pub struct DynamixelConfig {
    /// The serial device. A name under `/dev/serial/by-id` stays the same when the adapter is
    /// unplugged and comes back under another number.
    pub path: PathBuf,
    /// Bits per second, 9600 to 10,000,000; what the servos are set to.
    pub baud: u32,
    /// Cycles per second, 1 to 2000 Hz. A bus that is slower than that runs as fast as it can.
    pub rate_hz: f64,
    /// Whether all servos answer in one packet.
    pub fast_sync_read: FastSyncRead,
    /// Whether torque and PWM may be written. Without it nothing but reads and pings is ever sent.
    pub allow_writes: bool,
    /// With `allow_writes`: a servo that hears nothing for this long stops its motor, ms, 20 to
    /// 2540 in steps of 20 (Bus Watchdog, address 98); two cycles at least, and `answer_margin_ms`
    /// (4 ms without that key), a cycle, and what a request to all servos and their answers take on the wire with the Return
    /// Delay Time from the factory: 200 is too short for 48 servos at 57,600 bit/s.
    pub watchdog_ms: u16,
    /// How long an answer may take beyond its time on the wire, ms, 0.5 to 500. Without it 4 ms, or
    /// for an FTDI adapter 2 ms and twice its latency timer. A servo that falls silent, or is told
    /// something then, is waited for so long, two or three times, and for that long no other is read
    /// or told anything; after that, as long as without this key, until it answers, late or not.
    /// Angles of the others stay known where `hold_ms` is longer.
    pub answer_margin_ms: Option<f64>,
    /// The joints, in the order in which their angles are given.
    pub servo: Vec<ServoConfig>,
}

/// One joint that a Dynamixel servo drives.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct ServoConfig {
    /// The servo's id on the bus, 0 to 252.
    pub id: u8,
    /// The joint's name.
    pub name: String,
    /// The servo's angle at which the joint is at 0, radians (the servo's own 0 is position 2048).
    #[serde(default)]
    pub homing_rad: f64,
    /// 1 if the joint turns as the servo does, -1 if against it.
    #[serde(default = "default_direction")]
    pub direction: i8,
}

fn default_direction() -> i8 {
    1
}

/// Whether all servos are asked to answer in one packet (fast sync read), which needs recent firmware.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum FastSyncRead {
    /// Tried once the servos answer; if they do not answer that, each answers with its own packet.
    #[default]
    Auto,
    /// Always.
    On,
    /// Never.
    Off,
}

impl DynamixelConfig {
    /// Servos of these ids that are only read, with names `servo 1`, `servo 2`, ... and everything
    /// else at its default.
    pub fn new(path: impl Into<PathBuf>, ids: impl IntoIterator<Item = u8>) -> Self {
        let servo = |id| ServoConfig {
            id,
            name: format!("servo {id}"),
            homing_rad: 0.0,
            direction: default_direction(),
        };
        Self {
            path: path.into(),
            baud: 1_000_000,
            rate_hz: 100.0,
            fast_sync_read: FastSyncRead::Auto,
            allow_writes: false,
            watchdog_ms: 200,
            answer_margin_ms: None,
            servo: ids.into_iter().map(servo).collect(),
        }
    }

    /// What stands behind `dynamixel:`.
    pub(crate) fn at(device: &str) -> Result<Self, JointSourceError> {
        match device {
            "" => Err(JointSourceError::NoDevice),
            path => Ok(Self::new(path, [])),
        }
    }

    /// Refuses what cannot be.
    pub fn check(&self) -> Result<(), JointsConfigError> {
        self.check_numbers()?;
        if !(1..=MAX_JOINTS).contains(&self.servo.len()) {
            return Err(JointsConfigError::ServoCount(self.servo.len()));
        }
        let names = self.joint_names();
        for (i, servo) in self.servo.iter().enumerate() {
            let key = |name: &str| format!("servo[{i}].{name}");
            check_range("joints.", key("id"), servo.id, 0.0..=252.0, "(a servo's id)")?;
            check_range(
                "joints.",
                key("homing_rad"),
                servo.homing_rad,
                -6.3..=6.3,
                "rad (180 degrees are 3.1416)",
            )?;
            if servo.direction != 1 && servo.direction != -1 {
                return Err(JointsConfigError::Direction {
                    id: servo.id,
                    direction: servo.direction,
                });
            }
            let before = &self.servo[..i];
            if let Some(why) = why_no_joint_name(&servo.name, &names[..i]) {
                return Err(JointsConfigError::Name {
                    id: servo.id,
                    name: servo.name.clone(),
                    why,
                });
            }
            if let Some(other) = before.iter().find(|s| s.id == servo.id) {
                return Err(JointsConfigError::SameId {
                    id: servo.id,
                    first: other.name.clone(),
                    second: servo.name.clone(),
                });
            }
        }
        Ok(())
    }

    /// Refuses numbers that cannot be, whatever the servos.
    pub(crate) fn check_numbers(&self) -> Result<(), JointsConfigError> {
        check_range("joints.", "baud", self.baud, 9600.0..=1e7, "bit/s")?;
        check_range("joints.", "rate_hz", self.rate_hz, 1.0..=2000.0, "Hz")?;
        check_range("joints.", "watchdog_ms", self.watchdog_ms, 20.0..=2540.0, "ms")?;
        if let Some(ms) = self.answer_margin_ms {
            check_range("joints.", "answer_margin_ms", ms, 0.5..=500.0, "ms")?;
        }
        if !self.watchdog_ms.is_multiple_of(20) {
            return Err(JointsConfigError::WatchdogStep(self.watchdog_ms));
        }
        if self.allow_writes && f64::from(self.watchdog_ms) * self.rate_hz < 2000.0 {
            return Err(JointsConfigError::WatchdogShort {
                watchdog_ms: self.watchdog_ms,
                rate_hz: self.rate_hz,
            });
        }
        let cycle_ms = 1000.0 / self.rate_hz;
        let default_ms = DEFAULT_MARGIN_NS as f64 / 1e6;
        let answer_margin_ms = self.answer_margin_ms.unwrap_or(default_ms);
        let least_ms = answer_margin_ms + cycle_ms + self.wire_ms();
        if self.allow_writes && f64::from(self.watchdog_ms) < least_ms {
            return Err(JointsConfigError::WatchdogMargin {
                watchdog_ms: self.watchdog_ms,
                answer_margin_ms,
                cycle_ms,
                wire_ms: self.wire_ms(),
                baud: self.baud,
                least_ms: 20 * (least_ms / 20.0).ceil() as u32,
            });
        }
        Ok(())
    }

    /// How long a request for all positions and the answers take on the wire, ms, with the Return Delay Time from the factory.
    fn wire_ms(&self) -> f64 {
        let servos = self.servo.len();
        let bytes = REQUEST_BYTES + servos * (1 + STATUS_OVERHEAD + PRESENT_BYTES);
        wire_ns(bytes, self.baud) as f64 / 1e6 + servos as f64 * FACTORY_RETURN_DELAY_NS as f64 / 1e6
    }

    /// Names of the joints, in the order in which their angles are given.
    pub fn joint_names(&self) -> Vec<String> {
        self.servo.iter().map(|s| s.name.clone()).collect()
    }
}

impl SourceConfig for DynamixelConfig {
    fn device(&self) -> &'static str {
        "servos"
    }

    fn check(&self) -> Result<(), JointsConfigError> {
        self.check()
    }

    fn joint_names(&self) -> Vec<String> {
        self.joint_names()
    }

    fn readings_kept(&self) -> usize {
        READINGS_KEPT
    }

    fn serial_device(&self) -> Option<&Path> {
        Some(&self.path)
    }
}
