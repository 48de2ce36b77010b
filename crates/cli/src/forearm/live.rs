//! `taxel forearm estimate --live MODEL`: where the gripper holds while it squeezes, beside a running daemon.

use super::angles::{FRESH_US, JointAngles};
use super::says_enough;
use super::touch::TactileFinger;
use crate::client::control;
use crate::client::live_lines::{Lines, every_frame};
use crate::client::reconnect::with_daemon;
use crate::notices;
use anyhow::{Context, bail};
use serde::Serialize;
use serde_json::json;
use std::path::Path;
use taxel_forearm::{Estimator, FINGERS, ForearmError, Sample, Seen, Squeeze};
use taxel_wire::status::Status;
use taxel_wire::{EventKind, Kind, Received};

/// What a program that squeezes marks: a squeeze begins; a sample of this PWM, counts of 885, begins and the one before is
/// over; the squeeze is over.
pub(super) const BEGINS: &str = "squeeze";
pub(super) const SAMPLE: &str = "pwm ";
pub(super) const ENDS: &str = "release";

/// `SCHED_FIFO` priority, the lowest: threads of taxeld have up to two less than its configuration says.
const PRIORITY: u8 = 1;

/// Until an angle is known in a squeeze, one that was read so long before is better than none: two samples, microseconds.
/// A squeeze begins at rest.
const FIRST_US: u32 = 4 * FRESH_US;

/// A squeeze that is not released is over after so long without a mark, nanoseconds: far longer than a sample.
const SILENT_NS: u64 = 5_000_000_000;

/// A squeeze as it goes on: frames and marks in, estimates out. No socket and no clock.
struct Live<'a> {
    estimator: &'a dyn Estimator,
    /// Numbers of the joints: the fingers' servos, and their potentiometers where there are any.
    theta_a: [usize; FINGERS],
    theta_p: Option<[usize; FINGERS]>,
    /// The newest frame: its number, its time in nanoseconds, its angles.
    frame: Option<(u64, u64, JointAngles)>,
    /// Its tactile image; empty where there is none.
    image: Vec<u16>,
    /// The squeeze at work, and the time of its first sample.
    squeeze: Option<(Squeeze, Option<u64>)>,
    /// What was seen in its images.
    seen: Seen,
    /// PWM of the sample at work.
    pwm: Option<f64>,
    /// The newest frame's time when the newest mark came.
    marked_ns: Option<u64>,
    /// Why the squeeze at work has no estimate was said.
    told: bool,
}

/// The keys of an ESTIMATE message.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Line {
    location_percent: f64,
    low: f64,
    high: f64,
    source: String,
    /// Angles that it was made without.
    left_out: Vec<&'static str>,
    /// How far the squeeze came: 1 is its peak, 2 its end.
    phase: f64,
    samples: usize,
    /// Whether the squeeze is over.
    ended: bool,
}

/// Why a squeeze has no estimate: in its last message, the keys of one that has, null as far as they cannot be told.
#[derive(Debug, Default, PartialEq, Serialize)]
struct Untold {
    location_percent: (),
    low: (),
    high: (),
    source: (),
    left_out: [&'static str; 0],
    phase: (),
    samples: usize,
    ended: bool,
    error: String,
}

impl Live<'_> {
    /// Takes a mark: the estimate of the sample that it ends, if it ends one, or why there is none, said once a squeeze and
    /// at its end.
    fn handle_mark(&mut self, text: &str) -> Option<Result<Line, Untold>> {
        self.marked_ns = self.frame.as_ref().map(|(_, t_ns, _)| *t_ns);
        match text {
            BEGINS => {
                let broken_off = self.break_off("another squeeze begins, and it was not released");
                self.squeeze = Some((Squeeze::default(), None));
                self.seen = Seen::default();
                self.told = false;
                broken_off.map(Err)
            }
            ENDS => {
                self.end_sample();
                let line = self.estimate(true);
                (self.squeeze, self.pwm) = (None, None);
                line
            }
            _ => {
                let pwm: f64 = text.strip_prefix(SAMPLE)?.parse().ok()?;
                let line = self.end_sample().and_then(|()| self.estimate(false));
                self.pwm = Some(pwm).filter(|pwm| pwm.is_finite() && self.squeeze.is_some());
                line
            }
        }
    }

    /// Takes a frame: the end of a squeeze that nobody has gone on with.
    fn handle_frame(&mut self, seq: u64, t_ns: u64, angles: JointAngles) -> Option<Untold> {
        self.frame = Some((seq, t_ns, angles));
        let since_ns = t_ns.saturating_sub(*self.marked_ns.get_or_insert(t_ns));
        if since_ns <= SILENT_NS {
            return None;
        }
        let silent_s = SILENT_NS / 1_000_000_000;
        self.break_off(&format!(
            "no mark has come for {silent_s} s, and it was not released"
        ))
    }

    /// The last message of the squeeze at work, which ends otherwise than by its release.
    fn break_off(&mut self, error: &str) -> Option<Untold> {
        let (squeeze, _) = self.squeeze.take()?;
        self.pwm = None;
        Some(Untold {
            error: error.into(),
            samples: squeeze.len(),
            ended: true,
            ..Untold::default()
        })
    }

    /// Adds the sample at work to the squeeze; none where there is none, or no frame of it.
    fn end_sample(&mut self) -> Option<()> {
        let pwm = self.pwm.take()?;
        let (squeeze, first_ns) = self.squeeze.as_mut()?;
        let (_, t_ns, angles) = self.frame.as_ref()?;
        let degrees = |joint: usize, before: &[f64]| {
            let is_first = before.iter().all(|angle| !angle.is_finite());
            angles.degrees(joint, if is_first { FIRST_US } else { FRESH_US })
        };
        let first_ns = *first_ns.get_or_insert(*t_ns);
        let time_ms = t_ns.saturating_sub(first_ns) as f64 / 1e6;
        // A mark without a frame since the last one ends no sample.
        if squeeze.time_ms.last().is_some_and(|last| time_ms <= *last) {
            return None;
        }
        squeeze.push(Sample {
            time_ms,
            theta_p_deg: std::array::from_fn(|finger| {
                let joint = self.theta_p.map(|joints| joints[finger]);
                joint.map_or(f64::NAN, |joint| degrees(joint, &squeeze.theta_p_deg[finger]))
            }),
            theta_a_deg: std::array::from_fn(|finger| {
                degrees(self.theta_a[finger], &squeeze.theta_a_deg[finger])
            }),
            pwm,
        });
        // Touch has an image for each sample: from the first that is missing on, the squeeze is one without.
        if !self.image.is_empty() && (squeeze.len() == 1 || squeeze.tactile.is_some()) {
            squeeze.push_image(&self.image);
        } else {
            squeeze.tactile = None;
        }
        Some(())
    }

    /// The estimate of the squeeze so far, or why there is none.
    fn estimate(&mut self, ended: bool) -> Option<Result<Line, Untold>> {
        let (squeeze, _) = self.squeeze.as_ref()?;
        let samples = squeeze.len();
        let estimate = match self.estimator.follow(squeeze, &mut self.seen) {
            // There will be more of it.
            Err(ForearmError::TooShort { .. }) if !ended => return None,
            Ok(estimate) if ended => says_enough(&estimate, samples).map(|()| estimate),
            estimate => estimate.map_err(Into::into),
        };
        match estimate {
            Ok(estimate) => Some(Ok(Line {
                location_percent: estimate.percent,
                low: (estimate.percent - estimate.half_width_90)
                    .max(0.0)
                    .min(estimate.percent),
                high: (estimate.percent + estimate.half_width_90)
                    .min(100.0)
                    .max(estimate.percent),
                source: estimate.source.to_string(),
                left_out: estimate.left_out.names().collect(),
                phase: estimate.phase,
                samples,
                ended,
            })),
            Err(_) if !ended && self.told => None,
            Err(error) => {
                self.told = true;
                Some(Err(Untold {
                    error: error.to_string(),
                    samples,
                    ended,
                    ..Untold::default()
                }))
            }
        }
    }
}

/// Where it listens and tells.
pub(super) struct Sockets<'a> {
    pub(super) images: Option<&'a Path>,
    /// Whether a daemon is waited for, at the start and whenever it is gone.
    pub(super) reconnect: bool,
    pub(super) publish: Option<&'a Path>,
}

/// Reads every frame of a daemon until it ends and writes a line for each sample of a squeeze; publishes it too, where there
/// is a socket for that. Without names, the first two servos are the fingers', and the first two other joints their
/// potentiometers, as `taxel forearm record` has it.
pub(super) fn run(
    estimator: &dyn Estimator,
    sockets: &Sockets<'_>,
    fingers: &[String],
    potentiometers: &[String],
) -> anyhow::Result<()> {
    let mut live = Live {
        estimator,
        theta_a: [0, 1],
        theta_p: None,
        frame: None,
        squeeze: None,
        seen: Seen::default(),
        image: Vec::new(),
        pwm: None,
        marked_ns: None,
        told: false,
    };
    // What the system refuses is done without, as taxeld does.
    let _ = taxeld::set_fifo(PRIORITY);
    let mut lines = Lines::new(Kind::Estimate, "estimates", sockets.publish);
    with_daemon(sockets.images, sockets.reconnect, |subscriber, images| {
        if let Some(untold) = live.break_off("the daemon was gone, and it was not released") {
            tell(&lines, &live, &Err(untold), None)?;
        }
        live.frame = None;
        let mut subscriber = every_frame(subscriber)?;
        let mut finger = None;
        loop {
            match subscriber.next()? {
                Received::Hello(hello) => {
                    let servos = servos(images);
                    (live.theta_a, live.theta_p) = joints(&hello.joints, &servos, fingers, potentiometers)?;
                    finger = TactileFinger::find(hello);
                    lines.hello(hello)?;
                }
                Received::Raw(header, raw) => {
                    let silent = live.handle_frame(header.seq, header.t_ns, JointAngles::of(&raw));
                    live.image.clear();
                    if let Some(finger) = &finger {
                        finger.image(&raw, &mut live.image);
                    }
                    if let Some(untold) = silent {
                        tell(&lines, &live, &Err(untold), None)?;
                    }
                }
                Received::Event(header, event) if event.event == EventKind::Mark => {
                    if let Some(told) = live.handle_mark(&event.message) {
                        tell(&lines, &live, &told, Some(header.t_ns))?;
                    }
                }
                _ => {}
            }
        }
    })
}

/// Writes and publishes an estimate, made at a mark of this time, or the end of a squeeze that has none; what is wrong while it
/// goes on is for people.
fn tell(
    lines: &Lines<'_>,
    live: &Live<'_>,
    told: &Result<Line, Untold>,
    mark_ns: Option<u64>,
) -> anyhow::Result<()> {
    let newest = live.frame.as_ref().map_or((0, 0), |(seq, t_ns, _)| (*seq, *t_ns));
    let of_ns = mark_ns.unwrap_or(newest.1);
    match told {
        Ok(line) => lines.tell(line, of_ns, Some(newest)),
        Err(untold) if untold.ended => lines.tell(untold, of_ns, Some(newest)),
        Err(untold) => {
            notices::warn(&format!("taxel: {}", untold.error));
            Ok(())
        }
    }
}

/// The joints that are servos, as the status socket beside that of images tells them; none where it does not.
fn servos(images: &Path) -> Vec<String> {
    let reply = control::request(&images.with_file_name("status.sock"), &json!({ "cmd": "status" }));
    let status = reply
        .ok()
        .and_then(|reply| Status::try_from(reply["status"].clone()).ok());
    let joints = status.and_then(|status| status.joints);
    let servos = (joints.into_iter().flat_map(|joints| joints.joints)).filter(|joint| joint.servo.is_some());
    servos.map(|joint| joint.name).collect()
}

/// Numbers of the joints of these names, or of the first that fit. Where no servos are known, the first two joints are taken for
/// them.
fn joints(
    there: &[String],
    servos: &[String],
    fingers: &[String],
    potentiometers: &[String],
) -> anyhow::Result<([usize; FINGERS], Option<[usize; FINGERS]>)> {
    let place = |name: &String| {
        let found = there.iter().position(|joint| joint == name);
        found.with_context(|| format!("no joint is called {name}; there are {}", there.join(", ")))
    };
    let two = |names: &[String], others: &[usize]| match names {
        [] => Ok(others.first_chunk().copied()),
        [a, b] => Ok(Some([place(a)?, place(b)?])),
        _ => bail!("the gripper has two fingers; name a joint for each"),
    };
    let is_servo = |joint: &usize| match servos {
        [] => *joint < FINGERS,
        servos => servos.contains(&there[*joint]),
    };
    let all: Vec<usize> = (0..there.len()).filter(is_servo).collect();
    let Some(fingers) = two(fingers, &all)? else {
        bail!("the daemon reads no two joints; its [joints] has to have the gripper's servos");
    };
    let rest: Vec<usize> = (0..there.len())
        .filter(|joint| !is_servo(joint) && !fingers.contains(joint))
        .collect();
    let potentiometers = two(potentiometers, &rest)?;
    let named: Vec<usize> = fingers
        .into_iter()
        .chain(potentiometers.into_iter().flatten())
        .collect();
    match named
        .iter()
        .enumerate()
        .find(|(n, joint)| named[..*n].contains(joint))
    {
        Some((_, twice)) => bail!(
            "{} is named twice; each finger has a servo and a potentiometer of its own",
            there[*twice]
        ),
        None => Ok((fingers, potentiometers)),
    }
}

#[cfg(test)]
mod tests;
