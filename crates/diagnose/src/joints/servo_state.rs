//! What a servo says of itself, and what its motor has come to.

use super::of_joints;
use crate::kind::Kind;
use crate::problem::{Place, Problem};
use taxel_joints::bus::{MotorLost, ServoState, WriteError};
use taxel_joints::registers::HardwareError;

/// Degrees Celsius from which a servo is too hot, and down to which it stays so. It switches itself
/// off at 80.
const HOT_C: u8 = 70;
const HOT_ON_C: u8 = 65;

/// A motor was told to be off, and is on, or nobody knows whether it is.
pub(super) fn motor_not_off(joint: usize, name: &str, servo: &ServoState) -> Option<Problem> {
    let off = servo.motor_off;
    let reason = off.written.and_then(|written| written.result.err());
    let what = match reason {
        Some(WriteError::StillOn) => format!("the motor of servo {name} is on, though it was told to be off"),
        Some(why) => {
            format!("nobody knows whether the motor of servo {name} is off, as it was told to be: {why}")
        }
        None => format!("nobody knows whether the motor of servo {name} is off, as it was told to be"),
    };
    let problem = of_joints(
        Kind::MotorNotOff,
        Place::Joint(joint),
        what,
        "It is told again until it confirms that; a watchdog that was armed stays armed. Where it has to stand still now, cut its supply",
        format!("the motor of servo {name} is off, or was started anew"),
    );
    off.unconfirmed.then_some(problem)
}

/// A motor that was switched on here is so no longer, or was left on before, and nobody has told it to be off.
pub(super) fn motor_lost(joint: usize, name: &str, servo: &ServoState) -> Option<Problem> {
    let (what, advice) = match servo.motor_lost? {
        MotorLost::Restarted => (
            format!(
                "servo {name} has restarted while its motor was on, and has forgotten the watchdog that stops it; its motor is switched off"
            ),
            "Look at its supply and plug",
        ),
        MotorLost::Meddled { watchdog, armed } => (
            format!(
                "another program has set the bus watchdog of servo {name} to {watchdog} (address 98), where taxeld had {armed}; its motor is switched off"
            ),
            "End the other program",
        ),
        MotorLost::LeftOn => (
            format!(
                "the motor of servo {name} was left on by a taxeld that was killed, or by another program, and its watchdog does not stop it while it is read; it is switched off"
            ),
            "The log says how the taxeld before ended. Where another program drives it, end one of both",
        ),
        MotorLost::GoneOff => (
            format!("the motor of servo {name} was on and has gone off by itself"),
            "A servo does so at a hardware error and where it restarts, and another program may have done it",
        ),
    };
    let again = match servo.motor_lost? {
        MotorLost::Restarted | MotorLost::Meddled { .. } => {
            ", and is switched off again whoever else switches it on"
        }
        MotorLost::LeftOn | MotorLost::GoneOff => "",
    };
    Some(of_joints(
        Kind::MotorLost,
        Place::Joint(joint),
        what,
        format!(
            "{advice}. It takes no goal until its torque is enabled anew (`taxel servo`, --torque on){again}"
        ),
        format!("the motor of servo {name} is on again, or was told to be off"),
    ))
}

/// What a servo, by its joint and its name with its id, says of itself. One that was too hot at the
/// last look has to cool down further.
pub fn servo_state(joint: usize, name: &str, state: &ServoState, was_hot: bool) -> Vec<Problem> {
    let place = Place::Joint(joint);
    let mut found = Vec::new();
    let error = state.hardware_error.unwrap_or(HardwareError(0));
    let motor = match state.torque_enabled {
        Some(true) => {
            "Its motor is on and obeys all the same: its Shutdown (address 63) leaves this error out"
        }
        _ => "Its motor stays off until it is rebooted",
    };
    let told = match error.is_none() {
        false => Some((
            format!("{error}. {motor}; its angle goes on"),
            format!("{}; then reboot it", cures(error)),
        )),
        // It is asked at once which one it is; one that refuses that never says.
        true => (state.alert && state.refusal.is_some()).then(|| {
            (
                format!("it does not say which, since it refuses to be read. {motor}"),
                "Reboot it".into(),
            )
        }),
    };
    if let Some((what, advice)) = told {
        found.push(of_joints(
            Kind::ServoError,
            place,
            format!("servo {name} reports a hardware error: {what}"),
            format!("{advice}, or switch it off and on"),
            format!("servo {name} has no hardware error any more"),
        ));
    }
    if let Some(identity) = state.identity.filter(|identity| identity.model().is_none()) {
        found.push(unknown_model(joint, name, identity.model_number));
    }
    if state.is_stopped() {
        found.push(of_joints(
            Kind::MotorStopped,
            place,
            format!(
                "the motor of servo {name} is switched on and holds nothing: its bus watchdog has stopped it, since it heard nothing for too long. It refuses goals"
            ),
            "Enable its torque anew (`taxel servo`, --torque on), or switch it off; that it heard nothing is of a cable, or of a taxeld that stood still or was killed",
            format!("the motor of servo {name} is not stopped by its watchdog any more"),
        ));
    }
    let least_c = if was_hot { HOT_ON_C } else { HOT_C };
    if let Some(celsius) = state.temperature_c.filter(|c| *c >= least_c) {
        found.push(of_joints(
            Kind::ServoHot,
            place,
            format!(
                "servo {name} has {celsius} degrees Celsius, and switches itself off at 80 (Temperature Limit, address 31)"
            ),
            "give it a rest or less load",
            format!("servo {name} has cooled down"),
        ));
    }
    found
}

/// A servo, by its joint and its name with its id, has a model number that is not known. What it says is taken as that of a
/// servo of the X series.
pub fn unknown_model(joint: usize, name: &str, number: u16) -> Problem {
    of_joints(
        Kind::ServoModel,
        Place::Joint(joint),
        format!("the model number {number} of servo {name} is not known, so that its angles may be wrong"),
        "Wanted is an X-series servo with the control table of the XM430-W210 (4096 pulses per turn)",
        format!("servo {name} is of a known model"),
    )
}

/// What to do about a hardware error.
pub(super) fn cures(error: HardwareError) -> String {
    let all: Vec<&str> = error.names().map(cure).collect();
    match &all[..] {
        [] => "See its data sheet".into(),
        all => capitalised(&all.join(", ")),
    }
}

/// What to do about one, by its name in the data sheet.
fn cure(error: &str) -> &'static str {
    match error {
        "input voltage" => "check its supply",
        "overheating" => "let it cool down",
        "overload" => "free the joint",
        "motor encoder" => "its encoder is defective",
        "electrical shock" => "check supply and motor wires for a short circuit",
        _ => "see its data sheet",
    }
}

fn capitalised(words: &str) -> String {
    let mut rest = words.chars();
    rest.next()
        .map_or_else(String::new, |first| first.to_uppercase().chain(rest).collect())
}
