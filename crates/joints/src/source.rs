//! What a source of joint angles is to the rest of the program: the seam between its folder and
//! everything else.
//!
//! Each kind of source has a folder with a [`SourceConfig`] and, where its angles come over CAN,
//! [`CanJoints`]. Another kind is another folder and its line in the lists of `config.rs`.

use crate::allegro::MotorErrors;
use crate::error::JointsConfigError;
use crate::synchrony::JointHistory;
use std::path::Path;
use taxel_can::{CanFrame, IdFilter, Received, SourceAddress};
use taxel_skin::Layout;

/// The configuration of one source, checked and asked.
pub trait SourceConfig {
    /// What it is in a sentence, such as `Allegro hand`.
    fn device(&self) -> &'static str;

    /// Refuses what cannot be.
    fn check(&self) -> Result<(), JointsConfigError>;

    /// Names of its joints, in the order in which their angles are given.
    fn joint_names(&self) -> Vec<String>;

    /// Readings that are kept of each joint.
    fn readings_kept(&self) -> usize;

    /// The CAN bus that its angles come over, if they do.
    fn can_bus(&self) -> Option<&SourceAddress> {
        None
    }

    /// The serial device that a thread reads its angles from ([`crate::JointReader`]), if one does.
    fn serial_device(&self) -> Option<&Path> {
        None
    }

    /// What a CAN bus of its own has to let through; everything where there is none.
    fn filters(&self) -> Vec<IdFilter> {
        Vec::new()
    }

    /// The standard ids, in order, that both it and the skin's boards on bus `bus` (index into
    /// [`Layout::buses`]) use.
    fn overlapping_ids(&self, _layout: &Layout, _bus: u8) -> Vec<u16> {
        Vec::new()
    }

    /// What makes angles of the frames of its CAN bus; `None` if it is on none.
    fn can_joints(&self) -> Result<Option<Box<dyn CanJoints>>, JointsConfigError> {
        Ok(None)
    }
}

/// A source whose angles come as CAN frames, and what it sends. Times are those of the pipeline,
/// nanoseconds. Nothing here does I/O or allocates.
pub trait CanJoints: Send {
    /// Takes a frame of its bus; says whether it was one of its own, which is nothing to the skin.
    fn handle_frame(&mut self, received: &Received, readings: &mut JointReadings) -> bool;

    /// Whether its bus can be reached, told at every round.
    fn handle_link(&mut self, _is_up: bool) {}

    /// The next frame to be sent now.
    fn poll_command(&mut self, _now_ns: u64) -> Option<CanFrame> {
        None
    }

    /// The frame that [`CanJoints::poll_command`] gave could not be sent. It is given again; the
    /// caller goes on with other things first.
    fn command_not_sent(&mut self) {}

    /// When a frame is to be sent without another coming; `None` if none is, or it is up to the bus.
    fn poll_due_ns(&self) -> Option<u64> {
        None
    }

    /// From now on [`CanJoints::poll_command`] gives what ends its work.
    fn stop(&mut self) {}
}

/// How much one joint has delivered.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct JointCount {
    /// Readings.
    pub readings: u64,
    /// Time of the newest, nanoseconds; `None` before the first.
    pub heard_ns: Option<u64>,
}

/// The readings of one source's joints.
#[derive(Debug, Clone)]
pub struct JointReadings {
    /// The last of each joint.
    pub history: JointHistory,
    /// What each joint has delivered as CAN frames.
    pub counts: Vec<JointCount>,
    /// CAN frames that were its own.
    pub frames: u64,
    /// Those of them that were not as they should be, and told nothing.
    pub malformed: u64,
    /// What an Allegro hand has reported of its motors.
    pub motor_errors: MotorErrors,
}

impl JointReadings {
    /// Room for `depth` readings of each of `joints` joints.
    pub fn new(joints: usize, depth: usize) -> Self {
        Self {
            history: JointHistory::new(joints, depth),
            counts: vec![JointCount::default(); joints],
            frames: 0,
            malformed: 0,
            motor_errors: MotorErrors::default(),
        }
    }

    /// Takes a reading: an angle in radians at `t_ns`.
    pub fn push(&mut self, joint: usize, t_ns: u64, angle_rad: f64) {
        if let Some(count) = self.counts.get_mut(joint) {
            count.readings += 1;
            count.heard_ns = Some(t_ns);
        }
        self.history.push(joint, t_ns, angle_rad);
    }
}
