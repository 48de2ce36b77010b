//! Conditioning on signals whose truth is known.

mod faults;
mod life;
mod repair;
mod settings;
mod skin;
