//! uSkin on an MTB3 and on a XELA controller: one frame per taxel (docs/protocols.md, "uSkin").

use crate::board::firmware::{Blueprint, BoardSimulation, Firmware, Identity, MTB3, Moment};
use crate::board::queue::Queue;
use crate::levels::{Levels, Nature};
use crate::scene::SceneError;
use taxel_can::CanFrame;
use taxel_skin::Protocol;

/// uSkin boards of one id layout.
pub(super) struct UskinBoards {
    /// The place of a taxel on its sensor line, by its number.
    chip: fn(u8) -> u8,
    /// A XELA controller, which sends from power-up on and takes no command that is known.
    xela: bool,
}

const ON_MTB: UskinBoards = UskinBoards {
    // Chips 4 and 5 are those of 4x6 modules.
    chip: |k| if k < 16 { k & 3 } else { 4 + (k & 1) },
    xela: false,
};
pub(super) const L1: UskinBoards = ON_MTB;
pub(super) const L2: UskinBoards = ON_MTB;
pub(super) const L3: UskinBoards = UskinBoards {
    chip: |k| k & 15,
    xela: true,
};

impl BoardSimulation for UskinBoards {
    fn usual_hz(&self) -> u32 {
        // docs/protocols.md, "Bus timing"; and what two buses carry of eight boards on MTBs each.
        if self.xela { 83 } else { 50 }
    }

    fn nature(&self, levels: Levels) -> Nature {
        Nature {
            axes: levels.axes(),
            scale: [1.0; 3],
            decoded: 1.0,
        }
    }

    fn firmware(&self, blueprint: &Blueprint<'_>) -> Result<Box<dyn Firmware>, SceneError> {
        Ok(Box::new(Uskin::new(self, blueprint)))
    }
}

#[derive(Debug)]
struct Uskin {
    protocol: Protocol,
    xela: bool,
    /// `(k, taxel)` of each group of chips that is read at once.
    groups: Vec<Vec<(u8, u16)>>,
    boot_replies: bool,
}

impl Uskin {
    /// The four sensor lines are read at once, the chips of a line one after another.
    fn new(boards: &UskinBoards, blueprint: &Blueprint<'_>) -> Self {
        let taxels = blueprint.taxels();
        let chip = boards.chip;
        let mut chips: Vec<u8> = taxels.iter().map(|(k, _)| chip(*k)).collect();
        chips.sort_unstable();
        chips.dedup();
        let groups = chips
            .iter()
            .map(|c| {
                let mut group: Vec<_> = taxels.iter().copied().filter(|(k, _)| chip(*k) == *c).collect();
                group.sort_unstable();
                group
            })
            .collect();
        Self {
            protocol: blueprint.wiring().protocol,
            xela: boards.xela,
            groups,
            boot_replies: blueprint.boot_replies,
        }
    }
}

impl Firmware for Uskin {
    fn groups(&self) -> usize {
        self.groups.len()
    }

    fn read(&mut self, group: usize, moment: &Moment<'_>, send: &mut dyn FnMut(CanFrame)) {
        let Some(address) = (moment.address)(0) else {
            return;
        };
        for &(k, taxel) in &self.groups[group] {
            let (counts, status) = if moment.booting {
                ([0xFFFF; 3], 0xFF)
            } else {
                moment.skin.reading(taxel, moment.t_ns)
            };
            if let Some(frame) = self.protocol.frame(address, k.into(), counts, status) {
                send(frame);
            }
        }
    }

    fn identity(&self) -> Option<Identity> {
        (!self.xela).then_some(MTB3)
    }

    fn queue(&self) -> Queue {
        if self.xela {
            Queue::ring(64)
        } else {
            Queue::stack()
        }
    }

    /// Replies to the configuration of the sensor chips, one per chip of a line, in frames that
    /// look like data.
    fn boot(&mut self, send: &mut dyn FnMut(u8, [u8; 8])) {
        if self.boot_replies && !self.xela {
            (0..4).for_each(|chip| send(chip, [0; 8]));
        }
    }

    fn starts_itself(&self) -> bool {
        self.xela
    }
}
