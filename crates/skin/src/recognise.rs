//! From the traffic of unknown buses to a layout: which protocols are spoken, by which boards, with how many taxels.
//!
//! An identifier alone says little, since the id layouts overlap: eight L2 boards are, by their ids, also eight L3
//! controllers. So whole boards are looked for, and the content decides between layouts that explain the ids equally
//! well: byte 7 is `sda + 1` in the Waseda firmware, the first bytes of an iCub triangle's frames are 0x40 and 0xC0, a
//! CySkin packet has a checksum. What remains a guess is named in [`RecognisedBus::doubts`] and in the proposed file.

mod cyskin;
mod propose;
mod uskin;

use crate::protocol::icub::PADS;
use crate::{BoardKind, ByteOrder, Checksum, Protocol};
use cyskin::HubTraffic;
use std::collections::BTreeMap;
use taxel_can::{CanFrame, EXTENDED_FLAG};

/// Most hubs with extended ids that are told apart on a bus.
const MOST_HUBS: usize = 64;
/// An id that was heard less often is not part of a sweep.
const FEWEST: u64 = 2;
/// The ids of the published CySkin-type finger.
const CPM_IDS: [u16; 4] = [0x405, 0x407, 0x409, 0x40B];
const CPM_PROXIMITY: u16 = 0x601;

/// A board that was recognised.
#[derive(Debug, Clone, PartialEq)]
pub struct RecognisedBoard {
    /// How it speaks.
    pub protocol: Protocol,
    /// Its address; of a CySkin module its number on its hub.
    pub board: u8,
    /// The address of its hub, for CySkin.
    pub hub: Option<u32>,
    /// The taxel numbers `k` that it sends, ascending; thermal pads and temperatures are left out.
    pub taxels: Vec<u8>,
    /// Sweeps per second, where the recording is long enough to tell.
    pub rate_hz: Option<f64>,
}

/// What was recognised on one bus.
#[derive(Debug, Default, Clone, PartialEq)]
pub struct RecognisedBus {
    /// Data frames heard.
    pub frames: u64,
    /// Time from the first to the last, seconds.
    pub seconds: f64,
    /// The boards, by protocol and address.
    pub boards: Vec<RecognisedBoard>,
    /// The version of an Allegro hand that reports its joints here: 3 (for 1 to 3) or 4.
    pub allegro: Option<u8>,
    /// Ids that belong to nothing recognised, extended ones with [`EXTENDED_FLAG`].
    pub others: Vec<u32>,
    /// What is ambiguous or guessed, in words.
    pub doubts: Vec<String>,
}

/// What CySkin's unpublished parameters are, as far as packets tell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CyskinGuess {
    /// Order of the bytes of a value.
    pub byte_order: ByteOrder,
    /// The checksum that is right for nearly every packet; `Unchecked` if none is.
    pub checksum: Checksum,
    /// See [`crate::CyskinSetup::sequence_bytes_above`].
    pub sequence_bytes_above: u8,
    /// See [`crate::CyskinSetup::sensors_per_module`].
    pub sensors_per_module: u8,
}

/// What was recognised on all buses.
#[derive(Debug, Default, Clone, PartialEq)]
pub struct Recognition {
    /// By bus.
    pub buses: Vec<RecognisedBus>,
    /// How the CySkin hubs speak, where there are any.
    pub cyskin: Option<CyskinGuess>,
}

/// Listens to buses of which nothing is known. Give it every frame, without kernel filters; some sweeps of each board are
/// enough. Its memory is bounded whatever the buses carry.
///
/// ```
/// use taxel_skin::{Layout, Protocol, Recogniser};
///
/// let mut recogniser = Recogniser::new(1);
/// for sweep in 0..5u64 {
///     for k in 0..16 {
///         let frame = Protocol::UskinL1.frame(1, k, [0x8000; 3], 0x83).expect("there is such a taxel");
///         recogniser.hear(0, sweep * 10_000_000 + u64::from(k) * 200_000, &frame);
///     }
/// }
/// let found = recogniser.finish();
/// assert_eq!(found.buses[0].boards[0].protocol, Protocol::UskinL1);
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
    /// At most the 2048 standard ids.
    ids: BTreeMap<u16, IdTraffic>,
    hubs: BTreeMap<u32, HubTraffic>,
    /// Extended ids beyond those that are told apart.
    more_extended: bool,
    /// What boards said they are, by address.
    kinds: BTreeMap<u8, BoardKind>,
}

/// What was heard under one standard id.
#[derive(Debug, Default, Clone, Copy)]
struct IdTraffic {
    count: u64,
    /// Frames of eight bytes.
    full: u64,
    first_ns: u64,
    last_ns: u64,
    /// Byte 7 of the full frames, as long as it is the same.
    last_byte: Option<u8>,
    varies: bool,
    /// Frames that begin as the first and the second of an iCub triangle.
    triangle: [u64; 2],
}

impl Recogniser {
    /// For so many buses.
    pub fn new(buses: usize) -> Self {
        Self {
            buses: vec![Traffic::default(); buses],
        }
    }

    /// Takes a frame that was received on a bus at `t_ns`.
    pub fn hear(&mut self, bus: u8, t_ns: u64, frame: &CanFrame) {
        if let Some(traffic) = self.buses.get_mut(usize::from(bus))
            && !frame.is_error()
            && !frame.is_remote()
        {
            traffic.hear(t_ns, frame);
        }
    }

    /// Says what a board is, as a discovery told.
    pub fn is_known(&mut self, bus: u8, address: u8, kind: BoardKind) {
        if let Some(traffic) = self.buses.get_mut(usize::from(bus)) {
            traffic.kinds.insert(address, kind);
        }
    }

    /// What was recognised so far.
    pub fn finish(&self) -> Recognition {
        let mut buses: Vec<RecognisedBus> = self.buses.iter().map(Traffic::recognise).collect();
        let hubs: Vec<&HubTraffic> = self.buses.iter().flat_map(|bus| bus.hubs.values()).collect();
        let mut cyskin = None;
        if let Some((guess, doubts)) = cyskin::guess(&hubs) {
            for (bus, traffic) in buses.iter_mut().zip(&self.buses) {
                if bus.add_hubs(&traffic.hubs, &guess) {
                    bus.doubts.extend(doubts.iter().cloned());
                    cyskin = Some(guess);
                }
            }
        }
        for (bus, traffic) in buses.iter_mut().zip(&self.buses) {
            let claimed = |hub: &u32| bus.boards.iter().any(|b| b.hub == Some(*hub));
            let strangers: Vec<u32> = traffic.hubs.keys().filter(|hub| !claimed(hub)).copied().collect();
            bus.others.extend(strangers.iter().map(|hub| hub | EXTENDED_FLAG));
            if traffic.more_extended {
                bus.doubts.push(format!(
                    "more than {MOST_HUBS} extended addresses were heard; the rest was not looked at"
                ));
            }
        }
        Recognition { buses, cyskin }
    }
}

impl Traffic {
    fn hear(&mut self, t_ns: u64, frame: &CanFrame) {
        self.frames += 1;
        self.first_ns.get_or_insert(t_ns);
        self.last_ns = self.last_ns.max(t_ns);
        let Some(id) = frame.standard_id() else {
            let address = cyskin::address(frame.id());
            let full = self.hubs.len() >= MOST_HUBS && !self.hubs.contains_key(&address);
            self.more_extended |= full;
            if !full {
                self.hubs.entry(address).or_default().hear(t_ns, frame);
            }
            return;
        };
        let data = frame.data();
        if let (0x700, [0xFF, kind, ..]) = (id & 0x700, data)
            && matches!(data.len(), 4 | 5)
        {
            self.kinds.insert((id >> 4 & 15) as u8, BoardKind::of(*kind));
        }
        let heard = self.ids.entry(id).or_default();
        if heard.count == 0 {
            heard.first_ns = t_ns;
        }
        heard.count += 1;
        heard.last_ns = t_ns;
        match data {
            [0x40, ..] if data.len() == 8 => heard.triangle[0] += 1,
            [0xC0, ..] if matches!(data.len(), 6 | 8) => heard.triangle[1] += 1,
            _ => {}
        }
        if let [.., last] = data
            && data.len() == 8
        {
            heard.full += 1;
            heard.varies |= heard.last_byte.is_some_and(|before| before != *last);
            heard.last_byte = Some(*last);
        }
    }

    fn recognise(&self) -> RecognisedBus {
        let mut bus = RecognisedBus {
            frames: self.frames,
            seconds: self
                .first_ns
                .map_or(0.0, |first| (self.last_ns - first) as f64 / 1e9),
            ..RecognisedBus::default()
        };
        let mut left = self.ids.clone();
        self.take_triangles(&mut left, &mut bus);
        uskin::take_boards(&mut left, &mut bus);
        take_finger(&mut left, &mut bus);
        take_allegro(&mut left, &mut bus);
        // Commands to MTBs, their answers, and what they say in discovery are no data of anybody.
        left.retain(|id, heard| {
            let management = id & 0x7F0 == 0x200 || id & 0x70F == 0x200 || id & 0x700 == 0x700;
            !(management && heard.full < heard.count)
        });
        bus.others.extend(left.keys().map(|id| u32::from(*id)));
        bus
    }

    /// iCub boards: ids of class 4 (or 3, from obsolete commands) whose frames are the two halves of a triangle.
    fn take_triangles(&self, left: &mut BTreeMap<u16, IdTraffic>, bus: &mut RecognisedBus) {
        let mut boards: BTreeMap<u8, Vec<(u8, IdTraffic)>> = BTreeMap::new();
        let mut obsolete = false;
        left.retain(|id, heard| {
            let [first, second] = heard.triangle;
            let both = first > 0 && second > 0 && (first + second) * 20 >= heard.count * 19;
            let board = (id >> 4 & 15) as u8;
            let is_triangle = matches!(id >> 8, 3 | 4) && (1..15).contains(&board) && both;
            if is_triangle {
                boards.entry(board).or_default().push(((id & 15) as u8, *heard));
                obsolete |= id >> 8 == 3;
            }
            !is_triangle
        });
        if boards.is_empty() {
            return;
        }
        for (board, triangles) in boards {
            let protocol = match self.kinds.get(&board) {
                Some(kind) if kind.speaks(Protocol::IcubMtb4) => Protocol::IcubMtb4,
                Some(_) => Protocol::IcubMtb3,
                None => {
                    bus.doubts.push(format!(
                        "board {board}: MTB3 and MTB4 send the same frames; icub-mtb3 is a guess (discovery tells which)"
                    ));
                    Protocol::IcubMtb3
                }
            };
            let mut taxels: Vec<u8> = triangles
                .iter()
                .flat_map(|(triangle, _)| (0..PADS).map(move |pad| triangle * PADS + pad))
                .filter(|k| !matches!(k % PADS, 6 | 10))
                .collect();
            taxels.sort_unstable();
            bus.boards.push(RecognisedBoard {
                protocol,
                board,
                hub: None,
                taxels,
                rate_hz: triangles.first().and_then(|(_, heard)| heard.rate_hz(2.0)),
            });
        }
        bus.doubts.push(
            "pads 6 and 10 of each triangle are taken as thermal ones; of palms and fingertips it is pad 11 (skin_type 1)".into(),
        );
        bus.doubts.push(
            "how the boards were configured is not in their frames; taxeld configures them with the defaults of `icub` \
             (period_ms = 50, noload = 245, skin_type = 0, shift = 2, cdc_offset = 0x2200) when it starts them"
                .into(),
        );
        if obsolete {
            bus.doubts.push(
                "frames of class 3 were heard: a board was configured with the obsolete commands".into(),
            );
        }
    }
}

impl IdTraffic {
    /// Frames per second divided by those of one sweep.
    fn rate_hz(&self, per_sweep: f64) -> Option<f64> {
        let seconds = (self.last_ns.saturating_sub(self.first_ns)) as f64 / 1e9;
        let periods = (self.count as f64 - per_sweep) / per_sweep;
        (seconds > 0.0 && periods >= 1.0).then(|| periods / seconds)
    }
}

/// The published finger: all four of its ids with full frames.
fn take_finger(left: &mut BTreeMap<u16, IdTraffic>, bus: &mut RecognisedBus) {
    let whole = |id: &u16| left.get(id).is_some_and(|heard| heard.full >= FEWEST);
    if !CPM_IDS.iter().all(whole) {
        return;
    }
    let rate_hz = left.get(&CPM_IDS[0]).and_then(|heard| heard.rate_hz(1.0));
    for id in CPM_IDS.iter().chain([&CPM_PROXIMITY]) {
        left.remove(id);
    }
    bus.boards.push(RecognisedBoard {
        protocol: Protocol::CpmFinger,
        board: 0,
        hub: None,
        taxels: (0..16).collect(),
        rate_hz,
    });
}

/// The position frames of all four fingers (protocols.md 3).
fn take_allegro(left: &mut BTreeMap<u16, IdTraffic>, bus: &mut RecognisedBus) {
    // The destination in bits 3 to 5 is documented nowhere.
    let v3 = |id: u16| (id >> 6 == 0x0F && matches!(id & 7, 3..=6)).then(|| usize::from(id & 7) - 3);
    let v4 = |id: u16| (id >> 4 == 0x08).then_some(usize::from(id >> 2 & 3));
    let mut take = |version: u8, finger_of: &dyn Fn(u16) -> Option<usize>| {
        let mut fingers = [false; 4];
        for (id, heard) in left.iter() {
            if let Some(finger) = finger_of(*id) {
                fingers[finger] |= heard.full >= FEWEST && heard.full == heard.count;
            }
        }
        if fingers == [true; 4] {
            left.retain(|id, _| finger_of(*id).is_none());
            bus.allegro = Some(version);
            // What the hand's controller and the hand say beside.
            if version == 4 {
                left.retain(|id, _| !matches!(id >> 2, 0x30 | 0x38..=0x3B | 0x40 | 0x41 | 0x60..=0x63 | 0x68 | 0x80 | 0x81 | 0x88 | 0xE0..=0xE3));
            } else {
                left.retain(|id, _| !(id & 7 == 2 && (0x01..=0x15).contains(&(id >> 6))));
            }
        }
    };
    take(3, &v3);
    take(4, &v4);
}
