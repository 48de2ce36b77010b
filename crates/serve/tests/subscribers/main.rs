//! What subscribers are promised, with a server whose images the tests make.

mod every;
mod newest;
mod refusals;
mod stage;
mod standing;
mod waking;
