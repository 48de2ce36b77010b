//! The table `cyskin` of a layout file, as it is written, and what is refused of it.

use super::setup::{ByteOrder, Checksum, CommandsTo, CyskinHub, CyskinPacket, CyskinSetup, HubIds, SENSORS};
use serde::Deserialize;
use taxel_hand::{FromMap, why_no_name};

/// The table as it is written, before it is known to be complete.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FileCyskin {
    #[serde(default = "standard")]
    ids: HubIds,
    byte_order: Option<ByteOrder>,
    checksum: Option<Checksum>,
    sequence_bytes_above: Option<u8>,
    sensors_per_module: Option<u8>,
    timeout_ms: Option<u64>,
    #[serde(default = "period_ms")]
    period_ms: u16,
    commands_to: Option<CommandsTo>,
    #[serde(default, deserialize_with = "FromMap::list")]
    hub: Vec<FileHub>,
    start: Option<Vec<FromMap<CyskinPacket>>>,
    stop: Option<Vec<FromMap<CyskinPacket>>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FileHub {
    name: String,
    bus: String,
    address: Option<u32>,
}

fn standard() -> HubIds {
    HubIds::Standard
}

fn period_ms() -> u16 {
    50
}

/// What a layout of hubs without a table is told.
pub(crate) fn no_table() -> String {
    format!("[cyskin] lacks {HUBS}")
}

const HUBS: &str = "hub (a list of { name, bus, address })";

/// The keys without default where ids are extended, with what each of them is.
const REQUIRED: [(&str, &str); 4] = [
    ("byte_order", "\"big\" or \"little\""),
    (
        "checksum",
        "\"crc8-ff\", \"crc8\", \"sum\", \"sum-to-zero\", \"inverted-sum\", \"xor\" or \"unchecked\"",
    ),
    (
        "sequence_bytes_above",
        "data bytes above which continuation frames are numbered; 0 always, 255 never",
    ),
    ("sensors_per_module", "1 to 12"),
];

impl FileCyskin {
    /// The complete setup, or why there is none.
    pub(crate) fn check(self, buses: &[String]) -> Result<CyskinSetup, String> {
        if self.hub.is_empty() {
            return Err(no_table());
        }
        if self.hub.len() > usize::from(u8::MAX) {
            return Err(format!("cyskin: {} hubs are more than 255", self.hub.len()));
        }
        let mut setup = CyskinSetup::of_library(self.period_ms, Vec::new());
        if self.ids == HubIds::Extended {
            let given = [
                self.byte_order.is_some(),
                self.checksum.is_some(),
                self.sequence_bytes_above.is_some(),
                self.sensors_per_module.is_some(),
            ];
            let lacking = REQUIRED.iter().zip(given).filter(|(_, given)| !given);
            let lacking: Vec<String> = lacking
                .map(|((key, what), _)| format!("{key} ({what})"))
                .collect();
            if !lacking.is_empty() {
                return Err(format!(
                    "[cyskin] lacks {}; with ids = \"extended\" these are not public (nothing can be assumed): ask the maker of the hub, or measure, and write them",
                    lacking.join(", ")
                ));
            }
            setup.ids = HubIds::Extended;
            setup.commands_to = CommandsTo::Hub;
            (setup.start, setup.stop) = (Vec::new(), Vec::new());
        }
        if self.checksum == Some(Checksum::Unchecked) {
            // No packet can be made.
            (setup.start, setup.stop) = (Vec::new(), Vec::new());
        }
        setup.byte_order = self.byte_order.unwrap_or(setup.byte_order);
        setup.checksum = self.checksum.unwrap_or(setup.checksum);
        setup.sequence_bytes_above = self.sequence_bytes_above.unwrap_or(setup.sequence_bytes_above);
        setup.sensors_per_module = self.sensors_per_module.unwrap_or(setup.sensors_per_module);
        setup.timeout_ms = self.timeout_ms.unwrap_or(setup.timeout_ms);
        setup.commands_to = self.commands_to.unwrap_or(setup.commands_to);
        for (given, list) in [(self.start, &mut setup.start), (self.stop, &mut setup.stop)] {
            if let Some(given) = given {
                *list = given.into_iter().map(|FromMap(packet)| packet).collect();
            }
        }
        check_numbers(&setup)?;
        for hub in self.hub {
            let hub = hub.check(setup.ids, buses)?;
            if let Some(other) = setup.hubs.iter().find(|h| h.name == hub.name) {
                return Err(format!("hub {:?} is listed twice", other.name));
            }
            let same = |h: &&CyskinHub| (h.bus, h.address) == (hub.bus, hub.address);
            if let Some(other) = setup.hubs.iter().find(same) {
                return Err(format!(
                    "hubs {:?} and {:?} have one address on one bus",
                    other.name, hub.name
                ));
            }
            setup.hubs.push(hub);
        }
        for packet in setup.start.iter().chain(&setup.stop) {
            check_packet(packet, setup.checksum)?;
        }
        Ok(setup)
    }
}

fn check_numbers(setup: &CyskinSetup) -> Result<(), String> {
    let numbers = [
        (
            "sensors_per_module",
            u64::from(setup.sensors_per_module),
            [1, u64::from(SENSORS)],
        ),
        ("timeout_ms", setup.timeout_ms, [1, 10_000]),
        ("period_ms", u64::from(setup.period_ms), [2, 10_000]),
    ];
    for (key, value, [least, most]) in numbers {
        if !(least..=most).contains(&value) {
            return Err(format!("cyskin.{key} = {value} is not {least} to {most}"));
        }
    }
    Ok(())
}

impl FileHub {
    fn check(self, ids: HubIds, buses: &[String]) -> Result<CyskinHub, String> {
        let Self { name, bus, address } = self;
        if let Some(why) = why_no_name(&name) {
            return Err(format!("hub {name:?} is {why}"));
        }
        let Some(bus_index) = buses.iter().position(|b| *b == bus) else {
            return Err(format!(
                "hub {name:?} is on bus {bus:?}, but the buses are {}",
                buses.join(", ")
            ));
        };
        let Some(address) = address else {
            return Err(format!(
                "hub {name:?} lacks its address (which addresses hubs get is not public; the ids of its frames show it: id & {:#X})",
                ids.everybody()
            ));
        };
        let largest = ids.largest_address();
        if !(1..=largest).contains(&address) {
            let otherwise = match ids {
                HubIds::Standard if address <= HubIds::Extended.largest_address() => {
                    "; a hub with ids of 29 bits needs ids = \"extended\" in [cyskin]"
                }
                _ => "",
            };
            return Err(format!(
                "hub {name:?}: address {address:#X} is not 1 to {largest:#X}{otherwise}"
            ));
        }
        Ok(CyskinHub {
            name,
            bus: bus_index as u8,
            address,
        })
    }
}

fn check_packet(packet: &CyskinPacket, checksum: Checksum) -> Result<(), String> {
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
    Ok(())
}
