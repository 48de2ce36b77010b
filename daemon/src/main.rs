//! `taxeld`: from a robot hand's skin to tactile displays, in real time.

mod log;

use crate::log::{Flush, Log};
use anyhow::Context;
use clap::Parser;
use nix::sys::signal::{SigSet, Signal};
use sd_notify::NotifyState;
use signal_hook::iterator::Signals;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;
use taxeld::{Config, ConfigError, Daemon};
use tracing_subscriber::EnvFilter;

/// Reads a robot hand's skin from CAN and gives tactile images to display drivers.
///
/// The configuration is one TOML file; docs/guide.md says what is in it. Display drivers connect to
/// the images socket (docs/wire.md); `taxel watch` shows what they are given. RUST_LOG=debug says
/// more.
#[derive(Parser)]
#[command(version, after_help = "Example:\n  taxeld --config /etc/taxeld/taxeld.toml")]
struct Arguments {
    /// The configuration file.
    #[arg(long, value_name = "FILE")]
    config: PathBuf,
    /// Only check the configuration file, and say what it would run.
    #[arg(long)]
    check: bool,
}

/// The exit status where the configuration is at fault: `EX_CONFIG` of sysexits(3). To start again
/// would not help.
const BAD_CONFIG: u8 = 78;

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("Error: {error:?}");
            if error.is::<ConfigError>() {
                ExitCode::from(BAD_CONFIG)
            } else {
                ExitCode::FAILURE
            }
        }
    }
}

fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let _flush = log_to_stderr().context("cannot start the thread that writes the log")?;
    let config = Config::load(&arguments.config)?;
    if arguments.check {
        let layout = &config.layout;
        println!(
            "{}: {} modules, {} taxels, {}x{} image",
            layout.name,
            layout.modules.len(),
            layout.len(),
            layout.width,
            layout.height
        );
        for (bus, source) in layout.buses.iter().zip(&config.sources) {
            println!("  {bus}: {source}");
        }
        if let Some(joints) = &config.joints {
            println!("  {} joints: {}", joints.joint_names().len(), joints.source);
        }
        return Ok(());
    }

    // Blocked while threads start, so that all of them inherit it and only this one is interrupted.
    // It takes handlers as well: a library that waits for a device unblocks every signal meanwhile,
    // and an unhandled one would kill taxeld with its boards and motors running.
    const SIGNALS: [Signal; 3] = [Signal::SIGTERM, Signal::SIGINT, Signal::SIGHUP];
    let mut signals = Signals::new(SIGNALS.map(|signal| signal as i32)).context("cannot handle signals")?;
    let blocked = SigSet::from_iter(SIGNALS);
    blocked.thread_block().context("cannot block signals")?;
    let images = config.socket.images.clone();
    let daemon = Daemon::start(config)?;
    tracing::info!(images = %images.display(), "ready");
    let _ = sd_notify::notify(&[NotifyState::Ready]);

    let (sender, stop) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        for signal in signals.forever() {
            if Signal::try_from(signal).is_ok_and(|signal| sender.send(signal).is_err()) {
                return;
            }
        }
    });
    blocked.thread_unblock().context("cannot take signals")?;
    while daemon.is_running() {
        match stop.recv_timeout(Duration::from_millis(200)) {
            Ok(Signal::SIGHUP) => {
                tracing::warn!("SIGHUP: the configuration is read at the start only; restart to change it")
            }
            Ok(signal) => {
                tracing::info!("{signal}: stopping");
                break;
            }
            Err(_) => {}
        }
    }
    let _ = sd_notify::notify(&[NotifyState::Stopping]);
    daemon.stop().map_err(anyhow::Error::msg)
}

/// Plain lines under systemd, which stamps them itself; with times and colours in a terminal.
fn log_to_stderr() -> std::io::Result<Flush> {
    let (log, flush) = Log::start(std::io::stderr())?;
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("info"));
    let builder = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(log)
        .with_target(false);
    if std::env::var_os("JOURNAL_STREAM").is_some() {
        builder.without_time().with_ansi(false).init();
    } else {
        builder
            .with_ansi(std::io::IsTerminal::is_terminal(&std::io::stderr()))
            .init();
    }
    Ok(flush)
}
