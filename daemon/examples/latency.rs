//! How long an image takes: from the last frame of a sweep leaving the sender to the image in a
//! subscriber's hands.
//!
//!     cargo run --release -p taxeld --example latency [-- SWEEPS [HZ]]
//!
//! Sender, daemon and subscriber are threads of one process; frames travel as python-can's
//! `udp_multicast` datagrams over the loopback interface, images over the daemon's Unix socket, in
//! `sweep` mode. What is measured includes both kernel paths, decoding, assembly, conditioning,
//! compression and encoding; it does not include a CAN wire.

use hdrhistogram::Histogram;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};
use taxel_can::{CanFrame, SourceAddress, monotonic_ns};
use taxel_engine::TickMode;
use taxel_skin::Layout;
use taxel_wire::{Received, Subscriber};
use taxeld::{Config, Daemon};

type Problem = Box<dyn std::error::Error + Send + Sync>;

/// How hard half of the hand is pressed, counts, and how much harder from one sweep to the next, so
/// that an image tells which sweep it is of.
const PRESS: f64 = 2000.0;
const STEP: f64 = 20.0;
/// Sweeps until the press starts anew.
const SENT: usize = 250;

/// When the last frame of each of the newest sweeps was about to be sent, nanoseconds; 0 for not yet.
struct SentTimes {
    times: [AtomicU64; SENT],
    done: AtomicBool,
}

/// Frames sent without a pause; the receiver's kernel queue must hold them.
const BURST: usize = 60;

fn main() -> Result<(), Problem> {
    let mut arguments = std::env::args().skip(1);
    let sweeps: u64 = arguments.next().map_or(Ok(3000), |a| a.parse())?;
    let rate_hz: f64 = arguments.next().map_or(Ok(100.0), |a| a.parse())?;

    let folder = tempfile::tempdir()?;
    let layout = Layout::builtin("allegro-uskin-15").ok_or("no such layout")?;
    let port = 20_000 + (std::process::id() % 20_000) as u16;
    let sources: Vec<SourceAddress> = (0..layout.buses.len() as u16)
        .map(|bus| format!("udp:239.74.163.2:{}?hops=0", port + bus).parse())
        .collect::<Result<_, _>>()?;
    let mut config = Config::new(layout.clone(), sources.clone());
    config.tick.mode = TickMode::Sweep;
    config.socket.images = folder.path().join("images.sock");
    config.socket.control = folder.path().join("control.sock");
    config.conditioning.calibration_ms = 1000;
    let daemon = Daemon::start(config.clone())?;

    let mut buses = sources
        .iter()
        .map(|address| taxel_can::open(address, &taxel_can::SourceOptions::default()))
        .collect::<Result<Vec<_>, _>>()?;
    let sent = Arc::new(SentTimes {
        times: [const { AtomicU64::new(0) }; SENT],
        done: false.into(),
    });
    let subscriber = std::thread::spawn({
        let (images, sent) = (config.socket.images.clone(), sent.clone());
        move || receive(&images, &sent)
    });
    std::thread::sleep(Duration::from_millis(200));

    let start = Instant::now();
    // The first second is the daemon's calibration window.
    let warm_up = (1.5 * rate_hz) as u64;
    for sweep in 0..sweeps + warm_up {
        let due = start + Duration::from_secs_f64(sweep as f64 / rate_hz);
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
        let press = sweep
            .checked_sub(warm_up)
            .map_or(0.0, |s| PRESS + STEP * (s as usize % SENT) as f64);
        let time = &sent.times[sweep.saturating_sub(warm_up) as usize % SENT];
        for (i, (bus, frame)) in frames(&layout, sweep, press as u16)?.into_iter().enumerate() {
            if i == layout.len() - 1 {
                time.store(if press > 0.0 { monotonic_ns() } else { 0 }, Ordering::Release);
            } else if i % BURST == BURST - 1 {
                // The bus's own pace would be far slower.
                std::thread::sleep(Duration::from_micros(100));
            }
            buses[usize::from(bus)].send(&frame)?;
        }
    }
    std::thread::sleep(Duration::from_millis(300));
    sent.done.store(true, Ordering::Release);
    let latency = subscriber.join().map_err(|_| "the subscriber panicked")??;
    daemon.stop()?;
    let us = |quantile| latency.value_at_quantile(quantile) as f64 / 1000.0;
    println!(
        "{} of {sweeps} sweeps of {} taxels at {rate_hz} Hz arrived whole; last frame sent to image in hand:\n\
         p50 {:.0} us, p90 {:.0} us, p99 {:.0} us, p99.9 {:.0} us, max {:.0} us",
        latency.len(),
        layout.len(),
        us(0.5),
        us(0.9),
        us(0.99),
        us(0.999),
        us(1.0)
    );
    Ok(())
}

/// Every taxel once, as the boards would send it; half of the hand is pressed.
fn frames(layout: &Layout, sweep: u64, press: u16) -> Result<Vec<(u8, CanFrame)>, Problem> {
    (0..layout.len())
        .map(|taxel| {
            let board = layout.wiring_of(taxel);
            // Idle noise of a few counts, without which the taxel would be called stuck.
            let noise = ((sweep * 7 + taxel as u64 * 13) % 9) as u16;
            let press = if taxel % 2 == 0 { press } else { 0 };
            // Shear beside the normal force: a jump of one axis alone would be held back as a glitch.
            let counts = [32_768 + noise, 32_700 + noise + press / 2, 13_000 + noise + press];
            let frame = board.protocol.frame(board.board, layout.k[taxel], counts, 0x80);
            Ok((board.bus, frame.ok_or("a taxel without an id")?))
        })
        .collect()
}

/// Takes images until the sender is done, and matches each complete one to its sweep by the force it shows.
fn receive(images: &std::path::Path, sent: &SentTimes) -> Result<Histogram<u64>, Problem> {
    let mut latency = Histogram::new(3)?;
    let mut subscriber = Subscriber::connect(images)?;
    while !sent.done.load(Ordering::Acquire) {
        let Some(received) = subscriber.next_timeout(Duration::from_millis(200))? else {
            continue;
        };
        let now_ns = monotonic_ns();
        if let Received::Image(_, image) = received
            && image.contacts > 0
            && image.missing == 0
        {
            let force = image.levels().last().unwrap_or(0.0);
            let sweep = ((force as f64 / 1.25_f64.sqrt() - PRESS) / STEP).round() as u64;
            // Zero is a sweep that was cut in two at its deadline, and seen already.
            match sent.times[sweep as usize % SENT].swap(0, Ordering::AcqRel) {
                0 => {}
                sent_ns => latency.record(now_ns.saturating_sub(sent_ns).max(1))?,
            }
        }
    }
    Ok(latency)
}
