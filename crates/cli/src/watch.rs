//! `taxel watch`: one line per image of a running daemon.

use crate::client::rates::Rates;
use crate::client::reconnect::with_daemon;
use crate::notices;
use anyhow::Context;
use ratatui::crossterm::terminal::window_size;
use std::io::{self, IsTerminal, Write};
use std::path::PathBuf;
use std::time::{Instant, SystemTime};
use taxel_hand::plural;
use taxel_playback::{image_line, raw_line};
use taxel_view::shortened;
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
   \"actuators\":[{\"id\",\"x\",\"y\",\"level\",\"force\"}],\"contacts\",\"faulty\",\"missing\",\"joints\":[rad],
   \"skipped\",\"calibrating\",\"saturated\",\"repaired\"}
latency_us is null when the daemon plays a recording; skipped counts the images that this reader
was too slow for since the line before; calibrating is true while the baseline is measured, and the
image is empty; saturated where a taxel is at an end of its range, repaired where a value was
unwrapped or a glitch held back. With --raw as well:
  {\"seq\",\"t_ns\",\"latency_us\",\"threshold\",\"taxels\":[{\"counts\":[x,y,z],\"force\",\"contact\",\"repaired\",
   \"age_us\",\"status\",\"faults\":[names]}],\"joints\":[rad],\"skipped\",\"calibrating\"}
With --hz:
  {\"hz\",\"received_hz\",\"skipped\",\"longest_gap_ms\",\"latency_p50_us\",\"latency_p99_us\",\"latency_max_us\",
   \"contacts\",\"missing\",\"faulty\"}

Examples:
  taxel watch --count 10
  taxel watch --json | jq .contacts
  taxel watch --raw --json --count 1 > counts.json
  taxel watch --hz --reconnect               is it still running, and how well
  taxel watch --socket /tmp/taxeld-1000/images.sock")]
pub(crate) struct Args {
    /// The daemon's image socket [default: where the daemon of this user, or of the system, puts it]
    #[arg(long, value_name = "PATH")]
    socket: Option<PathBuf>,
    /// Stop after so many lines
    #[arg(long, value_name = "N", value_parser = count)]
    count: Option<u64>,
    /// One JSON object per line
    #[arg(long)]
    json: bool,
    /// Raw frames instead of images: every taxel's counts, force and faults
    #[arg(long, conflicts_with = "hz")]
    raw: bool,
    /// Rates instead of images, a line a second, in place on a terminal: images made and received here, their latency,
    /// the longest time without one
    #[arg(long)]
    hz: bool,
    /// Wait for the daemon, at the start and whenever it is gone, instead of ending
    #[arg(long)]
    reconnect: bool,
}

fn count(text: &str) -> Result<u64, String> {
    let count = text.parse().ok().filter(|count| *count > 0);
    count.ok_or_else(|| format!("{text} is no number of lines; give 1 or more"))
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let mut watch = Watch {
        args,
        in_place: args.hz && !args.json && io::stdout().is_terminal(),
        out: io::stdout().lock(),
        lines: 0,
        described: String::new(),
    };
    with_daemon(args.socket.as_deref(), args.reconnect, |subscriber, _| {
        watch.print(subscriber)
    })?;
    if watch.in_place {
        writeln!(watch.out).context("stdout")?;
    }
    Ok(())
}

struct Watch<'a> {
    args: &'a Args,
    /// Whether each line takes the place of the one before.
    in_place: bool,
    out: io::StdoutLock<'a>,
    lines: u64,
    /// What was said of the hand.
    described: String,
}

impl Watch<'_> {
    /// Prints lines until there are as many as were asked for, or the connection ends.
    fn print(&mut self, mut subscriber: Subscriber) -> anyhow::Result<()> {
        let args = self.args;
        if args.raw {
            subscriber.subscribe(&Subscribe {
                image: false,
                raw: true,
                ..Subscribe::default()
            })?;
        }
        let mut clock = Clock::Unknown;
        let mut names = Vec::new();
        let mut rates = args.hz.then(|| Rates::new(Instant::now()));
        while args.count.is_none_or(|count| self.lines < count) {
            if let Some(rates) = &mut rates {
                let now = Instant::now();
                if now >= rates.due() {
                    self.line(&rates.line(now, args.json))?;
                    continue;
                }
            }
            let left = rates
                .as_ref()
                .map(|rates| rates.due().saturating_duration_since(Instant::now()));
            let received = match left {
                Some(left) => subscriber.next_timeout(left)?,
                None => Some(subscriber.next()?),
            };
            let line = match received {
                Some(Received::Image(header, image)) if !args.raw => {
                    let latency_ns = latency_ns(clock, &header);
                    if let Some(rates) = &mut rates {
                        rates.image(&header, &image, latency_ns, Instant::now());
                        continue;
                    }
                    match args.json {
                        true => image_line::json(&header, &image, latency_ns),
                        false => image_line::words(&header, &image, latency_ns),
                    }
                }
                Some(Received::Raw(header, raw)) if args.raw => {
                    let latency_ns = latency_ns(clock, &header);
                    match args.json {
                        true => raw_line::json(&header, &raw, latency_ns),
                        false => raw_line::words(&header, &raw, latency_ns, &names),
                    }
                }
                Some(Received::Hello(hello)) => {
                    clock = hello.clock;
                    names = raw_line::names(hello);
                    // It also comes in answer to the subscription.
                    let description = describe(hello);
                    if !args.json && description != self.described {
                        notices::say(&description);
                    }
                    self.described = description;
                    continue;
                }
                Some(Received::Event(_, event)) => {
                    notices::say(&format!("taxeld: {}", event.message));
                    continue;
                }
                _ => continue,
            };
            self.line(&line)?;
        }
        Ok(())
    }

    fn line(&mut self, line: &str) -> anyhow::Result<()> {
        self.lines += 1;
        match self.in_place {
            // To the start of the line, which is cleared; what a window that is narrower by now has no room for is cut off.
            true => {
                let line = match window_size() {
                    Ok(window) if window.columns > 0 => shortened(line, window.columns.into()),
                    _ => line.to_owned(),
                };
                write!(self.out, "\r\x1b[K\x1b[?7l{line}\x1b[?7h").and_then(|()| self.out.flush())
            }
            false => writeln!(self.out, "{line}"),
        }
        .context("stdout")
    }
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
        joints => format!(", {}", plural(joints, "joint")),
    };
    let rate = match rate.hz {
        Some(hz) => format!("{} {hz} Hz", rate.mode),
        None => rate.mode.clone(),
    };
    format!(
        "{daemon}: {layout}, {}, {height}x{width} image, {}, {}, method {}, {rate}, \
         forces in {force_unit}{joints}",
        plural(hello.taxels.len(), "taxel"),
        plural(profile.levels, "level"),
        plural(profile.actuators, "actuator"),
        profile.method,
    )
}
