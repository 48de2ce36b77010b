//! This machine: CAN in the kernel, socket buffers, real-time limits, the processor's governor.

mod facts;

pub(super) use facts::MachineFacts;

use super::finding::Check;

const AREA: &str = "machine";
/// Bits of `CapEff` (`linux/capability.h`).
const CAP_NET_ADMIN: u32 = 12;
const CAP_IPC_LOCK: u32 = 14;
const CAP_SYS_NICE: u32 = 23;
/// Drivers whose governor `powersave` raises the clock with the load.
const SCALING_BY_THEMSELVES: [&str; 3] = ["intel_pstate", "amd-pstate-epp", "amd-pstate"];

/// What the configuration asks of the machine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Needs {
    /// Whether any source is a CAN interface.
    pub(super) can: bool,
    /// Whether any source is a socket at all.
    pub(super) sockets: bool,
    pub(super) receive_buffer_kib: u32,
    /// Priority of the tick thread, 0 for none.
    pub(super) priority: u8,
    pub(super) lock_memory: bool,
}

/// What is to be said of the machine.
pub(super) fn check(facts: &MachineFacts, needs: &Needs) -> Vec<Check> {
    let mut checks = vec![check_af_can(facts, needs.can)];
    if needs.sockets {
        checks.extend(check_rmem(facts, needs));
    }
    checks.extend(check_realtime(facts, needs));
    if needs.lock_memory {
        checks.push(check_memlock(facts));
    }
    if let Some(governor) = &facts.governor {
        let driver = facts.scaling_driver.as_deref().unwrap_or("");
        let slow = governor == "powersave" && !SCALING_BY_THEMSELVES.contains(&driver);
        checks.push(match slow {
            false => Check::ok(AREA, "cpu governor", "", governor),
            true => Check::warning(
                AREA,
                "cpu governor",
                "",
                "powersave: the processor stays at its lowest clock",
            )
            .wanted("performance or schedutil")
            .run("echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor"),
        });
    }
    checks
}

/// Whether the kernel has CAN sockets, which a CAN interface `is_needed` for.
pub(super) fn check_af_can(facts: &MachineFacts, is_needed: bool) -> Check {
    const NAME: &str = "AF_CAN";
    let Some(why) = &facts.no_af_can else {
        return Check::ok(AREA, NAME, "", "the kernel has CAN sockets");
    };
    let found = format!("kernel {} has no CAN sockets ({why})", facts.kernel);
    if !is_needed {
        return Check::ok(AREA, NAME, "", format!("{found}, and no source here needs them"));
    }
    let check = Check::error(AREA, NAME, "", found);
    if facts.in_container {
        return check
            .advise("this is a container, which shares the kernel of its host: load the modules there")
            .run("sudo modprobe -a can can_raw can_dev vcan    # on the host")
            .advise(
                "and run the container with --network=host, since interfaces live in a network namespace",
            );
    }
    if facts.has_can_module {
        return check.run("sudo modprobe -a can can_raw can_dev vcan");
    }
    let check = match facts.has_modules {
        true => check.advise("this kernel came without CAN modules; on Ubuntu and its cloud images they are a package of their own")
            .run(format!("sudo apt-get install linux-modules-extra-{} && sudo modprobe -a can can_raw can_dev vcan", facts.kernel)),
        false => check.advise(format!(
            "no modules of kernel {} are installed here (a virtual machine or sandbox with a kernel of its own, or one that \
             was updated and not yet booted): boot a stock kernel of your distribution",
            facts.kernel
        )),
    };
    check.advise(
        "until then, `udp:` sources of python-can's udp_multicast and recordings (`log:`) work without it",
    )
}

fn check_rmem(facts: &MachineFacts, needs: &Needs) -> Option<Check> {
    const NAME: &str = "net.core.rmem_max";
    let wanted = u64::from(needs.receive_buffer_kib) * 1024;
    let max = facts.rmem_max?;
    if max >= wanted {
        return Some(Check::ok(AREA, NAME, "", format!("{max} bytes")));
    }
    // A frame takes some 767 bytes of queue: 212,992 bytes, doubled by the kernel, were measured to hold 278.
    let frames = 2 * max / 1532;
    let found = format!("{max} bytes: a burst of more than {frames} CAN frames is lost");
    let check = Check::warning(AREA, NAME, "", found)
        .wanted(format!(
            "{wanted}, as [can] receive_buffer_kib = {}",
            needs.receive_buffer_kib
        ))
        .run(format!("sudo sysctl net.core.rmem_max={wanted}"))
        .run("sudo install -m 644 systemd/05-taxeld.sysctl.conf /usr/lib/sysctl.d/    # for good");
    // The service has no such capability, whoever runs the doctor.
    Some(match facts.may(CAP_NET_ADMIN) && facts.unit.is_none() {
        true => Check::ok(
            AREA,
            NAME,
            "",
            format!("{max} bytes, which CAP_NET_ADMIN may exceed"),
        ),
        false => check,
    })
}

fn check_realtime(facts: &MachineFacts, needs: &Needs) -> Vec<Check> {
    const NAME: &str = "real-time priority";
    let priority = u64::from(needs.priority);
    if priority == 0 {
        return vec![Check::ok(
            AREA,
            NAME,
            "",
            "not asked for ([realtime] priority = 0)",
        )];
    }
    let mut checks = Vec::new();
    match &facts.unit {
        Some((path, Some(limit))) if *limit >= priority => {
            let found = format!("LimitRTPRIO={limit} in {}", path.display());
            checks.push(Check::ok(AREA, NAME, "taxeld.service", found));
        }
        Some((path, limit)) => {
            let found = match limit {
                Some(limit) => format!("LimitRTPRIO={limit}"),
                None => "no LimitRTPRIO".into(),
            };
            let check = Check::warning(
                AREA,
                NAME,
                "taxeld.service",
                format!("{found} in {}", path.display()),
            );
            checks.push(check.wanted(format!("at least {priority}")).run(
                "printf '[Service]\\nLimitRTPRIO=20\\n' | sudo install -D -m 644 /dev/stdin \
                 /etc/systemd/system/taxeld.service.d/realtime.conf && sudo systemctl daemon-reload",
            ));
        }
        None if facts.may(CAP_SYS_NICE) => checks.push(Check::ok(AREA, NAME, "", "allowed (CAP_SYS_NICE)")),
        None => {
            let limit = facts.rtprio.unwrap_or(0);
            checks.push(match limit >= priority {
                true => Check::ok(AREA, NAME, "", format!("up to {limit} allowed")),
                false => Check::warning(AREA, NAME, "", format!("this user may have up to {limit}"))
                    .wanted(format!("{priority}, or images wait while the machine is busy"))
                    .run("echo \"$USER - rtprio 20\" | sudo tee /etc/security/limits.d/taxeld.conf    # then log in anew")
                    .advise("or run taxeld as a service: systemd/taxeld.service has LimitRTPRIO=20"),
            });
        }
    }
    if facts.sched_rt_runtime_us == Some(0) {
        checks.push(
            Check::warning(
                AREA,
                "sched_rt_runtime_us",
                "",
                "0: real-time threads get no time at all",
            )
            .wanted("950000")
            .run("sudo sysctl kernel.sched_rt_runtime_us=950000"),
        );
    }
    checks
}

fn check_memlock(facts: &MachineFacts) -> Check {
    const NAME: &str = "locked memory";
    if facts.may(CAP_IPC_LOCK) {
        return Check::ok(AREA, NAME, "", "allowed (CAP_IPC_LOCK)");
    }
    match facts.memlock {
        Some(u64::MAX) => Check::ok(AREA, NAME, "", "unlimited"),
        limit => Check::warning(
            AREA,
            NAME,
            "",
            format!("limited to {} KiB", limit.unwrap_or(0) / 1024),
        )
        .wanted("unlimited, for [realtime] lock_memory = true")
        .run("echo \"$USER - memlock unlimited\" | sudo tee -a /etc/security/limits.d/taxeld.conf    # then log in anew"),
    }
}

#[cfg(test)]
mod tests {
    use super::super::finding::State;
    use super::*;
    use std::path::PathBuf;

    const NEEDS: Needs = Needs {
        can: true,
        sockets: true,
        receive_buffer_kib: 4096,
        priority: 10,
        lock_memory: true,
    };

    fn good() -> MachineFacts {
        MachineFacts {
            kernel: "6.1.0-56-amd64".into(),
            has_modules: true,
            has_can_module: true,
            rmem_max: Some(4 << 20),
            rtprio: Some(20),
            memlock: Some(u64::MAX),
            sched_rt_runtime_us: Some(950_000),
            ..MachineFacts::default()
        }
    }

    fn no_can(change: impl FnOnce(&mut MachineFacts)) -> MachineFacts {
        let mut facts = good();
        facts.no_af_can = Some("Address family not supported by protocol".into());
        change(&mut facts);
        facts
    }

    fn with(change: impl FnOnce(&mut MachineFacts)) -> MachineFacts {
        let mut facts = good();
        change(&mut facts);
        facts
    }

    #[test]
    fn a_good_machine_is_told_so() {
        let checks = check(&good(), &NEEDS);
        assert!(checks.iter().all(|c| c.state == State::Ok), "{checks:?}");
        let names: Vec<&str> = checks.iter().map(|c| c.name.as_ref()).collect();
        assert_eq!(
            names,
            [
                "AF_CAN",
                "net.core.rmem_max",
                "real-time priority",
                "locked memory"
            ]
        );
    }

    #[test]
    fn each_thing_that_is_wrong_has_its_state_and_what_mends_it() {
        let unit = |limit| Some((PathBuf::from("/etc/systemd/system/taxeld.service"), limit));
        for (facts, name, state, mend) in [
            (
                no_can(|_| {}),
                "AF_CAN",
                State::Error,
                "sudo modprobe -a can can_raw",
            ),
            (
                no_can(|f| f.in_container = true),
                "AF_CAN",
                State::Error,
                "on the host",
            ),
            (
                no_can(|f| f.has_can_module = false),
                "AF_CAN",
                State::Error,
                "linux-modules-extra-6.1.0-56-amd64",
            ),
            (
                no_can(|f| (f.has_modules, f.has_can_module) = (false, false)),
                "AF_CAN",
                State::Error,
                "boot a stock kernel",
            ),
            (
                with(|f| f.rmem_max = Some(212_992)),
                "net.core.rmem_max",
                State::Warning,
                "sudo sysctl net.core.rmem_max=4194304",
            ),
            (
                with(|f| f.rtprio = Some(0)),
                "real-time priority",
                State::Warning,
                "rtprio 20",
            ),
            (
                with(|f| f.unit = unit(None)),
                "real-time priority",
                State::Warning,
                "LimitRTPRIO=20",
            ),
            (
                with(|f| f.sched_rt_runtime_us = Some(0)),
                "sched_rt_runtime_us",
                State::Warning,
                "kernel.sched_rt_runtime_us=950000",
            ),
            (
                with(|f| f.memlock = Some(8 << 20)),
                "locked memory",
                State::Warning,
                "memlock unlimited",
            ),
            (
                with(|f| f.governor = Some("powersave".into())),
                "cpu governor",
                State::Warning,
                "echo performance",
            ),
        ] {
            let checks = check(&facts, &NEEDS);
            let check = checks.iter().find(|c| c.name == name).unwrap();
            assert_eq!(check.state, state, "{facts:?}");
            assert!(check.mend_text().contains(mend), "{name}: {}", check.mend_text());
        }
    }

    #[test]
    fn what_is_not_needed_is_no_error() {
        let needs = Needs {
            can: false,
            sockets: false,
            priority: 0,
            lock_memory: false,
            ..NEEDS
        };
        let facts = no_can(|f| (f.rmem_max, f.rtprio, f.memlock) = (Some(1), Some(0), Some(0)));
        let checks = check(&facts, &needs);
        assert!(checks.iter().all(|c| c.state != State::Error), "{checks:?}");
        assert!(
            checks
                .iter()
                .all(|c| c.name != "net.core.rmem_max" && c.name != "locked memory")
        );
    }

    #[test]
    fn capabilities_and_drivers_excuse() {
        let nice = with(|f| (f.rtprio, f.capabilities) = (Some(0), 1 << CAP_SYS_NICE));
        let admin = with(|f| (f.rmem_max, f.capabilities) = (Some(1), 1 << CAP_NET_ADMIN));
        let pstate = with(|f| {
            (f.governor, f.scaling_driver) = (Some("powersave".into()), Some("intel_pstate".into()));
        });
        let unit = with(|f| {
            f.rtprio = Some(0);
            f.unit = Some((PathBuf::from("/u"), Some(20)));
        });
        for facts in [nice, admin, pstate, unit] {
            let checks = check(&facts, &NEEDS);
            assert!(checks.iter().all(|c| c.state == State::Ok), "{checks:?}");
        }
    }
}
