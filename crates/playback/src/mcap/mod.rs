//! MCAP recordings: their frames and images, and what they tell of the daemon that made them.

pub mod calibrated;
pub mod daemon_changes;
pub mod head;
pub mod recorded;
