//! Joint angles in the status and in requests; what they are and how they get into each tactile
//! frame is `taxel-joints`.

mod hold;
mod status;
mod write;

pub(crate) use hold::Hold;
pub(crate) use status::{status, summary};
pub(crate) use write::{ServoRequest, ServosRequest, write, write_together};
