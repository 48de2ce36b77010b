//! CySkin hubs on CAN (docs/protocols.md, "CySkin"): packets over one or more frames.
//!
//! A module is what other protocols call a board; what is sent goes to its hub.

pub(crate) mod decode;
pub(crate) mod file;
pub(crate) mod packet;
pub(crate) mod recognise;
pub(crate) mod setup;
mod start;

use super::board_protocol::{BoardProtocol, Measures, Properties};
use super::commands::Sequences;
use super::icub::setup::IcubSetup;
use super::id_table::IdTable;
use super::wired_board::WiredBoard;
use setup::{MODULES, SENSORS};

pub(crate) struct Cyskin;

impl BoardProtocol for Cyskin {
    fn properties(&self) -> &Properties {
        const CYSKIN: Properties = Properties {
            name: "cyskin",
            addresses: 0..MODULES,
            taxel_numbers: SENSORS as u16,
            measures: Measures {
                axes: 1,
                bits: 16,
                rests_at_zero: false,
            },
            keys: &["bus", "board", "hub"],
            bit_rate: None,
            ..Properties::USUAL
        };
        &CYSKIN
    }

    /// An estimate, of a packet for each module: which modules a hub puts into one is not public.
    fn frames_per_sweep(&self, k: &[u16]) -> usize {
        (k.len() * 2 + 7).div_ceil(7)
    }

    fn enter(&self, table: &mut IdTable, board: &WiredBoard<'_>) {
        let Some((setup, hub)) = board.hub else { return };
        let hub = table.enter_hub(setup, hub, board.module);
        for (k, taxel) in board.taxels() {
            hub.add_taxel(board.module, board.address, k, taxel);
        }
    }

    fn sequences(&self, board: &WiredBoard<'_>) -> Option<Sequences> {
        let (setup, hub) = board.hub?;
        start::sequences(setup, hub)
    }

    fn is_temperature(&self, k: u16, _icub: Option<&IcubSetup>) -> bool {
        k == 0
    }
}
