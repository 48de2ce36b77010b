//! Whether a squeeze's angles and touch are what the sensors of the training would have measured.

pub(crate) mod domain;
pub(crate) mod glitch;
pub(crate) mod likeness;
pub(crate) mod stillness;
