//! The `[joints]` table of the configuration file, and the list of the kinds of sources.

use crate::allegro::{AllegroConfig, AllegroSource};
use crate::analogue::AnalogueConfig;
use crate::dynamixel::{DynamixelConfig, FastSyncRead, ServoConfig};
use crate::error::{JointSourceError, JointsConfigError, MAX_JOINTS, SOURCE_FORMS};
use crate::joint_name::why_no_joint_name;
use crate::source::SourceConfig;
use serde::{Deserialize, Serialize, Serializer};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use taxel_hand::{FromMap, check_range};

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
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(try_from = "Table", into = "Table")]
pub struct JointsConfig {
    /// `dynamixel:DEVICE` or `allegro:INTERFACE`, with what the table says of it.
    pub source: JointSource,
    /// Potentiometers beside it, whose joints come behind its own.
    pub analogue: Option<AnalogueConfig>,
    /// An angle whose nearest reading is further than this from a frame's instant is given as
    /// unknown, ms, 10 to 60,000.
    pub hold_ms: f64,
}

/// Where joint angles come from. As text it is `dynamixel:DEVICE` or `allegro:INTERFACE`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(try_from = "String")]
pub enum JointSource {
    /// Servos on a serial port.
    Dynamixel(DynamixelConfig),
    /// An Allegro hand on a CAN bus: `allegro:can2`, or `allegro:` before any CAN source (`allegro:udp:...`).
    Allegro(AllegroSource),
}

/// The table as it is written: the keys of all kinds of sources side by side.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Table {
    source: JointSource,
    hold_ms: Option<f64>,
    baud: Option<u32>,
    rate_hz: Option<f64>,
    fast_sync_read: Option<FastSyncRead>,
    allow_writes: Option<bool>,
    watchdog_ms: Option<u16>,
    answer_margin_ms: Option<f64>,
    #[serde(
        default,
        deserialize_with = "FromMap::list",
        skip_serializing_if = "Vec::is_empty"
    )]
    servo: Vec<ServoConfig>,
    #[serde(default, deserialize_with = "FromMap::optional")]
    allegro: Option<AllegroConfig>,
    #[serde(default, deserialize_with = "FromMap::optional")]
    analogue: Option<AnalogueConfig>,
}

const DEFAULT_HOLD_MS: f64 = 250.0;

impl TryFrom<Table> for JointsConfig {
    type Error = JointsConfigError;

    /// Gives each source its keys, and refuses those of another.
    fn try_from(table: Table) -> Result<Self, JointsConfigError> {
        let of_servos = [
            ("baud", table.baud.is_some()),
            ("rate_hz", table.rate_hz.is_some()),
            ("fast_sync_read", table.fast_sync_read.is_some()),
            ("allow_writes", table.allow_writes.is_some()),
            ("watchdog_ms", table.watchdog_ms.is_some()),
            ("answer_margin_ms", table.answer_margin_ms.is_some()),
            ("[[joints.servo]]", !table.servo.is_empty()),
        ];
        let of_allegro = [("[joints.allegro]", table.allegro.is_some())];
        let (others, source): (&[_], _) = match table.source {
            JointSource::Dynamixel(_) => (&of_allegro, "dynamixel"),
            JointSource::Allegro(_) => (&of_servos, "allegro"),
        };
        if let Some((key, _)) = others.iter().find(|(_, is_given)| *is_given) {
            return Err(JointsConfigError::OfAnotherSource {
                key,
                source_kind: source,
            });
        }
        let defaults = DynamixelConfig::new(PathBuf::new(), []);
        let servos = DynamixelConfig {
            baud: table.baud.unwrap_or(defaults.baud),
            rate_hz: table.rate_hz.unwrap_or(defaults.rate_hz),
            fast_sync_read: table.fast_sync_read.unwrap_or(defaults.fast_sync_read),
            allow_writes: table.allow_writes.unwrap_or(defaults.allow_writes),
            watchdog_ms: table.watchdog_ms.unwrap_or(defaults.watchdog_ms),
            answer_margin_ms: table.answer_margin_ms,
            servo: table.servo,
            ..defaults
        };
        servos.check_numbers()?;
        let source = match table.source {
            JointSource::Dynamixel(DynamixelConfig { path, .. }) => {
                JointSource::Dynamixel(DynamixelConfig { path, ..servos })
            }
            JointSource::Allegro(AllegroSource { bus, .. }) => JointSource::Allegro(AllegroSource {
                bus,
                hand: table.allegro,
            }),
        };
        Ok(Self {
            source,
            analogue: table.analogue,
            hold_ms: table.hold_ms.unwrap_or(DEFAULT_HOLD_MS),
        })
    }
}

impl From<JointsConfig> for Table {
    /// Every key that has a value in force.
    fn from(config: JointsConfig) -> Self {
        let (servos, allegro) = match config.source.clone() {
            JointSource::Dynamixel(servos) => (Some(servos), None),
            JointSource::Allegro(hand) => (None, hand.hand),
        };
        let of = servos.as_ref();
        Self {
            source: config.source,
            hold_ms: Some(config.hold_ms),
            baud: of.map(|servos| servos.baud),
            rate_hz: of.map(|servos| servos.rate_hz),
            fast_sync_read: of.map(|servos| servos.fast_sync_read),
            allow_writes: of.map(|servos| servos.allow_writes),
            watchdog_ms: of.map(|servos| servos.watchdog_ms),
            answer_margin_ms: of.and_then(|servos| servos.answer_margin_ms),
            servo: servos.map_or(Vec::new(), |servos| servos.servo),
            allegro,
            analogue: config.analogue,
        }
    }
}

impl FromStr for JointSource {
    type Err = JointSourceError;

    fn from_str(text: &str) -> Result<Self, JointSourceError> {
        match text.split_once(':') {
            Some(("dynamixel", device)) => DynamixelConfig::at(device).map(Self::Dynamixel),
            Some(("allegro", bus)) => AllegroSource::at(bus).map(Self::Allegro),
            _ => Err(JointSourceError::Unknown(text.into())),
        }
    }
}

impl std::fmt::Display for JointSource {
    /// The form that `FromStr` reads back to the same source.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Dynamixel(servos) => write!(f, "dynamixel:{}", servos.path.display()),
            Self::Allegro(hand) => write!(f, "allegro:{}", hand.bus),
        }
    }
}

impl Serialize for JointSource {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl TryFrom<String> for JointSource {
    type Error = JointSourceError;

    fn try_from(text: String) -> Result<Self, JointSourceError> {
        text.parse()
    }
}

impl JointSource {
    /// How each kind is written.
    pub const FORMS: [&str; 2] = SOURCE_FORMS;

    /// Whether both read one thing: one serial port, by whichever link it is named, or one CAN bus.
    pub fn is_same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Dynamixel(one), Self::Dynamixel(other)) => is_one_device(&one.path, &other.path),
            (Self::Allegro(one), Self::Allegro(other)) => one.bus == other.bus,
            _ => false,
        }
    }

    /// What every kind of source can be asked.
    pub fn config(&self) -> &dyn SourceConfig {
        match self {
            Self::Dynamixel(servos) => servos,
            Self::Allegro(hand) => hand,
        }
    }
}

impl JointsConfig {
    /// This source, with everything else at its default.
    pub fn new(source: JointSource) -> Self {
        Self {
            source,
            analogue: None,
            hold_ms: DEFAULT_HOLD_MS,
        }
    }

    /// Servos of these ids that are only read, with names `servo 1`, `servo 2`, ... and everything
    /// else at its default.
    pub fn dynamixel(path: impl Into<PathBuf>, ids: impl IntoIterator<Item = u8>) -> Self {
        Self::new(JointSource::Dynamixel(DynamixelConfig::new(path, ids)))
    }

    /// Names of the joints, in the order in which their angles are given.
    pub fn joint_names(&self) -> Vec<String> {
        let mut names = self.source.config().joint_names();
        names.extend(self.analogue.iter().flat_map(AnalogueConfig::joint_names));
        names
    }

    /// Refuses what cannot be.
    pub fn check(&self) -> Result<(), JointsConfigError> {
        check_range("joints.", "hold_ms", self.hold_ms, 10.0..=60_000.0, "ms")?;
        self.source.config().check()?;
        let Some(analogue) = &self.analogue else {
            return Ok(());
        };
        let names = self.joint_names();
        let first = names.len() - analogue.joint.len();
        for (n, name) in names.iter().enumerate().skip(first) {
            if let Some(why) = why_no_joint_name(name, &names[..n]) {
                let name = name.clone();
                return Err(JointsConfigError::AnalogueName { name, why });
            }
        }
        analogue.check()?;
        let servos = self.source.config().serial_device();
        if servos.is_some_and(|servos| is_one_device(servos, &analogue.device)) {
            return Err(JointsConfigError::AnalogueDevice(analogue.device.clone()));
        }
        match names.len() {
            count if count > MAX_JOINTS => Err(JointsConfigError::TooMany(count)),
            _ => Ok(()),
        }
    }
}

/// Whether both name one device, be it by two links.
fn is_one_device(one: &Path, other: &Path) -> bool {
    let device = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.into());
    device(one) == device(other)
}

#[cfg(test)]
mod tests;
