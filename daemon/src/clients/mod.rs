//! The clients of the control sockets: who they are, how many may be connected, how often each may ask, and what all of them
//! are told at once.

mod allowance;
mod asker;
mod lines;
mod places;
mod report;

pub(crate) use allowance::Allowance;
pub(crate) use asker::{Access, Asker, Change, ChangeLog};
pub(crate) use lines::Lines;
pub(crate) use places::{Doing, MOST_CLIENTS, Place, Places};
pub(crate) use report::Reports;
