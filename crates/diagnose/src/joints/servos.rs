//! What is wrong with servos: the serial port, each servo's answers.

use super::servo_state::{motor_lost, motor_not_off, servo_state};
use super::{Judge, Patience, of_joints, port as of_port};
use crate::kind::Kind;
use crate::problem::{Place, Problem};
use std::ops::ControlFlow;
use taxel_hand::shell_word;
use taxel_joints::bus::{ServoCounters, ServoState};
use taxel_joints::protocol2::StatusError;
use taxel_joints::{DynamixelConfig, JointSource, PortState, PortStatus, ServoConfig, ServoSnapshot};

/// Late, damaged and refusing answers in the time looked at, from which they are a problem, if they are a fifth of all; one
/// keeps it up. A machine that is held up for a moment makes some answers late.
const LATE: u64 = 2;
const DAMAGED: u64 = 3;
/// Requests in that time that had two answers, from which two servos have one id: nothing else makes them.
const DOUBLE: u64 = 2;
const REFUSED: u64 = 3;
const SHARE: u64 = 5;
/// What is wrong with answers that come.
const OF_ANSWERS_THAT_COME: [Kind; 4] = [
    Kind::ServoLate,
    Kind::ServoDamaged,
    Kind::TwoServos,
    Kind::ServoRefuses,
];

/// The servos that angles come from, as they are configured and as they were seen.
#[derive(Clone, Copy)]
pub(super) struct Servos<'a> {
    pub(super) config: &'a DynamixelConfig,
    pub(super) snapshot: &'a ServoSnapshot,
    pub(super) port: &'a PortStatus,
    /// Whose angle is unknown.
    pub(super) unknown: &'a [bool],
}

/// How quiet a servo is.
struct Quiet {
    silent: bool,
    /// That all are silent is told instead, or was until now.
    told: bool,
    heard: bool,
    /// Its angle is unknown.
    unknown: bool,
}

/// What became of a servo's requests in the time looked at.
struct Answers {
    late: u64,
    damaged: u64,
    refused: u64,
    /// Two servos answer.
    two: bool,
    all: u64,
    /// None came, not one that nobody can read: what was wrong with them is not over.
    none: bool,
}

impl Answers {
    /// How many are a problem, of which `least` are too few to be told.
    fn many(&self, least: u64) -> u64 {
        least.max(self.all.div_ceil(SHARE))
    }
}

impl Judge<'_> {
    pub(super) fn servos(&self, servos: Servos<'_>, patience: &mut Patience, found: &mut Vec<Problem>) {
        let Servos {
            config,
            snapshot,
            port,
            ..
        } = servos;
        // That nobody can ask them any more puts none of it right.
        for (joint, servo) in snapshot.servos.iter().enumerate() {
            self.known_of(joint, &name_of(config, joint), servo, found);
        }
        if let ControlFlow::Break(problem) = self.port_alone(servos, patience) {
            found.extend(problem);
            return;
        }
        found.extend(adapter_of(port));
        let shared = of_port::shared(port, self.view.now_ns);
        let first = found.len();
        self.of_answers(servos, patience, found);
        if let Some(shared) = shared {
            // It explains whatever is missing or in pieces.
            patience.all_explained();
            let of_servos = found.split_off(first);
            found.extend(of_servos.into_iter().filter(|p| !is_of_answers(p.kind)));
            found.push(shared);
        }
    }

    /// Breaks where the port is in a state in which nothing is to be said of the servos' answers, with what is wrong with it.
    fn port_alone(&self, servos: Servos<'_>, patience: &mut Patience) -> ControlFlow<Option<Problem>> {
        let (snapshot, port) = (servos.snapshot, servos.port);
        let now_ns = self.view.now_ns;
        if port.abandoned {
            patience.all_explained();
            return ControlFlow::Break(Some(of_port::abandoned(port)));
        }
        match &port.state {
            PortState::Starting => return ControlFlow::Break(None),
            PortState::Away { reason, .. } => {
                patience.away();
                return ControlFlow::Break(Some(of_port::absent(port, reason)));
            }
            PortState::Open => patience.begin(port.opened, snapshot.servos.len(), now_ns),
        }
        let without_cycle_ns = patience.without_cycle_ns(snapshot.counters.cycles, now_ns);
        if let Some(stuck) = of_port::stuck(servos.config, port, without_cycle_ns) {
            patience.all_explained();
            return ControlFlow::Break(Some(stuck));
        }
        ControlFlow::Continue(())
    }

    /// What is wrong with the servos' answers where they are asked: of all, of most, and of each.
    fn of_answers(&self, servos: Servos<'_>, patience: &mut Patience, found: &mut Vec<Problem>) {
        let Servos {
            config,
            snapshot,
            port,
            unknown,
        } = servos;
        let now_ns = self.view.now_ns;
        let late_fast = snapshot.counters.late_fast.saturating_sub(self.before.late_fast);
        let silent: Vec<bool> = (snapshot.servos.iter().enumerate())
            .map(|(joint, servo)| patience.is_silent(joint, servo.alive, now_ns))
            .collect();
        let answers: Vec<Answers> = (snapshot.servos.iter().enumerate())
            .map(|(joint, servo)| self.answers(joint, servo))
            .collect();
        let all = silent.len() > 1 && silent.iter().all(|silent| *silent);
        let late = answers.iter().filter(|answers| answers.late > 0).count();
        let all_are_late = all && 2 * late > answers.len();
        if all && !all_are_late {
            found.push(missing_servos(&self.config.source.to_string(), config.baud));
        }
        let of_all = patience.is_of_all(all, now_ns);
        let mut own: Vec<Problem> = Vec::new();
        for (joint, servo) in snapshot.servos.iter().enumerate() {
            let name = name_of(config, joint);
            let quiet = Quiet {
                silent: silent[joint],
                told: of_all,
                heard: patience.heard[joint],
                unknown: unknown[joint] && patience.heard[joint] && late_fast == 0,
            };
            self.one_servo((joint, &name), servo, &answers[joint], &quiet, port, &mut own);
        }
        for problem in own.iter().filter(|p| explains_no_angle(p.kind)) {
            if let Place::Joint(joint) = problem.place {
                patience.explained(joint);
            }
        }
        if self.are_most(Kind::ServoDamaged, DAMAGED, (&answers, &silent), |a| a.damaged) {
            own.retain(|p| p.kind != Kind::ServoDamaged);
            found.push(most_damaged());
        }
        let is_told = own.iter().any(|p| p.kind == Kind::ServoLate);
        let are_late =
            self.are_most(Kind::ServoLate, LATE, (&answers, &silent), |a| a.late) || all_are_late && !is_told;
        if are_late {
            own.retain(|p| p.kind != Kind::ServoLate);
        }
        found.append(&mut own);
        if are_late || late_fast >= self.least(Kind::ServoLate, Place::Joints, LATE) {
            found.push(most_late(port));
        }
    }

    /// Whether so many answers of more than half of the servos are of this kind that it is told of all of them at once.
    fn are_most(
        &self,
        kind: Kind,
        least: u64,
        (answers, silent): (&[Answers], &[bool]),
        count: fn(&Answers) -> u64,
    ) -> bool {
        // One of a servo is enough to keep up what there is of most, and none too many for one of its own.
        let kept_up = (self.had)(kind, Place::Joints).is_some();
        let is_of_kind = |(joint, answers): &(usize, &Answers)| {
            let come = self.least(kind, Place::Joint(*joint), answers.many(least));
            let has_none = kept_up && answers.none && !silent[*joint];
            has_none || count(answers) >= if kept_up { 1 } else { come }
        };
        let of_kind = answers.iter().enumerate().filter(is_of_kind).count();
        answers.len() > 2 && 2 * of_kind > answers.len()
    }

    fn answers(&self, joint: usize, servo: &ServoState) -> Answers {
        let before = self.before.servos.get(joint).copied().unwrap_or(servo.counters);
        let since = |count: fn(&ServoCounters) -> u64| count(&servo.counters).saturating_sub(count(&before));
        let (late, damaged, refused) = (since(|c| c.late), since(|c| c.bad_crc), since(|c| c.refused));
        let double = since(|c| c.double);
        let came = late + damaged + double + refused + since(|c| c.ok);
        let mut answers = Answers {
            late,
            damaged,
            refused,
            two: double >= DOUBLE,
            all: came + since(|c| c.timeouts),
            none: came == 0,
        };
        if (self.had)(Kind::TwoServos, Place::Joint(joint)).is_some() {
            // Two that answer at once damage each other's answers; a noisy cable damages few.
            answers.two = double > 0 || damaged >= answers.many(DAMAGED);
        }
        if answers.two {
            answers.damaged = 0;
        }
        answers
    }

    fn one_servo(
        &self,
        (joint, name): (usize, &str),
        servo: &ServoState,
        answers: &Answers,
        quiet: &Quiet,
        port: &PortStatus,
        found: &mut Vec<Problem>,
    ) {
        let place = Place::Joint(joint);
        let (late, damaged, refused) = (answers.late, answers.damaged, answers.refused);
        let seconds = self.look.seconds;
        let count = found.len();
        if late >= self.least(Kind::ServoLate, place, answers.many(LATE)) {
            found.push(of_joints(
                Kind::ServoLate,
                place,
                format!(
                    "servo {name} answers after its deadline (late: {late} in {seconds:.1} s), into the next request; such answers are not taken for its angle",
                ),
                late_advice(port, servo),
                format!("servo {name} answers in time"),
            ));
        }
        if answers.two {
            found.push(two_servos(joint, name, 2));
        } else if damaged >= self.least(Kind::ServoDamaged, place, answers.many(DAMAGED)) {
            found.push(of_joints(
                Kind::ServoDamaged,
                place,
                format!(
                    "answers of servo {name} come damaged (CRC): {damaged} in {seconds:.1} s"
                ),
                "look for a loose plug, a cable beside motor wires, a long bus without termination (RS-485), or two servos with one id",
                format!("the answers of servo {name} are whole"),
            ));
        }
        if refused >= self.least(Kind::ServoRefuses, place, answers.many(REFUSED)) {
            found.push(refusing_servo(place, name, refused, seconds, servo.refusal));
        }
        if answers.none && !quiet.silent {
            found.extend(
                OF_ANSWERS_THAT_COME
                    .into_iter()
                    .filter_map(|kind| (self.had)(kind, place).cloned()),
            );
        }
        if quiet.silent && !quiet.told && late == 0 {
            found.push(silent_servo(joint, name, quiet.heard));
        }
        if quiet.unknown && !quiet.silent && found.len() == count {
            found.push(self.stale(joint));
        }
    }

    /// What a servo and its motor have come to, as was known when it was heard last.
    fn known_of(&self, joint: usize, name: &str, servo: &ServoState, found: &mut Vec<Problem>) {
        let had = |kind| (self.had)(kind, Place::Joint(joint));
        found.extend(motor_not_off(joint, name, servo));
        found.extend(motor_lost(joint, name, servo));
        found.extend(servo_state(joint, name, servo, had(Kind::ServoHot).is_some()));
        if servo.identity.is_none() {
            // It is asked anew, perhaps since another one may be in its place.
            found.extend(had(Kind::ServoModel).cloned());
        }
    }

    /// How many there must be of something for a problem: one is enough to keep it up.
    fn least(&self, kind: Kind, place: Place, come: u64) -> u64 {
        match (self.had)(kind, place) {
            Some(_) => 1,
            None => come,
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
        let margin_ms = match &self.config.source {
            JointSource::Dynamixel(servos) => servos.answer_margin_ms,
            JointSource::Allegro(_) => None,
        };
        let advice = match margin_ms {
            Some(margin_ms) if margin_ms >= hold_ms => format!(
                "One that falls silent is waited for {margin_ms} ms (`answer_margin_ms`), and no other is read meanwhile: make that shorter, or `hold_ms` longer"
            ),
            _ => "If the bus cannot be read more often (`cycle_hz` in the status), raise its baud rate, or `hold_ms`".into(),
        };
        of_joints(
            Kind::JointStale,
            Place::Joint(joint),
            format!("the angle of {name} is unknown: {age}"),
            advice,
            format!("the angle of {name} is known"),
        )
    }
}

fn name_of(config: &DynamixelConfig, joint: usize) -> String {
    config.servo.get(joint).map_or_else(String::new, servo_name)
}

/// A servo as it is called behind the word "servo": by its name and its id, or by its id alone where it has no other name.
pub fn servo_name(servo: &ServoConfig) -> String {
    let ServoConfig { id, name, .. } = servo;
    match *name == format!("servo {id}") {
        true => id.to_string(),
        false => format!("{name} (id {id})"),
    }
}

/// More than one servo, so many, answers with the id of this one, by its joint and its name with that id.
pub fn two_servos(joint: usize, name: &str, servos: u32) -> Problem {
    of_joints(
        Kind::TwoServos,
        Place::Joint(joint),
        format!(
            "{servos} servos answer with the id of servo {name}, and all obey what it is told: the angle of none is taken"
        ),
        "unplug all but one of them and give it an id of its own, then plug the others in again",
        format!("one servo answers with the id of servo {name}"),
    )
}

/// A servo that answers with an error number where its position is wanted.
fn refusing_servo(
    place: Place,
    name: &str,
    refused: u64,
    seconds: f64,
    refusal: Option<StatusError>,
) -> Problem {
    let why = refusal.map_or_else(String::new, |refusal| format!(": {refusal}"));
    let advice = match refusal {
        Some(StatusError::Crc) => {
            "Look for a cable beside motor wires, or a long bus without termination (RS-485)"
        }
        _ => {
            "Reboot it; if that does not help, bring its firmware up to date (DYNAMIXEL Wizard), or look whether its model has the control table of the XM430-W210"
        }
    };
    of_joints(
        Kind::ServoRefuses,
        place,
        format!("servo {name} answers and refuses to be read (refused: {refused} in {seconds:.1} s){why}"),
        advice,
        format!("servo {name} is read again"),
    )
}

fn most_damaged() -> Problem {
    of_joints(
        Kind::ServoDamaged,
        Place::Joints,
        "the answers of most servos come damaged (CRC)".into(),
        "look at the cable to the first servo, termination (RS-485), a cable beside motor wires, and at the baud rate",
        "the servos' answers are whole".into(),
    )
}

fn most_late(port: &PortStatus) -> Problem {
    of_joints(
        Kind::ServoLate,
        Place::Joints,
        "answers of most servos come after their deadline, into the next request".into(),
        late_advice(port, &ServoState::default()),
        "the servos answer in time".into(),
    )
}

/// Whether the angle of a servo with such a problem may be unknown for it.
fn explains_no_angle(kind: Kind) -> bool {
    is_of_answers(kind) && kind != Kind::JointStale
}

/// Whether it is about answers that do not come as they should.
fn is_of_answers(kind: Kind) -> bool {
    matches!(
        kind,
        Kind::ServosSilent
            | Kind::ServoSilent
            | Kind::ServoLate
            | Kind::ServoDamaged
            | Kind::TwoServos
            | Kind::ServoRefuses
            | Kind::JointStale
    )
}

/// An FTDI adapter, by its latency timer and its name in `/sys/bus/usb-serial/devices`, that keeps
/// bytes back for so long that cycles are slow; `None` where it does not.
pub fn slow_adapter(timer_ms: u32, name: &str) -> Option<Problem> {
    let problem = of_joints(
        Kind::AdapterLatency,
        Place::Joints,
        format!("the FTDI adapter keeps answers back for up to {timer_ms} ms"),
        format!(
            "`echo 1 > /sys/bus/usb-serial/devices/{name}/latency_timer` as root, or for good systemd/60-taxeld-serial.rules, makes it 1 ms"
        ),
        "the FTDI adapter hands answers over within 1 ms".into(),
    );
    (timer_ms > 1).then_some(problem)
}

fn adapter_of(port: &PortStatus) -> Option<Problem> {
    let name = port.device.as_ref()?.file_name()?.to_string_lossy();
    slow_adapter(port.latency?.ftdi_timer_ms?, &name)
}

fn late_advice(port: &PortStatus, servo: &ServoState) -> String {
    let timer_ms = port.latency.and_then(|l| l.ftdi_timer_ms);
    let delay_us = servo.identity.map_or(0, |i| i.return_delay_us);
    match (timer_ms, delay_us) {
        (Some(ms), _) if ms > 1 => format!("The adapter's latency timer is {ms} ms and should be 1"),
        (_, 50..) => format!("Its Return Delay Time is {delay_us} us: set it to 0"),
        _ => "Look for a USB hub or a busy machine in between; `answer_margin_ms` in [joints] gives answers more time \
              (`taxel doctor` measures how much they need, while taxeld does not run)"
            .into(),
    }
}

/// No servo answers; `source` is that of the configuration.
pub fn missing_servos(source: &str, baud: u32) -> Problem {
    of_joints(
        Kind::ServosSilent,
        Place::Joints,
        "no servo answers".into(),
        format!(
            "check their supply and the cable, and that they are set to baud = {baud} (`taxel doctor --joints {} --ids 1-16` looks for others). They are asked again twice a second",
            shell_word(source)
        ),
        "servos answer".into(),
    )
}

/// A servo, by its joint and its name with its id, does not answer; `heard` says that it once did.
pub fn silent_servo(joint: usize, name: &str, heard: bool) -> Problem {
    let more = match heard {
        true => "",
        false => ", its id and its baud rate, and that it is set to protocol 2.0 and Status Return Level 2",
    };
    of_joints(
        Kind::ServoSilent,
        Place::Joint(joint),
        format!("servo {name} is silent"),
        format!("check its power and cable{more}. The others go on; it is asked again twice a second"),
        format!("servo {name} answers again"),
    )
}
