//! Which boards a bus of a layout has.

use super::firmware::{Blueprint, Firmware};
use super::kinds::kind_of;
use super::module::ModuleOfBoard;
use crate::clock::Span;
use crate::fault::BoardFault;
use crate::scene::{Scene, SceneError};
use taxel_skin::{Layout, Protocol};

/// What a board is made from.
pub(crate) struct Plan {
    pub(super) number: u64,
    pub(super) modules: Vec<ModuleOfBoard>,
    pub(super) firmware: Box<dyn Firmware>,
    pub(super) period_ns: u64,
}

/// The boards of one bus whose modules are there. `faults` gives those of a module, by index.
pub(crate) fn plans(
    scene: &Scene,
    layout: &Layout,
    seed: u64,
    bus: u8,
    present: &[bool],
    mut faults: impl FnMut(usize) -> Result<Vec<(Span, BoardFault)>, SceneError>,
) -> Result<Vec<Plan>, SceneError> {
    let mut plans = Vec::new();
    for (m, wiring) in layout.wiring.iter().enumerate() {
        if wiring.bus != bus || !present[m] {
            continue;
        }
        // The modules of a hub are one board, which comes with the first of them.
        let of_board = |n: &usize| *n == m || (wiring.hub.is_some() && layout.wiring[*n].hub == wiring.hub);
        let on_board = (0..layout.modules.len()).filter(|n| present[*n] && of_board(n));
        let on_board: Vec<usize> = on_board.collect();
        if on_board[0] != m {
            continue;
        }
        let blueprint = Blueprint {
            layout,
            modules: &on_board,
            seed,
            boot_replies: scene.boards.boot_replies,
        };
        let kind = kind_of(wiring.protocol).ok_or_else(|| blueprint.refuse(m, "it has no board"))?;
        let modules = on_board.iter().map(|n| {
            Ok(ModuleOfBoard {
                address: layout.wiring[*n].board,
                faults: faults(*n)?,
            })
        });
        let usual_ns = 1_000_000_000 / u64::from(scene.rate_hz(wiring.protocol));
        plans.push(Plan {
            number: m as u64,
            modules: modules.collect::<Result<_, SceneError>>()?,
            firmware: kind.firmware(&blueprint)?,
            period_ns: kind.period_ns(wiring).unwrap_or(usual_ns),
        });
    }
    Ok(plans)
}

impl Scene {
    /// Nominal sweeps per second of each board of this protocol; iCub boards are told theirs when
    /// they are configured.
    pub fn rate_hz(&self, protocol: Protocol) -> u32 {
        let usual_hz = || kind_of(protocol).map_or(50, |kind| kind.usual_hz());
        self.boards.rate_hz.unwrap_or_else(usual_hz)
    }
}
