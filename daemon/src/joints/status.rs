//! The joints in the `status` reply.

use taxel_diagnose::{JointsView, SourceView};
use taxel_joints::bus::{FastState, ServoState};
use taxel_joints::{
    ALLEGRO_FINGERS, AllegroSource, AnalogueConfig, AnalogueSnapshot, DynamixelConfig, JointsConfig,
    JointsSnapshot, PortState, PortStatus, ServoSnapshot,
};
use taxel_wire::status::{
    AllegroStatus, AnalogueStatus, JointStatus, JointsStatus, ServoStatus, ServosStatus,
};

/// How many angles are known, for the line of `systemctl status`; empty where no joints are read.
pub(crate) fn summary(joints: &JointsSnapshot) -> String {
    match joints.angles.len() {
        0 => String::new(),
        all => {
            let known = joints.angles.iter().filter(|angle| angle.is_finite()).count();
            format!(", {known}/{all} joints")
        }
    }
}

/// The joints in the status; `None` while nothing is known of them. `cycle_hz` is the rate of
/// [`JointsView::cycles`].
///
/// `problems` tells the kinds of problems of a joint, or of the joints as a whole.
pub(crate) fn status(
    config: &JointsConfig,
    view: &JointsView,
    cycle_hz: f64,
    problems: &dyn Fn(Option<usize>) -> Vec<String>,
) -> Option<JointsStatus> {
    let mut status = match view.of(config)? {
        SourceView::Servos {
            config,
            snapshot,
            port,
        } => servos(config, view, snapshot, port),
        SourceView::Hand(source) => hand(source, &config.source.config().joint_names(), view),
    };
    let hold_ms = config.hold_ms;
    if let (Some(config), Some(snapshot)) = (&config.analogue, &view.analogue) {
        let hold_ns = (hold_ms * 1e6) as u64;
        potentiometers(config, snapshot, view, hold_ns, &mut status);
    }
    status.source = config.source.to_string();
    status.cycle_hz = cycle_hz;
    status.problems = problems(None);
    for (index, joint) in status.joints.iter_mut().enumerate() {
        joint.problems = problems(Some(index));
    }
    Some(status)
}

/// An angle of the newest frame and its age; null where unknown.
fn angle(view: &JointsView, joint: usize) -> (Option<f64>, Option<f64>) {
    let angle = view.tick.angles.get(joint).copied().filter(|a| a.is_finite());
    let age = view.tick.age_ns.get(joint).filter(|age| **age != u64::MAX);
    (angle.map(f64::from), age.map(|age| *age as f64 / 1e6))
}

fn potentiometers(
    config: &AnalogueConfig,
    snapshot: &AnalogueSnapshot,
    view: &JointsView,
    hold_ns: u64,
    status: &mut JointsStatus,
) {
    let (port, counters) = (&snapshot.port, snapshot.counters);
    for (n, joint) in config.joint.iter().enumerate() {
        let lost = snapshot.lost(n, view.now_ns, hold_ns);
        let (angle_rad, age_ms) = angle(view, status.joints.len());
        status.joints.push(JointStatus {
            name: joint.name.clone(),
            state: lost.map_or("speaks".to_string(), |lost| lost.to_string()),
            angle_rad,
            age_ms,
            ..JointStatus::default()
        });
    }
    status.analogue = Some(AnalogueStatus {
        analogue_source: config.device.display().to_string(),
        analogue_reason: match &port.state {
            PortState::Away { reason, .. } => Some(reason.clone()),
            PortState::Starting | PortState::Open => None,
        },
        analogue_opened: port.opened,
        analogue_lines: counters.lines,
        analogue_malformed: counters.malformed,
    });
}

fn servos(
    config: &DynamixelConfig,
    view: &JointsView,
    snapshot: &ServoSnapshot,
    port: &PortStatus,
) -> JointsStatus {
    let (state, reason) = match &port.state {
        _ if port.abandoned => ("gone", Some("the thread that read it has died; restart taxeld")),
        PortState::Open => ("connected", None),
        PortState::Starting => ("waiting", None),
        PortState::Away { reason, .. } if port.opened == 0 => ("waiting", Some(reason.as_str())),
        PortState::Away { reason, .. } => ("gone", Some(reason.as_str())),
    };
    let c = &snapshot.counters;
    let sum = |count: fn(&ServoState) -> u64| snapshot.servos.iter().map(count).sum::<u64>();
    let joints = (config.servo.iter().zip(&snapshot.servos))
        .zip(&snapshot.results)
        .enumerate()
        .map(|(i, ((servo, s), result))| {
            let (angle_rad, age_ms) = angle(view, i);
            let reading = result.as_ref().ok();
            JointStatus {
                name: servo.name.clone(),
                state: (result.as_ref().err()).map_or("answers".to_string(), ToString::to_string),
                angle_rad,
                age_ms,
                servo: Some(ServoStatus {
                    id: servo.id,
                    velocity_rad_s: reading.map(|r| r.velocity_rad_s),
                    current_a: reading.and_then(|r| r.current_a),
                    temperature_c: s.temperature_c,
                    voltage_v: s.voltage_v,
                    hardware_error: s.hardware_error.filter(|e| !e.is_none()).map(|e| e.to_string()),
                    torque_enabled: s.torque_enabled,
                    watchdog_tripped: s.watchdog_tripped,
                    model: s.identity.and_then(|i| i.model()).map(|m| m.name.to_string()),
                    firmware: s.identity.map(|i| i.firmware),
                    return_delay_us: s.identity.map(|i| i.return_delay_us),
                    readings: s.counters.ok,
                    timeouts: s.counters.timeouts,
                    bad_crc: s.counters.bad_crc,
                    alerts: s.counters.alerts,
                    late: s.counters.late,
                    double: s.counters.double,
                    refused: s.counters.refused,
                }),
                ..JointStatus::default()
            }
        })
        .collect();
    let writes = if config.allow_writes { "allowed" } else { "never" };
    JointsStatus {
        state: state.into(),
        writes: writes.into(),
        joints,
        servos: Some(ServosStatus {
            reason: reason.map(ToString::to_string),
            device: port.device.as_ref().map(|device| device.display().to_string()),
            opened: port.opened,
            baud: config.baud,
            wanted_hz: config.rate_hz,
            cycle_ms: c.cycle_ns as f64 / 1e6,
            fast_sync_read: fast_words(snapshot.fast).into(),
            low_latency: port.latency.map(|l| l.low_latency),
            ftdi_latency_ms: port.latency.and_then(|l| l.ftdi_timer_ms),
            watchdog_ms: config.allow_writes.then_some(config.watchdog_ms.into()),
            writes_ok: c.writes_ok,
            writes_failed: c.writes_failed,
            cycles: c.cycles,
            requests: c.requests,
            readings: sum(|s| s.counters.ok),
            timeouts: sum(|s| s.counters.timeouts),
            bad_crc: sum(|s| s.counters.bad_crc),
            alerts: sum(|s| s.counters.alerts),
            late: sum(|s| s.counters.late) + c.late_fast,
            double: sum(|s| s.counters.double),
            noise_bytes: c.noise_bytes,
            foreign: c.foreign,
        }),
        ..JointsStatus::default()
    }
}

fn fast_words(fast: FastState) -> &'static str {
    match fast {
        FastState::Off => "off",
        FastState::Probing => "being tried",
        FastState::On => "yes",
        FastState::NotSupported => "no: tried, and not answered as it should be",
    }
}

fn hand(source: &AllegroSource, names: &[String], view: &JointsView) -> JointsStatus {
    let counts = &view.tick.counts;
    let heard = (0..ALLEGRO_FINGERS.len())
        .filter(|finger| view.finger_speaks(*finger) == Some(true))
        .count();
    let state = match (view.link, heard) {
        (taxel_can::LinkState::Up, 0) if counts.iter().all(|count| count.heard_ns.is_none()) => "waiting",
        (taxel_can::LinkState::Up, 0) => "gone",
        (taxel_can::LinkState::Up, _) => "connected",
        _ => "gone",
    };
    let own_bus = source.hand.as_ref().is_some_and(|hand| hand.own_bus);
    let joints = (names.iter().enumerate())
        .map(|(i, name)| {
            let (angle_rad, age_ms) = angle(view, i);
            let state = match view.finger_speaks(i / 4) {
                None => "never heard",
                Some(true) => "speaks",
                Some(false) => "silent",
            };
            JointStatus {
                name: name.clone(),
                state: state.into(),
                angle_rad,
                age_ms,
                ..JointStatus::default()
            }
        })
        .collect();
    let writes = if own_bus {
        "start and stop of the hand"
    } else {
        "never"
    };
    JointsStatus {
        state: state.into(),
        writes: writes.into(),
        joints,
        allegro: Some(AllegroStatus {
            positions: counts.iter().step_by(4).map(|count| count.readings).collect(),
            version: source.hand.as_ref().map(|hand| hand.version),
            link: view.link.to_string(),
            malformed: view.tick.malformed,
            motor_errors: view.tick.motor_errors.reports,
            received: view.source.received,
            lost_in_kernel: view.source.lost_in_kernel,
            undecodable: view.source.undecodable,
            reopens: view.source.reopens,
            sent: view.source.sent,
        }),
        ..JointsStatus::default()
    }
}
