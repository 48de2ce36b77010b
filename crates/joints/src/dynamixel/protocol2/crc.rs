//! The checksum of Protocol 2.0.

/// CRC-16 with polynomial 0x8005, initial value 0, no reflection and no final exclusive or
/// ("BUYPASS"), continued from `crc` over `bytes`. A packet's CRC goes from its header to its last
/// parameter, after stuffing.
pub fn crc16(crc: u16, bytes: &[u8]) -> u16 {
    bytes.iter().fold(crc, |crc, byte| {
        crc << 8 ^ TABLE[usize::from((crc >> 8) as u8 ^ byte)]
    })
}

const TABLE: [u16; 256] = {
    let mut table = [0; 256];
    let mut i = 0;
    while i < 256 {
        let mut crc = (i as u16) << 8;
        let mut bit = 0;
        while bit < 8 {
            crc = if crc & 0x8000 == 0 {
                crc << 1
            } else {
                crc << 1 ^ 0x8005
            };
            bit += 1;
        }
        table[i] = crc;
        i += 1;
    }
    table
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gives_the_check_value_of_the_crc_catalogue() {
        // CRC-16/UMTS, also called BUYPASS.
        assert_eq!(crc16(0, b"123456789"), 0xFEE8);
    }

    #[test]
    fn can_be_continued() {
        let bytes: Vec<u8> = (0..200).collect();
        for cut in [0, 1, 99, 200] {
            assert_eq!(crc16(crc16(0, &bytes[..cut]), &bytes[cut..]), crc16(0, &bytes));
        }
    }
}
