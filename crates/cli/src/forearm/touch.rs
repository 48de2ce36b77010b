//! The tactile finger among the taxels of a daemon's hand.

use taxel_forearm::{TACTELS, TACTILE_COLUMNS, TACTILE_ROWS};
use taxel_hand::Freshness;
use taxel_wire::{Hello, RawView};

/// Counts older than this are no touch, microseconds: a squeeze has a sample every 121 ms, the sensor ten frames a second.
const OLDEST_US: u32 = 400_000;

/// The taxels of the tactile finger, row by row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct TactileFinger(Vec<usize>);

impl TactileFinger {
    /// The module of 28 x 50 taxels, if the hand has one.
    pub(super) fn find(hello: &Hello) -> Option<Self> {
        let whole = hello
            .modules
            .iter()
            .filter(|module| usize::from(module.taxels) == TACTELS);
        whole
            .filter_map(|module| {
                let first = usize::from(module.first_taxel);
                let mut taxels: Vec<_> = hello.taxels.get(first..first + TACTELS)?.iter().collect();
                taxels.sort_by_key(|taxel| (taxel.y, taxel.x));
                let (left, top) = (taxels[0].x, taxels[0].y);
                let stands = |(n, taxel): (usize, &&_)| is_at(taxel, left, top, n);
                let is_rectangle = taxels.iter().enumerate().all(stands);
                is_rectangle.then(|| Self(taxels.iter().map(|taxel| usize::from(taxel.taxel)).collect()))
            })
            .next()
    }

    /// The image of a frame, put into `counts`; false, and nothing there, where any of it is missing or old.
    pub(super) fn image(&self, raw: &RawView<'_>, counts: &mut Vec<u16>) -> bool {
        counts.clear();
        let taxels: Vec<_> = raw.taxels().collect();
        for taxel in &self.0 {
            match taxels.get(*taxel) {
                Some(felt) if felt.freshness != Freshness::Missing && felt.age_us <= OLDEST_US => {
                    counts.push(felt.counts[2]);
                }
                _ => {
                    counts.clear();
                    return false;
                }
            }
        }
        true
    }
}

fn is_at(taxel: &taxel_wire::HelloTaxel, left: u16, top: u16, n: usize) -> bool {
    let (row, column) = (n / TACTILE_COLUMNS, n % TACTILE_COLUMNS);
    row < TACTILE_ROWS && [taxel.x, taxel.y] == [left + column as u16, top + row as u16]
}
