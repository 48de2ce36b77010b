//! From an address to a source.

use crate::{
    CanSource, IdFilter, LogSource, SocketCan, SocketCanOptions, SourceAddress, UdpMulticast, UdpOptions,
};
use nix::errno::Errno;
use std::io;
use std::net::IpAddr;

/// What a source needs to know beside its address.
#[derive(Debug, Clone, PartialEq)]
pub struct SourceOptions {
    /// The bus's name, by which a recording of several interfaces is told which of them is meant where its address does not
    /// say ([`LogSource::open_bus`]). Other sources ignore it.
    pub bus: String,
    /// What a SocketCAN interface should let through; empty means everything. Other sources ignore it.
    pub filters: Vec<IdFilter>,
    /// Bytes of receive queue to ask the kernel for, where there is one.
    pub receive_buffer: usize,
    /// When the first frame of a recording or scene is due, nanoseconds on the caller's clock. Other sources ignore it.
    pub start_ns: u64,
}

impl Default for SourceOptions {
    fn default() -> Self {
        Self {
            bus: String::new(),
            filters: Vec::new(),
            receive_buffer: 4 << 20,
            start_ns: 0,
        }
    }
}

/// Why a source cannot be opened.
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
    fn udp(group: IpAddr, port: u16, source: io::Error) -> Self {
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

/// Opens what an address names. `sim:` and `pressure:` are refused: scenes are the simulator's, and a socket has an owner
/// and a mode ([`PressureSocket`](crate::PressureSocket)).
pub fn open(address: &SourceAddress, options: &SourceOptions) -> Result<Box<dyn CanSource>, OpenError> {
    match address {
        SourceAddress::Can { interface } => {
            let socket_options = SocketCanOptions {
                receive_buffer: options.receive_buffer,
                filters: options.filters.clone(),
            };
            Ok(Box::new(SocketCan::open(interface, socket_options)?))
        }
        SourceAddress::Udp {
            group,
            port,
            interface,
            hop_limit,
        } => {
            let udp_options = UdpOptions {
                group: *group,
                port: *port,
                interface: interface.clone(),
                hop_limit: *hop_limit,
                receive_buffer: options.receive_buffer,
            };
            match UdpMulticast::with_options(&udp_options) {
                Ok(source) => Ok(Box::new(source)),
                Err(error) => Err(OpenError::udp(*group, *port, error)),
            }
        }
        SourceAddress::Log { path, interface } => Ok(Box::new(match interface {
            Some(interface) => LogSource::open(path, Some(interface), options.start_ns)?,
            None => LogSource::open_bus(path, &options.bus, options.start_ns)?,
        })),
        SourceAddress::Pressure { path } => Err(OpenError::Refused(format!(
            "pressure:{} is no bus: its frames are sent to taxeld",
            path.display()
        ))),
        SourceAddress::Sim { scene } => Err(OpenError::Refused(format!(
            "sim:{scene} is not a bus: simulated scenes are opened by the simulator"
        ))),
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
