//! What is made of a daemon's frames while they come, as `taxel categorize --live` and `taxel forearm estimate --live` do:
//! every frame in, a JSON line for each result out, on stdout and where there is a socket for it.

use super::publisher::Publisher;
use serde::Serialize;
use std::path::Path;
use taxel_wire::{Clock, Hello, Kind, Subscribe, Subscriber};
use taxeld::stdout;

/// Asks for every frame, raw, and every mark of a daemon.
pub(crate) fn every_frame(mut subscriber: Subscriber) -> anyhow::Result<Subscriber> {
    subscriber.subscribe(&Subscribe {
        image: false,
        raw: true,
        every: true,
        ..Subscribe::default()
    })?;
    Ok(subscriber)
}

/// Where results go.
pub(crate) struct Lines<'a> {
    /// Of which kind they are, and what they are called.
    kind: Kind,
    what: &'static str,
    publish: Option<&'a Path>,
    publisher: Option<Publisher>,
    /// Whether the times of the daemon are of this machine's clock.
    monotonic: bool,
}

/// A result, and how long after `of_ns` it is told, microseconds; null where the daemon plays a recording.
#[derive(Debug, Serialize)]
struct Line<'a, T> {
    #[serde(flatten)]
    result: &'a T,
    latency_us: Option<f64>,
}

impl<'a> Lines<'a> {
    /// To stdout, and to a socket of this name.
    pub(crate) fn new(kind: Kind, what: &'static str, publish: Option<&'a Path>) -> Self {
        Self {
            kind,
            what,
            publish,
            publisher: None,
            monotonic: false,
        }
    }

    /// Takes note of a daemon; with the first one the socket begins.
    pub(crate) fn hello(&mut self, hello: &Hello) -> anyhow::Result<()> {
        self.monotonic = hello.clock == Clock::Monotonic;
        if let (None, Some(path)) = (&self.publisher, self.publish) {
            self.publisher = Some(Publisher::start(path, hello.clone(), self.what)?);
        }
        Ok(())
    }

    /// Tells a result of something that was at `of_ns` on the daemon's clock; `newest` is the number and the time of the
    /// newest frame that it is about.
    pub(crate) fn tell(
        &self,
        result: &impl Serialize,
        of_ns: u64,
        newest: Option<(u64, u64)>,
    ) -> anyhow::Result<()> {
        let since_ns = taxel_can::monotonic_ns().saturating_sub(of_ns);
        let line = serde_json::to_string(&Line {
            result,
            latency_us: self.monotonic.then_some(since_ns as f64 / 1e3),
        })?;
        if let (Some(publisher), Some((seq, t_ns))) = (&self.publisher, newest) {
            publisher.publish(self.kind, line.as_bytes(), seq, t_ns);
        }
        stdout::print(&format!("{line}\n"))
    }
}
