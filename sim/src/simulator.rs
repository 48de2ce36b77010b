//! A whole hand in a scene: its buses, its skin, and the truth about them.

use crate::board::{Board, nature_of};
use crate::bus::Bus;
use crate::clock::SceneClock;
use crate::scene::{Scene, SceneError};
use crate::skin_model::SkinModel;
use std::sync::Arc;
use taxel_can::{CanFrame, Received};
use taxel_skin::Layout;

/// Plays a scene on every bus of a hand. It does no I/O and holds no clock: time is an argument,
/// nanoseconds from the scene's beginning, and never turns back.
///
/// The same scene, layout, seed and commands give the same frames on every platform, however the
/// time is cut into calls of [`Simulator::advance`].
#[derive(Debug)]
pub struct Simulator {
    skin: Arc<SkinModel>,
    buses: Vec<Bus>,
}

/// Why a command cannot be given to a simulated bus.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum CommandError {
    /// The hand has no such bus.
    #[error("the hand has {buses} buses; there is no bus {bus}")]
    NoSuchBus {
        /// The bus asked for.
        bus: u8,
        /// How many there are.
        buses: usize,
    },
    /// Earlier commands still wait for the bus.
    #[error("the transmit queue of bus {bus} is full; advance the simulator before the next command")]
    QueueFull {
        /// The bus.
        bus: u8,
    },
}

/// What a simulated hand has done so far.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct BoardCounts {
    /// Boards in the scene.
    pub boards: usize,
    /// Boards that are sampling.
    pub streaming: usize,
    /// Transmit stacks that overflowed (docs/protocols.md, "MTB3 firmware").
    pub overflows: u64,
}

impl Scene {
    /// Whether it can be played on this hand; why not, otherwise.
    pub fn fits(&self, layout: &Layout) -> Result<(), SceneError> {
        Simulator::new(self, layout, self.seed).map(drop)
    }
}

impl Simulator {
    /// Puts a scene on a hand. MTB boards are stopped until they are commanded or
    /// [`Simulator::start_all`] is called; XELA controllers stream. The scene is played once,
    /// unless [`Simulator::looping`] says otherwise.
    pub fn new(scene: &Scene, layout: &Layout, seed: u64) -> Result<Self, SceneError> {
        let buses = 0..layout.buses.len().min(256);
        Self::with_buses(scene, layout, seed, false, buses.map(|b| b as u8))
    }

    /// The same, for some of the buses; a bus does not depend on the others.
    pub(crate) fn with_buses(
        scene: &Scene,
        layout: &Layout,
        seed: u64,
        looping: bool,
        buses: impl Iterator<Item = u8>,
    ) -> Result<Self, SceneError> {
        let natures = layout.boards().map(|(_, module, wiring)| {
            nature_of(wiring.protocol, scene.boards.levels).ok_or_else(|| SceneError::Layout {
                layout: layout.name.clone(),
                problem: format!("`{}` has no board; name a layout with boards", module.name),
            })
        });
        let natures = natures.collect::<Result<Vec<_>, _>>()?;
        let clock = SceneClock {
            length_ns: scene.length_ns,
            looping,
        };
        let skin = Arc::new(SkinModel::new(scene, layout, seed, clock, &natures)?);
        let buses = buses
            .map(|index| Bus::new(scene, layout, skin.clone(), seed, index))
            .collect::<Result<_, _>>()?;
        Ok(Self { skin, buses })
    }

    /// Puts a scene on a hand that plays it again and again; noise and timers do not repeat.
    pub fn looping(scene: &Scene, layout: &Layout, seed: u64) -> Result<Self, SceneError> {
        let buses = 0..layout.buses.len().min(256);
        Self::with_buses(scene, layout, seed, true, buses.map(|b| b as u8))
    }

    /// When something happens next; `None` once nothing will without a command. A step may yield no frame.
    pub fn next_at_ns(&self) -> Option<u64> {
        self.buses.iter().filter_map(Bus::next_event_ns).min()
    }

    /// Simulates up to and including `until_ns` and appends what the host received: bus index and
    /// frame, by time, and by bus where times are equal. The time of a frame is the end of its
    /// interframe space.
    pub fn advance(&mut self, until_ns: u64, frames: &mut Vec<(u8, Received)>) {
        let first = frames.len();
        for (index, bus) in self.buses.iter_mut().enumerate() {
            while let Some(received) = bus.pop(until_ns) {
                frames.push((index as u8, received));
            }
        }
        if self.buses.len() > 1 {
            frames[first..].sort_by_key(|(bus, received)| (received.t_ns, *bus));
        }
    }

    /// The host sends a frame. It competes for the bus like any other, from `t_ns` on, or from
    /// where the simulation is if that is later; boards hear it when it is through. The host does
    /// not receive its own frames.
    pub fn command(&mut self, bus: u8, frame: &CanFrame, t_ns: u64) -> Result<(), CommandError> {
        let buses = self.buses.len();
        let there = self.buses.get_mut(bus as usize);
        let there = there.ok_or(CommandError::NoSuchBus { bus, buses })?;
        there
            .command(frame, t_ns)
            .map_err(|_| CommandError::QueueFull { bus })
    }

    /// Starts every board without a command, now and after each power-up: for recordings made without a host.
    pub fn start_all(&mut self) {
        self.buses.iter_mut().for_each(Bus::start_all);
    }

    /// What touches the hand at `t_ns`: `force[taxel]` is how far the taxel is moved from its idle
    /// level, counts, as the norm over x, y and z, without noise, wraps or faults. Returns how many
    /// taxels are touched; those are the ones above 0. Taxels beyond the end of `force` are left
    /// out.
    pub fn truth(&self, t_ns: u64, force: &mut [f64]) -> usize {
        self.skin.truth(t_ns, force)
    }

    /// The same of one taxel: how far it is moved at `t_ns`; 0 where nothing touches it.
    pub fn truth_of(&self, taxel: u16, t_ns: u64) -> f64 {
        self.skin.truth_of(taxel, t_ns)
    }

    /// Boards, and how they fare.
    pub fn board_counts(&self) -> BoardCounts {
        let boards = || self.buses.iter().flat_map(|b| b.boards());
        BoardCounts {
            boards: boards().count(),
            streaming: boards().filter(|b| b.is_streaming()).count(),
            overflows: boards().map(Board::overflows).sum(),
        }
    }

    /// The only bus of a simulator made for one.
    pub(crate) fn into_bus(self) -> Option<Bus> {
        self.buses.into_iter().next()
    }
}
