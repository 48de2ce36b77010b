//! What sysfs and `ip` say of the CAN interfaces.
//!
//! Whether an interface exists, is CAN and is up, and what it has counted, is in sysfs. Bit timing, controller state and
//! `restart-ms` are only told by netlink, which `ip -json -details` prints; without `ip` these stay unknown and the report
//! says so.

use serde_json::Value;
use std::path::Path;
use std::process::Command;

/// `ARPHRD_CAN` of `linux/if_arp.h`.
pub(super) const CAN_TYPE: u32 = 280;

/// An interface of the configuration.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::doctor) struct LinkFacts {
    pub(in crate::doctor) name: String,
    /// What sysfs has of it; `None` where there is no interface of that name.
    pub(in crate::doctor) sysfs: Option<SysfsLink>,
    /// What `ip` tells of it, or why nothing.
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

/// What `ip -json -details` knows beyond that.
#[derive(Debug, Default, Clone, PartialEq)]
pub(in crate::doctor) struct LinkDetails {
    /// `can`, `vcan`, `vxcan`, `slcan`.
    pub(in crate::doctor) kind: String,
    /// Such as `ERROR-ACTIVE`; virtual interfaces have none.
    pub(in crate::doctor) state: Option<String>,
    pub(in crate::doctor) bitrate: Option<u64>,
    pub(in crate::doctor) sample_point: Option<f64>,
    pub(in crate::doctor) restart_ms: Option<u64>,
    /// Error counters of the controller, transmit and receive.
    pub(in crate::doctor) errors: Option<[u64; 2]>,
    /// How often the controller went bus-off and was restarted.
    pub(in crate::doctor) bus_off: u64,
    pub(in crate::doctor) restarts: u64,
}

impl LinkFacts {
    /// Looks at an interface; `root` is `/` but in tests.
    pub(in crate::doctor) fn read(root: &Path, name: &str) -> Self {
        let net = root.join("sys/class/net");
        let sysfs = SysfsLink::read(&net.join(name));
        let details = match sysfs {
            Some(_) => ask_ip(name),
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
    pub(in crate::doctor) fn bitrate(&self) -> Option<u64> {
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
pub(in crate::doctor) fn can_interfaces(net: &Path) -> Vec<String> {
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

fn ask_ip(name: &str) -> Result<LinkDetails, String> {
    let said = Command::new("ip")
        .args(["-json", "-details", "-statistics", "link", "show", "dev", name])
        .output();
    match said {
        Err(error) => Err(format!("the command `ip` cannot be run ({error})")),
        Ok(output) if !output.status.success() => {
            Err(String::from_utf8_lossy(&output.stderr).trim().to_string())
        }
        Ok(output) => parse(&String::from_utf8_lossy(&output.stdout)),
    }
}

/// The answer of `ip -json -details link show dev NAME`.
pub(in crate::doctor) fn parse(text: &str) -> Result<LinkDetails, String> {
    let bad = |why: &str| format!("`ip -json` of this machine says something unexpected ({why})");
    let value: Value = serde_json::from_str(text).map_err(|e| bad(&e.to_string()))?;
    let link = value
        .as_array()
        .and_then(|links| links.iter().find(|link| link["ifname"].is_string()))
        .ok_or_else(|| bad("no interface in it"))?;
    let info = &link["linkinfo"];
    let data = &info["info_data"];
    let timing = &data["bittiming"];
    // The sample point is a text in some versions of iproute2 and a number in others.
    let sample_point = &timing["sample_point"];
    let sample_point = sample_point
        .as_f64()
        .or_else(|| sample_point.as_str()?.parse().ok());
    let errors = match [&data["berr_counter"]["tx"], &data["berr_counter"]["rx"]].map(Value::as_u64) {
        [Some(tx), Some(rx)] => Some([tx, rx]),
        _ => None,
    };
    let counted = |key: &str| info["info_xstats"][key].as_u64().unwrap_or(0);
    Ok(LinkDetails {
        kind: info["info_kind"].as_str().unwrap_or("").to_string(),
        state: data["state"].as_str().map(str::to_string),
        // An adapter whose rates are a list has no bit timing.
        bitrate: [&timing["bitrate"], &data["bittiming_bitrate"]]
            .into_iter()
            .find_map(Value::as_u64)
            .filter(|rate| *rate > 0),
        sample_point,
        // A delay of 0 is left out where the controller is not restarted.
        restart_ms: (info["info_kind"] == "can").then(|| data["restart_ms"].as_u64().unwrap_or(0)),
        errors,
        bus_off: counted("bus_off"),
        restarts: counted("restarts"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_adapter_with_a_list_of_rates_has_a_bit_rate() {
        let text = r#"[{"ifname":"can0","linkinfo":{"info_kind":"can","info_data":{"state":"ERROR-ACTIVE",
            "restart_ms":100,"bittiming_bitrate":500000,"bitrate_const":[125000,500000,1000000]}}}]"#;
        let details = parse(text).unwrap();
        assert_eq!((details.bitrate, details.sample_point), (Some(500_000), None));
    }

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
