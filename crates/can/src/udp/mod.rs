//! python-can's `udp_multicast` interface as a CAN source, for machines whose kernel has no CAN.

use crate::address::{DEFAULT_UDP_GROUP, DEFAULT_UDP_HOP_LIMIT, DEFAULT_UDP_PORT};
use crate::clock::{StampConverter, monotonic_ns, realtime_ns};
use crate::drops::DropCounter;
use crate::kernel::DatagramReader;
use crate::python_can::{self, Undecodable};
use crate::{CanFrame, CanSource, LinkState, Received, SendError, SourceCounters, Wakeup};
use ::socketcan::SocketOptions;
use nix::errno::Errno;
use nix::libc;
use nix::net::if_::if_nametoindex;
use nix::sys::socket::{
    AddressFamily, MsgFlags, SockFlag, SockType, SockaddrIn, SockaddrIn6, SockaddrLike, SockaddrStorage,
    bind, connect, getsockname, getsockopt, send, setsockopt, socket, sockopt,
};
use std::io;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, SocketAddrV6};
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd, RawFd};

/// The largest datagram python-can reads.
const LARGEST_DATAGRAM: usize = 4096;
/// How often the kernel is asked for losses that no datagram has told of.
const CHECK_NS: u64 = 1_000_000_000;

/// How a multicast source is opened.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UdpOptions {
    /// The multicast group.
    pub group: IpAddr,
    /// The UDP port. Separate buses by port: python-can receives every group of its port.
    pub port: u16,
    /// The network interface to join and send on; `None` leaves it to the routing table.
    pub interface: Option<String>,
    /// Hop limit (IPv4: TTL) of sent datagrams; 0 keeps them on this machine.
    pub hop_limit: u8,
    /// Bytes of receive queue to ask for, as for `SocketCanOptions::receive_buffer`.
    pub receive_buffer: usize,
}

impl Default for UdpOptions {
    /// python-can's IPv4 group and port, one hop, 4 MiB.
    fn default() -> Self {
        Self {
            group: DEFAULT_UDP_GROUP.into(),
            port: DEFAULT_UDP_PORT,
            interface: None,
            hop_limit: DEFAULT_UDP_HOP_LIMIT,
            receive_buffer: 4 << 20,
        }
    }
}

/// A bus made of UDP datagrams to a multicast group, in the format of python-can 4.6.1's `udp_multicast`.
///
/// Stock python-can is the other side of it. Datagrams that are no classic CAN frame, CAN FD
/// included, are counted as `undecodable`. The frames this source sends do not come back to it.
/// There is no arbitration, no order between senders and no guarantee of delivery; it is for
/// function, not for timing.
pub struct UdpMulticast {
    receiver: Fd,
    sender: Fd,
    /// The address that datagrams from `sender` come from.
    own_address: Option<SocketAddr>,
    group: SockaddrStorage,
    reader: DatagramReader<LARGEST_DATAGRAM>,
    stamps: StampConverter,
    drops: DropCounter,
    next_check_ns: u64,
    receive_buffer: usize,
    counters: SourceCounters,
}

/// A socket on which the options that nix has no names for can be set.
struct Fd(OwnedFd);

impl AsRawFd for Fd {
    fn as_raw_fd(&self) -> RawFd {
        self.0.as_raw_fd()
    }
}

impl AsFd for Fd {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }
}

impl SocketOptions for Fd {}

impl UdpMulticast {
    /// Joins a group.
    ///
    /// Fails with the system's error, most often because no route leads to the group: then either name an
    /// interface, or `ip route add 224.0.0.0/4 dev lo` for a bus within this machine.
    pub fn with_options(options: &UdpOptions) -> io::Result<Self> {
        if !options.group.is_multicast() {
            return Err(io::Error::new(
                io::ErrorKind::InvalidInput,
                format!("{} is not a multicast group", options.group),
            ));
        }
        let interface = match &options.interface {
            None => 0,
            Some(name) => if_nametoindex(name.as_str())?,
        };
        let receiver = new_socket(options.group)?;
        setsockopt(&receiver, sockopt::ReuseAddr, &true)?;
        setsockopt(&receiver, sockopt::ReusePort, &true)?;
        if setsockopt(&receiver, sockopt::RcvBufForce, &options.receive_buffer).is_err() {
            setsockopt(&receiver, sockopt::RcvBuf, &options.receive_buffer)?;
        }
        setsockopt(&receiver, sockopt::ReceiveTimestampns, &true)?;
        setsockopt(&receiver, sockopt::RxqOvfl, &1)?;
        let stamps = StampConverter::starting_now();
        bind_to_group(&receiver, options, interface)?;
        join(&receiver, options.group, interface)?;

        let sender = new_socket(options.group)?;
        set_outgoing(&sender, options, interface)?;
        let mut source = Self {
            receive_buffer: getsockopt(&receiver, sockopt::RcvBuf)?,
            receiver,
            sender,
            own_address: None,
            group: group_address(options, interface),
            reader: DatagramReader::new(),
            stamps,
            drops: DropCounter::default(),
            next_check_ns: 0,
            counters: SourceCounters::default(),
        };
        source.connect_sender()?;
        Ok(source)
    }

    /// The size of the kernel's receive queue in bytes, the kernel's overhead included.
    pub fn receive_buffer(&self) -> usize {
        self.receive_buffer
    }

    /// Fixes the sender's own address, by which its datagrams are known when they come back.
    fn connect_sender(&mut self) -> io::Result<()> {
        connect(self.sender.as_raw_fd(), &self.group)?;
        let own: SockaddrStorage = getsockname(self.sender.as_raw_fd())?;
        self.own_address = own
            .as_sockaddr_in()
            .map(|a| SocketAddr::new(a.ip().into(), a.port()))
            .or_else(|| {
                own.as_sockaddr_in6()
                    .map(|a| SocketAddr::new(a.ip().into(), a.port()))
            });
        Ok(())
    }
}

fn new_socket(group: IpAddr) -> io::Result<Fd> {
    let family = match group {
        IpAddr::V4(_) => AddressFamily::Inet,
        IpAddr::V6(_) => AddressFamily::Inet6,
    };
    let flags = SockFlag::SOCK_NONBLOCK | SockFlag::SOCK_CLOEXEC;
    Ok(Fd(socket(family, SockType::Datagram, flags, None)?))
}

fn address(ip: IpAddr, port: u16, interface: u32) -> SockaddrStorage {
    match ip {
        IpAddr::V4(ip) => SockaddrIn::from(std::net::SocketAddrV4::new(ip, port)).into_storage(),
        IpAddr::V6(ip) => SockaddrIn6::from(SocketAddrV6::new(ip, port, 0, interface)).into_storage(),
    }
}

/// nix converts each family into the storage type by a conversion of its own.
trait IntoStorage: SockaddrLike {
    fn into_storage(self) -> SockaddrStorage;
}

impl IntoStorage for SockaddrIn {
    fn into_storage(self) -> SockaddrStorage {
        std::net::SocketAddrV4::from(self).into()
    }
}

impl IntoStorage for SockaddrIn6 {
    fn into_storage(self) -> SockaddrStorage {
        SocketAddrV6::from(self).into()
    }
}

fn group_address(options: &UdpOptions, interface: u32) -> SockaddrStorage {
    address(options.group, options.port, interface)
}

/// Binds to the group's own address, so that other groups of the port stay out.
///
/// An IPv6 group of link scope or less cannot be bound to without an interface; then any address has to do.
fn bind_to_group(receiver: &Fd, options: &UdpOptions, interface: u32) -> io::Result<()> {
    match bind(receiver.as_raw_fd(), &group_address(options, interface)) {
        Err(Errno::EINVAL) if options.group.is_ipv6() && interface == 0 => Ok(bind(
            receiver.as_raw_fd(),
            &address(Ipv6Addr::UNSPECIFIED.into(), options.port, 0),
        )?),
        result => Ok(result?),
    }
}

fn join(receiver: &Fd, group: IpAddr, interface: u32) -> io::Result<()> {
    let (level, name, request) = match group {
        IpAddr::V4(group) => (
            libc::IPPROTO_IP,
            libc::IP_ADD_MEMBERSHIP,
            ip_mreqn(group, interface).to_vec(),
        ),
        // struct ipv6_mreq
        IpAddr::V6(group) => (
            libc::IPPROTO_IPV6,
            libc::IPV6_ADD_MEMBERSHIP,
            [&group.octets()[..], &interface.to_ne_bytes()].concat(),
        ),
    };
    receiver.set_socket_option_bytes(level, name, &request).map_err(|e| {
        io::Error::new(
            e.kind(),
            format!(
                "cannot join {group}: {e}. If no route leads to it, name an interface (`?interface=lo`) or \
                 `ip route add 224.0.0.0/4 dev lo`"
            ),
        )
    })
}

/// struct ip_mreqn: group, local address, interface index.
fn ip_mreqn(group: Ipv4Addr, interface: u32) -> [u8; 12] {
    let mut bytes = [0; 12];
    bytes[..4].copy_from_slice(&group.octets());
    bytes[8..].copy_from_slice(&interface.to_ne_bytes());
    bytes
}

fn set_outgoing(sender: &Fd, options: &UdpOptions, interface: u32) -> io::Result<()> {
    let hops = i32::from(options.hop_limit);
    let index = interface.to_ne_bytes();
    match options.group {
        IpAddr::V4(_) => {
            sender.set_socket_option_int(libc::IPPROTO_IP, libc::IP_MULTICAST_TTL, hops)?;
            if interface != 0 {
                let request = ip_mreqn(Ipv4Addr::UNSPECIFIED, interface);
                sender.set_socket_option_bytes(libc::IPPROTO_IP, libc::IP_MULTICAST_IF, &request)?;
            }
        }
        IpAddr::V6(_) => {
            sender.set_socket_option_int(libc::IPPROTO_IPV6, libc::IPV6_MULTICAST_HOPS, hops)?;
            if interface != 0 {
                sender.set_socket_option_bytes(libc::IPPROTO_IPV6, libc::IPV6_MULTICAST_IF, &index)?;
            }
        }
    }
    Ok(())
}

impl CanSource for UdpMulticast {
    fn wakeup(&self) -> Wakeup<'_> {
        Wakeup {
            fd: Some(self.receiver.as_fd()),
            at_ns: Some(self.next_check_ns),
        }
    }

    fn receive(&mut self, now_ns: u64, batch: &mut Vec<Received>) -> bool {
        if now_ns >= self.next_check_ns {
            self.drops.ask(&self.receiver, &mut self.counters.lost_in_kernel);
            self.next_check_ns = now_ns.saturating_add(CHECK_NS);
        }
        // Anybody may send anything to a group. What is no frame takes no room in the batch, so it
        // is bounded here.
        let mut left = batch.capacity() - batch.len();
        loop {
            if left == 0 {
                return true;
            }
            let before_ns = monotonic_ns();
            let datagrams = match self.reader.read(self.receiver.as_fd(), left) {
                Ok(datagrams) => datagrams,
                Err(Errno::EINTR) => continue,
                Err(_) => {
                    self.stamps.queue_was_empty(before_ns);
                    return false;
                }
            };
            self.stamps.sample();
            let read_ns = monotonic_ns();
            left -= datagrams.len();
            for datagram in datagrams {
                if let Some(drops) = datagram.drops() {
                    self.drops.take(drops, &mut self.counters.lost_in_kernel);
                }
                if self.own_address.is_some() && datagram.source() == self.own_address {
                    continue;
                }
                let t_ns = self.stamps.convert(datagram.stamp_realtime_ns(), read_ns);
                match python_can::decode(datagram.payload()) {
                    Ok(frame) if !datagram.is_truncated() => {
                        self.counters.count(&frame);
                        batch.push(Received { t_ns, frame });
                    }
                    outcome => {
                        self.counters.undecodable += 1;
                        self.counters.can_fd += u64::from(outcome == Err(Undecodable::CanFd));
                    }
                }
            }
        }
    }

    fn send(&mut self, frame: &CanFrame) -> Result<(), SendError> {
        let mut buffer = [0; python_can::LARGEST];
        let result = python_can::encode(frame, realtime_ns() as f64 / 1e9, &mut buffer)
            .map_err(SendError::Io)
            .and_then(|datagram| {
                let flags = MsgFlags::MSG_DONTWAIT | MsgFlags::MSG_NOSIGNAL;
                match send(self.sender.as_raw_fd(), datagram, flags) {
                    Ok(_) => Ok(()),
                    Err(Errno::ENOBUFS | Errno::EAGAIN) => Err(SendError::QueueFull),
                    Err(Errno::ENETDOWN | Errno::ENETUNREACH | Errno::EHOSTUNREACH) => {
                        Err(SendError::LinkLost(LinkState::Down))
                    }
                    Err(e) => Err(SendError::Io(e.into())),
                }
            });
        self.counters.count_sent(&result);
        result
    }

    fn counters(&self) -> &SourceCounters {
        &self.counters
    }
}

#[cfg(test)]
mod tests;
#[cfg(test)]
pub(crate) use tests::stay_on_one_cpu;
