//! `taxel watch`: one line per image of a running daemon.

mod asked;
mod reader_of_stdout;

use crate::client::rates::Rates;
use crate::client::reconnect::with_daemon;
use crate::notices;
use anyhow::Context;
use asked::Asked;
use ratatui::crossterm::terminal::window_size;
use reader_of_stdout::ReaderOfStdout;
use std::convert::Infallible;
use std::io::{self, IsTerminal, Write};
use std::os::fd::AsFd;
use std::path::PathBuf;
use std::time::{Duration, Instant, SystemTime};
use taxel_hand::plural;
use taxel_playback::{image_line, raw_line};
use taxel_view::shortened;
use taxel_wire::{Body, Clock, Header, Hello, ReadError, Received, Subscriber, decode_packet};

/// Print one line per tactile image of a running daemon.
///
/// In words: number, time, latency from the newest reading to here, taxels in contact, actuators
/// that press, the strongest force, and what is missing, faulty or was skipped because this reader
/// was slow. What the daemon tells people (calibrating, paused) goes to stderr.
///
/// A pipe holds many lines: what a slow program reads may be seconds old. For a display there is
/// --newest: a line is written when the one before was read, and what was passed over for it counts
/// as skipped. For recordings there is --every.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
With --json each line is one object:
  {\"seq\",\"t_ns\",\"latency_us\",\"width\",\"height\",\"image\":[H*W of 0..255],\"levels\":[forces],
   \"actuators\":[{\"id\",\"x\",\"y\",\"level\",\"force\"}],\"contacts\",\"faulty\",\"missing\",\"joints\":[rad],
   \"skipped\",\"calibrating\",\"saturated\",\"repaired\"}
latency_us is of when the line is written, and null when the daemon plays a recording; skipped
counts the images that this reader was not given since the line before, as it was too slow or asked
for fewer; calibrating is true while the baseline is measured, and the image is empty; saturated
where a taxel is at an end of its range, repaired where a value was unwrapped or a glitch held back.
With --raw as well:
  {\"seq\",\"t_ns\",\"latency_us\",\"threshold\",\"taxels\":[{\"counts\":[x,y,z],\"force\",\"contact\",\"repaired\",
   \"age_us\",\"status\",\"faults\":[names]}],\"joints\":[rad],\"skipped\",\"calibrating\"}
With --hz:
  {\"hz\",\"received_hz\",\"skipped\",\"longest_gap_ms\",\"latency_p50_us\",\"latency_p99_us\",\"latency_max_us\",
   \"contacts\",\"missing\",\"faulty\"}

Examples:
  taxel watch --count 10
  taxel watch --json | jq .contacts
  taxel watch --json --every | gzip > images.jsonl.gz
  taxel watch --json --newest --profile '{\"levels\": 4, \"actuators\": 5}' --region index,thumb
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
    /// The newest image for a program that reads the lines through a pipe, a FIFO or a Unix socket, however slowly; what it
    /// was too slow for is passed over. For displays
    #[arg(long, conflicts_with_all = ["hz", "count", "every"])]
    newest: bool,
    /// Every image in order, also for a program that is too slow: the daemon keeps them. For recordings and analyses
    #[arg(long, conflicts_with_all = ["hz", "max_rate"])]
    every: bool,
    /// The most images per second, each when it is made, for a program that is slower than they are
    #[arg(long, value_name = "HZ", value_parser = asked::rate)]
    max_rate: Option<f64>,
    /// What the display can do that is to show the images: a JSON object, or the file that has one, - for stdin; its keys are
    /// those of `[profile]` in the configuration [default: the daemon's own profile]
    #[arg(long, value_name = "JSON|FILE", conflicts_with = "raw")]
    profile: Option<String>,
    /// The parts of the hand that are shown, such as index,thumb [default: the whole hand]
    #[arg(long, value_name = "PART,PART", value_delimiter = ',', conflicts_with = "raw")]
    region: Vec<String>,
}

fn count(text: &str) -> Result<u64, String> {
    let count = text.parse().ok().filter(|count| *count > 0);
    count.ok_or_else(|| format!("{text} is no number of lines; give 1 or more"))
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let reader = match args.newest {
        true => ReaderOfStdout::of(io::stdout()).context("stdout")?,
        false => None,
    };
    let mut watch = Watch {
        args,
        asked: Asked::of(args)?,
        reader,
        in_place: args.hz && !args.json && io::stdout().is_terminal(),
        out: io::stdout().lock(),
        lines: 0,
        described: String::new(),
        clock: Clock::Unknown,
        names: Vec::new(),
        rates: None,
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
    asked: Asked,
    /// Where a program reads stdout, and is to be given what is new.
    reader: Option<ReaderOfStdout>,
    /// Whether each line takes the place of the one before.
    in_place: bool,
    out: io::StdoutLock<'a>,
    lines: u64,
    /// What was said of the hand.
    described: String,
    /// That of what comes.
    clock: Clock,
    /// Those of its taxels.
    names: Vec<String>,
    /// Where lines are rates.
    rates: Option<Rates>,
}

impl Watch<'_> {
    /// Prints lines until there are as many as were asked for, or the connection ends.
    fn print(&mut self, mut subscriber: Subscriber) -> anyhow::Result<()> {
        if let Some(subscribe) = &self.asked.subscribe {
            subscriber.subscribe(subscribe)?;
        }
        self.asked.sent();
        self.clock = Clock::Unknown;
        self.names.clear();
        self.rates = self.args.hz.then(|| Rates::new(Instant::now()));
        let Some(mut reader) = self.reader.take() else {
            return self.print_all(&mut subscriber);
        };
        let mut newest = Newest::default();
        let Err(error) = self.print_newest(&mut subscriber, &mut reader, &mut newest);
        let printed = match error.is::<ReadError>() {
            // What came last is printed, and no line ends in its middle.
            true => self.print_last(&mut reader, &mut newest),
            false => Ok(()),
        };
        self.reader = Some(reader);
        printed.and(Err(error))
    }

    /// Prints each line, however long it takes to be written.
    fn print_all(&mut self, subscriber: &mut Subscriber) -> anyhow::Result<()> {
        while self.args.count.is_none_or(|count| self.lines < count) {
            let now = Instant::now();
            let due = self.rates.as_ref().map(Rates::due);
            if let Some(rates) = &mut self.rates
                && now >= rates.due()
            {
                let line = rates.line(now, self.args.json);
                self.line(&line)?;
                continue;
            }
            let received = match due {
                Some(due) => subscriber.next_timeout(due.saturating_duration_since(now))?,
                None => Some(subscriber.next()?),
            };
            if let Some(received) = received
                && self.is_to_be_printed(&received)?
            {
                let line = self.text(subscriber.packet(), 0)?;
                self.line(&line)?;
            }
        }
        Ok(())
    }

    /// Prints a line whenever the one before was taken, of the newest that has come by then.
    fn print_newest(
        &mut self,
        subscriber: &mut Subscriber,
        reader: &mut ReaderOfStdout,
        newest: &mut Newest,
    ) -> anyhow::Result<Infallible> {
        loop {
            let gives = !newest.packet.is_empty() || !reader.is_between_lines();
            let ready = reader.wait(Some(subscriber.as_fd()), gives).context("stdout")?;
            // First what is new. Of a text that is not whole yet the rest is on its way.
            if ready.other
                && let Some(received) = subscriber.next_timeout(Duration::ZERO)?
                && self.is_to_be_printed(&received)?
            {
                newest.replace(subscriber.packet())?;
            }
            if ready.reader {
                self.give(reader, newest)?;
            }
        }
    }

    /// Prints what is left where nothing comes any more.
    fn print_last(&mut self, reader: &mut ReaderOfStdout, newest: &mut Newest) -> anyhow::Result<()> {
        while !reader.is_between_lines() || !newest.packet.is_empty() {
            reader.wait(None, true).context("stdout")?;
            self.give(reader, newest)?;
        }
        Ok(())
    }

    /// Gives the reader what it has room for: the rest of a line, or a new one.
    fn give(&mut self, reader: &mut ReaderOfStdout, newest: &mut Newest) -> anyhow::Result<()> {
        if reader.is_between_lines() {
            reader.begin(&self.text(&newest.packet, newest.passed_over)?);
            *newest = Newest::default();
        }
        reader.write().context("stdout")
    }

    /// Takes a message; returns whether it is one that makes a line.
    fn is_to_be_printed(&mut self, received: &Received<'_>) -> anyhow::Result<bool> {
        self.asked.look_into(received)?;
        match received {
            // Made for the daemon's own display, before it has read what was asked for.
            Received::Image(..) | Received::Raw(..) if !self.asked.is_in_force() => Ok(false),
            Received::Image(header, image) if !self.args.raw => {
                if let Some(rates) = &mut self.rates {
                    rates.image(header, image, latency_ns(self.clock, header), Instant::now());
                }
                Ok(self.rates.is_none())
            }
            Received::Raw(..) => Ok(self.args.raw),
            Received::Hello(hello) => {
                self.clock = hello.clock;
                self.names = raw_line::names(hello);
                // It also comes in answer to the subscription.
                let description = describe(hello);
                if !self.args.json && self.asked.is_in_force() && description != self.described {
                    notices::say(&description);
                    self.described = description;
                }
                Ok(false)
            }
            Received::Event(_, event) => {
                notices::say(&format!("taxeld: {}", event.message));
                Ok(false)
            }
            _ => Ok(false),
        }
    }

    /// The line of an image or a raw frame, before which others were passed over.
    fn text(&self, packet: &[u8], passed_over: u32) -> anyhow::Result<String> {
        let message = decode_packet(packet)?;
        let header = message.header;
        let header = header.with_skipped(header.skipped.saturating_add(passed_over));
        let latency_ns = latency_ns(self.clock, &header);
        Ok(match (message.body, self.args.json) {
            (Body::Image(image), true) => image_line::json(&header, &image, latency_ns),
            (Body::Image(image), false) => image_line::words(&header, &image, latency_ns),
            (Body::Raw(raw), true) => raw_line::json(&header, &raw, latency_ns),
            (Body::Raw(raw), false) => raw_line::words(&header, &raw, latency_ns, &self.names),
            (other, _) => unreachable!("{other:?} makes no line"),
        })
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

/// What is to be printed next, until something newer takes its place.
#[derive(Debug, Default)]
struct Newest {
    /// Empty where there is nothing.
    packet: Vec<u8>,
    /// How many were passed over for it, here and on the way here.
    passed_over: u32,
}

impl Newest {
    fn replace(&mut self, packet: &[u8]) -> anyhow::Result<()> {
        if !self.packet.is_empty() {
            let skipped = Header::decode(&self.packet)?.skipped;
            self.passed_over = self.passed_over.saturating_add(skipped).saturating_add(1);
        }
        self.packet.clear();
        self.packet.extend_from_slice(packet);
        Ok(())
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
