//! The clients of the control sockets: who they are, how many may be connected, how often each may ask, and what all of them
//! are told at once.

mod asker;
mod places;
mod report;

pub(crate) use asker::{Access, Asker, Change, ChangeLog};
pub(crate) use places::{Doing, MOST_CLIENTS, Motors, Place, Places};
pub(crate) use report::Reports;
