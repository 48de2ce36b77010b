//! A CAN bus in memory, for tests and for a simulator in the same process.

use crate::clock::monotonic_ns;
use crate::{CanFrame, CanSource, LinkState, Received, SendError, SourceCounters, Wakeup};
use nix::sys::eventfd::{EfdFlags, EventFd};
use std::collections::VecDeque;
use std::io;
use std::os::fd::{AsFd, BorrowedFd};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A bus in memory: the source a daemon reads, and the handle that plays the boards.
///
/// Each direction holds `capacity` frames (at least 1). Frames that find the source's queue full
/// are lost and counted as `lost_in_kernel`; commands that nobody takes make `send` answer
/// [`SendError::QueueFull`]. Fails only when the process can open no more files.
pub fn memory_bus(capacity: usize) -> io::Result<(MemorySource, MemoryBus)> {
    let capacity = capacity.max(1);
    let flags = EfdFlags::EFD_NONBLOCK | EfdFlags::EFD_CLOEXEC;
    let bus = Arc::new(Bus {
        state: Mutex::new(State {
            to_source: VecDeque::with_capacity(capacity),
            to_boards: VecDeque::with_capacity(capacity),
            lost: 0,
            link: LinkState::Up,
            link_losses: 0,
            reopens: 0,
        }),
        capacity,
        source_ready: EventFd::from_flags(flags)?,
        boards_ready: EventFd::from_flags(flags)?,
    });
    let source = MemorySource {
        bus: Arc::clone(&bus),
        counters: SourceCounters::default(),
    };
    Ok((source, MemoryBus { bus }))
}

struct Bus {
    state: Mutex<State>,
    capacity: usize,
    source_ready: EventFd,
    boards_ready: EventFd,
}

struct State {
    to_source: VecDeque<Received>,
    to_boards: VecDeque<Received>,
    lost: u64,
    link: LinkState,
    link_losses: u64,
    reopens: u64,
}

impl Bus {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Adding 1 can only fail when the counter stands at its maximum, and then the other side is woken already.
fn ring(bell: &EventFd) {
    let _ = bell.write(1);
}

/// Reading fails only when there is nothing to take back.
fn silence(bell: &EventFd) {
    let _ = bell.read();
}

/// The end of a [`memory_bus`] that a daemon reads.
pub struct MemorySource {
    bus: Arc<Bus>,
    counters: SourceCounters,
}

/// The end of a [`memory_bus`] that plays the boards. Its clones are the same end.
///
/// As a file descriptor it is readable while there are commands to take.
#[derive(Clone)]
pub struct MemoryBus {
    bus: Arc<Bus>,
}

impl MemoryBus {
    /// Puts a frame on the bus, received at `t_ns`. It is there for the source at once, whatever its time.
    ///
    /// Returns whether the source will see it: not if its queue is full, which is counted, or the
    /// link is not up.
    pub fn push(&self, t_ns: u64, frame: CanFrame) -> bool {
        let mut state = self.bus.state();
        if state.link != LinkState::Up {
            return false;
        }
        if state.to_source.len() == self.bus.capacity {
            state.lost += 1;
            return false;
        }
        state.to_source.push_back(Received { t_ns, frame });
        drop(state);
        ring(&self.bus.source_ready);
        true
    }

    /// The oldest frame that the daemon sent and nobody took yet, with its time of sending.
    pub fn take_sent(&self) -> Option<Received> {
        let mut state = self.bus.state();
        let frame = state.to_boards.pop_front();
        if state.to_boards.is_empty() {
            silence(&self.bus.boards_ready);
        }
        frame
    }

    /// Frames that the source has not read yet.
    pub fn unread(&self) -> usize {
        self.bus.state().to_source.len()
    }

    /// Sets what the source reports as its link. Away from up counts as a loss; back from absent as
    /// a reopening.
    pub fn set_link(&self, link: LinkState) {
        let mut state = self.bus.state();
        if state.link == LinkState::Up && link != LinkState::Up {
            state.link_losses += 1;
        }
        if state.link == LinkState::Absent && link != LinkState::Absent {
            state.reopens += 1;
        }
        state.link = link;
        drop(state);
        ring(&self.bus.source_ready);
    }
}

impl AsFd for MemoryBus {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.bus.boards_ready.as_fd()
    }
}

impl CanSource for MemorySource {
    fn wakeup(&self) -> Wakeup<'_> {
        Wakeup {
            fd: Some(self.bus.source_ready.as_fd()),
            at_ns: None,
        }
    }

    fn receive(&mut self, _now_ns: u64, batch: &mut Vec<Received>) -> bool {
        let mut state = self.bus.state();
        let free = batch.capacity() - batch.len();
        let count = free.min(state.to_source.len());
        for received in state.to_source.drain(..count) {
            self.counters.count(&received.frame);
            batch.push(received);
        }
        self.counters.lost_in_kernel = state.lost;
        self.counters.link_losses = state.link_losses;
        self.counters.reopens = state.reopens;
        let more = !state.to_source.is_empty();
        if !more {
            silence(&self.bus.source_ready);
        }
        more
    }

    fn send(&mut self, frame: &CanFrame) -> Result<(), SendError> {
        let mut state = self.bus.state();
        let result = if state.link != LinkState::Up {
            Err(SendError::LinkLost(state.link))
        } else if state.to_boards.len() == self.bus.capacity {
            Err(SendError::QueueFull)
        } else {
            state.to_boards.push_back(Received {
                t_ns: monotonic_ns(),
                frame: *frame,
            });
            Ok(())
        };
        drop(state);
        if result.is_ok() {
            ring(&self.bus.boards_ready);
        }
        self.counters.count_sent(&result);
        result
    }

    fn counters(&self) -> &SourceCounters {
        &self.counters
    }

    fn link(&self) -> LinkState {
        self.bus.state().link
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nix::poll::{PollFd, PollFlags, PollTimeout, poll};

    fn frame(n: u16) -> CanFrame {
        CanFrame::standard(n, &[]).unwrap()
    }

    fn is_readable(fd: BorrowedFd<'_>) -> bool {
        poll(&mut [PollFd::new(fd, PollFlags::POLLIN)], PollTimeout::ZERO).unwrap() == 1
    }

    #[test]
    fn frames_come_in_order_and_wake_the_reader() {
        let (mut source, bus) = memory_bus(8).unwrap();
        assert!(!is_readable(source.wakeup().fd.unwrap()));
        for n in 0..3 {
            assert!(bus.push(u64::from(n) * 10, frame(n)));
        }
        assert!(is_readable(source.wakeup().fd.unwrap()));
        let mut batch = Vec::with_capacity(2);
        assert!(source.receive(0, &mut batch));
        assert!(
            is_readable(source.wakeup().fd.unwrap()),
            "one frame is still there"
        );
        assert_eq!(
            batch,
            [
                Received {
                    t_ns: 0,
                    frame: frame(0)
                },
                Received {
                    t_ns: 10,
                    frame: frame(1)
                }
            ]
        );
        batch.clear();
        assert!(!source.receive(0, &mut batch));
        assert_eq!(batch.len(), 1);
        assert!(!is_readable(source.wakeup().fd.unwrap()));
        assert_eq!(source.counters().received, 3);
    }

    #[test]
    fn what_does_not_fit_is_counted_as_lost() {
        let (mut source, bus) = memory_bus(2).unwrap();
        let accepted: Vec<bool> = (0..5).map(|n| bus.push(0, frame(n))).collect();
        assert_eq!(accepted, [true, true, false, false, false]);
        source.receive(0, &mut Vec::with_capacity(8));
        assert_eq!(
            (source.counters().received, source.counters().lost_in_kernel),
            (2, 3)
        );
    }

    #[test]
    fn commands_reach_the_boards_until_their_queue_is_full() {
        let (mut source, bus) = memory_bus(1).unwrap();
        source.send(&frame(1)).unwrap();
        assert!(is_readable(bus.as_fd()));
        assert!(matches!(source.send(&frame(2)), Err(SendError::QueueFull)));
        assert_eq!(bus.take_sent().map(|r| r.frame), Some(frame(1)));
        assert_eq!(bus.take_sent(), None);
        assert!(!is_readable(bus.as_fd()));
        assert_eq!((source.counters().sent, source.counters().send_failures), (1, 1));
    }

    #[test]
    fn a_lost_link_is_seen_and_counted() {
        let (mut source, bus) = memory_bus(4).unwrap();
        bus.set_link(LinkState::Absent);
        assert!(is_readable(source.wakeup().fd.unwrap()));
        assert!(!bus.push(0, frame(1)));
        assert!(matches!(
            source.send(&frame(1)),
            Err(SendError::LinkLost(LinkState::Absent))
        ));
        bus.set_link(LinkState::Up);
        source.receive(0, &mut Vec::with_capacity(1));
        assert_eq!(source.link(), LinkState::Up);
        assert_eq!((source.counters().link_losses, source.counters().reopens), (1, 1));
    }
}
