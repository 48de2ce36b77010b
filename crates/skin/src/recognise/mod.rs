//! From the traffic of unknown buses to a layout: which protocols are spoken, by which boards, with
//! how many taxels.
//!
//! An identifier alone says little, since the id layouts overlap: eight L2 boards are, by their
//! ids, also eight L3 controllers. So whole boards are looked for, and the content decides between
//! layouts that explain the ids equally well: byte 7 is `sda + 1` in the Waseda firmware, the first
//! bytes of an iCub triangle's frames are 0x40 and 0xC0, a CySkin packet has a checksum. What
//! remains a guess is named in [`RecognisedBus::doubts`] and in the proposed file.

mod allegro;
mod array;
mod conflicts;
mod fit;
mod found;
mod of_layout;
mod propose;

pub use fit::Fit;
pub use found::Recognition;

use crate::protocol::RECOGNISERS;
use crate::protocol::cyskin::recognise::{CyskinGuess, HubTraffic, add_hubs, guess};
use crate::protocol::cyskin::setup::HubIds;
use crate::protocol::mtb::{BoardKind, answering};
use crate::protocol::recognised::{HeardIds, RecognisedBus};
use std::collections::BTreeMap;
use taxel_can::{CanFrame, EXTENDED_FLAG, Received};

/// Most hubs of either kind of ids that are told apart on a bus.
const MOST_HUBS: usize = 64;

/// Listens to buses of which nothing is known. Give it every frame, without kernel filters; some
/// sweeps of each board are enough. Its memory is bounded whatever the buses carry.
///
/// ```
/// use taxel_can::Received;
/// use taxel_skin::{Layout, Protocol, Recogniser};
///
/// let mut recogniser = Recogniser::new(1);
/// for sweep in 0..5u64 {
///     for k in 0..16 {
///         let frame = Protocol::USKIN_L1.frame(1, k, [0x8000; 3], 0x83).expect("there is such a taxel");
///         let t_ns = sweep * 10_000_000 + u64::from(k) * 200_000;
///         recogniser.handle_frame(0, &Received { t_ns, frame });
///     }
/// }
/// let found = recogniser.finish();
/// assert_eq!(found.buses[0].boards[0].protocol, Protocol::USKIN_L1);
/// let text = found.layout_file("mine", &["can0"]).expect("something was recognised");
/// assert_eq!(Layout::parse(&text, "mine.toml")?.len(), 16);
/// # Ok::<(), taxel_skin::LayoutError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Recogniser {
    buses: Vec<Traffic>,
}

/// What was heard on one bus.
#[derive(Debug, Default, Clone)]
struct Traffic {
    frames: u64,
    first_ns: Option<u64>,
    last_ns: u64,
    heard: HeardIds,
    array: array::Heads,
    /// Hubs with extended ids.
    hubs: BTreeMap<u32, HubTraffic>,
    /// What may be hubs with standard ids.
    standard_hubs: BTreeMap<u32, HubTraffic>,
    /// Extended ids beyond those that are told apart.
    more_extended: bool,
}

impl Recogniser {
    /// For this many buses.
    pub fn new(buses: usize) -> Self {
        Self {
            buses: vec![Traffic::default(); buses],
        }
    }

    /// Takes a frame that was received on a bus.
    pub fn handle_frame(&mut self, bus: u8, received: &Received) {
        let frame = &received.frame;
        if let Some(traffic) = self.buses.get_mut(usize::from(bus))
            && !frame.is_error()
            && !frame.is_remote()
        {
            traffic.handle_frame(received.t_ns, frame);
        }
    }

    /// Takes what a board is, as a discovery told.
    pub fn handle_board_kind(&mut self, bus: u8, address: u8, kind: BoardKind) {
        if let Some(traffic) = self.buses.get_mut(usize::from(bus)) {
            traffic.heard.kinds.insert(address, kind);
        }
    }

    /// What was recognised so far.
    pub fn finish(&self) -> Recognition {
        let [standard, extended] = [HubIds::Standard, HubIds::Extended].map(|ids| {
            let hubs: Vec<&HubTraffic> = self.buses.iter().flat_map(|bus| bus.hubs(ids).values()).collect();
            guess(ids, &hubs)
        });
        let of_standard = standard.as_ref().map(|(guess, _)| guess);
        let hubs: Vec<BTreeMap<u32, HubTraffic>> = self
            .buses
            .iter()
            .map(|bus| bus.claimed_hubs(of_standard))
            .collect();
        let mut buses: Vec<RecognisedBus> = (self.buses.iter().zip(&hubs))
            .map(|(bus, hubs)| bus.recognise(hubs.keys().copied()))
            .collect();
        let mut cyskin = None;
        if let Some((guess, doubts)) = &standard {
            for (bus, hubs) in buses.iter_mut().zip(&hubs) {
                if add_hubs(bus, hubs, guess) {
                    bus.doubts.extend(doubts.iter().cloned());
                    cyskin = Some(*guess);
                }
            }
        }
        if let Some((guess, doubts)) = &extended
            && cyskin.is_none()
        {
            for (bus, traffic) in buses.iter_mut().zip(&self.buses) {
                if add_hubs(bus, &traffic.hubs, guess) {
                    bus.doubts.extend(doubts.iter().cloned());
                    cyskin = Some(*guess);
                }
            }
        }
        for (bus, traffic) in buses.iter_mut().zip(&self.buses) {
            let claimed = |hub: &u32| {
                cyskin.is_some_and(|guess| guess.ids == HubIds::Extended)
                    && bus.boards.iter().any(|b| b.hub == Some(*hub))
            };
            let strangers = traffic.hubs.iter().filter(|(address, _)| !claimed(address));
            let ids = strangers.flat_map(|(address, hub)| hub.ids(HubIds::Extended, *address));
            let mut ids: Vec<u32> = ids.map(|id| id | EXTENDED_FLAG).collect();
            ids.sort_unstable();
            bus.others.extend(ids);
            if traffic.more_extended {
                bus.doubts.push(format!(
                    "more than {MOST_HUBS} extended addresses were heard; the rest was not looked at"
                ));
            }
        }
        for bus in &mut buses {
            conflicts::settle(bus, cyskin.as_ref());
        }
        Recognition { buses, cyskin }
    }
}

impl Traffic {
    fn handle_frame(&mut self, t_ns: u64, frame: &CanFrame) {
        self.frames += 1;
        self.first_ns.get_or_insert(t_ns);
        self.last_ns = self.last_ns.max(t_ns);
        let Some(id) = frame.standard_id() else {
            if let Some((place, address)) = HubIds::Extended.split(frame) {
                let full = self.hubs.len() >= MOST_HUBS && !self.hubs.contains_key(&address);
                self.more_extended |= full;
                if !full {
                    let hub = self.hubs.entry(address).or_default();
                    hub.handle_frame(t_ns, place, frame);
                }
            }
            return;
        };
        if let Some((place, address)) = HubIds::Standard.split(frame) {
            let hubs = &mut self.standard_hubs;
            let known = hubs.contains_key(&address);
            if known || (hubs.len() < MOST_HUBS && HubTraffic::may_begin(place, frame)) {
                hubs.entry(address).or_default().handle_frame(t_ns, place, frame);
            }
        }
        let data = frame.data();
        if let (0x700, [0xFF, kind, ..]) = (id & 0x700, data)
            && matches!(data.len(), 4 | 5)
        {
            let address = (id >> 4 & 15) as u8;
            self.heard.kinds.insert(address, BoardKind::of(*kind));
        }
        if id == 0 {
            self.array.add(data);
        }
        let of_id = self.heard.ids.entry(id).or_default();
        of_id.add(t_ns, data);
        of_id.answers += u64::from(answering(frame).is_some());
    }

    fn hubs(&self, ids: HubIds) -> &BTreeMap<u32, HubTraffic> {
        match ids {
            HubIds::Standard => &self.standard_hubs,
            HubIds::Extended => &self.hubs,
        }
    }

    /// The hubs with standard ids, as far as they are hubs under this guess.
    fn claimed_hubs(&self, guess: Option<&CyskinGuess>) -> BTreeMap<u32, HubTraffic> {
        let addresses = 1..=HubIds::Standard.largest_address();
        let hubs = self.standard_hubs.iter();
        let claimed = hubs.filter(|(address, hub)| {
            addresses.contains(address) && guess.is_some_and(|guess| hub.is_hub(guess))
        });
        claimed.map(|(address, hub)| (*address, hub.clone())).collect()
    }

    /// What is on the bus beside hubs; `hubs` are the addresses of those with standard ids.
    fn recognise(&self, hubs: impl ExactSizeIterator<Item = u32>) -> RecognisedBus {
        let mut bus = RecognisedBus {
            frames: self.frames,
            seconds: self
                .first_ns
                .map_or(0.0, |first| (self.last_ns - first) as f64 / 1e9),
            ..RecognisedBus::default()
        };
        let mut left = self.heard.clone();
        if hubs.len() > 0 {
            // Their ids, and those of what all of them are told.
            for address in hubs.chain([HubIds::Standard.everybody()]) {
                let ids = HubIds::Standard.standard_ids(address);
                ids.for_each(|id| _ = left.ids.remove(&id));
            }
        }
        self.array.take(&mut left, &mut bus);
        for take_boards in RECOGNISERS {
            take_boards(&mut left, &mut bus);
        }
        allegro::take(&mut left, &mut bus);
        let mut left = left.ids;
        // Commands to MTBs, their answers, and what they say in discovery are no data of anybody.
        left.retain(|id, heard| {
            let management = id & 0x7F0 == 0x200 || id & 0x70F == 0x200 || id & 0x700 == 0x700;
            !(management && (heard.full < heard.count || heard.answers == heard.full))
        });
        bus.others.extend(left.keys().map(|id| u32::from(*id)));
        bus
    }
}
