//! The published finger with CySkin-type sensors (protocols.md 5.3): four frames of four values, and one of proximity.

use super::firmware::{Firmware, Look};
use taxel_can::CanFrame;
use taxel_skin::cpm_finger_frames;

/// What both proximity sensors read; nothing comes near them in a scene.
const PROXIMITY: [u16; 2] = [1200, 1180];

#[derive(Debug)]
pub(super) struct Finger {
    /// Taxel of each channel.
    taxels: [Option<u16>; 16],
}

impl Finger {
    pub(super) fn new(taxels: &[(u8, u16)]) -> Self {
        let mut channels = [None; 16];
        for &(k, taxel) in taxels {
            channels[usize::from(k) & 15] = Some(taxel);
        }
        Self { taxels: channels }
    }
}

impl Firmware for Finger {
    fn groups(&self) -> usize {
        1
    }

    fn read(&mut self, _group: usize, look: &Look<'_>, send: &mut dyn FnMut(CanFrame)) {
        let values = self.taxels.map(|taxel| match taxel {
            Some(taxel) if !look.booting => look.skin.capacitance(taxel, look.t_ns),
            _ => 0,
        });
        cpm_finger_frames(values, PROXIMITY).into_iter().for_each(send);
    }

    fn starts_itself(&self) -> bool {
        true
    }
}
