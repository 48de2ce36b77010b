//! `taxel metrics`: the daemon's counts and times for Prometheus and its like.

mod families;
mod http;
mod numbers;
mod shared_ask;
mod text;

use crate::errors::describe;
use crate::everyday::Ask;
use crate::notices;
use crate::seconds::seconds;
use anyhow::Context;
use families::Format;
use serde_json::json;
use std::net::{SocketAddr, TcpListener, ToSocketAddrs};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use taxel_playback::output_file::OutputFile;
use taxel_wire::status::Status;
use taxeld::stdout;

/// Give the running daemon's counts and times to Prometheus and Grafana.
///
/// They are in Prometheus' text format, and over HTTP in OpenMetrics for who asks for it. A program beside the daemon:
/// each time it is asked, it asks the daemon's status socket. Where no daemon answers,
/// `taxeld_up` is 0. Without options the metrics are printed once. docs/grafana/taxeld.json is a dashboard for them.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  taxel metrics                                            once, on stdout
  taxel metrics --listen 127.0.0.1:9464                    for Prometheus to fetch, at /metrics
  taxel metrics --textfile /var/lib/node_exporter/taxeld.prom --every 15")]
pub(crate) struct Args {
    #[command(flatten)]
    ask: Ask,
    /// Answer HTTP requests for /metrics here; port 0 takes a free one
    #[arg(long, value_name = "ADDRESS:PORT", value_parser = address, conflicts_with = "textfile")]
    listen: Option<SocketAddr>,
    /// Write them to this file again and again, whole each time, for node_exporter's textfile collector; where a later
    /// write fails, it is said once and tried again
    #[arg(long, value_name = "FILE")]
    textfile: Option<PathBuf>,
    /// With --textfile: seconds between two writes, 0.1 to 3600
    #[arg(long, value_name = "S", default_value = "15", value_parser = seconds(0.1..=3600.0), requires = "textfile",
          conflicts_with_all = ["listen", "json"])]
    every: Duration,
    /// Once, as a JSON object for each sample, a line each: {"name", "labels", "value"}
    #[arg(long, conflicts_with_all = ["listen", "textfile"])]
    json: bool,
}

fn address(text: &str) -> Result<SocketAddr, String> {
    let named = text.to_socket_addrs().ok().and_then(|mut named| named.next());
    named.ok_or_else(|| "give an address and a port, such as 127.0.0.1:9464".into())
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    if let Some(address) = args.listen {
        let listener = TcpListener::bind(address).with_context(|| format!("cannot listen at {address}"))?;
        say!(
            "metrics at http://{}/metrics; Ctrl-C stops it",
            listener.local_addr()?
        );
        return http::serve(listener, Daemon::new(&args.ask));
    }
    let Some(path) = &args.textfile else {
        let status = status(&args.ask);
        if let Err(error) = &status {
            notices::warn(&format!("taxel: {error:#}; so taxeld_up is 0"));
        }
        let format = if args.json {
            Format::Json
        } else {
            Format::Prometheus
        };
        return stdout::print(&text::of(status.as_ref().ok(), format));
    };
    write_again_and_again(path, args)
}

/// Writes the file until the program is ended. Only the first write has to succeed, or the name is wrong; later the
/// disk may be full or the folder away for a while.
fn write_again_and_again(path: &Path, args: &Args) -> anyhow::Result<()> {
    let daemon = Daemon::new(&args.ask);
    let write = || {
        let status = daemon.status();
        OutputFile::write(path, text::of(status.as_ref(), Format::Prometheus))
    };
    write()?;
    let mut has_failed = false;
    loop {
        std::thread::sleep(args.every);
        let failed_before = has_failed;
        let written = write();
        has_failed = written.is_err();
        match written {
            Err(error) if !failed_before => notices::warn(&format!(
                "taxel: {}; it is tried again every {:?}",
                describe(&error),
                args.every
            )),
            Ok(()) if failed_before => notices::say(&format!("taxel: {}: is written again", path.display())),
            _ => {}
        }
    }
}

/// A daemon that is asked again and again.
#[derive(Debug)]
struct Daemon {
    ask: Ask,
    is_failing: AtomicBool,
}

impl Daemon {
    fn new(ask: &Ask) -> Self {
        let (ask, is_failing) = (ask.clone(), AtomicBool::new(false));
        Self { ask, is_failing }
    }

    /// What it tells. Where it tells nothing, why is said once until it does.
    fn status(&self) -> Option<Status> {
        let status = status(&self.ask);
        let has_failed = self.is_failing.swap(status.is_err(), Ordering::Relaxed);
        match status {
            Err(error) if !has_failed => {
                notices::warn(&format!("taxel: {}; so taxeld_up is 0", describe(&error)));
                None
            }
            status => status.ok(),
        }
    }
}

fn status(ask: &Ask) -> anyhow::Result<Status> {
    let reply = ask.send(&json!({ "cmd": "status" }))?;
    Ok(Status::try_from(reply["status"].clone())?)
}
