//! Commands beside a running daemon: what it is asked and tells, its images while they come, and what is made of these and
//! published.

pub(crate) mod control;
pub(crate) mod hands;
pub(crate) mod live_lines;
pub(crate) mod publisher;
pub(crate) mod rates;
pub(crate) mod reconnect;
pub(crate) mod scene_marks;
pub(crate) mod status_text;
