//! What is wrong with a bus: its interface, its controller, its queues.

use crate::kind::Kind;
use crate::problem::{Place, Problem};
use crate::view::Look;
use taxel_can::{BusState, LinkState, SourceAddress};

/// Changes of the controller's state in the time looked at, from which it flaps, and down to which
/// it goes on to.
const FLAPS: u64 = 4;
const FLAPS_ON: u64 = 2;
/// Broken frames per second, and unacknowledged ones, from which they are worth a sentence.
const BROKEN_HZ: f64 = 5.0;
const UNACKNOWLEDGED_HZ: f64 = 2.0;

pub(crate) fn judge(look: &Look<'_>, index: usize, flapped: bool, found: &mut Vec<Problem>) {
    let name = &look.setup.layout.buses[index];
    let address = &look.setup.sources[index];
    let now = &look.view.buses[index];
    let (source, before) = (&now.counters, &look.before[index]);
    let since = |count: u64, before: u64| count.saturating_sub(before);
    let per_second = |count: u64| count as f64 / look.seconds;
    let mut report = |kind, what: &str, advice: &str, over: &str| {
        let (what, over) = (format!("{name}: {what}"), format!("{name}: {over}"));
        found.push(Problem::new(kind, Place::Bus(index), what, advice, over));
    };

    // With a link that is lost there is nothing else to say.
    match (now.link, interface(address)) {
        (LinkState::Up, _) => {}
        (LinkState::Absent, Some(interface)) => {
            return report(
                Kind::LinkAbsent,
                &format!("there is no interface {interface}"),
                "plug its adapter in, or see `ip link`. The rest goes on, and this bus will as soon as it is there",
                &format!("the interface {interface} is there and up"),
            );
        }
        (LinkState::Down, Some(interface)) => {
            return report(
                Kind::LinkDown,
                &format!("the interface {interface} is down"),
                &format!("`ip link set {interface} up` (for good: systemd/80-can.network). The rest goes on"),
                &format!("the interface {interface} is up"),
            );
        }
        (link, None) => {
            let kind = if link == LinkState::Down {
                Kind::LinkDown
            } else {
                Kind::LinkAbsent
            };
            return report(
                kind,
                &format!("{address} is {link}"),
                "waiting for it. The rest goes on",
                &format!("{address} is up"),
            );
        }
    }

    let device = interface(address).unwrap_or(name);
    let changes = since(source.state_changes, before.state_changes);
    let flaps = changes >= if flapped { FLAPS_ON } else { FLAPS };
    if flaps {
        report(
            Kind::Flapping,
            &format!(
                "the controller changes its error state {:.0} times a second",
                per_second(changes)
            ),
            "look for a loose contact, missing termination (120 ohms at both ends), or a node with another bit rate",
            &format!(
                "the controller's error state is steady again: {}",
                source.bus_state
            ),
        );
    }
    let [tx, rx] = source.error_counters;
    match source.bus_state {
        // While it flaps, each of its states is no news.
        _ if flaps => {}
        BusState::ErrorActive => {}
        BusState::BusOff => report(
            Kind::BusOff,
            "the controller is off the bus after too many errors, and hears nothing",
            &format!(
                "Check wiring, termination and bit rate. If the kernel does not restart it by itself, let it: `ip link set {device} down && ip link set {device} type can restart-ms 100 && ip link set {device} up`"
            ),
            "the controller is on the bus again",
        ),
        BusState::ErrorPassive => report(
            Kind::ErrorPassive,
            &format!("the controller is error-passive (errors: {tx} sending, {rx} receiving)"),
            advice(tx, rx),
            "the controller is no longer error-passive",
        ),
        BusState::ErrorWarning => report(
            Kind::ErrorWarning,
            &format!("the controller sees many errors ({tx} sending, {rx} receiving)"),
            advice(tx, rx),
            "the controller no longer warns of errors",
        ),
    }

    let (errors, earlier) = (&source.errors, &before.errors);
    let unacknowledged = per_second(since(errors.no_acknowledge, earlier.no_acknowledge));
    if unacknowledged >= UNACKNOWLEDGED_HZ {
        report(
            Kind::NoAcknowledge,
            "nobody acknowledges what is sent: the hand has no power, its cable is off, or its bit rate is another",
            "",
            "what is sent is acknowledged",
        );
    }
    let broken =
        per_second(since(errors.protocol, earlier.protocol).max(since(errors.bus_error, earlier.bus_error)));
    if broken >= BROKEN_HZ && unacknowledged < UNACKNOWLEDGED_HZ {
        report(
            Kind::BusErrors,
            &format!("{broken:.0} broken frames a second"),
            "look for missing termination (120 ohms at both ends), a cable beside motor wires, or a node with another bit rate",
            "no more broken frames",
        );
    }
    let overflows = since(errors.controller_overflow, earlier.controller_overflow);
    if overflows > 0 {
        report(
            Kind::ControllerOverflow,
            "the CAN adapter drops frames because the machine takes them too late",
            "try another USB port, less load on the machine, or a better adapter",
            "the CAN adapter drops no more frames",
        );
    }
    let lost = since(source.lost_in_kernel, before.lost_in_kernel);
    if lost > 0 {
        report(
            Kind::FramesLost,
            &format!("{lost} frames lost in the kernel because they were taken too late"),
            "`sysctl net.core.rmem_max=4194304` lets the queue be larger",
            "no more frames lost in the kernel",
        );
    }
    let undecodable = since(source.undecodable, before.undecodable);
    // Of a pressure array it is told with what is refused there.
    if undecodable > 0 && !matches!(address, SourceAddress::Pressure { .. }) {
        let can_fd = since(source.can_fd, before.can_fd);
        let mut what = "are no CAN frames";
        let (unit, advice) = match address {
            SourceAddress::Udp { .. } if 2 * can_fd > undecodable => {
                what = "are CAN FD frames, which are refused";
                (
                    "datagrams",
                    "no board of a known skin sends such; have the sender make classic ones (python-can: `is_fd=False`)",
                )
            }
            SourceAddress::Udp { .. } => (
                "datagrams",
                "does another program send to this group and port? Give the hand one of its own; python-can's \
                 `udp_multicast` and `taxel` send what is wanted",
            ),
            SourceAddress::Log { .. } => ("lines", "the recording is damaged; the rest of it is read"),
            _ => ("frames", "please report this"),
        };
        report(
            Kind::Undecodable,
            &format!(
                "{:.0} {unit} a second from {address} {what}",
                per_second(undecodable).max(1.0)
            ),
            advice,
            "all that comes are CAN frames",
        );
    }
    let unsent = since(source.send_failures, before.send_failures);
    // Off the bus, the queue fills of course.
    if unsent > 0 && ![source.bus_state, before.bus_state].contains(&BusState::BusOff) {
        report(
            Kind::CannotSend,
            "commands to the boards cannot be sent: the transmit queue is full, since nobody acknowledges them or the bus is full",
            &format!("Check the hand's power; `ip link set {device} txqueuelen 100`"),
            "commands to the boards are sent again",
        );
    }
}

fn interface(address: &SourceAddress) -> Option<&str> {
    match address {
        SourceAddress::Can { interface, .. } => Some(interface),
        _ => None,
    }
}

/// What to look at, by which error counter is the higher.
fn advice(tx: u8, rx: u8) -> &'static str {
    if tx > rx {
        "what it sends is not acknowledged or disturbed: check the hand's power and cable"
    } else {
        "what it hears is broken: check termination (120 ohms at both ends), bit rate and cable"
    }
}
