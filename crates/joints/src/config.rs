//! The `[joints]` table of the configuration file.

use crate::allegro::AllegroConfig;
use serde::Deserialize;
use std::path::PathBuf;
use std::str::FromStr;
use taxel_can::{AddressError, SourceAddress};

/// Most joints one daemon reads.
pub const MAX_JOINTS: usize = 64;

/// Where joint angles come from, and how the joints are called.
///
/// ```
/// let config: taxel_joints::JointsConfig = toml::from_str(r#"
///     source = "dynamixel:/dev/serial/by-id/usb-FTDI_USB__-__Serial_Converter_FT-if00-port0"
///     [[servo]]
///     id = 1
///     name = "left finger"
///     [[servo]]
///     id = 2
///     name = "right finger"
///     direction = -1
/// "#)?;
/// config.check()?;
/// assert_eq!(config.joint_names(), ["left finger", "right finger"]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointsConfig {
    /// `dynamixel:DEVICE` or `allegro:INTERFACE`.
    pub source: JointSource,
    /// Dynamixel: bits per second, 9600 to 10,000,000; what the servos are set to.
    #[serde(default = "default_baud")]
    pub baud: u32,
    /// Dynamixel: cycles per second, 1 to 2000 Hz. A bus that is slower than that runs as fast as it can.
    #[serde(default = "default_rate_hz")]
    pub rate_hz: f64,
    /// Dynamixel: whether all servos answer in one packet.
    #[serde(default)]
    pub fast_sync_read: FastSyncRead,
    /// Dynamixel: whether torque and PWM may be written. Without it nothing but reads and pings is ever sent.
    #[serde(default)]
    pub allow_writes: bool,
    /// Dynamixel with `allow_writes`: a servo that hears nothing for this long stops its motor, ms, 20 to 2540 in
    /// steps of 20 (Bus Watchdog, address 98).
    #[serde(default = "default_watchdog_ms")]
    pub watchdog_ms: u16,
    /// Dynamixel: how long an answer may take beyond its time on the wire, ms, 0.5 to 100. Without it 4 ms, or for an
    /// FTDI adapter 2 ms and twice its latency timer.
    #[serde(default)]
    pub answer_margin_ms: Option<f64>,
    /// An angle whose nearest reading is further than this from a frame's instant is given as unknown, ms, 10 to 60,000.
    #[serde(default = "default_hold_ms")]
    pub hold_ms: f64,
    /// Dynamixel: the joints, in the order in which their angles are given.
    #[serde(default)]
    pub servo: Vec<ServoConfig>,
    /// Allegro: which hand it is.
    #[serde(default)]
    pub allegro: Option<AllegroConfig>,
}

/// One joint that a Dynamixel servo drives.
#[derive(Debug, Clone, PartialEq, Deserialize)]
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

/// Whether all servos are asked to answer in one packet (fast sync read), which needs recent firmware.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Deserialize)]
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

/// Where joint angles come from: `dynamixel:DEVICE` or `allegro:INTERFACE`.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub enum JointSource {
    /// Servos on a serial port. A name under `/dev/serial/by-id` stays the same when the adapter is unplugged and
    /// comes back under another number.
    Dynamixel {
        /// The device.
        path: PathBuf,
    },
    /// An Allegro hand on a CAN bus: `allegro:can2`, or `allegro:` before any CAN source (`allegro:udp:...`).
    Allegro {
        /// The bus.
        bus: SourceAddress,
    },
}

/// Why a text names no source of joint angles.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum JointSourceError {
    /// Neither of the known beginnings.
    #[error(
        "`{0}` is no source of joint angles: write dynamixel:DEVICE, such as dynamixel:/dev/ttyUSB0, or allegro:INTERFACE, such as allegro:can2"
    )]
    Unknown(String),
    /// `dynamixel:` alone.
    #[error("`dynamixel:` needs the serial device behind it, such as dynamixel:/dev/ttyUSB0")]
    NoDevice,
    /// What stands behind `allegro:` is no CAN source.
    #[error("behind `allegro:` {0}")]
    Bus(#[from] AddressError),
}

impl FromStr for JointSource {
    type Err = JointSourceError;

    fn from_str(text: &str) -> Result<Self, JointSourceError> {
        match text.split_once(':') {
            Some(("dynamixel", "")) => Err(JointSourceError::NoDevice),
            Some(("dynamixel", path)) => Ok(JointSource::Dynamixel { path: path.into() }),
            Some(("allegro", bus)) => {
                let address = if bus.contains(':') {
                    bus.parse()?
                } else {
                    format!("can:{bus}").parse()?
                };
                Ok(JointSource::Allegro { bus: address })
            }
            _ => Err(JointSourceError::Unknown(text.into())),
        }
    }
}

impl std::fmt::Display for JointSource {
    /// The form that `FromStr` reads back to the same value.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            JointSource::Dynamixel { path } => write!(f, "dynamixel:{}", path.display()),
            JointSource::Allegro { bus } => write!(f, "allegro:{bus}"),
        }
    }
}

impl TryFrom<String> for JointSource {
    type Error = JointSourceError;

    fn try_from(text: String) -> Result<Self, JointSourceError> {
        text.parse()
    }
}

/// A value of the `[joints]` table that makes no sense.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum JointsConfigError {
    /// A number outside its range.
    #[error("joints.{key} = {value} is outside {low} to {high} {unit}")]
    Range {
        /// The key.
        key: String,
        /// What it is set to.
        value: f64,
        /// The smallest value allowed.
        low: f64,
        /// The largest value allowed.
        high: f64,
        /// Their unit.
        unit: &'static str,
    },
    /// No servo, or too many.
    #[error(
        "joints has {0} [[joints.servo]] tables; source dynamixel needs 1 to {MAX_JOINTS}, one per joint with its id and name"
    )]
    ServoCount(usize),
    /// Two servos with one id.
    #[error("joints: servo id {id} is given to both {first} and {second}; each servo on a bus needs its own")]
    SameId {
        /// The id.
        id: u8,
        /// A joint.
        first: String,
        /// Another joint.
        second: String,
    },
    /// A joint without name, or two with one.
    #[error("joints: servo {id} has the name \"{name}\", which is empty or taken; each joint needs its own")]
    Name {
        /// The servo.
        id: u8,
        /// Its name.
        name: String,
    },
    /// Not a direction.
    #[error(
        "joints: servo {id} has direction = {direction}; write 1, or -1 if the joint turns the other way"
    )]
    Direction {
        /// The servo.
        id: u8,
        /// What it says.
        direction: i8,
    },
    /// The bus watchdog counts in steps of 20 ms.
    #[error("joints.watchdog_ms = {0} is no multiple of 20, the step of the servo's bus watchdog")]
    WatchdogStep(u16),
    /// Servos that would stop between two cycles.
    #[error(
        "joints.watchdog_ms = {watchdog_ms} is shorter than two cycles at rate_hz = {rate_hz}: motors would stop by themselves; make it longer, or read faster"
    )]
    WatchdogShort {
        /// The watchdog's time.
        watchdog_ms: u16,
        /// Cycles per second.
        rate_hz: f64,
    },
    /// A table for the other kind of source.
    #[error("joints: {table} has no meaning with source {source_kind}; leave it out")]
    WrongTable {
        /// The table.
        table: &'static str,
        /// The kind of source.
        source_kind: &'static str,
    },
    /// An Allegro hand whose version is not said.
    #[error("joints: source allegro needs a table [joints.allegro] with version = 1, 2, 3 or 4")]
    NoAllegro,
    /// Not a version of the hand.
    #[error("joints.allegro.version = {0}; there are versions 1, 2, 3 and 4")]
    AllegroVersion(u8),
    /// Not a direction.
    #[error("joints.allegro.enc_dir[{joint}] = {value}; write 1 or -1")]
    EncoderDirection {
        /// The joint, 0 to 15.
        joint: usize,
        /// What it says.
        value: i8,
    },
}

fn default_baud() -> u32 {
    1_000_000
}

fn default_rate_hz() -> f64 {
    100.0
}

fn default_watchdog_ms() -> u16 {
    200
}

fn default_hold_ms() -> f64 {
    250.0
}

fn default_direction() -> i8 {
    1
}

impl JointsConfig {
    /// A read-only configuration for these servo ids, with names `servo 1`, `servo 2`, ... and everything else at its
    /// default.
    pub fn dynamixel(path: impl Into<PathBuf>, ids: impl IntoIterator<Item = u8>) -> Self {
        Self {
            source: JointSource::Dynamixel { path: path.into() },
            baud: default_baud(),
            rate_hz: default_rate_hz(),
            fast_sync_read: FastSyncRead::Auto,
            allow_writes: false,
            watchdog_ms: default_watchdog_ms(),
            answer_margin_ms: None,
            hold_ms: default_hold_ms(),
            servo: ids
                .into_iter()
                .map(|id| ServoConfig {
                    id,
                    name: format!("servo {id}"),
                    homing_rad: 0.0,
                    direction: 1,
                })
                .collect(),
            allegro: None,
        }
    }

    /// Names of the joints, in the order in which their angles are given.
    pub fn joint_names(&self) -> Vec<String> {
        match self.source {
            JointSource::Dynamixel { .. } => self.servo.iter().map(|s| s.name.clone()).collect(),
            JointSource::Allegro { .. } => crate::allegro::joint_names(),
        }
    }

    /// Refuses what cannot be.
    pub fn check(&self) -> Result<(), JointsConfigError> {
        let range = |key: String, value: f64, low: f64, high: f64, unit: &'static str| {
            if (low..=high).contains(&value) {
                Ok(())
            } else {
                Err(JointsConfigError::Range {
                    key,
                    value,
                    low,
                    high,
                    unit,
                })
            }
        };
        range("baud".into(), f64::from(self.baud), 9600.0, 1e7, "bit/s")?;
        range("rate_hz".into(), self.rate_hz, 1.0, 2000.0, "Hz")?;
        range(
            "watchdog_ms".into(),
            f64::from(self.watchdog_ms),
            20.0,
            2540.0,
            "ms",
        )?;
        if let Some(ms) = self.answer_margin_ms {
            range("answer_margin_ms".into(), ms, 0.5, 100.0, "ms")?;
        }
        range("hold_ms".into(), self.hold_ms, 10.0, 60_000.0, "ms")?;
        if !self.watchdog_ms.is_multiple_of(20) {
            return Err(JointsConfigError::WatchdogStep(self.watchdog_ms));
        }
        if self.allow_writes && f64::from(self.watchdog_ms) * self.rate_hz < 2000.0 {
            return Err(JointsConfigError::WatchdogShort {
                watchdog_ms: self.watchdog_ms,
                rate_hz: self.rate_hz,
            });
        }
        if let JointSource::Allegro { .. } = self.source {
            if !self.servo.is_empty() {
                return Err(JointsConfigError::WrongTable {
                    table: "[[joints.servo]]",
                    source_kind: "allegro",
                });
            }
            return self.allegro.as_ref().ok_or(JointsConfigError::NoAllegro)?.check();
        }
        if self.allegro.is_some() {
            return Err(JointsConfigError::WrongTable {
                table: "[joints.allegro]",
                source_kind: "dynamixel",
            });
        }
        if !(1..=MAX_JOINTS).contains(&self.servo.len()) {
            return Err(JointsConfigError::ServoCount(self.servo.len()));
        }
        for (i, servo) in self.servo.iter().enumerate() {
            let key = |name: &str| format!("servo[{i}].{name}");
            range(key("id"), f64::from(servo.id), 0.0, 252.0, "(a servo's id)")?;
            range(key("homing_rad"), servo.homing_rad, -1608.0, 1608.0, "rad")?;
            if servo.direction != 1 && servo.direction != -1 {
                return Err(JointsConfigError::Direction {
                    id: servo.id,
                    direction: servo.direction,
                });
            }
            let before = &self.servo[..i];
            if let Some(other) = before.iter().find(|s| s.id == servo.id) {
                return Err(JointsConfigError::SameId {
                    id: servo.id,
                    first: other.name.clone(),
                    second: servo.name.clone(),
                });
            }
            if servo.name.trim().is_empty() || before.iter().any(|s| s.name == servo.name) {
                return Err(JointsConfigError::Name {
                    id: servo.id,
                    name: servo.name.clone(),
                });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWO: &str = r#"
        source = "dynamixel:/dev/ttyUSB0"
        [[servo]]
        id = 1
        name = "a"
        [[servo]]
        id = 2
        name = "b"
    "#;

    #[test]
    fn a_short_table_is_read_only_at_1_mbit_s() {
        let config: JointsConfig = toml::from_str(TWO).unwrap();
        config.check().unwrap();
        assert_eq!((config.baud, config.allow_writes), (1_000_000, false));
        assert_eq!(config.fast_sync_read, FastSyncRead::Auto);
        assert_eq!((config.servo[1].direction, config.servo[1].homing_rad), (1, 0.0));
    }

    #[test]
    fn what_cannot_be_is_refused_in_words() {
        for (from, to, words) in [
            ("id = 2", "id = 1", "servo id 1 is given to both a and b"),
            (
                "id = 2",
                "id = 253",
                "joints.servo[1].id = 253 is outside 0 to 252",
            ),
            ("\"b\"", "\"a\"", "empty or taken"),
            ("\"b\"", "\" \"", "empty or taken"),
            ("id = 2", "id = 2\ndirection = 0", "direction = 0; write 1, or -1"),
            (
                "id = 2",
                "id = 2\nhoming_rad = nan",
                "homing_rad = NaN is outside",
            ),
            (
                "source",
                "baud = 300\nsource",
                "joints.baud = 300 is outside 9600 to 10000000 bit/s",
            ),
            (
                "source",
                "rate_hz = 0\nsource",
                "rate_hz = 0 is outside 1 to 2000 Hz",
            ),
            ("source", "watchdog_ms = 50\nsource", "no multiple of 20"),
            ("[[servo]]", "[allegro]\nversion = 4\n[[servo]]", "leave it out"),
        ] {
            let text = TWO.replacen(from, to, 2).replace("id = 2\nid", "id");
            let text = if from == "[[servo]]" || from == "source" {
                TWO.replacen(from, to, 1)
            } else {
                text
            };
            let config: JointsConfig = toml::from_str(&text).unwrap_or_else(|e| panic!("{text}: {e}"));
            let message = config.check().unwrap_err().to_string();
            assert!(message.contains(words), "{to}: {message}");
        }
    }

    #[test]
    fn unknown_keys_and_sources_do_not_parse() {
        for (text, words) in [
            (TWO.replace("name", "nmae"), "nmae"),
            (
                TWO.replace("dynamixel:/dev/ttyUSB0", "dynamixel:"),
                "needs the serial device",
            ),
            (
                TWO.replace("dynamixel:/dev/ttyUSB0", "serial:/dev/ttyUSB0"),
                "write dynamixel:DEVICE",
            ),
            (
                TWO.replace("dynamixel:/dev/ttyUSB0", "allegro:a b"),
                "behind `allegro:`",
            ),
            (
                TWO.replace("[[servo]]", "fast_sync_read = \"maybe\"\n[[servo]]"),
                "maybe",
            ),
        ] {
            let error = toml::from_str::<JointsConfig>(&text).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
    }

    #[test]
    fn a_source_is_written_as_it_is_read() {
        for text in [
            "dynamixel:/dev/ttyUSB0",
            "allegro:can:can2",
            "allegro:log:a.log?interface=can2",
        ] {
            let source: JointSource = text.parse().unwrap();
            assert_eq!(source.to_string(), text);
        }
        let short: JointSource = "allegro:can2".parse().unwrap();
        assert_eq!(short.to_string(), "allegro:can:can2");
    }

    #[test]
    fn no_servo_and_too_many_are_refused() {
        for ids in [0, 65] {
            assert_eq!(
                JointsConfig::dynamixel("/dev/x", 0..ids).check(),
                Err(JointsConfigError::ServoCount(usize::from(ids)))
            );
        }
        JointsConfig::dynamixel("/dev/x", 0..64).check().unwrap();
    }

    #[test]
    fn an_allegro_hand_needs_its_version() {
        let bare = r#"source = "allegro:can2""#;
        let config: JointsConfig = toml::from_str(bare).unwrap();
        assert_eq!(config.check(), Err(JointsConfigError::NoAllegro));
        for (version, good) in [(0, false), (1, true), (3, true), (4, true), (5, false)] {
            let config: JointsConfig =
                toml::from_str(&format!("{bare}\nallegro.version = {version}")).unwrap();
            assert_eq!(config.check().is_ok(), good, "{version}");
        }
    }
}
