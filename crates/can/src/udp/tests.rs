use super::*;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sched::{CpuSet, sched_getaffinity, sched_setaffinity};
use nix::unistd::Pid;
use std::net::UdpSocket;
use std::time::{Duration, Instant};

/// A port that nobody else is given as long as the socket lives, which hears nothing of groups; datagrams stay on this machine.
fn options() -> (UdpSocket, UdpOptions) {
    let kept = UdpSocket::bind("127.0.0.1:0").unwrap();
    let options = UdpOptions {
        port: kept.local_addr().unwrap().port(),
        interface: Some("lo".to_owned()),
        hop_limit: 0,
        ..UdpOptions::default()
    };
    (kept, options)
}

fn frame(n: u16) -> CanFrame {
    CanFrame::standard(n, &n.to_be_bytes()).unwrap()
}

/// What takes longer than this hangs.
const HANGS_AFTER: Duration = Duration::from_secs(200);

/// Waits as a daemon would, for nothing but what the source asks for, until `done`; gives all that came.
fn receive_until(
    source: &mut UdpMulticast,
    done: impl Fn(&SourceCounters, &[Received]) -> bool,
) -> Vec<Received> {
    let started = Instant::now();
    let mut all = Vec::new();
    let mut batch = Vec::with_capacity(64);
    loop {
        while source.receive(monotonic_ns(), &mut batch) {
            all.append(&mut batch);
        }
        all.append(&mut batch);
        if done(source.counters(), &all) {
            return all;
        }
        assert!(started.elapsed() < HANGS_AFTER, "{:?}", source.counters());
        let wakeup = source.wakeup();
        let pause_ns = wakeup.at_ns.unwrap().saturating_sub(monotonic_ns());
        let timeout = PollTimeout::try_from(pause_ns.div_ceil(1_000_000) as u32).unwrap();
        poll(&mut [PollFd::new(wakeup.fd.unwrap(), PollFlags::POLLIN)], timeout).unwrap();
    }
}

fn receive(source: &mut UdpMulticast, count: usize) -> Vec<Received> {
    receive_until(source, |_, all| all.len() >= count)
}

/// The loopback queues datagrams per CPU, so a sender that changes its CPU can overtake itself.
pub(crate) fn stay_on_one_cpu() {
    let mut here = CpuSet::new();
    let allowed = sched_getaffinity(Pid::from_raw(0)).unwrap();
    let cpu = (0..CpuSet::count()).find(|cpu| allowed.is_set(*cpu).unwrap());
    here.set(cpu.unwrap()).unwrap();
    sched_setaffinity(Pid::from_raw(0), &here).unwrap();
}

#[test]
fn two_sources_hear_each_other_and_not_themselves() {
    stay_on_one_cpu();
    let (_kept, options) = options();
    let mut a = UdpMulticast::with_options(&options).unwrap();
    let mut b = UdpMulticast::with_options(&options).unwrap();
    let before_ns = monotonic_ns();
    for n in 0..100 {
        a.send(&frame(n)).unwrap();
    }
    b.send(&frame(500)).unwrap();
    let at_b = receive(&mut b, 100);
    let frames: Vec<CanFrame> = at_b.iter().map(|r| r.frame).collect();
    assert_eq!(frames, (0..100).map(frame).collect::<Vec<_>>());
    assert!(at_b.is_sorted_by_key(|r| r.t_ns));
    // The kernel's stamp, converted: between sending and now, but for the error of the conversion.
    let after_ns = monotonic_ns();
    assert!(
        at_b.iter()
            .all(|r| r.t_ns + 100_000_000 >= before_ns && r.t_ns <= after_ns)
    );
    let at_a = receive(&mut a, 1);
    assert_eq!(at_a.iter().map(|r| r.frame).collect::<Vec<_>>(), [frame(500)]);
    assert_eq!((a.counters().sent, a.counters().received), (100, 1));
    assert_eq!((b.counters().sent, b.counters().received), (1, 100));
}

#[test]
fn another_group_of_the_same_port_stays_out() {
    let (_kept, options) = options();
    let mut ours = UdpMulticast::with_options(&options).unwrap();
    let mut other = UdpMulticast::with_options(&UdpOptions {
        group: "239.74.163.3".parse().unwrap(),
        ..options.clone()
    })
    .unwrap();
    let mut peer = UdpMulticast::with_options(&options).unwrap();
    other.send(&frame(1)).unwrap();
    peer.send(&frame(2)).unwrap();
    let frames: Vec<CanFrame> = receive(&mut ours, 1).iter().map(|r| r.frame).collect();
    assert_eq!(frames, [frame(2)]);
}

#[test]
fn nonsense_is_counted_and_does_not_hide_what_follows() {
    let (_kept, options) = options();
    let mut source = UdpMulticast::with_options(&options).unwrap();
    let mut peer = UdpMulticast::with_options(&options).unwrap();
    let mut fd_frame = [0; python_can::LARGEST];
    let fd_frame = python_can::encode(&frame(1), 0.0, &mut fd_frame).unwrap();
    let fd_frame: Vec<u8> = {
        let at = fd_frame.windows(5).position(|w| w == b"is_fd").unwrap();
        let mut bytes = fd_frame.to_vec();
        bytes[at + 5] = 0xC3;
        bytes
    };
    // A map with one unknown entry that is longer than what is read.
    let mut over_long = b"\x81\xa1a\xc5\x20\x00".to_vec();
    over_long.resize(over_long.len() + 0x2000, 0);
    for datagram in [&b""[..], b"hello", &fd_frame, &over_long] {
        send(peer.sender.as_raw_fd(), datagram, MsgFlags::empty()).unwrap();
    }
    peer.send(&frame(7)).unwrap();
    let frames: Vec<CanFrame> = receive(&mut source, 1).iter().map(|r| r.frame).collect();
    assert_eq!(frames, [frame(7)]);
    let counters = source.counters();
    assert_eq!((counters.undecodable, counters.can_fd), (4, 1));
}

#[test]
fn a_queue_that_is_too_small_counts_every_loss() {
    let (_kept, options) = options();
    let mut source = UdpMulticast::with_options(&UdpOptions {
        receive_buffer: 8192,
        ..options.clone()
    })
    .unwrap();
    let mut peer = UdpMulticast::with_options(&options).unwrap();
    for n in 0..1000 {
        peer.send(&frame(n)).unwrap();
    }
    // No datagram comes that could tell of the losses, so the source asks the kernel by itself.
    let received = receive_until(&mut source, |counters, _| {
        counters.received + counters.lost_in_kernel == 1000
    });
    assert!(received.len() < 1000);
    // The next datagram tells it again.
    peer.send(&frame(1000)).unwrap();
    receive(&mut source, 1);
    let counters = source.counters();
    assert_eq!(counters.received + counters.lost_in_kernel, 1001);
}

#[test]
fn a_large_burst_fits_the_default_queue_where_the_kernel_allows_one() {
    let (_kept, options) = options();
    let mut source = UdpMulticast::with_options(&options).unwrap();
    let mut peer = UdpMulticast::with_options(&options).unwrap();
    for n in 0..2000 {
        peer.send(&frame(n)).unwrap();
    }
    receive_until(&mut source, |counters, _| {
        counters.received + counters.lost_in_kernel == 2000
    });
    if source.receive_buffer() >= 4 << 20 {
        assert_eq!(source.counters().lost_in_kernel, 0);
    }
}

#[test]
fn python_cans_ipv6_group_works_where_ipv6_has_a_route_for_it() {
    let (_kept, options) = options();
    let options = UdpOptions {
        group: "ff15:7079:7468:6f6e:6465:6d6f:6d63:6173".parse().unwrap(),
        interface: None,
        ..options.clone()
    };
    let (mut a, mut b) = match (
        UdpMulticast::with_options(&options),
        UdpMulticast::with_options(&options),
    ) {
        (Ok(a), Ok(b)) => (a, b),
        (Err(e), _) | (_, Err(e)) => {
            println!("SKIPPED: no IPv6 multicast on this machine: {e}");
            return;
        }
    };
    a.send(&frame(1)).unwrap();
    b.send(&frame(2)).unwrap();
    assert_eq!(receive(&mut b, 1)[0].frame, frame(1));
    assert_eq!(receive(&mut a, 1)[0].frame, frame(2));
}

#[test]
fn an_ipv6_group_of_narrow_scope_needs_no_interface_to_be_received() {
    // All of IPv6 is IPv4, too: nobody may have the port there.
    let options = UdpOptions {
        group: "ff12::7461:7865".parse().unwrap(),
        interface: None,
        ..options().1
    };
    let receiver = new_socket(options.group).unwrap();
    match bind(receiver.as_raw_fd(), &group_address(&options, 0)) {
        Err(Errno::EINVAL) => bind_to_group(&receiver, &options, 0).unwrap(),
        other => println!("SKIPPED: binding to a link-local group gave {other:?} here, not EINVAL"),
    }
}

#[test]
fn an_address_that_is_no_group_is_refused() {
    let error = UdpMulticast::with_options(&UdpOptions {
        group: "127.0.0.1".parse().unwrap(),
        ..options().1
    })
    .err()
    .unwrap();
    assert!(error.to_string().contains("not a multicast group"));
}

#[test]
fn a_flood_of_what_is_no_frame_does_not_keep_its_reader_for_ever() {
    stay_on_one_cpu();
    let (_kept, options) = options();
    let mut source = UdpMulticast::with_options(&options).unwrap();
    let flood = UdpMulticast::with_options(&options).unwrap();
    for _ in 0..500 {
        send(flood.sender.as_raw_fd(), b"nonsense", MsgFlags::empty()).unwrap();
    }
    let mut batch = Vec::with_capacity(16);
    let mut calls = 0;
    let started = Instant::now();
    while source.counters().undecodable < 500 {
        assert!(started.elapsed() < HANGS_AFTER, "{:?}", source.counters());
        let before = source.counters().undecodable;
        source.receive(monotonic_ns(), &mut batch);
        let read = source.counters().undecodable - before;
        assert!(read <= 16, "{read} in one call");
        calls += u64::from(read > 0);
    }
    assert!(calls >= 500 / 16);
}
