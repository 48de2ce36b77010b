//! Joint angles in the status, in the log and in requests; what they are and how they get into each tactile frame is
//! `taxel-joints`.

mod status;
mod tell;
#[cfg(test)]
pub(crate) mod test_views;
mod view;
mod write;

pub(crate) use status::{status, summary};
pub(crate) use tell::{Told, Weight};
pub(crate) use view::{JointsView, SourceView};
pub(crate) use write::{ServoRequest, write};
