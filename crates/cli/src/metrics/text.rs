//! The daemon's status as OpenMetrics text.

use serde::Serialize;
use serde_json::Value;
use std::fmt::Write;
use taxel_wire::status::{QuantileStatus, Status};

/// Labels of a sample: name and value.
type Labels<'a> = [(&'a str, &'a str)];

/// The metrics of a status; of none where no daemon answers, which `taxeld_up` tells.
pub(crate) fn of(status: Option<&Status>) -> String {
    let mut text = Text::default();
    text.gauge("up", "Whether taxeld answers.", &[], status.is_some().into());
    if let Some(status) = status {
        text.whole(status);
        text.buses(status);
        text.boards(status);
        text.joints(status);
        text.readers(status);
    }
    text.finish()
}

/// Samples by family: in OpenMetrics those of one family follow each other.
#[derive(Default)]
struct Text {
    families: Vec<(String, Family)>,
}

struct Family {
    kind: &'static str,
    help: String,
    samples: String,
}

impl Text {
    fn whole(&mut self, status: &Status) {
        let about = [
            ("version", status.version.as_str()),
            ("layout", status.layout.as_str()),
        ];
        self.sample("info", "info", "The daemon and its hand.", "_info", &about, "1");
        self.gauge(
            "uptime_seconds",
            "Since the daemon's start.",
            &[],
            status.uptime_s,
        );
        self.gauge(
            "tick_rate_hertz",
            "Images per second asked for, in timer mode.",
            &[],
            status.tick.rate_hz,
        );
        for (name, value) in [
            ("paused", f64::from(u8::from(status.paused))),
            ("calibrating", f64::from(u8::from(status.calibrating))),
            ("contact_threshold", status.threshold),
            ("taxels_in_contact", status.contacts as f64),
            ("taxels_missing", status.missing as f64),
            ("taxels_faulty", status.faulty as f64),
            ("subscribers", status.images.sent.subscribers as f64),
            ("profiles", status.profiles.len() as f64),
            ("profiles_max", status.profile_budget.max as f64),
            ("profiles_budget_seconds", status.profile_budget.budget_us / 1e6),
            ("profiles_spent_seconds", status.profile_budget.spent_us / 1e6),
            (
                "image_gap_longest_seconds",
                status.images.sent.longest_gap_ms / 1e3,
            ),
            ("image_rate_hertz", status.images.rate_hz),
        ] {
            self.gauge(name, "Now; docs/guide.md, \"See what it does\".", &[], value);
        }
        for (name, help, value) in [
            ("images_made", "Images made.", status.images.made),
            (
                "image_overruns",
                "Ticks given up because the daemon was held up.",
                status.images.overruns,
            ),
            (
                "images_unpublished",
                "Images that could not be handed over.",
                status.images.unpublished,
            ),
            (
                "images_sent",
                "Images sent to subscribers.",
                status.images.sent.images,
            ),
            (
                "images_skipped",
                "Images that a subscriber was not sent.",
                status.images.sent.skipped,
            ),
            (
                "control_made_room",
                "Clients of the control sockets that lost their place.",
                status.control.made_room,
            ),
            (
                "control_slowed",
                "Requests that had to wait.",
                status.control.slowed,
            ),
        ] {
            self.counter(name, help, &[], value);
        }
        self.gauge(
            "control_clients",
            "Connections to the control sockets.",
            &[],
            status.control.clients as f64,
        );
        let images = &status.images;
        let latency = "From a tick's newest reading until its images were handed over.";
        self.quantiles("image_latency_seconds", latency, &[], &images.latency_us);
        let lateness = "From when a tick was due until its images were handed over: the jitter of the tick.";
        self.quantiles("image_lateness_seconds", lateness, &[], &images.lateness_us);
        self.ages(&images.sent.ages);
        for severe in [true, false] {
            let count = status
                .problems
                .iter()
                .filter(|problem| problem.severe == severe)
                .count();
            let severity = if severe { "error" } else { "warning" };
            self.gauge(
                "problems",
                "What is wrong now.",
                &[("severity", severity)],
                count as f64,
            );
        }
        for problem in &status.problems {
            let labels = [
                ("kind", problem.kind.as_str()),
                ("bus", problem.bus.as_deref().unwrap_or_default()),
                ("module", problem.module.as_deref().unwrap_or_default()),
                ("joint", problem.joint.as_deref().unwrap_or_default()),
            ];
            self.gauge(
                "problem_seconds",
                "Since when something is wrong.",
                &labels,
                problem.since_s,
            );
        }
    }

    fn buses(&mut self, status: &Status) {
        for bus in &status.buses {
            let labels = [("bus", bus.name.as_str())];
            let up = bus.link == "up" && bus.state != "bus-off";
            self.gauge("bus_up", "Whether a bus can be read.", &labels, up.into());
            let (tx, rx) = (bus.error_counters.tx, bus.error_counters.rx);
            self.gauge(
                "bus_error_counter_tx",
                "Error counter of sending, 0 to 255.",
                &labels,
                tx.into(),
            );
            self.gauge(
                "bus_error_counter_rx",
                "Error counter of receiving, 0 to 255.",
                &labels,
                rx.into(),
            );
            self.numbers("bus", "buses[]", &labels, bus, &[]);
            self.numbers("bus_error_frames", "buses[].errors", &labels, &bus.errors, &[]);
        }
    }

    fn boards(&mut self, status: &Status) {
        for board in &status.boards {
            let labels = [("bus", board.bus.as_str()), ("module", board.module.as_str())];
            let living = board.state == "living";
            self.gauge(
                "board_up",
                "Whether the board of a module speaks.",
                &labels,
                living.into(),
            );
            self.numbers("board", "boards[]", &labels, board, &["board", "silent_ms"]);
        }
    }

    fn joints(&mut self, status: &Status) {
        let Some(joints) = &status.joints else { return };
        let connected = joints.state == "connected";
        self.gauge("joints_up", "Whether the joints are read.", &[], connected.into());
        self.gauge(
            "joints_cycle_hertz",
            "Readings of each joint per second.",
            &[],
            joints.cycle_hz,
        );
        let settings = ["baud", "ftdi_latency_ms", "watchdog_ms", "version"];
        if let Some(servos) = &joints.servos {
            self.numbers("servos", "joints", &[], servos, &settings);
        }
        if let Some(hand) = &joints.allegro {
            self.numbers("allegro", "joints", &[], hand, &settings);
        }
        for joint in &joints.joints {
            let labels = [("joint", joint.name.as_str())];
            let problems = joint.problems.len() as f64;
            self.gauge(
                "joint_problems",
                "What is wrong with a joint now.",
                &labels,
                problems,
            );
            if let Some(temperature) = joint.servo.as_ref().and_then(|servo| servo.temperature_c) {
                let help = "Temperature of a servo.";
                self.gauge("joint_temperature_celsius", help, &labels, temperature.into());
            }
            let known = ["id", "temperature_c"];
            self.numbers("joint", "joints.joints[]", &labels, joint, &known);
        }
    }

    fn readers(&mut self, status: &Status) {
        for profile in &status.profiles {
            let id = profile.id.to_string();
            let labels = [("profile", id.as_str())];
            self.counter(
                "profile_images",
                "Images made for a profile.",
                &labels,
                profile.images,
            );
            let readers = profile.subscribers as f64;
            self.gauge("profile_subscribers", "Who is shown a profile.", &labels, readers);
            for (quantile, value) in [("0.5", profile.cost_us.p50), ("0.99", profile.cost_us.p99)] {
                let labels = [labels[0], ("quantile", quantile)];
                let help = "What an image of a profile takes.";
                self.sample(
                    "profile_cost_seconds",
                    "summary",
                    help,
                    "",
                    &labels,
                    &number(value / 1e6),
                );
            }
        }
    }

    /// Each number of a part of the status: whole numbers count since the start, fractions are of now.
    fn numbers(
        &mut self,
        prefix: &str,
        place: &str,
        labels: &Labels<'_>,
        part: &impl Serialize,
        but: &[&str],
    ) {
        let Ok(Value::Object(part)) = serde_json::to_value(part) else {
            return;
        };
        for (key, value) in part.iter().filter(|(key, _)| !but.contains(&key.as_str())) {
            let name = format!("{prefix}_{key}");
            let help = format!("{place}.{key} of `taxel status --json`.");
            match (value.as_u64(), value.as_f64()) {
                (Some(count), _) => self.counter(&name, &help, labels, count),
                (None, Some(value)) => self.gauge(&name, &help, labels, value),
                (None, None) => {}
            }
        }
    }

    fn gauge(&mut self, name: &str, help: &str, labels: &Labels<'_>, value: f64) {
        self.sample(name, "gauge", help, "", labels, &number(value));
    }

    fn counter(&mut self, name: &str, help: &str, labels: &Labels<'_>, value: u64) {
        self.sample(name, "counter", help, "_total", labels, &value.to_string());
    }

    /// Microseconds as a summary in seconds.
    fn quantiles(&mut self, name: &str, help: &str, labels: &Labels<'_>, of: &QuantileStatus) {
        for (quantile, value) in [
            ("0.5", of.p50),
            ("0.99", of.p99),
            ("0.999", of.p999),
            ("1", of.max),
        ] {
            let mut labels = labels.to_vec();
            labels.push(("quantile", quantile));
            self.sample(name, "summary", help, "", &labels, &number(value / 1e6));
        }
    }

    /// The ages of images as a histogram in seconds. Its rows come and go as ages are seen, so buckets are few and fixed.
    fn ages(&mut self, rows: &[(u64, u64)]) {
        let help = "From when an image was due until it was sent.";
        let name = "image_age_seconds";
        let up_to = |most_us: u64| {
            rows.iter()
                .filter(|(age, _)| *age <= most_us)
                .map(|(_, n)| n)
                .sum::<u64>()
        };
        for most_us in [
            50, 100, 200, 500, 1_000, 2_000, 5_000, 10_000, 20_000, 50_000, 100_000, 1_000_000,
        ] {
            let le = number(most_us as f64 / 1e6);
            let count = up_to(most_us).to_string();
            self.sample(name, "histogram", help, "_bucket", &[("le", &le)], &count);
        }
        let all = up_to(u64::MAX).to_string();
        self.sample(name, "histogram", help, "_bucket", &[("le", "+Inf")], &all);
        self.sample(name, "histogram", help, "_count", &[], &all);
        // Of each age only the bound is known.
        let sum = rows.iter().map(|(age, n)| *age as f64 * *n as f64).sum::<f64>() / 1e6;
        self.sample(name, "histogram", help, "_sum", &[], &number(sum));
    }

    fn sample(
        &mut self,
        name: &str,
        kind: &'static str,
        help: &str,
        suffix: &str,
        labels: &Labels<'_>,
        value: &str,
    ) {
        let family = match self.families.iter_mut().find(|(known, _)| known == name) {
            Some((_, family)) => family,
            None => {
                let family = Family {
                    kind,
                    help: help.into(),
                    samples: String::new(),
                };
                self.families.push((name.into(), family));
                &mut self.families.last_mut().expect("just pushed").1
            }
        };
        let name = if name == "info" {
            "taxeld"
        } else {
            &format!("taxeld_{name}")
        };
        let labels: Vec<String> = labels
            .iter()
            .map(|(key, value)| format!("{key}=\"{}\"", escaped(value)))
            .collect();
        let labels = match labels.is_empty() {
            true => String::new(),
            false => format!("{{{}}}", labels.join(",")),
        };
        let _ = writeln!(family.samples, "{name}{suffix}{labels} {value}");
    }

    fn finish(self) -> String {
        let mut text = String::new();
        for (name, family) in self.families {
            let name = if name == "info" {
                "taxeld".to_owned()
            } else {
                format!("taxeld_{name}")
            };
            let _ = write!(
                text,
                "# TYPE {name} {}\n# HELP {name} {}\n",
                family.kind,
                escaped(&family.help)
            );
            text += &family.samples;
        }
        text + "# EOF\n"
    }
}

fn number(value: f64) -> String {
    match value {
        _ if value.is_nan() => "NaN".into(),
        _ if value.is_infinite() => (if value > 0.0 { "+Inf" } else { "-Inf" }).into(),
        _ => value.to_string(),
    }
}

fn escaped(text: &str) -> String {
    text.replace('\\', "\\\\")
        .replace('"', "\\\"")
        .replace('\n', "\\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;
    use std::collections::HashSet;

    fn status() -> Status {
        let quantiles = json!({ "p50": 20.0, "p99": 80.0, "p999": 100.0, "max": 2000.0 });
        serde_json::from_value(json!({
            "version": "0.1.0", "layout": "a \"hand\"", "uptime_s": 3.5, "profile": {},
            "images": {
                "made": 90, "rate_hz": 30.0, "latency_us": quantiles, "lateness_us": quantiles,
                "sent": { "subscribers": 2, "images": 7, "ages": [[40, 3], [900, 2], [5_000_000, 1]] },
            },
            "problems": [{ "kind": "board-silent", "bus": "can0", "module": "index tip", "severe": true, "since_s": 2.0 }],
            "buses": [
                { "name": "can0", "link": "up", "state": "error-active", "received": 5, "frames_hz": 0.0 },
                { "name": "can1", "link": "up", "state": "bus-off", "received": 6, "frames_hz": 1.5 },
            ],
            "boards": [{ "bus": "can0", "module": "index tip", "board": 3, "state": "living", "sweeps": 4 }],
            "joints": {
                "source": "dynamixel:a", "state": "connected", "cycle_hz": 100.0, "baud": 1_000_000, "timeouts": 1,
                "joints": [{ "name": "index 0", "state": "well", "id": 1, "angle_rad": 0.5, "temperature_c": 40 }],
            },
            "profiles": [{ "id": 0, "profile": {}, "images": 9, "cost_us": { "p50": 10.0 } }],
        }))
        .unwrap()
    }

    #[test]
    fn every_count_and_quantile_is_a_sample_of_its_family() {
        let text = of(Some(&status()));
        for wanted in [
            "taxeld_up 1",
            "taxeld_info{version=\"0.1.0\",layout=\"a \\\"hand\\\"\"} 1",
            "taxeld_images_made_total 90",
            "taxeld_image_latency_seconds{quantile=\"0.99\"} 0.00008",
            "taxeld_image_age_seconds_bucket{le=\"0.00005\"} 3",
            "taxeld_image_age_seconds_bucket{le=\"0.001\"} 5",
            "taxeld_image_age_seconds_bucket{le=\"+Inf\"} 6",
            "taxeld_image_age_seconds_count 6",
            "taxeld_problems{severity=\"error\"} 1",
            "taxeld_bus_up{bus=\"can0\"} 1",
            "taxeld_bus_up{bus=\"can1\"} 0",
            "taxeld_bus_received_total{bus=\"can1\"} 6",
            "taxeld_bus_frames_hz{bus=\"can0\"} 0",
            "taxeld_bus_error_frames_bus_off_total{bus=\"can0\"} 0",
            "taxeld_board_sweeps_total{bus=\"can0\",module=\"index tip\"} 4",
            "taxeld_servos_timeouts_total 1",
            "taxeld_joint_angle_rad{joint=\"index 0\"} 0.5",
            "taxeld_joint_temperature_celsius{joint=\"index 0\"} 40",
        ] {
            assert!(text.lines().any(|line| line == wanted), "{wanted} in\n{text}");
        }
        assert!(text.ends_with("# EOF\n"));
    }

    #[test]
    fn the_samples_of_a_family_follow_each_other() {
        let text = of(Some(&status()));
        let mut done = HashSet::new();
        let mut family = String::new();
        for line in text.lines() {
            if let Some(rest) = line.strip_prefix("# TYPE ") {
                family = rest.split(' ').next().unwrap().to_owned();
                assert!(done.insert(family.clone()), "{family} comes twice");
            }
            assert!(
                line.starts_with('#') || line.starts_with(&family),
                "{line} in {family}"
            );
        }
    }

    #[test]
    fn a_daemon_that_is_gone_is_told() {
        let text = of(None);
        assert!(
            text.contains("taxeld_up 0\n") && text.ends_with("# EOF\n"),
            "{text}"
        );
    }

    #[test]
    fn the_dashboard_asks_for_metrics_that_there_are() {
        let dashboard = include_str!("../../../../docs/grafana/taxeld.json");
        serde_json::from_str::<Value>(dashboard).unwrap();
        let text = of(Some(&status()));
        let names = dashboard.split(|c: char| !c.is_ascii_alphanumeric() && c != '_');
        let mut asked = 0;
        for name in names.filter(|name| name.starts_with("taxeld_")) {
            asked += 1;
            let is_there = |line: &str| {
                line.strip_prefix(name)
                    .is_some_and(|rest| rest.starts_with(['{', ' ']))
            };
            assert!(text.lines().any(is_there), "no metric {name}");
        }
        assert!(asked > 10);
    }
}
