//! What every MTB has in common, be it the iCub's or uSkin's: its commands, its answers, and who it
//! says it is.

mod command;
mod frames;
mod kind;

pub use command::MtbCommand;
pub(crate) use frames::{GET_FW_VERSION, MtbBoards, MtbFrame, answer_filter, answer_id, answering};
pub use kind::BoardKind;
