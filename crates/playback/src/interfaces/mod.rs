//! Which interface of recorded traffic is which bus of a hand.

pub(crate) mod bus_orders;
pub(crate) mod heard;
pub mod log_interfaces;
