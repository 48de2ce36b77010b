//! Motors that run only as long as the client is there that has had them switched on.

use super::Releases;
use super::write::{ServoRequest, joint_called};
use std::cell::{Cell, RefCell};
use std::time::Duration;
use taxel_joints::bus::WriteCommand;
use taxel_joints::{JointReader, JointSource, JointsConfig};

/// The motors that a connection holds. When it is dropped, however the connection ends, they are switched off.
pub(crate) struct Hold<'a> {
    config: Option<&'a JointsConfig>,
    reader: Option<&'a JointReader>,
    releases: &'a Releases,
    joints: RefCell<Vec<usize>>,
    patience: Cell<Option<Duration>>,
}

impl<'a> Hold<'a> {
    /// None yet.
    pub(crate) fn new(
        config: Option<&'a JointsConfig>,
        reader: Option<&'a JointReader>,
        releases: &'a Releases,
    ) -> Self {
        Self {
            config,
            reader,
            releases,
            joints: RefCell::default(),
            patience: Cell::default(),
        }
    }

    /// How long the client may be silent; `None` where it holds nothing.
    pub(crate) fn patience(&self) -> Option<Duration> {
        self.patience.get()
    }

    /// Notes what is about to be told to a servo, before it is: whether it is confirmed or not, the motor may run.
    pub(crate) fn note(&self, request: &ServoRequest) {
        let Some(JointSource::Dynamixel(config)) = self.config.map(|config| &config.source) else {
            return;
        };
        let Ok(joint) = joint_called(config, &request.joint) else {
            return;
        };
        let mut joints = self.joints.borrow_mut();
        match (request.torque, request.hold_ms) {
            (Some(true), Some(ms)) if (20.0..=10_000.0).contains(&ms) => {
                if !joints.contains(&joint) {
                    joints.push(joint);
                }
                let patience = Duration::from_secs_f64(ms / 1e3);
                let shortest = self.patience.get().map_or(patience, |other| other.min(patience));
                self.patience.set(Some(shortest));
            }
            (Some(false), _) => joints.retain(|held| *held != joint),
            _ => {}
        }
        if joints.is_empty() {
            self.patience.set(None);
        }
    }
}

impl Drop for Hold<'_> {
    fn drop(&mut self) {
        let Some(servos) = self.reader.and_then(|reader| reader.servos.as_deref()) else {
            return;
        };
        for joint in self.joints.take() {
            // Refused only where writing is, and then nothing was switched on.
            if let Ok(number) = servos.command(joint, WriteCommand::Torque(false)) {
                self.releases.let_go(joint, number);
            }
        }
    }
}
