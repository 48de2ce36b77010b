//! Scenes as CAN traffic: simulated boards of every kind that `taxel-skin` reads, which behave, and
//! misbehave on request.
//!
//! A [`Scene`] names what touches the hand and what breaks; nothing else is modelled. A
//! [`Simulator`] plays it on every bus of a layout, with time as an argument; a [`SimSource`] plays
//! one bus in real time behind [`taxel_can::CanSource`]. The same scene with the same seed gives
//! the same bytes on every platform. The joints are in [`servo`]: simulated servos behind a pseudo
//! terminal. What a gripper feels that squeezes a forearm is in [`forearm`].
//!
//! ```
//! use taxel_sim::{Scene, Simulator};
//! use taxel_skin::Layout;
//!
//! let scene = Scene::builtin("tap")?;
//! let layout = Layout::resolve(scene.layout())?;
//! let mut hand = Simulator::new(&scene, &layout, scene.seed())?;
//! hand.start_all();
//! let mut frames = Vec::new();
//! hand.advance(100_000_000, &mut frames);
//! assert!(frames.len() > 240);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod board;
mod bus;
mod clock;
mod contact;
mod contact_file;
mod fault;
pub mod forearm;
mod levels;
mod objects;
mod phantom;
mod random;
mod scene;
pub mod servo;
mod simulator;
mod skin_model;
mod source;
mod stand_in;

pub use phantom::Palpation;
pub use scene::{Scene, SceneError};
pub use simulator::{BoardCounts, CommandError, Simulator};
pub use source::{SimOptions, SimSource};
pub use stand_in::{stand_in_layout_file, with_stand_in_boards};
