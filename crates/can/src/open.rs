//! From an address to a source.

use crate::{
    CanSource, IdFilter, LogSource, Playback, SocketCan, SocketCanOptions, SourceAddress, UdpMulticast,
    UdpOptions,
};
use std::io;

/// What a source needs to know beside its address.
#[derive(Debug, Clone, PartialEq)]
pub struct SourceOptions {
    /// What a SocketCAN interface should let through; empty means everything. Other sources ignore it.
    pub filters: Vec<IdFilter>,
    /// Bytes of receive queue to ask the kernel for, where there is one.
    pub receive_buffer: usize,
    /// When the frames of a recording are due.
    pub playback: Playback,
}

impl Default for SourceOptions {
    fn default() -> Self {
        Self {
            filters: Vec::new(),
            receive_buffer: 4 << 20,
            playback: Playback::default(),
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

/// Opens what an address names. A `sim:` address is refused: scenes are the simulator's.
pub fn open(address: &SourceAddress, options: &SourceOptions) -> Result<Box<dyn CanSource>, OpenError> {
    match address {
        SourceAddress::Can { interface } => {
            let socket_options = SocketCanOptions {
                receive_buffer: options.receive_buffer,
                filters: options.filters.clone(),
                ..SocketCanOptions::default()
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
            let source = UdpMulticast::with_options(&udp_options).map_err(|source| OpenError::Io {
                what: format!("open udp multicast {group} port {port}"),
                source,
            })?;
            Ok(Box::new(source))
        }
        SourceAddress::Log { path, interface } => Ok(Box::new(LogSource::open(
            path,
            interface.as_deref(),
            options.playback,
        )?)),
        SourceAddress::Sim { scene } => Err(OpenError::Refused(format!(
            "sim:{scene} is not a bus: simulated scenes are opened by the simulator"
        ))),
    }
}
