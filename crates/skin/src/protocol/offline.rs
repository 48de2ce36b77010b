//! No board: an array in a file.

use super::board_protocol::{BoardProtocol, Properties};
use crate::reading::TaxelReading;

pub(crate) struct Offline;

impl BoardProtocol for Offline {
    fn properties(&self) -> &Properties {
        const OFFLINE: Properties = Properties {
            name: "offline",
            taxel_numbers: u16::MAX,
            keys: &[],
            bit_rate: None,
            ..Properties::USUAL
        };
        &OFFLINE
    }

    fn frames_per_sweep(&self, _k: &[u16]) -> usize {
        0
    }

    /// Nothing is known of the sensor's range or axes; that a count is 0 may say that nothing presses it.
    fn is_saturated(&self, reading: &TaxelReading) -> bool {
        reading.counts.contains(&u16::MAX)
    }
}
