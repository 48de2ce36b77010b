//! What of CySkin is public, as numbers; and what is not, as configuration without default: the
//! table `cyskin` of a layout file.

use serde::Deserialize;

/// Modules on a hub: numbers 0 to 247.
pub(crate) const MODULES: u8 = 248;
/// Capacitive inputs of a module; number 0 measures temperature.
pub(crate) const SENSORS: u8 = 12;
/// The largest address; the one above is the broadcast.
pub(crate) const LARGEST_ADDRESS: u32 = 0x03FF_FFFE;
/// Command code of the packets that carry values.
pub(crate) const SENSOR_DATA: u8 = 0x43;

/// Order of the two bytes of a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ByteOrder {
    /// Most significant byte first, as in the EtherCAT generation.
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
    /// CRC-8 with polynomial 0x07, start 0.
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
            Checksum::Crc8 => bytes.iter().fold(0u8, |crc, b| {
                (0..8).fold(crc ^ b, |c, _| if c & 0x80 != 0 { c << 1 ^ 0x07 } else { c << 1 })
            }),
            Checksum::Unchecked => return None,
        })
    }
}

/// The table `cyskin` of a layout file: what the CAN generation of CySkin leaves unpublished
/// (docs/protocols.md, "CySkin gaps").
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CyskinSetup {
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
    /// The hubs, in the order of the file; a module names its hub by index.
    pub hubs: Vec<CyskinHub>,
    /// What is sent to every hub to start it.
    pub start: Vec<CyskinPacket>,
    /// What is sent to every hub to stop it.
    pub stop: Vec<CyskinPacket>,
}

/// One hub.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CyskinHub {
    /// Its name.
    pub name: String,
    /// Index of its bus in [`crate::Layout::buses`].
    pub bus: u8,
    /// The address in the ids of its frames, 1 to 0x3FFFFFE.
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

fn ten_ms() -> u64 {
    10
}

impl CyskinPacket {
    /// Grouping, automatic synchronisation and its period, SPI speed, sync, declare, CDC speed and
    /// control, phase shift. Programming, reboots and the cutting of sensors are not sent by this
    /// program.
    pub const ALLOWED: [u8; 10] = [0x36, 0x37, 0x38, 0x39, 0x3A, 0x3B, 0x3C, 0x42, 0x44, 0x45];
}

/// The table as it is written, before it is known to be complete.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FileCyskin {
    byte_order: Option<ByteOrder>,
    checksum: Option<Checksum>,
    sequence_bytes_above: Option<u8>,
    sensors_per_module: Option<u8>,
    #[serde(default = "timeout_ms")]
    timeout_ms: u64,
    #[serde(default)]
    hub: Vec<FileHub>,
    #[serde(default)]
    start: Vec<CyskinPacket>,
    #[serde(default)]
    stop: Vec<CyskinPacket>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FileHub {
    name: String,
    bus: String,
    address: Option<u32>,
}

fn timeout_ms() -> u64 {
    50
}

/// The keys that have no default, with what each of them is.
const REQUIRED: [(&str, &str); 5] = [
    ("byte_order", "\"big\" or \"little\""),
    (
        "checksum",
        "\"sum\", \"sum-to-zero\", \"inverted-sum\", \"xor\", \"crc8\" or \"unchecked\"",
    ),
    (
        "sequence_bytes_above",
        "data bytes above which continuation frames are numbered; 0 always, 255 never",
    ),
    ("sensors_per_module", "1 to 12"),
    ("hub", "a list of { name, bus, address }"),
];

/// What is missing when there is no table at all.
pub(crate) fn all_missing() -> String {
    missing(REQUIRED.iter())
}

fn missing<'a>(keys: impl Iterator<Item = &'a (&'a str, &'a str)>) -> String {
    let keys: Vec<String> = keys.map(|(key, what)| format!("{key} ({what})")).collect();
    format!(
        "[cyskin] lacks {}; these are not public (nothing can be assumed): ask the maker of the hub, or measure, and write them",
        keys.join(", ")
    )
}

impl FileCyskin {
    /// The complete setup, or why there is none.
    pub(crate) fn check(self, buses: &[String]) -> Result<CyskinSetup, String> {
        let given = [
            self.byte_order.is_some(),
            self.checksum.is_some(),
            self.sequence_bytes_above.is_some(),
            self.sensors_per_module.is_some(),
            !self.hub.is_empty(),
        ];
        let (Some(byte_order), Some(checksum), Some(sequence_bytes_above), Some(sensors_per_module), true) = (
            self.byte_order,
            self.checksum,
            self.sequence_bytes_above,
            self.sensors_per_module,
            given[4],
        ) else {
            let keys = REQUIRED.iter().zip(given).filter(|(_, given)| !given);
            return Err(missing(keys.map(|(key, _)| key)));
        };
        if !(1..=SENSORS).contains(&sensors_per_module) {
            return Err(format!(
                "cyskin.sensors_per_module = {sensors_per_module} is not 1 to {SENSORS}"
            ));
        }
        if !(1..=10_000).contains(&self.timeout_ms) {
            return Err(format!(
                "cyskin.timeout_ms = {} is not 1 to 10000",
                self.timeout_ms
            ));
        }
        if self.hub.len() > usize::from(u8::MAX) {
            return Err(format!("cyskin: {} hubs are more than 255", self.hub.len()));
        }
        let mut hubs: Vec<CyskinHub> = Vec::new();
        for FileHub { name, bus, address } in self.hub {
            let Some(bus_index) = buses.iter().position(|b| *b == bus) else {
                return Err(format!(
                    "hub {name:?} is on bus {bus:?}, but the buses are {}",
                    buses.join(", ")
                ));
            };
            let Some(address) = address else {
                return Err(format!(
                    "hub {name:?} lacks its address (which addresses hubs get is not public; the ids of its frames show it: id & 0x3FFFFFF)"
                ));
            };
            if !(1..=LARGEST_ADDRESS).contains(&address) {
                return Err(format!(
                    "hub {name:?}: address {address:#X} is not 1 to {LARGEST_ADDRESS:#X}"
                ));
            }
            let hub = CyskinHub {
                name,
                bus: bus_index as u8,
                address,
            };
            if let Some(other) = hubs.iter().find(|h| h.name == hub.name) {
                return Err(format!("hub {:?} is listed twice", other.name));
            }
            if let Some(other) = hubs.iter().find(|h| (h.bus, h.address) == (hub.bus, hub.address)) {
                return Err(format!(
                    "hubs {:?} and {:?} have one address on one bus",
                    other.name, hub.name
                ));
            }
            hubs.push(hub);
        }
        for packet in self.start.iter().chain(&self.stop) {
            let CyskinPacket {
                command,
                data,
                pause_ms,
            } = packet;
            if !CyskinPacket::ALLOWED.contains(command) {
                return Err(format!(
                    "cyskin: command {command:#04X} is not one that start or stop may send (0x36 to 0x3C, 0x42, 0x44, 0x45)"
                ));
            }
            if data.len() > 5 {
                return Err(format!(
                    "cyskin: command {command:#04X} has {} data bytes, not up to 5",
                    data.len()
                ));
            }
            if !(2..=10_000).contains(pause_ms) {
                return Err(format!("cyskin: pause_ms = {pause_ms} is not 2 to 10000"));
            }
            if checksum == Checksum::Unchecked {
                return Err(
                    "cyskin: with checksum = \"unchecked\" nothing can be sent; remove start and stop".into(),
                );
            }
        }
        Ok(CyskinSetup {
            byte_order,
            checksum,
            sequence_bytes_above,
            sensors_per_module,
            timeout_ms: self.timeout_ms,
            hubs,
            start: self.start,
            stop: self.stop,
        })
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
            // The catalogued check value of CRC-8 (polynomial 0x07).
            (Checksum::Crc8, Some(0xF4)),
            (Checksum::Unchecked, None),
        ];
        for (checksum, value) in cases {
            assert_eq!(checksum.of(bytes), value, "{checksum:?}");
        }
    }
}
