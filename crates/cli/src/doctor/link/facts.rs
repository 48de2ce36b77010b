//! What sysfs and the kernel say of the CAN interfaces.
//!
//! Whether an interface exists, is CAN and is up, and what it has counted, is in sysfs. Bit timing,
//! controller state and `restart-ms` are only told by netlink; where that may not be asked these
//! stay unknown and the report says so.

use super::netlink::LinkDetails;
use std::path::Path;

/// `ARPHRD_CAN` of `linux/if_arp.h`.
pub(super) const CAN_TYPE: u32 = 280;

/// An interface of the configuration.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LinkFacts {
    pub(in crate::doctor) name: String,
    /// What sysfs has of it; `None` where there is no interface of that name.
    pub(in crate::doctor) sysfs: Option<SysfsLink>,
    /// What netlink tells of it, or why nothing.
    pub(in crate::doctor) details: Result<LinkDetails, String>,
    /// The CAN interfaces there are.
    pub(in crate::doctor) others: Vec<String>,
}

#[derive(Debug, Default, Clone, PartialEq)]
pub(in crate::doctor) struct SysfsLink {
    /// Kind of hardware address, 280 for CAN.
    pub(in crate::doctor) kind: u32,
    pub(in crate::doctor) flags: u32,
    pub(in crate::doctor) tx_queue_len: Option<u64>,
    /// Counts of `statistics`: frames received, lost in the controller, lost in the kernel.
    pub(in crate::doctor) rx_packets: u64,
    pub(in crate::doctor) rx_over_errors: u64,
    pub(in crate::doctor) rx_dropped: u64,
}

impl LinkFacts {
    /// Looks at an interface; `root` is `/` but in tests.
    pub(crate) fn read(root: &Path, name: &str) -> Self {
        let net = root.join("sys/class/net");
        let sysfs = SysfsLink::read(&net.join(name));
        let details = match sysfs {
            Some(_) => LinkDetails::ask(name).map_err(|e| format!("{e:#}")),
            None => Err("there is no such interface".into()),
        };
        Self {
            name: name.into(),
            sysfs,
            details,
            others: can_interfaces(&net),
        }
    }

    /// The bit rate of the interface, where it is known.
    pub(crate) fn bitrate(&self) -> Option<u64> {
        self.details.as_ref().ok()?.bitrate
    }
}

impl SysfsLink {
    fn read(dir: &Path) -> Option<Self> {
        let text = |file: &str| std::fs::read_to_string(dir.join(file)).ok();
        let count = |file: &str| text(&format!("statistics/{file}")).and_then(|t| t.trim().parse().ok());
        let flags = text("flags")?;
        Some(Self {
            kind: text("type")?.trim().parse().ok()?,
            flags: u32::from_str_radix(flags.trim().trim_start_matches("0x"), 16).ok()?,
            tx_queue_len: text("tx_queue_len").and_then(|t| t.trim().parse().ok()),
            rx_packets: count("rx_packets").unwrap_or(0),
            rx_over_errors: count("rx_over_errors").unwrap_or(0),
            rx_dropped: count("rx_dropped").unwrap_or(0),
        })
    }
}

/// The CAN interfaces in `/sys/class/net`.
pub(crate) fn can_interfaces(net: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(net)
        .into_iter()
        .flatten()
        .flatten()
        .filter(|entry| SysfsLink::read(&entry.path()).is_some_and(|link| link.kind == CAN_TYPE))
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sysfs_is_read_as_the_kernel_writes_it() {
        let root = tempfile::TempDir::new().unwrap();
        let dir = root.path().join("sys/class/net/can7");
        std::fs::create_dir_all(dir.join("statistics")).unwrap();
        for (file, text) in [
            ("type", "280\n"),
            ("flags", "0x400c1\n"),
            ("tx_queue_len", "10\n"),
            ("statistics/rx_packets", "1234\n"),
            ("statistics/rx_over_errors", "2\n"),
            ("statistics/rx_dropped", "0\n"),
        ] {
            std::fs::write(dir.join(file), text).unwrap();
        }
        let link = SysfsLink::read(&dir).unwrap();
        assert_eq!(
            (link.kind, link.flags, link.rx_packets, link.rx_over_errors),
            (280, 0x4_00C1, 1234, 2)
        );
        let facts = LinkFacts::read(root.path(), "can8");
        assert_eq!((facts.sysfs, facts.others), (None, vec!["can7".to_string()]));
    }
}
