//! How many bits a classic CAN frame takes on the wire (ISO 11898-1).

use crate::CanFrame;

/// Bits after the CRC, which are never stuffed: CRC delimiter, ACK slot and delimiter, end of
/// frame, interframe space.
const TAIL_BITS: u32 = 1 + 2 + 7 + 3;
/// Bits of a standard and of an extended frame from its start to the end of its CRC, without data
/// and stuff bits.
const STANDARD_BITS: u32 = 34;
const EXTENDED_BITS: u32 = 54;

impl CanFrame {
    /// Fewest and most bits of a data or remote frame on the wire, interframe space included:
    /// without stuff bits, and with as many as there can be. 111 and 135 for a standard frame with
    /// eight data bytes.
    #[inline]
    pub fn bits_within(&self) -> [u32; 2] {
        let head = if self.is_extended() {
            EXTENDED_BITS
        } else {
            STANDARD_BITS
        };
        let stuffable = head + 8 * self.data().len() as u32;
        let least = stuffable + TAIL_BITS;
        [least, least + (stuffable - 1) / 4]
    }

    /// Exact number of bits of a data or remote frame on the wire, with its stuff bits and the
    /// interframe space.
    pub fn bits(&self) -> u32 {
        let mut line = Line::default();
        line.send(0, 1);
        let (id, rtr) = (self.id(), u32::from(self.is_remote()));
        if self.is_extended() {
            line.send(id >> 18, 11);
            line.send(0b11, 2);
            line.send(id & 0x3FFFF, 18);
            line.send(rtr << 2, 3);
        } else {
            line.send(id, 11);
            line.send(rtr << 2, 3);
        }
        line.send(u32::from(self.dlc()), 4);
        self.data().iter().for_each(|byte| line.send_byte(*byte));
        let crc = line.crc;
        line.send(crc, 15);
        line.bits + TAIL_BITS
    }
}

/// Counts bits as a transmitter puts them on the line.
#[derive(Default, Clone, Copy)]
struct Line {
    bits: u32,
    /// Bits alike at the end, 1 to 4, and what they are.
    run: u32,
    last: u32,
    crc: u32,
}

/// What eight data bits do: to a line that ends in each of eight ways, how many stuff bits they bring and, in the lowest three
/// bits, how it ends then; and to a CRC of 0.
const STUFFED: [[u8; 256]; 8] = stuffed();
const CRC: [u16; 256] = crc();

impl Line {
    const fn send(&mut self, value: u32, bits: u32) {
        let mut left = bits;
        while left > 0 {
            left -= 1;
            let bit = value >> left & 1;
            let feedback = bit ^ (self.crc >> 14 & 1);
            self.crc = self.crc << 1 & 0x7FFF;
            if feedback == 1 {
                self.crc ^= 0x4599;
            }
            self.bits += 1;
            if self.bits > 1 && bit == self.last {
                self.run += 1;
            } else {
                self.run = 1;
                self.last = bit;
            }
            if self.run == 5 {
                self.bits += 1;
                self.last = 1 - bit;
                self.run = 1;
            }
        }
    }

    /// The same for eight bits behind others.
    fn send_byte(&mut self, byte: u8) {
        let done = STUFFED[self.end() as usize][usize::from(byte)];
        self.bits += 8 + u32::from(done >> 3);
        (self.last, self.run) = (u32::from(done >> 2 & 1), u32::from(done & 3) + 1);
        let folded = (self.crc >> 7) as u8 ^ byte;
        self.crc = self.crc << 8 & 0x7FFF ^ u32::from(CRC[usize::from(folded)]);
    }

    /// How it ends, as a number below 8.
    const fn end(&self) -> u32 {
        self.last << 2 | (self.run - 1)
    }
}

const fn stuffed() -> [[u8; 256]; 8] {
    let mut all = [[0; 256]; 8];
    let mut end = 0;
    while end < 8 {
        let mut byte = 0;
        while byte < 256 {
            let mut line = Line {
                bits: 1,
                run: (end & 3) + 1,
                last: end >> 2,
                crc: 0,
            };
            line.send(byte, 8);
            all[end as usize][byte as usize] = ((line.bits - 9) << 3 | line.end()) as u8;
            byte += 1;
        }
        end += 1;
    }
    all
}

const fn crc() -> [u16; 256] {
    let mut all = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let mut line = Line {
            bits: 1,
            run: 1,
            last: 0,
            crc: 0,
        };
        line.send(byte, 8);
        all[byte as usize] = line.crc as u16;
        byte += 1;
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn eight_bits_at_once_are_as_long_as_one_by_one(head in 0u32..0x8_0000, data in prop::collection::vec(any::<u8>(), 0..=8)) {
            let mut one_by_one = Line::default();
            one_by_one.send(head, 19);
            let mut at_once = one_by_one;
            for byte in data {
                one_by_one.send(byte.into(), 8);
                at_once.send_byte(byte);
            }
            prop_assert_eq!((at_once.bits, at_once.crc, at_once.end()), (one_by_one.bits, one_by_one.crc, one_by_one.end()));
        }
    }

    #[test]
    fn lengths_stay_within_the_bounds_of_the_standard() {
        for dlc in 0..=8 {
            for fill in [0x00, 0xFF, 0x55, 0x83, 0x3C] {
                for id in [0x000, 0x233, 0x555, 0x7FF] {
                    let frame = CanFrame::standard(id, &[fill; 8][..dlc]).unwrap();
                    let [least, most] = frame.bits_within();
                    let (plain, bits) = (47 + 8 * dlc as u32, frame.bits());
                    assert_eq!([least, most], [plain, plain + (34 + 8 * dlc as u32 - 1) / 4]);
                    assert!((least..=most).contains(&bits), "{frame}: {bits}");
                }
            }
        }
        let extended = CanFrame::extended(0x1555_5555, &[0x55; 8]).unwrap();
        assert_eq!(extended.bits_within(), [131, 160]);
        assert!((131..=160).contains(&extended.bits()), "{}", extended.bits());
    }

    #[test]
    fn bits_of_a_frame_are_those_of_the_arithmetic() {
        for (frame, bits) in [
            (CanFrame::standard(0x710, &[0; 8]), [111, 135]),
            (CanFrame::standard(0x201, &[]), [47, 55]),
            (CanFrame::extended(1, &[0; 8]), [131, 160]),
            (CanFrame::remote(0x201, false, 8), [47, 55]),
        ] {
            assert_eq!(frame.unwrap().bits_within(), bits);
        }
    }

    #[test]
    fn a_run_of_five_equal_bits_costs_one_more() {
        // Id 0x555 alternates; a remote frame of DLC 0 then has 0 (r0) 000 (DLC 0): SOF 0,
        // 10101010101, 1, 0, 0, 0000: six zeros in a row hold one stuff bit, the CRC decides about
        // the rest.
        let mut line = Line::default();
        line.send(0, 1);
        line.send(0x555, 11);
        assert_eq!(line.bits, 12);
        line.send(0b100, 3);
        line.send(0, 4);
        assert_eq!(line.bits, 12 + 7 + 1);
    }

    #[test]
    fn the_checksum_is_that_of_can() {
        // CRC-15/CAN of "123456789" is 0x059E by the catalogue of parametrised CRC algorithms.
        let mut line = Line::default();
        for byte in b"123456789" {
            line.send(u32::from(*byte), 8);
        }
        assert_eq!(line.crc, 0x059E);
    }
}
