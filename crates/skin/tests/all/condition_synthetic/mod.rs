//! Conditioning on signals whose truth is known.

mod ends;
mod faults;
mod lasting;
mod life;
mod moved;
mod noisy_hand;
mod quiet;
mod repair;
mod settings;
mod skin;
mod steps;
