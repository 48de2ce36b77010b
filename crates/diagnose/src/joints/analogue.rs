//! What is wrong with potentiometers: the serial port, the lines, each joint in them.

use super::{Judge, of_joints};
use crate::kind::Kind;
use crate::problem::{Place, Problem};
use taxel_hand::plural;
use taxel_joints::{AnalogueConfig, AnalogueSnapshot, NoAngle, PortState};

/// Without a good line for so long, nothing comes.
const SILENT_NS: u64 = 1_000_000_000;
/// Lines in the time looked at that cannot be read, from which they are a problem, if they are a fifth of all.
const MALFORMED: u64 = 3;
const SHARE: u64 = 5;

impl Judge<'_> {
    pub(super) fn potentiometers(
        &self,
        config: &AnalogueConfig,
        snapshot: &AnalogueSnapshot,
        found: &mut Vec<Problem>,
    ) {
        if snapshot.port.abandoned {
            found.push(abandoned_potentiometers(config));
            return;
        }
        match &snapshot.port.state {
            PortState::Starting => return,
            PortState::Away { reason, .. } => {
                found.push(absent_potentiometers(config, reason));
                return;
            }
            PortState::Open => {}
        }
        let counters = snapshot.counters;
        let since_ns = counters
            .heard_ns
            .map_or(snapshot.open_ns, |heard| heard.max(snapshot.open_ns));
        if self.view.now_ns.saturating_sub(since_ns) >= SILENT_NS {
            found.push(silent_potentiometers(config, counters.malformed > 0));
            return;
        }
        let before = self.before.analogue;
        let malformed = counters.malformed.saturating_sub(before.malformed);
        let lines = counters.lines.saturating_sub(before.lines);
        let least = match (self.had)(Kind::AnalogueMalformed, Place::Joints).is_some() {
            true => 1,
            false => MALFORMED.max((malformed + lines).div_ceil(SHARE)),
        };
        if malformed >= least {
            found.push(unread_lines(config, malformed, self.look.seconds));
        }
        let names = self.config.joint_names();
        let first = names.len() - config.joint.len();
        let (now_ns, hold_ns) = (self.view.now_ns, (self.config.hold_ms * 1e6) as u64);
        let lost = (0..snapshot.angles.len()).filter_map(|n| {
            let lost = snapshot.lost(n, now_ns, hold_ns)?;
            potentiometer_state(config, n, first + n, lost)
        });
        found.extend(lost);
    }
}

/// The port of the potentiometers cannot be opened.
pub fn absent_potentiometers(config: &AnalogueConfig, reason: &str) -> Problem {
    of_joints(
        Kind::AnalogueAbsent,
        Place::Joints,
        format!("potentiometers: {reason}"),
        "Until then images go on with unknown angles of those joints",
        format!("the potentiometers' port {} is there", config.device.display()),
    )
}

/// The thread that read them has panicked.
fn abandoned_potentiometers(config: &AnalogueConfig) -> Problem {
    let device = config.device.display();
    of_joints(
        Kind::AnalogueSilent,
        Place::Joints,
        format!("the thread that reads the potentiometers on {device} has died of a fault of taxeld"),
        "restart taxeld, and report what its log says of the panic",
        format!("lines come from the potentiometers on {device}"),
    )
}

/// No good line comes.
pub fn silent_potentiometers(config: &AnalogueConfig, speaks: bool) -> Problem {
    let (device, baud) = (config.device.display(), config.baud);
    let found = match speaks {
        true => format!("no line that can be read comes from the potentiometers on {device}"),
        false => format!("nothing comes from the potentiometers on {device}"),
    };
    of_joints(
        Kind::AnalogueSilent,
        Place::Joints,
        found,
        format!(
            "check the microcontroller's supply and program, and that it prints at {baud} bit/s lines such as \
             `p0 512 p1 498`"
        ),
        format!("lines come from the potentiometers on {device}"),
    )
}

/// Some lines cannot be read.
pub fn unread_lines(config: &AnalogueConfig, malformed: u64, seconds: f64) -> Problem {
    let device = config.device.display();
    of_joints(
        Kind::AnalogueMalformed,
        Place::Joints,
        format!(
            "{} of the potentiometers on {device} in {seconds:.1} s cannot be read",
            plural(malformed, "line")
        ),
        "look at the cable and the baud rate, and for other things that the microcontroller prints: a line is numbers, or \
         names each with a number",
        format!("the lines of the potentiometers on {device} can be read"),
    )
}

/// A potentiometer, by its number and its joint's, that gives no angle ([`AnalogueSnapshot::lost`]); `None` where no line
/// has come.
pub fn potentiometer_state(
    config: &AnalogueConfig,
    n: usize,
    joint: usize,
    lost: NoAngle,
) -> Option<Problem> {
    let of = config.joint.get(n)?;
    let (name, channel, [low, high]) = (&of.name, &of.channel, config.ends);
    let (what, advice) = match lost {
        NoAngle::NeverHeard => return None,
        NoAngle::Missing => (
            format!("channel {channel} is not in the lines"),
            "correct `channel`, or what the microcontroller prints".to_owned(),
        ),
        NoAngle::AtEnd(counts) => (
            format!("it stands at an end ({counts} of {low} to {high} counts)"),
            "look for a wire that is off or a short; a potentiometer that is only turned too far is turned back".to_owned(),
        ),
    };
    Some(of_joints(
        Kind::PotentiometerLost,
        Place::Joint(joint),
        format!("the potentiometer of {name} gives no angle: {what}"),
        advice,
        format!("the potentiometer of {name} gives its angle again"),
    ))
}
