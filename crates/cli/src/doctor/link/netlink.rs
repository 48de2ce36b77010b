//! What the kernel tells of a CAN interface over netlink: its kind, controller state, bit timing
//! and restarts.
//!
//! `ip -details -statistics link show` asks the same question. socketcan's `nl::CanInterface` does
//! too, but keeps neither the kind nor the counts of bus-off and restarts of the answer, which are
//! nowhere else.

use anyhow::{Context, bail};
use nix::libc;
use nix::net::if_::if_nametoindex;
use nix::sys::socket::{AddressFamily, MsgFlags, SockFlag, SockProtocol, SockType, recv, send, socket};
use std::io;
use std::os::fd::AsRawFd;

/// Bytes of `struct nlmsghdr` and of `struct ifinfomsg`, which follows it.
const HEADER: usize = 16;
const LINK: usize = 16;
/// More than the kernel tells of one interface.
const ANSWER: usize = 64 << 10;
/// Bits of an attribute's type that only say how it is to be read.
const TYPE_FLAGS: u16 = 0xC000;

/// What is known of an interface beyond sysfs.
#[derive(Debug, Default, Clone, PartialEq)]
pub(in crate::doctor) struct LinkDetails {
    /// `can`, `vcan`, `vxcan`, `slcan`.
    pub(super) kind: String,
    /// Such as `error-active`; virtual interfaces have none.
    pub(super) state: Option<&'static str>,
    pub(super) bitrate: Option<u64>,
    /// 0 to 1; adapters that only know a list of bit rates have none.
    pub(super) sample_point: Option<f64>,
    pub(super) restart_ms: Option<u32>,
    /// Error counters of the controller, transmit and receive.
    pub(super) errors: Option<[u16; 2]>,
    /// How often the controller went bus-off and was restarted.
    pub(super) bus_off: u32,
    pub(super) restarts: u32,
}

impl LinkDetails {
    /// Asks the kernel.
    pub(super) fn ask(name: &str) -> anyhow::Result<Self> {
        let index = if_nametoindex(name)?;
        let (family, protocol) = (AddressFamily::Netlink, SockProtocol::NetlinkRoute);
        let socket = socket(family, SockType::Raw, SockFlag::SOCK_CLOEXEC, protocol).context("netlink")?;
        let mut question = [0; HEADER + LINK];
        question[..4].copy_from_slice(&((HEADER + LINK) as u32).to_ne_bytes());
        question[4..6].copy_from_slice(&libc::RTM_GETLINK.to_ne_bytes());
        question[6..8].copy_from_slice(&(libc::NLM_F_REQUEST as u16).to_ne_bytes());
        question[HEADER + 4..HEADER + 8].copy_from_slice(&index.to_ne_bytes());
        send(socket.as_raw_fd(), &question, MsgFlags::empty()).context("netlink")?;
        let mut answer = vec![0; ANSWER];
        let length = recv(socket.as_raw_fd(), &mut answer, MsgFlags::empty()).context("netlink")?;
        Self::parse(&answer[..length])
    }

    /// The answer to `RTM_GETLINK`.
    fn parse(answer: &[u8]) -> anyhow::Result<Self> {
        let (header, message) = answer.split_at_checked(HEADER).context("netlink: no answer")?;
        let kind = u16::from_ne_bytes([header[4], header[5]]);
        if i32::from(kind) == libc::NLMSG_ERROR {
            let error = word(message, 0).unwrap_or(0) as i32;
            bail!("netlink: {}", io::Error::from_raw_os_error(-error));
        }
        if kind != libc::RTM_NEWLINK {
            bail!("netlink: an answer of type {kind}");
        }
        let mut details = Self::default();
        let mut restart_ms = 0;
        let link = attributes(message.get(LINK..).unwrap_or_default());
        let infos = link.filter(|(kind, _)| *kind == libc::IFLA_LINKINFO);
        for (kind, info) in infos.flat_map(|(_, value)| attributes(value)) {
            match kind {
                libc::IFLA_INFO_KIND => {
                    details.kind = String::from_utf8_lossy(info).trim_end_matches('\0').into();
                }
                // `struct can_device_stats`.
                libc::IFLA_INFO_XSTATS => {
                    details.bus_off = word(info, 3).unwrap_or(0);
                    details.restarts = word(info, 5).unwrap_or(0);
                }
                libc::IFLA_INFO_DATA => {
                    for (kind, value) in attributes(info) {
                        match (i32::from(kind), word(value, 0)) {
                            // `struct can_bittiming`; an interface that has none yet says 0.
                            (libc::IFLA_CAN_BITTIMING, rate) => {
                                details.bitrate = rate.filter(|r| *r > 0).map(u64::from);
                                let point = word(value, 1).filter(|p| *p > 0);
                                details.sample_point = point.map(|p| f64::from(p) / 1000.0);
                            }
                            (libc::IFLA_CAN_STATE, state) => details.state = state.and_then(state_name),
                            (libc::IFLA_CAN_RESTART_MS, Some(ms)) => restart_ms = ms,
                            // `struct can_berr_counter`.
                            (libc::IFLA_CAN_BERR_COUNTER, Some(_)) => {
                                let count = |i| u16::from_ne_bytes([value[i], value[i + 1]]);
                                details.errors = Some([count(0), count(2)]);
                            }
                            _ => {}
                        }
                    }
                }
                _ => {}
            }
        }
        details.restart_ms = (details.kind == "can").then_some(restart_ms);
        Ok(details)
    }
}

fn state_name(state: u32) -> Option<&'static str> {
    let names = [
        "error-active",
        "error-warning",
        "error-passive",
        "bus-off",
        "stopped",
        "sleeping",
    ];
    names.get(state as usize).copied()
}

/// Word `index` of a structure of 32-bit words.
fn word(bytes: &[u8], index: usize) -> Option<u32> {
    let word = bytes.get(4 * index..)?.first_chunk()?;
    Some(u32::from_ne_bytes(*word))
}

/// Types and values of the attributes in these bytes, each of which begins at a multiple of four.
fn attributes(mut bytes: &[u8]) -> impl Iterator<Item = (u16, &[u8])> {
    std::iter::from_fn(move || {
        let [a, b, c, d] = *bytes.first_chunk()?;
        let length = usize::from(u16::from_ne_bytes([a, b]));
        let value = bytes.get(4..length)?;
        bytes = bytes.get(length.next_multiple_of(4)..).unwrap_or_default();
        Some((u16::from_ne_bytes([c, d]) & !TYPE_FLAGS, value))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn attribute(kind: u16, value: &[u8]) -> Vec<u8> {
        let length = 4 + value.len() as u16;
        let mut bytes = [length.to_ne_bytes(), kind.to_ne_bytes()].concat();
        bytes.extend(value);
        bytes.resize(bytes.len().next_multiple_of(4), 0);
        bytes
    }

    fn words(words: &[u32]) -> Vec<u8> {
        words.iter().flat_map(|w| w.to_ne_bytes()).collect()
    }

    /// An answer with these attributes of `IFLA_LINKINFO`, after one of another kind and of odd length.
    fn answer(infos: &[(u16, &[u8])]) -> Vec<u8> {
        let infos: Vec<u8> = infos.iter().flat_map(|(k, v)| attribute(*k, v)).collect();
        let mut bytes = vec![0; HEADER + LINK];
        bytes[4..6].copy_from_slice(&libc::RTM_NEWLINK.to_ne_bytes());
        bytes.extend(attribute(libc::IFLA_IFNAME, b"can0\0"));
        bytes.extend(attribute(libc::IFLA_LINKINFO | 0x8000, &infos));
        bytes
    }

    fn can(data: &[(i32, &[u8])]) -> LinkDetails {
        let data: Vec<u8> = data.iter().flat_map(|(k, v)| attribute(*k as u16, v)).collect();
        let bytes = answer(&[
            (libc::IFLA_INFO_KIND, b"can\0"),
            (libc::IFLA_INFO_XSTATS, &words(&[0, 1, 1, 2, 0, 3])),
            (libc::IFLA_INFO_DATA, &data),
        ]);
        LinkDetails::parse(&bytes).unwrap()
    }

    #[test]
    fn an_adapter_tells_its_state_timing_and_restarts() {
        let details = can(&[
            (
                libc::IFLA_CAN_BITTIMING,
                &words(&[1_000_000, 750, 62, 5, 6, 4, 3, 3]),
            ),
            (libc::IFLA_CAN_STATE, &words(&[2])),
            (libc::IFLA_CAN_RESTART_MS, &words(&[100])),
            (libc::IFLA_CAN_BERR_COUNTER, &words(&[0])),
        ]);
        let wanted = LinkDetails {
            kind: "can".into(),
            state: Some("error-passive"),
            bitrate: Some(1_000_000),
            sample_point: Some(0.75),
            restart_ms: Some(100),
            errors: Some([0, 0]),
            bus_off: 2,
            restarts: 3,
        };
        assert_eq!(details, wanted);
    }

    #[test]
    fn an_adapter_with_a_list_of_rates_has_a_bit_rate_and_no_sample_point() {
        let listed = can(&[(libc::IFLA_CAN_BITTIMING, &words(&[500_000, 0, 0, 0, 0, 0, 0, 0]))]);
        assert_eq!((listed.bitrate, listed.sample_point), (Some(500_000), None));
        let unset = can(&[(libc::IFLA_CAN_BITTIMING, &words(&[0; 8]))]);
        assert_eq!((unset.bitrate, unset.restart_ms), (None, Some(0)));
    }

    #[test]
    fn a_virtual_interface_has_a_kind_and_nothing_else() {
        let details = LinkDetails::parse(&answer(&[(libc::IFLA_INFO_KIND, b"vcan\0")])).unwrap();
        let wanted = LinkDetails {
            kind: "vcan".into(),
            ..LinkDetails::default()
        };
        assert_eq!(details, wanted);
    }

    #[test]
    fn what_the_kernel_refuses_or_cuts_off_is_no_panic() {
        let mut refused = vec![0; HEADER];
        refused[4..6].copy_from_slice(&(libc::NLMSG_ERROR as u16).to_ne_bytes());
        refused.extend((-libc::ENODEV).to_ne_bytes());
        let why = LinkDetails::parse(&refused).unwrap_err().to_string();
        assert!(why.contains("No such device"), "{why}");
        let whole = answer(&[(libc::IFLA_INFO_XSTATS, &[9; 24])]);
        for length in 0..whole.len() {
            let _ = LinkDetails::parse(&whole[..length]);
        }
    }

    #[test]
    fn the_kernel_answers_for_an_interface_that_every_machine_has() {
        let details = LinkDetails::ask("lo").unwrap();
        assert_eq!((details.state, details.bitrate), (None, None));
        assert!(LinkDetails::ask("taxel-none").is_err());
    }
}
