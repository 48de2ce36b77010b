//! The seam between what every simulated board is (power, timer, queues) and what one kind of board does.

use super::queue::Queue;
use crate::levels::{Levels, Nature};
use crate::scene::SceneError;
use crate::skin_model::{SkinModel, taxels_of};
use std::fmt::Debug;
use taxel_can::CanFrame;
use taxel_skin::{Layout, Wiring};

/// One kind of simulated board: an entry of the list in `kinds/mod.rs`.
pub(super) trait BoardSimulation: Sync {
    /// Sweeps per second of a board that a scene does not give a rate: what two buses carry of
    /// eight uSkin boards each, which they do not of the 100 Hz of their timers.
    fn usual_hz(&self) -> u32 {
        50
    }

    /// The time between two sweeps of a board that is configured by the layout file, nanoseconds.
    fn period_ns(&self, _wiring: &Wiring) -> Option<u64> {
        None
    }

    /// What its taxels read; `levels` are those of uSkin boards.
    fn nature(&self, levels: Levels) -> Nature;

    /// What is to run on a board.
    fn firmware(&self, blueprint: &Blueprint<'_>) -> Result<Box<dyn Firmware>, SceneError>;
}

/// What a board's firmware is made from.
pub(super) struct Blueprint<'a> {
    pub(super) layout: &'a Layout,
    /// Its module; of a hub, all those that are there.
    pub(super) modules: &'a [usize],
    pub(super) seed: u64,
    pub(super) boot_replies: bool,
}

impl Blueprint<'_> {
    /// The wiring of its first module.
    pub(super) fn wiring(&self) -> &Wiring {
        &self.layout.wiring[self.modules[0]]
    }

    /// `(k, taxel)` of each taxel of its first module.
    pub(super) fn taxels(&self) -> Vec<(u8, u16)> {
        let taxels = taxels_of(self.layout, self.modules[0]);
        taxels.map(|(i, k)| (k, i as u16)).collect()
    }

    /// Why a module cannot be simulated.
    pub(super) fn refuse(&self, module: usize, why: &str) -> SceneError {
        SceneError::Layout {
            layout: self.layout.name.clone(),
            problem: format!("`{}`: {why}", self.layout.modules[module].name),
        }
    }
}

/// What one kind of board does with its chips and with what it is told.
pub(super) trait Firmware: Debug + Send {
    /// Groups of chips of a sweep, which are read one after another; none while nothing is switched on.
    fn groups(&self) -> usize;

    /// Reads a group and gives the frames of it to `send`, in the order in which the board makes them.
    fn read(&mut self, group: usize, moment: &Moment<'_>, send: &mut dyn FnMut(CanFrame));

    /// Most frames that one group gives, where the board waits until its queue has room for them.
    fn needs_room(&self) -> Option<usize> {
        None
    }

    /// Who it says it is, if it is an MTB and so takes commands of classes 2 and 7.
    fn identity(&self) -> Option<Identity> {
        None
    }

    /// The queue its frames wait in: two sweeps of most boards.
    fn queue(&self) -> Queue {
        Queue::ring(64)
    }

    /// Frames it sends when it gets power.
    fn boot(&mut self, _send: &mut dyn FnMut(u8, [u8; 8])) {}

    /// Does what a command of class 2 says that not every MTB has.
    fn configure(&mut self, _data: &[u8], _t_ns: u64, _skin: &SkinModel) -> Effect {
        Effect::default()
    }

    /// Does what a frame says that is no command to an MTB.
    fn handle_frame(&mut self, _frame: &CanFrame) -> Effect {
        Effect::default()
    }

    /// Forgets what it was told: it lost its power.
    fn forget(&mut self) {}

    /// Is as it would be after its start sequence, but for the start itself.
    fn set_up(&mut self) {}

    /// Whether it sends from power-up on, without a command.
    fn starts_itself(&self) -> bool {
        false
    }
}

/// When and as whom a board reads its chips.
pub(super) struct Moment<'a> {
    pub(super) t_ns: u64,
    pub(super) skin: &'a SkinModel,
    /// Its first sweeps after power-up read nothing.
    pub(super) booting: bool,
    /// The address it sends under; that of each of its modules, where it has several; `None` for
    /// one without power.
    pub(super) address: &'a dyn Fn(usize) -> Option<u8>,
}

/// What an MTB answers to discovery and to the question for its version (docs/protocols.md, "MTB commands"
/// and "MTB discovery").
#[derive(Debug, Clone, Copy)]
pub(super) struct Identity {
    /// Board type (`iCubCanProto_types.h`).
    pub(super) board_type: u8,
    pub(super) firmware: [u8; 3],
    pub(super) can_protocol: [u8; 2],
}

/// Board type of an MTB up to generation 3, uSkin's included; firmware 2.17.0, CAN protocol 1.0
/// (docs/protocols.md, "MTB discovery").
pub(super) const MTB3: Identity = Identity {
    board_type: 5,
    firmware: [2, 17, 0],
    can_protocol: [1, 0],
};

/// Board type of an MTB4. Which versions there are was not looked up; these are the simulation's own.
pub(super) const MTB4: Identity = Identity {
    board_type: 11,
    firmware: [2, 9, 0],
    can_protocol: [1, 0],
};

/// What a command does to the board's timer.
#[derive(Debug, Default, Clone, Copy)]
pub(super) struct Effect {
    pub(super) stops: bool,
    pub(super) starts: bool,
    /// It sweeps this often from now on.
    pub(super) period_ns: Option<u64>,
    /// It takes no start before this time.
    pub(super) busy_until_ns: u64,
}
