//! The one reply of all servos to a fast sync read.

use super::{BROADCAST_ID, FAST_BLOCK_OVERHEAD, HEADER, Instruction, PREFIX_BYTES, StatusByte, crc16};

/// Takes the reply to a fast sync read apart, servo by servo, also if it broke off.
///
/// The reply is `FF FF FD 00 FE LEN LEN 55` and then, per servo, `ERR ID data CRC CRC`. Each CRC
/// covers the packet from its header to there, the CRCs before it included, and nothing is stuffed.
/// It ends where the first servo is missing. After a block whose CRC is wrong, the next one is
/// checked from the CRC that the damaged one brought: a servo computes its own CRC from what it
/// heard on the bus, so that one damaged block does not hide those behind it.
#[derive(Debug, Clone)]
pub struct FastBlocks<'a> {
    rest: &'a [u8],
    data: usize,
    crc: u16,
}

/// One servo's part of the reply to a fast sync read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FastBlock<'a> {
    /// The servo, as it says; meaningless if the CRC is wrong.
    pub id: u8,
    /// Its ERR byte.
    pub status: StatusByte,
    /// Its data.
    pub data: &'a [u8],
    /// Whether its CRC is right.
    pub crc_ok: bool,
}

impl<'a> FastBlocks<'a> {
    /// `raw`: the packet from its header on, whole or broken off; `data`: bytes asked of each
    /// servo. `None` if it does not begin like the reply to a fast read.
    pub fn new(raw: &'a [u8], data: u16) -> Option<Self> {
        let head = raw.get(..PREFIX_BYTES + 1)?;
        let is_reply = head.starts_with(&HEADER)
            && head[4] == BROADCAST_ID
            && head[PREFIX_BYTES] == Instruction::Status as u8;
        let length = usize::from(u16::from_le_bytes([head[5], head[6]]));
        let end = raw.len().min(PREFIX_BYTES + length);
        is_reply.then(|| Self {
            rest: raw.get(PREFIX_BYTES + 1..end).unwrap_or_default(),
            data: usize::from(data),
            crc: crc16(0, head),
        })
    }
}

impl<'a> Iterator for FastBlocks<'a> {
    type Item = FastBlock<'a>;

    fn next(&mut self) -> Option<FastBlock<'a>> {
        let (block, rest) = self.rest.split_at_checked(self.data + FAST_BLOCK_OVERHEAD)?;
        let (body, crc_bytes) = block.split_at(block.len() - 2);
        let told = u16::from_le_bytes([crc_bytes[0], crc_bytes[1]]);
        let crc_ok = crc16(self.crc, body) == told;
        self.crc = crc16(told, crc_bytes);
        self.rest = rest;
        Some(FastBlock {
            id: body[1],
            status: StatusByte(body[0]),
            data: &body[2..],
            crc_ok,
        })
    }
}

/// Writes the reply to a fast sync or bulk read into `out`, for a simulated bus. `asked` is how many bytes of data each
/// servo was asked for (which sets LEN); `blocks` are those that answer, each with its id, ERR byte and data.
pub fn encode_fast_reply<'a>(
    out: &mut Vec<u8>,
    asked: &[u16],
    blocks: impl IntoIterator<Item = (u8, u8, &'a [u8])>,
) {
    let length = 1 + asked
        .iter()
        .map(|data| usize::from(*data) + FAST_BLOCK_OVERHEAD)
        .sum::<usize>();
    let [lo, hi] = u16::try_from(length).unwrap_or(u16::MAX).to_le_bytes();
    let from = out.len();
    out.extend_from_slice(&HEADER);
    out.extend_from_slice(&[BROADCAST_ID, lo, hi, Instruction::Status as u8]);
    for (id, error, data) in blocks {
        out.extend_from_slice(&[error, id]);
        out.extend_from_slice(data);
        let crc = crc16(0, &out[from..]);
        out.extend_from_slice(&crc.to_le_bytes());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reply() -> Vec<u8> {
        let mut out = Vec::new();
        // The second servo's data holds the header's pattern, which is not stuffed here.
        let data: [(u8, u8, &[u8]); 3] = [
            (3, 0, &[1, 2, 3, 4]),
            (1, 0x80, &[0xFF, 0xFF, 0xFD, 0x00]),
            (2, 0, &[9, 9, 9, 9]),
        ];
        encode_fast_reply(&mut out, &[4; 3], data);
        out
    }

    #[test]
    fn every_block_comes_with_its_servo() {
        let raw = reply();
        let blocks: Vec<_> = FastBlocks::new(&raw, 4).unwrap().collect();
        let ids: Vec<u8> = blocks.iter().map(|b| b.id).collect();
        assert_eq!(ids, [3, 1, 2]);
        assert!(blocks.iter().all(|b| b.crc_ok));
        assert!(blocks[1].status.alert());
        assert_eq!(blocks[1].data, [0xFF, 0xFF, 0xFD, 0x00]);
        // The last block's CRC is that of the packet.
        let (body, crc) = raw.split_at(raw.len() - 2);
        assert_eq!(crc16(0, body).to_le_bytes(), crc);
    }

    #[test]
    fn a_reply_that_breaks_off_gives_the_servos_before() {
        let raw = reply();
        for cut in 0..raw.len() {
            let whole = cut.saturating_sub(8) / 8;
            let blocks = FastBlocks::new(&raw[..cut], 4).map_or(0, |b| b.filter(|b| b.crc_ok).count());
            assert_eq!(blocks, whole, "cut at {cut}");
        }
    }

    #[test]
    fn a_damaged_block_does_not_hide_the_next() {
        // ERR, ID and data of the first block.
        for at in 8..14 {
            let mut raw = reply();
            raw[at] ^= 0x10;
            let ok: Vec<bool> = FastBlocks::new(&raw, 4).unwrap().map(|b| b.crc_ok).collect();
            assert_eq!(ok, [false, true, true], "byte {at}");
        }
        // Its CRC: the next block cannot be told from a damaged one, the one after it can.
        let mut raw = reply();
        raw[14] ^= 0x10;
        let ok: Vec<bool> = FastBlocks::new(&raw, 4).unwrap().map(|b| b.crc_ok).collect();
        assert_eq!(ok, [false, false, true]);
    }

    #[test]
    fn what_is_no_fast_reply_is_refused() {
        let raw = reply();
        for at in [0, 3, 4, 7] {
            let mut other = raw.clone();
            other[at] ^= 1;
            assert!(FastBlocks::new(&other, 4).is_none(), "byte {at}");
        }
        assert!(FastBlocks::new(&raw[..7], 4).is_none());
    }
}
