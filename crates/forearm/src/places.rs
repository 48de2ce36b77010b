//! Places on the forearm.

/// Places of the publication, evenly from wrist to elbow.
pub const PLACES: usize = 13;

/// Where the publication's place `index` is, from 0 (wrist) to 100 (elbow).
pub fn location_percent(index: usize) -> f64 {
    100.0 * index as f64 / (PLACES - 1) as f64
}
