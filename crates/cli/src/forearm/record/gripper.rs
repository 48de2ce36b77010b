//! The gripper, moved through the daemon.

use super::super::live::{BEGINS, ENDS, SAMPLE};
use super::followed::Followed;
use super::newest::{Joints, Newest};
use crate::client::control::{self, Connection, Held};
use anyhow::{Context, anyhow, bail};
use serde_json::{Map, Value, json};
use std::fmt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use taxel_forearm::{FINGERS, FULL_PWM, Sample, Squeeze};
use taxel_playback::interrupt::Interrupt;
use taxel_wire::status::{JointsStatus, Status};

/// After so long without a request the daemon lets the motors go: eight samples.
const HOLD_MS: f64 = 1000.0;
/// A finger that has moved less than this, degrees, has not squeezed.
const MOVED_DEG: f64 = 1.0;

/// The gripper of a daemon.
#[derive(Debug)]
pub(super) struct Gripper {
    control: PathBuf,
    newest: Newest,
    watchdog_ms: f64,
    fingers: [String; FINGERS],
    potentiometers: Vec<String>,
    /// Numbers of those joints.
    theta_a: [usize; FINGERS],
    theta_p: Vec<usize>,
}

impl Gripper {
    /// The gripper that the daemon's joints are, with these names or the first that fit.
    pub(super) fn find(
        control: PathBuf,
        images: &Path,
        fingers: &[String],
        potentiometers: &[String],
    ) -> anyhow::Result<Self> {
        let reply = control::request(&control, &json!({ "cmd": "status" }))?;
        let status = Status::try_from(reply["status"].clone())?;
        let joints =
            (status.joints).context("the daemon reads no joints; give its configuration a table [joints] with the two servos, and start it anew")?;
        let watchdog_ms = (joints.servos.as_ref())
            .and_then(|servos| servos.watchdog_ms)
            .context("the daemon may not move its servos; set allow_writes = true in its table [joints], and start it anew")?;
        let (fingers, potentiometers) = choose(&joints, fingers, potentiometers)?;
        let place = |name: &String| joints.joints.iter().position(|joint| joint.name == *name);
        let theta_a = fingers.each_ref().map(|name| place(name).unwrap_or_default());
        Ok(Self {
            newest: Newest::start(images)?,
            control,
            watchdog_ms: watchdog_ms.into(),
            theta_a,
            theta_p: potentiometers.iter().filter_map(place).collect(),
            fingers,
            potentiometers,
        })
    }

    /// Names of the joints that are its servos.
    pub(super) fn fingers(&self) -> &[String] {
        &self.fingers
    }

    /// Names of the joints that are its potentiometers; none, or two.
    pub(super) fn potentiometers(&self) -> &[String] {
        &self.potentiometers
    }

    /// Whether the hand has a tactile finger, whose images are kept.
    pub(super) fn has_touch(&self) -> bool {
        self.newest.has_touch()
    }

    /// Refuses a daemon whose frames come less often than steps of this length, which would each last as long as a frame.
    pub(super) fn keeps_up(&self, period: Duration) -> anyhow::Result<()> {
        let interval = self.newest.interval(period)?;
        if interval > period {
            bail!(
                "the daemon's frames come every {:.0} ms, and a step of this ramp lasts {:.0} ms; it takes {:.1} frames per \
                 second at least ([tick] of the daemon's configuration)",
                1e3 * interval.as_secs_f64(),
                1e3 * period.as_secs_f64(),
                1.0 / period.as_secs_f64()
            );
        }
        Ok(())
    }

    /// Squeezes and releases with this PWM, counts of 885, one sample after another; `None` where it was asked to stop.
    /// However it ends, the motors are switched off; an error says whether they are known to be.
    pub(super) fn squeeze(
        &self,
        pwm: &[f64],
        period: Duration,
        interrupt: &Interrupt,
    ) -> anyhow::Result<Option<Squeeze>> {
        let mut motors = Motors::of(self)?;
        let made = self.squeeze_with(&mut motors, pwm, period, interrupt);
        if motors.running == 0 {
            // Nothing was driven: another program has the gripper.
            return made;
        }
        let released = motors.let_go();
        if motors.has_begun && !matches!(made, Ok(Some(_))) {
            // Who estimates it live waits for its end. A daemon that is gone has told them already.
            let _ = control::request(&self.control, &mark(ENDS));
        }
        let squeeze = made.with_context(|| self.left_behind(&released))?;
        released.with_context(|| self.may_run_on())?;
        if let Some(squeeze) = &squeeze {
            self.has_moved(squeeze)?;
        }
        Ok(squeeze)
    }

    /// What a fault left the motors in.
    fn left_behind(&self, released: &anyhow::Result<()>) -> String {
        match released {
            Ok(()) => "its motors are let go".into(),
            Err(error) => format!("{} ({error:#})", self.may_run_on()),
        }
    }

    fn may_run_on(&self) -> String {
        format!(
            "its motors may still be on: the daemon lets them go {HOLD_MS} ms after this program fell silent, and \
             without the daemon they stop by themselves after {} ms",
            self.watchdog_ms
        )
    }

    fn squeeze_with(
        &self,
        motors: &mut Motors<'_>,
        pwm: &[f64],
        period: Duration,
        interrupt: &Interrupt,
    ) -> anyhow::Result<Option<Squeeze>> {
        motors.start()?;
        let mut due = Instant::now();
        let mut squeeze = Squeeze::default();
        let (mut first_ns, mut newest_ns) = (None, None);
        let motor = |finger: usize| Followed::new(&self.fingers[finger], self.theta_a[finger], true);
        let [mut left, mut right] = [0, 1].map(motor);
        let potentiometers = self.potentiometers.iter().zip(&self.theta_p);
        let mut potentiometers: Vec<_> = potentiometers
            .map(|(name, joint)| Followed::new(name, *joint, false))
            .collect();
        for pwm in pwm {
            motors.mark(&format!("{SAMPLE}{pwm}"))?;
            motors.drive(*pwm)?;
            // The finger has until the next step to come to rest.
            // One that came late does not make the next ones short.
            due = (due + period).max(Instant::now());
            if !interrupt.sleep_until(due) {
                return Ok(None);
            }
            // As long again, where angles of another sample are all that there is.
            let joints = self
                .newest
                .after(newest_ns, |joints| !self.has_late(joints), period)?;
            newest_ns = Some(joints.t_ns);
            let time_ms = joints.t_ns.saturating_sub(*first_ns.get_or_insert(joints.t_ns)) as f64 / 1e6;
            squeeze.push(Sample {
                time_ms,
                theta_a_deg: [left.angle(&joints.angles)?, right.angle(&joints.angles)?],
                theta_p_deg: match potentiometers.as_mut_slice() {
                    [left, right] => [left.angle(&joints.angles)?, right.angle(&joints.angles)?],
                    _ => [f64::NAN; FINGERS],
                },
                pwm: *pwm,
            });
            if self.has_touch() {
                let image = joints.image.as_ref();
                squeeze
                    .push_image(image.context("the tactile finger feels nothing; `taxel status` says why")?);
            }
        }
        motors.mark(ENDS)?;
        Ok(Some(squeeze))
    }

    /// Whether an angle of these is of another sample.
    fn has_late(&self, joints: &Joints) -> bool {
        let mut own = self.theta_a.iter().chain(&self.theta_p);
        own.any(|joint| joints.angles.late_ms(*joint).is_some())
    }

    fn has_moved(&self, squeeze: &Squeeze) -> anyhow::Result<()> {
        for (name, angles) in self.fingers.iter().zip(&squeeze.theta_a_deg) {
            let least = angles.iter().copied().fold(f64::INFINITY, f64::min);
            let most = angles.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            if most - least < MOVED_DEG {
                bail!(
                    "{name} has moved by {:.1} degrees only: its servo has to be in operating mode 16 (PWM), with its supply \
                     on, and PWM above 0 has to close it (direction)",
                    most - least
                );
            }
        }
        Ok(())
    }
}

impl fmt::Display for Gripper {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "fingers {}, ", self.fingers.join(" and "))?;
        match self.potentiometers.is_empty() {
            true => write!(f, "no potentiometers")?,
            false => write!(f, "potentiometers {}", self.potentiometers.join(" and "))?,
        }
        f.write_str(if self.has_touch() { ", touch" } else { ", no touch" })?;
        write!(
            f,
            "; a motor stops by itself {} ms after the daemon falls silent, and {HOLD_MS} ms after this program does",
            self.watchdog_ms
        )
    }
}

/// The joints of these names, or the first that fit.
fn choose(
    joints: &JointsStatus,
    fingers: &[String],
    potentiometers: &[String],
) -> anyhow::Result<([String; FINGERS], Vec<String>)> {
    let names = |are_servos: bool| -> Vec<String> {
        (joints.joints.iter())
            .filter(|joint| joint.servo.is_some() == are_servos)
            .map(|joint| joint.name.clone())
            .collect()
    };
    let named = |wanted: &[String], are_servos: bool, what: &str| {
        let there = names(are_servos);
        if let Some(missing) = wanted.iter().find(|name| !there.contains(name)) {
            return Err(anyhow!(
                "no {what} is a joint called {missing}; there are {}",
                there.join(", ")
            ));
        }
        Ok(match wanted.is_empty() {
            true => there.into_iter().take(FINGERS).collect::<Vec<_>>(),
            false => wanted.to_vec(),
        })
    };
    let fingers = named(fingers, true, "servo")?;
    let fingers = <[String; FINGERS]>::try_from(fingers).map_err(|found| {
        anyhow!(
            "the gripper has two fingers; {} servos were found or named. The table [joints] of the daemon's configuration \
             lists them",
            found.len()
        )
    })?;
    let potentiometers = named(potentiometers, false, "potentiometer")?;
    match potentiometers.len() {
        0 | FINGERS if fingers[0] != fingers[1] => Ok((fingers, potentiometers)),
        0 | FINGERS => bail!("both fingers are called {}", fingers[0]),
        n => bail!(
            "the gripper has a potentiometer in each of its two fingers, or none; {n} were found or named"
        ),
    }
}

fn mark(text: &str) -> Value {
    json!({ "cmd": "mark", "text": text })
}

/// The motors as long as they run. When it is dropped they are switched off; when the process dies, the daemon does it.
struct Motors<'a> {
    gripper: &'a Gripper,
    daemon: Connection,
    /// So many of the fingers, from the first, may be on.
    running: usize,
    /// Whether it was marked that a squeeze begins.
    has_begun: bool,
}

impl<'a> Motors<'a> {
    fn of(gripper: &'a Gripper) -> anyhow::Result<Self> {
        Ok(Self {
            gripper,
            daemon: Connection::open(&gripper.control)?,
            running: 0,
            has_begun: false,
        })
    }

    /// Switches both on, with no PWM, and marks that a squeeze begins.
    fn start(&mut self) -> anyhow::Result<()> {
        for joint in &self.gripper.fingers {
            let started = self.daemon.ask(&json!({
                "cmd": "servo", "joint": joint, "torque": true, "pwm_percent": 0, "hold_ms": HOLD_MS,
            }));
            // One that has not confirmed it may be on; one that another program drives is none of ours.
            let is_held = (started.as_ref()).is_err_and(|error| error.is::<Held>());
            self.running += usize::from(!is_held);
            started?;
        }
        self.has_begun = true;
        self.mark(BEGINS)
    }

    /// Tells whoever reads the daemon's frames what is done with them.
    fn mark(&mut self, text: &str) -> anyhow::Result<()> {
        self.daemon.ask(&mark(text)).map(drop)
    }

    /// Gives both a PWM at once, counts of 885.
    fn drive(&mut self, pwm: f64) -> anyhow::Result<()> {
        let percent = 100.0 * pwm / FULL_PWM;
        let fingers = self.gripper.fingers.iter();
        let goals: Map<String, Value> = fingers.map(|joint| (joint.clone(), percent.into())).collect();
        let request = json!({ "cmd": "servos", "pwm_percent": goals });
        self.daemon.ask(&request).map(drop)
    }

    /// Switches both off.
    fn let_go(&mut self) -> anyhow::Result<()> {
        let running = std::mem::take(&mut self.running);
        let off = |joint: &String| json!({ "cmd": "servo", "joint": joint, "torque": false });
        let mut done = Ok(());
        for joint in self.gripper.fingers.iter().take(running) {
            let told = self.daemon.ask(&off(joint)).map(drop);
            // Where this connection is of no use any more, another one may be.
            done = done.and(told.or_else(|_| control::request(&self.gripper.control, &off(joint)).map(drop)));
        }
        done
    }
}

impl Drop for Motors<'_> {
    fn drop(&mut self) {
        if self.running > 0
            && let Err(error) = self.let_go()
        {
            say!("taxel: the motors may still be on: {error:#}");
        }
    }
}
