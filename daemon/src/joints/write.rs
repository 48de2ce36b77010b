//! The one way in which taxeld moves anything: control requests to servos, where the configuration allows it.

use super::confirmed::{all_confirmed, confirmed};
use super::{Hold, NotDone};
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::fmt;
use taxel_hand::{check_range, did_you_mean};
use taxel_joints::bus::{WriteCommand, WriteError, WriteRefused, check_goals};
use taxel_joints::{DynamixelConfig, JointReader, JointSource, JointsConfig, PortState, ServoReader};

/// What a servo is to do: torque, PWM, or torque that begins with a PWM.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ServoRequest {
    /// The joint's name.
    pub(super) joint: String,
    pub(super) torque: Option<bool>,
    /// Share of full PWM in the joint's direction, percent.
    pub(super) pwm_percent: Option<f64>,
    /// Its motor is switched off when the connection that asks ends, or asks nothing for so long, ms, 20 to 10,000.
    pub(super) hold_ms: Option<f64>,
}

/// What several servos are to do at the same instant.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ServosRequest {
    /// Share of full PWM by the joint's name, in the joint's direction, percent.
    pwm_percent: Shares,
}

/// Names with their values as they come, a name that comes twice as well: a map would drop one of them unsaid.
#[derive(Debug, Clone, PartialEq)]
struct Shares(Vec<(String, f64)>);

impl<'de> Deserialize<'de> for Shares {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Pairs;

        impl<'de> Visitor<'de> for Pairs {
            type Value = Shares;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a map")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Shares, A::Error> {
                let mut shares = Vec::new();
                while let Some(share) = map.next_entry()? {
                    shares.push(share);
                }
                Ok(Shares(shares))
            }
        }

        deserializer.deserialize_map(Pairs)
    }
}

/// What has been done.
#[derive(Debug, PartialEq)]
pub(crate) struct Told {
    /// A sentence for the log.
    pub(crate) said: String,
    /// What has to be known of it by who asked: servos that have confirmed it and report a hardware error.
    pub(crate) warning: Option<String>,
}

impl ServoRequest {
    /// The joint whose motor it has switched on or off, and which of both.
    pub(crate) fn switched_motor(&self) -> Option<(&str, bool)> {
        self.torque.map(|is_on| (self.joint.as_str(), is_on))
    }

    /// Whether it has the motor of one of these joints switched off, and nothing else.
    pub(crate) fn releases(&self, joints: Option<&JointsConfig>) -> bool {
        let Some(JointSource::Dynamixel(config)) = joints.map(|joints| &joints.source) else {
            return false;
        };
        command(config, self).is_ok_and(|(_, command)| command == WriteCommand::Torque(false))
    }
}

/// The servos that may be told something, or why there are none.
fn servos<'a>(
    config: Option<&'a JointsConfig>,
    reader: Option<&'a JointReader>,
) -> Result<(&'a DynamixelConfig, &'a ServoReader), String> {
    let servos = reader.and_then(|reader| reader.servos.as_deref());
    let (config, servos) = match (config.map(|config| &config.source), servos) {
        (Some(JointSource::Dynamixel(config)), Some(servos)) => (config, servos),
        (Some(source), None) => {
            let what = source.config().device();
            return Err(format!(
                "an {what} is listened to only; torque is its own driver's"
            ));
        }
        _ => return Err("there are no servos; the configuration has no table [joints]".into()),
    };
    match config.allow_writes {
        true => Ok((config, servos)),
        false => Err(WriteRefused::ReadOnly.to_string()),
    }
}

/// That a servo reports a hardware error, and what that means for what it was told; `None` where it does not.
fn complaint(servos: &ServoReader, joint: usize) -> Option<String> {
    let error = servos.reported_error(joint)?;
    let which = match error.is_none() {
        true => String::new(),
        false => format!(": {error}"),
    };
    Some(format!(
        "the servo reports a hardware error{which}; its motor may stay off until it is rebooted"
    ))
}

/// Why the servos' port is away; `None` where it is not.
fn away(servos: &ServoReader) -> Option<String> {
    match servos.port().state {
        PortState::Away { reason, .. } => Some(reason),
        PortState::Starting | PortState::Open => None,
    }
}

/// Why a command was not taken; of a port that is not open, why that is so.
fn why_not(servos: &ServoReader, refused: WriteRefused) -> String {
    let reason = away(servos).filter(|_| refused == WriteRefused::NoPort);
    reason.unwrap_or_else(|| refused.to_string())
}

/// Has a servo told something, and waits until it has confirmed it; a sentence that says so, or why not. A motor that was to
/// be switched off and may not be is noted among the releases of `hold`.
pub(crate) async fn write(
    config: Option<&JointsConfig>,
    hold: &Hold<'_>,
    request: &ServoRequest,
) -> Result<Told, NotDone> {
    let (config, servos) = servos(config, hold.reader)?;
    let (joint, command) = command(config, request)?;
    let is_off = command == WriteCommand::Torque(false);
    if !is_off {
        hold.refuse_other(joint, &request.joint)?;
    }
    let failed = |why: String| format!("{}: {why}", request.joint);
    let number = servos
        .command(joint, command)
        .map_err(|refused| failed(why_not(servos, refused)))?;
    hold.note(joint, command, request.hold_ms);
    // It is taken while the port is away, and done when that is back.
    let done = match away(servos).filter(|_| is_off) {
        Some(reason) => Err(reason),
        None => {
            let done = confirmed(servos, hold, joint, command, number).await;
            if done != Err(WriteError::Unconfirmed) {
                hold.is_told(joint);
            }
            done.map_err(|error| match complaint(servos, joint) {
                Some(complaint) => format!("{error}; {complaint}"),
                None => error.to_string(),
            })
        }
    };
    if let Err(why) = done {
        if is_off {
            hold.releases.asked(joint, number);
            return Err(failed(format!(
                "{why}; it is told again until it confirms that its motor is off"
            ))
            .into());
        }
        let is_start = !matches!(command, WriteCommand::GoalPwm(_));
        let held = match request.hold_ms {
            _ if is_start && servos.motor_off(joint).unconfirmed => {
                "; its motor may run, and is told to be off until it confirms that"
            }
            Some(_) if hold.holds(joint) => {
                "; its motor may run, and is held by this connection until that lets go or has it switched off"
            }
            None if is_start && !servos.is_off(joint) => {
                "; its motor may run, and nobody holds it: have it switched off, or ask again"
            }
            _ => "",
        };
        return Err(failed(format!("{why}{held}")).into());
    }
    let said = match command {
        WriteCommand::Torque(true) | WriteCommand::Start(_) => format!(
            "joints: torque of {} is on (it stops by itself after {} ms of silence)",
            request.joint, config.watchdog_ms
        ),
        WriteCommand::Torque(false) => format!("joints: torque of {} is off", request.joint),
        WriteCommand::GoalPwm(counts) => format!("joints: {} is given PWM {counts}", request.joint),
    };
    let warning = complaint(servos, joint).map(|complaint| format!("{}: {complaint}", request.joint));
    Ok(Told { said, warning })
}

/// Has a servo told something, by a request to switch its motor off, and does not wait for it: what becomes of that is noted
/// among the releases of `hold`.
pub(crate) fn release(
    config: Option<&JointsConfig>,
    hold: &Hold<'_>,
    request: &ServoRequest,
) -> Result<(), String> {
    let (config, servos) = servos(config, hold.reader)?;
    let (joint, command) = command(config, request)?;
    let number = (servos.command(joint, command))
        .map_err(|refused| format!("{}: {}", request.joint, why_not(servos, refused)))?;
    hold.note(joint, command, request.hold_ms);
    hold.releases.left(joint, number);
    Ok(())
}

/// Has several servos given their PWM in one packet, and waits until each has confirmed it.
pub(crate) async fn write_together(
    config: Option<&JointsConfig>,
    hold: &Hold<'_>,
    request: &ServosRequest,
) -> Result<Told, NotDone> {
    let (config, servos) = servos(config, hold.reader)?;
    let goals = goals(config, request)?;
    for (joint, _) in &goals {
        hold.refuse_other(*joint, &config.servo[*joint].name)?;
    }
    let number = servos
        .command_together(&goals)
        .map_err(|refused| why_not(servos, refused))?;
    let (mut failed, mut warnings) = (Vec::new(), Vec::new());
    let outcomes = all_confirmed(servos, hold, &goals, number).await;
    for ((joint, _), outcome) in goals.iter().zip(outcomes) {
        match outcome {
            Ok(()) => {
                let name = &config.servo[*joint].name;
                warnings.extend(complaint(servos, *joint).map(|complaint| format!("{name}: {complaint}")));
            }
            // All or none is told; only the one that is off is at fault.
            Err(WriteError::NotTaken(refused)) if refused.is_of_another(*joint) => {}
            Err(error) => failed.push(format!("{}: {error}", config.servo[*joint].name)),
        }
    }
    let names: Vec<&str> = (request.pwm_percent.0.iter())
        .map(|(name, _)| name.as_str())
        .collect();
    match failed.is_empty() {
        true => Ok(Told {
            said: format!("joints: {} are given PWM together", names.join(", ")),
            warning: (!warnings.is_empty()).then(|| warnings.join("; ")),
        }),
        false => Err(failed.join("; ").into()),
    }
}

/// The servo of a joint, by its index.
fn joint_called(config: &DynamixelConfig, name: &str) -> Result<usize, String> {
    let joint = config.servo.iter().position(|servo| servo.name == name);
    joint.ok_or_else(|| {
        let names = config.joint_names();
        let meant = did_you_mean(name, names.iter().map(String::as_str));
        format!("no joint is called {name}{meant}; there are {}", names.join(", "))
    })
}

/// A PWM in the servo's own direction.
fn counts(config: &DynamixelConfig, joint: usize, percent: f64) -> Result<i16, String> {
    if !(-100.0..=100.0).contains(&percent) {
        return Err(format!("pwm_percent = {percent} is outside -100 to 100"));
    }
    let share = percent / 100.0 * f64::from(config.servo[joint].direction);
    Ok((share * f64::from(WriteCommand::PWM_COUNTS)).round() as i16)
}

/// Which servos, by their indices, and the PWM that each is given.
fn goals(config: &DynamixelConfig, request: &ServosRequest) -> Result<Vec<(usize, i16)>, String> {
    let mut goals = Vec::new();
    for (name, percent) in &request.pwm_percent.0 {
        let joint = joint_called(config, name)?;
        goals.push((joint, counts(config, joint, *percent)?));
    }
    if goals.is_empty() {
        return Err("pwm_percent names no joint; write {\"pwm_percent\":{\"JOINT\":PERCENT,...}}".into());
    }
    match check_goals(goals.iter().copied(), config.servo.len()) {
        Err(WriteRefused::Twice(joint)) => {
            let name = &config.servo[joint].name;
            Err(format!("{name}: {}", WriteRefused::Twice(joint)))
        }
        checked => checked.map(|()| goals).map_err(|refused| refused.to_string()),
    }
}

/// Which servo, by its index, and what it is told.
fn command(config: &DynamixelConfig, request: &ServoRequest) -> Result<(usize, WriteCommand), String> {
    let joint = joint_called(config, &request.joint)?;
    if let Some(ms) = request.hold_ms {
        check_range("", "hold_ms", ms, 20.0..=10_000.0, "ms").map_err(|error| error.to_string())?;
        if request.torque != Some(true) {
            return Err("hold_ms goes with \"torque\":true alone".into());
        }
    }
    let counts = |percent| counts(config, joint, percent);
    let command = match (request.torque, request.pwm_percent) {
        (Some(true), Some(percent)) => WriteCommand::Start(counts(percent)?),
        (Some(on), None) => WriteCommand::Torque(on),
        (None, Some(percent)) => WriteCommand::GoalPwm(counts(percent)?),
        _ => {
            return Err(
                "say torque (true or false), pwm_percent (-100 to 100), or torque true with the pwm_percent it begins \
                 with"
                    .into(),
            );
        }
    };
    Ok((joint, command))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clients::Asker;
    use std::sync::Arc;

    fn of(joint: &str, torque: Option<bool>, pwm_percent: Option<f64>) -> ServoRequest {
        ServoRequest {
            joint: joint.into(),
            torque,
            pwm_percent,
            hold_ms: None,
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
            (of("servo 7", None, None), Err("say torque")),
            (of("servo 7", Some(false), Some(1.0)), Err("say torque")),
            (
                of("servo 9", Some(true), Some(10.0)),
                Ok((1, WriteCommand::Start(-89))),
            ),
            (of("servo 7", Some(true), Some(101.0)), Err("outside -100 to 100")),
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

    #[test]
    fn several_servos_are_named_once_each() {
        let config = DynamixelConfig::new("/dev/servos", [7, 9]);
        for (shares, wanted) in [
            (r#"{"servo 9":100,"servo 7":0}"#, Ok(vec![(1, 885), (0, 0)])),
            (r#"{"servo 7":1,"servo 7":90}"#, Err("servo 7: it is named twice")),
            (
                r#"{"servo 7":1,"servo 9":0,"servo 7":1}"#,
                Err("servo 7: it is named twice"),
            ),
            (r#"{"servo 8":1}"#, Err("no joint is called servo 8")),
            (r#"{"sevro 7":1}"#, Err("did you mean `servo 7`?")),
            (r#"{"servo 7":101}"#, Err("outside -100 to 100")),
        ] {
            let request = serde_json::from_str(&format!("{{\"pwm_percent\":{shares}}}")).unwrap();
            match (goals(&config, &request), wanted) {
                (Ok(got), Ok(wanted)) => assert_eq!(got, wanted, "{shares}"),
                (Err(got), Err(wanted)) => assert!(got.contains(wanted), "{shares}: {got}"),
                (got, _) => panic!("{shares}: {got:?}"),
            }
        }
    }

    #[test]
    fn only_a_motor_that_is_switched_on_is_held() {
        let config = DynamixelConfig::new("/dev/servos", [7]);
        for (torque, hold_ms, wanted) in [
            (Some(true), 20.0, None),
            (Some(true), 10_000.0, None),
            (Some(true), 19.0, Some("hold_ms = 19 is outside 20 to 10000")),
            (Some(true), f64::NAN, Some("hold_ms = NaN is outside")),
            (Some(false), 500.0, Some("goes with \"torque\":true")),
            (None, 500.0, Some("goes with \"torque\":true")),
        ] {
            let mut request = of("servo 7", torque, None);
            request.hold_ms = Some(hold_ms);
            match (command(&config, &request), wanted) {
                (Ok(_), None) => {}
                (Err(error), Some(words)) => assert!(error.contains(words), "{error}"),
                (got, _) => panic!("{request:?}: {got:?}"),
            }
        }
    }

    #[tokio::test]
    async fn a_refused_request_holds_nothing() {
        let mut config = DynamixelConfig::new("/dev/never/there", [7]);
        config.allow_writes = true;
        let reader = JointReader {
            servos: Some(Arc::new(ServoReader::start(&config).expect("a thread"))),
            analogue: None,
        };
        let mut joints = JointsConfig::new(JointSource::Dynamixel(config));
        for (joint, percent, words) in [
            ("servo 7", 500.0, "outside -100 to 100"),
            ("servo 8", 0.0, "no joint is called"),
            ("servo 7", 0.0, ""),
        ] {
            let mut request = of(joint, Some(true), Some(percent));
            request.hold_ms = Some(100.0);
            let (releases, holders) = Default::default();
            let hold = Hold::new(Some(&reader), &releases, &holders, Asker::nobody());
            let refused = write(Some(&joints), &hold, &request).await.unwrap_err().why;
            assert!(refused.contains(words), "{refused}");
            assert_eq!(hold.patience(), None, "{refused}");
        }
        let JointSource::Dynamixel(config) = &mut joints.source else {
            panic!("servos");
        };
        config.allow_writes = false;
        let (releases, holders) = Default::default();
        let hold = Hold::new(Some(&reader), &releases, &holders, Asker::nobody());
        let mut request = of("servo 7", Some(true), None);
        request.hold_ms = Some(100.0);
        assert!(write(Some(&joints), &hold, &request).await.is_err());
        assert_eq!(hold.patience(), None);
    }

    #[tokio::test]
    async fn what_has_no_servos_says_so() {
        let request = of("thumb 0", Some(true), None);
        let allegro = toml::from_str("source = \"allegro:can2\"\nallegro.version = 4").expect("joints");
        for (config, words) in [(None, "no table [joints]"), (Some(&allegro), "listened to only")] {
            let (releases, holders) = Default::default();
            let hold = Hold::new(None, &releases, &holders, Asker::nobody());
            let refused = write(config, &hold, &request).await.unwrap_err().why;
            assert!(refused.contains(words), "{refused}");
        }
    }
}
