//! Contact that lasts to the end of a recording of counts: something rests on the skin, or its baseline has drifted.

use taxel_hand::ForceFrame;
use taxel_playback::remarks::{self, Priority};

/// So long is no touch, nanoseconds.
const LONG_NS: u64 = 60_000_000_000;

/// Since when taxels are in contact without a break.
#[derive(Debug, Default)]
pub(crate) struct HeldToTheEnd {
    /// Of each taxel, nanoseconds.
    since_ns: Vec<Option<u64>>,
    begin_ns: Option<u64>,
    end_ns: u64,
    threshold: f64,
}

impl HeldToTheEnd {
    /// Takes the next frame.
    pub(crate) fn take(&mut self, frame: &ForceFrame) {
        self.begin_ns.get_or_insert(frame.t_ns);
        (self.end_ns, self.threshold) = (frame.t_ns, frame.threshold);
        self.since_ns.resize(frame.contact.len(), None);
        for (since, contact) in self.since_ns.iter_mut().zip(&frame.contact) {
            *since = contact.then_some(since.unwrap_or(frame.t_ns));
        }
    }

    /// Says how many taxels are held for longer than a minute, if any are.
    pub(crate) fn say(&self, name: &str) {
        let held = self.since_ns.iter().flatten();
        let held: Vec<u64> = held
            .copied()
            .filter(|since| self.end_ns.saturating_sub(*since) > LONG_NS)
            .collect();
        let Some(last) = held.iter().max() else {
            return;
        };
        let last_s = last.saturating_sub(self.begin_ns.unwrap_or_default()) as f64 / 1e9;
        remarks::say(
            Priority::Warning,
            format!(
                "taxel: {name}: {} of {} taxels are in contact from {last_s:.0} s at the latest to the end, above a \
                 threshold of {:.1}; something rests on them, or their baseline has drifted faster than it is followed \
                 (conditioning.drift_time_constant_ms in a file for --config), or while something was held for long",
                held.len(),
                self.since_ns.len(),
                self.threshold,
            ),
        );
    }
}
