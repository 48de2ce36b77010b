//! uSkin and XELA (protocols.md section 2): one frame per taxel, its identifier and its payload.

use crate::Protocol;
use taxel_can::CanFrame;

/// MLX90393 status bit: the chip reports an error.
pub const STATUS_ERROR: u8 = 0x10;
/// Status byte of a chip that did not answer, since the I2C bus is left to its pull-ups. Its error bit is set too.
pub const STATUS_NO_ANSWER: u8 = 0xFF;

/// Whether a status byte says that the value beside it must not be used: error bit set, or no answer.
pub const fn status_is_error(status: u8) -> bool {
    status & STATUS_ERROR != 0
}

/// Standard id of the frames that carry taxel `k` of a board; `None` if the protocol is no uSkin layout, or has no such
/// board or taxel.
///
/// What is uncertain (protocols.md 2.3, 2.8): which layout a given hand uses is not public for L1 and L2; of L3
/// the manual's excerpt only gives one example (controller 1: 0x001 to 0x051, 0x101 to 0x151, ... 0x301 to
/// 0x351), and what the group bit means is not said. Here it extends the controller number.
pub(crate) const fn can_id(protocol: Protocol, board: u8, k: u8) -> Option<u16> {
    if board >= protocol.addresses() || k >= protocol.taxel_numbers() {
        return None;
    }
    let (board, k) = (board as u16, k as u16);
    Some(match protocol {
        Protocol::UskinL1 => 0x700 | board << 4 | k,
        Protocol::UskinL2 => board << 8 | (k >> 2) << 4 | (k & 3),
        Protocol::UskinL3 => (board >> 4) << 10 | (k >> 4) << 8 | (k & 15) << 4 | (board & 15),
        _ => return None,
    })
}

/// The board and taxel number `(board, k)` a standard id means. It undoes [`can_id`].
pub(crate) const fn taxel_of(protocol: Protocol, id: u16) -> Option<(u8, u8)> {
    if id > 0x7FF {
        return None;
    }
    let (board, k) = match protocol {
        Protocol::UskinL1 => {
            if id < 0x700 {
                return None;
            }
            ((id >> 4 & 15) as u8, (id & 15) as u8)
        }
        Protocol::UskinL2 => {
            if id & 0xCC != 0 {
                return None;
            }
            ((id >> 8) as u8, (id >> 2 & 0xC | id & 3) as u8)
        }
        Protocol::UskinL3 => (
            (id >> 6 & 0x10 | id & 15) as u8,
            (id >> 4 & 0x30 | id >> 4 & 15) as u8,
        ),
        _ => return None,
    };
    if board < protocol.addresses() {
        Some((board, k))
    } else {
        None
    }
}

/// The frame of one taxel's value: status, then x, y, z with the most significant byte first, then `sda + 1`.
pub(crate) fn frame(protocol: Protocol, board: u8, k: u8, counts: [u16; 3], status: u8) -> Option<CanFrame> {
    let id = can_id(protocol, board, k)?;
    let sda = match protocol {
        Protocol::UskinL3 => k >> 4,
        _ => k >> 2,
    };
    let [x, y, z] = counts.map(u16::to_be_bytes);
    CanFrame::standard(id, &[status, x[0], x[1], y[0], y[1], z[0], z[1], sda + 1]).ok()
}

/// Status and counts of a taxel frame's eight data bytes (protocols.md 2.2).
pub(crate) fn payload(data: &[u8; 8]) -> (u8, [u16; 3]) {
    let axis = |i: usize| u16::from_be_bytes([data[i], data[i + 1]]);
    (data[0], [axis(1), axis(3), axis(5)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_are_those_of_the_published_layouts() {
        let cases = [
            // XELA XR1944: board 1, 0x710 to 0x71F.
            (Protocol::UskinL1, 1, 0, Some(0x710)),
            (Protocol::UskinL1, 1, 15, Some(0x71F)),
            // L1: sda 1, chip 2.
            (Protocol::UskinL1, 5, 0b01_10, Some(0x756)),
            // L2: board 2 sends 0x200 to 0x233.
            (Protocol::UskinL2, 2, 0, Some(0x200)),
            (Protocol::UskinL2, 2, 15, Some(0x233)),
            (Protocol::UskinL2, 7, 0b10_01, Some(0x721)),
            (Protocol::UskinL2, 8, 0, None),
            // L3: controller 1, SDA 0 taxel 5 and SDA 3 taxel 5.
            (Protocol::UskinL3, 1, 0x05, Some(0x051)),
            (Protocol::UskinL3, 1, 0x10, Some(0x101)),
            (Protocol::UskinL3, 1, 0x35, Some(0x351)),
            (Protocol::UskinL3, 0x11, 0x00, Some(0x401)),
            (Protocol::UskinL1, 15, 0, None),
            (Protocol::UskinL2, 0, 16, None),
            (Protocol::UskinL3, 32, 0, None),
        ];
        for (protocol, board, k, id) in cases {
            assert_eq!(protocol.can_id(board, k), id, "{protocol:?} board {board} k {k}");
        }
    }

    #[test]
    fn every_id_of_every_board_means_its_taxel_and_passes_its_filter() {
        for protocol in [Protocol::UskinL1, Protocol::UskinL2, Protocol::UskinL3] {
            let mut ids = 0;
            for id in 0..0x800 {
                let Some((board, k)) = protocol.taxel_of(id) else {
                    continue;
                };
                ids += 1;
                assert_eq!(protocol.can_id(board, k), Some(id), "{protocol:?} {id:#x}");
                for b in 0..protocol.addresses() {
                    let passes = protocol
                        .filter(b)
                        .unwrap()
                        .passes(&CanFrame::standard(id, &[]).unwrap());
                    assert_eq!(passes, b == board, "{protocol:?} {id:#x} board {b}");
                }
            }
            assert_eq!(
                ids,
                protocol.addresses() as usize * protocol.taxel_numbers() as usize
            );
            assert_eq!(protocol.taxel_of(0x800), None);
        }
    }

    #[test]
    fn a_frame_carries_big_endian_counts_between_status_and_line() {
        let frame = Protocol::UskinL2
            .frame(3, 0b10_01, [0x1234, 0x8000, 0x3039], 0x83)
            .unwrap();
        assert_eq!(frame.to_string(), "321#8312348000303903");
        assert_eq!(
            payload(frame.data().try_into().unwrap()),
            (0x83, [0x1234, 0x8000, 0x3039])
        );
    }

    #[test]
    fn the_error_bit_and_the_missing_answer_are_errors() {
        for (status, error) in [
            (0x82, false),
            (0x83, false),
            (0x00, false),
            (0x93, true),
            (STATUS_NO_ANSWER, true),
        ] {
            assert_eq!(status_is_error(status), error, "{status:#04x}");
        }
    }
}
