//! HELLO: what hand and which display the images are of.

use crate::format::{MAJOR, MINOR};
use crate::text::{Subscribe, split_json, to_json};
use serde::{Deserialize, Serialize};
use taxel_hand::{Geometry, GeometryError, Module, Pose, Profile, Taxel};

/// The self-description that each reader gets first, and again whenever it changes.
///
/// Keys of later versions are ignored when read.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Hello {
    /// Version of the format.
    pub protocol: HelloProtocol,
    /// Program and version, such as `taxeld 0.1.0`.
    pub daemon: String,
    /// Name of the layout, such as `allegro-uskin-15`.
    pub layout: String,
    /// Width of the images, pixels.
    pub width: u16,
    /// Height of the images, pixels.
    pub height: u16,
    /// The modules, in the order of their taxels.
    pub modules: Vec<HelloModule>,
    /// The taxels, in the order of their numbers.
    pub taxels: Vec<HelloTaxel>,
    /// Names of the joints, in the order of every message's angles; absent where no joints are read.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub joints: Vec<String>,
    /// Column and row of each pixel that no taxel stands behind.
    pub absent: Vec<[u16; 2]>,
    /// The display that the images are made for.
    pub profile: HelloProfile,
    /// The parts of the hand that the images show; absent where they show all of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region: Option<Vec<String>>,
    /// The subscription in force when this was sent, but for profile and region; absent where a daemon
    /// does not tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub subscription: Option<Subscription>,
    /// When images come.
    pub rate: HelloRate,
    /// Unit of every force: `counts`, or `counts^2` in the publication's squared mode.
    pub force_unit: String,
    /// The clock of every `t_ns`.
    pub clock: Clock,
}

/// Version of the format.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct HelloProtocol {
    /// Readers refuse another major version.
    pub major: u8,
    /// Readers accept any minor version.
    pub minor: u8,
}

/// What is sent to a subscriber, as it was told to whoever subscribed. Defaults are those of a client
/// that never did.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Subscription {
    /// IMAGE messages.
    pub image: bool,
    /// RAW messages.
    pub raw: bool,
    /// STATUS messages.
    pub status: bool,
    /// Every image and raw frame in order, instead of the newest.
    pub every: bool,
    /// The most images, and the most raw frames, per second; null for every one.
    pub max_rate_hz: Option<f64>,
}

impl From<&Subscribe> for Subscription {
    fn from(wants: &Subscribe) -> Self {
        Self {
            image: wants.image,
            raw: wants.raw,
            status: wants.status,
            every: wants.every,
            max_rate_hz: wants.max_rate_hz,
        }
    }
}

impl Default for Subscription {
    fn default() -> Self {
        Self::from(&Subscribe::default())
    }
}

/// One board's patch of taxels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HelloModule {
    /// Name for people, such as `index tip`.
    pub name: String,
    /// Part of the hand, such as `index`.
    pub part: String,
    /// Number of its first taxel.
    pub first_taxel: u16,
    /// How many taxels it has.
    pub taxels: u16,
    /// Where it sits on the link that `joint` moves, or on the hand's base without one; absent where unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose: Option<Pose>,
    /// Name of the joint that moves its link, as the layout names it; absent on the hand's base,
    /// and where unknown. It may be missing from [`Hello::joints`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint: Option<String>,
}

/// One taxel's place; in JSON the row `[taxel, x, y, module, [x_mm, y_mm, z_mm] or null]`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(from = "TaxelRow", into = "TaxelRow")]
pub struct HelloTaxel {
    /// Number of the taxel, `0..N`.
    pub taxel: u16,
    /// Column of its pixel.
    pub x: u16,
    /// Row of its pixel.
    pub y: u16,
    /// Index of its module in [`Hello::modules`].
    pub module: u16,
    /// Place on the hand, millimetres, where known.
    pub position_mm: Option<[f32; 3]>,
}

type TaxelRow = (u16, u16, u16, u16, Option<[f32; 3]>);

impl From<TaxelRow> for HelloTaxel {
    fn from((taxel, x, y, module, position_mm): TaxelRow) -> Self {
        Self {
            taxel,
            x,
            y,
            module,
            position_mm,
        }
    }
}

impl From<HelloTaxel> for TaxelRow {
    fn from(t: HelloTaxel) -> Self {
        (t.taxel, t.x, t.y, t.module, t.position_mm)
    }
}

/// The display that the images are made for.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct HelloProfile {
    /// `K_D`, the most force levels an image has.
    pub levels: u16,
    /// `K_A`, the most actuators an image has; actuator ids are below it.
    pub actuators: u16,
    /// Name of the compression method, such as `paper`.
    pub method: String,
    /// Meaning of a grey: `level` (equal steps) or `centroid` (in the ratio of the forces).
    pub grey: String,
}

impl From<&Profile> for HelloProfile {
    fn from(profile: &Profile) -> Self {
        let name = |value: serde_json::Result<serde_json::Value>| match value {
            Ok(serde_json::Value::String(name)) => name,
            _ => "unknown".into(),
        };
        Self {
            levels: profile.level_count(),
            actuators: profile.actuators,
            method: name(serde_json::to_value(profile.method)),
            grey: name(serde_json::to_value(profile.grey)),
        }
    }
}

/// When images come.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HelloRate {
    /// `timer` for a fixed rate, `sweep` for an image as soon as every board has reported.
    pub mode: String,
    /// Images per second; in `sweep` mode the expected rate, or null where that is unknown.
    pub hz: Option<f64>,
}

/// The clock of every `t_ns`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Clock {
    /// The machine's monotonic clock, for live hands.
    #[serde(rename = "CLOCK_MONOTONIC")]
    Monotonic,
    /// The machine's wall clock.
    #[serde(rename = "CLOCK_REALTIME")]
    Realtime,
    /// The times in a recording; they tell no latency.
    #[serde(rename = "recording")]
    Recording,
    /// A clock of a later version.
    #[serde(other)]
    Unknown,
}

impl Hello {
    /// Describes a hand and a display; forces in counts.
    pub fn new(
        daemon: impl Into<String>,
        geometry: &Geometry,
        profile: &Profile,
        rate: HelloRate,
        clock: Clock,
    ) -> Self {
        let (width, height) = (geometry.width, geometry.height);
        let pixel = |x: u16, y: u16| usize::from(y) * usize::from(width) + usize::from(x);
        let mut present = vec![false; usize::from(width) * usize::from(height)];
        for taxel in &geometry.taxels {
            if let Some(present) = present.get_mut(pixel(taxel.x, taxel.y)) {
                *present = true;
            }
        }
        let absent = (0..height)
            .flat_map(|y| (0..width).map(move |x| [x, y]))
            .filter(|&[x, y]| !present[pixel(x, y)])
            .collect();
        Self {
            protocol: HelloProtocol {
                major: MAJOR,
                minor: MINOR,
            },
            daemon: daemon.into(),
            layout: geometry.name.clone(),
            width,
            height,
            modules: geometry
                .modules
                .iter()
                .map(|module| HelloModule {
                    name: module.name.clone(),
                    part: module.part.clone(),
                    first_taxel: module.first_taxel,
                    taxels: module.taxels,
                    pose: module.pose,
                    joint: module.joint.clone(),
                })
                .collect(),
            taxels: geometry
                .taxels
                .iter()
                .zip(0..)
                .map(|(place, taxel)| HelloTaxel {
                    taxel,
                    x: place.x,
                    y: place.y,
                    module: place.module,
                    position_mm: place.position_mm,
                })
                .collect(),
            joints: Vec::new(),
            absent,
            profile: profile.into(),
            region: None,
            subscription: None,
            rate,
            force_unit: "counts".into(),
            clock,
        }
    }

    /// The hand that it describes, where it describes one.
    pub fn geometry(&self) -> Result<Geometry, GeometryError> {
        let modules = self.modules.iter().map(|module| Module {
            name: module.name.clone(),
            part: module.part.clone(),
            first_taxel: module.first_taxel,
            taxels: module.taxels,
            pose: module.pose,
            joint: module.joint.clone(),
        });
        let taxels = self.taxels.iter().map(|taxel| Taxel {
            module: taxel.module,
            x: taxel.x,
            y: taxel.y,
            position_mm: taxel.position_mm,
        });
        let size = [self.width, self.height];
        Geometry::new(self.layout.clone(), size, modules.collect(), taxels.collect())
    }

    /// Whether both describe one hand: its layout, its modules, and the places of its taxels.
    pub fn is_of_one_hand_with(&self, other: &Self) -> bool {
        (&self.layout, &self.modules, &self.taxels) == (&other.layout, &other.modules, &other.taxels)
    }

    /// The text of the message; [`crate::split_text`] makes packets of it.
    pub fn to_json(&self) -> Vec<u8> {
        to_json(self)
    }

    /// The packets of the message, each a header and its part of the text, in order.
    pub fn to_packets(&self, seq: u64, t_ns: u64) -> Vec<Vec<u8>> {
        split_json(crate::Kind::Hello, &self.to_json(), seq, t_ns)
    }

    /// Reads the text of a HELLO.
    pub fn parse(text: &[u8]) -> Result<Self, serde_json::Error> {
        serde_json::from_slice(text)
    }
}

/// A HELLO that is written once for many subscribers, and sent to each with what it has subscribed to.
#[derive(Debug, Clone)]
pub struct HelloText {
    /// The JSON object without its closing brace.
    open: Vec<u8>,
}

impl HelloText {
    /// Writes it down; [`Hello::subscription`] is left out.
    pub fn new(hello: &Hello) -> Self {
        let mut open = Hello {
            subscription: None,
            ..hello.clone()
        }
        .to_json();
        open.pop();
        Self { open }
    }

    /// The packets of the message for one subscriber.
    pub fn to_packets(&self, subscription: &Subscription, seq: u64, t_ns: u64) -> Vec<Vec<u8>> {
        let text = [
            &self.open,
            &b",\"subscription\":"[..],
            &to_json(subscription),
            b"}",
        ]
        .concat();
        split_json(crate::Kind::Hello, &text, seq, t_ns)
    }
}
