//! How an iCub board is set up: the table `icub` of a module in a layout file.

/// Pads of a triangle, thermal ones included.
pub(crate) const PADS: u8 = 12;

/// How an iCub board is configured before it is started: the table `icub` of a module in a layout file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct IcubSetup {
    /// Time between two sweeps, ms, 1 to 209. Fifteen triangles and seven boards on a bus need more than 30.
    pub period_ms: u8,
    /// The value of a pad that is not pressed, 0 to 255.
    pub noload: u8,
    /// What is mounted and how it is compensated, 0 to 15: 0 temperature compensation, 1 palm or
    /// fingertip, 2 no compensation, 3 hand "ergo", 7 raw, 8 temperature compensation, second
    /// version.
    pub skin_type: u8,
    /// How far the chip's 16 bits are shifted right, 0 to 15.
    pub shift: u8,
    /// Offset of the chip's converter.
    pub cdc_offset: u16,
}

impl Default for IcubSetup {
    /// The values the official document uses.
    fn default() -> Self {
        Self {
            period_ms: 50,
            noload: 245,
            skin_type: 0,
            shift: 2,
            cdc_offset: 0x2200,
        }
    }
}

impl IcubSetup {
    /// What is wrong with it, if anything is.
    pub(crate) fn problem(&self) -> Option<String> {
        if !(1..=209).contains(&self.period_ms) {
            return Some(format!("icub.period_ms = {} is not 1 to 209", self.period_ms));
        }
        if self.skin_type > 15 {
            return Some(format!("icub.skin_type = {} is not 0 to 15", self.skin_type));
        }
        (self.shift > 15).then(|| format!("icub.shift = {} is not 0 to 15", self.shift))
    }

    /// Whether pad `k` (`triangle * 12 + pad`) is known to measure temperature: pads 6 and 10 of a triangle that is
    /// compensated by them (docs/protocols.md, "iCub frames").
    pub const fn is_thermal(&self, k: u8) -> bool {
        let (triangle, pad) = (k / PADS, k % PADS);
        let is_compensated = match self.skin_type {
            0 | 8 => true,
            // Fingertips come first.
            3 => triangle > 4,
            _ => false,
        };
        is_compensated && (pad == 6 || pad == 10)
    }

    /// Whether pad `k` measures temperature or may do so, depending on what is mounted: on a palm, pad 11 and one more.
    pub const fn may_be_thermal(&self, k: u8) -> bool {
        const OF_PALM: u8 = 11 * PADS + 7;
        let pad = k % PADS;
        match self.skin_type {
            1 => pad == 11 || k == OF_PALM,
            2 | 7 => pad == 6 || pad == 10,
            _ => self.is_thermal(k),
        }
    }
}
