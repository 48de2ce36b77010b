//! What the kernel lets through of a CAN bus.

use crate::{CanFrame, EXTENDED_FLAG};

/// Which frames the kernel lets through: those whose raw identifier equals `id` in every bit of `mask`.
///
/// Raw means with the flag bits of `linux/can.h`. Error frames do not pass through these filters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct IdFilter {
    /// The identifier with its flag bits.
    pub id: u32,
    /// The bits that are compared.
    pub mask: u32,
}

impl IdFilter {
    /// Standard (11 bit) frames whose identifier equals `id` in the bits of `mask`; `0x7FF`
    /// compares all of them.
    pub const fn standard(id: u16, mask: u16) -> Self {
        Self {
            id: (id & 0x7FF) as u32,
            mask: (mask & 0x7FF) as u32 | EXTENDED_FLAG,
        }
    }

    /// Extended (29 bit) frames whose identifier equals `id` in the bits of `mask`.
    pub const fn extended(id: u32, mask: u32) -> Self {
        Self {
            id: (id & 0x1FFF_FFFF) | EXTENDED_FLAG,
            mask: (mask & 0x1FFF_FFFF) | EXTENDED_FLAG,
        }
    }

    /// Whether a frame passes; error frames always do.
    pub const fn passes(&self, frame: &CanFrame) -> bool {
        frame.is_error() || (frame.raw_id() ^ self.id) & self.mask == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filters_compare_the_format_as_well_as_the_number() {
        let standard = CanFrame::standard(0x123, &[]).unwrap();
        let extended = CanFrame::extended(0x123, &[]).unwrap();
        assert!(IdFilter::standard(0x123, 0x7FF).passes(&standard));
        assert!(!IdFilter::standard(0x123, 0x7FF).passes(&extended));
        assert!(!IdFilter::standard(0x124, 0x7FF).passes(&standard));
        assert!(IdFilter::standard(0x120, 0x7F0).passes(&standard));
        assert!(IdFilter::extended(0x123, 0x1FFF_FFFF).passes(&extended));
        assert!(!IdFilter::extended(0x123, 0x1FFF_FFFF).passes(&standard));
        assert!(IdFilter::standard(0x7, 0x7FF).passes(&CanFrame::error(0x40, [0; 8])));
    }
}
