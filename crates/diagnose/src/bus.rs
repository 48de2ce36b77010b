//! What is wrong with a bus: its interface, its controller, its queues.

use crate::kind::Kind;
use crate::problem::{Place, Problem};
use crate::view::Look;
use taxel_can::{BusState, LinkState, SourceAddress, SourceCounters};

/// Changes of the controller's state in the time looked at, from which it flaps, and down to which
/// it goes on to.
const FLAPS: u64 = 4;
const FLAPS_ON: u64 = 2;
/// Broken frames per second, and unacknowledged ones, from which they are worth a sentence.
const BROKEN_HZ: f64 = 5.0;
const UNACKNOWLEDGED_HZ: f64 = 2.0;

pub(crate) fn judge(look: &Look<'_>, index: usize, flapped: bool, found: &mut Vec<Problem>) {
    let now = &look.view.buses[index];
    let mut judge = Judge {
        index,
        name: &look.setup.layout.buses[index],
        address: &look.setup.sources[index],
        now: &now.counters,
        before: &look.before[index],
        seconds: look.seconds,
        found,
    };
    match now.link {
        LinkState::Up => {
            judge.controller(flapped);
            judge.errors_on_the_wire();
            judge.frames_lost();
            judge.undecodable();
            judge.unsent();
        }
        // There is nothing else to say.
        link => judge.link_lost(link),
    }
}

/// A bus and what its source has counted, now and a while ago.
struct Judge<'a> {
    index: usize,
    name: &'a str,
    address: &'a SourceAddress,
    now: &'a SourceCounters,
    before: &'a SourceCounters,
    /// What `before` is older by.
    seconds: f64,
    found: &'a mut Vec<Problem>,
}

impl Judge<'_> {
    fn report(&mut self, kind: Kind, what: &str, advice: &str, over: &str) {
        let (what, over) = (format!("{}: {what}", self.name), format!("{}: {over}", self.name));
        self.found
            .push(Problem::new(kind, Place::Bus(self.index), what, advice, over));
    }

    /// By how much a count has grown meanwhile.
    fn since(&self, count: impl Fn(&SourceCounters) -> u64) -> u64 {
        count(self.now).saturating_sub(count(self.before))
    }

    /// The same, per second.
    fn rate_hz(&self, count: impl Fn(&SourceCounters) -> u64) -> f64 {
        self.since(count) as f64 / self.seconds
    }

    /// The interface by the name that `ip` knows, where it has one.
    fn device(&self) -> &str {
        interface(self.address).unwrap_or(self.name)
    }

    fn link_lost(&mut self, link: LinkState) {
        let is_down = link == LinkState::Down;
        let kind = match (self.address, is_down) {
            (SourceAddress::Log { .. }, _) => Kind::RecordingEnded,
            (_, true) => Kind::LinkDown,
            (_, false) => Kind::LinkAbsent,
        };
        let (what, advice, over) = match interface(self.address) {
            Some(interface) if is_down => (
                format!("the interface {interface} is down"),
                format!("`ip link set {interface} up` (for good: systemd/80-can.network). The rest goes on"),
                format!("the interface {interface} is up"),
            ),
            Some(interface) => (
                format!("there is no interface {interface}"),
                "plug its adapter in, or see `ip link`. The rest goes on, and this bus will as soon as it is there"
                    .into(),
                format!("the interface {interface} is there and up"),
            ),
            None if matches!(self.address, SourceAddress::Log { .. }) => (
                format!("{} is at its end", self.address),
                "The rest goes on".into(),
                format!("{} goes on", self.address),
            ),
            None => (
                format!("{} is {link}", self.address),
                "waiting for it. The rest goes on".into(),
                format!("{} is up", self.address),
            ),
        };
        self.report(kind, &what, &advice, &over);
    }

    fn controller(&mut self, flapped: bool) {
        let SourceCounters {
            bus_state,
            error_counters: [tx, rx],
            ..
        } = *self.now;
        let changes = |counted: &SourceCounters| counted.state_changes;
        if self.since(changes) >= if flapped { FLAPS_ON } else { FLAPS } {
            // Each of its states is no news.
            return self.report(
                Kind::Flapping,
                &format!(
                    "the controller changes its error state {:.0} times a second",
                    self.rate_hz(changes)
                ),
                "look for a loose contact, missing termination (120 ohms at both ends), or a node with another bit rate",
                &format!("the controller's error state is steady again: {bus_state}"),
            );
        }
        match bus_state {
            BusState::ErrorActive => {}
            BusState::BusOff => {
                let device = self.device();
                let advice = format!(
                    "Check wiring, termination and bit rate. If the kernel does not restart it by itself, let it: \
                     `ip link set {device} down && ip link set {device} type can restart-ms 100 && ip link set {device} up`"
                );
                self.report(
                    Kind::BusOff,
                    "the controller is off the bus after too many errors, and hears nothing",
                    &advice,
                    "the controller is on the bus again",
                );
            }
            BusState::ErrorPassive => self.report(
                Kind::ErrorPassive,
                &format!("the controller is error-passive (errors: {tx} sending, {rx} receiving)"),
                advice(tx, rx),
                "the controller is no longer error-passive",
            ),
            BusState::ErrorWarning => self.report(
                Kind::ErrorWarning,
                &format!("the controller sees many errors ({tx} sending, {rx} receiving)"),
                advice(tx, rx),
                "the controller no longer warns of errors",
            ),
        }
    }

    fn errors_on_the_wire(&mut self) {
        let unacknowledged = self.rate_hz(|counted| counted.errors.no_acknowledge);
        let broken = self
            .rate_hz(|counted| counted.errors.protocol)
            .max(self.rate_hz(|counted| counted.errors.bus_error));
        if unacknowledged >= UNACKNOWLEDGED_HZ {
            self.report(
                Kind::NoAcknowledge,
                "nobody acknowledges what is sent: the hand has no power, its cable is off, or its bit rate is another",
                "",
                "what is sent is acknowledged",
            );
        } else if broken >= BROKEN_HZ {
            self.report(
                Kind::BusErrors,
                &format!("{broken:.0} broken frames a second"),
                "look for missing termination (120 ohms at both ends), a cable beside motor wires, or a node with another \
                 bit rate",
                "no more broken frames",
            );
        }
    }

    fn frames_lost(&mut self) {
        if self.since(|counted| counted.errors.controller_overflow) > 0 {
            self.report(
                Kind::ControllerOverflow,
                "the CAN adapter drops frames because the machine takes them too late",
                "try another USB port, less load on the machine, or a better adapter",
                "the CAN adapter drops no more frames",
            );
        }
        let lost = self.since(|counted| counted.lost_in_kernel);
        if lost > 0 {
            self.report(
                Kind::FramesLost,
                &match lost {
                    1 => "a frame lost in the kernel because it was taken too late".into(),
                    _ => format!("{lost} frames lost in the kernel because they were taken too late"),
                },
                "the machine was busy, or taxeld stood still, for longer than the queue lasts: less load, or a larger queue \
                 (`[can] receive_buffer_kib`, and `sysctl net.core.rmem_max`, in bytes, no less than that)",
                "no more frames lost in the kernel",
            );
        }
    }

    fn undecodable(&mut self) {
        let undecodable = self.since(|counted| counted.undecodable);
        let are_mostly_can_fd = 2 * self.since(|counted| counted.can_fd) > undecodable;
        let (unit, what, advice) = match self.address {
            _ if undecodable == 0 => return,
            // It is told with what is refused there.
            SourceAddress::Pressure { .. } => return,
            SourceAddress::Udp { .. } if are_mostly_can_fd => (
                "datagrams",
                "are CAN FD frames, which are refused",
                "no board of a known skin sends such; have the sender make classic ones (python-can: `is_fd=False`)",
            ),
            SourceAddress::Udp { .. } => (
                "datagrams",
                "are no CAN frames",
                "does another program send to this group and port? Give the hand one of its own; python-can's \
                 `udp_multicast` and `taxel` send what is wanted",
            ),
            SourceAddress::Log { .. } if are_mostly_can_fd => (
                "lines",
                "are CAN FD frames, which are left out",
                "no board of a known skin sends such; the rest of it is read",
            ),
            SourceAddress::Log { .. } => (
                "lines",
                "are no CAN frames",
                "the recording is damaged; the rest of it is read",
            ),
            _ => ("frames", "are no CAN frames", "please report this"),
        };
        let rate_hz = (undecodable as f64 / self.seconds).max(1.0);
        self.report(
            Kind::Undecodable,
            &format!("{rate_hz:.0} {unit} a second from {} {what}", self.address),
            advice,
            "all that comes are CAN frames",
        );
    }

    fn unsent(&mut self) {
        // Off the bus, the queue fills of course.
        let is_off = [self.now.bus_state, self.before.bus_state].contains(&BusState::BusOff);
        if self.since(|counted| counted.send_failures) > 0 && !is_off {
            let advice = format!(
                "Check the hand's power; `ip link set {} txqueuelen 100`",
                self.device()
            );
            self.report(
                Kind::CannotSend,
                "commands to the boards cannot be sent: the transmit queue is full, since nobody acknowledges them or the \
                 bus is full",
                &advice,
                "commands to the boards are sent again",
            );
        }
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
