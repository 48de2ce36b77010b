//! Taxels that are out of use and were not before.

use std::time::Duration;
use taxel_hand::{Fault, Faults};
use taxel_serve::LogLines;
use taxel_skin::Layout;
use tokio::time::Instant;

/// A taxel whose board speaks is missing once it was so at this many looks in a row, a second of them: one that a lost
/// frame left out is back with the next.
const LOOKS: u8 = 10;

/// A module of which nothing was said for so long is told of, however much is said of others.
const QUIET: Duration = Duration::from_secs(600);

/// What was known of each taxel at the last look.
#[derive(Debug, Default)]
pub(crate) struct OutOfUse {
    /// Empty before the first look.
    taxels: Vec<Known>,
    lines: LogLines,
    /// When something was last said of each module.
    told_at: Vec<Option<Instant>>,
}

#[derive(Debug, Clone, Copy)]
struct Known {
    faults: Faults,
    /// Looks in a row at which it was missing and its board spoke.
    missing: u8,
}

impl OutOfUse {
    /// Taxels that are out of use for reasons that did not hold before, and these reasons; those of one module with the
    /// same are one entry. That nothing comes from a board that is silent is told of the board. At the first look nothing
    /// is new.
    pub(crate) fn look(
        &mut self,
        layout: &Layout,
        now: &[Faults],
        speaks: impl Fn(usize) -> bool,
    ) -> Vec<(Faults, Vec<usize>)> {
        let mut all: Vec<(Faults, Vec<usize>)> = Vec::new();
        let is_first = self.taxels.is_empty();
        let unknown = Known {
            faults: Faults::NONE,
            missing: 0,
        };
        self.taxels.resize(now.len(), unknown);
        for (index, module) in layout.modules.iter().enumerate() {
            let (first, speaks) = (all.len(), speaks(index));
            for taxel in module.taxel_range() {
                let known = &mut self.taxels[taxel];
                known.missing = match speaks && now[taxel].contains(Fault::Missing) {
                    true => known.missing.saturating_add(1),
                    false => 0,
                };
                let (mut faults, mut newly) = (Faults::NONE, Faults::NONE);
                let is_told = |fault: &Fault| *fault != Fault::Missing || known.missing >= LOOKS;
                for fault in now[taxel].iter().filter(is_told) {
                    faults.insert(fault);
                    if !is_first && !known.faults.contains(fault) {
                        newly.insert(fault);
                    }
                }
                known.faults = faults;
                match all[first..].iter_mut().find(|(faults, _)| *faults == newly) {
                    _ if newly.is_empty() => {}
                    Some((_, taxels)) => taxels.push(taxel),
                    None => all.push((newly, vec![taxel])),
                }
            }
        }
        all
    }

    /// Whether the log says so of a module, and how many such lines before it were left out: boards whose taxels come and go
    /// are not to fill it.
    pub(crate) fn say(&mut self, module: usize, now: Instant) -> Option<u64> {
        self.told_at.resize(self.told_at.len().max(module + 1), None);
        let told_at = &mut self.told_at[module];
        let is_quiet = told_at.is_none_or(|at| now >= at + QUIET);
        let unsaid = self.lines.take(is_quiet, now)?;
        *told_at = Some(now);
        Some(unsaid)
    }

    /// How many lines were left out and are still to be told of.
    pub(crate) fn left_out(&mut self, now: Instant) -> Option<u64> {
        self.lines.take_unsaid(now)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout() -> Layout {
        Layout::builtin("allegro-uskin-15").expect("built in")
    }

    fn of(faults: &[Fault]) -> Faults {
        let mut all = Faults::NONE;
        faults.iter().for_each(|fault| all.insert(*fault));
        all
    }

    #[test]
    fn taxels_of_one_module_that_fall_out_for_the_same_reason_are_told_together() {
        let layout = layout();
        let (status, stuck) = (of(&[Fault::Status]), of(&[Fault::Stuck]));
        let mut before = vec![Faults::NONE; layout.taxels.len()];
        let mut now = before.clone();
        now[..40].fill(status);
        now[3] = of(&[Fault::Status, Fault::Stuck]);
        (before[5], now[5]) = (status, of(&[Fault::Status, Fault::Missing]));
        (before[6], now[6]) = (status, of(&[Fault::Status, Fault::Stuck]));
        now[100] = of(&[Fault::Missing]);
        before[101] = stuck;
        let mut out_of_use = OutOfUse::default();
        assert!(out_of_use.look(&layout, &before, |_| true).is_empty());
        let told = out_of_use.look(&layout, &now, |_| true);
        let all_but = |not: &[usize]| (0..16).filter(|taxel| !not.contains(taxel)).collect();
        assert_eq!(
            told,
            [
                (status, all_but(&[3, 5, 6])),
                (of(&[Fault::Status, Fault::Stuck]), vec![3]),
                (stuck, vec![6]),
                (status, (16..32).collect()),
                (status, (32..40).collect()),
            ]
        );
        assert!(out_of_use.look(&layout, &now, |_| true).is_empty());
    }

    #[test]
    fn taxels_that_a_board_leaves_out_are_told_once_while_it_speaks() {
        let layout = layout();
        let missing = of(&[Fault::Missing]);
        let well = vec![Faults::NONE; layout.taxels.len()];
        let mut half = well.clone();
        half[16..24].fill(missing);
        // Which looks of 40 tell of it, where module 1 speaks or does not and sends its half or all.
        let told = |speaks: bool, is_whole: fn(usize) -> bool| {
            let mut out_of_use = OutOfUse::default();
            out_of_use.look(&layout, &well, |_| true);
            let mut told = Vec::new();
            for look in 0..40 {
                let now = if is_whole(look) { &well } else { &half };
                let news = out_of_use.look(&layout, now, |module| module != 1 || speaks);
                if let [(faults, taxels)] = &news[..] {
                    assert_eq!((*faults, taxels), (missing, &(16..24).collect()));
                    told.push(look);
                }
            }
            told
        };
        assert_eq!(told(true, |_| false), [9]);
        assert_eq!(told(true, |look| look == 20), [9, 30]);
        assert_eq!(told(true, |look| look % 5 == 0), [0; 0]);
        assert_eq!(told(false, |_| false), [0; 0]);
    }

    #[test]
    fn taxels_that_come_and_go_fill_no_log_and_keep_no_other_module_out_of_it() {
        let layout = layout();
        let (mut out_of_use, start) = (OutOfUse::default(), Instant::now());
        let well = vec![Faults::NONE; layout.taxels.len()];
        let (mut lines, mut all, mut counted) = (0, 0, 0);
        // Looked at in tenths of a second: the taxels of all modules but the last come and go five times in one, in halves
        // that fail differently, for ten minutes. The last fails once, in the middle.
        let mut last_said = None;
        for tenth in 0..6000 + 100 {
            let now = start + tenth * Duration::from_millis(100);
            let mut faults = well.clone();
            if tenth % 2 == 1 && tenth < 6000 {
                for (taxel, fault) in faults[..14 * 16].iter_mut().enumerate() {
                    *fault = of(&[if taxel % 2 == 0 {
                        Fault::Status
                    } else {
                        Fault::Stuck
                    }]);
                }
            }
            if tenth >= 3000 {
                faults[14 * 16..].fill(of(&[Fault::Status]));
            }
            for (_, taxels) in out_of_use.look(&layout, &faults, |_| true) {
                let module = layout.taxels[taxels[0]].module.into();
                all += 1;
                if let Some(unsaid) = out_of_use.say(module, now) {
                    (lines, counted) = (lines + 1, counted + 1 + unsaid);
                    if module == 14 {
                        last_said = Some(tenth);
                    }
                }
            }
            if let Some(unsaid) = out_of_use.left_out(now) {
                (lines, counted) = (lines + 1, counted + unsaid);
            }
        }
        assert_eq!(last_said, Some(3000));
        assert_eq!((all, counted), (3000 * 28 + 1, all), "each is said or counted");
        assert!((100..=260).contains(&lines), "{lines} lines in ten minutes");
    }
}
