//! The daemon's status as metrics.

use super::families::{Families, Format, Kind, Labels, number};
use super::numbers::numbers;
use taxel_wire::status::{ErrorFrameStatus, JointsStatus, Report, Status};

/// The metrics of a status; of none where no daemon answers, which `taxeld_up` tells.
pub(super) fn of(status: Option<&Status>, format: Format) -> String {
    let mut families = Families::default();
    families.gauge("up", "Whether taxeld answers.", &[], status.is_some().into());
    if let Some(status) = status {
        whole(&mut families, status);
        images(&mut families, status);
        problems(&mut families, status);
        buses(&mut families, status);
        boards(&mut families, status);
        if let Some(status) = &status.joints {
            joints(&mut families, status);
        }
        profiles(&mut families, status);
    }
    families.text(format)
}

fn whole(to: &mut Families, status: &Status) {
    let about = [
        ("version", status.version.as_str()),
        ("layout", status.layout.as_str()),
    ];
    to.sample("", Kind::Info, "The daemon and its hand.", "_info", &about, "1");
    let (tick, budget) = (&status.tick, &status.profile_budget);
    for (name, help, value) in [
        ("uptime_seconds", "Since the daemon's start.", status.uptime_s),
        (
            "tick_rate_hertz",
            "Images per second asked for, in timer mode.",
            tick.rate_hz,
        ),
        (
            "paused",
            "Whether images show no contact because somebody asked for that.",
            status.paused.into(),
        ),
        (
            "calibrating",
            "Whether the baseline is being measured.",
            status.calibrating.into(),
        ),
        (
            "contact_threshold",
            "Force from which a taxel is in contact, in the unit of the forces.",
            status.threshold,
        ),
        ("taxels_in_contact", "Taxels in contact.", status.contacts as f64),
        (
            "taxels_missing",
            "Taxels without a usable value.",
            status.missing as f64,
        ),
        (
            "taxels_faulty",
            "Taxels out of use for another reason.",
            status.faulty as f64,
        ),
        (
            "profiles",
            "Display profiles that images are made for.",
            status.profiles.len() as f64,
        ),
        (
            "profiles_max",
            "Display profiles that there may be at once.",
            budget.max as f64,
        ),
        (
            "profiles_budget_seconds",
            "Time of a tick set aside for all display profiles.",
            budget.budget_us / 1e6,
        ),
        (
            "profiles_spent_seconds",
            "Time of a tick that the display profiles there are take.",
            budget.spent_us / 1e6,
        ),
        (
            "control_clients",
            "Connections to the control sockets.",
            status.control.clients as f64,
        ),
    ] {
        to.gauge(name, help, &[], value);
    }
    numbers(to, "conditioning", &[], &status.conditioning);
    let help = "Clients of the control sockets that lost their place.";
    to.counter("control_made_room", help, &[], status.control.made_room);
    let help = "Requests that had to wait because their client asks too often.";
    to.counter("control_slowed", help, &[], status.control.slowed);
}

fn images(to: &mut Families, status: &Status) {
    let images = &status.images;
    let sent = &images.sent;
    for (name, help, value) in [
        ("subscribers", "Who is sent images.", sent.subscribers as f64),
        (
            "image_gap_longest_seconds",
            "The longest that a subscriber was without an image between two, since the daemon's start.",
            sent.longest_gap_ms / 1e3,
        ),
        (
            "image_rate_hertz",
            "Images per second over the last second or so.",
            images.rate_hz,
        ),
    ] {
        to.gauge(name, help, &[], value);
    }
    for (name, help, value) in [
        ("images_made", "Images made.", images.made),
        (
            "image_overruns",
            "Ticks given up because the daemon was held up.",
            images.overruns,
        ),
        (
            "images_unpublished",
            "Images that could not be handed over.",
            images.unpublished,
        ),
        ("images_sent", "Images sent to subscribers.", sent.images),
        (
            "images_skipped",
            "Images that a subscriber was not sent since it was too slow for them.",
            sent.skipped,
        ),
        (
            "images_paced",
            "Images that a subscriber was not sent since it asked for fewer.",
            sent.paced,
        ),
    ] {
        to.counter(name, help, &[], value);
    }
    let latency = "From a tick's newest reading until its images were handed over.";
    histogram(
        to,
        "image_latency_seconds",
        latency,
        &images.latencies,
        images.latency_sum_us,
    );
    let lateness = "From when a tick was due until its images were handed over.";
    histogram(
        to,
        "image_lateness_seconds",
        lateness,
        &images.latenesses,
        images.lateness_sum_us,
    );
    let jitter = "From when a tick was due until the daemon began with it: its jitter.";
    histogram(
        to,
        "tick_jitter_seconds",
        jitter,
        &images.jitters,
        images.jitter_sum_us,
    );
    let duration = "From when the daemon began with a tick until its images were handed over.";
    histogram(
        to,
        "tick_duration_seconds",
        duration,
        &images.durations,
        images.duration_sum_us,
    );
    let age = "From when an image was due until it was sent.";
    histogram(to, "image_age_seconds", age, &sent.ages, sent.age_sum_us);
}

/// Microseconds as a histogram in seconds. Rows come and go as times are seen, so buckets are few and fixed.
fn histogram(to: &mut Families, name: &str, help: &'static str, rows: &[(u64, u64)], sum_us: u64) {
    let mut sample = |suffix: &str, labels: &Labels<'_>, value: &str| {
        to.sample(name, Kind::Histogram, help, suffix, labels, value);
    };
    let up_to = |most_us: u64| {
        rows.iter()
            .filter(|(us, _)| *us <= most_us)
            .map(|(_, n)| n)
            .sum::<u64>()
    };
    for most_us in [
        50, 100, 200, 500, 1_000, 2_000, 5_000, 10_000, 20_000, 50_000, 100_000, 1_000_000,
    ] {
        let le = number(most_us as f64 / 1e6);
        sample("_bucket", &[("le", &le)], &up_to(most_us).to_string());
    }
    let all = up_to(u64::MAX).to_string();
    sample("_bucket", &[("le", "+Inf")], &all);
    sample("_count", &[], &all);
    sample("_sum", &[], &number(sum_us as f64 / 1e6));
}

fn problems(to: &mut Families, status: &Status) {
    let severity = |severe| if severe { "error" } else { "warning" };
    for severe in [true, false] {
        let of_this = status.problems.iter().filter(|problem| problem.severe == severe);
        let labels = [("severity", severity(severe))];
        to.gauge("problems", "What is wrong now.", &labels, of_this.count() as f64);
    }
    for problem in &status.problems {
        let labels = [
            ("kind", problem.kind.as_str()),
            ("severity", severity(problem.severe)),
            ("bus", problem.bus.as_deref().unwrap_or_default()),
            ("module", problem.module.as_deref().unwrap_or_default()),
            ("joint", problem.joint.as_deref().unwrap_or_default()),
        ];
        let help = "For how long something has been wrong.";
        to.gauge("problem_seconds", help, &labels, problem.since_s);
    }
}

fn buses(to: &mut Families, status: &Status) {
    for bus in &status.buses {
        let name = bus.name.as_str();
        let labels = [("bus", name)];
        let up = bus.link == "up" && bus.state != "bus-off";
        to.gauge("bus_up", "Whether a bus can be read.", &labels, up.into());
        let (tx, rx) = (bus.error_counters.tx.into(), bus.error_counters.rx.into());
        let help = "Error counter of sending, 0 to 255.";
        to.gauge("bus_error_level_tx", help, &labels, tx);
        let help = "Error counter of receiving, 0 to 255.";
        to.gauge("bus_error_level_rx", help, &labels, rx);
        numbers(to, "bus", &labels, bus);
        to.counter("bus_error_frames", "Error frames.", &labels, bus.errors.frames);
        let causes = serde_json::to_value(&bus.errors).unwrap_or_default();
        let named = ErrorFrameStatus::KEYS.iter().map(|key| key.name);
        for cause in named.filter(|name| *name != "frames") {
            let labels = [("bus", name), ("cause", cause)];
            let frames = causes[cause].as_u64().unwrap_or_default();
            let help = "Error frames by their cause, of which one frame may have several.";
            to.counter("bus_error_frame_causes", help, &labels, frames);
        }
    }
}

fn boards(to: &mut Families, status: &Status) {
    for board in &status.boards {
        let labels = [("bus", board.bus.as_str()), ("module", board.module.as_str())];
        let living = board.state == "living";
        let help = "Whether the board of a module speaks.";
        to.gauge("board_up", help, &labels, living.into());
        numbers(to, "board", &labels, board);
    }
}

fn joints(to: &mut Families, joints: &JointsStatus) {
    let connected = joints.state == "connected";
    to.gauge("joints_up", "Whether the joints are read.", &[], connected.into());
    let help = "Readings of each joint per second.";
    to.gauge("joints_cycle_hertz", help, &[], joints.cycle_hz);
    if let Some(servos) = &joints.servos {
        numbers(to, "servos", &[], servos);
    }
    if let Some(hand) = &joints.allegro {
        numbers(to, "allegro", &[], hand);
    }
    for joint in &joints.joints {
        let labels = [("joint", joint.name.as_str())];
        let problems = joint.problems.len() as f64;
        to.gauge(
            "joint_problems",
            "How much is wrong with a joint now.",
            &labels,
            problems,
        );
        numbers(to, "joint", &labels, joint);
        if let Some(servo) = &joint.servo {
            numbers(to, "joint", &labels, servo);
        }
    }
}

fn profiles(to: &mut Families, status: &Status) {
    for profile in &status.profiles {
        let id = profile.id.to_string();
        let labels = [("profile", id.as_str())];
        let help = "Images made for a profile.";
        to.counter("profile_images", help, &labels, profile.images);
        let readers = profile.subscribers as f64;
        to.gauge("profile_subscribers", "Who is shown a profile.", &labels, readers);
        for (quantile, value) in [("0.5", profile.cost_us.p50), ("0.99", profile.cost_us.p99)] {
            let labels = [labels[0], ("quantile", quantile)];
            let help = "What an image of a profile takes.";
            let value = number(value / 1e6);
            to.sample("profile_cost_seconds", Kind::Summary, help, "", &labels, &value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};
    use std::collections::HashSet;

    fn status() -> Status {
        serde_json::from_value(json!({
            "version": "0.1.0", "layout": "a \"hand\"", "uptime_s": 3.5, "profile": {}, "conditioning": { "glitches": 2 },
            "images": {
                "made": 90, "rate_hz": 30.0, "latencies": [[50, 80], [100, 10]], "latenesses": [[200, 90]],
                "jitters": [[20, 70], [100, 20]], "durations": [[100, 85], [2000, 5]],
                "sent": { "subscribers": 2, "images": 7, "skipped": 4, "paced": 5, "ages": [[40, 3], [900, 2], [5_000_000, 1]] },
            },
            "problems": [{ "kind": "board-silent", "bus": "can0", "module": "index tip", "severe": true, "since_s": 2.0 }],
            "buses": [
                { "name": "can0", "link": "up", "state": "error-active", "received": 5, "frames_hz": 0.0, "load_percent": 25.0 },
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
        let text = of(Some(&status()), Format::OpenMetrics);
        for wanted in [
            "taxeld_up 1",
            "taxeld_info{version=\"0.1.0\",layout=\"a \\\"hand\\\"\"} 1",
            "taxeld_images_made_total 90",
            "taxeld_conditioning_glitches_total 2",
            "taxeld_images_skipped_total 4",
            "taxeld_images_paced_total 5",
            "taxeld_image_latency_seconds_bucket{le=\"0.00005\"} 80",
            "taxeld_image_latency_seconds_bucket{le=\"0.0001\"} 90",
            "taxeld_image_lateness_seconds_bucket{le=\"0.0001\"} 0",
            "taxeld_image_lateness_seconds_count 90",
            "taxeld_tick_jitter_seconds_bucket{le=\"0.00005\"} 70",
            "taxeld_tick_jitter_seconds_count 90",
            "taxeld_tick_duration_seconds_bucket{le=\"0.0001\"} 85",
            "taxeld_tick_duration_seconds_bucket{le=\"0.002\"} 90",
            "taxeld_image_age_seconds_bucket{le=\"0.00005\"} 3",
            "taxeld_image_age_seconds_bucket{le=\"0.001\"} 5",
            "taxeld_image_age_seconds_bucket{le=\"+Inf\"} 6",
            "taxeld_image_age_seconds_count 6",
            "taxeld_problems{severity=\"error\"} 1",
            "taxeld_problem_seconds{kind=\"board-silent\",severity=\"error\",bus=\"can0\",module=\"index tip\",joint=\"\"} 2",
            "taxeld_bus_up{bus=\"can0\"} 1",
            "taxeld_bus_up{bus=\"can1\"} 0",
            "taxeld_bus_received_total{bus=\"can1\"} 6",
            "taxeld_bus_frames_hertz{bus=\"can0\"} 0",
            "taxeld_bus_error_frames_total{bus=\"can0\"} 0",
            "taxeld_bus_error_frame_causes_total{bus=\"can0\",cause=\"bus_off\"} 0",
            "taxeld_bus_load_ratio{bus=\"can0\"} 0.25",
            "taxeld_board_sweeps_total{bus=\"can0\",module=\"index tip\"} 4",
            "taxeld_servos_timeouts_total 1",
            "taxeld_joint_angle_radians{joint=\"index 0\"} 0.5",
            "taxeld_joint_temperature_celsius{joint=\"index 0\"} 40",
        ] {
            assert!(text.lines().any(|line| line == wanted), "{wanted} in\n{text}");
        }
        assert!(text.ends_with("# EOF\n"));
    }

    #[test]
    fn the_samples_of_a_family_follow_each_other() {
        let text = of(Some(&status()), Format::OpenMetrics);
        let mut done = HashSet::new();
        let mut family = String::new();
        for line in text.lines() {
            if let Some(rest) = line.strip_prefix("# TYPE ") {
                family = rest.split(' ').next().unwrap().to_owned();
                assert!(done.insert(family.clone()), "{family} comes twice");
            }
            assert!(
                !line.starts_with("# HELP ") || !line.contains(['"', '\\']),
                "{line}"
            );
            assert!(
                line.starts_with('#') || line.starts_with(&family),
                "{line} in {family}"
            );
        }
    }

    #[test]
    fn a_daemon_that_is_gone_is_told() {
        let text = of(None, Format::OpenMetrics);
        assert!(
            text.contains("taxeld_up 0\n") && text.ends_with("# EOF\n"),
            "{text}"
        );
    }

    const DASHBOARD: &str = include_str!("../../../../docs/grafana/taxeld.json");
    const ALERTS: &str = include_str!("../../../../docs/prometheus/taxeld.rules.yml");

    #[test]
    fn the_dashboard_and_the_alerts_ask_for_metrics_that_there_are() {
        serde_json::from_str::<Value>(DASHBOARD).unwrap();
        let text = of(Some(&status()), Format::OpenMetrics);
        for (page, least) in [(DASHBOARD, 20), (ALERTS, 7)] {
            let names = page.split(|c: char| !c.is_ascii_alphanumeric() && c != '_');
            let asked: HashSet<&str> = names.filter(|name| name.starts_with("taxeld_")).collect();
            for name in &asked {
                let is_there = |line: &str| {
                    line.strip_prefix(name)
                        .is_some_and(|rest| rest.starts_with(['{', ' ']))
                };
                assert!(text.lines().any(is_there), "no metric {name}");
            }
            assert!(asked.len() >= least, "{asked:?}");
        }
    }

    #[test]
    fn of_several_hands_the_dashboard_shows_those_that_are_chosen_and_each_line_says_which() {
        let dashboard: Value = serde_json::from_str(DASHBOARD).unwrap();
        let panels = dashboard["panels"].as_array().unwrap();
        let targets = panels
            .iter()
            .flat_map(|panel| panel["targets"].as_array().unwrap());
        for target in targets {
            let [expr, legend] = ["expr", "legendFormat"].map(|key| target[key].as_str().unwrap());
            let (metrics, chosen) = (expr.matches("taxeld_"), expr.matches("{instance=~\"$instance\"}"));
            assert_eq!(metrics.count(), chosen.count(), "{expr}");
            assert!(legend.starts_with("{{instance}}"), "{legend}");
        }
        let summaries: Vec<&str> = ALERTS.lines().filter(|line| line.contains(" summary:")).collect();
        assert!(summaries.len() >= 6, "{summaries:?}");
        for summary in summaries {
            assert!(summary.contains("$labels.instance"), "{summary}");
        }
    }

    #[test]
    fn the_alerts_ask_for_kinds_of_problems_that_there_are() {
        let (_, kinds) = ALERTS.split_once("kind=~\"").unwrap();
        let (kinds, _) = kinds.split_once('"').unwrap();
        for kind in kinds.split('|') {
            let is_there = taxel_diagnose::Kind::ALL.iter().any(|known| known.name() == kind);
            assert!(is_there, "no kind {kind}");
        }
    }
}
