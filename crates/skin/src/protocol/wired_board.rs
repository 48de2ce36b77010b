//! What a protocol is told of one board of a layout.

use super::cyskin::setup::{CyskinHub, CyskinSetup};
use super::icub::setup::IcubSetup;

/// A board of a layout, as its protocol sees it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WiredBoard<'a> {
    /// Index of its module in the layout.
    pub(crate) module: u16,
    /// Its address; of a CySkin module the number on its hub.
    pub(crate) address: u8,
    pub(crate) icub: Option<&'a IcubSetup>,
    pub(crate) hub: Option<(&'a CyskinSetup, &'a CyskinHub)>,
    /// Rows and columns of a pressure array.
    pub(crate) array: Option<[u16; 2]>,
    /// Index of its first taxel in the layout.
    pub(crate) first_taxel: u16,
    /// Its own numbers for its taxels, in the order of the layout.
    pub(crate) k: &'a [u16],
}

impl WiredBoard<'_> {
    /// Its taxels, by its own number and by index in the layout. No board on CAN has more numbers than a byte holds.
    pub(crate) fn taxels(&self) -> impl Iterator<Item = (u8, u16)> {
        self.k.iter().map(|k| *k as u8).zip(self.first_taxel..)
    }
}
