//! The CAN interfaces: what is wrong with what sysfs and the kernel say of them.

mod facts;
mod netlink;

pub(crate) use facts::{LinkFacts, can_interfaces};

use super::finding::Check;
use facts::CAN_TYPE;
use netlink::LinkDetails;

const AREA: &str = "link";
/// `IFF_UP` of `linux/if.h`.
const UP: u32 = 1;
/// What every public description of these boards says (docs/protocols.md, "Bus timing").
pub(crate) const BITRATE: u64 = 1_000_000;
const RESTART_MS: u64 = 100;
const TXQUEUELEN: u64 = 100;

/// What is to be said of an interface. `bitrate` is what the boards need, where that is known.
pub(crate) fn check(facts: &LinkFacts, bitrate: Option<u64>) -> Vec<Check> {
    let name = &facts.name;
    let ok = |what, found: String| Check::ok(AREA, what, name, found);
    let Some(sysfs) = &facts.sysfs else {
        return vec![absent(facts)];
    };
    if sysfs.kind != CAN_TYPE {
        return vec![
            Check::error(AREA, "interface", name, "is not a CAN interface")
                .wanted(format!("one of: {}", list(&facts.others))),
        ];
    }
    let details = facts.details.as_ref().ok();
    let kind = details.map_or("", |d| d.kind.as_str());
    let is_virtual = matches!(kind, "vcan" | "vxcan");
    let rate = bitrate.unwrap_or(BITRATE);
    let bring_up = match is_virtual || (kind.is_empty() && name.starts_with("vcan")) {
        true => format!("sudo ip link set {name} up"),
        false => format!("sudo ip link set {name} up type can bitrate {rate} restart-ms {RESTART_MS}"),
    };
    let again = format!("sudo ip link set {name} down && {bring_up}");

    let mut checks = Vec::new();
    let is_up = sysfs.flags & UP != 0;
    checks.push(match is_up {
        true => ok(
            "link",
            format!(
                "up{}",
                if kind.is_empty() {
                    String::new()
                } else {
                    format!(", {kind}")
                }
            ),
        ),
        false => Check::error(AREA, "link", name, "is down")
            .wanted("up")
            .run(&bring_up),
    });
    match (&facts.details, details) {
        (Err(why), _) => checks.push(
            Check::skipped(AREA, "bit timing", name, format!("unknown: {why}")).advise(format!(
                "`ip -details link show {name}` tells it where this program may not ask"
            )),
        ),
        (_, Some(details)) if !is_virtual => {
            checks.extend(check_controller(name, details, is_up, bitrate, &again));
        }
        _ => {}
    }
    if let Some(len) = sysfs.tx_queue_len {
        checks.push(match len >= TXQUEUELEN {
            true => ok("txqueuelen", len.to_string()),
            false => Check::warning(AREA, "txqueuelen", name, len.to_string())
                .wanted(format!("{TXQUEUELEN}, so that commands to all boards fit"))
                .run(format!("sudo ip link set {name} txqueuelen {TXQUEUELEN}")),
        });
    }
    let lost = sysfs.rx_over_errors + sysfs.rx_dropped;
    checks.push(match lost {
        0 => ok("lost frames", format!("none of {}", sysfs.rx_packets)),
        _ => Check::warning(
            AREA,
            "lost frames",
            name,
            format!(
                "{} lost in the controller, {} dropped by the kernel, {} received since the interface exists",
                sysfs.rx_over_errors, sysfs.rx_dropped, sysfs.rx_packets
            ),
        )
        .wanted("none")
        .advise(
            "a slow adapter or a busy machine: try another USB port, and look whether the number still grows",
        ),
    });
    checks
}

fn absent(facts: &LinkFacts) -> Check {
    let name = &facts.name;
    let check = Check::error(AREA, "interface", name, "does not exist");
    if name.starts_with("vcan") {
        return check.run(format!(
            "sudo modprobe vcan && sudo ip link add {name} type vcan && sudo ip link set {name} up"
        ));
    }
    if name.starts_with("slcan") {
        return check.run(format!(
            "sudo slcand -o -s8 -S 3000000 /dev/ttyACM0 {name} && sudo ip link set {name} up"
        ));
    }
    check
        .advise(format!(
            "plug the adapter in, and look with `ip -details link show type can`; there is: {}",
            list(&facts.others)
        ))
        .advise("if the adapter is there under another name, write that into the configuration")
}

fn list(names: &[String]) -> String {
    match names.is_empty() {
        true => "no CAN interface at all".into(),
        false => names.join(", "),
    }
}

fn check_controller(
    name: &str,
    details: &LinkDetails,
    is_up: bool,
    wanted: Option<u64>,
    again: &str,
) -> Vec<Check> {
    let mut checks = Vec::new();
    let counters = match details.errors {
        Some([tx, rx]) => format!(" (error counters: transmit {tx}, receive {rx})"),
        None => String::new(),
    };
    if is_up && let Some(state) = details.state {
        let found = format!("{state}{counters}");
        checks.push(match state {
            "error-active" => Check::ok(AREA, "state", name, found),
            "bus-off" => Check::error(AREA, "state", name, found)
                .wanted("error-active")
                .run(format!("sudo ip link set {name} type can restart"))
                .advise(WIRING),
            _ => Check::warning(AREA, "state", name, found)
                .wanted("error-active")
                .advise(WIRING),
        });
    }
    match (details.bitrate, wanted) {
        (Some(rate), Some(wanted)) if rate != wanted => checks.push(
            Check::error(AREA, "bit rate", name, format!("{rate} bit/s"))
                .wanted(format!("{wanted} bit/s"))
                .run(again),
        ),
        (Some(rate), _) => checks.push(Check::ok(AREA, "bit rate", name, format!("{rate} bit/s"))),
        (None, _) => checks.push(
            Check::error(AREA, "bit rate", name, "not set")
                .wanted(format!("{} bit/s", wanted.unwrap_or(BITRATE)))
                .run(again),
        ),
    }
    if let Some(point) = details.sample_point {
        let found = format!("{:.1} %", point * 100.0);
        checks.push(match (0.5..=0.9).contains(&point) {
            true => Check::ok(AREA, "sample point", name, found),
            false => Check::warning(AREA, "sample point", name, found)
                .wanted("50 to 90 %; 75 to 87.5 % is usual")
                .run(format!("{again} sample-point 0.8")),
        });
    }
    match details.restart_ms {
        Some(0) => checks.push(
            Check::warning(AREA, "restart-ms", name, "0: after bus-off it stays off for ever")
                .wanted(RESTART_MS.to_string())
                .run(again),
        ),
        Some(ms) => checks.push(Check::ok(AREA, "restart-ms", name, ms.to_string())),
        None => {}
    }
    if details.bus_off > 0 {
        checks.push(
            Check::warning(
                AREA,
                "bus-off",
                name,
                format!(
                    "{} times so far, restarted {} times",
                    details.bus_off, details.restarts
                ),
            )
            .wanted("never")
            .advise(WIRING),
        );
    }
    checks
}

const WIRING: &str = "look at the wiring: CAN-H and CAN-L not swapped, a common ground, 120 ohm at both ends of the bus \
                      (60 ohm between H and L without power), every node at the same bit rate, the boards powered";

#[cfg(test)]
mod tests {
    use super::super::finding::{Mend, State};
    use super::facts::SysfsLink;
    use super::*;

    /// A USB adapter at work, but for what is given.
    fn can(state: &'static str, bitrate: u64, restart_ms: u32) -> LinkDetails {
        LinkDetails {
            kind: "can".into(),
            state: Some(state),
            bitrate: Some(bitrate),
            sample_point: Some(0.75),
            restart_ms: Some(restart_ms),
            errors: Some([0, 0]),
            bus_off: 2,
            restarts: 0,
        }
    }

    fn vcan() -> LinkDetails {
        LinkDetails {
            kind: "vcan".into(),
            ..LinkDetails::default()
        }
    }

    fn facts(details: LinkDetails, flags: u32) -> LinkFacts {
        LinkFacts {
            name: "can0".into(),
            sysfs: Some(SysfsLink {
                kind: CAN_TYPE,
                flags,
                tx_queue_len: Some(100),
                ..SysfsLink::default()
            }),
            details: Ok(details),
            others: vec!["can0".into()],
        }
    }

    fn found<'a>(checks: &'a [Check], name: &str) -> &'a Check {
        checks
            .iter()
            .find(|c| c.name == name)
            .unwrap_or_else(|| panic!("no check of {name}: {checks:?}"))
    }

    fn command(check: &Check) -> &str {
        match &check.mend[..] {
            [Mend::Run(command), ..] => command,
            other => panic!("no command: {other:?}"),
        }
    }

    #[test]
    fn each_thing_that_is_wrong_has_its_state_and_its_command() {
        let up = "sudo ip link set can0 up type can bitrate 1000000 restart-ms 100";
        let again = format!("sudo ip link set can0 down && {up}");
        let good = can("error-active", 1_000_000, 100);
        let restart = "sudo ip link set can0 type can restart";
        for (details, flags, name, state, mend) in [
            (good.clone(), 0x4_00C0, "link", State::Error, up),
            (
                can("error-active", 500_000, 100),
                0x4_00C1,
                "bit rate",
                State::Error,
                &again,
            ),
            (
                can("error-active", 1_000_000, 0),
                0x4_00C1,
                "restart-ms",
                State::Warning,
                &again,
            ),
            (
                can("bus-off", 1_000_000, 100),
                0x4_00C1,
                "state",
                State::Error,
                restart,
            ),
        ] {
            let checks = check(&facts(details, flags), Some(1_000_000));
            let check = found(&checks, name);
            assert_eq!((check.state, command(check)), (state, mend), "{checks:?}");
        }
        let checks = check(&facts(good, 0x4_00C1), Some(1_000_000));
        for name in [
            "link",
            "state",
            "bit rate",
            "sample point",
            "restart-ms",
            "txqueuelen",
            "lost frames",
        ] {
            assert_eq!(found(&checks, name).state, State::Ok, "{name}");
        }
        assert_eq!(found(&checks, "bus-off").state, State::Warning);
        assert_eq!(found(&checks, "sample point").found, "75.0 %");
    }

    #[test]
    fn error_passive_is_a_matter_of_wiring() {
        let checks = check(&facts(can("error-passive", 1_000_000, 0), 1), None);
        let state = found(&checks, "state");
        assert_eq!(state.state, State::Warning);
        assert!(matches!(&state.mend[0], Mend::Do(advice) if advice.contains("120 ohm")));
    }

    #[test]
    fn a_virtual_interface_has_no_bit_timing_to_find_fault_with() {
        let mut vcan = facts(vcan(), 0x4_00C1);
        vcan.name = "vcan0".into();
        let checks = check(&vcan, Some(1_000_000));
        assert!(checks.iter().all(|c| c.state == State::Ok), "{checks:?}");
        assert_eq!(found(&checks, "link").found, "up, vcan");
        vcan.sysfs.as_mut().unwrap().flags = 0x80;
        assert_eq!(
            command(found(&check(&vcan, None), "link")),
            "sudo ip link set vcan0 up"
        );
    }

    #[test]
    fn an_interface_that_is_not_there_is_an_error_with_what_is_there() {
        let facts = |name: &str| LinkFacts {
            name: name.into(),
            sysfs: None,
            details: Err(String::new()),
            others: vec!["can3".into()],
        };
        let can = &check(&facts("can0"), None)[0];
        assert_eq!(can.state, State::Error);
        assert!(matches!(&can.mend[0], Mend::Do(text) if text.contains("can3")));
        assert!(command(&check(&facts("vcan1"), None)[0]).contains("ip link add vcan1 type vcan"));
        assert!(command(&check(&facts("slcan0"), None)[0]).starts_with("sudo slcand"));
    }

    #[test]
    fn where_the_kernel_may_not_be_asked_the_rest_is_still_said() {
        let mut facts = facts(vcan(), 1);
        facts.details = Err("netlink: EPERM".into());
        let checks = check(&facts, None);
        assert_eq!(found(&checks, "link").state, State::Ok);
        let timing = found(&checks, "bit timing");
        assert_eq!(timing.state, State::Skipped);
        assert!(timing.found.contains("EPERM"), "{}", timing.found);
    }

    #[test]
    fn an_interface_of_another_kind_is_refused_and_lost_frames_are_told() {
        let mut ethernet = facts(vcan(), 1);
        ethernet.sysfs.as_mut().unwrap().kind = 1;
        assert!(check(&ethernet, None)[0].found.contains("not a CAN interface"));
        let mut lossy = facts(vcan(), 1);
        lossy.sysfs.as_mut().unwrap().rx_over_errors = 7;
        lossy.sysfs.as_mut().unwrap().tx_queue_len = Some(10);
        let checks = check(&lossy, None);
        assert!(
            found(&checks, "lost frames")
                .found
                .starts_with("7 lost in the controller")
        );
        assert!(command(found(&checks, "txqueuelen")).ends_with("txqueuelen 100"));
    }
}
