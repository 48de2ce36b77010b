//! What was heard on a bus of which nothing is known, and which boards were recognised in it.

use super::board_protocol::Protocol;
use super::icub::decode::{ICUB_NOT_CONNECTED, half_of};
use super::mtb::BoardKind;
use std::collections::BTreeMap;

/// An id that was heard less often is not part of a sweep.
pub(crate) const FEWEST: u64 = 2;

/// Finds the boards of one kind in what was heard on a bus, and takes their ids out of it.
pub(crate) type Recognise = fn(&mut HeardIds, &mut RecognisedBus);

/// A board that was recognised.
#[derive(Debug, Clone, PartialEq)]
pub struct RecognisedBoard {
    /// How it speaks.
    pub protocol: Protocol,
    /// How it may as well, where nothing told the two apart.
    pub or_protocol: Option<Protocol>,
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
    /// The version of an Allegro hand that reports its joints here: 3 (for 1 to 3) or 4 (for 4 and 5, whose
    /// ids are the same).
    pub allegro: Option<u8>,
    /// Rows and columns of a pressure array, whose frames are here instead of boards'.
    pub array: Option<[u16; 2]>,
    /// Ids that belong to nothing recognised, extended ones with [`taxel_can::EXTENDED_FLAG`].
    pub others: Vec<u32>,
    /// What is ambiguous or guessed, in words.
    pub doubts: Vec<String>,
}

/// What was heard under standard ids and is not claimed yet.
#[derive(Debug, Default, Clone)]
pub(crate) struct HeardIds {
    /// At most the 2048 standard ids.
    pub(crate) ids: BTreeMap<u16, IdTraffic>,
    /// What boards said they are, by address.
    pub(crate) kinds: BTreeMap<u8, BoardKind>,
}

/// What was heard under one standard id.
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct IdTraffic {
    pub(crate) count: u64,
    /// Frames of eight bytes.
    pub(crate) full: u64,
    /// Of these, answers of MTBs that are asked for their firmware; a taxel may have their first byte.
    pub(crate) answers: u64,
    /// When a frame of a sweep came first, and last: one of eight bytes, or a half of an iCub triangle.
    first_ns: Option<u64>,
    last_ns: u64,
    /// Byte 7 of the full frames, as long as it is the same.
    pub(crate) last_byte: Option<u8>,
    pub(crate) varies: bool,
    /// Frames that begin as the first and the second of an iCub triangle.
    pub(crate) triangle: [u64; 2],
    /// Of the second ones, those that say that no chip is connected.
    pub(crate) not_connected: u64,
}

impl IdTraffic {
    /// Takes the data of a frame.
    pub(crate) fn add(&mut self, t_ns: u64, data: &[u8]) {
        self.count += 1;
        let half = half_of(data);
        if half.is_some() || data.len() == 8 {
            self.first_ns.get_or_insert(t_ns);
            self.last_ns = t_ns;
        }
        if let Some(half) = half {
            self.triangle[half] += 1;
            let status = data.get(7).filter(|_| half == 1);
            self.not_connected += u64::from(status.is_some_and(|status| status & ICUB_NOT_CONNECTED != 0));
        }
        if let [.., last] = data
            && data.len() == 8
        {
            self.full += 1;
            self.varies |= self.last_byte.is_some_and(|before| before != *last);
            self.last_byte = Some(*last);
        }
    }

    /// Sweeps per second, where there were so many. Commands to a board may have the id of another's taxel, and are none.
    pub(crate) fn rate_hz(&self, sweeps: f64) -> Option<f64> {
        let seconds = self.last_ns.saturating_sub(self.first_ns?) as f64 / 1e9;
        let periods = sweeps - 1.0;
        (seconds > 0.0 && periods >= 1.0).then(|| periods / seconds)
    }
}
