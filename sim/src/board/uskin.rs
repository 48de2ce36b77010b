//! uSkin on an MTB3 and on a XELA controller: one frame per taxel (protocols.md section 2).

use super::firmware::{Firmware, Identity, Look, MTB3};
use super::queue::Queue;
use taxel_can::CanFrame;
use taxel_skin::Protocol;

#[derive(Debug)]
pub(super) struct Uskin {
    protocol: Protocol,
    /// `(k, taxel)` of each group of chips that is read at once.
    groups: Vec<Vec<(u8, u16)>>,
    boot_replies: bool,
}

impl Uskin {
    /// A board with these taxels, `(k, taxel)`. The four sensor lines are read at once, the chips of a line one after
    /// another.
    pub(super) fn new(protocol: Protocol, taxels: &[(u8, u16)], boot_replies: bool) -> Self {
        let chip = |k: u8| match protocol {
            Protocol::UskinL3 => k & 15,
            _ => k & 3,
        };
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
            protocol,
            groups,
            boot_replies,
        }
    }
}

impl Firmware for Uskin {
    fn groups(&self) -> usize {
        self.groups.len()
    }

    fn read(&mut self, group: usize, look: &Look<'_>, send: &mut dyn FnMut(CanFrame)) {
        let Some(address) = (look.address)(0) else { return };
        for &(k, taxel) in &self.groups[group] {
            let (counts, status) = if look.booting {
                ([0xFFFF; 3], 0xFF)
            } else {
                look.skin.reading(taxel, look.t_ns)
            };
            if let Some(frame) = self.protocol.frame(address, k, counts, status) {
                send(frame);
            }
        }
    }

    /// XELA controllers take no command that is known.
    fn identity(&self) -> Option<Identity> {
        self.protocol.takes_commands().then_some(MTB3)
    }

    fn queue(&self) -> Queue {
        if self.protocol.takes_commands() {
            Queue::stack()
        } else {
            Queue::ring(64)
        }
    }

    /// Replies to the configuration of the sensor chips, one per chip of a line, in frames that look like data.
    fn boot(&mut self, send: &mut dyn FnMut(u8, [u8; 8])) {
        if self.boot_replies && self.protocol.takes_commands() {
            (0..4).for_each(|chip| send(chip, [0; 8]));
        }
    }

    fn starts_itself(&self) -> bool {
        !self.protocol.takes_commands()
    }
}
