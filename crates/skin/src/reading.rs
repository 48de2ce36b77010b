//! What boards send: one taxel's value.

/// One taxel's value, as a board sent it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TaxelReading {
    /// Index of the taxel in the layout, `0..N`.
    pub taxel: u16,
    /// Raw counts of x, y, z; 0 to 65535, on an arbitrary offset.
    pub counts: [u16; 3],
    /// The status byte the board sent with the value (for uSkin the MLX90393's, protocols.md 2.2).
    pub status: u8,
}
