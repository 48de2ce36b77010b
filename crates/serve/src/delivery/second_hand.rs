//! Sending one message to many sockets, with a second pair of hands.
//!
//! The kernel takes two microseconds for a packet, and so a millisecond for as many as there may be. A second thread sends
//! some of them meanwhile, where it gets a processor: it begins at the end, the first at the beginning, and where they meet
//! they are done. Where it gets none, the first sends all. It is given descriptors and bytes; whose they are, and what
//! becomes of it, is the serving thread's business.

use super::lane::Lane;
use super::message::Message;
use super::packet::Packet;
use super::socket::are_writable;
use nix::sys::socket::{MsgFlags, sendmsg};
use std::io::IoSlice;
use std::os::fd::{AsFd, AsRawFd};
use std::rc::Rc;
use std::sync::{Arc, Mutex, MutexGuard, mpsc};
use std::time::Instant;

/// Parts that a message's packets are sent in.
const PARTS: usize = 64;
/// Least packets of a part: few, since the first hand may have to wait for the second to have sent one, and since the
/// kernel is asked for room in all of its sockets before any is sent to.
const LEAST_PACKETS: usize = 16;
/// Packets that one hand sends alone: it has sent many of them before the other is awake.
const ALONE: usize = 64;

/// What is run on the second thread first.
pub(crate) type Prepare = Box<dyn FnOnce() + Send>;

/// Packets that one hand sends in one go. Whoever has locked them sends them, unless that was done.
#[derive(Debug, Default)]
struct Part {
    /// What is still to be sent.
    message: Option<Arc<Message>>,
    packets: Vec<Option<Packet>>,
}

/// Sends messages to lanes. Belongs to the serving thread.
#[derive(Debug)]
pub(crate) struct Hands {
    parts: Arc<[Mutex<Part>; PARTS]>,
    /// Wakes the second hand, which ends with this.
    wake: Option<mpsc::SyncSender<()>>,
}

impl Hands {
    /// The second thread is there where there is something to be run on it first.
    pub(crate) fn new(prepare: Option<Prepare>) -> Rc<Self> {
        let parts = Arc::new(std::array::from_fn(|_| Mutex::default()));
        let wake = prepare.and_then(|prepare| start(parts.clone(), prepare));
        Rc::new(Self { parts, wake })
    }

    /// Sends a message to those lanes that wait for it, whose sockets take it at once. The tasks of the others are to.
    pub(crate) fn send(&self, message: &Arc<Message>, lanes: &[Rc<Lane>]) {
        self.lay_out(message, lanes);
        self.finish(message, lanes);
    }

    /// The parts of a message, each locked when it comes to it, and the lanes of each.
    fn parts<'a>(
        &self,
        lanes: &'a [Rc<Lane>],
    ) -> impl DoubleEndedIterator<Item = (MutexGuard<'_, Part>, &'a [Rc<Lane>])> {
        let each = lanes.len().div_ceil(PARTS).max(LEAST_PACKETS);
        let parts = self.parts.iter().zip(lanes.chunks(each));
        parts.map(|(part, lanes)| (lock(part), lanes))
    }

    /// Makes the packets, from the end: the second hand sends the last while the first are made.
    fn lay_out(&self, message: &Arc<Message>, lanes: &[Rc<Lane>]) {
        let (mut packets, mut woken_at) = (0, ALONE);
        for (mut part, lanes) in self.parts(lanes).rev() {
            let waiting = lanes.iter().filter(|lane| lane.waits_for(message));
            part.packets.extend(waiting.map(|lane| lane.packet(message)));
            packets += part.packets.len();
            part.message = (!part.packets.is_empty()).then(|| message.clone());
            drop(part);
            if packets > woken_at {
                woken_at = usize::MAX;
                self.wake_second();
            }
        }
        // Once more, where it has come to one before that was made.
        if woken_at == usize::MAX {
            self.wake_second();
        }
    }

    fn wake_second(&self) {
        if let Some(wake) = &self.wake {
            // Full where it was woken already.
            let _ = wake.try_send(());
        }
    }

    /// Sends what the second hand has not, and then tells the lanes, which no reader waits for.
    fn finish(&self, message: &Arc<Message>, lanes: &[Rc<Lane>]) {
        for (mut part, _) in self.parts(lanes) {
            part.send();
        }
        for (mut part, lanes) in self.parts(lanes) {
            let waiting = lanes.iter().filter(|lane| lane.waits_for(message));
            for (lane, packet) in waiting.zip(part.packets.drain(..)) {
                lane.conclude(message, packet);
            }
        }
    }
}

fn lock(part: &Mutex<Part>) -> MutexGuard<'_, Part> {
    part.lock().unwrap_or_else(|e| e.into_inner())
}

/// Starts the second hand. Where there can be none, the first does without.
fn start(parts: Arc<[Mutex<Part>; PARTS]>, prepare: Prepare) -> Option<mpsc::SyncSender<()>> {
    let (wake, woken) = mpsc::sync_channel(1);
    let run = move || {
        prepare();
        while woken.recv().is_ok() {
            for part in parts.iter().rev() {
                if let Ok(mut part) = part.try_lock() {
                    part.send();
                }
            }
        }
    };
    match std::thread::Builder::new().name("images 2".into()).spawn(run) {
        Ok(_) => Some(wake),
        Err(error) => {
            tracing::info!(%error, "one thread alone sends images");
            None
        }
    }
}

impl Part {
    /// Sends what is still to be sent.
    fn send(&mut self) {
        let Some(message) = self.message.take() else {
            return;
        };
        let mut packets: Vec<_> = self.packets.iter_mut().flatten().collect();
        // Where the kernel cannot be asked, each lane's own task finds out why.
        let writable = are_writable(packets.iter().map(|packet| packet.socket.as_fd())).unwrap_or_default();
        let flags = MsgFlags::MSG_DONTWAIT | MsgFlags::MSG_NOSIGNAL;
        for (packet, _) in packets.iter_mut().zip(writable).filter(|(_, is)| *is) {
            let bytes = [IoSlice::new(&packet.header), IoSlice::new(&message.payload)];
            let sent = sendmsg::<()>(packet.socket.as_raw_fd(), &bytes, &[], flags, None);
            packet.sent = sent.is_ok().then(Instant::now);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::delivery::sent::Sent;
    use crate::delivery::socket::Socket;
    use nix::errno::Errno;
    use nix::poll::{PollFd, PollFlags, poll};
    use nix::sys::socket::{AddressFamily, SockFlag, SockType, recv, send, socketpair};
    use std::os::fd::OwnedFd;
    use taxel_wire::{HEADER_LEN, Header, Kind};

    const READERS: usize = 200;
    const PATIENCE_MS: u16 = 20_000;

    fn message(tick: u64) -> Arc<Message> {
        let payload = tick.to_le_bytes().to_vec();
        Arc::new(Message {
            tick,
            due: Instant::now(),
            header: Some(Header::new(Kind::Image, payload.len())),
            payload,
        })
    }

    /// Lanes that the courier sends, and the other ends of their sockets.
    fn readers() -> (Vec<Rc<Lane>>, Vec<OwnedFd>) {
        let flags = SockFlag::SOCK_NONBLOCK | SockFlag::SOCK_CLOEXEC;
        let reader = |_| {
            let (ours, theirs) = socketpair(AddressFamily::Unix, SockType::SeqPacket, None, flags).unwrap();
            let socket = Rc::new(Socket::new(ours).unwrap());
            let lane = Lane::new(&socket, [(); 2].map(|()| Arc::<Sent>::default()));
            lane.set_free(true);
            (lane, theirs)
        };
        (0..READERS).map(reader).unzip()
    }

    /// The payload of the next packet, as soon as there is one.
    fn take(theirs: &OwnedFd) -> Vec<u8> {
        poll(&mut [PollFd::new(theirs.as_fd(), PollFlags::POLLIN)], PATIENCE_MS).unwrap();
        let mut packet = [0; 1000];
        let bytes = recv(theirs.as_raw_fd(), &mut packet, MsgFlags::MSG_DONTWAIT).unwrap();
        packet[HEADER_LEN..bytes].to_vec()
    }

    fn has_no_more(theirs: &OwnedFd) -> bool {
        recv(theirs.as_raw_fd(), &mut [0], MsgFlags::MSG_DONTWAIT) == Err(Errno::EAGAIN)
    }

    #[tokio::test(flavor = "current_thread")]
    async fn the_second_hand_sends_whatever_the_first_has_not() {
        let hands = Hands::new(Some(Box::new(|| ())));
        let (lanes, theirs) = readers();
        let (first, second) = (message(1), message(2));
        hands.send(&first, &lanes);
        hands.lay_out(&second, &lanes);
        // The first hand does nothing meanwhile.
        for theirs in &theirs {
            assert_eq!(
                (take(theirs), take(theirs)),
                (first.payload.clone(), second.payload.clone())
            );
        }
        hands.finish(&second, &lanes);
        assert!(theirs.iter().all(has_no_more));
        assert!(
            lanes
                .iter()
                .all(|lane| lane.after() == 2 && lane.waits_for(&message(3)))
        );
    }

    #[tokio::test(flavor = "current_thread")]
    async fn each_is_sent_it_once_and_who_has_no_room_is_left_to_its_task_whether_the_second_hand_runs_or_not()
     {
        let (_released, held_up) = mpsc::channel::<()>();
        let never = move || {
            let _ = held_up.recv();
        };
        let kinds: [(&str, Option<Prepare>); 3] = [
            ("none", None),
            ("one that runs", Some(Box::new(|| ()))),
            ("one that gets no processor", Some(Box::new(never))),
        ];
        for (kind, prepare) in kinds {
            let hands = Hands::new(prepare);
            let (lanes, theirs) = readers();
            let is_full = |at: usize| at % 7 == 3;
            for lane in lanes
                .iter()
                .enumerate()
                .filter_map(|(at, lane)| is_full(at).then_some(lane))
            {
                let socket = lane.socket.descriptor().unwrap();
                while send(socket.as_raw_fd(), &[7; 1000], MsgFlags::MSG_DONTWAIT).is_ok() {}
            }
            for tick in 1..=20 {
                let message = message(tick);
                hands.send(&message, &lanes);
                for (at, (lane, theirs)) in lanes.iter().zip(&theirs).enumerate() {
                    let what = format!("{kind}, tick {tick}, reader {at}");
                    assert_eq!(lane.after(), if is_full(at) { 0 } else { tick }, "{what}");
                    assert_eq!(lane.waits_for(&self::message(tick + 1)), !is_full(at), "{what}");
                    if !is_full(at) {
                        assert_eq!(take(theirs), message.payload, "{what}");
                        assert!(has_no_more(theirs), "{what}");
                    }
                }
            }
        }
    }
}
