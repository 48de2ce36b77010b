//! What is known of a hand at one instant.

use crate::joints_view::JointsView;
use crate::readers::Crowd;
use crate::reload::NotReloaded;
use taxel_can::{LinkState, SourceAddress, SourceCounters};
use taxel_hand::Faults;
use taxel_joints::JointsConfig;
use taxel_skin::{BoardStatus, Finding, Layout, Movement};

/// The hand as it is configured.
#[derive(Debug, Clone, Copy)]
pub struct HandSetup<'a> {
    /// Its boards and taxels.
    pub layout: &'a Layout,
    /// One source per bus of the layout, in its order.
    pub sources: &'a [SourceAddress],
    /// A board that is not heard for this long is silent, nanoseconds.
    pub silence_ns: u64,
    /// A value older than this is stale, nanoseconds; `None` for three periods of its board.
    pub stale_ns: Option<u64>,
    /// Where joint angles come from, if any are read.
    pub joints: Option<&'a JointsConfig>,
    /// Whether they come over a bus of the skin.
    pub joints_share_bus: bool,
}

/// What is known of the hand at one instant. Counts are those since the start.
#[derive(Debug, Clone, Copy)]
pub struct HandView<'a> {
    /// The engine's clock, nanoseconds.
    pub now_ns: u64,
    /// One entry per bus of the layout.
    pub buses: &'a [BusView],
    /// One entry per module of the layout.
    pub boards: &'a [BoardStatus],
    /// What the traffic shows.
    pub findings: &'a [Finding],
    /// What moved while the baseline was measured (`CalibrationReport::moved`).
    pub moved: Movement,
    /// Of each taxel, why it is out of use; empty where whoever looks tells of taxels itself.
    pub faults: &'a [Faults],
    /// Of each taxel, whether it is in contact without a change for long (`Conditioner::is_unchanging`).
    pub unchanging: &'a [bool],
    /// The joints; `None` where none are read.
    pub joints: Option<&'a JointsView>,
    /// Whether every board had the time to speak up since the start.
    pub boards_due: bool,
    /// What a daemon knows of itself; nothing where whoever looks is none.
    pub daemon: DaemonView<'a>,
}

/// What a daemon knows of itself and of others beside it.
#[derive(Debug, Default, Clone, Copy)]
pub struct DaemonView<'a> {
    /// Why the configuration that was to be read again last is not taken up; `None` where it was.
    pub reload_refused: Option<&'a NotReloaded>,
    /// Its sockets that nobody can connect to any more, and why; `None` where all can be reached.
    pub sockets_lost: Option<&'a str>,
    /// Of each bus, the process of another taxeld on this machine that reads it, in words; empty where nobody knows.
    pub other_daemons: &'a [Option<String>],
    /// Who holds the places of readers where some are turned away; `None` where none are.
    pub crowd: Option<&'a Crowd>,
}

/// What is known of one bus.
#[derive(Debug, Default, Clone, Copy)]
pub struct BusView {
    /// What its source has seen.
    pub counters: SourceCounters,
    /// Whether it can be reached.
    pub link: LinkState,
    /// Frames that are nobody's in the layout.
    pub unknown: u64,
    /// Commands that boards obey, which whoever looks has not sent itself.
    pub obeyed: u64,
    /// What is done about boards that are silent.
    pub starting: Starting,
}

/// What is done about boards that are silent, where their protocol knows a command to start them.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub enum Starting {
    /// They are told to start again and again.
    #[default]
    Repeated,
    /// Nothing: another program controls them.
    ByOthers,
    /// Nothing: whoever looks does not speak on this bus.
    NotAllowed,
}

/// What a judgement is made from.
pub(crate) struct Look<'a> {
    pub(crate) setup: &'a HandSetup<'a>,
    pub(crate) view: &'a HandView<'a>,
    /// Counters of the buses a while ago.
    pub(crate) before: &'a [SourceCounters],
    /// What the boards had sent at that time.
    pub(crate) boards_before: &'a [BoardStatus],
    /// What `before` is older by, seconds.
    pub(crate) seconds: f64,
    /// Since when whoever looks was not held up, nanoseconds: what was not heard before it is no silence.
    pub(crate) awake_ns: u64,
}
