//! Potentiometers whose angles are to be read: whether lines come, and what they say. Nothing is sent.

use super::finding::Check;
use std::time::{Duration, Instant};
use taxel_diagnose::{absent_potentiometers, potentiometer_state, silent_potentiometers, unread_lines};
use taxel_joints::{AnalogueConfig, AnalogueReader, AnalogueSnapshot, PortState, StartError};
use taxel_playback::interrupt::Interrupt;

const AREA: &str = "joints";
/// So long lines are listened to: most boards start anew when their port is opened.
const LISTEN: Duration = Duration::from_secs(3);

/// Listens to the port.
pub(super) fn listen(config: &AnalogueConfig, interrupt: &Interrupt) -> Result<AnalogueSnapshot, StartError> {
    let reader = AnalogueReader::start(config, || ())?;
    interrupt.sleep_until(Instant::now() + LISTEN);
    Ok(reader.snapshot())
}

/// What is to be said of the potentiometers, whose joints begin with number `first`.
pub(super) fn check(config: &AnalogueConfig, first: usize, heard: &AnalogueSnapshot) -> Vec<Check> {
    let object = config.device.display().to_string();
    let counters = heard.counters;
    let problems = match &heard.port.state {
        PortState::Away { reason, .. } => vec![absent_potentiometers(config, reason)],
        PortState::Starting => vec![silent_potentiometers(config, false)],
        PortState::Open if counters.heard_ns.is_none() => {
            vec![silent_potentiometers(config, counters.malformed > 0)]
        }
        PortState::Open => {
            // A channel that was in some line of the listening is not missing.
            let lost = (0..heard.angles.len()).filter_map(|n| {
                let lost = heard.lost(n, heard.open_ns, u64::MAX)?;
                potentiometer_state(config, n, first + n, lost)
            });
            let seconds = LISTEN.as_secs_f64();
            let unread = (counters.malformed > 0).then(|| unread_lines(config, counters.malformed, seconds));
            unread.into_iter().chain(lost).collect()
        }
    };
    if problems.is_empty() {
        let names = config.joint.iter().zip(&heard.heard);
        let angles: Vec<String> = names
            .filter_map(|(joint, heard)| {
                Some(format!(
                    "{} {:.1}",
                    joint.name,
                    (*heard)?.angle.ok()?.to_degrees()
                ))
            })
            .collect();
        let hz = counters.lines as f64 / LISTEN.as_secs_f64();
        let found = format!("{hz:.0} lines a second; degrees: {}", angles.join(", "));
        return vec![Check::ok(AREA, "potentiometers", object, found)];
    }
    problems
        .iter()
        .map(|p| Check::of_problem(AREA, object.clone(), p))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::finding::State;
    use super::*;
    use taxel_joints::{AnalogueCounters, HeardChannel, NoAngle, PortStatus};

    #[test]
    fn potentiometers_are_judged_by_their_port_their_lines_and_each_joint() {
        let config: AnalogueConfig = toml::from_str(
            "device = \"/dev/lines\"\n[[joint]]\nname = \"left p\"\nchannel = \"p0\"\ncounts = [100, 900]\ndegrees = [0, 80]",
        )
        .unwrap();
        let away = PortState::Away {
            reason: "cannot open it".into(),
            since_ns: 0,
        };
        let cases = [
            (away, None, 0, Ok(0.5), State::Error, "cannot open it"),
            (
                PortState::Open,
                None,
                0,
                Err(NoAngle::NeverHeard),
                State::Error,
                "nothing comes from",
            ),
            (
                PortState::Open,
                None,
                9,
                Err(NoAngle::NeverHeard),
                State::Error,
                "no line that can be read",
            ),
            (PortState::Open, Some(1), 9, Ok(0.5), State::Warning, "9 lines"),
            (
                PortState::Open,
                Some(1),
                0,
                Err(NoAngle::Missing),
                State::Error,
                "channel p0 is not in the lines",
            ),
            (
                PortState::Open,
                Some(1),
                0,
                Err(NoAngle::AtEnd(0.0)),
                State::Error,
                "stands at an end (0 of 0 to 1023",
            ),
            (
                PortState::Open,
                Some(1),
                0,
                Ok(0.5),
                State::Ok,
                "100 lines a second; degrees: left p 28.6",
            ),
        ];
        for (state, heard_ns, malformed, angle, wanted, words) in cases {
            let heard = AnalogueSnapshot {
                angles: vec![angle],
                heard: vec![angle.is_ok().then_some(HeardChannel { t_ns: 1, angle })],
                counters: AnalogueCounters {
                    lines: 300,
                    malformed,
                    heard_ns,
                },
                port: PortStatus {
                    path: "/dev/lines".into(),
                    device: None,
                    state,
                    latency: None,
                    opened: 1,
                    taken_ns: None,
                    abandoned: false,
                },
                open_ns: 1,
            };
            let checks = check(&config, 2, &heard);
            assert_eq!(checks.len(), 1);
            assert_eq!(checks[0].state, wanted, "{words}");
            assert!(
                checks[0].json().to_string().contains(words),
                "{}",
                checks[0].json()
            );
        }
    }
}
