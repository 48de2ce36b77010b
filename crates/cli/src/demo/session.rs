//! The demo's own daemon, its subscriber and its control socket.

use super::Args;
use anyhow::Context;
use std::path::PathBuf;
use std::time::Instant;
use taxel_can::SourceAddress;
use taxel_engine::TickMode;
use taxel_hand::Profile;
use taxel_joints::{DynamixelConfig, JointSource, JointsConfig};
use taxel_sim::Scene;
use taxel_sim::servo::{SERVO_BAUD, ServoBus, ServoPty, servos_of_scene};
use taxel_skin::Layout;
use taxel_wire::{Subscribe, Subscriber};
use taxeld::{Config, Daemon};
use tempfile::TempDir;

/// A running daemon on simulated buses, with its sockets in a directory of its own.
pub(super) struct Session {
    daemon: Daemon,
    pub(super) images: PathBuf,
    pub(super) control: PathBuf,
    /// When the scene began, on the clock of the images' times, nanoseconds.
    pub(super) scene_began_ns: u64,
    pub(super) began: Instant,
    pub(super) layout: Layout,
    /// The profile that it was started with.
    pub(super) profile: Profile,
    /// The servos' serial port is gone when this is.
    _servos: Option<ServoPty>,
    /// Removed, with the sockets in it, when the session ends.
    _directory: TempDir,
}

impl Session {
    /// Starts the daemon. Images are made as soon as a sweep is complete.
    pub(super) fn start(
        args: &Args,
        scene_name: &str,
        scene: &Scene,
        layout: Layout,
    ) -> anyhow::Result<Self> {
        let directory = tempfile::Builder::new()
            .prefix("taxel-demo-")
            .tempdir()
            .context("a directory for sockets")?;
        let sources = layout
            .buses
            .iter()
            .map(|_| SourceAddress::Sim {
                scene: scene_name.into(),
            })
            .collect();
        let mut config = Config::new(layout.clone(), sources);
        config.tick.mode = TickMode::Sweep;
        config.profile.levels = args.levels.unwrap_or(config.profile.levels);
        config.profile.actuators = args.actuators.unwrap_or(config.profile.actuators);
        config.set_method(args.method.unwrap_or(config.profile.method), args.conditioning);
        config.profile.check()?;
        config.socket.images = directory.path().join("images.sock");
        config.socket.control = directory.path().join("control.sock");
        // The demo is a guest on this machine.
        config.realtime.priority = 0;
        let (images, control) = (config.socket.images.clone(), config.socket.control.clone());
        let servos = servos(scene, &layout, &mut config)?;
        let profile = config.profile.clone();
        let (scene_began_ns, began) = (taxel_can::monotonic_ns(), Instant::now());
        let daemon = Daemon::start(config)?;
        Ok(Self {
            daemon,
            images,
            control,
            scene_began_ns,
            began,
            layout,
            profile,
            _servos: servos,
            _directory: directory,
        })
    }

    /// A subscriber of images, raw frames and the status.
    pub(super) fn subscribe(&self) -> anyhow::Result<Subscriber> {
        let mut subscriber = Subscriber::connect(&self.images)?;
        subscriber.subscribe(&Subscribe {
            raw: true,
            status: true,
            ..Subscribe::default()
        })?;
        Ok(subscriber)
    }

    /// Ends the daemon; every subscriber is let go.
    pub(super) fn stop(self) -> anyhow::Result<()> {
        self.daemon
            .stop()
            .map_err(|fault| anyhow::anyhow!("the demo's daemon: {fault}"))
    }
}

/// Simulated servos that close the fingers as the scene has it, where there are fingers, and their configuration.
fn servos(scene: &Scene, layout: &Layout, config: &mut Config) -> anyhow::Result<Option<ServoPty>> {
    let servos = servos_of_scene(scene, layout, taxel_can::monotonic_ns());
    if servos.is_empty() {
        return Ok(None);
    }
    let mut joints = DynamixelConfig::new("", servos.iter().map(|servo| servo.build.id));
    for (joint, servo) in joints.servo.iter_mut().zip(&servos) {
        joint.name.clone_from(&servo.name);
    }
    let bus = ServoBus::new(servos.into_iter().map(|servo| servo.build), SERVO_BAUD);
    let servos = ServoPty::open(bus).context("a pseudo terminal for the servos")?;
    joints.baud = SERVO_BAUD;
    joints.path = servos.path().into();
    config.joints = Some(JointsConfig::new(JointSource::Dynamixel(joints)));
    Ok(Some(servos))
}
