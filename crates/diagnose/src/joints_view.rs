//! What is known of the joints at one instant.

use taxel_can::{LinkState, SourceCounters};
use taxel_joints::{
    AllegroSource, AnalogueSnapshot, DynamixelConfig, JointSource, JointsConfig, JointsSnapshot, PortStatus,
    ServoSnapshot,
};

/// A finger that is silent for this long counts as gone, nanoseconds.
const FINGER_SILENT_NS: u64 = 500_000_000;

/// What is known of the joints at one instant.
#[derive(Debug, Clone)]
pub struct JointsView {
    /// The engine's clock, nanoseconds.
    pub now_ns: u64,
    /// From the tick thread.
    pub tick: JointsSnapshot,
    /// What the bus that angles come over has seen.
    pub source: SourceCounters,
    /// Whether that bus can be reached.
    pub link: LinkState,
    /// From the thread that reads servos, where there are any.
    pub servos: Option<(ServoSnapshot, PortStatus)>,
    /// From the thread that reads potentiometers, where there are any.
    pub analogue: Option<AnalogueSnapshot>,
}

/// The joints' source with what is known of that kind alone.
#[derive(Debug, Clone, Copy)]
pub enum SourceView<'a> {
    /// Servos.
    Servos {
        /// Its configuration.
        config: &'a DynamixelConfig,
        /// What was read.
        snapshot: &'a ServoSnapshot,
        /// The serial port.
        port: &'a PortStatus,
    },
    /// An Allegro hand.
    Hand(&'a AllegroSource),
}

impl JointsView {
    /// The source that `config` names; `None` while nothing is known of it.
    pub fn of<'a>(&'a self, config: &'a JointsConfig) -> Option<SourceView<'a>> {
        match (&config.source, &self.servos) {
            (JointSource::Dynamixel(config), Some((snapshot, port))) => Some(SourceView::Servos {
                config,
                snapshot,
                port,
            }),
            (JointSource::Dynamixel(_), None) => None,
            (JointSource::Allegro(hand), _) => Some(SourceView::Hand(hand)),
        }
    }

    /// Cycles of the servos, or readings of the joint that has sent most.
    pub fn cycles(&self) -> u64 {
        match &self.servos {
            Some((snapshot, _)) => snapshot.counters.cycles,
            None => self.tick.counts.iter().map(|c| c.readings).max().unwrap_or(0),
        }
    }

    /// Whether a finger of an Allegro hand (0 to 3) was heard lately; `None` if it never was.
    pub fn finger_speaks(&self, finger: usize) -> Option<bool> {
        let heard_ns = self.tick.counts.get(4 * finger)?.heard_ns?;
        Some(self.now_ns.saturating_sub(heard_ns) < FINGER_SILENT_NS)
    }
}
