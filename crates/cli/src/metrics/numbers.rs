//! The numbers in a part of the status, as metrics.

use super::families::{Families, Labels};
use taxel_wire::status::Report;

/// The values of now, of whichever part they are: key, what it is times to be in the unit of its metric, the metric's
/// name behind that of the part, and its help.
const NOW: [(&str, f64, &str, &str); 13] = [
    ("frames_hz", 1.0, "frames_hertz", "Frames per second on a bus."),
    (
        "load_percent",
        0.01,
        "load_ratio",
        "Load of a bus of 1 Mbit/s without stuff bits, 1 where it is full.",
    ),
    (
        "load_percent_most",
        0.01,
        "load_most_ratio",
        "Load of a bus with as many stuff bits as there can be, 1 where it is full.",
    ),
    (
        "period_ms",
        1e-3,
        "period_seconds",
        "Time between two sweeps of a board.",
    ),
    (
        "wanted_hz",
        1.0,
        "wanted_hertz",
        "Readings of each servo per second that the configuration asks for.",
    ),
    (
        "cycle_ms",
        1e-3,
        "cycle_seconds",
        "What the newest reading of all servos took.",
    ),
    (
        "angle_rad",
        1.0,
        "angle_radians",
        "Angle of a joint in the newest image.",
    ),
    (
        "age_ms",
        1e-3,
        "angle_age_seconds",
        "Age of the angle of a joint.",
    ),
    (
        "velocity_rad_s",
        1.0,
        "velocity_radians_per_second",
        "Velocity of a servo.",
    ),
    ("current_a", 1.0, "current_amperes", "Current of a servo."),
    (
        "temperature_c",
        1.0,
        "temperature_celsius",
        "Temperature of a servo.",
    ),
    ("voltage_v", 1.0, "supply_volts", "Supply of a servo."),
    (
        "return_delay_us",
        1e-6,
        "return_delay_seconds",
        "How long a servo waits before it answers.",
    ),
];

/// The numbers of a part of the status: its counts, each a metric of its key with what the status says of it, and its
/// values of now. Those that are null are left out.
pub(super) fn numbers<T: Report>(to: &mut Families, prefix: &str, labels: &Labels<'_>, part: &T) {
    let part = serde_json::to_value(part).unwrap_or_default();
    for key in T::KEYS {
        let value = &part[key.name];
        if let (true, Some(count)) = (key.is_count, value.as_u64()) {
            to.counter(&format!("{prefix}_{}", key.name), key.about, labels, count);
        }
        let now = NOW.iter().find(|(name, ..)| *name == key.name);
        if let (Some((_, scale, name, help)), Some(value)) = (now, value.as_f64()) {
            to.gauge(&format!("{prefix}_{name}"), help, labels, value * scale);
        }
    }
}
