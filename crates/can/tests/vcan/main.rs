//! The SocketCAN source on real virtual CAN interfaces.
//!
//! Runs only where `TAXEL_VCAN=1` says that this is root on a kernel with the `vcan` module and
//! iproute2, which may make and delete interfaces as it likes; `tests/vcan/run` provides such a
//! place. Each test has interfaces of its own.

mod link;
mod queue;

use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sched::{CpuSet, sched_setaffinity};
use nix::unistd::Pid;
use std::process::Command;
use std::time::{Duration, Instant};
use taxel_can::{
    BusState, CanFrame, CanSource, LinkState, Received, SocketCan, SocketCanOptions, monotonic_ns,
};

/// What takes longer than this hangs.
const HANGS_AFTER: Duration = Duration::from_secs(200);

/// Whether the tests can run here; says loudly if not.
fn vcan_is_here(test: &str) -> bool {
    let here = std::env::var_os("TAXEL_VCAN").is_some_and(|v| v == "1");
    if !here {
        println!("SKIPPED: {test} needs real vcan interfaces: `tests/vcan/run` with this test's binary");
        return false;
    }
    // Virtual interfaces queue frames per CPU, so a sender that changes its CPU can overtake itself.
    let mut cpu = CpuSet::new();
    cpu.set(0).unwrap();
    sched_setaffinity(Pid::from_raw(0), &cpu).unwrap();
    true
}

fn ip(arguments: &str) {
    let output = Command::new("ip")
        .args(arguments.split(' '))
        .output()
        .unwrap_or_else(|e| panic!("ip {arguments}: {e}"));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "ip {arguments}: {said}");
}

/// A virtual CAN interface that goes with its value.
struct Vcan(&'static str);

impl Vcan {
    fn down(name: &'static str) -> Self {
        ip(&format!("link add {name} type vcan"));
        Self(name)
    }

    fn up(name: &'static str) -> Self {
        let vcan = Self::down(name);
        vcan.set("up");
        vcan
    }

    fn set(&self, state: &str) {
        ip(&format!("link set {} {state}", self.0));
    }

    fn delete(self) {}
}

impl Drop for Vcan {
    fn drop(&mut self) {
        ip(&format!("link delete {}", self.0));
    }
}

fn open(name: &str) -> SocketCan {
    SocketCan::open(name, SocketCanOptions::default()).unwrap()
}

fn frame(n: u32) -> CanFrame {
    CanFrame::extended(n, &n.to_be_bytes()).unwrap()
}

fn numbers(received: &[Received]) -> Vec<u32> {
    received.iter().map(|r| r.frame.id()).collect()
}

/// Waits as a daemon would, for nothing but what the source asks for, until `done`; gives all that came.
fn receive_until(
    source: &mut SocketCan,
    what: &str,
    done: impl Fn(&SocketCan, &[Received]) -> bool,
) -> Vec<Received> {
    let started = Instant::now();
    let mut all = Vec::new();
    let mut batch = Vec::with_capacity(100);
    loop {
        let more = source.receive(monotonic_ns(), &mut batch);
        all.append(&mut batch);
        if more {
            continue;
        }
        if done(source, &all) {
            return all;
        }
        assert!(
            started.elapsed() < HANGS_AFTER,
            "still no {what}: link {}, {:?}",
            source.link(),
            source.counters()
        );
        let wakeup = source.wakeup();
        let pause_ns = wakeup
            .at_ns
            .map_or(1_000_000_000, |at| at.saturating_sub(monotonic_ns()));
        let timeout = PollTimeout::from((pause_ns.div_ceil(1_000_000)).min(1000) as u16);
        // A vanished interface shows as POLLERR, which needs no asking for.
        let mut waited = wakeup.fd.map(|fd| PollFd::new(fd, PollFlags::POLLIN));
        poll(waited.as_mut_slice(), timeout).unwrap();
    }
}

fn receive_count(source: &mut SocketCan, count: usize) -> Vec<Received> {
    receive_until(source, "frames", |_, all| all.len() >= count)
}

fn wait_for_link(source: &mut SocketCan, link: LinkState) {
    receive_until(source, "change of the link", |source, _| source.link() == link);
}

/// Waits on the file descriptor alone for what the kernel has to say.
fn events(source: &SocketCan) -> PollFlags {
    let mut waited = [PollFd::new(source.wakeup().fd.unwrap(), PollFlags::POLLIN)];
    poll(&mut waited, PollTimeout::try_from(HANGS_AFTER).unwrap()).unwrap();
    waited[0].revents().unwrap()
}

#[test]
fn frames_of_all_kinds_arrive_in_order() {
    if !vcan_is_here("frames in order") {
        return;
    }
    let _vcan = Vcan::up("tx_order");
    let (mut source, mut peer) = (open("tx_order"), open("tx_order"));
    assert_eq!(source.link(), LinkState::Up);
    let sent = [
        CanFrame::standard(0x20B, &[7, 0]).unwrap(),
        CanFrame::standard(0x7FF, &[]).unwrap(),
        CanFrame::extended(0x20B, &[1, 2, 3, 4, 5, 6, 7, 8]).unwrap(),
        CanFrame::remote(0x20B, false, 4).unwrap(),
        CanFrame::remote(0x20B, true, 0).unwrap(),
    ];
    for frame in &sent {
        peer.send(frame).unwrap();
    }
    let received = receive_count(&mut source, sent.len());
    assert_eq!(received.iter().map(|r| r.frame).collect::<Vec<_>>(), sent);
    assert!(received.is_sorted_by_key(|r| r.t_ns));
    assert_eq!((source.counters().received, source.counters().remote), (5, 2));
}

/// The kernel turns stamping on in the background when the first socket asks for it; frames that
/// come before are stamped when they are read.
#[test]
fn a_frame_has_the_time_it_came_and_not_the_time_it_was_read() {
    if !vcan_is_here("receive stamps") {
        return;
    }
    let _vcan = Vcan::up("tx_stamps");
    let (mut source, mut peer) = (open("tx_stamps"), open("tx_stamps"));
    let started = Instant::now();
    loop {
        let before_ns = monotonic_ns();
        peer.send(&frame(1)).unwrap();
        let after_ns = monotonic_ns();
        std::thread::sleep(Duration::from_millis(200));
        let t_ns = receive_count(&mut source, 1)[0].t_ns;
        assert!(t_ns <= monotonic_ns());
        // The allowance is for the conversion between the clocks.
        if (before_ns - 50_000_000..after_ns + 50_000_000).contains(&t_ns) {
            return;
        }
        assert!(
            started.elapsed() < HANGS_AFTER,
            "{t_ns} is not in {before_ns}..{after_ns}"
        );
    }
}

#[test]
fn own_frames_do_not_come_back_but_others_on_this_machine_see_them() {
    if !vcan_is_here("own frames") {
        return;
    }
    let _vcan = Vcan::up("tx_own");
    let (mut source, mut peer) = (open("tx_own"), open("tx_own"));
    source.send(&frame(1)).unwrap();
    peer.send(&frame(2)).unwrap();
    assert_eq!(numbers(&receive_count(&mut source, 1)), [2]);
    assert_eq!(numbers(&receive_count(&mut peer, 1)), [1]);
    assert_eq!((source.counters().sent, source.counters().received), (1, 1));
}

#[test]
fn injected_error_frames_are_counted_by_cause_and_set_the_bus_state() {
    if !vcan_is_here("error frames") {
        return;
    }
    let _vcan = Vcan::up("tx_error");
    let (mut source, mut peer) = (open("tx_error"), open("tx_error"));
    // Bus-off with error counters: 0x20000240.
    peer.send(&CanFrame::error(0x240, [0, 0, 0, 0, 0, 0, 248, 0]))
        .unwrap();
    receive_count(&mut source, 1);
    assert_eq!(source.counters().bus_state, BusState::BusOff);
    peer.send(&CanFrame::error(0x100, [0; 8])).unwrap();
    receive_count(&mut source, 1);
    assert_eq!(source.counters().bus_state, BusState::ErrorActive);
    // Receive overflow and error-passive; then a bus error nobody acknowledged.
    peer.send(&CanFrame::error(0x204, [0, 0x11, 0, 0, 0, 0, 0, 130]))
        .unwrap();
    peer.send(&CanFrame::error(0x0A8, [0; 8])).unwrap();
    receive_count(&mut source, 2);
    let counters = source.counters();
    assert_eq!(counters.bus_state, BusState::ErrorPassive);
    let errors = counters.errors;
    assert_eq!((errors.frames, errors.bus_off, errors.restarted), (4, 1, 1));
    assert_eq!((errors.controller, errors.controller_overflow), (1, 1));
    assert_eq!(
        (errors.protocol, errors.no_acknowledge, errors.bus_error),
        (1, 1, 1)
    );
    assert_eq!(counters.received, 4);
}

#[test]
fn calls_without_a_reason_find_nothing_and_lose_nothing() {
    if !vcan_is_here("spurious calls") {
        return;
    }
    let _vcan = Vcan::up("tx_spurious");
    let (mut source, mut peer) = (open("tx_spurious"), open("tx_spurious"));
    let mut batch = Vec::with_capacity(3);
    assert!(!source.receive(monotonic_ns(), &mut batch));
    let mut all = Vec::new();
    for n in 0..200 {
        // No room: nothing is taken, and there may be more.
        assert!(source.receive(monotonic_ns(), &mut Vec::new()));
        for _ in 0..n % 8 {
            peer.send(&frame(n)).unwrap();
        }
        // Called whether or not the kernel has passed the frames on by now.
        while source.receive(monotonic_ns(), &mut batch) {
            assert_eq!((batch.len(), batch.capacity()), (3, 3));
            all.append(&mut batch);
        }
        all.append(&mut batch);
        // `append` leaves the capacity where it was.
        assert_eq!(batch.capacity(), 3);
    }
    all.append(&mut receive_count(&mut source, 700 - all.len()));
    assert!(!source.receive(monotonic_ns(), &mut batch) && batch.is_empty());
    let sent: Vec<u32> = (0..200).flat_map(|n| vec![n; n as usize % 8]).collect();
    assert_eq!(numbers(&all), sent);
}
