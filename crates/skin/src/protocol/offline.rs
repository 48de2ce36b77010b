//! No board: an array in a file.

use super::board_protocol::{BoardProtocol, Properties};

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
}
