//! What is wrong with the joints: the serial port, each servo, an Allegro hand.

use super::{Kind, Look, Place, Problem};
use crate::joints::{JointsView, SourceView};
use taxel_can::{BusState, LinkState};
use taxel_joints::bus::{ServoCounters, ServoState};
use taxel_joints::registers::HardwareError;
use taxel_joints::{
    ALLEGRO_FINGERS, AllegroSource, DynamixelConfig, JointsConfig, PortLatency, PortState, PortStatus,
    ServoSnapshot,
};

/// A servo that does not answer for so long is silent; one that was not heard since the port was opened is given longer.
const SILENT_NS: u64 = 200_000_000;
const UNHEARD_NS: u64 = 1_000_000_000;
/// A joint whose source is well and whose angle is unknown for so long.
const STALE_NS: u64 = 500_000_000;
/// Late and damaged answers in the time looked at, from which they are a problem, if they are a fifth of all; one keeps it up.
/// A machine that is held up for a moment makes some answers late.
const LATE: u64 = 2;
const DAMAGED: u64 = 3;
const SHARE: u64 = 5;
/// Degrees Celsius from which a servo is too hot, and down to which it stays so. It switches itself off at 80.
const HOT_C: u8 = 70;
const HOT_ON_C: u8 = 65;

/// How often each thing happened to servos, at one look.
#[derive(Debug, Default, Clone)]
pub(super) struct Counts {
    servos: Vec<ServoCounters>,
    late_fast: u64,
}

impl Counts {
    pub(super) fn of(view: Option<&JointsView>) -> Self {
        view.and_then(|view| view.servos.as_ref())
            .map_or_else(Self::default, |(snapshot, _)| Self {
                servos: snapshot.servos.iter().map(|s| s.counters).collect(),
                late_fast: snapshot.counters.late_fast,
            })
    }
}

/// Since when each servo or finger is quiet, and each angle unknown.
#[derive(Debug, Default)]
pub(super) struct Patience {
    /// Which opening of the port, and since when the port or the hand's bus is there.
    opened: u64,
    there_ns: Option<u64>,
    heard: Vec<bool>,
    quiet_ns: Vec<Option<u64>>,
    unknown_ns: Vec<Option<u64>>,
}

impl Patience {
    fn begin(&mut self, opened: u64, sources: usize, now_ns: u64) {
        if self.there_ns.is_none() || self.opened != opened {
            self.opened = opened;
            self.there_ns = Some(now_ns);
            self.heard = vec![false; sources];
            self.quiet_ns = vec![None; sources];
        }
    }

    /// Whether a source is silent.
    fn is_silent(&mut self, source: usize, speaks: bool, now_ns: u64) -> bool {
        if speaks {
            self.heard[source] = true;
            self.quiet_ns[source] = None;
            return false;
        }
        let since_ns = *self.quiet_ns[source].get_or_insert(now_ns);
        let there_ns = self.there_ns.unwrap_or(now_ns);
        now_ns.saturating_sub(since_ns) >= SILENT_NS
            && (self.heard[source] || now_ns.saturating_sub(there_ns) >= UNHEARD_NS)
    }

    /// Something else explains that a joint's angle is unknown.
    fn explained(&mut self, joint: usize) {
        self.unknown_ns[joint] = None;
    }

    /// Joints whose angle has been unknown for too long.
    fn unknown(&mut self, view: &JointsView) -> Vec<bool> {
        self.unknown_ns.resize(view.tick.angles.len(), None);
        (self.unknown_ns.iter_mut().zip(&view.tick.angles))
            .map(|(since, angle)| {
                if angle.is_finite() {
                    *since = None;
                }
                let since_ns = *since.get_or_insert(view.now_ns);
                !angle.is_finite() && view.now_ns.saturating_sub(since_ns) >= STALE_NS
            })
            .collect()
    }
}

/// How quiet a servo is.
struct Quiet {
    silent: bool,
    /// That all are silent is told instead.
    told: bool,
    heard: bool,
    /// Its angle is unknown.
    unknown: bool,
}

/// What joints are judged by.
pub(super) struct Judge<'a> {
    pub(super) config: &'a JointsConfig,
    pub(super) view: &'a JointsView,
    pub(super) before: &'a Counts,
    pub(super) look: &'a Look<'a>,
    /// Whether there was such a problem at the last look.
    pub(super) has: &'a dyn Fn(Kind, Place) -> bool,
}

impl Judge<'_> {
    pub(super) fn judge(&self, patience: &mut Patience, found: &mut Vec<Problem>) {
        let unknown = patience.unknown(self.view);
        match self.view.of(self.config) {
            Some(SourceView::Servos {
                config,
                snapshot,
                port,
            }) => self.servos(config, snapshot, port, &unknown, patience, found),
            Some(SourceView::Hand(hand)) => self.hand(hand, patience, found),
            None => {}
        }
    }

    fn servos(
        &self,
        config: &DynamixelConfig,
        snapshot: &ServoSnapshot,
        port: &PortStatus,
        unknown: &[bool],
        patience: &mut Patience,
        found: &mut Vec<Problem>,
    ) {
        let now_ns = self.view.now_ns;
        match &port.state {
            PortState::Starting => return,
            PortState::Away { reason, .. } => {
                patience.there_ns = None;
                found.push(absent_port(port, reason));
                return;
            }
            PortState::Open => patience.begin(port.opened, snapshot.servos.len(), now_ns),
        }
        found.extend(port.latency.and_then(|latency| slow_adapter(latency, port)));
        let late_fast = snapshot.counters.late_fast.saturating_sub(self.before.late_fast);
        let silent: Vec<bool> = (snapshot.servos.iter().enumerate())
            .map(|(joint, servo)| patience.is_silent(joint, servo.alive, now_ns))
            .collect();
        let mut own: Vec<Problem> = Vec::new();
        let all = silent.len() > 1 && silent.iter().all(|silent| *silent);
        if all {
            found.push(self.silent_servos(config.baud));
        }
        for (joint, servo) in snapshot.servos.iter().enumerate() {
            let name =
                (config.servo.get(joint)).map_or_else(String::new, |s| format!("{} (id {})", s.name, s.id));
            let quiet = Quiet {
                silent: silent[joint],
                told: all,
                heard: patience.heard[joint],
                unknown: unknown[joint] && patience.heard[joint] && late_fast == 0,
            };
            self.one_servo(joint, &name, servo, &quiet, port, &mut own);
        }
        for problem in own.iter().filter(|p| p.kind != "joint-stale") {
            if let Place::Joint(joint) = problem.place {
                patience.explained(joint);
            }
        }
        let most = |kind: Kind, own: &[Problem]| {
            let of_kind = own.iter().filter(|p| p.kind == kind).count();
            snapshot.servos.len() > 2 && 2 * of_kind > snapshot.servos.len()
        };
        if most("servo-damaged", &own) {
            own.retain(|p| p.kind != "servo-damaged");
            found.push(of_joints(
                "servo-damaged",
                Place::Joints,
                "the answers of most servos come damaged (CRC): look at the cable to the first servo, termination (RS-485), a cable beside motor wires, and at the baud rate".into(),
                "the servos' answers are whole".into(),
            ));
        }
        let all_late = most("servo-late", &own);
        if all_late {
            own.retain(|p| p.kind != "servo-late");
        }
        found.append(&mut own);
        if all_late || late_fast >= self.least("servo-late", Place::Joints, LATE) {
            found.push(of_joints(
                "servo-late",
                Place::Joints,
                format!(
                    "answers of most servos come after their deadline, into the next request. {}",
                    late_advice(port, &ServoState::default())
                ),
                "the servos answer in time".into(),
            ));
        }
    }

    fn one_servo(
        &self,
        joint: usize,
        name: &str,
        servo: &ServoState,
        quiet: &Quiet,
        port: &PortStatus,
        found: &mut Vec<Problem>,
    ) {
        let place = Place::Joint(joint);
        let before = self.before.servos.get(joint).copied().unwrap_or(servo.counters);
        let since = |count: fn(&ServoCounters) -> u64| count(&servo.counters).saturating_sub(count(&before));
        let (late, damaged) = (since(|c| c.late), since(|c| c.bad_crc));
        let all = late + damaged + since(|c| c.ok) + since(|c| c.timeouts);
        let seconds = self.look.seconds;
        let count = found.len();
        if late >= self.least("servo-late", place, LATE.max(all.div_ceil(SHARE))) {
            found.push(of_joints(
                "servo-late",
                place,
                format!(
                    "servo {name} answers after its deadline ({late} times in {seconds:.1} s), into the next request; such answers are not taken for its angle. {}",
                    late_advice(port, servo)
                ),
                format!("servo {name} answers in time"),
            ));
        }
        if damaged >= self.least("servo-damaged", place, DAMAGED.max(all.div_ceil(SHARE))) {
            found.push(of_joints(
                "servo-damaged",
                place,
                format!(
                    "{damaged} answers of servo {name} in {seconds:.1} s came damaged (CRC): look for a loose plug, a cable beside motor wires, a long bus without termination (RS-485), or two servos with one id"
                ),
                format!("the answers of servo {name} are whole"),
            ));
        }
        if quiet.silent && !quiet.told && late == 0 {
            let more = if quiet.heard {
                ""
            } else {
                ", its id and its baud rate"
            };
            found.push(of_joints(
                "servo-silent",
                place,
                format!(
                    "servo {name} is silent; check its power and cable{more}. The others go on; it is asked again twice a second"
                ),
                format!("servo {name} answers again"),
            ));
        }
        if quiet.unknown && !quiet.silent && found.len() == count {
            found.push(self.stale(joint));
        }
        found.extend(of_state(name, place, servo, (self.has)("servo-hot", place)));
    }

    /// How many there must be of something for a problem: one is enough to keep it up.
    fn least(&self, kind: Kind, place: Place, come: u64) -> u64 {
        if (self.has)(kind, place) || (self.has)(kind, Place::Joints) {
            1
        } else {
            come
        }
    }

    fn silent_servos(&self, baud: u32) -> Problem {
        Problem {
            severe: true,
            ..of_joints(
                "servos-silent",
                Place::Joints,
                format!(
                    "no servo answers; check their supply and the cable, and that they are set to baud = {baud} (`taxel doctor --joints {}` looks for others). They are asked again twice a second",
                    self.config.source
                ),
                "servos answer".into(),
            )
        }
    }

    fn stale(&self, joint: usize) -> Problem {
        let (name, hold_ms) = (&self.config.joint_names()[joint], self.config.hold_ms);
        let age_ns = self.view.tick.age_ns.get(joint).copied().unwrap_or(u64::MAX);
        let age = match age_ns {
            u64::MAX => "it has no reading yet".to_string(),
            ns => format!(
                "its newest reading is {} ms old, hold_ms = {hold_ms}",
                ns / 1_000_000
            ),
        };
        of_joints(
            "joint-stale",
            Place::Joint(joint),
            format!(
                "the angle of {name} is unknown: {age}. If the bus cannot be read more often (`cycle_hz` in the status), raise its baud rate, or `hold_ms`"
            ),
            format!("the angle of {name} is known"),
        )
    }

    fn hand(&self, hand: &AllegroSource, patience: &mut Patience, found: &mut Vec<Problem>) {
        let (view, bus) = (self.view, &hand.bus.to_string());
        let shared = self.look.config.joints_bus().is_some_and(|bus| bus.shared);
        let link = view.link;
        let off = view.source.bus_state == BusState::BusOff;
        if link != LinkState::Up || off {
            patience.there_ns = None;
            // That of a skin's bus is told of the bus.
            if !shared {
                found.push(lost_hand_bus(bus, link));
            }
            return;
        }
        patience.begin(0, ALLEGRO_FINGERS.len(), view.now_ns);
        let silent: Vec<bool> = (0..ALLEGRO_FINGERS.len())
            .map(|f| patience.is_silent(f, view.finger_speaks(f) == Some(true), view.now_ns))
            .collect();
        let own = hand.hand.as_ref().is_some_and(|hand| hand.own_bus);
        let what = if own {
            "check its power, cable and version. It is started again every second"
        } else {
            "check its power and cable, `version`, and that the program that controls it runs: taxeld only listens"
        };
        if silent.iter().all(|silent| *silent) {
            found.push(Problem {
                severe: true,
                ..of_joints(
                    "hand-silent",
                    Place::Joints,
                    format!("the Allegro hand on {bus} sends no angles; {what}"),
                    format!("the Allegro hand on {bus} sends its angles"),
                )
            });
            return;
        }
        for (finger, name) in ALLEGRO_FINGERS
            .iter()
            .enumerate()
            .filter(|(finger, _)| silent[*finger])
        {
            found.push(of_joints(
                "finger-silent",
                Place::Joint(4 * finger),
                format!(
                    "the hand's {name} finger sends no angles, and others do: look at its connector inside the hand"
                ),
                format!("the hand's {name} finger sends its angles again"),
            ));
        }
    }
}

fn of_joints(kind: Kind, place: Place, sentence: String, over: String) -> Problem {
    Problem {
        kind,
        place,
        severe: false,
        sentence: format!("joints: {sentence}"),
        over: format!("joints: {over}"),
    }
}

fn absent_port(port: &PortStatus, reason: &str) -> Problem {
    let path = port.path.display();
    // The newest reason is that it cannot be opened anew, which says nothing of how it went.
    let gone = match port.opened {
        0 => String::new(),
        _ => format!(
            "{path} is gone, unplugged or reset by its driver, and is used again as soon as it is back: "
        ),
    };
    Problem {
        severe: true,
        ..of_joints(
            "serial-absent",
            Place::Joints,
            format!("{gone}{reason}. Until then images go on with unknown joint angles"),
            format!("{path} is there"),
        )
    }
}

/// An adapter that keeps bytes back for so long that cycles are slow.
fn slow_adapter(latency: PortLatency, port: &PortStatus) -> Option<Problem> {
    let ms = latency.ftdi_timer_ms.filter(|ms| *ms > 1)?;
    let name = port.device.as_ref()?.file_name()?.to_string_lossy().into_owned();
    Some(of_joints(
        "adapter-latency",
        Place::Joints,
        format!(
            "the FTDI adapter keeps answers back for up to {ms} ms; `echo 1 > /sys/bus/usb-serial/devices/{name}/latency_timer` as root, or for good systemd/60-taxeld-serial.rules, makes it 1 ms"
        ),
        "the FTDI adapter hands answers over within 1 ms".into(),
    ))
}

fn late_advice(port: &PortStatus, servo: &ServoState) -> String {
    let timer_ms = port.latency.and_then(|l| l.ftdi_timer_ms);
    let delay_us = servo.identity.map_or(0, |i| i.return_delay_us);
    match (timer_ms, delay_us) {
        (Some(ms), _) if ms > 1 => format!("The adapter's latency timer is {ms} ms and should be 1"),
        (_, 50..) => format!("Its Return Delay Time is {delay_us} us: set it to 0"),
        _ => "Look for a USB hub or a busy machine in between; `answer_margin_ms` in [joints] gives answers more time"
            .into(),
    }
}

/// What a servo says of itself.
fn of_state(name: &str, place: Place, state: &ServoState, was_hot: bool) -> Vec<Problem> {
    let mut found = Vec::new();
    let error = state.hardware_error.unwrap_or(HardwareError(0));
    if !error.is_none() {
        let advice: Vec<&str> = error.names().map(cure).collect();
        found.push(of_joints(
            "servo-error",
            place,
            format!(
                "servo {name} reports a hardware error: {error}. Its motor stays off until it is rebooted; its angle goes on. {}; then reboot it, or switch it off and on",
                advice.join(", ")
            ),
            format!("servo {name} has no hardware error any more"),
        ));
    }
    let least_c = if was_hot { HOT_ON_C } else { HOT_C };
    if let Some(celsius) = state.temperature_c.filter(|c| *c >= least_c) {
        found.push(of_joints(
            "servo-hot",
            place,
            format!(
                "servo {name} has {celsius} degrees Celsius, and switches itself off at 80 (Temperature Limit, address 31): give it a rest or less load"
            ),
            format!("servo {name} has cooled down"),
        ));
    }
    found
}

/// What to do about a hardware error, by its name in the data sheet.
fn cure(error: &str) -> &'static str {
    match error {
        "input voltage" => "Check its supply",
        "overheating" => "Let it cool down",
        "overload" => "Free the joint",
        "motor encoder" => "Its encoder is defective",
        "electrical shock" => "Check supply and motor wires for a short circuit",
        _ => "See its data sheet",
    }
}

fn lost_hand_bus(bus: &str, link: LinkState) -> Problem {
    let (kind, what) = match link {
        LinkState::Absent => (
            "link-absent",
            "is not there; plug its adapter in, or see `ip link`",
        ),
        LinkState::Down => ("link-down", "is down; `ip link set INTERFACE up`"),
        LinkState::Up => (
            "bus-off",
            "is off after too many errors; check wiring and termination, and set `restart-ms 100`",
        ),
    };
    Problem {
        severe: true,
        ..of_joints(
            kind,
            Place::Joints,
            format!("the hand's bus {bus} {what}. Images go on, with unknown joint angles"),
            format!("the hand's bus {bus} is up"),
        )
    }
}
