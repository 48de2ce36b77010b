//! Tests of what the crate promises, as one program: linked once instead of once for each file.

mod boards;
mod cyskin;
mod discovery;
mod forearm;
mod icub;
mod scenes;
mod servos;
mod source;
mod support;
