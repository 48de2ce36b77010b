//! `taxel record`: everything that a running hand sends and the daemon makes of it, into an MCAP file.

mod described;
mod named;
mod outcome;
mod same_hand;

pub(crate) use outcome::words;

use self::described::preamble;
use crate::client::{control, hands};
use crate::errors::wrong_use;
use crate::notices;
use crate::piped_file::text_parser;
use crate::seconds::seconds;
use anyhow::{Context, anyhow, bail};
use serde_json::json;
use signal_hook::consts::SIGUSR1;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use taxel_playback::head::is_here;
use taxel_playback::interrupt::Interrupt;
use taxel_record::FileKind;
use taxel_recorder::{Around, CanInput, Described, Plan, Signals, Split};
use taxel_skin::Layout;
use taxel_wire::Hello;
use taxel_wire::status::{BusStatus, Status};
use taxeld::Config;
use taxeld::stdout;

/// Times of a recording, seconds.
const TIMES: RangeInclusive<f64> = 0.001..=1e6;

/// Record a running hand: raw CAN, every tactile frame and image, joints, marks, events, and what was wrong.
///
/// The file is MCAP with ROS 2 messages: Foxglove, Lichtblick, rosbags and the mcap tools open it, and so does everything
/// here that takes a recording. CAN comes over sockets of its own, those of the daemon's buses unless --can names others;
/// the daemon does not notice. What was recorded up to a second before a crash or a power loss can be read.
///
/// With --keep it records all the time and keeps only what is around a trigger: `taxel mark`, or the signal USR1.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  taxel record grasp.mcap
  taxel record grasp.mcap --config /etc/taxeld/taxeld.toml --seconds 60
  taxel record day.mcap --split-size 1GB --most-files 24      day-0001.mcap, day-0002.mcap, ..
  taxel record slip.mcap --keep 30 --after 5                  slip-0001.mcap at the first `taxel mark slipped`
  taxel record bus.mcap --no-daemon --can can0=can:can0       CAN alone")]
#[command(group(clap::ArgGroup::new("several").multiple(true).args(["split_size", "split_seconds", "keep"])))]
pub(crate) struct Args {
    /// The recording, or the name that recordings are named after; none is overwritten
    #[arg(value_name = "OUT.mcap")]
    out: PathBuf,
    /// The daemon's image socket [default: the configuration's, or where the daemon of this user, or of the system, puts it]
    #[arg(long, value_name = "PATH")]
    socket: Option<PathBuf>,
    /// Its status or control socket, which tells the buses that it reads [default: the configuration's, or status.sock beside
    /// --socket]
    #[arg(long, value_name = "PATH", conflicts_with = "no_daemon")]
    control: Option<PathBuf>,
    /// A bus, can:INTERFACE or udp:GROUP:PORT, and what it is called in the recording [default: as its interface, or as the
    /// configuration or the daemon calls it]; repeat it for several [default: those of the configuration, or that the daemon
    /// reads]
    #[arg(long, value_name = "[NAME=]SOURCE")]
    can: Vec<String>,
    /// No raw CAN
    #[arg(long, conflicts_with = "can")]
    no_can: bool,
    /// CAN alone
    #[arg(long, conflicts_with_all = ["socket", "no_can", "trigger"], requires = "can")]
    no_daemon: bool,
    /// The configuration that the daemon runs with: it and its layout go into the recording, which then can be
    /// read without them; - for stdin
    #[arg(long, value_name = "FILE", value_parser = text_parser())]
    config: Option<PathBuf>,
    /// How long to record [default: until Ctrl-C]
    #[arg(long, value_name = "S", value_parser = seconds(TIMES))]
    seconds: Option<Duration>,
    /// Goes on in another file after so many bytes, such as 500MB or 2GB
    #[arg(long, value_name = "SIZE", value_parser = size)]
    split_size: Option<u64>,
    /// Goes on in another file after so many seconds
    #[arg(long, value_name = "S", value_parser = seconds(TIMES))]
    split_seconds: Option<Duration>,
    /// Removes the oldest of the files OUT-0001.mcap, OUT-0002.mcap, .. where there are more, those of earlier runs too,
    /// and as many more as it takes where the disk is full
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..), requires = "several")]
    most_files: Option<u16>,
    /// Keeps only what is around a trigger: so many seconds before it
    #[arg(long, value_name = "S", value_parser = seconds(TIMES), conflicts_with_all = SPLITS)]
    keep: Option<Duration>,
    /// With --keep: and so many seconds behind it
    #[arg(long, value_name = "S", value_parser = seconds(TIMES), default_value = "5", requires = "keep", conflicts_with_all = SPLITS)]
    after: Duration,
    /// With --keep: what is a trigger; the signal USR1 is one in either case
    #[arg(long, value_name = "mark|signal", default_value = "mark", requires = "keep", conflicts_with_all = SPLITS)]
    trigger: Trigger,
    /// One JSON object on stdout in the end: the files, what is in them, and what is missing
    #[arg(long)]
    json: bool,
}

/// What excludes `--keep`, and its options, too: clap does not miss `--keep` beside what excludes it.
const SPLITS: [&str; 2] = ["split_size", "split_seconds"];

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Trigger {
    Mark,
    Signal,
}

fn size(text: &str) -> Result<u64, String> {
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let unit = match text[digits.len()..].to_ascii_lowercase().as_str() {
        "" | "b" => 1.0,
        "k" | "kb" => 1e3,
        "m" | "mb" => 1e6,
        "g" | "gb" => 1e9,
        "kib" => 1024.0,
        "mib" => 1024.0 * 1024.0,
        "gib" => 1024.0 * 1024.0 * 1024.0,
        _ => f64::NAN,
    };
    match digits.trim().parse::<f64>().map(|number| number * unit) {
        Ok(bytes) if (1.0..1e18).contains(&bytes) => Ok(bytes as u64),
        _ => Err(format!("{text:?} is no size; write it like 500MB or 2GiB")),
    }
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    if FileKind::of(&args.out) != Some(FileKind::Mcap) {
        return Err(wrong_use(format!(
            "{}: a recording is called NAME.mcap; `taxel convert` makes other formats of it",
            args.out.display()
        )));
    }
    let config = args.config.as_deref().map(Config::load).transpose()?;
    let config = config.as_ref().zip(args.config.as_deref());
    let sockets = args.sockets(config.map(|(config, _)| config));
    // A daemon that does not answer yet is waited for.
    let hello = sockets.as_ref().and_then(|[images, _]| same_hand::hello(images));
    let status_socket = sockets.as_ref().map(|[_, status]| status.as_path());
    if let (None, Some([images, _])) = (&hello, &sockets) {
        // Without its daemon there is nothing to record.
        match config.is_none() && args.names_no_bus() {
            true => hands::refuse_others(images, hands::socket_option)?,
            false => hands::warn_of_others(images),
        }
    }
    if let Some(hello) = &hello {
        args.check_hand(config, status_socket, hello)?;
    }
    let can = args.buses(config, status_socket, hello.is_some())?;
    let socket = sockets.as_ref().map(|[images, _]| images.clone());
    let plan = Plan {
        out: args.out.clone(),
        socket,
        can,
        split: Split {
            bytes: args.split_size,
            after_ns: args.split_seconds.map(|time| time.as_nanos() as u64),
            most_files: args.most_files.map(usize::from),
        },
        around: args.keep.map(|keep| Around {
            before_ns: keep.as_nanos() as u64,
            after_ns: args.after.as_nanos() as u64,
        }),
        mark_triggers: args.trigger == Trigger::Mark,
        duration: args.seconds,
        preamble: preamble(args.config.as_deref())?,
    };
    let interrupt = Interrupt::install()?;
    let asked = Arc::new(AtomicBool::new(false));
    signal_hook::flag::register(SIGUSR1, Arc::clone(&asked))?;
    let signals = Signals {
        stop: &|| interrupt.is_set(),
        trigger: &|| asked.swap(false, Ordering::Relaxed),
        say: &|priority, text| notices::tell(priority, &format!("taxel: {text}")),
        described: &|hello| status_socket.map(|status| args.described(hello, status, &plan.can)),
    };
    let finished = taxel_recorder::record(&plan, &signals)?;
    for (priority, line) in words(&plan, &finished) {
        notices::tell(priority, &line);
    }
    if args.json {
        stdout::print(&format!("{}\n", outcome::in_json(&finished)))?;
    }
    if let Some(failure) = finished.failure {
        return Err(failure.into());
    }
    if !finished.gone.is_empty() {
        bail!(
            "the recording is not whole in its files, since others did not leave them alone while they were made"
        );
    }
    if interrupt.is_set() && finished.files.is_empty() {
        // It was told to stop before anything came, and nothing is lost.
        return Ok(());
    }
    // A script must not go on as if it had what it asked for.
    match &plan.socket {
        Some(socket) if !finished.is_described => {
            bail!("nothing came of a daemon at {}", socket.display())
        }
        None if finished.can.iter().all(|bus| bus.frames == 0) => bail!("no CAN frame came"),
        _ => Ok(()),
    }
}

impl Args {
    /// The daemon's image socket, and that which tells its status.
    fn sockets(&self, config: Option<&Config>) -> Option<[PathBuf; 2]> {
        if self.no_daemon {
            return None;
        }
        let configured = config.map(|config| config.socket.images.clone());
        let named = self.socket.clone().or(configured);
        let images = named.unwrap_or_else(|| taxeld::config::running_socket("images.sock"));
        let status = match (&self.control, config) {
            (Some(named), _) => named.clone(),
            (None, Some(config)) if is_same_socket(&config.socket.images, &images) => {
                config.socket.status_path()
            }
            _ => images.with_file_name("status.sock"),
        };
        Some([images, status])
    }

    /// Whether the command names no bus, so that they are the configuration's or the daemon's.
    fn names_no_bus(&self) -> bool {
        self.can.is_empty() && !self.no_can
    }

    /// Refuses the configuration of another hand than the daemon's, and says where the recording will not tell which.
    fn check_hand(
        &self,
        config: Option<(&Config, &Path)>,
        status_socket: Option<&Path>,
        hello: &Hello,
    ) -> anyhow::Result<()> {
        let Some((config, file)) = config else {
            if !is_here(hello) {
                remark!(
                    "taxel: hand {} is not built in{}, and its layout will not be in the recording, which is then read with \
                     --layout alone; --config FILE, the daemon's configuration, puts it there",
                    hello.layout,
                    match Layout::builtin(&hello.layout) {
                        Some(_) => " as the daemon describes it",
                        None => "",
                    }
                );
            }
            return Ok(());
        };
        same_hand::check(config, file, hello)?;
        match status_socket
            .filter(|_| self.names_no_bus())
            .map(status_of_daemon)
        {
            Some(Ok(status)) => same_hand::check_buses(config, file, &status)?,
            Some(Err(error)) => remark!(
                "taxel: whether the daemon reads the buses of {} is not known: {error:#}",
                file.display()
            ),
            None => {}
        }
        Ok(())
    }

    /// The buses that are read.
    fn buses(
        &self,
        config: Option<(&Config, &Path)>,
        status_socket: Option<&Path>,
        daemon_runs: bool,
    ) -> anyhow::Result<Vec<CanInput>> {
        if !self.names_no_bus() {
            return named::named(&self.can, || match (config, status_socket) {
                (Some((config, _)), _) => buses_of(config),
                (None, Some(socket)) => {
                    status_of_daemon(socket).map_or_else(|_| Vec::new(), |status| buses_of_daemon(&status))
                }
                (None, None) => Vec::new(),
            });
        }
        let (can, whose) = match (config, status_socket) {
            (Some((config, file)), _) => (buses_of(config), file.display().to_string()),
            (None, Some(socket)) => {
                let status = status_of_daemon(socket).map_err(|error| match daemon_runs {
                    // It listens elsewhere.
                    true => anyhow!(
                        "the daemon sends images and does not answer at {}, so its buses are not known; --control PATH \
                         names the socket that answers, --can SOURCE the buses, --no-can leaves them out",
                        socket.display()
                    ),
                    false => error,
                });
                (buses_of_daemon(&status?), "the daemon".into())
            }
            (None, None) => return Ok(Vec::new()),
        };
        if can.is_empty() {
            remark!("taxel: no raw CAN: {whose} reads neither can: nor udp:; --can SOURCE names a bus");
        }
        Ok(can)
    }
}

/// However they are spelt; a socket that is not there is known by its spelling alone.
fn is_same_socket(a: &Path, b: &Path) -> bool {
    let whole = |path: &Path| path.canonicalize().ok();
    a == b || whole(a).is_some_and(|a| Some(a) == whole(b))
}

fn buses_of(config: &Config) -> Vec<CanInput> {
    let skin = config
        .layout
        .buses
        .iter()
        .cloned()
        .zip(config.sources.iter().cloned());
    let joints = config
        .joints_bus()
        .filter(|bus| !bus.shared)
        .map(|bus| ("joints".to_owned(), bus.address));
    let input = |(name, address)| same_hand::bus(address).map(|address| CanInput { name, address });
    skin.chain(joints).filter_map(input).collect()
}

/// What a daemon tells of itself.
fn status_of_daemon(socket: &Path) -> anyhow::Result<Status> {
    let reply = control::request(socket, &json!({"cmd": "status"})).context(
        "the daemon does not say which buses it reads; --can SOURCE names them, --no-can leaves them out",
    )?;
    Status::try_from(reply["status"].clone()).context("the daemon's status")
}

/// The buses that a daemon reads.
fn buses_of_daemon(status: &Status) -> Vec<CanInput> {
    let input = |bus: &BusStatus| {
        Some(CanInput {
            name: bus.name.clone(),
            address: bus.source.parse().ok().and_then(same_hand::bus)?,
        })
    };
    status.buses.iter().filter_map(input).collect()
}

/// A recording of all that the daemon with this image socket has, until it is stopped.
pub(crate) fn plan_of_daemon(socket: &Path, out: PathBuf) -> anyhow::Result<Plan> {
    Ok(Plan {
        out,
        socket: Some(socket.into()),
        can: buses_beside(socket)?,
        split: Split::default(),
        around: None,
        mark_triggers: false,
        duration: None,
        preamble: preamble(None)?,
    })
}

/// What such a recording goes on with where another daemon is connected to; as before where that does not say.
pub(crate) fn described_by_status(socket: &Path, plan: &Plan) -> Option<Described> {
    Some(Described {
        preamble: plan.preamble.clone(),
        can: buses_beside(socket).ok()?,
        news: None,
    })
}

/// The buses of the daemon with this image socket, whose status socket is beside it.
fn buses_beside(socket: &Path) -> anyhow::Result<Vec<CanInput>> {
    Ok(buses_of_daemon(&status_of_daemon(
        &socket.with_file_name("status.sock"),
    )?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_as_people_write_them() {
        for (text, bytes) in [
            ("500MB", 500_000_000),
            ("2 GiB", 2 << 30),
            ("1.5k", 1500),
            ("12", 12),
        ] {
            assert_eq!(size(text), Ok(bytes), "{text}");
        }
        for text in ["", "MB", "-1k", "1 parsec", "nan"] {
            assert!(size(text).is_err(), "{text}");
        }
    }
}
