//! What the kernel alone takes to send an image to many readers: the same packets to the same sockets,
//! and nothing else.
//!
//!     cargo run --release -p taxel-serve --example only_sending -- [READERS [SECONDS [BYTES]]]
//!
//! Another process reads, as `tests/siege/storms.py` does. Prints the age of a packet when it was
//! sent, from the beginning of its round, 30 rounds a second, and what one takes; beside FIFO
//! priority (`chrt -f 48`) it is to be compared with "readers alone" of that campaign.

use nix::sys::socket::{
    AddressFamily, MsgFlags, SockFlag, SockType, sendmsg, setsockopt, socketpair, sockopt,
};
use std::io::IoSlice;
use std::os::fd::AsRawFd;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Reads whatever comes on the sockets that it was given, as one that waits for all of them.
const READER: &str = "
import selectors, socket, sys
selector = selectors.DefaultSelector()
for fd in map(int, sys.argv[1:]):
    reader = socket.socket(fileno=fd)
    reader.setblocking(False)
    selector.register(reader, selectors.EVENT_READ)
packet = bytearray(1 << 17)
while True:
    for key, _ in selector.select():
        if key.fileobj.recv_into(packet) == 0:
            sys.exit()
";

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<usize> = std::env::args()
        .skip(1)
        .map(|a| a.parse())
        .collect::<Result<_, _>>()?;
    let argument = |at: usize, otherwise| arguments.get(at).copied().unwrap_or(otherwise);
    let (readers, seconds, bytes) = (argument(0, 450), argument(1, 5), argument(2, 640));

    let (mut sockets, mut theirs) = (Vec::new(), Vec::new());
    for _ in 0..readers {
        let (ours, other) = socketpair(AddressFamily::Unix, SockType::SeqPacket, None, SockFlag::empty())?;
        setsockopt(&ours, sockopt::SndBuf, &4608)?;
        sockets.push(ours);
        theirs.push(other);
    }
    let numbers = theirs.iter().map(|fd| fd.as_raw_fd().to_string());
    let mut reader = Command::new("python3")
        .args(["-c", READER])
        .args(numbers)
        .stdin(Stdio::null())
        .spawn()?;
    drop(theirs);
    std::thread::sleep(Duration::from_secs(1));

    let (header, payload) = (vec![0; 40], vec![0; bytes]);
    let packet = [IoSlice::new(&header), IoSlice::new(&payload)];
    let (mut ages, mut full, mut took) = (hdrhistogram::Histogram::<u64>::new(3)?, 0, Duration::ZERO);
    let start = Instant::now();
    for round in 0..30 * seconds as u32 {
        std::thread::sleep(
            (start + round * Duration::from_secs(1) / 30).saturating_duration_since(Instant::now()),
        );
        let began = Instant::now();
        for socket in &sockets {
            let flags = MsgFlags::MSG_DONTWAIT | MsgFlags::MSG_NOSIGNAL;
            full += u64::from(sendmsg::<()>(socket.as_raw_fd(), &packet, &[], flags, None).is_err());
            ages.saturating_record(began.elapsed().as_micros() as u64);
        }
        took += began.elapsed();
    }
    let ms = |quantile| ages.value_at_quantile(quantile) as f64 / 1000.0;
    println!(
        "{readers} readers, {} packets, {full} found a full socket; {:.2} us each; age ms p50 {:.2}, p99 {:.2}, p99.9 {:.2}, max {:.2}",
        ages.len(),
        took.as_secs_f64() * 1e6 / ages.len() as f64,
        ms(0.5),
        ms(0.99),
        ms(0.999),
        ms(1.0)
    );
    reader.kill()?;
    reader.wait()?;
    Ok(())
}
