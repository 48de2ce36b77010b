//! Two buses at full load: is every frame received, used and in time?
//!
//!     cargo run --release -p taxeld --example bus_load -- SOURCE SOURCE [SECONDS [FRAMES_PER_SECOND]]
//!
//! Sends taxel frames of the default hand on both buses at an even pace, by default 9,000 frames/s
//! each, the most that 1 Mbit/s carries, while the daemon reads them in the same process; then
//! prints what became of each. On real vcan:
//!
//!     tests/vcan/run -- bash -c 'ip link add vcan1 type vcan && ip link set vcan1 up &&
//!         exec target/release/examples/bus_load can:vcan0 can:vcan1 60'

use std::time::{Duration, Instant};
use taxel_can::{CanFrame, CanSource, SourceAddress, SourceOptions};
use taxel_engine::TickMode;
use taxel_skin::Layout;
use taxeld::{Config, Daemon};

/// Frames of this much time are sent at once.
const COALESCE: Duration = Duration::from_millis(1);

type Problem = Box<dyn std::error::Error + Send + Sync>;

fn main() -> Result<(), Problem> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [first, second, rest @ ..] = arguments.as_slice() else {
        return Err("give the two buses, such as: bus_load can:vcan0 can:vcan1 60".into());
    };
    let sources: Vec<SourceAddress> = vec![first.parse()?, second.parse()?];
    let seconds: f64 = rest.first().map_or(Ok(60.0), |a| a.parse())?;
    let rate: f64 = rest.get(1).map_or(Ok(9000.0), |a| a.parse())?;

    let folder = tempfile::tempdir()?;
    let layout = Layout::builtin("allegro-uskin-15").ok_or("no such layout")?;
    let mut config = Config::new(layout.clone(), sources.clone());
    config.tick.mode = TickMode::Sweep;
    config.sweep.settle_ms = 0.0;
    config.socket.images = folder.path().join("images.sock");
    config.socket.control = folder.path().join("control.sock");
    let control = config.socket.control.clone();
    let daemon = Daemon::start(config)?;
    std::thread::sleep(Duration::from_millis(500));

    let senders: Vec<_> = (sources.iter().enumerate())
        .map(|(bus, source)| {
            let (layout, source) = (layout.clone(), source.clone());
            std::thread::spawn(move || send(&layout, bus as u8, &source, seconds, rate))
        })
        .collect();
    let mut sent = Vec::new();
    for sender in senders {
        sent.push(sender.join().map_err(|_| "a sender panicked")??);
    }
    std::thread::sleep(Duration::from_millis(500));
    let status = ask_status(&control)?;
    daemon.stop()?;

    let mut lost_or_late = 0;
    for (bus, (sent, took)) in status["buses"]
        .as_array()
        .ok_or("a status without buses")?
        .iter()
        .zip(sent)
    {
        let count = |key: &str| bus[key].as_u64().unwrap_or(0);
        println!(
            "{} {}: {sent} sent in {:.1} s ({:.0}/s), {} received, {} used, {} late, {} duplicate, \
             {} lost in the kernel",
            bus["name"],
            bus["source"],
            took.as_secs_f64(),
            sent as f64 / took.as_secs_f64(),
            count("received"),
            count("used"),
            count("late"),
            count("duplicate"),
            count("lost_in_kernel"),
        );
        lost_or_late += sent.abs_diff(count("used"));
    }
    println!("images: {}", status["images"]);
    if lost_or_late > 0 {
        return Err(format!("{lost_or_late} frames were lost or not used").into());
    }
    println!("nothing lost, nothing late");
    Ok(())
}

/// Sends whole sweeps at an even pace; returns how many frames, and how long it took.
///
/// A sender that was held up does not catch up: a bus never carries more than its rate.
fn send(
    layout: &Layout,
    bus: u8,
    source: &SourceAddress,
    seconds: f64,
    rate: f64,
) -> Result<(u64, Duration), Problem> {
    let frames: Vec<CanFrame> = (0..layout.len())
        .map(|taxel| (layout.wiring_of(taxel), layout.k[taxel]))
        .filter(|(wiring, _)| wiring.bus == bus)
        .filter_map(|(wiring, k)| {
            wiring
                .protocol
                .frame(wiring.board, k, [32_768, 32_700, 13_000], 0x80)
        })
        .collect();
    let mut sender: Box<dyn CanSource> = taxel_can::open(source, &SourceOptions::default())?;
    let sweeps = (seconds * rate / frames.len() as f64) as u64;
    let start = Instant::now();
    let mut due = Duration::ZERO;
    for i in 0..sweeps * frames.len() as u64 {
        let now = start.elapsed();
        due = (due + Duration::from_secs_f64(1.0 / rate)).max(now.saturating_sub(COALESCE));
        // Sleeping for each frame costs more than a frame; a millisecond of frames goes out at once.
        if due.saturating_sub(now) > COALESCE {
            std::thread::sleep(due - now);
        }
        while let Err(error) = sender.send(&frames[(i % frames.len() as u64) as usize]) {
            if start.elapsed() > due + Duration::from_secs(5) {
                return Err(error.into());
            }
            std::thread::sleep(Duration::from_micros(200));
        }
    }
    Ok((sweeps * frames.len() as u64, start.elapsed()))
}

fn ask_status(control: &std::path::Path) -> Result<serde_json::Value, Problem> {
    use std::io::{BufRead, BufReader, Write};
    let mut socket = std::os::unix::net::UnixStream::connect(control)?;
    socket.write_all(b"{\"cmd\":\"status\"}\n")?;
    let mut reply = String::new();
    BufReader::new(socket).read_line(&mut reply)?;
    Ok(serde_json::from_str::<serde_json::Value>(&reply)?["status"].take())
}
