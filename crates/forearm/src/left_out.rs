//! What an estimate is made without.

/// What errors and people call the angles: the potentiometers', then the motors'.
pub(crate) const ANGLES: [&str; 4] = [
    "theta_p of finger 0",
    "theta_p of finger 1",
    "theta_a of finger 0",
    "theta_a of finger 1",
];

/// What an estimate was made without: angles that are lost, stuck or jump, touch that is unlike that of the training, and the
/// less sure of the two where they contradict each other.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct LeftOut {
    /// In the order of `ANGLES`.
    pub(crate) angles: [bool; 4],
    pub(crate) touch: bool,
}

impl LeftOut {
    /// Their names, such as `theta_p of finger 0` and `touch`.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        let angles = ANGLES.into_iter().zip(self.angles);
        angles
            .chain([("touch", self.touch)])
            .filter_map(|(name, left_out)| left_out.then_some(name))
    }
}
