//! The two places where only the raw kernel interface will do: many datagrams with their control
//! messages in one call, and whether a network interface is up.
//!
//! nix has a safe `recvmmsg`, but its prepared headers keep the control message length of the
//! previous call, so that a drop counter which appears for the first time no longer fits and is cut
//! off.
#![allow(unsafe_code)]

use nix::errno::Errno;
use nix::libc;
use std::mem;
use std::net::{IpAddr, SocketAddr};
use std::os::fd::{AsRawFd, BorrowedFd};

/// Datagrams read by one system call at most.
pub(crate) const SLOTS: usize = 32;

/// Room for a timestamp (`SCM_TIMESTAMPNS`, 32 bytes) and a drop counter (`SO_RXQ_OVFL`, 24 bytes),
/// and to spare.
const CONTROL_BYTES: usize = 128;
/// The size of `sockaddr_in6`, the largest address of interest.
const NAME_BYTES: usize = 28;

/// One datagram of at most `N` bytes with what the kernel says about it.
#[repr(C, align(8))]
pub(crate) struct Datagram<const N: usize> {
    // First, for the alignment a control message header needs.
    control: [u8; CONTROL_BYTES],
    name: [u8; NAME_BYTES],
    payload: [u8; N],
    name_len: usize,
    len: usize,
    truncated: bool,
    stamp_realtime_ns: Option<u64>,
    drops: Option<u32>,
}

impl<const N: usize> Datagram<N> {
    const EMPTY: Self = Self {
        control: [0; CONTROL_BYTES],
        name: [0; NAME_BYTES],
        payload: [0; N],
        name_len: 0,
        len: 0,
        truncated: false,
        stamp_realtime_ns: None,
        drops: None,
    };

    /// The bytes, cut off at `N`.
    pub(crate) fn payload(&self) -> &[u8] {
        &self.payload[..self.len.min(N)]
    }

    /// Whether the datagram was longer than `N` bytes.
    pub(crate) fn is_truncated(&self) -> bool {
        self.truncated
    }

    /// The kernel's receive stamp, `CLOCK_REALTIME`.
    pub(crate) fn stamp_realtime_ns(&self) -> Option<u64> {
        self.stamp_realtime_ns
    }

    /// The socket's count of dropped datagrams so far, modulo 2^32; absent while it is zero.
    pub(crate) fn drops(&self) -> Option<u32> {
        self.drops
    }

    /// Where the datagram came from, for the internet families.
    pub(crate) fn source(&self) -> Option<SocketAddr> {
        let name = &self.name[..self.name_len.min(NAME_BYTES)];
        let family = i32::from(u16::from_ne_bytes(name.get(..2)?.try_into().ok()?));
        let port = u16::from_be_bytes(name.get(2..4)?.try_into().ok()?);
        let ip: IpAddr = match family {
            libc::AF_INET => <[u8; 4]>::try_from(name.get(4..8)?).ok()?.into(),
            libc::AF_INET6 => <[u8; 16]>::try_from(name.get(8..24)?).ok()?.into(),
            _ => return None,
        };
        Some(SocketAddr::new(ip, port))
    }
}

/// Reusable room for [`SLOTS`] datagrams of at most `N` bytes.
pub(crate) struct DatagramReader<const N: usize> {
    slots: Box<[Datagram<N>]>,
}

impl<const N: usize> DatagramReader<N> {
    pub(crate) fn new() -> Self {
        Self {
            slots: (0..SLOTS).map(|_| Datagram::EMPTY).collect(),
        }
    }

    /// Reads what is queued, at most `most` datagrams, without blocking; `EAGAIN` if there is nothing.
    pub(crate) fn read(&mut self, socket: BorrowedFd<'_>, most: usize) -> Result<&[Datagram<N>], Errno> {
        let count = most.min(SLOTS);
        if count == 0 {
            return Ok(&[]);
        }
        // SAFETY: `iovec` and `mmsghdr` are plain data for which all zeroes (null pointers, no
        // lengths) is valid.
        let mut vectors: [libc::iovec; SLOTS] = unsafe { mem::zeroed() };
        // SAFETY: as above.
        let mut headers: [libc::mmsghdr; SLOTS] = unsafe { mem::zeroed() };
        for ((slot, vector), header) in self.slots.iter_mut().zip(&mut vectors).zip(&mut headers) {
            vector.iov_base = slot.payload.as_mut_ptr().cast();
            vector.iov_len = N;
            let header = &mut header.msg_hdr;
            header.msg_iov = vector;
            header.msg_iovlen = 1;
            header.msg_name = slot.name.as_mut_ptr().cast();
            header.msg_namelen = NAME_BYTES as _;
            header.msg_control = slot.control.as_mut_ptr().cast();
            header.msg_controllen = CONTROL_BYTES as _;
        }
        // SAFETY: the first `count` headers are filled in; each points to one `iovec` and three
        // buffers of the lengths given, all of which outlive the call and are used by nothing else
        // during it.
        let received = unsafe {
            libc::recvmmsg(
                socket.as_raw_fd(),
                headers.as_mut_ptr(),
                count as _,
                libc::MSG_DONTWAIT as _,
                std::ptr::null_mut(),
            )
        };
        let received = Errno::result(received)? as usize;
        for (slot, header) in self.slots.iter_mut().zip(&headers).take(received) {
            slot.len = header.msg_len as usize;
            slot.truncated = header.msg_hdr.msg_flags & libc::MSG_TRUNC != 0;
            slot.name_len = header.msg_hdr.msg_namelen as usize;
            (slot.stamp_realtime_ns, slot.drops) = control_messages(&header.msg_hdr);
        }
        Ok(&self.slots[..received.min(SLOTS)])
    }
}

/// The timestamp and the drop counter among the control messages of a header that the kernel has filled in.
fn control_messages(header: &libc::msghdr) -> (Option<u64>, Option<u32>) {
    let (mut stamp, mut drops) = (None, None);
    // SAFETY: `msg_control` points to `msg_controllen` bytes written by the kernel, aligned for a `cmsghdr`
    // because `Datagram` is aligned to 8 and begins with them.
    let mut next = unsafe { libc::CMSG_FIRSTHDR(header) };
    while !next.is_null() {
        // SAFETY: `CMSG_FIRSTHDR` and `CMSG_NXTHDR` give null or a complete header inside the buffer.
        let (level, kind, len, data) = unsafe {
            let message = &*next;
            let data_len = (message.cmsg_len as usize).saturating_sub(libc::CMSG_LEN(0) as usize);
            (
                message.cmsg_level,
                message.cmsg_type,
                data_len,
                libc::CMSG_DATA(next),
            )
        };
        match (level, kind) {
            (libc::SOL_SOCKET, libc::SCM_TIMESTAMPNS) if len >= mem::size_of::<libc::timespec>() => {
                // SAFETY: the message holds at least a `timespec`; it may be unaligned.
                let t = unsafe { data.cast::<libc::timespec>().read_unaligned() };
                stamp = (t.tv_sec as u64)
                    .checked_mul(1_000_000_000)
                    .map(|s| s.saturating_add(t.tv_nsec as u64));
            }
            (libc::SOL_SOCKET, libc::SO_RXQ_OVFL) if len >= mem::size_of::<u32>() => {
                // SAFETY: the message holds at least a `u32`; it may be unaligned.
                drops = Some(unsafe { data.cast::<u32>().read_unaligned() });
            }
            _ => {}
        }
        // SAFETY: `next` is a header inside the buffer that `header` describes.
        next = unsafe { libc::CMSG_NXTHDR(header, next) };
    }
    (stamp, drops)
}

/// What the flags of a network interface say.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct InterfaceState {
    pub(crate) is_up: bool,
    /// Whether it has a carrier. A CAN interface loses its carrier when its controller goes
    /// bus-off, and has it again when the controller is restarted (`can_bus_off`, `can_restart` of
    /// the kernel); virtual ones always have it.
    pub(crate) has_carrier: bool,
}

/// The state of the network interface of that name; `ENODEV` if there is none. Any socket will do.
pub(crate) fn interface_state(socket: BorrowedFd<'_>, interface: &str) -> Result<InterfaceState, Errno> {
    // SAFETY: `ifreq` is plain data for which all zeroes is valid.
    let mut request: libc::ifreq = unsafe { mem::zeroed() };
    if interface.len() >= request.ifr_name.len() {
        return Err(Errno::ENODEV);
    }
    for (to, from) in request.ifr_name.iter_mut().zip(interface.bytes()) {
        *to = from as libc::c_char;
    }
    // SAFETY: the request holds a name with a terminating zero and outlives the call, which writes
    // only into it.
    let result = unsafe { libc::ioctl(socket.as_raw_fd(), libc::SIOCGIFFLAGS as _, &mut request) };
    Errno::result(result)?;
    // SAFETY: the kernel has filled in the flags, and every bit pattern of them is valid.
    let flags = libc::c_int::from(unsafe { request.ifr_ifru.ifru_flags });
    Ok(InterfaceState {
        is_up: flags & libc::IFF_UP != 0,
        has_carrier: flags & libc::IFF_RUNNING != 0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::UdpSocket;
    use std::os::fd::AsFd;

    #[test]
    fn the_loopback_interface_is_found_and_others_are_not() {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        let up = InterfaceState {
            is_up: true,
            has_carrier: true,
        };
        assert_eq!(interface_state(socket.as_fd(), "lo"), Ok(up));
        assert_eq!(interface_state(socket.as_fd(), "no-such-if"), Err(Errno::ENODEV));
        assert_eq!(
            interface_state(socket.as_fd(), "a-name-over-the-limit"),
            Err(Errno::ENODEV)
        );
    }

    #[test]
    fn datagrams_come_in_order_with_stamp_source_and_drop_counter() {
        use nix::sys::socket::{setsockopt, sockopt};
        crate::udp::stay_on_one_cpu();
        let receiver = UdpSocket::bind("127.0.0.1:0").unwrap();
        let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
        setsockopt(&receiver, sockopt::ReceiveTimestampns, &true).unwrap();
        setsockopt(&receiver, sockopt::RxqOvfl, &1).unwrap();
        setsockopt(&receiver, sockopt::RcvBuf, &0).unwrap();
        let mut reader = DatagramReader::<8>::new();
        assert_eq!(reader.read(receiver.as_fd(), 32).err(), Some(Errno::EAGAIN));

        // A first round without any drop, so that the counter is a control message that was not there before.
        sender
            .send_to(b"0123456789", receiver.local_addr().unwrap())
            .unwrap();
        let datagrams = reader.read(receiver.as_fd(), 32).unwrap();
        assert_eq!(datagrams.len(), 1);
        assert_eq!(datagrams[0].payload(), b"01234567");
        assert!(datagrams[0].is_truncated());
        assert_eq!(datagrams[0].drops(), None);

        // The kernel may pass datagrams on a little later, so more are sent until every one before the newest
        // is accounted for.
        let (mut sent, mut seen, mut drops) = (1u32, 1u32, 0);
        let mut newest = None;
        for _ in 0..10_000 {
            for _ in 0..50 {
                sender
                    .send_to(&sent.to_ne_bytes(), receiver.local_addr().unwrap())
                    .unwrap();
                sent += 1;
            }
            while let Ok(datagrams) = reader.read(receiver.as_fd(), 5) {
                assert!(datagrams.len() <= 5);
                for datagram in datagrams {
                    let number = u32::from_ne_bytes(datagram.payload().try_into().unwrap());
                    assert!(newest < Some(number));
                    newest = Some(number);
                    assert_eq!(datagram.source(), Some(sender.local_addr().unwrap()));
                    assert!(datagram.stamp_realtime_ns().is_some());
                    let told = datagram.drops().unwrap_or(0);
                    assert!(told >= drops);
                    drops = told;
                    seen += 1;
                }
            }
            if drops > 0 && newest.is_some_and(|n| n + 1 == seen + drops) {
                return;
            }
        }
        panic!("of {sent} datagrams {seen} were read and {drops} counted as dropped");
    }
}
