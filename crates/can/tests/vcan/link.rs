//! Interfaces that go down, vanish, come back, or are not there yet.

use super::*;
use nix::poll::PollFlags;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use taxel_can::{CanSource, LinkState, OpenError, SendError, SocketCan, SocketCanOptions, monotonic_ns};

#[test]
fn a_link_that_goes_down_wakes_the_reader_and_works_again_when_it_is_up() {
    if !vcan_is_here("link down and up") {
        return;
    }
    let vcan = Vcan::up("tx_updown");
    let (mut source, mut peer) = (open("tx_updown"), open("tx_updown"));
    receive_until(&mut source, "link", |s, _| s.link() == LinkState::Up);
    vcan.set("down");
    assert!(events(&source).contains(PollFlags::POLLERR));
    wait_for_link(&mut source, LinkState::Down);
    assert!(matches!(
        source.send(&frame(1)),
        Err(SendError::LinkLost(LinkState::Down))
    ));
    vcan.set("up");
    wait_for_link(&mut source, LinkState::Up);
    wait_for_link(&mut peer, LinkState::Up);
    peer.send(&frame(2)).unwrap();
    assert_eq!(numbers(&receive_count(&mut source, 1)), [2]);
    let counters = source.counters();
    assert_eq!(
        (counters.link_losses, counters.reopens, counters.send_failures),
        (1, 0, 1)
    );
}

#[test]
fn an_interface_deleted_and_made_anew_under_load_is_opened_again() {
    if !vcan_is_here("delete and re-create under load") {
        return;
    }
    let vcan = Vcan::up("tx_replug");
    let mut source = open("tx_replug");
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        // A board does not know that the adapter is gone.
        scope.spawn(|| {
            let mut peer = open("tx_replug");
            let mut nothing = Vec::with_capacity(100);
            for n in 0.. {
                if stop.load(Ordering::Relaxed) {
                    return;
                }
                let _ = peer.send(&frame(n));
                nothing.clear();
                peer.receive(monotonic_ns(), &mut nothing);
                std::thread::sleep(Duration::from_micros(200));
            }
        });
        // The sender must not outlive a failing assertion.
        let _stop = StopAtEnd(&stop);
        let first = receive_count(&mut source, 100);
        assert!(numbers(&first).is_sorted_by(|a, b| a < b));
        for round in 1..=3 {
            let old_fd = fd_number(&source);
            drop(Vcan("tx_replug"));
            wait_for_link(&mut source, LinkState::Absent);
            assert!(source.wakeup().fd.is_none() && source.wakeup().at_ns.is_some());
            std::mem::forget(Vcan::up("tx_replug"));
            wait_for_link(&mut source, LinkState::Up);
            receive_count(&mut source, 100);
            assert!(old_fd.is_some() && fd_number(&source).is_some());
            let counters = source.counters();
            assert_eq!((counters.link_losses, counters.reopens), (round, round));
        }
    });
    drop(vcan);
}

fn fd_number(source: &SocketCan) -> Option<i32> {
    use std::os::fd::AsRawFd;
    source.wakeup().fd.map(|fd| fd.as_raw_fd())
}

struct StopAtEnd<'a>(&'a AtomicBool);

impl Drop for StopAtEnd<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

#[test]
fn an_interface_replaced_between_two_looks_is_told_by_its_index() {
    if !vcan_is_here("replaced between two looks") {
        return;
    }
    let vcan = Vcan::up("tx_swap");
    let mut source = open("tx_swap");
    receive_until(&mut source, "link", |s, _| s.link() == LinkState::Up);
    let old_fd = fd_number(&source);
    vcan.delete();
    let _vcan = Vcan::up("tx_swap");
    receive_until(&mut source, "reopening", |s, _| s.counters().reopens == 1);
    assert_eq!((source.link(), source.counters().link_losses), (LinkState::Up, 1));
    assert_ne!(
        fd_number(&source),
        old_fd,
        "a waiter can tell by the number that it must register anew"
    );
    open("tx_swap").send(&frame(3)).unwrap();
    assert_eq!(numbers(&receive_count(&mut source, 1)), [3]);
}

#[test]
fn frames_queued_when_the_interface_vanished_are_still_delivered() {
    if !vcan_is_here("frames queued at the loss") {
        return;
    }
    let vcan = Vcan::up("tx_queued");
    let (mut source, mut peer) = (open("tx_queued"), open("tx_queued"));
    for n in 0..500 {
        peer.send(&frame(n)).unwrap();
    }
    vcan.delete();
    let received = receive_until(&mut source, "loss", |s, _| s.link() == LinkState::Absent);
    assert_eq!(numbers(&received), (0..500).collect::<Vec<_>>());
    assert_eq!(source.counters().lost_in_kernel, 0);
}

#[test]
fn an_interface_that_does_not_exist_yet_is_waited_for() {
    if !vcan_is_here("open before the interface exists") {
        return;
    }
    let mut source = open("tx_late");
    assert_eq!((source.link(), source.receive_buffer()), (LinkState::Absent, 0));
    assert!(matches!(
        source.send(&frame(1)),
        Err(SendError::LinkLost(LinkState::Absent))
    ));
    let mut batch = Vec::with_capacity(1);
    assert!(!source.receive(monotonic_ns(), &mut batch));
    let vcan = Vcan::down("tx_late");
    wait_for_link(&mut source, LinkState::Down);
    vcan.set("up");
    wait_for_link(&mut source, LinkState::Up);
    open("tx_late").send(&frame(4)).unwrap();
    assert_eq!(numbers(&receive_count(&mut source, 1)), [4]);
    let counters = source.counters();
    assert_eq!(
        (counters.link_losses, counters.reopens),
        (0, 0),
        "it was never lost"
    );
}

#[test]
fn looks_at_an_absent_interface_become_rarer_up_to_four_a_second() {
    if !vcan_is_here("back-off") {
        return;
    }
    let mut source = open("tx_never");
    let mut batch = Vec::with_capacity(1);
    let mut now_ns = monotonic_ns();
    let mut pauses_ms = Vec::new();
    for _ in 0..8 {
        source.receive(now_ns, &mut batch);
        let at_ns = source.wakeup().at_ns.unwrap();
        pauses_ms.push((at_ns - now_ns) / 1_000_000);
        // A call before its time changes nothing.
        source.receive(at_ns - 1, &mut batch);
        assert_eq!(source.wakeup().at_ns, Some(at_ns));
        now_ns = at_ns;
    }
    assert_eq!(pauses_ms, [50, 100, 200, 250, 250, 250, 250, 250]);
}

#[test]
fn what_is_no_can_interface_is_refused() {
    if !vcan_is_here("no CAN interface") {
        return;
    }
    let refused = SocketCan::open("lo", SocketCanOptions::default());
    assert!(matches!(refused, Err(OpenError::NotCan { .. })));
}
