//! Whether the servos answer in time, and can be read as often as is wanted.

use super::{AREA, list};
use crate::doctor::finding::Check;
use taxel_joints::bus::wire_ns;
use taxel_joints::{BusSurvey, DynamixelConfig};

/// Answers to a sync read of so many bytes; the request has 14 and one per servo (docs/protocols.md,
/// "Dynamixel cycle").
const CYCLE_BYTES: usize = 12;
/// Most that `answer_margin_ms` may be.
const MOST_MARGIN_MS: f64 = 500.0;
/// Most that `watchdog_ms` may be, and its steps.
const MOST_WATCHDOG_MS: u16 = 2540;
const WATCHDOG_STEP_MS: usize = 20;

/// Late answers of all servos from which taxeld tells of them, if they are a fifth of all.
const LATE: usize = 3;
const LATE_SHARE: usize = 5;

/// Whether the daemon waits long enough for the servos' answers; nothing where none of them answered a read. A few answers
/// that come late are those of a busy machine; a servo whose answers all do is not read.
pub(super) fn answers(config: &DynamixelConfig, port: &str, survey: &BusSurvey) -> Option<Check> {
    let servos = (survey.servos.iter()).filter(|s| config.servo.iter().any(|wanted| wanted.id == s.id));
    let took: Vec<_> = servos.filter(|s| !s.answers_ns.is_empty()).collect();
    let usual_ms = survey.usual_margin_ns() as f64 / 1e6;
    let margin_ms = config.answer_margin_ms.unwrap_or(usual_ms);
    let ms = |ns: &u64| *ns as f64 / 1e6;
    let is_late = |ns: &u64| ms(ns) > margin_ms;
    let late: Vec<u8> = (took.iter())
        .filter_map(|servo| servo.answers_ns.iter().all(is_late).then_some(servo.id))
        .collect();
    let mut all: Vec<u64> = took.iter().flat_map(|servo| &servo.answers_ns).copied().collect();
    all.sort_unstable();
    let slowest_ms = all.last().map(ms)?;
    let (n, of) = (all.iter().filter(|ns| is_late(ns)).count(), all.len());
    let many = n >= LATE && n * LATE_SHARE >= of;
    let mut found = match n {
        0 => format!("the slowest came {slowest_ms:.1} ms after its time on the wire"),
        _ => format!(
            "{n} of {of} answers came later than the {margin_ms} ms that taxeld waits, up to {slowest_ms:.0} ms after their time on \
             the wire"
        ),
    };
    if late.is_empty() && !many {
        return Some(Check::ok(AREA, "answer time", port, found));
    }
    if !late.is_empty() {
        found += &format!(": it does not read servos {}", list(&late));
    }
    // Nine of ten answers come in time then; where all of a servo's are late, every one.
    let enough_ms = match late.is_empty() {
        true => ms(&all[of * 9 / 10]),
        false => slowest_ms,
    };
    Some(
        Check::error(AREA, "answer time", port, found)
            .wanted(format!("at most {margin_ms} ms"))
            .advise(more_time(config, enough_ms)),
    )
}

/// What gives answers that come so late the time that they take, where anything may.
fn more_time(config: &DynamixelConfig, slowest_ms: f64) -> String {
    let delays = "look for what delays them: a USB hub, or a slow adapter";
    if slowest_ms >= MOST_MARGIN_MS {
        return format!("no answer_margin_ms is long enough, {MOST_MARGIN_MS} is the most; {delays}");
    }
    let margin_ms = (2.0 * slowest_ms).ceil().min(MOST_MARGIN_MS);
    let is_taken = |watchdog_ms: &u16| {
        let with_both = DynamixelConfig {
            watchdog_ms: *watchdog_ms,
            answer_margin_ms: Some(margin_ms),
            ..config.clone()
        };
        with_both.check().is_ok()
    };
    let mut watchdogs_ms = (config.watchdog_ms..=MOST_WATCHDOG_MS).step_by(WATCHDOG_STEP_MS);
    match watchdogs_ms.find(is_taken) {
        Some(ms) if ms == config.watchdog_ms => {
            format!("write answer_margin_ms = {margin_ms:.1} into [joints]; or {delays}")
        }
        Some(ms) => format!(
            "write answer_margin_ms = {margin_ms:.1} and watchdog_ms = {ms}, which is not to be shorter than that and a cycle, \
             into [joints]; or {delays}"
        ),
        None => format!(
            "answer_margin_ms = {margin_ms:.1} is enough where motors are only read: with allow_writes no watchdog_ms, of which \
             {MOST_WATCHDOG_MS} is the most, is longer than that and a cycle; {delays}"
        ),
    }
}

/// Whether the servos can be read as often as the configuration wants.
pub(super) fn cycle(config: &DynamixelConfig, port: &str, survey: &BusSurvey) -> Check {
    let n = config.servo.len();
    let bytes = 14 + n + n * (11 + CYCLE_BYTES);
    let delays_us: u64 = survey
        .servos
        .iter()
        .filter(|s| config.servo.iter().any(|w| w.id == s.id))
        .filter_map(|s| s.identity)
        .map(|identity| u64::from(identity.return_delay_us))
        .sum();
    let usb_us = survey.latency.ftdi_timer_ms.map_or(0, |ms| u64::from(ms) * 1000);
    let cycle_us = wire_ns(bytes, config.baud) / 1000 + delays_us + usb_us;
    let most_hz = 1e6 / cycle_us.max(1) as f64;
    let found = format!(
        "a cycle takes {:.2} ms ({:.2} on the wire, {:.2} return delay{}): up to {most_hz:.0} Hz",
        cycle_us as f64 / 1e3,
        wire_ns(bytes, config.baud) as f64 / 1e6,
        delays_us as f64 / 1e3,
        match usb_us {
            0 => String::new(),
            us => format!(", {:.0} USB", us as f64 / 1e3),
        }
    );
    match most_hz >= config.rate_hz {
        true => Check::ok(AREA, "cycle", port, found),
        false => Check::warning(AREA, "cycle", port, found)
            .wanted(format!("{} Hz, as [joints] rate_hz says", config.rate_hz))
            .advise("return delay 0, a latency timer of 1 ms, a higher bit rate, or fewer servos per bus"),
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::servo;
    use super::*;
    use crate::doctor::finding::State;
    use taxel_joints::{PortLatency, SurveyedServo};

    #[test]
    fn answers_that_come_too_late_for_the_daemon_are_told_with_the_margin_that_they_need() {
        const MS: u64 = 1_000_000;
        let told = |answers_ms: &[u64], margin_ms: Option<f64>, timer_ms: Option<u32>| {
            let mut config = DynamixelConfig::new("p", 1..=2);
            config.answer_margin_ms = margin_ms;
            let mut late = servo(2);
            late.answers_ns = answers_ms.iter().map(|ms| ms * MS).collect();
            let survey = BusSurvey {
                servos: vec![servo(1), late],
                damaged: 0,
                latency: PortLatency {
                    ftdi_timer_ms: timer_ms,
                    ..PortLatency::default()
                },
            };
            let check = answers(&config, "p", &survey).unwrap();
            (check.state, format!("{}; {}", check.found, check.mend_text()))
        };
        for (answers_ms, margin_ms, timer_ms) in [
            (&[][..], None, None),
            (&[1, 3], None, None),
            // A busy machine, which delays some.
            (&[1, 60], None, None),
            (&[1, 1, 20, 60], None, None),
            (&[60, 62], Some(100.0), None),
            (&[20, 30], None, Some(16)),
        ] {
            let (state, text) = told(answers_ms, margin_ms, timer_ms);
            assert_eq!(state, State::Ok, "{text}");
        }
        for (answers_ms, margin_ms, words) in [
            (&[60, 62][..], None, "servos 2; write answer_margin_ms = 124.0"),
            (&[60, 62], Some(50.0), "servos 2; write answer_margin_ms = 124.0"),
            (&[300, 310], None, "servos 2; write answer_margin_ms = 500.0"),
            (
                &[590, 600],
                None,
                "servos 2; no answer_margin_ms is long enough, 500 is the most; look for what delays them",
            ),
            // Half of the answers, as through a busy hub: enough for nine of ten, and no servo is named.
            (
                &[1, 1, 1, 1, 15, 15, 15, 15],
                None,
                "4 of 10 answers came later than the 4 ms that taxeld waits, up to 15 ms after their time on the wire; write \
                 answer_margin_ms = 30.0",
            ),
        ] {
            let (state, text) = told(answers_ms, margin_ms, None);
            assert_eq!(state, State::Error, "{text}");
            assert!(text.contains(words), "{text}");
        }
    }

    #[test]
    fn the_margin_that_is_advised_is_one_that_the_configuration_takes() {
        const MS: u64 = 1_000_000;
        let of = |servos: u8, baud, rate_hz, watchdog_ms| DynamixelConfig {
            allow_writes: true,
            baud,
            rate_hz,
            watchdog_ms,
            ..DynamixelConfig::new("p", 1..=servos)
        };
        let few = |watchdog_ms| of(2, 1_000_000, 100.0, watchdog_ms);
        let slow = of(64, 9600, 1.2, 2540);
        for (mut config, slowest_ms, margin, watchdog_ms, words) in [
            (few(200), 30, Some(60.0), 200, "= 60.0 into [joints]; or"),
            (few(60), 30, Some(60.0), 80, "= 60.0 and watchdog_ms = 80, which"),
            (
                few(200),
                200,
                Some(400.0),
                420,
                "= 400.0 and watchdog_ms = 420, which",
            ),
            (
                of(2, 57_600, 100.0, 200),
                310,
                Some(500.0),
                540,
                "watchdog_ms = 540, which",
            ),
            (
                slow,
                310,
                None,
                2540,
                "with allow_writes no watchdog_ms, of which 2540",
            ),
        ] {
            assert!(config.check().is_ok(), "{config:?}");
            let mut late = servo(2);
            late.answers_ns = vec![slowest_ms * MS];
            let survey = BusSurvey {
                servos: vec![servo(1), late],
                damaged: 0,
                latency: PortLatency::default(),
            };
            let text = answers(&config, "p", &survey).unwrap().mend_text();
            assert!(text.contains(words), "{text}");
            (config.answer_margin_ms, config.watchdog_ms) = (margin, watchdog_ms);
            assert!(config.check().is_ok(), "{text}");
        }
    }

    #[test]
    fn a_cycle_that_is_too_long_for_the_rate_is_told() {
        let mut config = DynamixelConfig::new("p", 1..=16);
        config.baud = 57_600;
        let slow: Vec<SurveyedServo> = (1..=16)
            .map(|id| {
                let mut s = servo(id);
                s.identity.as_mut().unwrap().return_delay_us = 500;
                s
            })
            .collect();
        let survey = BusSurvey {
            servos: slow,
            damaged: 0,
            latency: PortLatency::default(),
        };
        let cycle = cycle(&config, "p", &survey);
        assert_eq!(cycle.state, State::Warning);
        assert!(cycle.found.contains("8.00 return delay"), "{}", cycle.found);
    }
}
