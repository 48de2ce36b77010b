//! A hand on the terminal: the panes of `taxel view` and of `taxel demo`.
//!
//! [`Seen`] takes what a subscriber receives and remembers what is worth showing. [`Seen::picture`] is all of it at one
//! instant, [`draw`] its panes. [`Screen`] is what the person there has chosen, [`Screen::key`] what keys do; what a key
//! asks of others is an [`Action`].
//!
//! Nothing here connects, has a clock, or writes to a terminal: messages, times and the buffer that is drawn into are
//! arguments.

mod colour;
mod figures;
mod flat;
mod history;
mod keys;
mod out_of_use;
mod outline;
mod paint;
mod panes;
mod picture;
mod raster;
mod scale;
mod screen;
mod seen;
mod summary;
mod svg;

pub use colour::Palette;
pub use figures::Figures;
pub use flat::Hand;
pub use keys::Action;
pub use outline::{letter, outline};
pub use paint::shortened;
pub use panes::{Heading, draw};
pub use picture::Picture;
pub use screen::Screen;
pub use seen::Seen;
pub use summary::Summary;
pub use svg::svg;
