//! Joint angles on their way into tactile frames: what comes over CAN or from a reading thread goes
//! in, and each frame gets every joint's angle at its own instant. No I/O and no clock; after the
//! start nothing allocates.

use crate::allegro::MotorErrors;
use crate::analogue::READINGS_KEPT;
use crate::config::JointsConfig;
use crate::error::JointsConfigError;
use crate::source::{CanJoints, JointCount, JointReadings};
use crate::synchrony::{JointHistory, JointMotion};
use taxel_can::{CanFrame, Received};
use taxel_hand::TactileFrame;

/// The joints of a hand, from one source after the other in one list.
pub struct JointFeed {
    sources: Vec<FedSource>,
    hold_ns: u64,
}

/// One source of the feed.
struct FedSource {
    readings: JointReadings,
    /// The number of its bus and its decoder, where its angles come over CAN.
    can: Option<(u8, Box<dyn CanJoints>)>,
}

/// A frame to be sent to a source.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct JointCommand {
    /// Number of the bus.
    pub bus: u8,
    /// What to send.
    pub frame: CanFrame,
}

/// The angles of the newest tactile frame, and what each joint has delivered.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct JointsSnapshot {
    /// Radians; not a number where unknown.
    pub angles: Vec<f32>,
    /// From the newest frame's instant to the nearest reading, nanoseconds; `u64::MAX` where there is none.
    pub age_ns: Vec<u64>,
    /// What each joint has delivered as CAN frames; nothing of those that a thread reads.
    pub counts: Vec<JointCount>,
    /// CAN frames that were the joints', and so none of the skin's.
    pub frames: u64,
    /// Those of them that were not as they should be, and told nothing.
    pub malformed: u64,
    /// What an Allegro hand has reported of its motors.
    pub motor_errors: MotorErrors,
}

impl JointFeed {
    /// A hand without joints: frames carry none.
    pub fn none() -> Self {
        Self {
            sources: Vec::new(),
            hold_ns: 0,
        }
    }

    /// The feed of a configuration whose source, if it is on CAN, has the bus number `bus`.
    ///
    /// What a thread reads is among the joints only where there is such a thread (`is_read`): a
    /// recording of CAN frames has none of it.
    pub fn new(config: &JointsConfig, bus: Option<u8>, is_read: bool) -> Result<Self, JointsConfigError> {
        let source = config.source.config();
        let can = bus.zip(source.can_joints()?);
        let mut sources = Vec::new();
        if can.is_some() || is_read {
            sources.push(FedSource {
                readings: JointReadings::new(source.joint_names().len(), source.readings_kept()),
                can,
            });
        }
        if let Some(analogue) = config.analogue.as_ref().filter(|_| is_read) {
            sources.push(FedSource {
                readings: JointReadings::new(analogue.joint.len(), READINGS_KEPT),
                can: None,
            });
        }
        Ok(Self {
            sources,
            hold_ns: (config.hold_ms * 1e6) as u64,
        })
    }

    fn joints(&self) -> usize {
        self.sources.iter().map(|s| s.readings.counts.len()).sum()
    }

    /// Makes room for the angles in a frame, all unknown.
    pub fn prepare(&self, frame: &mut TactileFrame) {
        frame.joints = vec![f32::NAN; self.joints()];
        frame.joint_age_ns = vec![u64::MAX; self.joints()];
        // CAN sources tell angles alone.
        if self.sources.iter().any(|source| source.can.is_none()) {
            frame.joint_velocity_rad_s = vec![f32::NAN; self.joints()];
            frame.joint_current_a = vec![f32::NAN; self.joints()];
        }
    }

    /// Takes a CAN frame of a bus; says whether it was one of a source, which is nothing to the skin.
    pub fn handle_frame(&mut self, bus: u8, received: &Received) -> bool {
        self.sources.iter_mut().any(|source| match &mut source.can {
            Some((own, can)) if *own == bus => {
                let is_own = can.handle_frame(received, &mut source.readings);
                source.readings.frames += u64::from(is_own);
                is_own
            }
            _ => false,
        })
    }

    /// Has the readings of a source that a thread reads brought up to date: `update` is given those
    /// known so far.
    pub fn handle_joints(&mut self, source: usize, update: impl FnOnce(&mut JointHistory)) {
        if let Some(source) = self.sources.get_mut(source) {
            update(&mut source.readings.history);
        }
    }

    /// Whether a bus can be reached, told at every round before [`JointFeed::poll_command`].
    pub fn handle_link(&mut self, bus: u8, is_up: bool) {
        for (own, can) in self.sources.iter_mut().filter_map(|source| source.can.as_mut()) {
            if *own == bus {
                can.handle_link(is_up);
            }
        }
    }

    /// The next frame that a source is to be sent now.
    pub fn poll_command(&mut self, now_ns: u64) -> Option<JointCommand> {
        self.sources.iter_mut().find_map(|source| {
            let (bus, can) = source.can.as_mut()?;
            let frame = can.poll_command(now_ns)?;
            Some(JointCommand { bus: *bus, frame })
        })
    }

    /// The command could not be sent; it is given again after the next [`JointFeed::handle_link`].
    pub fn command_not_sent(&mut self, command: &JointCommand) {
        for (bus, can) in self.sources.iter_mut().filter_map(|source| source.can.as_mut()) {
            if *bus == command.bus {
                can.command_not_sent();
            }
        }
    }

    /// When the next command is due without a frame coming before, nanoseconds.
    pub fn poll_due_ns(&self) -> Option<u64> {
        let due = |source: &FedSource| source.can.as_ref()?.1.poll_due_ns();
        self.sources.iter().filter_map(due).min()
    }

    /// From now on [`JointFeed::poll_command`] gives what ends the sources' work.
    pub fn stop(&mut self) {
        for (_, can) in self.sources.iter_mut().filter_map(|source| source.can.as_mut()) {
            can.stop();
        }
    }

    /// Writes the angles at the frame's own instant, and their ages, into it; and, where it has
    /// room for them, velocity and current of the newest readings. What is further than `hold_ms`
    /// from its nearest reading is unknown.
    pub fn fill(&self, frame: &mut TactileFrame) {
        let t_ns = frame.t_ns;
        let joints = self.sources.iter().flat_map(|source| {
            let history = &source.readings.history;
            (0..history.joints()).map(move |joint| history.at(joint, t_ns))
        });
        let places = frame.joints.iter_mut().zip(&mut frame.joint_age_ns);
        for (at, (angle, age_ns)) in joints.zip(places) {
            *age_ns = at.map_or(u64::MAX, |at| at.age_ns);
            *angle = match at {
                Some(at) if at.age_ns <= self.hold_ns => at.angle_rad as f32,
                _ => f32::NAN,
            };
        }
        let motion = self
            .sources
            .iter()
            .flat_map(|source| source.readings.history.motion());
        let places = frame
            .joint_velocity_rad_s
            .iter_mut()
            .zip(&mut frame.joint_current_a);
        for ((motion, angle), (velocity, current)) in motion.zip(&frame.joints).zip(places) {
            let known = if angle.is_finite() {
                *motion
            } else {
                JointMotion::UNKNOWN
            };
            (*velocity, *current) = (known.velocity_rad_s, known.current_a);
        }
    }

    /// Copies what is known into the snapshot; `frame` is the newest. Allocates nothing once the
    /// snapshot has its memory.
    pub fn snapshot(&self, frame: &TactileFrame, into: &mut JointsSnapshot) {
        let readings = || self.sources.iter().map(|source| &source.readings);
        into.angles.clone_from(&frame.joints);
        into.age_ns.clone_from(&frame.joint_age_ns);
        into.counts.clear();
        into.counts.extend(readings().flat_map(|r| &r.counts));
        into.frames = readings().map(|r| r.frames).sum();
        into.malformed = readings().map(|r| r.malformed).sum();
        // That of the first source: beside a hand there are potentiometers alone.
        into.motor_errors = readings().next().map(|r| r.motor_errors).unwrap_or_default();
    }
}

impl JointsSnapshot {
    /// Nothing known of `joints` joints, with all its memory.
    pub fn new(joints: usize) -> Self {
        Self {
            angles: vec![f32::NAN; joints],
            age_ns: vec![u64::MAX; joints],
            counts: vec![JointCount::default(); joints],
            frames: 0,
            malformed: 0,
            motor_errors: MotorErrors::default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    fn feed(table: &str, bus: Option<u8>, is_read: bool) -> (JointFeed, TactileFrame) {
        let config: JointsConfig = toml::from_str(table).unwrap();
        let feed = JointFeed::new(&config, bus, is_read).unwrap();
        let mut frame = TactileFrame::new(1);
        feed.prepare(&mut frame);
        (feed, frame)
    }

    fn finger(t_ns: u64, data: &[u8]) -> Received {
        let frame = CanFrame::standard(0x084, data).unwrap();
        Received { t_ns, frame }
    }

    #[test]
    fn a_hand_s_frames_are_taken_from_its_own_bus_alone_and_counted() {
        let (mut feed, mut frame) = feed("source = \"allegro:can2\"\nallegro.version = 4", Some(2), false);
        assert!(!feed.handle_frame(0, &finger(MS, &[0; 8])));
        assert!(feed.handle_frame(2, &finger(MS, &[0; 8])));
        assert!(feed.handle_frame(2, &finger(2 * MS, &[0; 6])));
        let other = CanFrame::standard(0x300, &[]).unwrap();
        assert!(!feed.handle_frame(
            2,
            &Received {
                t_ns: 3 * MS,
                frame: other
            }
        ));
        frame.t_ns = 4 * MS;
        feed.fill(&mut frame);
        assert_eq!((frame.joints[4], frame.joint_age_ns[4]), (0.0, 3 * MS));
        assert!(frame.joints[0].is_nan() && frame.joint_age_ns[0] == u64::MAX);
        let mut snapshot = JointsSnapshot::new(16);
        feed.snapshot(&frame, &mut snapshot);
        assert_eq!((snapshot.frames, snapshot.malformed), (2, 1));
        let heard = JointCount {
            readings: 1,
            heard_ns: Some(MS),
        };
        assert_eq!(snapshot.counts[4..8], [heard; 4]);
        assert_eq!(snapshot.counts[0], JointCount::default());
    }

    #[test]
    fn what_a_thread_reads_is_among_the_joints_only_where_there_is_a_thread() {
        let table = "source = \"dynamixel:/dev/x\"\nhold_ms = 10.0\n[[servo]]\nid = 1\nname = \"a\"";
        assert_eq!(feed(table, None, false).1.joints.len(), 0);
        let (mut feed, mut frame) = feed(table, None, true);
        let motion = JointMotion {
            velocity_rad_s: 1.5,
            current_a: f32::NAN,
        };
        feed.handle_joints(0, |history| {
            history.push(0, MS, 0.5);
            history.set_motion(0, motion);
        });
        feed.handle_joints(1, |_| panic!("there is no second source"));
        for (t_ns, known) in [(MS, true), (11 * MS, true), (11 * MS + 1, false)] {
            frame.t_ns = t_ns;
            feed.fill(&mut frame);
            assert_eq!(frame.joints[0].is_finite(), known, "{t_ns}");
            assert_eq!(frame.joint_age_ns[0], t_ns - MS);
            assert_eq!(frame.joint_velocity_rad_s[0] == 1.5, known, "{t_ns}");
            assert!(frame.joint_current_a[0].is_nan());
        }
    }

    #[test]
    fn a_hand_on_a_bus_of_its_own_is_started_through_the_feed_and_stopped() {
        let table = "source = \"allegro:can2\"\nallegro.version = 4\nallegro.own_bus = true";
        let (mut feed, _) = feed(table, Some(2), false);
        feed.handle_link(1, true);
        assert_eq!((feed.poll_command(0), feed.poll_due_ns()), (None, None));
        feed.handle_link(2, true);
        let first = feed.poll_command(0).unwrap();
        assert_eq!((first.bus, first.frame.id()), (2, 0x204));
        feed.command_not_sent(&first);
        assert_eq!(feed.poll_command(0), None);
        feed.handle_link(2, true);
        assert_eq!(feed.poll_command(MS), Some(first));
        assert_eq!(feed.poll_command(MS).unwrap().frame.id(), 0x100);
        assert_eq!(feed.poll_due_ns(), Some(1001 * MS));
        feed.stop();
        assert_eq!(feed.poll_command(MS).unwrap().frame.id(), 0x104);
        assert_eq!(feed.poll_command(MS), None);
    }
}
