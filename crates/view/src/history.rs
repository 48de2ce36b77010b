//! The forces of all taxels of late, for those that somebody wants to see over time.

use std::collections::VecDeque;

/// Memory for forces of the past, bytes.
const MOST_BYTES: usize = 8 << 20;
/// Time kept, at most.
pub(crate) const KEPT_NS: u64 = 20_000_000_000;
/// Frames nearer to the one before are passed over.
const STEP_NS: u64 = 30_000_000;

/// Frames of late, oldest first.
#[derive(Debug, Clone, Default)]
pub(crate) struct History {
    frames: VecDeque<(u64, Vec<f32>)>,
    /// The taxel that was the strongest one last.
    touched: Option<usize>,
}

impl History {
    /// A frame, and its strongest taxel while anything is touched.
    pub(crate) fn see(
        &mut self,
        t_ns: u64,
        forces: impl ExactSizeIterator<Item = f32>,
        strongest: Option<usize>,
    ) {
        match self.frames.back() {
            // Another hand, or a recording from its start again.
            Some((last_ns, last)) if t_ns < *last_ns || last.len() != forces.len() => *self = Self::default(),
            Some((last_ns, _)) if t_ns - last_ns < STEP_NS => return,
            _ => {}
        }
        self.touched = strongest.or(self.touched);
        let most = (MOST_BYTES / 4 / forces.len().max(1)).max(1);
        let is_old = |(first_ns, _): &(u64, Vec<f32>)| t_ns - first_ns > KEPT_NS;
        let mut memory = Vec::new();
        while self.frames.len() >= most || self.frames.front().is_some_and(is_old) {
            memory = self
                .frames
                .pop_front()
                .map(|(_, forces)| forces)
                .unwrap_or_default();
        }
        memory.clear();
        memory.extend(forces);
        self.frames.push_back((t_ns, memory));
    }

    /// The taxel that was the strongest one when something was touched last.
    pub(crate) fn touched(&self) -> Option<usize> {
        self.touched
    }

    /// Time before the newest frame, seconds, 0 or below, and force of a taxel, oldest first.
    pub(crate) fn of(&self, taxel: usize) -> Vec<(f64, f64)> {
        let Some((newest_ns, _)) = self.frames.back() else {
            return Vec::new();
        };
        self.frames
            .iter()
            .filter_map(|(t_ns, forces)| {
                let force = forces.get(taxel)?;
                Some((-((newest_ns - t_ns) as f64) / 1e9, f64::from(*force)))
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_older_than_is_kept_goes_and_a_restart_begins_anew() {
        let mut history = History::default();
        for frame in 0..1000u64 {
            history.see(frame * 40_000_000, [frame as f32, 0.0].into_iter(), Some(0));
        }
        let past = history.of(0);
        assert_eq!(past.last(), Some(&(0.0, 999.0)));
        assert!((past[0].0 + 20.0).abs() < 0.05, "{:?}", past[0]);
        assert!(history.of(2).is_empty());
        history.see(0, [7.0, 0.0].into_iter(), None);
        assert_eq!((history.of(0), history.touched()), (vec![(0.0, 7.0)], None));
    }

    #[test]
    fn a_huge_hand_keeps_less() {
        let mut history = History::default();
        for frame in 0..400u64 {
            history.see(frame * 40_000_000, (0..16_000).map(|_| 0.0f32), None);
        }
        assert_eq!(history.of(0).len(), MOST_BYTES / 4 / 16_000);
    }
}
