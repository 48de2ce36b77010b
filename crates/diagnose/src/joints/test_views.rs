//! Views of joints for tests.

use crate::joints_view::JointsView;
use taxel_can::{LinkState, SourceCounters};
use taxel_joints::bus::{BusCounters, FastState, NoReading, ServoState};
use taxel_joints::{
    AllegroConfig, AllegroSource, JointSource, JointsConfig, JointsSnapshot, PortLatency, PortState,
    PortStatus, ServoSnapshot,
};

pub(crate) const S: u64 = 1_000_000_000;

/// So many servos behind a port that is not open yet.
pub(crate) fn servos(n: u8) -> (JointsConfig, JointsView) {
    let config = JointsConfig::dynamixel("/dev/servos", 1..=n);
    let n = usize::from(n);
    let snapshot = ServoSnapshot {
        results: vec![Err(NoReading::NotAsked); n],
        servos: vec![ServoState::default(); n],
        counters: BusCounters::default(),
        fast: FastState::Off,
    };
    let port = PortStatus {
        path: "/dev/servos".into(),
        device: None,
        state: PortState::Starting,
        latency: None,
        opened: 0,
        taken_ns: None,
        abandoned: false,
    };
    let view = JointsView {
        now_ns: S,
        tick: JointsSnapshot::new(n),
        source: SourceCounters::default(),
        link: LinkState::default(),
        servos: Some((snapshot, port)),
        analogue: None,
    };
    (config, view)
}

/// An Allegro hand on a bus that is not there.
pub(crate) fn allegro() -> (JointsConfig, JointsView) {
    let (_, mut view) = servos(1);
    let config = JointsConfig::new(JointSource::Allegro(AllegroSource {
        bus: "can:can2".parse().expect("a bus"),
        hand: Some(AllegroConfig::new(4)),
    }));
    view.servos = None;
    view.tick = JointsSnapshot::new(16);
    (config, view)
}

pub(crate) fn open(view: &mut JointsView, device: &str, latency_ms: u32) {
    let (_, port) = view.servos.as_mut().expect("servos");
    port.state = PortState::Open;
    port.device = Some(device.into());
    port.latency = Some(PortLatency {
        low_latency: true,
        ftdi_timer_ms: Some(latency_ms),
    });
    port.opened += 1;
}

pub(crate) fn away(view: &mut JointsView) {
    let (snapshot, port) = view.servos.as_mut().expect("servos");
    port.state = PortState::Away {
        reason: "No such file".into(),
        since_ns: 0,
    };
    for servo in &mut snapshot.servos {
        servo.alive = false;
    }
}

pub(crate) fn servo(view: &mut JointsView, joint: usize) -> &mut ServoState {
    &mut view.servos.as_mut().expect("servos").0.servos[joint]
}

/// A finger of an Allegro hand sends its angles now.
pub(crate) fn finger(view: &mut JointsView, finger: usize) {
    for count in &mut view.tick.counts[4 * finger..4 * finger + 4] {
        count.readings += 1;
        count.heard_ns = Some(view.now_ns);
    }
}
