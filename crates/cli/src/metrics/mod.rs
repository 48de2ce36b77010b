//! `taxel metrics`: the daemon's counts and times for Prometheus and its like.

mod families;
mod numbers;
mod text;

use crate::everyday::Ask;
use anyhow::Context;
use families::Format;
use serde_json::json;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream, ToSocketAddrs};
use std::path::PathBuf;
use std::time::Duration;
use taxel_playback::output_file::OutputFile;
use taxel_wire::status::Status;

/// How long a client may take to ask, and to take the answer.
const PATIENCE: Duration = Duration::from_secs(2);
/// The most bytes of a request that are read.
const REQUEST: u64 = 8192;

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
    /// Write them to this file again and again, whole each time, for node_exporter's textfile collector
    #[arg(long, value_name = "FILE")]
    textfile: Option<PathBuf>,
    /// Seconds between two writes of --textfile, 0.1 to 3600
    #[arg(long, value_name = "S", default_value = "15", value_parser = seconds, requires = "textfile")]
    every: Duration,
    /// Once, as a JSON object for each sample, a line each: {"name", "labels", "value"}
    #[arg(long, conflicts_with_all = ["listen", "textfile"])]
    json: bool,
}

fn address(text: &str) -> Result<SocketAddr, String> {
    let named = text.to_socket_addrs().ok().and_then(|mut named| named.next());
    named.ok_or_else(|| "give an address and a port, such as 127.0.0.1:9464".into())
}

fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok().filter(|s| (0.1..=3600.0).contains(s));
    seconds
        .map(Duration::from_secs_f64)
        .ok_or_else(|| format!("{text} is not 0.1 to 3600 seconds"))
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    if let Some(address) = args.listen {
        let listener = TcpListener::bind(address).with_context(|| format!("cannot listen at {address}"))?;
        eprintln!(
            "metrics at http://{}/metrics; Ctrl-C stops it",
            listener.local_addr()?
        );
        return serve(&listener, &args.ask);
    }
    let Some(path) = &args.textfile else {
        let mut out = std::io::stdout().lock();
        let status = status(&args.ask);
        if let Err(error) = &status {
            eprintln!("taxel: {error:#}; so taxeld_up is 0");
        }
        let format = if args.json {
            Format::Json
        } else {
            Format::Prometheus
        };
        let text = text::of(status.as_ref().ok(), format);
        return Ok(out.write_all(text.as_bytes()).and_then(|()| out.flush())?);
    };
    loop {
        OutputFile::write(path, metrics(&args.ask, Format::Prometheus))?;
        std::thread::sleep(args.every);
    }
}

/// What the daemon tells now.
fn metrics(ask: &Ask, format: Format) -> String {
    text::of(status(ask).as_ref().ok(), format)
}

fn status(ask: &Ask) -> anyhow::Result<Status> {
    let reply = ask.send(&json!({ "cmd": "status" }))?;
    Ok(Status::try_from(reply["status"].clone())?)
}

/// Answers one client after the other; one that is slow holds up the others for no longer than [`PATIENCE`].
fn serve(listener: &TcpListener, ask: &Ask) -> anyhow::Result<()> {
    loop {
        let (client, _) = listener.accept().context("cannot take a connection")?;
        // A client that leaves early is none of our business.
        let _ = answer(client, ask);
    }
}

fn answer(mut client: TcpStream, ask: &Ask) -> std::io::Result<()> {
    client.set_read_timeout(Some(PATIENCE))?;
    client.set_write_timeout(Some(PATIENCE))?;
    let mut request = BufReader::new(client.try_clone()?.take(REQUEST));
    let mut first = String::new();
    request.read_line(&mut first)?;
    let mut format = Format::Prometheus;
    let mut line = String::new();
    while request.read_line(&mut line)? > 2 {
        if let Some((name, value)) = line.split_once(':')
            && name.eq_ignore_ascii_case("accept")
        {
            format = Format::accepted(value);
        }
        line.clear();
    }
    let path = first
        .strip_prefix("GET ")
        .and_then(|rest| rest.split([' ', '?']).next());
    let (status, kind, body) = match path {
        Some("/metrics") => ("200 OK", format.content_type(), metrics(ask, format)),
        Some(_) => (
            "404 Not Found",
            "text/plain",
            "metrics are at /metrics\n".to_owned(),
        ),
        None => (
            "405 Method Not Allowed",
            "text/plain",
            "GET /metrics\n".to_owned(),
        ),
    };
    let length = body.len();
    write!(
        client,
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n{body}"
    )
}
