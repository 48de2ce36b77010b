//! A uSkin taxel's eight bytes (docs/protocols.md, "uSkin payload"), the same in all three layouts.

use super::ids::IdLayout;
use taxel_can::CanFrame;

/// Status and counts of a taxel frame's eight data bytes.
#[inline]
pub(crate) fn payload(data: &[u8; 8]) -> (u8, [u16; 3]) {
    let axis = |i: usize| u16::from_be_bytes([data[i], data[i + 1]]);
    (data[0], [axis(1), axis(3), axis(5)])
}

/// The frame of one taxel's value: status, then x, y, z with the most significant byte first, then `sda + 1`.
pub(super) fn frame(ids: IdLayout, board: u8, k: u8, counts: [u16; 3], status: u8) -> Option<CanFrame> {
    let (sda, _) = ids.line(k);
    let [x, y, z] = counts.map(u16::to_be_bytes);
    let data = [status, x[0], x[1], y[0], y[1], z[0], z[1], sda + 1];
    CanFrame::standard(ids.id(board, k), &data).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_carries_big_endian_counts_between_status_and_line() {
        let frame = frame(IdLayout::L2, 3, 0b10_01, [0x1234, 0x8000, 0x3039], 0x83).unwrap();
        assert_eq!(frame.to_string(), "321#8312348000303903");
        assert_eq!(
            payload(frame.data().try_into().unwrap()),
            (0x83, [0x1234, 0x8000, 0x3039])
        );
    }
}
