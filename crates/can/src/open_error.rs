//! Why a source cannot be opened.

use nix::errno::Errno;
use std::io;
use std::net::IpAddr;

/// Why a source cannot be opened: now, or ever ([`OpenError::is_lasting`]).
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The kernel knows no CAN sockets.
    #[error(
        "this kernel has no CAN sockets ({source}): load them with `modprobe -a can can_raw`, \
         or use a udp: source where there is no such module"
    )]
    NotSupported {
        /// What the system said.
        source: io::Error,
    },
    /// There is an interface of that name, but it is no CAN interface.
    #[error("`{interface}` is not a CAN interface; `ip -details link show type can` lists those there are")]
    NotCan {
        /// Its name.
        interface: String,
    },
    /// The process cannot have the socket.
    #[error("cannot open a CAN socket for `{interface}`: {source}")]
    Socket {
        /// The interface's name.
        interface: String,
        /// What the system said.
        source: io::Error,
    },
    /// The process may have no socket of the address family of a multicast group.
    #[error(
        "cannot open udp multicast {group}: this process can have no network socket ({source}). As a service it needs \
         the drop-in `taxeld-network.conf` of the folder `systemd` (docs/guide.md, \"Run it for months\"); elsewhere \
         the kernel was started without this version of IP"
    )]
    NoNetwork {
        /// The group.
        group: IpAddr,
        /// What the system said.
        source: io::Error,
    },
    /// The recording cannot be read, or the multicast group not be joined.
    #[error("cannot {what}: {source}")]
    Io {
        /// What was tried: `read FILE` or `open udp multicast GROUP port PORT`.
        what: String,
        /// What the system said.
        source: io::Error,
    },
    /// What can never be opened: an impossible name, too many filters, a recording without a CAN
    /// frame, a speed that is none, a scene.
    #[error("{0}")]
    Refused(String),
}

impl OpenError {
    /// Why a multicast group cannot be joined.
    pub(crate) fn udp(group: IpAddr, port: u16, source: io::Error) -> Self {
        match source.raw_os_error().map(Errno::from_raw) {
            Some(Errno::EAFNOSUPPORT) => Self::NoNetwork { group, source },
            _ => Self::Io {
                what: format!("open udp multicast {group} port {port}"),
                source,
            },
        }
    }

    /// Whether the source is wrong as it is named, so that opening it later fails as well.
    pub fn is_lasting(&self) -> bool {
        match self {
            Self::NotCan { .. } | Self::NoNetwork { .. } | Self::Refused(_) => true,
            Self::NotSupported { .. } | Self::Socket { .. } | Self::Io { .. } => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::Ipv4Addr;

    #[test]
    fn a_process_without_network_is_told_how_it_gets_one_and_that_waiting_does_not_help() {
        let refused =
            |errno: Errno| OpenError::udp(Ipv4Addr::new(239, 74, 163, 2).into(), 43113, errno.into());
        let error = refused(Errno::EAFNOSUPPORT);
        assert!(error.is_lasting());
        let said = error.to_string();
        assert!(
            said.contains("239.74.163.2") && said.contains("taxeld-network.conf"),
            "{said}"
        );
        // No route leads to the group, as long as no interface is up.
        assert!(!refused(Errno::ENODEV).is_lasting());
    }
}
