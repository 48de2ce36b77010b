//! A recording of named counts, board by board: `{board}B{taxel}X`, `..Y`, `..Z`.

use crate::csv::taxel_of;
use crate::recording::{Frames, Recording};

impl Recording {
    /// The numbers of the boards in the names of its columns, ascending, and those of the taxels of each, ascending; none where
    /// columns are named otherwise, or with fingers.
    pub fn boards(&self) -> Option<Vec<(u32, Vec<u32>)>> {
        if !self.has_counts() || self.column_names().is_empty() {
            return None;
        }
        let mut boards: Vec<(u32, Vec<u32>)> = Vec::new();
        for name in self.column_names().iter().step_by(3) {
            let (number, taxel) = taxel_of(name)?;
            match boards.last_mut() {
                Some((last, taxels)) if *last == number => taxels.push(taxel),
                _ => boards.push((number, vec![taxel])),
            }
        }
        Some(boards)
    }

    /// Puts the taxels of counts in another order: `order` has for each its number before.
    ///
    /// # Panics
    /// Where `order` does not have every taxel once, or the frames are magnitudes.
    pub fn reorder_taxels(&mut self, order: &[usize]) {
        let taxels = self.taxels();
        let mut before = order.to_vec();
        before.sort_unstable();
        assert!(
            before.into_iter().eq(0..taxels),
            "{order:?} is no order of {taxels} taxels"
        );
        let Frames::Counts(counts) = &mut self.frames else {
            panic!("frames are magnitudes");
        };
        for frame in counts.chunks_exact_mut(taxels) {
            let before = frame.to_vec();
            frame
                .iter_mut()
                .zip(order)
                .for_each(|(counts, n)| *counts = before[*n]);
        }
        let names = std::mem::take(&mut self.names.values);
        let triples: Vec<&[String]> = names.chunks(3).collect();
        let triples = order.iter().filter_map(|n| triples.get(*n).copied());
        self.names.values = triples.flatten().cloned().collect();
    }
}
