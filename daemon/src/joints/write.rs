//! The one way in which taxeld moves anything: a control request to one servo, where the
//! configuration allows it.

use serde::Deserialize;
use std::time::Duration;
use taxel_joints::bus::{WriteCommand, WriteError, WriteRefused};
use taxel_joints::{DynamixelConfig, JointReader, JointSource, JointsConfig, PortState};

/// What a servo is to do; one of both.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ServoRequest {
    /// The joint's name.
    joint: String,
    torque: Option<bool>,
    /// Share of full PWM in the joint's direction, percent.
    pwm_percent: Option<f64>,
}

/// How long the servo may take to confirm it: many cycles of a slow bus.
const PATIENCE: Duration = Duration::from_secs(2);
const LOOK: Duration = Duration::from_millis(2);

impl ServoRequest {
    /// Whether it has a motor switched off, and nothing else.
    pub(crate) fn releases(&self) -> bool {
        self.torque == Some(false) && self.pwm_percent.is_none()
    }
}

/// Has a servo told something, and waits until it has confirmed it; a sentence that says so, or why not.
pub(crate) async fn write(
    config: Option<&JointsConfig>,
    reader: Option<&JointReader>,
    request: &ServoRequest,
) -> Result<String, String> {
    let (config, servos) = match (config.map(|config| &config.source), reader) {
        (Some(JointSource::Dynamixel(config)), Some(JointReader::Servos(servos))) => (config, servos),
        (Some(source), None) => {
            let what = source.config().device();
            return Err(format!(
                "an {what} is listened to only; torque is its own driver's"
            ));
        }
        _ => return Err("there are no servos; the configuration has no table [joints]".into()),
    };
    if !config.allow_writes {
        return Err(WriteRefused::ReadOnly.to_string());
    }
    let (joint, command) = command(config, request)?;
    if let PortState::Away { reason, .. } = servos.port().state {
        return Err(format!("{}: {reason}", request.joint));
    }
    let failed = |error: WriteError| format!("{}: {error}", request.joint);
    let number = servos
        .command(joint, command)
        .map_err(|refused| failed(WriteError::NotTaken(refused)))?;
    let confirmed = async {
        loop {
            let off = servos.motor_off(joint);
            if command == WriteCommand::Torque(false) {
                // A newer one has taken its place.
                if let Some(done) = off.written.filter(|off| off.number >= number) {
                    return done.result;
                }
            } else {
                match servos.written(joint) {
                    Some(written) if written.number == number => return written.result,
                    // A later command to the same servo is done. So is this one, unless that was to switch it off.
                    Some(written) if written.number > number => {
                        return match off.newest > number {
                            true => Err(WriteError::SwitchedOff),
                            false => Ok(()),
                        };
                    }
                    _ => {}
                }
            }
            tokio::time::sleep(LOOK).await;
        }
    };
    let outcome = tokio::time::timeout(PATIENCE, confirmed).await;
    outcome.unwrap_or(Err(WriteError::PortLost)).map_err(failed)?;
    Ok(match command {
        WriteCommand::Torque(true) => format!(
            "joints: torque of {} is on (it stops by itself after {} ms of silence)",
            request.joint, config.watchdog_ms
        ),
        WriteCommand::Torque(false) => format!("joints: torque of {} is off", request.joint),
        WriteCommand::GoalPwm(counts) => format!("joints: {} is given PWM {counts}", request.joint),
    })
}

/// Which servo, by its index, and what it is told.
fn command(config: &DynamixelConfig, request: &ServoRequest) -> Result<(usize, WriteCommand), String> {
    let name = &request.joint;
    let Some(joint) = config.servo.iter().position(|servo| servo.name == *name) else {
        let names = config.joint_names().join(", ");
        return Err(format!("no joint is called {name}; there are {names}"));
    };
    match (request.torque, request.pwm_percent) {
        (Some(on), None) => Ok((joint, WriteCommand::Torque(on))),
        (None, Some(percent)) if (-100.0..=100.0).contains(&percent) => {
            let share = percent / 100.0 * f64::from(config.servo[joint].direction);
            let counts = (share * f64::from(WriteCommand::PWM_COUNTS)).round() as i16;
            Ok((joint, WriteCommand::GoalPwm(counts)))
        }
        (None, Some(percent)) => Err(format!("pwm_percent = {percent} is outside -100 to 100")),
        _ => Err("say either torque (true or false) or pwm_percent (-100 to 100)".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(joint: &str, torque: Option<bool>, pwm_percent: Option<f64>) -> ServoRequest {
        ServoRequest {
            joint: joint.into(),
            torque,
            pwm_percent,
        }
    }

    #[test]
    fn a_request_becomes_a_command_in_the_servo_s_own_direction() {
        let mut config = DynamixelConfig::new("/dev/servos", [7, 9]);
        config.servo[1].direction = -1;
        let cases = [
            (
                of("servo 7", Some(true), None),
                Ok((0, WriteCommand::Torque(true))),
            ),
            (
                of("servo 9", Some(false), None),
                Ok((1, WriteCommand::Torque(false))),
            ),
            (
                of("servo 7", None, Some(100.0)),
                Ok((0, WriteCommand::GoalPwm(885))),
            ),
            (
                of("servo 9", None, Some(10.0)),
                Ok((1, WriteCommand::GoalPwm(-89))),
            ),
            (of("servo 7", None, Some(-100.5)), Err("outside -100 to 100")),
            (of("servo 7", None, Some(f64::NAN)), Err("outside -100 to 100")),
            (of("servo 7", None, None), Err("say either")),
            (of("servo 7", Some(true), Some(1.0)), Err("say either")),
            (of("thumb", Some(true), None), Err("there are servo 7, servo 9")),
        ];
        for (request, wanted) in cases {
            match (command(&config, &request), wanted) {
                (Ok(got), Ok(wanted)) => assert_eq!(got, wanted, "{request:?}"),
                (Err(got), Err(wanted)) => assert!(got.contains(wanted), "{request:?}: {got}"),
                (got, _) => panic!("{request:?}: {got:?}"),
            }
        }
    }

    #[tokio::test]
    async fn what_has_no_servos_says_so() {
        let request = of("thumb 0", Some(true), None);
        let allegro = toml::from_str("source = \"allegro:can2\"\nallegro.version = 4").expect("joints");
        for (config, words) in [(None, "no table [joints]"), (Some(&allegro), "listened to only")] {
            let refused = write(config, None, &request).await.unwrap_err();
            assert!(refused.contains(words), "{refused}");
        }
    }
}
