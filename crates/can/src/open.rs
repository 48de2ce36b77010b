//! From an address to a source.

use crate::open_error::OpenError;
use crate::{
    CanSource, IdFilter, LogSource, SocketCan, SocketCanOptions, SourceAddress, UdpMulticast, UdpOptions,
};

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
