//! The three published layouts of uSkin's ids (docs/protocols.md, "uSkin ids"): one id per taxel.
//!
//! What is uncertain (docs/protocols.md, "uSkin ids"): which layout a given hand uses is not public for L1
//! and L2; of L3 the manual's excerpt only gives one example (controller 1: 0x001 to 0x051, 0x101 to 0x151,
//! ... 0x301 to 0x351), and what the group bit means is not said. Here it extends the controller number.

/// Which of the layouts. L2 has six chips on a line where the module is XELA's 4x6: those beyond the fourth have the
/// taxel numbers from 16 on, so that a 4x4 module keeps its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum IdLayout {
    L1,
    L2,
    L3,
}

impl IdLayout {
    /// Standard id of the frames that carry taxel `k` of a board.
    pub(crate) const fn id(self, board: u8, k: u8) -> u16 {
        let (board, k) = (board as u16, k as u16);
        match self {
            IdLayout::L1 => 0x700 | board << 4 | k,
            IdLayout::L2 => {
                let (sda, chip) = self.line(k as u8);
                board << 8 | (sda as u16) << 4 | chip as u16
            }
            IdLayout::L3 => (board >> 4) << 10 | (k >> 4) << 8 | (k & 15) << 4 | (board & 15),
        }
    }

    /// The board and taxel number `(board, k)` a standard id means. It undoes [`IdLayout::id`].
    pub(crate) const fn taxel_of(self, id: u16) -> Option<(u8, u8)> {
        match self {
            IdLayout::L1 if 0x700 <= id && id <= 0x7FF => Some(((id >> 4 & 15) as u8, (id & 15) as u8)),
            IdLayout::L2 if id <= 0x7FF && id & 0xC8 == 0 && id & 7 < 6 => {
                let (sda, chip) = ((id >> 4 & 3) as u8, (id & 7) as u8);
                let k = if chip < 4 {
                    sda << 2 | chip
                } else {
                    16 + 2 * sda + chip - 4
                };
                Some(((id >> 8) as u8, k))
            }
            IdLayout::L3 if id <= 0x7FF => Some((
                (id >> 6 & 0x10 | id & 15) as u8,
                (id >> 4 & 0x30 | id >> 4 & 15) as u8,
            )),
            _ => None,
        }
    }

    /// The bits of an id that are the same in all frames of a board.
    pub(crate) const fn board_mask(self) -> u16 {
        match self {
            IdLayout::L1 => 0x7F0,
            IdLayout::L2 => 0x7C8,
            IdLayout::L3 => 0x40F,
        }
    }

    /// The SDA line of a taxel, and its place on the line.
    pub(crate) const fn line(self, k: u8) -> (u8, u8) {
        match self {
            // Chips 4 and 5, of 4x6 modules.
            IdLayout::L2 if k >= 16 => ((k - 16) >> 1, 4 + (k & 1)),
            IdLayout::L1 | IdLayout::L2 => (k >> 2, k & 3),
            IdLayout::L3 => (k >> 4, k & 15),
        }
    }

    /// The taxel numbers that a board would have that has at least these: a phalange of 16 or a
    /// fingertip of 8, in L2 also a 4x6 module of 24; in L3 the same number on each SDA line from 0 on.
    pub(super) fn expected(self, taxels: &[u8]) -> Vec<u8> {
        let largest = taxels.iter().copied().max().unwrap_or(0);
        if self != IdLayout::L3 {
            let taxels = match largest {
                0..8 => 8,
                8..16 => 16,
                _ => 24,
            };
            return (0..taxels).collect();
        }
        let per_line = taxels.iter().map(|k| k & 15).max().unwrap_or(0);
        (0..=largest >> 4)
            .flat_map(|line| (0..=per_line).map(move |taxel| line << 4 | taxel))
            .collect()
    }
}
