//! The daemon's one configuration file: its keys, their checks, and what is wrong with it, by line.
//!
//! A crate of its own because most of its code is made by derive: it is compiled once, without optimisation, and not
//! again with each change of the daemon.

mod boardless;
mod buses;
mod place;
mod sockets;
mod summary;
mod syntax;
mod unread_joints;

pub use buses::told_apart;
pub use place::line_of;
pub use sockets::{ControlConfig, SocketConfig, other_hands, running_socket};

use serde::{Deserialize, Serialize};
use std::path::Path;
use taxel_can::SourceAddress;
use taxel_diagnose::HandSetup;
use taxel_engine::{EngineConfig, EngineJoints, TickConfig, TickMode};
use taxel_hand::{FromMap, Method, Profile};
use taxel_joints::{JointsBus, JointsConfig, JointsError};
use taxel_serve::ProfilesConfig;
use taxel_skin::{
    BoardsConfig, ConditionConfig, ConditionSettings, Layout, LayoutError, Preset, SweepConfig,
};
use toml::Spanned;

/// Every key of a configuration behind `#`, with its default and what it means; `layout` and `[[bus]]` go above it.
pub const ANNOTATED: &str = include_str!("annotated.toml");

/// Most buses one daemon reads.
pub const MAX_BUSES: usize = 8;

/// Everything the daemon needs to know, checked.
#[derive(Debug, Clone)]
pub struct Config {
    /// The hand.
    pub layout: Layout,
    /// One source per bus of the layout, in its order.
    pub sources: Vec<SourceAddress>,
    /// When images are made.
    pub tick: TickConfig,
    /// How boards are started and watched.
    pub boards: BoardsConfig,
    /// How sweeps are assembled.
    pub sweep: SweepConfig,
    /// Baseline, contact threshold, faults and repair.
    pub conditioning: ConditionConfig,
    /// What the file says of it; the rest of it belongs to the method of `profile`.
    pub stated_conditioning: ConditionSettings,
    /// What the display can do, unless a subscriber states its own.
    pub profile: Profile,
    /// How many profiles subscribers may state, and what they may cost.
    pub profiles: ProfilesConfig,
    /// Where subscribers connect.
    pub socket: SocketConfig,
    /// Who may change something.
    pub control: ControlConfig,
    /// Scheduling of the tick thread.
    pub realtime: RealtimeConfig,
    /// How CAN interfaces are opened.
    pub can: CanConfig,
    /// Where the joint angles come from, if any are read.
    pub joints: Option<JointsConfig>,
}

/// Scheduling of the tick thread. What the system refuses is reported once and done without.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RealtimeConfig {
    /// `SCHED_FIFO` priority of the tick thread, 1 to 49; 0 for normal scheduling.
    pub priority: u8,
    /// Keep the daemon's memory from being paged out.
    pub lock_memory: bool,
}

/// How CAN interfaces are opened.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CanConfig {
    /// Receive buffer asked of the kernel per bus, KiB, 64 to 65,536. Without `CAP_NET_ADMIN` the
    /// kernel caps it at `net.core.rmem_max`.
    pub receive_buffer_kib: u32,
}

impl Default for RealtimeConfig {
    fn default() -> Self {
        Self {
            priority: 10,
            lock_memory: false,
        }
    }
}

impl Default for CanConfig {
    fn default() -> Self {
        Self {
            receive_buffer_kib: 4096,
        }
    }
}

/// Why a configuration was refused, with the place.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file could not be read.
    #[error("cannot read {path}: {error}")]
    Read {
        /// The file.
        path: String,
        /// What the system said.
        error: std::io::Error,
    },
    /// Not TOML, an unknown key, or a value of the wrong type.
    #[error("{file}:{line}: {message}")]
    Syntax {
        /// The file.
        file: String,
        /// Line, from 1.
        line: usize,
        /// What is wrong.
        message: String,
    },
    /// A value that makes no sense.
    #[error("{file}:{line}: {message}")]
    Value {
        /// The file.
        file: String,
        /// Line of the value or of its table, from 1.
        line: usize,
        /// What is wrong and what would be right.
        message: String,
    },
}

/// A table of the file: keys with their values, and no list of values in the order of the keys.
type Table<T> = Spanned<FromMap<T>>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FileConfig {
    #[serde(default = "default_layout")]
    layout: Spanned<String>,
    #[serde(default)]
    bus: Vec<Table<BusConfig>>,
    tick: Option<Table<TickConfig>>,
    boards: Option<Table<BoardsConfig>>,
    sweep: Option<Table<SweepConfig>>,
    conditioning: Option<Table<ConditionSettings>>,
    profile: Option<Table<Profile>>,
    profiles: Option<Table<ProfilesConfig>>,
    socket: Option<Table<SocketConfig>>,
    control: Option<Table<ControlConfig>>,
    realtime: Option<Table<RealtimeConfig>>,
    can: Option<Table<CanConfig>>,
    joints: Option<Table<JointsConfig>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BusConfig {
    source: Spanned<String>,
}

fn default_layout() -> Spanned<String> {
    Spanned::new(0..0, "allegro-uskin-15".into())
}

impl Config {
    /// A configuration with everything at its default, for this hand and these sources.
    pub fn new(layout: Layout, sources: Vec<SourceAddress>) -> Self {
        Self {
            layout,
            sources,
            tick: TickConfig::default(),
            boards: BoardsConfig::default(),
            sweep: SweepConfig::default(),
            conditioning: ConditionConfig::default(),
            stated_conditioning: ConditionSettings::default(),
            profile: Profile::default(),
            profiles: ProfilesConfig::default(),
            socket: SocketConfig::default(),
            control: ControlConfig::default(),
            realtime: RealtimeConfig::default(),
            can: CanConfig::default(),
            joints: None,
        }
    }

    /// Compresses by another method, with the conditioning that belongs to it: `preset`, or what the file states, or
    /// the method's own.
    pub fn set_method(&mut self, method: Method, preset: Option<Preset>) {
        self.profile.method = method;
        self.stated_conditioning.preset = preset.or(self.stated_conditioning.preset);
        self.conditioning = self.stated_conditioning.over(method.into());
    }

    /// The CAN bus that joint angles come over; `None` where none do.
    pub fn joints_bus(&self) -> Option<JointsBus> {
        self.joints.as_ref()?.can_bus(&self.layout, &self.sources)
    }

    /// The engine's part of it; `is_read` says that somebody reads the joints that come over no CAN
    /// bus. Refuses joints that cannot be read beside this skin.
    pub fn engine(&self, is_read: bool) -> Result<EngineConfig, JointsError> {
        if let Some(joints) = &self.joints {
            joints.check_beside(&self.layout, &self.sources)?;
        }
        Ok(EngineConfig {
            layout: self.layout.clone(),
            tick: self.tick,
            boards: self.boards.clone(),
            sweep: self.sweep.clone(),
            conditioning: self.conditioning.clone(),
            calibrated: None,
            joints: self.joints.clone().map(|config| EngineJoints {
                bus: self.joints_bus().map(|bus| bus.index),
                config,
                is_read,
            }),
        })
    }

    /// The unit of forces, as HELLO names it.
    pub fn force_unit(&self) -> &'static str {
        match self.conditioning.magnitude.is_squared() {
            true => "counts^2",
            false => "counts",
        }
    }

    /// The hand as [`taxel_diagnose`] is told of it.
    pub fn hand_setup(&self) -> HandSetup<'_> {
        HandSetup {
            layout: &self.layout,
            sources: &self.sources,
            silence_ns: (self.boards.silence_ms * 1e6) as u64,
            stale_ns: self.sweep.stale_after_ms.map(|ms| (ms * 1e6) as u64),
            joints: self.joints.as_ref(),
            joints_share_bus: self.joints_bus().is_some_and(|bus| bus.shared),
        }
    }

    /// Time between two images, nanoseconds: in `sweep` mode a sweep of the boards.
    pub fn period_ns(&self) -> u64 {
        match self.tick.mode {
            TickMode::Timer => self.tick.period_ns(),
            TickMode::Sweep => self.sweep.board_period_ns(),
        }
    }

    /// Reads and checks a configuration file. A layout file named in it is looked for beside it.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        Self::parse(&text_of(path)?, path)
    }

    /// The same for what is recorded already, which has no bus to be read: the file may do without any `[[bus]]`.
    pub fn load_for_recordings(path: &Path) -> Result<Self, ConfigError> {
        let name = path.display().to_string();
        Self::parse_with(&text_of(path)?, &name, &|name| layout_beside(path, name), false)
    }

    /// Checks the text of a configuration file; `path` is only for messages and for finding a layout file.
    pub fn parse(text: &str, path: &Path) -> Result<Self, ConfigError> {
        let name = path.display().to_string();
        Self::parse_for(text, &name, &|name| layout_beside(path, name))
    }

    /// Checks the text of a configuration that stands in no folder; `file` is what it is called in messages, and
    /// `layout_of` finds the hand that it names.
    pub fn parse_for(
        text: &str,
        file: &str,
        layout_of: &dyn Fn(&str) -> Result<Layout, LayoutError>,
    ) -> Result<Self, ConfigError> {
        Self::parse_with(text, file, layout_of, true)
    }

    fn parse_with(
        text: &str,
        file: &str,
        layout_of: &dyn Fn(&str) -> Result<Layout, LayoutError>,
        needs_buses: bool,
    ) -> Result<Self, ConfigError> {
        let file = &File { text, name: file };
        let parsed: FileConfig = toml::from_str(text).map_err(|e| ConfigError::Syntax {
            file: file.name.to_owned(),
            line: file.line_at(e.span().map_or(0, |s| s.start)),
            message: syntax::problem(text, e.span(), e.message()),
        })?;
        let mut layout = layout_of(parsed.layout.get_ref())
            .map_err(|e| file.refuse(parsed.layout.span().start, e.to_string()))?;
        let sources = buses::sources_of(file, &parsed.bus, &layout)?;
        let are_scenes = sources.iter().all(|s| matches!(s, SourceAddress::Sim { .. }));
        if layout.buses.is_empty() && are_scenes && !sources.is_empty() {
            // A scene on a hand without boards is played on simulated ones.
            let refuse = |message| file.refuse(parsed.layout.span().start, message);
            layout = with_boards(layout).map_err(refuse)?;
        }
        if needs_buses || !sources.is_empty() {
            buses::check_buses(file, &parsed.bus, &layout, &sources)?;
        }
        let joints = match parsed.joints {
            Some(table) => {
                let offset = table.span().start;
                let FromMap(joints) = table.into_inner();
                joints
                    .check_beside(&layout, &sources)
                    .map_err(|e| file.refuse_in("joints", offset, e.to_string()))?;
                Some(joints)
            }
            None => None,
        };

        /// The table's value, or the default; then its check, with the line of the key or the table on failure.
        macro_rules! section {
            ($name:ident, $check:expr) => {{
                let (offset, value) = match parsed.$name {
                    Some(table) => (table.span().start, table.into_inner().0),
                    None => (0, Default::default()),
                };
                let check: Result<(), String> = $check(&value);
                check.map_err(|message| file.refuse_in(stringify!($name), offset, message))?;
                value
            }};
        }
        let profile = section!(profile, |v: &Profile| v.check().map_err(|e| e.to_string()));
        let implied = Preset::from(profile.method);
        let stated_conditioning = section!(conditioning, |v: &ConditionSettings| {
            let settings = v.over(implied);
            settings.validate(layout.len()).map_err(|e| e.to_string())
        });
        Ok(Self {
            tick: section!(tick, |v: &TickConfig| v.check().map_err(|e| e.to_string())),
            boards: section!(boards, |v: &BoardsConfig| v.check().map_err(|e| e.to_string())),
            sweep: section!(sweep, |v: &SweepConfig| v.check().map_err(|e| e.to_string())),
            conditioning: stated_conditioning.over(implied),
            stated_conditioning,
            profile,
            profiles: section!(profiles, |v: &ProfilesConfig| v
                .check()
                .map_err(|e| e.to_string())),
            socket: section!(socket, SocketConfig::check),
            control: section!(control, |v: &ControlConfig| v.mode_bits().map(drop)),
            realtime: section!(realtime, RealtimeConfig::check),
            can: section!(can, CanConfig::check),
            joints,
            layout,
            sources,
        })
    }
}

fn text_of(path: &Path) -> Result<String, ConfigError> {
    taxel_skin::read_text_file(path).map_err(|error| ConfigError::Read {
        path: path.display().to_string(),
        error,
    })
}

/// The hand of that name: a layout file beside the configuration, if it is not built in.
fn layout_beside(path: &Path, name: &str) -> Result<Layout, LayoutError> {
    let beside = path.parent().unwrap_or(Path::new("")).join(name);
    match Layout::builtin(name).is_none() && beside.is_file() {
        true => Layout::load(&beside),
        false => Layout::resolve(name),
    }
}

/// The text of a configuration and where it stands, to tell the line of what is refused.
struct File<'a> {
    text: &'a str,
    name: &'a str,
}

impl File<'_> {
    fn line_at(&self, offset: usize) -> usize {
        let before = &self.text.as_bytes()[..offset.min(self.text.len())];
        1 + before.iter().filter(|b| **b == b'\n').count()
    }

    fn refuse(&self, offset: usize, message: String) -> ConfigError {
        self.refuse_at(self.line_at(offset), message)
    }

    /// At the key that the message names, where the table is written line by line.
    fn refuse_in(&self, table: &str, offset: usize, message: String) -> ConfigError {
        let line = line_of(self.text, table, &message);
        self.refuse_at(line.unwrap_or_else(|| self.line_at(offset)), message)
    }

    fn refuse_at(&self, line: usize, message: String) -> ConfigError {
        ConfigError::Value {
            file: self.name.to_owned(),
            line,
            message,
        }
    }
}

/// Refuses a value outside its range.
fn within(
    table: &'static str,
    key: &str,
    value: impl Into<f64>,
    range: std::ops::RangeInclusive<f64>,
) -> Result<(), String> {
    taxel_hand::check_range(table, key, value, range, "").map_err(|e| e.to_string())
}

#[cfg(feature = "sim")]
fn with_boards(layout: Layout) -> Result<Layout, String> {
    taxel_sim::with_stand_in_boards(&layout).map_err(|e| e.to_string())
}

/// Refused when its scenes are opened.
#[cfg(not(feature = "sim"))]
fn with_boards(layout: Layout) -> Result<Layout, String> {
    Ok(layout)
}

impl RealtimeConfig {
    fn check(&self) -> Result<(), String> {
        within("realtime.", "priority", self.priority, 0.0..=49.0)
            .map_err(|e| format!("{e}; from 50 on the kernel's own threads run"))
    }
}

impl CanConfig {
    fn check(&self) -> Result<(), String> {
        within(
            "can.",
            "receive_buffer_kib",
            self.receive_buffer_kib,
            64.0..=65_536.0,
        )
    }
}
