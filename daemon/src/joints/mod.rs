//! Joint angles in the status and in requests; what they are and how they get into each tactile
//! frame is `taxel-joints`.

mod confirmed;
mod hold;
mod releases;
mod status;
mod write;

pub(crate) use hold::{Deserted, Hold, Holders, NotDone};
pub(crate) use releases::Releases;
pub(crate) use status::{status, summary};
pub(crate) use write::{ServoRequest, ServosRequest, Told, release, write, write_together};
