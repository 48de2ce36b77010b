//! `taxeld`: from a robot hand's skin to tactile displays, in real time.

#![deny(clippy::print_stdout, clippy::print_stderr)]

mod journal;
mod rereads;

use crate::journal::Journal;
use crate::rereads::Rereads;
use anyhow::Context;
use clap::Parser;
use nix::libc;
use nix::sys::signal::{SigSet, SigmaskHow};
use signal_hook::consts::{
    SIGALRM, SIGHUP, SIGINT, SIGIO, SIGPROF, SIGQUIT, SIGTERM, SIGUSR1, SIGUSR2, SIGVTALRM, SIGXCPU, SIGXFSZ,
};
use signal_hook::iterator::Signals;
use signal_hook::low_level::signal_name;
use std::io::Write;
use std::process::ExitCode;
use std::time::{Duration, Instant};
use taxel_journal::Priority;
use taxeld::log::{Flush, Log};
use taxeld::{Arguments, Config, ConfigError, Daemon, MORE_FILES, StartError, service_manager, stdout};
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;

/// The exit status where the configuration is at fault: `EX_CONFIG` of sysexits(3). To start again would not help.
const BAD_CONFIG: u8 = 78;

fn main() -> ExitCode {
    // Where there is no such socket, /dev/null stays, and the daemon runs.
    let _ = stdout::refuse_closed();
    // What is told at the end goes the way of the log: it waits for nobody, and neither panics where stderr is gone or full.
    let (log, _flush) = match log_to_stderr() {
        Ok(log) => log,
        Err(error) => {
            let why = "cannot start the thread that writes the log";
            let said = Priority::Error.lines(&format!("Error: {why}: {error}"));
            let _ = std::io::stderr().write_all(said.as_bytes());
            return ExitCode::FAILURE;
        }
    };
    let outcome = match Arguments::try_parse() {
        Ok(arguments) => run(&arguments),
        Err(said) => stdout::ended(stdout::tell(&said)),
    };
    match outcome {
        Ok(status) => status,
        Err(error) => {
            let (said, wants_files) = last_words(&error);
            log.say(Priority::Error.lines(&format!("Error: {said}")));
            let start = error.downcast_ref::<StartError>();
            if wants_files || error.is::<ConfigError>() || start.is_some_and(StartError::is_lasting) {
                ExitCode::from(BAD_CONFIG)
            } else {
                ExitCode::FAILURE
            }
        }
    }
}

/// Why it ends, and whether since too few files may be open: then what needed one more comes from all over the start, and only
/// the system's words are the same.
fn last_words(error: &anyhow::Error) -> (String, bool) {
    let said = format!("{error:#}");
    let too_many = std::io::Error::from_raw_os_error(libc::EMFILE).to_string();
    match said.contains(&too_many) {
        true => (format!("{said}; {MORE_FILES}"), true),
        false => (said, false),
    }
}

fn run(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let config = Config::load(&arguments.config)?;
    if arguments.check {
        let text = std::fs::read_to_string(&arguments.config).unwrap_or_default();
        taxeld::check(&config, &text, &arguments.config)?;
        return stdout::ended(stdout::print(&config.summary()).map(|()| ExitCode::SUCCESS));
    }

    // They interrupt the thread that they wake alone, so that every other one is started without them. They take
    // handlers as well: a library that waits for a device unblocks every signal meanwhile, and an unhandled one would
    // kill taxeld with its boards and motors running.
    let mut signals = Signals::new(ending_signals().chain([SIGHUP])).context("cannot handle signals")?;
    let mask = SigSet::all()
        .thread_swap_mask(SigmaskHow::SIG_SETMASK)
        .context("cannot block signals")?;
    service_manager::attach();
    let images = config.socket.images.clone();
    let mut daemon = Daemon::start(config)?;
    tracing::info!(images = %images.display(), "ready");

    let (sender, stop) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        for signal in signals.forever() {
            if sender.send(signal).is_err() {
                return;
            }
        }
    });
    mask.thread_set_mask().context("cannot take signals")?;
    let mut status = ExitCode::SUCCESS;
    let mut rereads = Rereads::default();
    let mut is_ready_told = false;
    while daemon.is_running() {
        // Again and again, since systemd starts nothing behind taxeld before it was told.
        is_ready_told = is_ready_told || service_manager::tell("READY=1");
        if !daemon.is_reloading() && rereads.take(Instant::now()) {
            let file = arguments.config.clone();
            daemon.reload(move || Config::load(&file));
        }
        match stop.recv_timeout(Duration::from_millis(200)) {
            Ok(SIGHUP) => rereads.ask(),
            Ok(signal) => {
                let name = signal_name(signal).map_or_else(|| format!("signal {signal}"), str::to_owned);
                tracing::info!("{name}: stopping");
                if !matches!(signal, SIGTERM | SIGINT) {
                    status = ExitCode::from(128 + signal as u8);
                }
                break;
            }
            Err(_) => {}
        }
    }
    daemon.stop().map_err(anyhow::Error::msg)?;
    Ok(status)
}

/// The signals that end taxeld after boards and motors have been stopped: all that end a process and can be caught. Not
/// those that tell of a fault of the program itself (SIGSEGV, SIGABRT and the like), after which it can do nothing more.
/// SIGABRT is also what systemd sends to a taxeld of which a thread hangs. To stop in order would wait for that thread,
/// while another one goes on reading the servos, so that their watchdogs let their motors run: it is safest to be gone.
fn ending_signals() -> impl Iterator<Item = i32> {
    let named = [
        SIGTERM, SIGINT, SIGQUIT, SIGUSR1, SIGUSR2, SIGALRM, SIGVTALRM, SIGPROF, SIGXCPU, SIGXFSZ, SIGIO,
    ];
    let rare = [libc::SIGPWR, libc::SIGSTKFLT];
    named
        .into_iter()
        .chain(rare)
        .chain(libc::SIGRTMIN()..=libc::SIGRTMAX())
}

/// What is logged where RUST_LOG has these words: `debug`, or `warn,taxeld=debug`; from `info` on where it has none or
/// others. Spans and fields, which `EnvFilter` reads too, there are none, and it brings regular expressions.
fn filter(words: &str) -> Targets {
    let info = || Targets::new().with_default(LevelFilter::INFO);
    match words {
        "" => info(),
        words => words.parse().unwrap_or_else(|_| info()),
    }
}

/// Plain lines for the journal, which stamps them itself and is told how much each matters; with times and colours in
/// a terminal.
fn log_to_stderr() -> std::io::Result<(Log, Flush)> {
    let (log, flush) = Log::start(std::io::stderr())?;
    let filter = filter(&std::env::var("RUST_LOG").unwrap_or_default());
    let builder = tracing_subscriber::fmt()
        .with_max_level(LevelFilter::TRACE)
        .with_writer(log.clone())
        .with_target(false);
    if taxel_journal::is_stderr() {
        let plain = tracing_subscriber::fmt::format()
            .without_time()
            .with_target(false);
        let lines = builder.with_ansi(false).event_format(Journal(plain));
        lines.finish().with(filter).init();
    } else {
        builder
            .with_ansi(std::io::IsTerminal::is_terminal(&std::io::stderr()))
            .finish()
            .with(filter)
            .init();
    }
    Ok((log, flush))
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracing::Level;

    #[test]
    fn too_few_files_are_told_from_a_system_that_has_too_many_open_whatever_needed_one() {
        for (error, wanted) in [(libc::EMFILE, true), (libc::ENFILE, false), (libc::ENOENT, false)] {
            let error =
                anyhow::Error::from(std::io::Error::from_raw_os_error(error)).context("cannot listen");
            let (said, wants_files) = last_words(&error);
            assert_eq!(
                (wants_files, said.contains("LimitNOFILE=")),
                (wanted, wanted),
                "{said}"
            );
        }
    }

    #[test]
    fn rust_log_says_what_is_logged() {
        for (words, own, of_others) in [
            ("", Level::INFO, Level::INFO),
            ("debug", Level::DEBUG, Level::DEBUG),
            ("warn,taxeld=trace", Level::TRACE, Level::WARN),
            ("taxeld=what", Level::INFO, Level::INFO),
        ] {
            let filter = filter(words);
            for level in [Level::ERROR, Level::WARN, Level::INFO, Level::DEBUG, Level::TRACE] {
                assert_eq!(
                    filter.would_enable("taxeld::tick", &level),
                    level <= own,
                    "{words}, {level}"
                );
                assert_eq!(
                    filter.would_enable("tokio", &level),
                    level <= of_others,
                    "{words}, {level}"
                );
            }
        }
    }
}
