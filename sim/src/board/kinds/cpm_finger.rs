//! The published finger with CySkin-type sensors (docs/protocols.md, "CPM finger"): four frames of four
//! values, and one of proximity.

use super::one_axis_nature;
use crate::board::firmware::{Blueprint, BoardSimulation, Firmware, Moment};
use crate::levels::{Levels, Nature};
use crate::scene::SceneError;
use taxel_can::CanFrame;
use taxel_skin::cpm_finger_frames;

/// What both proximity sensors read; nothing comes near them in a scene.
const PROXIMITY: [u16; 2] = [1200, 1180];

pub(super) struct CpmFinger;

impl BoardSimulation for CpmFinger {
    fn nature(&self, levels: Levels) -> Nature {
        one_axis_nature(levels)
    }

    fn firmware(&self, blueprint: &Blueprint<'_>) -> Result<Box<dyn Firmware>, SceneError> {
        Ok(Box::new(Finger::new(&blueprint.taxels())))
    }
}

#[derive(Debug)]
struct Finger {
    /// Taxel of each channel.
    taxels: [Option<u16>; 16],
}

impl Finger {
    fn new(taxels: &[(u8, u16)]) -> Self {
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

    fn read(&mut self, _group: usize, moment: &Moment<'_>, send: &mut dyn FnMut(CanFrame)) {
        let values = self.taxels.map(|taxel| match taxel {
            Some(taxel) if !moment.booting => moment.skin.one_axis(taxel, moment.t_ns),
            _ => 0,
        });
        cpm_finger_frames(values, PROXIMITY).into_iter().for_each(send);
    }

    fn starts_itself(&self) -> bool {
        true
    }
}
