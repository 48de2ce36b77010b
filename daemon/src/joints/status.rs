//! The joints in the `status` reply.

use super::JointsSnapshot;
use serde_json::{Value, json};
use taxel_joints::bus::{FastState, ServoState};
use taxel_joints::{JointSnapshot, JointSource, JointsConfig, PortState, PortStatus};

/// A finger that is silent for so long counts as gone, nanoseconds.
pub(crate) const FINGER_SILENT_NS: u64 = 500_000_000;

/// What is known of the joints at one instant.
#[derive(Debug, Clone)]
pub(crate) struct JointsView {
    /// The pipeline's clock, nanoseconds.
    pub(crate) now_ns: u64,
    /// From the tick thread.
    pub(crate) tick: JointsSnapshot,
    /// From the thread that reads servos, where there are any.
    pub(crate) servos: Option<(JointSnapshot, PortStatus)>,
}

impl JointsView {
    /// Cycles of the servos, or position frames of the hand's finger that has sent most.
    pub(crate) fn cycles(&self) -> u64 {
        match &self.servos {
            Some((snapshot, _)) => snapshot.counters.cycles,
            None => self.tick.hand.positions.into_iter().max().unwrap_or(0),
        }
    }

    /// Whether a finger of an Allegro hand (0 to 3) was heard lately; `None` if it never was.
    pub(crate) fn finger_speaks(&self, finger: usize) -> Option<bool> {
        let heard_ns = self.tick.finger_ns[finger]?;
        Some(self.now_ns.saturating_sub(heard_ns) < FINGER_SILENT_NS)
    }
}

/// The `joints` object; `cycle_hz` is the rate of [`JointsView::cycles`].
///
/// `problems` tells the kinds of problems of a joint, or of the joints as a whole.
pub(crate) fn status(
    config: &JointsConfig,
    view: &JointsView,
    cycle_hz: f64,
    problems: &dyn Fn(Option<usize>) -> Vec<&'static str>,
) -> Value {
    let mut status = of_source(config, view, cycle_hz);
    if let Some(object) = status.as_object_mut() {
        object.insert("problems".into(), json!(problems(None)));
    }
    if let Some(joints) = status.get_mut("joints").and_then(Value::as_array_mut) {
        for (index, joint) in joints.iter_mut().filter_map(Value::as_object_mut).enumerate() {
            joint.insert("problems".into(), json!(problems(Some(index))));
        }
    }
    status
}

fn of_source(config: &JointsConfig, view: &JointsView, cycle_hz: f64) -> Value {
    match (&config.source, &view.servos) {
        (JointSource::Dynamixel { .. }, Some((snapshot, port))) => {
            servos(config, view, snapshot, port, cycle_hz)
        }
        (JointSource::Allegro { .. }, _) => hand(config, view, cycle_hz),
        (JointSource::Dynamixel { .. }, None) => Value::Null,
    }
}

/// An angle of the newest frame and its age; null where unknown.
fn angle(view: &JointsView, joint: usize) -> (Option<f32>, Option<f64>) {
    let angle = view.tick.angles.get(joint).copied().filter(|a| a.is_finite());
    let age = view.tick.age_ns.get(joint).filter(|age| **age != u64::MAX);
    (angle, age.map(|age| *age as f64 / 1e6))
}

fn servos(
    config: &JointsConfig,
    view: &JointsView,
    snapshot: &JointSnapshot,
    port: &PortStatus,
    cycle_hz: f64,
) -> Value {
    let (state, reason) = match &port.state {
        PortState::Open => ("connected", None),
        PortState::Starting => ("waiting", None),
        PortState::Away { reason, .. } if port.opened == 0 => ("waiting", Some(reason)),
        PortState::Away { reason, .. } => ("gone", Some(reason)),
    };
    let c = &snapshot.counters;
    let sum = |count: fn(&ServoState) -> u64| snapshot.servos.iter().map(count).sum::<u64>();
    let joints = (config.servo.iter().zip(&snapshot.servos))
        .zip(&snapshot.results)
        .enumerate()
        .map(|(i, ((servo, s), result))| {
            let (angle_rad, age_ms) = angle(view, i);
            let reading = result.as_ref().ok();
            json!({
                "name": servo.name,
                "id": servo.id,
                "state": result.as_ref().err().map_or("answers".to_string(), ToString::to_string),
                "angle_rad": angle_rad,
                "age_ms": age_ms,
                "velocity_rad_s": reading.map(|r| r.velocity_rad_s),
                "current_a": reading.and_then(|r| r.current_a),
                "temperature_c": s.temperature_c,
                "voltage_v": s.voltage_v,
                "hardware_error": s.hardware_error.filter(|e| !e.is_none()).map(|e| e.to_string()),
                "torque_enabled": s.torque_enabled,
                "model": s.identity.and_then(|i| i.model()).map(|m| m.name),
                "firmware": s.identity.map(|i| i.firmware),
                "return_delay_us": s.identity.map(|i| i.return_delay_us),
                "readings": s.counters.ok,
                "timeouts": s.counters.timeouts,
                "bad_crc": s.counters.bad_crc,
                "alerts": s.counters.alerts,
                "late": s.counters.late,
                "refused": s.counters.refused,
            })
        })
        .collect::<Vec<_>>();
    json!({
        "source": config.source.to_string(),
        "state": state,
        "reason": reason,
        "device": port.device.as_ref().map(|device| device.display().to_string()),
        "opened": port.opened,
        "baud": config.baud,
        "cycle_hz": cycle_hz,
        "wanted_hz": config.rate_hz,
        "cycle_ms": c.cycle_ns as f64 / 1e6,
        "fast_sync_read": fast_words(snapshot.fast),
        "low_latency": port.latency.map(|l| l.low_latency),
        "ftdi_latency_ms": port.latency.and_then(|l| l.ftdi_timer_ms),
        "writes": if config.allow_writes { "allowed" } else { "never" },
        "watchdog_ms": config.allow_writes.then_some(config.watchdog_ms),
        "writes_ok": c.writes_ok,
        "writes_failed": c.writes_failed,
        "cycles": c.cycles,
        "requests": c.requests,
        "readings": sum(|s| s.counters.ok),
        "timeouts": sum(|s| s.counters.timeouts),
        "bad_crc": sum(|s| s.counters.bad_crc),
        "alerts": sum(|s| s.counters.alerts),
        "late": sum(|s| s.counters.late) + c.late_fast,
        "noise_bytes": c.noise_bytes,
        "foreign": c.foreign,
        "joints": joints,
    })
}

fn fast_words(fast: FastState) -> &'static str {
    match fast {
        FastState::Off => "off",
        FastState::Probing => "being tried",
        FastState::On => "yes",
        FastState::NotSupported => "no: tried, and not answered as it should be",
    }
}

fn hand(config: &JointsConfig, view: &JointsView, cycle_hz: f64) -> Value {
    let tick = &view.tick;
    let heard = (0..4)
        .filter(|finger| view.finger_speaks(*finger) == Some(true))
        .count();
    let state = match (tick.link, heard) {
        (taxel_can::LinkState::Up, 0) if tick.finger_ns.iter().all(Option::is_none) => "waiting",
        (taxel_can::LinkState::Up, 0) => "gone",
        (taxel_can::LinkState::Up, _) => "connected",
        _ => "gone",
    };
    let own_bus = config.allegro.as_ref().is_some_and(|hand| hand.own_bus);
    let joints = (config.joint_names().iter().enumerate())
        .map(|(i, name)| {
            let (angle_rad, age_ms) = angle(view, i);
            let state = match view.finger_speaks(i / 4) {
                None => "never heard",
                Some(true) => "speaks",
                Some(false) => "silent",
            };
            json!({ "name": name, "state": state, "angle_rad": angle_rad, "age_ms": age_ms })
        })
        .collect::<Vec<_>>();
    json!({
        "source": config.source.to_string(),
        "state": state,
        "version": config.allegro.as_ref().map(|hand| hand.version),
        "link": tick.link.to_string(),
        "cycle_hz": cycle_hz,
        "writes": if own_bus { "start and stop of the hand" } else { "never" },
        "positions": tick.hand.positions,
        "malformed": tick.hand.malformed,
        "received": tick.source.received,
        "lost_in_kernel": tick.source.lost_in_kernel,
        "undecodable": tick.source.undecodable,
        "reopens": tick.source.reopens,
        "sent": tick.source.sent,
        "joints": joints,
    })
}
