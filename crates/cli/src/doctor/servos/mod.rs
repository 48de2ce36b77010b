//! The servos: who answers, how they are set, what they complain of.

mod timing;

use super::finding::{Check, State};
use std::borrow::Cow;
use std::collections::BTreeSet;
use taxel_diagnose::{
    Kind, missing_servos, servo_name, servo_state, silent_servo, two_servos, unknown_model,
};
use taxel_joints::bus::ServoState;
use taxel_joints::registers::{Model, baud_of};
use taxel_joints::{BusSurvey, DynamixelConfig, SurveyedServo};

const AREA: &str = "servos";
/// A servo that waits longer than this before it answers was never set up for being asked often.
const LONG_DELAY_US: u16 = 20;
/// The supply that the data sheet allows, volts.
const SUPPLY_V: std::ops::RangeInclusive<f64> = 9.5..=16.0;
/// What was asked of the bus and what came.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ServoFacts {
    pub(super) survey: BusSurvey,
    /// Where nobody answered: bit rates at which somebody does, and who.
    pub(super) elsewhere: Vec<(u32, Vec<u8>)>,
}

/// What is to be said of the servos.
pub(super) fn check(config: &DynamixelConfig, facts: &ServoFacts) -> Vec<Check> {
    let survey = &facts.survey;
    let port = config.path.display().to_string();
    let write = |id: u8, call: &str| {
        format!(
            "python3 -c \"from dynamixel_sdk import *; p = PortHandler('{port}'); p.openPort(); \
             p.setBaudRate({}); print(PacketHandler(2.0).{})\"    # pip install dynamixel-sdk",
            config.baud,
            call.replace("(p, ID", &format!("(p, {id}"))
        )
    };
    let mut checks = Vec::new();
    if survey.servos.is_empty() {
        let problem = missing_servos(&format!("dynamixel:{port}"), config.baud);
        let none = Check::of_problem(AREA, &port, &problem).without_mend();
        checks.push(match facts.elsewhere.first() {
            Some((baud, ids)) => none
                .wanted(format!("{} servos", config.servo.len()))
                .advise(format!(
                    "servos {} answer at {baud} bit/s: write baud = {baud} into [joints], or set their Baud Rate \
                     (address 8) to {} bit/s",
                    list(ids),
                    config.baud
                )),
            None => none.wanted(format!("{} servos", config.servo.len())).advise(
                "is their supply on, the cable in the port marked TTL (or RS-485), and Protocol Type (address 13) 2? \
                 No servo answers at another usual bit rate either",
            ),
        });
        return checks;
    }
    if survey.damaged > 0 {
        checks.push(
            Check::warning(AREA, "damaged answers", &port, survey.damaged.to_string())
                .wanted("none")
                .advise("two servos with one id that answer at once, a bad connector, or a missing ground"),
        );
    }
    let mut of_servos = Vec::new();
    for (joint, wanted) in config.servo.iter().enumerate() {
        let name = servo_name(wanted);
        let number = format!("servo {}", wanted.id);
        let object = match wanted.name == number {
            true => number,
            false => format!("{number} ({})", wanted.name),
        };
        match survey.servos.iter().find(|s| s.id == wanted.id) {
            None => {
                let check = Check::of_problem(AREA, object, &silent_servo(joint, &name, false));
                of_servos.push(check.without_mend().advise(
                    "its supply, its place in the chain of cables, or its id: one that is in no table is told below",
                ));
            }
            Some(servo) => {
                of_servos.extend(check_servo(servo, (joint, &name), &object, config, &write));
                of_servos.extend(check_state(servo, (joint, &name), object, &write));
            }
        }
    }
    checks.extend(by_name(of_servos));
    let expected: BTreeSet<u8> = config.servo.iter().map(|s| s.id).collect();
    for servo in survey.servos.iter().filter(|s| !expected.contains(&s.id)) {
        let model = Model::of(servo.model_number).map_or("of an unknown model", |m| m.name);
        checks.push(
            Check::warning(
                AREA,
                "unexpected",
                format!("servo {}", servo.id),
                format!("answers ({model})"),
            )
            .wanted("a [[joints.servo]] table, or another bus for it"),
        );
    }
    checks.extend(timing::answers(config, &port, survey));
    checks.push(timing::cycle(config, &port, survey));
    checks
}

fn check_servo(
    servo: &SurveyedServo,
    (joint, name): (usize, &str),
    object: &str,
    config: &DynamixelConfig,
    write: &impl Fn(u8, &str) -> String,
) -> Vec<Check> {
    let id = servo.id;
    let mut checks = Vec::new();
    let model = match Model::of(servo.model_number) {
        Some(model) => model.name.to_string(),
        None => format!("model {}", servo.model_number),
    };
    let found = format!("{model}, firmware {}", servo.firmware);
    if servo.answers > 1 {
        checks.push(
            Check::of_problem(AREA, object, &two_servos(joint, name, servo.answers))
                .wanted("one id per servo")
                .run(write(id, "write1ByteTxRx(p, ID, 7, NEW_ID)")),
        );
    } else {
        checks.push(Check::ok(AREA, "answers", object, found));
    }
    if servo.status_return_level == Some(0)
        || (servo.identity.is_none() && servo.status_return_level.is_none())
    {
        checks.push(
            Check::error(AREA, "status return level", object, "answers pings and no reads")
                .wanted("2 (answers everything)")
                .run(write(id, "write1ByteTxOnly(p, ID, 68, 2)")),
        );
    }
    if let Some(identity) = servo.identity {
        let us = identity.return_delay_us;
        checks.push(match us > LONG_DELAY_US {
            true => Check::warning(
                AREA,
                "return delay time",
                object,
                format!("{us} us before each answer"),
            )
            .wanted("0")
            .run(write(id, "write1ByteTxRx(p, ID, 9, 0)"))
            .advise("address 9 is written with torque off; 250, as from the factory, is 500 us"),
            false => Check::ok(AREA, "return delay time", object, format!("{us} us")),
        });
        if baud_of(identity.baud_register).is_some_and(|baud| baud != config.baud) {
            checks.push(Check::warning(
                AREA,
                "baud rate",
                object,
                format!(
                    "answers at {}, and its Baud Rate register says {}, at which it will be after a restart",
                    config.baud,
                    baud_of(identity.baud_register).unwrap_or(0)
                ),
            ));
        }
    }
    if let Some(volts) = servo.voltage_v {
        let found = format!("{volts:.1} V");
        checks.push(match SUPPLY_V.contains(&volts) {
            true => Check::ok(AREA, "supply", object, found),
            false => Check::warning(AREA, "supply", object, found).wanted(format!(
                "{} to {} V",
                SUPPLY_V.start(),
                SUPPLY_V.end()
            )),
        });
    }
    checks
}

/// What a servo says of itself: temperature, hardware errors.
fn check_state(
    servo: &SurveyedServo,
    (joint, name): (usize, &str),
    object: String,
    write: &impl Fn(u8, &str) -> String,
) -> Vec<Check> {
    let state = ServoState {
        hardware_error: servo.hardware_error,
        temperature_c: servo.temperature_c,
        ..ServoState::default()
    };
    let mut problems = servo_state(joint, name, &state, false);
    if Model::of(servo.model_number).is_none() {
        problems.push(unknown_model(joint, name, servo.model_number));
    }
    let is_hot = problems.iter().any(|p| p.kind == Kind::ServoHot);
    let well = servo.temperature_c.filter(|_| !is_hot);
    let well = well.map(|c| Check::ok(AREA, "temperature", object.as_str(), format!("{c} degrees")));
    let bad = problems.iter().map(|problem| {
        let check = Check::of_problem(AREA, object.as_str(), problem);
        match problem.kind {
            Kind::ServoError => check.run(write(servo.id, "reboot(p, ID)")),
            _ => check,
        }
    });
    bad.chain(well).collect()
}

/// The same findings, those of one name together and the good ones of each last, so that what many
/// servos have in common is told once.
fn by_name(mut checks: Vec<Check>) -> Vec<Check> {
    let mut names: Vec<Cow<'static, str>> = Vec::new();
    for check in &checks {
        if !names.contains(&check.name) {
            names.push(check.name.clone());
        }
    }
    checks.sort_by_key(|c| {
        (
            names.iter().position(|name| name == &c.name),
            c.state == State::Ok,
        )
    });
    checks
}

fn list(ids: &[u8]) -> String {
    let ids: Vec<String> = ids.iter().map(u8::to_string).collect();
    ids.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_joints::PortLatency;
    use taxel_joints::bus::ServoIdentity;
    use taxel_joints::registers::HardwareError;

    pub(super) fn servo(id: u8) -> SurveyedServo {
        SurveyedServo {
            id,
            model_number: 1030,
            firmware: 46,
            answers: 1,
            identity: Some(ServoIdentity {
                model_number: 1030,
                firmware: 46,
                baud_register: 3,
                return_delay_us: 0,
                drive_mode: 0,
            }),
            torque_enabled: Some(false),
            status_return_level: Some(2),
            hardware_error: Some(HardwareError(0)),
            voltage_v: Some(12.0),
            temperature_c: Some(31),
            answers_ns: vec![100_000, 900_000],
        }
    }

    fn checks(servos: Vec<SurveyedServo>, elsewhere: Vec<(u32, Vec<u8>)>) -> Vec<Check> {
        let config = DynamixelConfig::new("/dev/ttyUSB0", 1..=2);
        let survey = BusSurvey {
            servos,
            damaged: 0,
            latency: PortLatency::default(),
        };
        check(&config, &ServoFacts { survey, elsewhere })
    }

    fn changed(change: impl FnOnce(&mut SurveyedServo)) -> Vec<Check> {
        let mut second = servo(2);
        change(&mut second);
        checks(vec![servo(1), second], Vec::new())
    }

    #[test]
    fn healthy_servos_are_told_with_what_they_are() {
        let checks = changed(|_| {});
        assert!(checks.iter().all(|c| c.state == State::Ok), "{checks:?}");
        let told: Vec<(&str, &str)> = checks
            .iter()
            .map(|c| (c.name.as_ref(), c.found.as_str()))
            .step_by(2)
            .collect();
        assert_eq!(
            told[..4],
            [
                ("answers", "XM430-W210, firmware 46"),
                ("return delay time", "0 us"),
                ("supply", "12.0 V"),
                ("temperature", "31 degrees"),
            ]
        );
        // docs/protocols.md, "Dynamixel cycle": two servos at 1 Mbit/s take 0.62 ms.
        assert!(checks.last().unwrap().found.starts_with("a cycle takes 0.62 ms"));
    }

    #[test]
    fn each_thing_that_is_wrong_has_its_state_and_what_mends_it() {
        let delay = |us: u16| move |s: &mut SurveyedServo| s.identity.as_mut().unwrap().return_delay_us = us;
        let cases: [(Vec<Check>, &str, State, &str); 8] = [
            (
                changed(delay(500)),
                "return delay time",
                State::Warning,
                "write1ByteTxRx(p, 2, 9, 0)",
            ),
            (
                changed(|s| s.answers = 2),
                "two-servos-one-id",
                State::Error,
                "write1ByteTxRx(p, 2, 7, NEW_ID)",
            ),
            (
                changed(|s| s.hardware_error = Some(HardwareError(0x24))),
                "servo-error",
                State::Error,
                "reboot(p, 2)",
            ),
            (
                changed(|s| s.status_return_level = Some(0)),
                "status return level",
                State::Error,
                "write1ByteTxOnly(p, 2, 68, 2)",
            ),
            (
                checks(vec![servo(1)], vec![]),
                "servo-silent",
                State::Error,
                "its supply",
            ),
            (
                checks(vec![servo(1), servo(2), servo(9)], vec![]),
                "unexpected",
                State::Warning,
                "",
            ),
            (
                checks(vec![], vec![(57_600, vec![1, 2])]),
                "servos-silent",
                State::Error,
                "servos 1, 2 answer at 57600 bit/s: write baud = 57600",
            ),
            (
                checks(vec![], vec![]),
                "servos-silent",
                State::Error,
                "is their supply on",
            ),
        ];
        for (checks, name, state, mend) in &cases {
            let bad = checks.iter().find(|c| c.name == *name && c.state != State::Ok);
            let bad = bad.unwrap_or_else(|| panic!("{name}: {checks:?}"));
            assert_eq!(bad.state, *state, "{bad:?}");
            assert!(bad.mend_text().contains(mend), "{}", bad.mend_text());
        }
        let error = &cases[2].0.iter().find(|c| c.name == "servo-error").unwrap().found;
        assert!(error.contains("hardware error: overheating, overload"), "{error}");
        for (checks, name) in [
            (changed(|s| s.voltage_v = Some(5.1)), "supply"),
            (changed(|s| s.temperature_c = Some(75)), "servo-hot"),
            (changed(|s| s.model_number = 7), "servo-model"),
            (
                changed(|s| s.identity.as_mut().unwrap().baud_register = 1),
                "baud rate",
            ),
        ] {
            assert!(
                checks.iter().any(|c| c.name == name && c.state == State::Warning),
                "{name}"
            );
        }
    }
}
