//! From an address to a source.

use crate::{
    CanSource, IdFilter, LogSource, Playback, SocketCan, SocketCanOptions, SourceAddress, UdpMulticast,
    UdpOptions,
};
use std::io;
use std::net::IpAddr;
use std::path::PathBuf;

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
    /// The interface's name is impossible.
    #[error("`{interface}` is no interface name (1 to 15 bytes without blanks, `/` or `:`)")]
    BadInterface {
        /// The name given.
        interface: String,
    },
    /// There is an interface of that name, but it is no CAN interface.
    #[error("`{interface}` is not a CAN interface; `ip -details link show type can` lists those there are")]
    NotCan {
        /// Its name.
        interface: String,
    },
    /// More filters than the kernel takes.
    #[error("{filters} CAN filters are more than the {most} the kernel takes; use masks to join some")]
    TooManyFilters {
        /// The number given.
        filters: usize,
        /// The number the kernel takes.
        most: usize,
    },
    /// The process cannot have the socket.
    #[error("cannot open a CAN socket for `{interface}`: {source}")]
    Socket {
        /// The interface's name.
        interface: String,
        /// What the system said.
        source: io::Error,
    },
    /// The multicast group cannot be joined.
    #[error("cannot open udp multicast {group} port {port}: {source}")]
    Udp {
        /// The group.
        group: IpAddr,
        /// The UDP port.
        port: u16,
        /// What the system said.
        source: io::Error,
    },
    /// The recording cannot be read.
    #[error("cannot read {path}: {source}", path = path.display())]
    Log {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The recording holds no classic CAN frame at all.
    #[error(
        "{path} holds no CAN frame in its {lines} lines ({problem}); a candump log has lines such as \
         `(1436509052.249713) can0 044#2A366C2B`, and `can_logconvert` makes one of other formats",
        path = path.display()
    )]
    EmptyLog {
        /// The file.
        path: PathBuf,
        /// How many lines it has.
        lines: u64,
        /// What is wrong with the first of them.
        problem: String,
    },
    /// The speed of a playback is not a positive number.
    #[error("a playback speed of {speed} is not a positive number")]
    BadSpeed {
        /// The speed given.
        speed: f64,
    },
    /// A simulated scene, which only the simulator can play.
    #[error("sim:{scene} is not a bus: simulated scenes are opened by the simulator")]
    Simulated {
        /// The scene.
        scene: String,
    },
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
            let source = UdpMulticast::with_options(&udp_options).map_err(|source| OpenError::Udp {
                group: *group,
                port: *port,
                source,
            })?;
            Ok(Box::new(source))
        }
        SourceAddress::Log { path, interface } => Ok(Box::new(LogSource::open(
            path,
            interface.as_deref(),
            options.playback,
        )?)),
        SourceAddress::Sim { scene } => Err(OpenError::Simulated { scene: scene.clone() }),
    }
}
