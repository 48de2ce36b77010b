//! Joint angles into tactile frames, on the tick thread: without waiting, allocating or asking for a clock.

use super::hand_bus;
use crate::config::Config;
use std::sync::Arc;
use taxel_can::{LinkState, Received, SourceCounters};
use taxel_hand::TactileFrame;
use taxel_joints::{
    AllegroCounters, AllegroDecoder, AllegroFrame, JointHistory, JointReader, JointSource, JointsConfigError,
};

/// Readings kept of an Allegro hand's joints: a fifth of a second at 333 Hz.
const HISTORY: usize = 64;

/// Where a pipeline takes the angles of a frame from.
pub(crate) enum JointFeed {
    /// No joints: frames carry none.
    None,
    /// Servos that another thread reads.
    Servos {
        reader: Arc<JointReader>,
        /// The tick thread's own copy of the readings, so that it needs no lock to look at them.
        history: JointHistory,
        hold_ns: u64,
    },
    /// A hand whose frames come with those of the skin.
    Hand {
        bus: u8,
        decoder: Box<AllegroDecoder>,
        history: JointHistory,
        hold_ns: u64,
    },
}

/// What an Allegro hand and its bus have delivered, and the angles of the newest frame whatever their source.
#[derive(Debug, Clone, Default)]
pub(crate) struct JointsSnapshot {
    /// Radians; not a number where unknown.
    pub(crate) angles: Vec<f32>,
    /// From the newest frame's instant to the nearest reading, nanoseconds.
    pub(crate) age_ns: Vec<u64>,
    /// Frames of the hand, by kind.
    pub(crate) hand: AllegroCounters,
    /// When each finger was heard last, nanoseconds.
    pub(crate) finger_ns: [Option<u64>; 4],
    /// What the hand's bus has seen.
    pub(crate) source: SourceCounters,
    /// Whether the hand's bus can be reached.
    pub(crate) link: LinkState,
}

fn hold_ns(hold_ms: f64) -> u64 {
    (hold_ms * 1e6) as u64
}

impl JointFeed {
    /// The feed of a configuration. Servos have none without their reader, as in the pipeline of a recording.
    pub(crate) fn new(config: &Config) -> Result<Self, JointsConfigError> {
        let Some(joints) = &config.joints else {
            return Ok(Self::None);
        };
        match (&joints.source, &joints.allegro, hand_bus(config)) {
            (JointSource::Allegro { .. }, Some(allegro), Some(bus)) => Ok(Self::Hand {
                bus: bus.index,
                decoder: Box::new(AllegroDecoder::new(allegro)?),
                history: JointHistory::new(taxel_joints::ALLEGRO_JOINTS, HISTORY),
                hold_ns: hold_ns(joints.hold_ms),
            }),
            (JointSource::Allegro { .. }, ..) => Err(JointsConfigError::NoAllegro),
            (JointSource::Dynamixel { .. }, ..) => Ok(Self::None),
        }
    }

    /// The feed of servos.
    pub(crate) fn servos(reader: Arc<JointReader>, hold_ms: f64) -> Self {
        Self::Servos {
            history: reader.new_history(),
            reader,
            hold_ns: hold_ns(hold_ms),
        }
    }

    fn joints(&self) -> usize {
        match self {
            Self::None => 0,
            Self::Servos { history, .. } | Self::Hand { history, .. } => history.joints(),
        }
    }

    /// Makes room for the angles in a frame, all unknown.
    pub(crate) fn prepare(&self, frame: &mut TactileFrame) {
        frame.joints = vec![f32::NAN; self.joints()];
        frame.joint_age_ns = vec![u64::MAX; self.joints()];
    }

    /// Takes a CAN frame; says whether it was one of the hand, which is nothing to the skin.
    pub(crate) fn push(&mut self, bus: u8, received: &Received) -> bool {
        let Self::Hand {
            bus: own,
            decoder,
            history,
            ..
        } = self
        else {
            return false;
        };
        if bus != *own {
            return false;
        }
        match decoder.push(&received.frame, received.t_ns) {
            AllegroFrame::Position { finger } => {
                for joint in 4 * finger..4 * finger + 4 {
                    if let Some((angle_rad, t_ns)) = decoder.joint(joint) {
                        history.push(joint, t_ns, angle_rad);
                    }
                }
                true
            }
            AllegroFrame::Malformed { .. } => true,
            AllegroFrame::Other => false,
        }
    }

    /// Writes the angles at the frame's own instant into it.
    ///
    /// While the reader is at its readings, those that were copied before are used once more; their age tells.
    pub(crate) fn fill(&mut self, frame: &mut TactileFrame) {
        let (history, hold_ns) = match self {
            Self::None => return,
            Self::Servos {
                reader,
                history,
                hold_ns,
            } => {
                reader.try_history_into(history);
                (&*history, *hold_ns)
            }
            Self::Hand { history, hold_ns, .. } => (&*history, *hold_ns),
        };
        let angles = frame.joints.iter_mut().zip(&mut frame.joint_age_ns);
        for (joint, (angle, age_ns)) in angles.enumerate() {
            let at = history.at(joint, frame.t_ns);
            *age_ns = at.map_or(u64::MAX, |at| at.age_ns);
            *angle = match at {
                Some(at) if at.age_ns <= hold_ns => at.angle_rad as f32,
                _ => f32::NAN,
            };
        }
    }

    /// Copies what is known into the snapshot; allocates nothing once the snapshot has its memory.
    pub(crate) fn snapshot(&self, frame: &TactileFrame, into: &mut JointsSnapshot) {
        into.angles.clone_from(&frame.joints);
        into.age_ns.clone_from(&frame.joint_age_ns);
        if let Self::Hand { decoder, .. } = self {
            into.hand = *decoder.counters();
            for (finger, t_ns) in into.finger_ns.iter_mut().enumerate() {
                *t_ns = decoder.joint(4 * finger).map(|(_, t_ns)| t_ns);
            }
        }
    }
}

impl JointsSnapshot {
    /// Empty, with all its memory.
    pub(crate) fn new(joints: usize) -> Self {
        Self {
            angles: vec![f32::NAN; joints],
            age_ns: vec![u64::MAX; joints],
            ..Self::default()
        }
    }

    /// Frames that were those of an Allegro hand, and so none of the skin's.
    pub(crate) fn of_hand(&self) -> u64 {
        self.hand.positions.iter().sum::<u64>() + self.hand.malformed
    }

    /// How many angles are known, for the line of `systemctl status`; empty where no joints are read.
    pub(crate) fn summary(&self) -> String {
        match self.angles.len() {
            0 => String::new(),
            all => {
                let known = self.angles.iter().filter(|angle| angle.is_finite()).count();
                format!(", {known}/{all} joints")
            }
        }
    }
}
