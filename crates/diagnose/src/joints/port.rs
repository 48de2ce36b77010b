//! What is wrong with the serial port of servos.

use super::of_joints;
use crate::kind::Kind;
use crate::problem::{Place, Problem};
use taxel_hand::shell_word;
use taxel_joints::bus::wire_ns;
use taxel_joints::{DynamixelConfig, PortStatus};

/// A cycle that takes so much longer than the slowest bus needs does not end.
const STUCK_NS: u64 = 2_000_000_000;
/// Requests of a cycle whose answers are waited for, and bytes that the request to a servo and its answer take at most.
const REQUESTS: u64 = 6;
const SERVO_BYTES: usize = 40;
/// Another program that has taken bytes within this time still does.
const SHARED_NS: u64 = 5_000_000_000;

/// The port is away, for this reason.
pub(super) fn absent(port: &PortStatus, reason: &str) -> Problem {
    let path = port.path.display();
    // The newest reason is that it cannot be opened anew, which says nothing of how it went.
    let gone = match port.opened {
        0 => String::new(),
        _ => format!(
            "{path} is gone, unplugged or reset by its driver, and is used again as soon as it is back: "
        ),
    };
    of_joints(
        Kind::SerialAbsent,
        Place::Joints,
        format!("{gone}{reason}"),
        "Until then images go on with unknown joint angles",
        format!("{path} is there"),
    )
}

/// The thread that reads it hangs, where no cycle has ended for so long.
pub(super) fn stuck(config: &DynamixelConfig, port: &PortStatus, without_cycle_ns: u64) -> Option<Problem> {
    let margin_ns = (config.answer_margin_ms.unwrap_or_default() * 1e6) as u64;
    let most_ns = STUCK_NS + REQUESTS * (wire_ns(SERVO_BYTES * config.servo.len(), config.baud) + margin_ns);
    let (path, seconds) = (port.path.display(), without_cycle_ns as f64 / 1e9);
    let problem = of_joints(
        Kind::SerialStuck,
        Place::Joints,
        format!(
            "the thread that reads servos has waited for {path} for {seconds:.1} s; motors stop by their own watchdogs"
        ),
        "the adapter's driver does not return: unplug the adapter and plug it in again, then restart taxeld. `dmesg` may say why",
        format!("{path} is read again"),
    );
    (without_cycle_ns >= most_ns).then_some(problem)
}

/// The thread that read it has panicked.
pub(super) fn abandoned(port: &PortStatus) -> Problem {
    let path = port.path.display();
    of_joints(
        Kind::SerialStuck,
        Place::Joints,
        format!(
            "the thread that reads servos has died of a fault of taxeld, so that {path} is not read and no servo obeys; motors stop by their own watchdogs"
        ),
        "restart taxeld, and report what its log says of the panic",
        format!("{path} is read again"),
    )
}

/// Another program reads it.
pub(super) fn shared(port: &PortStatus, now_ns: u64) -> Option<Problem> {
    let taken_ns = port.taken_ns?;
    let path = port.path.display();
    let problem = of_joints(
        Kind::SerialShared,
        Place::Joints,
        format!(
            "another program reads {path} and takes the servos' answers, so that angles are missing and no motor can be trusted"
        ),
        format!("end it: `fuser -v {}` tells which", shell_word(&path)),
        format!("no other program reads {path} any more"),
    );
    (now_ns.saturating_sub(taken_ns) < SHARED_NS).then_some(problem)
}
