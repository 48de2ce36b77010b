//! CySkin hubs: which variant of their packets they send, found out from packets.

use super::Cyskin;
use super::packet::{begins_packet, begins_with_values};
use super::setup::{ByteOrder, Checksum, HubIds, LAST, MODULES, SENSOR_DATA, SENSORS};
use crate::protocol::board_protocol::Protocol;
use crate::protocol::recognised::{RecognisedBoard, RecognisedBus};
use std::collections::{BTreeMap, BTreeSet};
use taxel_can::CanFrame;

/// Most frames of one hub that are kept.
const MOST_FRAMES: usize = 4000;
/// Longest packet, frames: 258 bytes, seven to a frame.
const MOST_OF_A_PACKET: usize = 40;
/// A checksum is believed if it is right for this share of the packets.
const RIGHT: f64 = 0.9;
const CHECKSUMS: [Checksum; 6] = [
    Checksum::Crc8Ff,
    Checksum::Sum,
    Checksum::SumToZero,
    Checksum::InvertedSum,
    Checksum::Xor,
    Checksum::Crc8,
];

/// How CySkin hubs speak, as far as packets tell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CyskinGuess {
    /// Which ids frames have.
    pub ids: HubIds,
    /// Order of the bytes of a value.
    pub byte_order: ByteOrder,
    /// The checksum that is right for nearly every packet; `Unchecked` if none is.
    pub checksum: Checksum,
    /// See [`crate::CyskinSetup::sequence_bytes_above`].
    pub sequence_bytes_above: u8,
    /// See [`crate::CyskinSetup::sensors_per_module`].
    pub sensors_per_module: u8,
}

/// The packets of one hub, as frames.
#[derive(Debug, Default, Clone)]
pub(crate) struct HubTraffic {
    /// The places of a packet that were heard, a bit each.
    places: u8,
    packets: Vec<Vec<Vec<u8>>>,
    open: Option<Vec<Vec<u8>>>,
    kept: usize,
    first_ns: Option<u64>,
    last_ns: u64,
}

/// A packet's bytes if its continuation frames begin with a number, and if they do not.
struct Ways {
    numbered: Option<Vec<u8>>,
    plain: Vec<u8>,
}

impl Ways {
    /// Whether they are a packet with this checksum, numbered or not.
    fn is_whole(&self, checksum: Checksum) -> bool {
        let numbered = self.numbered.as_ref();
        numbered.is_some_and(|bytes| is_whole(bytes, checksum)) || is_whole(&self.plain, checksum)
    }
}

impl HubTraffic {
    /// Whether a frame at this place of a packet is worth to follow the packets of its standard id: boards
    /// of other kinds have such ids too.
    pub(crate) fn may_begin(place: u32, frame: &CanFrame) -> bool {
        begins_with_values(place, frame.data())
    }

    /// The ids of its frames, where its address is this one.
    pub(crate) fn ids(&self, ids: HubIds, address: u32) -> impl Iterator<Item = u32> + use<> {
        let places = self.places;
        let heard = (0..u8::BITS).filter(move |place| places >> place & 1 != 0);
        heard.map(move |place| ids.id(place, address))
    }

    pub(crate) fn handle_frame(&mut self, t_ns: u64, place: u32, frame: &CanFrame) {
        // A damaged log may have a standard id of more bits than there are.
        self.places |= 1u8.checked_shl(place).unwrap_or(0);
        if self.kept >= MOST_FRAMES {
            return;
        }
        self.kept += 1;
        self.first_ns.get_or_insert(t_ns);
        self.last_ns = t_ns;
        if begins_packet(place) {
            self.open = Some(Vec::new());
        }
        let Some(mut packet) = self.open.take() else {
            return;
        };
        packet.push(frame.data().to_vec());
        if place & LAST != 0 {
            self.packets.push(packet);
        } else if packet.len() < MOST_OF_A_PACKET {
            self.open = Some(packet);
        }
    }

    fn ways(&self) -> impl Iterator<Item = Ways> + '_ {
        self.packets.iter().map(|frames| {
            // Whether counting starts at 0 or 1 is not public.
            let is_numbered = (0..=1).any(|start| {
                let mut rest = frames[1..].iter().enumerate();
                rest.all(|(i, frame)| frame.first().is_some_and(|n| usize::from(*n) == (i + start) & 15))
            });
            let numbered = (frames.len() > 1 && is_numbered).then(|| {
                let rest = frames[1..].iter().flat_map(|frame| &frame[1..]);
                frames[0].iter().chain(rest).copied().collect()
            });
            Ways {
                numbered,
                plain: frames.concat(),
            }
        })
    }

    /// Whether most packets are whole ones of values, read as the guess has it.
    pub(crate) fn is_hub(&self, guess: &CyskinGuess) -> bool {
        let whole = self.values(guess).count();
        whole >= 2 && 2 * whole >= self.packets.len()
    }

    /// The whole packets, read as the guess has it: first module, first sensor, values' bytes.
    fn values<'a>(&'a self, guess: &'a CyskinGuess) -> impl Iterator<Item = (u8, u8, Vec<u8>)> + 'a {
        self.ways().filter_map(move |ways| {
            let bytes = ways
                .numbered
                .filter(|bytes| is_whole(bytes, guess.checksum))
                .or_else(|| Some(ways.plain).filter(|bytes| is_whole(bytes, guess.checksum)))?;
            match &bytes[2..bytes.len() - 1] {
                [module, sensor, values @ ..] if bytes[0] == SENSOR_DATA && values.len() % 2 == 0 => {
                    Some((*module, *sensor, values.to_vec()))
                }
                _ => None,
            }
        })
    }
}

/// Whether the bytes are a packet with this checksum.
fn is_whole(bytes: &[u8], checksum: Checksum) -> bool {
    let [_, size, .., last] = *bytes else {
        return false;
    };
    bytes.len() == 3 + usize::from(size)
        && checksum
            .of(&bytes[..bytes.len() - 1])
            .is_none_or(|sum| sum == last)
}

/// What the packets of all hubs with such ids tell of their parameters, with what remains doubtful;
/// `None` if they are no packets of values.
pub(crate) fn guess(ids: HubIds, hubs: &[&HubTraffic]) -> Option<(CyskinGuess, Vec<String>)> {
    let anything = CyskinGuess {
        ids,
        byte_order: ByteOrder::Big,
        checksum: Checksum::Unchecked,
        sequence_bytes_above: u8::MAX,
        sensors_per_module: SENSORS,
    };
    // What has standard ids may be boards of another kind.
    let is_hub = |hub: &&&HubTraffic| ids == HubIds::Extended || hub.is_hub(&anything);
    let hubs: Vec<&HubTraffic> = hubs.iter().filter(is_hub).copied().collect();
    let ways: Vec<Ways> = hubs.iter().flat_map(|hub| hub.ways()).collect();
    let packets: Vec<&Ways> = ways
        .iter()
        .filter(|ways| ways.is_whole(Checksum::Unchecked) && ways.plain[0] == SENSOR_DATA)
        .collect();
    if packets.len() < 2 || packets.len() * 2 < ways.len() {
        return None;
    }
    let mut doubts = match ids {
        HubIds::Standard => Vec::new(),
        HubIds::Extended => vec![
            "how CySkin hubs with extended ids are started and stopped is not public: the hub has to send by itself"
                .to_string(),
        ],
    };
    let (checksum, doubt) = checksum(&packets);
    doubts.extend(doubt);
    let (sequence_bytes_above, doubt) = sequence_bytes_above(&packets, checksum);
    doubts.extend(doubt);
    let mut guess = CyskinGuess {
        checksum,
        sequence_bytes_above,
        ..anything
    };
    match sensors_per_module(&hubs, &guess) {
        Some(sensors) => guess.sensors_per_module = sensors,
        None => doubts.push(format!(
            "the packets do not tell how many values a module has; sensors_per_module = {SENSORS} is a guess"
        )),
    }
    match byte_order(&hubs, &guess) {
        Some(order) => guess.byte_order = order,
        None => doubts.push("the values do not tell their byte order; \"big\" is a guess".into()),
    }
    Some((guess, doubts))
}

/// The checksum that nearly all packets have, and what is doubtful about it.
fn checksum(packets: &[&Ways]) -> (Checksum, Option<String>) {
    let right = |checksum: Checksum| packets.iter().filter(|p| p.is_whole(checksum)).count();
    let good: Vec<Checksum> = CHECKSUMS
        .into_iter()
        .filter(|c| right(*c) as f64 >= RIGHT * packets.len() as f64)
        .collect();
    match good[..] {
        [] => (
            Checksum::Unchecked,
            Some("no known checksum fits the packets, so they are not checked".into()),
        ),
        [one] => (one, None),
        [first, ..] => (
            first,
            Some(format!(
                "the checksums {good:?} all fit the packets; the first is a guess"
            )),
        ),
    }
}

/// The most values of a packet whose frames are not numbered, and what is doubtful about it.
fn sequence_bytes_above(packets: &[&Ways], checksum: Checksum) -> (u8, Option<String>) {
    let (mut numbered, mut plain) = (BTreeSet::new(), BTreeSet::new());
    for packet in packets {
        let as_numbered = packet
            .numbered
            .as_ref()
            .is_some_and(|bytes| is_whole(bytes, checksum));
        let as_plain = is_whole(&packet.plain, checksum);
        match (as_numbered, as_plain) {
            (true, false) => _ = numbered.insert(packet.plain[1]),
            // A packet of one frame says nothing of continuation frames.
            (false, true) if packet.plain.len() > 8 => _ = plain.insert(packet.plain[1]),
            _ => {}
        }
    }
    match (numbered.first(), plain.last()) {
        (None, None) => (
            u8::MAX,
            Some("no packet of several frames was heard: sequence_bytes_above is a guess".into()),
        ),
        (None, Some(_)) => (u8::MAX, None),
        (Some(_), None) => (0, None),
        (Some(fewest), Some(most)) => {
            let doubt =
                "packets of one length are numbered and not numbered: sequence_bytes_above is a guess";
            (*most, (fewest <= most).then(|| doubt.into()))
        }
    }
}

/// The number of values per module with which the packets of a sweep follow one another without gap
/// or overlap. None where it is not [`SENSORS`] and each packet may as well be a whole module of so many, between which others
/// are not there.
fn sensors_per_module(hubs: &[&HubTraffic], guess: &CyskinGuess) -> Option<u8> {
    let mut votes = [0usize; SENSORS as usize + 1];
    let mut pairs = 0;
    let mut largest = 0;
    let mut are_whole_modules = true;
    for hub in hubs {
        let packets: Vec<_> = hub.values(guess).collect();
        are_whole_modules &= packets
            .iter()
            .all(|(_, sensor, values)| *sensor == 0 && values.len() == 2 * usize::from(SENSORS));
        largest = packets
            .iter()
            .map(|(_, sensor, _)| *sensor)
            .max()
            .unwrap_or(0)
            .max(largest);
        for pair in packets.windows(2) {
            let [(module, sensor, values), (next_module, next_sensor, _)] = pair else {
                continue;
            };
            // Packets that stay within a module fit every number.
            if next_module <= module {
                continue;
            }
            pairs += 1;
            for (sensors, votes) in votes.iter_mut().enumerate().skip(1) {
                let begin = |module: u8, sensor: u8| usize::from(module) * sensors + usize::from(sensor);
                let follows = begin(*module, *sensor) + values.len() / 2 == begin(*next_module, *next_sensor);
                *votes += usize::from(follows);
            }
        }
    }
    let best = (1..votes.len()).max_by_key(|sensors| votes[*sensors])?;
    let alone = votes.iter().filter(|n| **n == votes[best]).count() == 1;
    let fits = pairs > 1 && alone && votes[best] * 2 > pairs && best > usize::from(largest);
    let other = are_whole_modules && best != usize::from(SENSORS);
    (fits && !other).then_some(best as u8)
}

/// The order under which values change least from one sweep to the next.
fn byte_order(hubs: &[&HubTraffic], guess: &CyskinGuess) -> Option<ByteOrder> {
    let mut steps = [0u64; 2];
    let mut last: BTreeMap<(usize, u8, u8), [u8; 2]> = BTreeMap::new();
    for (index, hub) in hubs.iter().enumerate() {
        for (module, sensor, values) in hub.values(guess) {
            for (place, bytes) in places(module, sensor, guess).zip(values.chunks_exact(2)) {
                let bytes = [bytes[0], bytes[1]];
                if let Some(before) = last.insert((index, place.0, place.1), bytes) {
                    let change = |of: fn([u8; 2]) -> u16| u64::from(of(bytes).abs_diff(of(before)));
                    steps[0] += change(u16::from_be_bytes);
                    steps[1] += change(u16::from_le_bytes);
                }
            }
        }
    }
    let [big, little] = steps;
    if big * 2 <= little && little > 0 {
        Some(ByteOrder::Big)
    } else if little * 2 <= big && big > 0 {
        Some(ByteOrder::Little)
    } else {
        None
    }
}

/// Module and sensor of each value of a packet.
fn places(module: u8, sensor: u8, guess: &CyskinGuess) -> impl Iterator<Item = (u8, u8)> {
    let per_module = usize::from(guess.sensors_per_module);
    let first = usize::from(module) * per_module + usize::from(sensor);
    (first..).map(move |n| ((n / per_module) as u8, (n % per_module) as u8))
}

/// Adds the modules of the hubs of a bus; says whether there are any.
pub(crate) fn add_hubs(
    bus: &mut RecognisedBus,
    hubs: &BTreeMap<u32, HubTraffic>,
    guess: &CyskinGuess,
) -> bool {
    let before = bus.boards.len();
    for (address, hub) in hubs {
        if !(1..=guess.ids.largest_address()).contains(address) {
            continue;
        }
        // How often each sensor spoke, and whether it ever had a value (0 and 65535 are none).
        let mut modules: BTreeMap<u8, BTreeMap<u8, (u64, bool)>> = BTreeMap::new();
        for (module, sensor, values) in hub.values(guess) {
            for (place, bytes) in places(module, sensor, guess).zip(values.chunks_exact(2)) {
                let heard = modules.entry(place.0).or_default().entry(place.1).or_default();
                heard.0 += 1;
                heard.1 |= bytes != [0, 0] && bytes != [0xFF, 0xFF];
            }
        }
        let seconds = hub
            .first_ns
            .map_or(0.0, |first| (hub.last_ns - first) as f64 / 1e9);
        for (module, sensors) in modules.into_iter().filter(|(module, _)| *module < MODULES) {
            let sweeps = sensors.values().map(|(n, _)| *n).max().unwrap_or(0);
            let taxels: Vec<u8> = sensors
                .iter()
                .filter(|(sensor, (_, valued))| (1..SENSORS).contains(*sensor) && *valued)
                .map(|(sensor, _)| *sensor)
                .collect();
            if taxels.is_empty() {
                continue;
            }
            bus.boards.push(RecognisedBoard {
                protocol: Protocol(&Cyskin),
                or_protocol: None,
                board: module,
                hub: Some(*address),
                taxels,
                rate_hz: (sweeps > 1 && seconds > 0.0).then(|| (sweeps - 1) as f64 / seconds),
            });
        }
    }
    bus.boards.len() > before
}
