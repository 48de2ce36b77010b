//! Ten different displays on one hand at 1 kHz: what does each cost the tick thread, and are they in time?
//!
//!     cargo run --release -p taxeld --example displays -- [SCENE [SECONDS [RATE_HZ]]]
//!
//! Prints for each display what was set aside for it and what it took, then how late the last of a
//! tick's ten images was. By default every taxel is in contact, which is the most work there is.

use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::time::Duration;
use taxel_hand::{Method, Profile};
use taxel_skin::Layout;
use taxel_wire::{Subscribe, Subscriber};
use taxeld::{Config, Daemon};

type Problem = Box<dyn std::error::Error + Send + Sync>;

fn main() -> Result<(), Problem> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let scene = arguments.first().map_or("worst-case", String::as_str);
    let seconds: f64 = arguments.get(1).map_or(Ok(10.0), |a| a.parse())?;
    let rate_hz: f64 = arguments.get(2).map_or(Ok(1000.0), |a| a.parse())?;

    let folder = tempfile::tempdir()?;
    let layout = Layout::builtin("allegro-uskin-15").ok_or("no such layout")?;
    let sources = layout.buses.iter().map(|_| format!("sim:{scene}").parse());
    let mut config = Config::new(layout.clone(), sources.collect::<Result<_, _>>()?);
    config.tick.rate_hz = rate_hz;
    config.socket.images = folder.path().join("images.sock");
    config.socket.control = folder.path().join("control.sock");
    let daemon = Daemon::start(config.clone())?;

    let methods = [Method::Optimal, Method::Paper];
    let sizes = [(4, 5), (8, 16), (8, 32), (16, 16), (32, 64)];
    let displays = methods
        .iter()
        .flat_map(|method| sizes.map(|size| (*method, size)));
    let readers: Vec<_> = displays
        .map(|(method, (levels, actuators))| {
            let mut subscriber = Subscriber::connect(&config.socket.images)?;
            subscriber.subscribe(&Subscribe {
                profile: Some(Profile {
                    method,
                    levels,
                    actuators,
                    ..Profile::default()
                }),
                ..Subscribe::default()
            })?;
            Ok(std::thread::spawn(move || while subscriber.next().is_ok() {}))
        })
        .collect::<Result<_, Problem>>()?;

    std::thread::sleep(Duration::from_secs_f64(3.0 + seconds));
    let mut control = UnixStream::connect(&config.socket.control)?;
    writeln!(control, "{}", json!({ "cmd": "status" }))?;
    let mut line = String::new();
    BufReader::new(control).read_line(&mut line)?;
    let status = &serde_json::from_str::<Value>(&line)?["status"];
    daemon.stop()?;
    for reader in readers {
        reader.join().map_err(|_| "a reader panicked")?;
    }

    println!("levels actuators method   images  reserved      p50      p99  us per tick");
    let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
    for made in status["profiles"].as_array().ok_or("no profiles in the status")? {
        let (profile, cost) = (&made["profile"], &made["cost_us"]);
        println!(
            "{:>6} {:>9} {:<8} {:>6}  {:>8.1} {:>8.1} {:>8.1}",
            profile["levels"],
            profile["actuators"],
            profile["method"].as_str().unwrap_or("?"),
            made["images"],
            number(&cost["reserved"]),
            number(&cost["p50"]),
            number(&cost["p99"]),
        );
    }
    println!("{} {}", status["profile_budget"], status["images"]);
    let skipped = status["subscribers"].as_array().map(|all| {
        let of = |s: &Value| {
            (
                s["skipped"].as_u64().unwrap_or(0),
                s["images"].as_u64().unwrap_or(0),
            )
        };
        all.iter().map(of).fold((0, 0), |a, b| (a.0 + b.0, a.1 + b.1))
    });
    println!("skipped, sent: {skipped:?}");
    Ok(())
}
