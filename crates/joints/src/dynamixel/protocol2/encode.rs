//! Packets, written.

use super::{BROADCAST_ID, HEADER, Instruction, PREFIX_BYTES, crc16};

/// Bytes for one servo, as a sync write hands them out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Assignment<'a> {
    /// The servo.
    pub id: u8,
    /// Its bytes: as many as every other servo's.
    pub data: &'a [u8],
}

/// Writes one packet at a time into memory that is used again; nothing is allocated once it has grown to the
/// longest packet.
///
/// A packet's LEN has 16 bits: parameters that do not fit are refused with `None`.
///
/// ```
/// use taxel_joints::protocol2::Encoder;
///
/// let mut encoder = Encoder::default();
/// assert_eq!(encoder.ping(1), [0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x03, 0x00, 0x01, 0x19, 0x4E]);
/// ```
#[derive(Debug, Default, Clone)]
pub struct Encoder {
    bytes: Vec<u8>,
}

impl Encoder {
    /// An encoder that has room for packets of so many bytes from the start.
    pub fn with_capacity(bytes: usize) -> Self {
        Self {
            bytes: Vec::with_capacity(bytes),
        }
    }

    /// Ping one servo, or all of them ([`BROADCAST_ID`]); these answer in the order of their ids.
    pub fn ping(&mut self, id: u8) -> &[u8] {
        self.short(id, Instruction::Ping, &[])
    }

    /// Restart one servo.
    pub fn reboot(&mut self, id: u8) -> &[u8] {
        self.short(id, Instruction::Reboot, &[])
    }

    /// Read `length` bytes at `address`.
    pub fn read(&mut self, id: u8, address: u16, length: u16) -> &[u8] {
        let [a, b] = address.to_le_bytes();
        let [c, d] = length.to_le_bytes();
        self.short(id, Instruction::Read, &[a, b, c, d])
    }

    /// Write bytes at `address`.
    pub fn write(&mut self, id: u8, address: u16, data: &[u8]) -> Option<&[u8]> {
        let parts = [&address.to_le_bytes()[..], data];
        self.packet(id, Instruction::Write, parts.into_iter().flatten().copied())
    }

    /// Read the same bytes of several servos; they answer in the order of `ids`, each with its own packet.
    pub fn sync_read(&mut self, address: u16, length: u16, ids: &[u8]) -> Option<&[u8]> {
        self.sync(Instruction::SyncRead, address, length, ids)
    }

    /// Read the same bytes of several servos; they answer in one packet ([`super::FastBlocks`]).
    pub fn fast_sync_read(&mut self, address: u16, length: u16, ids: &[u8]) -> Option<&[u8]> {
        self.sync(Instruction::FastSyncRead, address, length, ids)
    }

    /// Write the same bytes of several servos; nobody answers. `None` too if the servos' data
    /// differ in length.
    pub fn sync_write(&mut self, address: u16, data: &[Assignment<'_>]) -> Option<&[u8]> {
        let length = data.first().map_or(0, |a| a.data.len());
        if data.iter().any(|a| a.data.len() != length) {
            return None;
        }
        let place = place(address, u16::try_from(length).ok()?);
        let each = data
            .iter()
            .flat_map(|a| std::iter::once(a.id).chain(a.data.iter().copied()));
        self.packet(
            BROADCAST_ID,
            Instruction::SyncWrite,
            place.into_iter().chain(each),
        )
    }

    /// A servo's answer: `error` is its ERR byte.
    pub fn status(&mut self, id: u8, error: u8, data: &[u8]) -> Option<&[u8]> {
        let parameters = std::iter::once(error).chain(data.iter().copied());
        self.packet(id, Instruction::Status, parameters)
    }

    /// Any packet.
    pub fn packet(
        &mut self,
        id: u8,
        instruction: Instruction,
        parameters: impl IntoIterator<Item = u8>,
    ) -> Option<&[u8]> {
        let out = &mut self.bytes;
        out.clear();
        out.extend_from_slice(&HEADER);
        out.extend_from_slice(&[id, 0, 0, instruction as u8]);
        for byte in parameters {
            out.push(byte);
            // No instruction is FF, so the pattern lies within the parameters.
            if out.ends_with(&[0xFF, 0xFF, 0xFD]) {
                out.push(0xFD);
            }
            if out.len() + 2 > PREFIX_BYTES + usize::from(u16::MAX) {
                return None;
            }
        }
        let length = u16::try_from(out.len() + 2 - PREFIX_BYTES).ok()?;
        out[PREFIX_BYTES - 2..PREFIX_BYTES].copy_from_slice(&length.to_le_bytes());
        let crc = crc16(0, out);
        out.extend_from_slice(&crc.to_le_bytes());
        Some(out)
    }

    fn sync(&mut self, instruction: Instruction, address: u16, length: u16, ids: &[u8]) -> Option<&[u8]> {
        let parameters = place(address, length).into_iter().chain(ids.iter().copied());
        self.packet(BROADCAST_ID, instruction, parameters)
    }

    /// A packet of a few parameters, which always fits.
    fn short(&mut self, id: u8, instruction: Instruction, parameters: &[u8]) -> &[u8] {
        debug_assert!(parameters.len() < 64);
        self.packet(id, instruction, parameters.iter().copied())
            .unwrap_or_default()
    }
}

fn place(address: u16, length: u16) -> [u8; 4] {
    let ([a, b], [c, d]) = (address.to_le_bytes(), length.to_le_bytes());
    [a, b, c, d]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hex(text: &str) -> Vec<u8> {
        text.split(' ')
            .map(|b| u8::from_str_radix(b, 16).unwrap())
            .collect()
    }

    #[test]
    fn writes_the_packets_of_the_manual() {
        let e = &mut Encoder::default();
        let cases = [
            (e.ping(1).to_vec(), "FF FF FD 00 01 03 00 01 19 4E"),
            (
                e.status(1, 0, &[0x06, 0x04, 0x26]).unwrap().to_vec(),
                "FF FF FD 00 01 07 00 55 00 06 04 26 65 5D",
            ),
            (e.ping(BROADCAST_ID).to_vec(), "FF FF FD 00 FE 03 00 01 31 42"),
            (
                e.read(1, 132, 4).to_vec(),
                "FF FF FD 00 01 07 00 02 84 00 04 00 1D 15",
            ),
            (
                e.status(1, 0, &166u32.to_le_bytes()).unwrap().to_vec(),
                "FF FF FD 00 01 08 00 55 00 A6 00 00 00 8C C0",
            ),
            (
                e.sync_read(132, 4, &[1, 2]).unwrap().to_vec(),
                "FF FF FD 00 FE 09 00 82 84 00 04 00 01 02 CE FA",
            ),
            (
                e.status(2, 0, &2079u32.to_le_bytes()).unwrap().to_vec(),
                "FF FF FD 00 02 08 00 55 00 1F 08 00 00 BA BE",
            ),
            (
                e.write(1, 116, &512u32.to_le_bytes()).unwrap().to_vec(),
                "FF FF FD 00 01 09 00 03 74 00 00 02 00 00 CA 89",
            ),
            (
                e.status(1, 0, &[]).unwrap().to_vec(),
                "FF FF FD 00 01 04 00 55 00 A1 0C",
            ),
            (e.reboot(1).to_vec(), "FF FF FD 00 01 03 00 08 2F 4E"),
        ];
        for (written, manual) in cases {
            assert_eq!(written, hex(manual), "{manual}");
        }
    }

    #[test]
    fn stuffs_the_header_pattern_wherever_it_is_in_the_parameters() {
        let e = &mut Encoder::default();
        let packet = e
            .write(1, 0x1FF, &[0xFF, 0xFD, 0x00, 0xFF, 0xFF, 0xFD, 0xFD])
            .unwrap();
        // The address is FF 01, so only the second pattern is one; LEN counts the stuffing.
        let body = &packet[PREFIX_BYTES..packet.len() - 2];
        assert_eq!(
            body,
            [0x03, 0xFF, 0x01, 0xFF, 0xFD, 0x00, 0xFF, 0xFF, 0xFD, 0xFD, 0xFD]
        );
        assert_eq!(usize::from(packet[5]), body.len() + 2);
        // Low byte FF of an address and the data after its high byte FF make one too.
        let packet = e.write(1, 0xFFFF, &[0xFD]).unwrap();
        assert_eq!(
            packet[PREFIX_BYTES..packet.len() - 2],
            [0x03, 0xFF, 0xFF, 0xFD, 0xFD]
        );
    }

    #[test]
    fn refuses_what_a_packet_cannot_carry() {
        let e = &mut Encoder::default();
        assert!(e.write(1, 0, &vec![0; 65_530]).is_some());
        assert!(e.write(1, 0, &vec![0; 65_531]).is_none());
        assert!(e.write(1, 0, &vec![0; 1 << 20]).is_none());
        let uneven = [
            Assignment { id: 1, data: &[1, 2] },
            Assignment { id: 2, data: &[3] },
        ];
        assert!(e.sync_write(64, &uneven).is_none());
    }
}
