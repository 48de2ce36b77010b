//! Lines for systemd's journal, each with its priority (sd-daemon(3)).

use nix::sys::stat::fstat;
use std::fmt;
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::fmt::format::{Format, Full, Writer};
use tracing_subscriber::fmt::{FmtContext, FormatEvent, FormatFields};
use tracing_subscriber::registry::LookupSpan;

/// Whether stderr is the journal's stream. A terminal that a service has opened inherits the variable as well, so it
/// says which file is meant.
pub(crate) fn is_stderr() -> bool {
    let stream = std::env::var("JOURNAL_STREAM").unwrap_or_default();
    match fstat(std::io::stderr()) {
        Ok(file) => stream == format!("{}:{}", file.st_dev, file.st_ino),
        Err(_) => false,
    }
}

/// What stands before a line of this level where stderr is the journal.
pub(crate) fn prefix(level: &Level) -> &'static str {
    match is_stderr() {
        true => priority(level),
        false => "",
    }
}

fn priority(level: &Level) -> &'static str {
    match *level {
        Level::ERROR => "<3>",
        Level::WARN => "<4>",
        Level::INFO => "<6>",
        _ => "<7>",
    }
}

/// A line of the format within, behind its priority.
pub(crate) struct Journal(pub(crate) Format<Full, ()>);

impl<S, N> FormatEvent<S, N> for Journal
where
    S: Subscriber + for<'span> LookupSpan<'span>,
    N: for<'writer> FormatFields<'writer> + 'static,
{
    fn format_event(
        &self,
        context: &FmtContext<'_, S, N>,
        mut line: Writer<'_>,
        event: &Event<'_>,
    ) -> fmt::Result {
        line.write_str(priority(event.metadata().level()))?;
        self.0.format_event(context, line, event)
    }
}
