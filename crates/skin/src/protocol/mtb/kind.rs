//! Who a board says it is.

use serde::Serialize;

/// What a board says it is (`iCubCanProto_types.h`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum BoardKind {
    /// MTB of generations up to 3; uSkin's are among them.
    Mtb3,
    /// MTB4.
    Mtb4,
    /// MTB4 with WiFi.
    Mtb4w,
    /// MTB4 for the ergo hand.
    Mtb4c,
    /// Another board of the iCub: strain, MAIS, RFE, PSC, or one of another time; its number.
    Other(u8),
}

impl BoardKind {
    /// The kind of this number.
    pub const fn of(number: u8) -> Self {
        match number {
            5 => BoardKind::Mtb3,
            11 => BoardKind::Mtb4,
            16 => BoardKind::Mtb4w,
            20 => BoardKind::Mtb4c,
            other => BoardKind::Other(other),
        }
    }
}
