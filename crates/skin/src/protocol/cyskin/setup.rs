//! How CySkin hubs speak: what Genoa's own CAN library does, and the variants that a layout file can name
//! instead (docs/protocols.md, "CySkin packets").

use serde::Deserialize;
use taxel_can::CanFrame;

/// Modules on a hub: numbers 0 to 247.
pub(crate) const MODULES: u8 = 248;
/// Capacitive inputs of a module; number 0 measures temperature.
pub(crate) const SENSORS: u8 = 12;
/// Command code of the packets that carry values.
pub(crate) const SENSOR_DATA: u8 = 0x43;
/// Switches a hub's sending by itself on (1) or off (0).
const AUTO_SYNC: u8 = 0x37;
/// Sets the period of that, ms, two bytes, the most significant first.
const AUTO_SYNC_PERIOD: u8 = 0x38;

/// Which ids the frames of packets have. Three bits of an id say the place of the frame in its packet, the
/// lower ones the hub.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum HubIds {
    /// 11 bits: the place in bits 10 to 8, the hub in bits 7 to 0, as Genoa's library has it.
    Standard,
    /// 29 bits: the place in bits 28 to 26, the hub below, as the header files of the EtherCAT generation say.
    Extended,
}

impl HubIds {
    /// Bits of an address.
    const fn bits(self) -> u32 {
        match self {
            HubIds::Standard => 8,
            HubIds::Extended => 26,
        }
    }

    /// The address that means all hubs.
    pub const fn everybody(self) -> u32 {
        (1 << self.bits()) - 1
    }

    /// The largest address of a hub; the smallest is 1.
    pub const fn largest_address(self) -> u32 {
        self.everybody() - 1
    }

    /// The id of a frame of a packet.
    pub(crate) const fn id(self, place: u32, address: u32) -> u32 {
        place << self.bits() | address
    }

    /// The four standard ids of the frames with this address, none where ids are extended.
    pub fn standard_ids(self, address: u32) -> impl Iterator<Item = u16> {
        let places = match self {
            HubIds::Standard => &[FIRST, MIDDLE, LAST, SINGLE][..],
            HubIds::Extended => &[],
        };
        places.iter().map(move |place| self.id(*place, address) as u16)
    }

    /// The place in its packet of a frame with this id.
    #[inline]
    pub(crate) const fn place(self, id: u32) -> u32 {
        id >> self.bits()
    }

    /// The place of a data frame in its packet and the address of its hub; `None` for ids of the other kind.
    #[inline]
    pub(crate) fn split(self, frame: &CanFrame) -> Option<(u32, u32)> {
        let fits =
            frame.is_extended() == (self == HubIds::Extended) && !frame.is_remote() && !frame.is_error();
        fits.then(|| (self.place(frame.id()), frame.id() & self.everybody()))
    }
}

/// The places of a frame in its packet.
pub(super) const FIRST: u32 = 1;
pub(super) const MIDDLE: u32 = 2;
pub(super) const LAST: u32 = 4;
pub(super) const SINGLE: u32 = FIRST | LAST;

/// Order of the two bytes of a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ByteOrder {
    /// Most significant byte first, as Genoa's library has it.
    Big,
    /// Least significant byte first.
    Little,
}

/// How the last byte of a packet is made from all the bytes before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Checksum {
    /// Their sum modulo 256.
    Sum,
    /// The number that makes the sum of the whole packet 0 modulo 256.
    SumToZero,
    /// The sum with every bit inverted.
    InvertedSum,
    /// Their exclusive or.
    Xor,
    /// CRC-8 with polynomial 0x07, start 0xFF, as Genoa's library has it.
    Crc8Ff,
    /// CRC-8 with polynomial 0x07, start 0, which that library rejects.
    Crc8,
    /// There is such a byte, and it is not checked. Only to find out what it is: garbage passes.
    Unchecked,
}

impl Checksum {
    /// The checksum of these bytes; `None` for [`Checksum::Unchecked`].
    pub fn of(self, bytes: &[u8]) -> Option<u8> {
        let sum = || bytes.iter().fold(0u8, |sum, b| sum.wrapping_add(*b));
        Some(match self {
            Checksum::Sum => sum(),
            Checksum::SumToZero => sum().wrapping_neg(),
            Checksum::InvertedSum => !sum(),
            Checksum::Xor => bytes.iter().fold(0, |x, b| x ^ b),
            Checksum::Crc8Ff => crc8(0xFF, bytes),
            Checksum::Crc8 => crc8(0, bytes),
            Checksum::Unchecked => return None,
        })
    }
}

fn crc8(start: u8, bytes: &[u8]) -> u8 {
    let shift = |c: u8, _| if c & 0x80 != 0 { c << 1 ^ 0x07 } else { c << 1 };
    bytes.iter().fold(start, |crc, b| (0..8).fold(crc ^ b, shift))
}

/// Whom the packets of `start` and `stop` are for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CommandsTo {
    /// All hubs of the bus, as Genoa's library has it.
    All,
    /// The one hub that is to be started or stopped.
    Hub,
}

/// The table `cyskin` of a layout file: how its hubs speak (docs/protocols.md, "CySkin gaps").
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CyskinSetup {
    /// Which ids frames have.
    pub ids: HubIds,
    /// Order of the bytes of a value.
    pub byte_order: ByteOrder,
    /// How packets end.
    pub checksum: Checksum,
    /// In packets with more data bytes than this, the frames after the first begin with a sequence
    /// number; 0: in all packets of several frames, 255: in none.
    pub sequence_bytes_above: u8,
    /// After this many values, 1 to 12, the values of the next module follow.
    pub sensors_per_module: u8,
    /// A packet whose next frame does not come within this time is given up, ms, 1 to 10,000.
    pub timeout_ms: u64,
    /// The hubs' period, ms, 2 to 10,000; one that is silent for three of them is started again.
    pub period_ms: u16,
    /// Whom `start` and `stop` are sent to.
    pub commands_to: CommandsTo,
    /// The hubs, in the order of the file; a module names its hub by index.
    pub hubs: Vec<CyskinHub>,
    /// What is sent to start a hub; nothing where hubs send by themselves.
    pub start: Vec<CyskinPacket>,
    /// What is sent to stop it.
    pub stop: Vec<CyskinPacket>,
}

/// One hub.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CyskinHub {
    /// Its name.
    pub name: String,
    /// Index of its bus in [`crate::Layout::buses`].
    pub bus: u8,
    /// The address in the ids of its frames, 1 to [`HubIds::largest_address`].
    pub address: u32,
}

/// A packet to a hub, with the pause after it.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CyskinPacket {
    /// Command code; one of those that only set up the sending of values ([`CyskinPacket::ALLOWED`]).
    pub command: u8,
    /// Up to 5 bytes, so that the packet is one frame.
    #[serde(default)]
    pub data: Vec<u8>,
    /// Pause after it, ms, 2 to 10,000.
    #[serde(default = "ten_ms")]
    pub pause_ms: u64,
}

const fn ten_ms() -> u64 {
    10
}

impl CyskinSetup {
    /// As Genoa's library drives hubs, with this period, ms. It was seen to number no continuation frames in
    /// packets of up to 40 data bytes; that it never does is an assumption.
    pub fn of_library(period_ms: u16, hubs: Vec<CyskinHub>) -> Self {
        Self {
            ids: HubIds::Standard,
            byte_order: ByteOrder::Big,
            checksum: Checksum::Crc8Ff,
            sequence_bytes_above: u8::MAX,
            sensors_per_module: SENSORS,
            timeout_ms: 50,
            period_ms,
            commands_to: CommandsTo::All,
            hubs,
            start: vec![
                CyskinPacket::new(AUTO_SYNC_PERIOD, &period_ms.to_be_bytes()),
                CyskinPacket::new(AUTO_SYNC, &[1]),
            ],
            stop: vec![CyskinPacket::new(AUTO_SYNC, &[0])],
        }
    }
}

impl CyskinPacket {
    /// Grouping, automatic synchronisation and its period, SPI speed, sync, declare, CDC speed and
    /// control, phase shift. Programming, reboots and the cutting of sensors are not sent by this
    /// program.
    pub const ALLOWED: [u8; 10] = [0x36, 0x37, 0x38, 0x39, 0x3A, 0x3B, 0x3C, 0x42, 0x44, 0x45];

    /// A packet with the usual pause after it.
    fn new(command: u8, data: &[u8]) -> Self {
        Self {
            command,
            data: data.to_vec(),
            pause_ms: ten_ms(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checksums_are_those_of_their_names() {
        let bytes = b"123456789";
        let sum = 0xDDu8;
        let cases = [
            (Checksum::Sum, Some(sum)),
            (Checksum::SumToZero, Some(0x23)),
            (Checksum::InvertedSum, Some(0x22)),
            (Checksum::Xor, Some(0x31)),
            (Checksum::Crc8Ff, Some(0xFB)),
            // The catalogued check value of CRC-8 (polynomial 0x07).
            (Checksum::Crc8, Some(0xF4)),
            (Checksum::Unchecked, None),
        ];
        for (checksum, value) in cases {
            assert_eq!(checksum.of(bytes), value, "{checksum:?}");
        }
    }
    /// The library's own packets (docs/protocols.md, "CySkin packets").
    #[test]
    fn the_library_s_packets_have_a_crc_that_starts_at_ff() {
        for packet in [
            &[0x38, 0x02, 0x00, 0x32, 0x80][..],
            &[0x37, 1, 1, 0xCE],
            &[0x37, 1, 0, 0xC9],
        ] {
            let (last, before) = packet.split_last().unwrap();
            assert_eq!(Checksum::Crc8Ff.of(before), Some(*last), "{packet:02X?}");
        }
    }
}
