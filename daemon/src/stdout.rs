//! Standard output that is closed or full: whoever prints ends with an error, and says so.
//!
//! Of one that is closed (`taxel status >&-`) no program in Rust hears: before `main` the standard library puts /dev/null
//! in its place, which takes everything. So the loader has a function here called before that one.
#![allow(unsafe_code)]

use anyhow::{Context, anyhow};
use nix::errno::Errno;
use nix::fcntl::{FcntlArg, fcntl};
use nix::sys::socket::{AddressFamily, SockFlag, SockType, socket};
use nix::unistd::dup2_stdout;
use std::io::{self, ErrorKind, Write};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use taxel_journal::Priority;

static WAS_CLOSED: AtomicBool = AtomicBool::new(false);

// SAFETY: the section is a list of functions that are called once, with arguments that this one does without. It needs
// nothing that the standard library makes ready before `main`.
#[used]
#[unsafe(link_section = ".init_array")]
static BEFORE_MAIN: extern "C" fn() = look;

extern "C" fn look() {
    let flags = fcntl(io::stdout(), FcntlArg::F_GETFD);
    WAS_CLOSED.store(flags == Err(Errno::EBADF), Ordering::Relaxed);
}

/// Sees to it that printing to a standard output that is closed fails: a socket without a peer takes its place. To be
/// called before anything is printed.
pub fn refuse_closed() -> io::Result<()> {
    match WAS_CLOSED.load(Ordering::Relaxed) {
        true => Ok(dup2_stdout(socket(
            AddressFamily::Unix,
            SockType::Stream,
            SockFlag::empty(),
            None,
        )?)?),
        false => Ok(()),
    }
}

/// Prints help, the version, or what is wrong with the arguments; gives the exit code.
pub fn tell(said: &clap::Error) -> anyhow::Result<ExitCode> {
    if !said.use_stderr() {
        said.print().context("stdout")?;
    } else if taxel_journal::is_stderr() {
        let lines = Priority::Error.lines(&said.to_string());
        let _ = io::stderr().write_all(lines.as_bytes());
    } else {
        let _ = said.print();
    }
    Ok(ExitCode::from(said.exit_code() as u8))
}

/// Prints a text at once.
pub fn print(text: &str) -> anyhow::Result<()> {
    let mut out = io::stdout().lock();
    out.write_all(text.as_bytes())
        .and_then(|()| out.flush())
        .context("stdout")
}

/// How a program ends that printed: with an error where not all of it was taken, but not where a reader has seen enough
/// (`taxel watch | head`).
pub fn ended(outcome: anyhow::Result<ExitCode>) -> anyhow::Result<ExitCode> {
    let outcome = outcome.and_then(|code| {
        io::stdout().flush().context("stdout")?;
        Ok(code)
    });
    match outcome {
        Err(error) if is_broken_pipe(&error) => Ok(ExitCode::SUCCESS),
        Err(error) if WAS_CLOSED.load(Ordering::Relaxed) && is(&error, ErrorKind::NotConnected) => {
            Err(anyhow!("stdout is closed, and nothing can be printed"))
        }
        outcome => outcome,
    }
}

/// Whether a reader has gone.
pub fn is_broken_pipe(error: &anyhow::Error) -> bool {
    is(error, ErrorKind::BrokenPipe)
}

/// Whether the error, or a cause of it, is one of input or output and of this kind.
fn is(error: &anyhow::Error, kind: ErrorKind) -> bool {
    let io_error = error.chain().find_map(|cause| cause.downcast_ref::<io::Error>());
    io_error.is_some_and(|e| e.kind() == kind)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_broken_pipe_is_seen_behind_its_context() {
        let pipe = io::Error::from(ErrorKind::BrokenPipe);
        assert!(is_broken_pipe(&anyhow::Error::new(pipe).context("writing")));
        assert!(!is_broken_pipe(&anyhow!("Broken pipe")));
    }
}
