//! Prints what comes from any CAN source as a candump log: `cargo run -p taxel-can --example
//! candump -- udp:`.
//!
//! A second argument is how many seconds to listen; without it a live source is listened to for ever.

use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use std::error::Error;
use std::io::{Write, stdout};
use taxel_can::{LogWriter, SourceAddress, SourceOptions, monotonic_ns, open};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let address: SourceAddress = arguments
        .next()
        .ok_or("usage: candump SOURCE [SECONDS]")?
        .parse()?;
    let start_ns = monotonic_ns();
    let end_ns = match arguments.next() {
        Some(seconds) => start_ns + (seconds.parse::<f64>()? * 1e9) as u64,
        None => u64::MAX,
    };
    let mut source = open(
        &address,
        &SourceOptions {
            start_ns,
            ..SourceOptions::default()
        },
    )?;
    let mut log = LogWriter::new(stdout().lock());
    let mut batch = Vec::with_capacity(256);
    let mut link = None;
    while !source.is_finished() && monotonic_ns() < end_ns {
        let now_ns = monotonic_ns();
        while source.receive(now_ns, &mut batch) || !batch.is_empty() {
            for received in batch.drain(..) {
                log.write(received.t_ns, "bus", &received.frame)?;
            }
        }
        log.flush()?;
        if link.replace(source.link()) != Some(source.link()) {
            eprintln!("{address} is {}", source.link());
        }
        let wakeup = source.wakeup();
        let until_ns = wakeup.at_ns.unwrap_or(u64::MAX).min(end_ns);
        let pause_ms = until_ns.saturating_sub(monotonic_ns()).div_ceil(1_000_000);
        let timeout = PollTimeout::try_from(pause_ms.min(60_000) as u32)?;
        // POLLERR needs no asking for.
        let mut waited = wakeup.fd.map(|fd| PollFd::new(fd, PollFlags::POLLIN));
        poll(waited.as_mut_slice(), timeout)?;
    }
    std::io::stderr().write_all(format!("{:#?}\n", source.counters()).as_bytes())?;
    Ok(())
}
