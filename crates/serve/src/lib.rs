//! Publishing on a Unix socket with the daemon's manners, for the daemon and for programs beside it.
//!
//! A program has a thread that makes frames and one that serves. The first publishes from a table
//! of outputs ([`OutputSlots`]): each is an encoder ([`taxel_wire::Encode`]) and the stream its
//! messages go to; publishing neither allocates nor waits. The second runs a [`Server`] in a
//! single-threaded tokio runtime: subscribers connect, state what their display can do, and are
//! sent the newest message, or every one from a backlog of about a second. A slow reader holds up
//! neither the frames nor another reader. Any other thread has a [`ServerHandle`]: to tell the
//! subscribers something, and to ask who they are.
//!
//! What is served is said by a [`ProfileMaker`]: how a display profile becomes an output.
//! [`Announcements`] is one without images, for programs that publish texts alone, such as touches
//! and estimates.

mod accept;
mod allowance;
mod announcements;
mod config;
mod crowding;
mod delivery;
mod farewell;
mod handle;
mod log_lines;
mod profiles;
mod raw;
mod registry;
mod server;
mod socket_path;
mod subscriber;
mod turns;

pub use allowance::Allowance;
pub use announcements::Announcements;
pub use config::{Limits, ProfilesConfig};
pub use crowding::most_crowding;
pub use handle::{Holder, Roster, ServerHandle};
pub use log_lines::{LogLines, and_unsaid};
pub use profiles::output_slots::OutputSlots;
pub use profiles::profile_maker::{Cost, DisplayProfile, MadeOutput, Measurement, ProfileMaker};
pub use server::{Server, ServerSeed};
pub use socket_path::{SocketPath, SocketPathError, check_group, check_socket_path};
