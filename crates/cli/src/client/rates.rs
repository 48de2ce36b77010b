//! `taxel watch --hz`: how many frames come, and how old they are.

use serde_json::json;
use std::time::{Duration, Instant};
use taxel_wire::{Header, ImageView};

/// One line tells of so long.
pub(crate) const LINE: Duration = Duration::from_secs(1);

/// The frames of one line.
#[derive(Debug)]
pub(crate) struct Rates {
    began: Instant,
    /// When the newest came; before the first, when the line before ended.
    last: Instant,
    longest_gap: Duration,
    received: u64,
    skipped: u64,
    latencies_ns: Vec<i64>,
    /// Taxels in contact, missing and faulty in the newest.
    taxels: [usize; 3],
}

impl Rates {
    pub(crate) fn new(now: Instant) -> Self {
        Self {
            began: now,
            last: now,
            longest_gap: Duration::ZERO,
            received: 0,
            skipped: 0,
            latencies_ns: Vec::new(),
            taxels: [0; 3],
        }
    }

    /// When the line is due.
    pub(crate) fn due(&self) -> Instant {
        self.began + LINE
    }

    pub(crate) fn image(
        &mut self,
        header: &Header,
        image: &ImageView<'_>,
        latency_ns: Option<i64>,
        now: Instant,
    ) {
        self.taxels = [image.contacts, image.missing, image.faulty].map(|count| count as usize);
        self.frame(header, latency_ns, now);
    }

    fn frame(&mut self, header: &Header, latency_ns: Option<i64>, now: Instant) {
        self.longest_gap = self.longest_gap.max(now.saturating_duration_since(self.last));
        self.last = now;
        self.received += 1;
        self.skipped += u64::from(header.skipped);
        self.latencies_ns.extend(latency_ns);
    }

    /// The line, in words or as JSON, and an empty one behind it.
    pub(crate) fn line(&mut self, now: Instant, as_json: bool) -> String {
        let seconds = now.saturating_duration_since(self.began).as_secs_f64().max(1e-3);
        let hz = |frames: u64| (10.0 * frames as f64 / seconds).round() / 10.0;
        let (made, received) = (hz(self.received + self.skipped), hz(self.received));
        // What goes on is a gap, too.
        let gap = self.longest_gap.max(now.saturating_duration_since(self.last));
        let gap_ms = (gap.as_secs_f64() * 1e4).round() / 10.0;
        self.latencies_ns.sort_unstable();
        let us = |share: f64| {
            let place = (self.latencies_ns.len() as f64 * share) as usize;
            let ns = self
                .latencies_ns
                .get(place.min(self.latencies_ns.len().saturating_sub(1)))?;
            Some(*ns as f64 / 1e3)
        };
        let (p50, p99, max) = (us(0.5), us(0.99), us(1.0));
        let [contacts, missing, faulty] = self.taxels;
        let line = if as_json {
            json!({
                "hz": made, "received_hz": received, "skipped": self.skipped, "longest_gap_ms": gap_ms,
                "latency_p50_us": p50, "latency_p99_us": p99, "latency_max_us": max,
                "contacts": contacts, "missing": missing, "faulty": faulty,
            })
            .to_string()
        } else {
            let ms = |us: Option<f64>| us.map_or("-".into(), |us| format!("{:.2}", us / 1e3));
            let mut line = format!(
                "{made:.1} Hz, {received:.1} here  latency p50 {} p99 {} max {} ms  gap {gap_ms:.0} ms  {contacts} in contact",
                ms(p50),
                ms(p99),
                ms(max),
            );
            for (count, what) in [
                (missing as u64, "missing"),
                (faulty as u64, "faulty"),
                (self.skipped, "skipped"),
            ] {
                if count > 0 {
                    line += &format!("  {count} {what}");
                }
            }
            line
        };
        *self = Self {
            last: self.last,
            taxels: self.taxels,
            ..Self::new(now)
        };
        line
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_wire::Kind;

    fn after(start: Instant, ms: u64) -> Instant {
        start + Duration::from_millis(ms)
    }

    #[test]
    fn a_line_counts_what_was_made_and_what_came() {
        let start = Instant::now();
        let mut rates = Rates::new(start);
        for frame in 1..=10 {
            let header = Header::new(Kind::Image, 0).with_skipped(2);
            rates.frame(&header, Some(1_000_000 * frame), after(start, 100 * frame as u64));
        }
        let line: serde_json::Value = serde_json::from_str(&rates.line(after(start, 1000), true)).unwrap();
        for (key, value) in [
            ("hz", 30.0),
            ("received_hz", 10.0),
            ("longest_gap_ms", 100.0),
            ("latency_p50_us", 6000.0),
            ("latency_max_us", 10_000.0),
        ] {
            assert_eq!(line[key], value, "{key}: {line}");
        }
        assert_eq!(line["skipped"], 20);
    }

    #[test]
    fn a_daemon_that_stops_shows_a_gap_that_grows() {
        let start = Instant::now();
        let mut rates = Rates::new(start);
        rates.frame(&Header::new(Kind::Image, 0), None, after(start, 10));
        rates.line(after(start, 1000), false);
        let line = rates.line(after(start, 2010), false);
        for part in ["0.0 Hz, 0.0 here", "p50 - p99 -", "gap 2000 ms"] {
            assert!(line.contains(part), "{part}: {line}");
        }
    }
}
