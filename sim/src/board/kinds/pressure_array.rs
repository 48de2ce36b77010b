//! A pressure array and the program that sends its frames (docs/protocols.md, "Pressure arrays"), already cut as its
//! source cuts them.

use crate::board::firmware::{Blueprint, BoardSimulation, Firmware, Moment};
use crate::board::queue::Queue;
use crate::levels::{Axis, Levels, Nature};
use crate::scene::SceneError;
use crate::skin_model::taxels_of;
use taxel_can::{CanFrame, pressure_frames};

/// Counts that a newton on one tactel moves it by: 255 at 34 kPa on 1.9 mm squared, as the Tekscan 6077 (Table 1 of the
/// publication). The counts of one that nothing presses are an assumption.
const COUNTS_PER_NEWTON: f64 = 2077.0;
const TACTEL: Axis = Axis {
    idle: [0.0, 2.0],
    sd: [0.2, 0.6],
};
const FULL_SCALE: u16 = 255;

pub(super) struct PressureArray;

impl BoardSimulation for PressureArray {
    fn usual_hz(&self) -> u32 {
        10
    }

    fn nature(&self, levels: Levels) -> Nature {
        Nature::of_one_axis(levels, TACTEL, COUNTS_PER_NEWTON, 1.0)
    }

    fn firmware(&self, blueprint: &Blueprint<'_>) -> Result<Box<dyn Firmware>, SceneError> {
        let module = blueprint.modules[0];
        let Some(size) = blueprint.wiring().array else {
            return Err(blueprint.refuse(module, "it has no rows and columns"));
        };
        let taxels: Vec<u16> = taxels_of(blueprint.layout, module)
            .map(|(i, _)| i as u16)
            .collect();
        Ok(Box::new(Array {
            size,
            taxels,
            sequence: 0,
        }))
    }
}

#[derive(Debug)]
struct Array {
    size: [u16; 2],
    taxels: Vec<u16>,
    sequence: u32,
}

impl Firmware for Array {
    fn groups(&self) -> usize {
        1
    }

    fn read(&mut self, _group: usize, moment: &Moment<'_>, send: &mut dyn FnMut(CanFrame)) {
        let read = |taxel: &u16| moment.skin.one_axis(*taxel, moment.t_ns).min(FULL_SCALE);
        let counts: Vec<u16> = self.taxels.iter().map(read).collect();
        pressure_frames(self.size, self.sequence, &counts)
            .into_iter()
            .for_each(send);
        self.sequence = self.sequence.wrapping_add(1);
    }

    fn queue(&self) -> Queue {
        Queue::ring(2 * self.taxels.len())
    }

    fn starts_itself(&self) -> bool {
        true
    }

    fn forget(&mut self) {
        self.sequence = 0;
    }
}
