//! Taxels that are out of use and were not before.

use taxel_hand::{Fault, Faults};
use taxel_skin::Layout;

/// A taxel whose board speaks is missing once it was so at this many looks in a row, a second of them: one that a lost
/// frame left out is back with the next.
const LOOKS: u8 = 10;

/// What was known of each taxel at the last look.
#[derive(Debug, Default)]
pub(crate) struct OutOfUse {
    /// Empty before the first look.
    taxels: Vec<Known>,
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
}
