//! Conditioning on signals whose truth is known.

mod life;
mod repair;
mod skin;
