//! A SocketCAN interface as a CAN source that survives whatever happens to the interface.

use crate::address::{INTERFACE_NAME, is_interface_name};
use crate::clock::{StampConverter, monotonic_ns};
use crate::drops::DropCounter;
use crate::kernel::{Datagram, DatagramReader, interface_state};
use crate::{
    BusState, CanFrame, CanSource, IdFilter, LinkState, OpenError, Received, SendError, SourceCounters,
    Wakeup,
};
use ::socketcan::{CanAddr, CanSocket, Socket, SocketOptions};
use nix::errno::Errno;
use nix::libc;
use nix::net::if_::if_nametoindex;
use nix::sys::socket::{
    AddressFamily, MsgFlags, SockFlag, SockProtocol, SockType, getsockopt, send, setsockopt, socket, sockopt,
};
use std::io;
use std::os::fd::{AsFd, AsRawFd};

/// The size of `struct can_frame`.
const FRAME_BYTES: usize = 16;
/// `CAN_RAW_FILTER_MAX` of `linux/can/raw.h`.
const MOST_FILTERS: usize = 512;

/// The shortest and the longest pause between two looks at an interface that is absent or down.
const BACK_OFF_NS: std::ops::RangeInclusive<u64> = 50_000_000..=250_000_000;
/// How often a link that is up is looked at, in case the one error that tells of its loss was missed.
const CHECK_NS: u64 = 1_000_000_000;
/// ... and one whose controller is bus-off, since a restart by hand is told by the carrier alone.
const CHECK_BUS_OFF_NS: u64 = 100_000_000;

/// How a SocketCAN source is opened.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SocketCanOptions {
    /// Bytes of receive queue to ask for. The kernel doubles it for its own overhead and, without
    /// `CAP_NET_ADMIN`, caps it at `net.core.rmem_max`; [`SocketCan::receive_buffer`] says what came of it.
    /// 4 MiB hold over 10,000 frames.
    pub receive_buffer: usize,
    /// What to receive: a frame that passes any of these. Empty means everything; at most 512.
    /// Error frames always come.
    pub filters: Vec<IdFilter>,
}

impl Default for SocketCanOptions {
    fn default() -> Self {
        Self {
            receive_buffer: 4 << 20,
            filters: Vec::new(),
        }
    }
}

/// A SocketCAN interface.
///
/// The interface need not exist when it is opened, and may go down, come up, vanish and be made
/// anew: it is looked for by name, first after 50 ms and then less often, at least four times a
/// second. Frames that were queued when it vanished are still delivered. Each time the socket is
/// replaced it has another file descriptor number than its predecessor, so that a caller can tell
/// by [`CanSource::wakeup`] that it must register anew.
///
/// Times are the kernel's receive stamps. If no other program has asked the kernel for stamps yet,
/// it takes a moment to turn them on, and frames that come in that moment have the time at which
/// they were read.
///
/// The controller's state is that of the newest error frame. Two things tell of no error frame:
/// that the controller was bus-off already when the interface was opened, and that the interface
/// was set down and up by hand, which restarts the controller. Both are seen by the interface's
/// flags.
///
/// Own frames are not received, but other sockets on this machine see them.
pub struct SocketCan {
    interface: String,
    options: SocketCanOptions,
    /// What to receive, as the kernel takes it: made once, since a socket is opened again between two frames.
    filters: Vec<u8>,
    open: Option<Open>,
    reader: DatagramReader<FRAME_BYTES>,
    link: LinkState,
    counters: SourceCounters,
    was_open: bool,
    receive_buffer: usize,
    next_check_ns: u64,
    back_off_ns: u64,
}

/// A `struct can_filter` of `linux/can.h`.
fn can_filter(filter: &IdFilter) -> impl Iterator<Item = u8> + use<> {
    [filter.id, filter.mask].into_iter().flat_map(u32::to_ne_bytes)
}

/// A socket bound to the interface that had index `ifindex` then.
struct Open {
    socket: CanSocket,
    ifindex: u32,
    stamps: StampConverter,
    drops: DropCounter,
    /// The interface is gone for good; the socket is kept until its queue is empty.
    is_dead: bool,
    /// At how many looks in a row the interface had no carrier. One is not enough to believe it,
    /// since the kernel follows the controller a moment later.
    without_carrier: u8,
}

impl SocketCan {
    /// Opens the interface of that name, or waits for it.
    ///
    /// Fails only where waiting cannot help: the kernel has no CAN, the name is impossible or that
    /// of something else than a CAN interface, there are too many filters, or the process may open
    /// no socket.
    pub fn open(interface: &str, options: SocketCanOptions) -> Result<Self, OpenError> {
        if !is_interface_name(interface) {
            return Err(OpenError::Refused(format!(
                "`{interface}` is no interface name ({INTERFACE_NAME})"
            )));
        }
        if options.filters.len() > MOST_FILTERS {
            return Err(OpenError::Refused(format!(
                "{} CAN filters are more than the {MOST_FILTERS} the kernel takes; use masks to join some",
                options.filters.len()
            )));
        }
        let mut source = Self {
            interface: interface.to_owned(),
            filters: options.filters.iter().flat_map(can_filter).collect(),
            options,
            open: None,
            reader: DatagramReader::new(),
            link: LinkState::Absent,
            counters: SourceCounters::default(),
            was_open: false,
            receive_buffer: 0,
            next_check_ns: 0,
            back_off_ns: *BACK_OFF_NS.start(),
        };
        match source.open_socket() {
            Ok(()) | Err(Unopened::NoInterface) => Ok(source),
            Err(Unopened::NoCanInKernel(source)) => Err(OpenError::NotSupported { source }),
            Err(Unopened::NotCan) => Err(OpenError::NotCan {
                interface: interface.to_owned(),
            }),
            Err(Unopened::Io(source)) => Err(OpenError::Socket {
                interface: interface.to_owned(),
                source,
            }),
        }
    }

    /// The size of the kernel's receive queue in bytes, the kernel's overhead included (it doubles what it is
    /// asked for and reports the double); 0 as long as the interface has never been there.
    pub fn receive_buffer(&self) -> usize {
        self.receive_buffer
    }

    /// Replaces the socket by one for the interface that has the name now. The predecessor is
    /// closed last, so that the two have different numbers.
    fn open_socket(&mut self) -> Result<(), Unopened> {
        // First the socket, so that a kernel without CAN is told from a missing interface.
        let flags = SockFlag::SOCK_NONBLOCK | SockFlag::SOCK_CLOEXEC;
        let fd =
            socket(AddressFamily::Can, SockType::Raw, flags, SockProtocol::CanRaw).map_err(|e| match e {
                Errno::EAFNOSUPPORT | Errno::EPROTONOSUPPORT | Errno::ESOCKTNOSUPPORT => {
                    Unopened::NoCanInKernel(e.into())
                }
                _ => Unopened::Io(e.into()),
            })?;
        let ifindex = match if_nametoindex(self.interface.as_str()) {
            Ok(index) => index,
            Err(Errno::ENODEV | Errno::ENXIO) => return Err(Unopened::NoInterface),
            Err(e) => return Err(Unopened::Io(e.into())),
        };
        // All options before `bind`, since from then on frames are queued.
        let socket = CanSocket::from(fd);
        let wanted = self.options.receive_buffer;
        if setsockopt(&socket, sockopt::RcvBufForce, &wanted).is_err() {
            setsockopt(&socket, sockopt::RcvBuf, &wanted)?;
        }
        self.receive_buffer = getsockopt(&socket, sockopt::RcvBuf)?;
        setsockopt(&socket, sockopt::ReceiveTimestampns, &true)?;
        setsockopt(&socket, sockopt::RxqOvfl, &1)?;
        if !self.filters.is_empty() {
            socket.set_socket_option_bytes(libc::SOL_CAN_RAW, libc::CAN_RAW_FILTER, &self.filters)?;
        }
        socket.set_error_filter_accept_all()?;
        let stamps = StampConverter::starting_now();
        if let Err(e) = socket.as_raw_socket().bind(&CanAddr::new(ifindex).into()) {
            // ENODEV has two meanings here: gone since it was looked up, or not a CAN interface.
            return Err(match e.raw_os_error() {
                Some(libc::ENODEV) if if_nametoindex(self.interface.as_str()) == Ok(ifindex) => {
                    Unopened::NotCan
                }
                Some(libc::ENODEV) => Unopened::NoInterface,
                _ => Unopened::Io(e),
            });
        }
        self.open = Some(Open {
            socket,
            ifindex,
            stamps,
            drops: DropCounter::default(),
            is_dead: false,
            without_carrier: 0,
        });
        if self.was_open {
            self.counters.reopens += 1;
        }
        self.was_open = true;
        self.look_at_flags();
        Ok(())
    }

    /// Takes the link state from the interface's flags.
    fn look_at_flags(&mut self) {
        let Some(open) = &mut self.open else { return };
        match interface_state(open.socket.as_fd(), &self.interface) {
            Ok(state) if state.is_up => {
                let looks = open.without_carrier;
                open.without_carrier = if state.has_carrier {
                    0
                } else {
                    looks.saturating_add(1)
                };
                self.set_link(LinkState::Up);
                if !state.has_carrier && looks == 1 {
                    self.counters.set_bus_state(BusState::BusOff);
                } else if state.has_carrier && looks > 0 && self.counters.bus_state == BusState::BusOff {
                    self.counters.set_bus_state(BusState::ErrorActive);
                }
            }
            Ok(_) => self.set_link(LinkState::Down),
            Err(_) => open.is_dead = true,
        }
    }

    fn set_link(&mut self, link: LinkState) {
        if self.link == LinkState::Up && link != LinkState::Up {
            self.counters.link_losses += 1;
            // A controller that is taken down and up again, or replaced, begins anew and sends no
            // frame to say so.
            self.counters.set_bus_state(BusState::ErrorActive);
            if let Some(open) = &mut self.open {
                open.without_carrier = 0;
            }
        }
        self.link = link;
    }

    /// Looks, if it is time, whether the interface is there, is the same as before, and is up.
    fn check(&mut self, now_ns: u64) {
        if now_ns < self.next_check_ns {
            return;
        }
        match &mut self.open {
            None => {
                // Whatever is in the way now, trying again is all that can be done.
                let _ = self.open_socket();
            }
            Some(open) => {
                open.is_dead |= is_another(if_nametoindex(self.interface.as_str()), open.ifindex);
                open.drops.ask(&open.socket, &mut self.counters.lost_in_kernel);
                self.look_at_flags();
            }
        }
        self.schedule_check(now_ns);
    }

    fn schedule_check(&mut self, now_ns: u64) {
        let pause_ns = if self.link == LinkState::Up {
            self.back_off_ns = *BACK_OFF_NS.start();
            let without_carrier = self.open.as_ref().is_some_and(|open| open.without_carrier > 0);
            if without_carrier || self.counters.bus_state == BusState::BusOff {
                CHECK_BUS_OFF_NS
            } else {
                CHECK_NS
            }
        } else {
            let pause_ns = self.back_off_ns;
            self.back_off_ns = (2 * pause_ns).min(*BACK_OFF_NS.end());
            pause_ns
        };
        self.next_check_ns = now_ns.saturating_add(pause_ns);
    }

    /// Has the interface looked at on the next call, and often for a while if that shows a loss.
    fn suspect(&mut self) {
        self.next_check_ns = 0;
        self.back_off_ns = *BACK_OFF_NS.start();
    }

    /// Moves queued frames into `batch` until the queue or the room is at its end, and returns whether it was
    /// the room.
    fn drain(&mut self, now_ns: u64, batch: &mut Vec<Received>) -> bool {
        let mut suspicious = false;
        while let Some(open) = &mut self.open {
            let room = batch.capacity() - batch.len();
            if room == 0 {
                return true;
            }
            let before_ns = monotonic_ns();
            match self.reader.read(open.socket.as_fd(), room) {
                Ok(datagrams) => {
                    open.stamps.sample();
                    let read_ns = monotonic_ns();
                    for datagram in datagrams {
                        open.take(datagram, read_ns, batch, &mut self.counters);
                    }
                    if !open.is_dead {
                        self.set_link(LinkState::Up);
                    }
                }
                Err(Errno::EAGAIN) => {
                    open.stamps.queue_was_empty(before_ns);
                    if open.is_dead {
                        open.drops.ask(&open.socket, &mut self.counters.lost_in_kernel);
                        self.set_link(LinkState::Absent);
                        if self.open_socket().is_err() {
                            self.open = None;
                        }
                        suspicious = true;
                    }
                    break;
                }
                Err(Errno::EINTR) => {}
                Err(Errno::ENETDOWN) => {
                    self.set_link(LinkState::Down);
                    suspicious = true;
                }
                // ENODEV says that the interface is gone. Anything else has no better answer either, and what stays is
                // not asked again before the next call.
                Err(_) => {
                    suspicious = true;
                    if std::mem::replace(&mut open.is_dead, true) {
                        break;
                    }
                }
            }
        }
        if suspicious {
            self.suspect();
            self.look_at_flags();
            self.schedule_check(now_ns);
        }
        if self.counters.bus_state == BusState::BusOff {
            self.next_check_ns = self.next_check_ns.min(now_ns.saturating_add(CHECK_BUS_OFF_NS));
        }
        false
    }
}

/// Whether a name that led to the interface of index `ifindex` leads to another one now, or to
/// none. A failure that says nothing of the interface does not count: the C library opens a socket
/// to look, and may find the process out of file descriptors.
fn is_another(looked_up: nix::Result<u32>, ifindex: u32) -> bool {
    match looked_up {
        Ok(index) => index != ifindex,
        Err(e) => matches!(e, Errno::ENODEV | Errno::ENXIO),
    }
}

impl Open {
    fn take(
        &mut self,
        datagram: &Datagram<FRAME_BYTES>,
        read_ns: u64,
        batch: &mut Vec<Received>,
        counters: &mut SourceCounters,
    ) {
        if let Some(drops) = datagram.drops() {
            self.drops.take(drops, &mut counters.lost_in_kernel);
        }
        let t_ns = self.stamps.convert(datagram.stamp_realtime_ns(), read_ns);
        match decode(datagram.payload()) {
            Some(frame) => {
                counters.count(&frame);
                batch.push(Received { t_ns, frame });
            }
            None => counters.undecodable += 1,
        }
    }
}

/// A `struct can_frame`: identifier with flags, length, three bytes of no meaning here, data.
fn decode(bytes: &[u8]) -> Option<CanFrame> {
    let bytes: &[u8; FRAME_BYTES] = bytes.try_into().ok()?;
    let (id, rest) = bytes.split_first_chunk()?;
    let raw_id = u32::from_ne_bytes(*id);
    let len = usize::from(rest[0]);
    let data = rest[4..].get(..len)?;
    CanFrame::from_raw(raw_id, data).ok()
}

fn encode(frame: &CanFrame) -> [u8; FRAME_BYTES] {
    let mut bytes = [0; FRAME_BYTES];
    bytes[..4].copy_from_slice(&frame.raw_id().to_ne_bytes());
    bytes[4] = frame.dlc();
    bytes[8..][..frame.data().len()].copy_from_slice(frame.data());
    bytes
}

/// Why there is no socket.
enum Unopened {
    NoInterface,
    NoCanInKernel(io::Error),
    NotCan,
    Io(io::Error),
}

impl From<Errno> for Unopened {
    fn from(e: Errno) -> Self {
        Unopened::Io(e.into())
    }
}

impl From<io::Error> for Unopened {
    fn from(e: io::Error) -> Self {
        Unopened::Io(e)
    }
}

impl CanSource for SocketCan {
    fn wakeup(&self) -> Wakeup<'_> {
        Wakeup {
            fd: self.open.as_ref().map(|open| open.socket.as_fd()),
            at_ns: Some(self.next_check_ns),
        }
    }

    fn receive(&mut self, now_ns: u64, batch: &mut Vec<Received>) -> bool {
        self.check(now_ns);
        self.drain(now_ns, batch)
    }

    fn send(&mut self, frame: &CanFrame) -> Result<(), SendError> {
        let result = match &self.open {
            None => Err(SendError::LinkLost(LinkState::Absent)),
            Some(open) => {
                let flags = MsgFlags::MSG_DONTWAIT | MsgFlags::MSG_NOSIGNAL;
                match send(open.socket.as_raw_fd(), &encode(frame), flags) {
                    Ok(_) => Ok(()),
                    Err(Errno::ENOBUFS | Errno::EAGAIN) => Err(SendError::QueueFull),
                    // A send can take away the one error that `receive` would have seen, so the
                    // loss is looked into from here too.
                    Err(Errno::ENETDOWN) => {
                        self.set_link(LinkState::Down);
                        self.suspect();
                        Err(SendError::LinkLost(LinkState::Down))
                    }
                    Err(Errno::ENODEV | Errno::ENXIO) => {
                        self.suspect();
                        Err(SendError::LinkLost(LinkState::Absent))
                    }
                    Err(e) => Err(SendError::Io(e.into())),
                }
            }
        };
        self.counters.count_sent(&result);
        result
    }

    fn counters(&self) -> &SourceCounters {
        &self.counters
    }

    fn link(&self) -> LinkState {
        self.link
    }
}

#[cfg(test)]
mod tests;
