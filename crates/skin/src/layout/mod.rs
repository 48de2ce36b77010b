//! A hand as the layout file describes it: its geometry, and how its boards are wired.

mod board;
mod error;
mod file;
mod pose;
mod source;
mod text_file;
mod tile;
mod wiring;

pub use error::{LayoutError, LayoutProblem};
pub use text_file::read_text_file;
pub use wiring::{Layout, Wiring};

use std::path::Path;

const BUILTIN: &[(&str, &str)] = &[
    (
        "allegro-uskin-15",
        include_str!("../../layouts/allegro-uskin-15.toml"),
    ),
    (
        "allegro-xela-18",
        include_str!("../../layouts/allegro-xela-18.toml"),
    ),
    ("cpm-finger", include_str!("../../layouts/cpm-finger.toml")),
    (
        "cyskin-triangle",
        include_str!("../../layouts/cyskin-triangle.toml"),
    ),
    ("icub-forearm", include_str!("../../layouts/icub-forearm.toml")),
    ("schunk-sdh", include_str!("../../layouts/schunk-sdh.toml")),
    ("tekscan-6077", include_str!("../../layouts/tekscan-6077.toml")),
    (
        "uskin-fingertip",
        include_str!("../../layouts/uskin-fingertip.toml"),
    ),
    ("uskin-module", include_str!("../../layouts/uskin-module.toml")),
];

impl Layout {
    /// Checks the text of a layout file. `file_name` is only for messages.
    pub fn parse(text: &str, file_name: &str) -> Result<Self, LayoutError> {
        file::parse(text, file_name)
    }

    /// Reads and checks a layout file.
    pub fn load(path: &Path) -> Result<Self, LayoutError> {
        let text = text_file::read_text_file(path).map_err(|source| LayoutError::Read {
            path: path.display().to_string(),
            source,
        })?;
        Self::parse(&text, &path.display().to_string())
    }

    /// The hand built in under this name; `None` where there is none ([`Layout::builtin_names`]).
    pub fn builtin(name: &str) -> Option<Self> {
        let (_, text) = BUILTIN.iter().find(|(n, _)| *n == name)?;
        Self::parse(text, &format!("{name}.toml")).ok()
    }

    /// The names [`Layout::builtin`] knows; the first is the default hand.
    pub fn builtin_names() -> impl Iterator<Item = &'static str> {
        BUILTIN.iter().map(|(name, _)| *name)
    }

    /// The file a built-in hand is made from, to start a layout of one's own.
    pub fn builtin_text(name: &str) -> Option<&'static str> {
        BUILTIN.iter().find(|(n, _)| *n == name).map(|(_, text)| *text)
    }

    /// The layout that a user names: a built-in hand, `grid:HxW`, or the path of a layout file,
    /// tried in this order.
    pub fn resolve(name_or_path: &str) -> Result<Self, LayoutError> {
        if let Some(layout) = Self::builtin(name_or_path) {
            return Ok(layout);
        }
        if let Some(size) = name_or_path.strip_prefix("grid:") {
            let bad = || LayoutError::BadGrid(name_or_path.to_string());
            let (height, width) = size.split_once('x').ok_or_else(bad)?;
            return Self::grid(
                width.parse().map_err(|_| bad())?,
                height.parse().map_err(|_| bad())?,
            );
        }
        let path = Path::new(name_or_path);
        if !path.exists() {
            return Err(LayoutError::Unknown {
                name: name_or_path.to_string(),
                builtin: Self::builtin_names().collect::<Vec<_>>().join(", "),
            });
        }
        Self::load(path)
    }
}
