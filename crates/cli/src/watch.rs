//! `taxel watch`: one line per image of a running daemon.

use crate::{image_line, raw_line};
use anyhow::Context;
use std::io::{self, Write};
use std::path::PathBuf;
use std::time::SystemTime;
use taxel_wire::{Clock, Header, Hello, Received, Subscribe, Subscriber};

/// Print one line per tactile image of a running daemon.
///
/// In words: number, time, latency from the newest reading to here, taxels in contact, actuators
/// that press, the strongest force, and what is missing, faulty or was skipped because this reader
/// was slow. What the daemon tells people (calibrating, paused) goes to stderr.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
With --json each line is one object:
  {\"seq\",\"t_ns\",\"latency_us\",\"width\",\"height\",\"image\":[H*W of 0..255],\"levels\":[forces],
   \"actuators\":[{\"id\",\"x\",\"y\",\"level\",\"force\"}],\"contacts\",\"faulty\",\"missing\",\"joints\":[rad]}
latency_us is null when the daemon plays a recording. With --raw as well:
  {\"seq\",\"t_ns\",\"latency_us\",\"threshold\",\"taxels\":[{\"counts\":[x,y,z],\"force\",\"contact\",\"repaired\",
   \"age_us\",\"status\",\"faults\":[names]}],\"joints\":[rad]}

Examples:
  taxel watch --count 10
  taxel watch --json | jq .contacts
  taxel watch --raw --json --count 1 > counts.json
  taxel watch --socket /tmp/taxeld-1000/images.sock")]
pub(crate) struct Args {
    /// The daemon's image socket [default: where the daemon of this user, or of the system, puts it]
    #[arg(long, value_name = "PATH")]
    socket: Option<PathBuf>,
    /// Stop after so many lines
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    count: Option<u64>,
    /// One JSON object per line
    #[arg(long)]
    json: bool,
    /// Raw frames instead of images: every taxel's counts, force and faults
    #[arg(long)]
    raw: bool,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let socket = args
        .socket
        .clone()
        .unwrap_or_else(|| taxeld::config::running_socket("images.sock"));
    let mut subscriber = Subscriber::connect(&socket)?;
    if args.raw {
        subscriber.subscribe(&Subscribe {
            image: false,
            raw: true,
            ..Subscribe::default()
        })?;
    }
    let mut out = io::stdout().lock();
    let mut clock = Clock::Unknown;
    let mut names = Vec::new();
    let mut described = String::new();
    let mut lines = 0;
    while args.count.is_none_or(|count| lines < count) {
        let line = match subscriber.next()? {
            Received::Image(header, image) if !args.raw => {
                let latency_ns = latency_ns(clock, &header);
                match args.json {
                    true => image_line::json(&header, &image, latency_ns),
                    false => image_line::words(&header, &image, latency_ns),
                }
            }
            Received::Raw(header, raw) if args.raw => {
                let latency_ns = latency_ns(clock, &header);
                match args.json {
                    true => raw_line::json(&header, &raw, latency_ns),
                    false => raw_line::words(&header, &raw, latency_ns, &names),
                }
            }
            Received::Hello(hello) => {
                clock = hello.clock;
                names = raw_line::names(hello);
                // It also comes in answer to the subscription.
                let description = describe(hello);
                if !args.json && description != described {
                    eprintln!("{description}");
                }
                described = description;
                continue;
            }
            Received::Event(_, event) => {
                eprintln!("taxeld: {}", event.message);
                continue;
            }
            _ => continue,
        };
        writeln!(out, "{line}").context("stdout")?;
        lines += 1;
    }
    Ok(())
}

/// From a message's time of validity to now, nanoseconds; none where the clock tells none.
pub(crate) fn latency_ns(clock: Clock, header: &Header) -> Option<i64> {
    let now_ns = match clock {
        Clock::Monotonic => taxel_can::monotonic_ns(),
        Clock::Realtime => SystemTime::now()
            .duration_since(SystemTime::UNIX_EPOCH)
            .ok()?
            .as_nanos() as u64,
        Clock::Recording | Clock::Unknown => return None,
    };
    Some(now_ns.wrapping_sub(header.t_ns) as i64)
}

fn describe(hello: &Hello) -> String {
    let Hello {
        daemon,
        layout,
        width,
        height,
        profile,
        rate,
        force_unit,
        ..
    } = hello;
    let joints = match hello.joints.len() {
        0 => String::new(),
        joints => format!(", {joints} joints"),
    };
    let rate = match rate.hz {
        Some(hz) => format!("{} {hz} Hz", rate.mode),
        None => rate.mode.clone(),
    };
    format!(
        "{daemon}: {layout}, {} taxels, {width}x{height} image, {} levels, {} actuators, method {}, {rate}, \
         forces in {force_unit}{joints}",
        hello.taxels.len(),
        profile.levels,
        profile.actuators,
        profile.method,
    )
}
