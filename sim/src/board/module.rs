//! One module of a board: what it sends under, and what is wrong with it.

use crate::clock::Span;
use crate::fault::BoardFault;

/// One of the modules of a board, of which only a hub has several.
#[derive(Debug)]
pub(super) struct ModuleOfBoard {
    /// The address it sends under.
    pub(super) address: u8,
    pub(super) faults: Vec<(Span, BoardFault)>,
}

impl ModuleOfBoard {
    pub(super) fn has(&self, scene_ns: u64, wanted: BoardFault) -> bool {
        self.faults
            .iter()
            .any(|(span, fault)| span.contains(scene_ns) && *fault == wanted)
    }

    /// What it sends under at this time of the scene; `None` without power.
    pub(super) fn address_at(&self, scene_ns: u64) -> Option<u8> {
        if self.has(scene_ns, BoardFault::Silent) {
            return None;
        }
        let wrong = self.faults.iter().find_map(|(span, fault)| match fault {
            BoardFault::WrongId { board } if span.contains(scene_ns) => Some(*board),
            _ => None,
        });
        Some(wrong.unwrap_or(self.address))
    }
}
