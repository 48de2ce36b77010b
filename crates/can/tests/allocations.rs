//! No source allocates while frames come and go.
use std::io::Write;
use std::net::{IpAddr, UdpSocket};
use std::time::{Duration, Instant};
use taxel_allocations::during;
use taxel_can::{
    CanFrame, CanSource, FrameMerge, IdFilter, LogSource, OpenError, PressureSocket, Received, SocketCan,
    SocketCanOptions, UdpMulticast, UdpOptions, monotonic_ns,
};

#[global_allocator]
static ALLOCATOR: taxel_allocations::Counting = taxel_allocations::Counting;

fn allocations(work: impl FnOnce()) -> u64 {
    during(work).1
}

fn frame(n: u32) -> CanFrame {
    CanFrame::extended(n, &[1, 2, 3, 4, 5, 6, 7, 8]).unwrap()
}

/// What takes longer than this hangs.
const HANGS_AFTER: Duration = Duration::from_secs(200);

/// Takes what there is and forgets it.
fn drain(source: &mut dyn CanSource, now_ns: u64, batch: &mut Vec<Received>) -> usize {
    let mut count = 0;
    loop {
        let more = source.receive(now_ns, batch);
        count += batch.len();
        batch.clear();
        if !more {
            return count;
        }
    }
}

/// Takes until `count` frames have come, since the kernel may pass them on a little later.
fn take(source: &mut dyn CanSource, count: usize, batch: &mut Vec<Received>) {
    let started = Instant::now();
    let mut taken = 0;
    while taken < count {
        taken += drain(source, monotonic_ns(), batch);
        assert!(started.elapsed() < HANGS_AFTER, "{taken} of {count} frames came");
    }
    assert_eq!(taken, count);
}

/// A hundred rounds of ten frames there and one back.
fn exchange(source: &mut dyn CanSource, peer: &mut dyn CanSource, batch: &mut Vec<Received>) {
    for round in 0..100 {
        for n in 0..10 {
            peer.send(&frame(round * 10 + n)).unwrap();
        }
        take(source, 10, batch);
        source.send(&frame(round)).unwrap();
        take(peer, 1, batch);
    }
}

#[test]
fn udp_multicast() {
    // Nobody else is given its port as long as it lives, and it hears nothing of groups.
    let kept = UdpSocket::bind("127.0.0.1:0").unwrap();
    let options = UdpOptions {
        group: IpAddr::from([239, 74, 163, 2]),
        port: kept.local_addr().unwrap().port(),
        interface: Some("lo".to_owned()),
        hop_limit: 0,
        ..UdpOptions::default()
    };
    let mut source = UdpMulticast::with_options(&options).unwrap();
    let mut peer = UdpMulticast::with_options(&options).unwrap();
    let mut batch = Vec::with_capacity(64);
    let count = allocations(|| exchange(&mut source, &mut peer, &mut batch));
    assert_eq!(count, 0);
}

#[test]
fn a_recording_bad_lines_and_all() {
    let mut file = tempfile::NamedTempFile::new().unwrap();
    for n in 0..10_000 {
        writeln!(
            file,
            "({}.{:06}) can{} 00000123#0102030405060708 R",
            n / 1000,
            n % 1000,
            n % 2
        )
        .unwrap();
        writeln!(file, "nonsense").unwrap();
    }
    let mut source = LogSource::open(file.path(), Some("can1"), 0).unwrap();
    let mut batch = Vec::with_capacity(64);
    let mut received = 0;
    let count = allocations(|| {
        while let Some(now_ns) = source.wakeup().at_ns {
            received += drain(&mut source, now_ns, &mut batch);
        }
    });
    assert_eq!((received, count), (5000, 0));
    assert_eq!(source.counters().undecodable, 10_000);
}

#[test]
fn a_pressure_array_garbage_and_all() {
    let (program, socket) = std::os::unix::net::UnixDatagram::pair().unwrap();
    let mut source = PressureSocket::new(socket.into(), [28, 50], ()).unwrap();
    let _renewal = source.renewal();
    let mut message = b"TXPA\x01\x00\x1c\x00\x32\x00\x00\x00".to_vec();
    message.resize(24 + 2 * 1400, 0);
    let mut batch = Vec::with_capacity(64);
    let mut received = 0;
    let count = allocations(|| {
        for round in 0..100 {
            message[12] = round;
            program.send(&message).unwrap();
            program.send(b"garbage").unwrap();
            received += drain(&mut source, u64::from(round), &mut batch);
        }
    });
    assert_eq!((received, count), (100 * 351, 0));
    let array = source.counters().array;
    assert_eq!((array.taken, array.foreign, array.lost), (100, 100, 0));
}

/// Needs `vcan0` up, as `tests/vcan/run` makes it.
#[test]
fn socketcan() {
    if std::env::var_os("TAXEL_VCAN").is_none_or(|v| v != "1") {
        println!("SKIPPED: allocations of SocketCAN need real vcan interfaces: `tests/vcan/run`");
        return;
    }
    let open = || -> Result<SocketCan, OpenError> { SocketCan::open("vcan0", SocketCanOptions::default()) };
    let (mut source, mut peer) = (open().unwrap(), open().unwrap());
    let mut batch = Vec::with_capacity(64);
    let count = allocations(|| {
        exchange(&mut source, &mut peer, &mut batch);
        // Also when it is time to look at the interface.
        drain(&mut source, u64::MAX / 2, &mut batch);
        // And for an error frame with every cause there is.
        peer.send(&CanFrame::error(0x3FF, [0xFF; 8])).unwrap();
        take(&mut source, 1, &mut batch);
    });
    assert_eq!(count, 0);
}

/// Needs leave to make interfaces, as `tests/vcan/run` has it.
#[test]
fn socketcan_opens_an_interface_that_comes_back_without_allocating() {
    if std::env::var_os("TAXEL_VCAN").is_none_or(|v| v != "1") {
        println!("SKIPPED: an interface that comes back needs real vcan interfaces: `tests/vcan/run`");
        return;
    }
    let ip = |arguments: &str| {
        let status = std::process::Command::new("ip")
            .args(arguments.split(' '))
            .status()
            .unwrap();
        assert!(status.success(), "ip {arguments}");
    };
    let add = || {
        ip("link add tx_again type vcan");
        ip("link set tx_again up");
    };
    add();
    let options = SocketCanOptions {
        filters: vec![IdFilter::standard(0x080, 0x780)],
        ..SocketCanOptions::default()
    };
    let mut source = SocketCan::open("tx_again", options).unwrap();
    let mut batch = Vec::with_capacity(64);
    let mut now_ns = monotonic_ns();
    for reopens in 1..=3 {
        ip("link delete tx_again");
        add();
        let started = Instant::now();
        let count = allocations(|| {
            while source.counters().reopens < reopens {
                assert!(started.elapsed() < HANGS_AFTER, "it is not opened again");
                now_ns += 1_000_000_000;
                drain(&mut source, now_ns, &mut batch);
            }
        });
        assert_eq!(count, 0);
    }
    ip("link delete tx_again");
}

#[test]
fn frames_of_several_buses_are_merged_without_allocating() {
    let mut merge = FrameMerge::new(3, 16, true);
    let mut given = 0;
    let count = allocations(|| {
        for round in 0..100 {
            for bus in 0..3 {
                merge.fill(bus, round, |batch| {
                    batch.extend((0..16).map(|n| Received {
                        t_ns: round * 16 + n,
                        frame: frame(bus as u32),
                    }));
                    bus == 2
                });
            }
            while merge.pop().is_some() {
                given += 1;
            }
        }
    });
    assert_eq!((count, given), (0, 4800));
}
