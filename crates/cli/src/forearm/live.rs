//! `taxel forearm estimate --live MODEL`: where the gripper holds while it squeezes, beside a running daemon.

use super::angles::{FRESH_US, JointAngles};
use super::touch::TactileFinger;
use crate::live_lines::{Lines, every_frame};
use crate::notices;
use anyhow::{Context, bail};
use serde::Serialize;
use std::path::Path;
use taxel_forearm::{Estimator, FINGERS, ForearmError, Sample, Squeeze};
use taxel_wire::{EventKind, Kind, Received};

/// What a program that squeezes marks: a squeeze begins; a sample of this PWM, counts of 885, begins and the one before is
/// over; the squeeze is over.
pub(super) const BEGINS: &str = "squeeze";
pub(super) const SAMPLE: &str = "pwm ";
pub(super) const ENDS: &str = "release";

/// Until an angle is known in a squeeze, one that was read so long before is better than none: two samples, microseconds.
/// A squeeze begins at rest.
const FIRST_US: u32 = 4 * FRESH_US;

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
    /// PWM of the sample at work.
    pwm: Option<f64>,
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

impl Live<'_> {
    /// Takes a mark: the estimate of the sample that it ends, if it ends one, or why there is none, said once a squeeze.
    fn handle_mark(&mut self, text: &str) -> Option<Result<Line, ForearmError>> {
        match text {
            BEGINS => {
                self.squeeze = Some((Squeeze::default(), None));
                (self.pwm, self.told) = (None, false);
                None
            }
            ENDS => {
                let line = self.end_sample(true);
                (self.squeeze, self.pwm) = (None, None);
                line
            }
            _ => {
                let pwm: f64 = text.strip_prefix(SAMPLE)?.parse().ok()?;
                let line = self.end_sample(false);
                self.pwm = Some(pwm).filter(|pwm| pwm.is_finite() && self.squeeze.is_some());
                line
            }
        }
    }

    fn end_sample(&mut self, ended: bool) -> Option<Result<Line, ForearmError>> {
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
        match self.estimator.estimate(squeeze) {
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
                samples: squeeze.len(),
                ended,
            })),
            // There will be more of it.
            Err(ForearmError::TooShort { .. }) if !ended => None,
            Err(error) => (!std::mem::replace(&mut self.told, true)).then_some(Err(error)),
        }
    }
}

/// Where it listens and tells.
pub(super) struct Sockets<'a> {
    pub(super) images: Option<&'a Path>,
    pub(super) publish: Option<&'a Path>,
}

/// Reads every frame of a daemon until it ends and writes a line for each sample of a squeeze; publishes it too, where there
/// is a socket for that. Without names, the first two joints are the fingers' servos and the next two their potentiometers.
pub(super) fn run(
    estimator: &dyn Estimator,
    sockets: &Sockets<'_>,
    fingers: &[String],
    potentiometers: &[String],
) -> anyhow::Result<()> {
    let mut subscriber = every_frame(sockets.images)?;
    let mut live = Live {
        estimator,
        theta_a: [0, 1],
        theta_p: None,
        frame: None,
        squeeze: None,
        image: Vec::new(),
        pwm: None,
        told: false,
    };
    let mut finger = None;
    let mut lines = Lines::new(Kind::Estimate, "estimates", sockets.publish);
    loop {
        match subscriber.next()? {
            Received::Hello(hello) => {
                (live.theta_a, live.theta_p) = joints(&hello.joints, fingers, potentiometers)?;
                finger = TactileFinger::find(hello);
                lines.hello(hello)?;
            }
            Received::Raw(header, raw) => {
                live.frame = Some((header.seq, header.t_ns, JointAngles::of(&raw)));
                live.image.clear();
                if let Some(finger) = &finger {
                    finger.image(&raw, &mut live.image);
                }
            }
            Received::Event(header, event) if event.event == EventKind::Mark => {
                match live.handle_mark(&event.message) {
                    None => {}
                    Some(Err(error)) => notices::say(&format!("taxel: {error}")),
                    Some(Ok(line)) => {
                        let newest = live.frame.as_ref().map(|(seq, t_ns, _)| (*seq, *t_ns));
                        lines.tell(&line, header.t_ns, newest)?;
                    }
                }
            }
            _ => {}
        }
    }
}

/// Numbers of the joints of these names, or of the first there are.
fn joints(
    there: &[String],
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
    let all: Vec<usize> = (0..there.len()).collect();
    let Some(fingers) = two(fingers, &all)? else {
        bail!("the daemon reads no two joints; its [joints] has to have the gripper's servos");
    };
    let rest: Vec<usize> = (FINGERS..there.len())
        .filter(|joint| !fingers.contains(joint))
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
mod tests {
    use super::*;
    use taxel_forearm::{Estimate, Kinesthetic, LeftOut, Source, TACTELS, Trial};

    /// Says the angle of the first finger, from two samples on; refuses PWM beyond 500.
    struct FirstAngle;

    impl Estimator for FirstAngle {
        fn estimate(&self, squeeze: &Squeeze) -> Result<Estimate, ForearmError> {
            let samples = squeeze.len();
            let last = samples - 1;
            if samples < 2 {
                return Err(ForearmError::TooShort { samples, least: 2 });
            }
            if squeeze.pwm[last] > 500.0 {
                let (peak, expected) = (squeeze.pwm[last], 400.0);
                return Err(ForearmError::Profile { peak, expected });
            }
            Ok(Estimate {
                percent: squeeze.theta_a_deg[0][last],
                half_width_90: 10.0,
                source: Source::Kinesthetic,
                left_out: LeftOut::default(),
                phase: squeeze.time_ms[last],
            })
        }
    }

    fn live() -> Live<'static> {
        Live {
            estimator: &FirstAngle,
            theta_a: [0, 1],
            theta_p: Some([2, 3]),
            frame: None,
            image: Vec::new(),
            squeeze: None,
            pwm: None,
            told: false,
        }
    }

    fn frame(live: &mut Live<'_>, ms: u64, degrees: f32) {
        let angles = [degrees.to_radians(), 0.0, 0.0, 0.0].map(|angle| (angle, 0));
        live.frame = Some((ms, ms * 1_000_000, angles.into_iter().collect()));
    }

    #[test]
    fn a_sample_is_estimated_with_the_newest_frame_when_the_next_begins() {
        let mut live = live();
        frame(&mut live, 1000, 5.0);
        assert!(live.handle_mark("pwm 10").is_none(), "of no squeeze");
        assert!(live.handle_mark(BEGINS).is_none());
        assert!(live.handle_mark("pwm 10").is_none(), "it has just begun");
        frame(&mut live, 1121, 7.0);
        assert!(
            live.handle_mark("pwm 20").is_none(),
            "one sample is too short, and there will be more"
        );
        frame(&mut live, 1200, 8.0);
        frame(&mut live, 1242, 9.0);
        let line = live.handle_mark("pwm 30").unwrap().unwrap();
        assert!(
            (line.location_percent - 9.0).abs() < 1e-5 && line.phase == 121.0,
            "{line:?}"
        );
        assert_eq!((line.low, line.samples, line.ended), (0.0, 2, false));
        assert!(live.handle_mark("pwm 40").is_none(), "no frame has come since");
        assert!(live.handle_mark("a cup").is_none());
        frame(&mut live, 1363, 95.0);
        let line = live.handle_mark(ENDS).unwrap().unwrap();
        assert_eq!((line.high, line.samples, line.ended), (100.0, 3, true));
        assert!(live.handle_mark(ENDS).is_none());
        assert!(live.handle_mark("pwm 10").is_none());
    }

    /// Says of how many samples it knows the touch.
    struct Touched;

    impl Estimator for Touched {
        fn estimate(&self, squeeze: &Squeeze) -> Result<Estimate, ForearmError> {
            let images = squeeze
                .tactile
                .as_ref()
                .map_or(0, |counts| counts.len() / TACTELS);
            Ok(Estimate {
                percent: images as f64,
                half_width_90: 1.0,
                source: Source::Fused,
                left_out: LeftOut::default(),
                phase: 0.0,
            })
        }
    }

    #[test]
    fn touch_that_falls_silent_is_done_without_until_the_next_squeeze() {
        let mut live = Live {
            estimator: &Touched,
            ..live()
        };
        let mut ms = 0;
        for expected in [[1.0, 2.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0], [1.0, 2.0, 3.0, 4.0]] {
            live.handle_mark(BEGINS);
            live.handle_mark("pwm 10");
            for (sample, expected) in expected.into_iter().enumerate() {
                ms += 100;
                frame(&mut live, ms, 5.0);
                let is_felt = ms < 300 || ms == 600 || ms > 800;
                live.image = if is_felt { vec![3; TACTELS] } else { Vec::new() };
                let line = live.handle_mark("pwm 20").unwrap().unwrap();
                assert_eq!(line.location_percent, expected, "sample {sample} at {ms} ms");
            }
            live.handle_mark(ENDS);
        }
    }

    #[test]
    fn why_a_squeeze_has_no_estimate_is_said_once() {
        let mut live = live();
        for _ in 0..2 {
            live.handle_mark(BEGINS);
            let mut errors = 0;
            for ms in 1..9 {
                live.handle_mark("pwm 600");
                frame(&mut live, ms, 1.0);
                errors += live
                    .handle_mark("pwm 600")
                    .map_or(0, |line| usize::from(line.is_err()));
            }
            assert_eq!(errors, 1);
            live.handle_mark(ENDS);
            live.frame = Some((0, 0, JointAngles::default()));
        }
    }

    /// Softer from wrist to elbow.
    fn arm(percent: f64, off: f64) -> Squeeze {
        let mut squeeze = Squeeze::default();
        for row in 0..95 {
            let pwm = 10.0 * (40.0 - (f64::from(row) - 50.0).abs()).max(0.0);
            let closed = 60.0 - 0.4 * percent + 0.05 * pwm * (1.0 + 0.005 * percent) + off;
            squeeze.push(Sample {
                time_ms: 121.0 * f64::from(row),
                theta_p_deg: [f64::NAN; FINGERS],
                theta_a_deg: [closed, closed + 8.0],
                pwm,
            });
        }
        squeeze
    }

    #[test]
    fn a_sample_whose_angles_were_read_late_has_an_estimate_from_those_before() {
        let mut trials = Vec::new();
        for n in 0..10 {
            let location_percent = f64::from(n / 2) * 25.0;
            trials.push(Trial {
                location_percent,
                repetition: n as usize % 2,
                squeeze: arm(location_percent, f64::from(n % 2)),
            });
        }
        let estimator = Kinesthetic::train(&trials.iter().collect::<Vec<_>>()).unwrap();
        // Which samples' angles are so many milliseconds old, and which then have no estimate.
        let nothing: &[usize] = &[];
        for (late, age_ms, missing) in [
            (&[][..], 0, nothing),
            (&[2, 3], 200, nothing),
            (&[1, 3, 4], 200, nothing),
            (&[2, 3, 4], 200, nothing),
            (&[1, 2], 200, nothing),
            (&[1, 2, 3, 4], 200, nothing),
            (&[3, 5, 6, 7], 200, nothing),
            (&[8, 9, 10], 200, nothing),
            // Longer than two samples ago; and nothing new for nine.
            (&[1, 2], 241, &[2]),
            (&[4, 5, 6, 7, 8, 9, 10, 11, 12, 13], 200, &[12, 13]),
        ] {
            let mut live = Live {
                estimator: &estimator,
                theta_p: None,
                ..live()
            };
            live.handle_mark(BEGINS);
            let (squeeze, mut without, mut said) = (arm(37.0, 0.0), Vec::new(), String::new());
            for row in 0..14 {
                live.handle_mark(&format!("pwm {}", squeeze.pwm[row]));
                let age_us = if late.contains(&(row + 1)) {
                    1000 * age_ms
                } else {
                    5000
                };
                let angles = squeeze
                    .sample(row)
                    .theta_a_deg
                    .map(|a| (a.to_radians() as f32, age_us));
                let t_ns = 121_000_000 * row as u64;
                live.frame = Some((row as u64, t_ns, angles.into_iter().collect()));
                // The next sample begins.
                let line = live.handle_mark(&format!("pwm {}", squeeze.pwm[row + 1]));
                live.pwm = None;
                match line {
                    Some(Ok(_)) => continue,
                    Some(Err(error)) => said += &error.to_string(),
                    None => {}
                }
                without.push(row + 1);
            }
            assert_eq!(without, [&[1], missing].concat(), "{age_ms} ms old at {late:?}");
            assert_eq!(
                said.contains("lost or stuck"),
                !missing.is_empty(),
                "{late:?}: {said}"
            );
        }
    }

    #[test]
    fn joints_are_taken_by_name_or_in_order() {
        let there: Vec<String> = ["a", "b", "ap", "bp"].map(String::from).to_vec();
        let names = |names: &[&str]| -> Vec<String> { names.iter().map(ToString::to_string).collect() };
        for (fingers, potentiometers, wanted) in [
            (&[][..], &[][..], Ok(([0, 1], Some([2, 3])))),
            (&["b", "a"], &["bp", "ap"], Ok(([1, 0], Some([3, 2])))),
            (&["b"], &[], Err("two fingers")),
            (&["a", "a"], &[], Err("a is named twice")),
            (&[], &["a", "b"], Err("a is named twice")),
            (&["ap", "bp"], &[], Ok(([2, 3], None))),
            (
                &["b", "c"],
                &[],
                Err("no joint is called c; there are a, b, ap, bp"),
            ),
        ] {
            match (joints(&there, &names(fingers), &names(potentiometers)), wanted) {
                (Ok(got), Ok(wanted)) => assert_eq!(got, wanted),
                (Err(error), Err(words)) => assert!(error.to_string().contains(words), "{error}"),
                (got, _) => panic!("{fingers:?}: {got:?}"),
            }
        }
        assert_eq!(joints(&there[..2], &[], &[]).unwrap(), ([0, 1], None));
        assert!(joints(&there[..1], &[], &[]).is_err());
    }
}
