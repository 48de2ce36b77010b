//! What this machine says of itself.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use taxel_can::{OpenError, SourceAddress, SourceOptions};

/// What the machine says of itself.
#[derive(Debug, Default, Clone, PartialEq)]
pub(in crate::doctor) struct MachineFacts {
    /// Why there are no CAN sockets; `None` where there are.
    pub(in crate::doctor) no_af_can: Option<String>,
    /// Release of the kernel, such as `6.1.0-56-amd64`.
    pub(in crate::doctor) kernel: String,
    /// Whether modules for that kernel are installed, and whether `can-raw` is among them.
    pub(in crate::doctor) has_modules: bool,
    pub(in crate::doctor) has_can_module: bool,
    pub(in crate::doctor) in_container: bool,
    pub(in crate::doctor) rmem_max: Option<u64>,
    /// Effective capabilities.
    pub(in crate::doctor) capabilities: u64,
    /// Soft limit of real-time priority.
    pub(in crate::doctor) rtprio: Option<u64>,
    /// Soft limit of locked memory, bytes.
    pub(in crate::doctor) memlock: Option<u64>,
    pub(in crate::doctor) sched_rt_runtime_us: Option<i64>,
    pub(in crate::doctor) governor: Option<String>,
    pub(in crate::doctor) scaling_driver: Option<String>,
    /// The installed unit, and what it sets `LimitRTPRIO` to.
    pub(in crate::doctor) unit: Option<(PathBuf, Option<u64>)>,
}

impl MachineFacts {
    /// Looks at the machine; `root` is `/` but in tests.
    pub(in crate::doctor) fn read(root: &Path) -> Self {
        let text = |path: &str| std::fs::read_to_string(root.join(path)).ok();
        let kernel = text("proc/sys/kernel/osrelease")
            .unwrap_or_default()
            .trim()
            .to_string();
        let modules = root.join("lib/modules").join(&kernel);
        let listed = |file: &str| {
            std::fs::read_to_string(modules.join(file)).is_ok_and(|list| list.contains("/can-raw.ko"))
        };
        let limits = text("proc/self/limits").unwrap_or_default();
        let unit = [
            "etc/systemd/system",
            "usr/lib/systemd/system",
            "lib/systemd/system",
        ]
        .iter()
        .map(|dir| root.join(dir).join("taxeld.service"))
        .find(|path| path.is_file());
        let cpu = "sys/devices/system/cpu/cpu0/cpufreq";
        let word = |path: &str| text(path).map(|t| t.trim().to_string());
        Self {
            no_af_can: None,
            has_modules: !kernel.is_empty() && modules.is_dir(),
            has_can_module: listed("modules.dep") || listed("modules.builtin"),
            kernel,
            in_container: root.join(".dockerenv").exists()
                || root.join("run/.containerenv").exists()
                || text("proc/1/environ").is_some_and(|e| e.split('\0').any(|v| v.starts_with("container="))),
            rmem_max: word("proc/sys/net/core/rmem_max").and_then(|t| t.parse().ok()),
            capabilities: capabilities(&text("proc/self/status").unwrap_or_default()),
            rtprio: soft_limit(&limits, "Max realtime priority"),
            memlock: soft_limit(&limits, "Max locked memory"),
            sched_rt_runtime_us: word("proc/sys/kernel/sched_rt_runtime_us").and_then(|t| t.parse().ok()),
            governor: word(&format!("{cpu}/scaling_governor")),
            scaling_driver: word(&format!("{cpu}/scaling_driver")),
            unit: unit.map(|path| {
                let text = unit_with_drop_ins(root, &path);
                (path, limit_rtprio(&text))
            }),
        }
    }

    /// Tries to have a CAN socket.
    #[must_use]
    pub(in crate::doctor) fn with_can_sockets(mut self) -> Self {
        let address = SourceAddress::Can {
            interface: "taxel-doctor".into(),
        };
        self.no_af_can = match taxel_can::open(&address, &SourceOptions::default()) {
            Err(OpenError::NotSupported { source }) => Some(source.to_string()),
            Err(OpenError::Socket { source, .. }) => Some(source.to_string()),
            _ => None,
        };
        self
    }

    pub(super) fn may(&self, capability: u32) -> bool {
        self.capabilities >> capability & 1 == 1
    }
}

fn capabilities(status: &str) -> u64 {
    status
        .lines()
        .find_map(|line| line.strip_prefix("CapEff:"))
        .and_then(|bits| u64::from_str_radix(bits.trim(), 16).ok())
        .unwrap_or(0)
}

/// The soft limit of this name in `/proc/self/limits`; `unlimited` is the largest number.
fn soft_limit(limits: &str, name: &str) -> Option<u64> {
    let line = limits.lines().find_map(|line| line.strip_prefix(name))?;
    match line.split_whitespace().next()? {
        "unlimited" => Some(u64::MAX),
        number => number.parse().ok(),
    }
}

/// A unit file and, after it, its drop-ins: what is said later counts. Drop-ins are taken by file
/// name, one in a later folder in place of one of the same name before (systemd.unit(5)).
fn unit_with_drop_ins(root: &Path, unit: &Path) -> String {
    let folders = [
        "lib/systemd/system",
        "usr/lib/systemd/system",
        "run/systemd/system",
        "etc/systemd/system",
    ];
    let mut drop_ins = BTreeMap::new();
    for folder in folders {
        let folder = root.join(folder).join("taxeld.service.d");
        for path in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let path = path.path();
            if path.extension().is_some_and(|e| e == "conf")
                && let Some(name) = path.file_name()
            {
                drop_ins.insert(name.to_os_string(), path);
            }
        }
    }
    let mut text = String::new();
    for path in std::iter::once(unit).chain(drop_ins.values().map(PathBuf::as_path)) {
        text.push_str(&std::fs::read_to_string(path).unwrap_or_default());
        text.push('\n');
    }
    text
}

fn limit_rtprio(unit: &str) -> Option<u64> {
    let value = unit
        .lines()
        .rev()
        .find_map(|line| line.trim().strip_prefix("LimitRTPRIO="))?;
    match value.trim() {
        "infinity" => Some(u64::MAX),
        number => number.split(':').next()?.parse().ok(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn proc_is_read_as_the_kernel_writes_it() {
        let limits = "Limit                     Soft Limit           Hard Limit           Units     \n\
                      Max locked memory         8388608              8388608              bytes     \n\
                      Max realtime priority     0                    20                   \n\
                      Max cpu time              unlimited            unlimited            seconds   \n";
        assert_eq!(soft_limit(limits, "Max realtime priority"), Some(0));
        assert_eq!(soft_limit(limits, "Max locked memory"), Some(8_388_608));
        assert_eq!(soft_limit(limits, "Max cpu time"), Some(u64::MAX));
        assert_eq!(soft_limit("", "Max cpu time"), None);
        assert_eq!(
            capabilities("Name:\tx\nCapEff:\t0000000000801000\n"),
            1 << 23 | 1 << 12
        );
        for (unit, limit) in [
            ("[Service]\nLimitRTPRIO=20\n", Some(20)),
            ("LimitRTPRIO=20\nLimitRTPRIO=infinity", Some(u64::MAX)),
            ("[Service]\n", None),
        ] {
            assert_eq!(limit_rtprio(unit), limit, "{unit}");
        }
    }

    #[test]
    fn a_drop_in_of_the_unit_counts() {
        let root = tempfile::TempDir::new().unwrap();
        let write = |path: &str, text: &str| {
            let path = root.path().join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        };
        let limit = || MachineFacts::read(root.path()).unit.unwrap().1;
        write(
            "usr/lib/systemd/system/taxeld.service",
            "[Service]\nLimitRTPRIO=5",
        );
        assert_eq!(limit(), Some(5));
        write(
            "usr/lib/systemd/system/taxeld.service.d/rt.conf",
            "[Service]\nLimitRTPRIO=7\n",
        );
        assert_eq!(limit(), Some(7));
        write(
            "etc/systemd/system/taxeld.service.d/rt.conf",
            "[Service]\nLimitRTPRIO=9\n",
        );
        write("etc/systemd/system/taxeld.service.d/notes.txt", "LimitRTPRIO=1\n");
        assert_eq!(limit(), Some(9));
    }
}
