//! Who sent how much on one bus since a window began.

use crate::protocol::cyskin::packet::{begins_packet, begins_with_values};
use crate::protocol::cyskin::setup::HubIds;
use taxel_can::CanFrame;

/// Different extended ids that are told apart within one window; further ones are only counted to the whole.
const EXTENDED_IDS: usize = 16;
/// Addresses of hubs that are not the hand's, told apart within one window; further ones are not seen.
pub(crate) const FOREIGN_HUBS: usize = 8;

/// Frames and bits of one id.
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct OfId {
    pub(crate) frames: u32,
    pub(crate) bits: u32,
    /// With as many stuff bits as there can be.
    pub(crate) most_bits: u32,
}

impl OfId {
    fn add(&mut self, [bits, most_bits]: [u32; 2]) {
        self.frames += 1;
        self.bits += bits;
        self.most_bits += most_bits;
    }
}

/// What came under the address of a CySkin hub.
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct OfHub {
    pub(crate) address: u32,
    pub(crate) frames: u32,
    /// Those that begin a packet of values, as no command to the hub does.
    pub(crate) packets: u32,
    /// Those that begin any packet.
    pub(crate) begun: u32,
}

/// Constant time and memory per frame.
#[derive(Debug, Clone)]
pub(crate) struct Tally {
    pub(crate) ids: Box<[OfId; 0x800]>,
    extended: [(u32, OfId); EXTENDED_IDS],
    /// Which ids the hand's hubs use, where it has any.
    hub_ids: Option<HubIds>,
    /// By address.
    hubs: Vec<OfHub>,
    /// Extended frames that are of none of the hand's hubs.
    pub(crate) of_no_hub: u32,
    /// In the order in which they were heard.
    foreign: [OfHub; FOREIGN_HUBS],
    pub(crate) all: OfId,
}

impl Tally {
    /// A tally that tells hubs of these addresses apart, by such ids.
    pub(crate) fn new(hub_ids: Option<HubIds>, hubs: impl Iterator<Item = u32>) -> Self {
        let mut hubs: Vec<OfHub> = hubs
            .map(|address| OfHub {
                address,
                ..OfHub::default()
            })
            .collect();
        hubs.sort_unstable_by_key(|hub| hub.address);
        hubs.dedup_by_key(|hub| hub.address);
        Self {
            hub_ids,
            hubs,
            of_no_hub: 0,
            foreign: [OfHub::default(); FOREIGN_HUBS],
            ids: Box::new([OfId::default(); 0x800]),
            extended: [(0, OfId::default()); EXTENDED_IDS],
            all: OfId::default(),
        }
    }

    /// Counts a frame; `of_board` says whether its id is a board's that is no hub. Error frames never
    /// were on the bus and do not count.
    #[inline]
    pub(crate) fn count(&mut self, frame: &CanFrame, of_board: bool) {
        if frame.is_error() {
            return;
        }
        let bits = frame.bits_within();
        self.all.add(bits);
        let is_of_hub = self
            .hub_ids
            .filter(|_| !of_board)
            .is_some_and(|ids| self.count_hub(ids, frame));
        if frame.is_extended() {
            let id = frame.id();
            self.of_no_hub += u32::from(!is_of_hub);
            let known = self
                .extended
                .iter_mut()
                .find(|(other, of)| *other == id || of.frames == 0);
            if let Some((place, of)) = known {
                *place = id;
                of.add(bits);
            }
        } else {
            self.ids[frame.id() as usize & 0x7FF].add(bits);
        }
    }

    /// Counts a frame that may be a hub's; says whether it is one's of the hand.
    #[inline]
    fn count_hub(&mut self, ids: HubIds, frame: &CanFrame) -> bool {
        let Some((place, address)) = ids.split(frame) else {
            return false;
        };
        let known = self.hubs.binary_search_by_key(&address, |hub| hub.address);
        let hub = match known {
            Ok(hub) => self.hubs.get_mut(hub),
            // No hub has address 0, nor the one of commands to all of them.
            Err(_) if !(1..=ids.largest_address()).contains(&address) => None,
            Err(_) => (self.foreign.iter_mut()).find(|hub| hub.address == address || hub.frames == 0),
        };
        if let Some(hub) = hub {
            hub.address = address;
            hub.frames += 1;
            hub.packets += u32::from(begins_with_values(place, frame.data()));
            hub.begun += u32::from(begins_packet(place));
        }
        known.is_ok()
    }

    /// The id that took most of the bus: whether it is extended, the id, what it sent.
    pub(crate) fn loudest(&self) -> Option<(bool, u32, OfId)> {
        let standard = (0u32..).zip(self.ids.iter()).map(|(id, of)| (false, id, *of));
        let extended = self.extended.iter().map(|(id, of)| (true, *id, *of));
        let spoken = standard.chain(extended).filter(|(_, _, of)| of.frames > 0);
        spoken.max_by_key(|(_, _, of)| of.bits)
    }

    /// What came of a hub; nothing of one that is not the hand's.
    pub(crate) fn hub(&self, address: u32) -> OfHub {
        let hub = self.hubs.binary_search_by_key(&address, |hub| hub.address);
        hub.map_or_else(|_| OfHub::default(), |hub| self.hubs[hub])
    }

    /// What came under addresses of hubs that the hand does not have; nothing where it has no hubs at all.
    pub(crate) fn foreign_hubs(&self) -> impl Iterator<Item = &OfHub> {
        self.foreign.iter().filter(|hub| hub.frames > 0)
    }

    pub(crate) fn clear(&mut self) {
        for hub in &mut self.hubs {
            (hub.frames, hub.packets, hub.begun) = (0, 0, 0);
        }
        self.foreign.fill(OfHub::default());
        self.ids.fill(OfId::default());
        self.extended.fill((0, OfId::default()));
        self.all = OfId::default();
        self.of_no_hub = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_count_with_their_bits_under_their_id_and_error_frames_not_at_all() {
        let mut tally = Tally::new(None, [].into_iter());
        tally.count(&CanFrame::standard(0x123, &[0; 8]).unwrap(), false);
        tally.count(&CanFrame::standard(0x123, &[]).unwrap(), false);
        tally.count(&CanFrame::extended(0x123, &[0; 8]).unwrap(), false);
        tally.count(&CanFrame::error(0x123, [0; 8]), false);
        assert_eq!((tally.ids[0x123].frames, tally.ids[0x123].bits), (2, 111 + 47));
        assert_eq!((tally.all.frames, tally.all.bits), (3, 111 + 47 + 131));
        // docs/protocols.md, "Bus timing": 135 bits at worst for eight bytes.
        assert_eq!(tally.ids[0x123].most_bits, 135 + 47 + 33 / 4);
        assert_eq!(tally.all.most_bits, 135 + 47 + 33 / 4 + 131 + 117 / 4);
        let (extended, id, of) = tally.loudest().unwrap();
        assert_eq!((extended, id, of.frames), (false, 0x123, 2));
    }

    #[test]
    fn hubs_are_told_by_their_address_and_their_values_from_commands_to_them() {
        let mut tally = Tally::new(Some(HubIds::Extended), [0x2_0001, 0x123].into_iter());
        const FIRST: u32 = 1 << 26;
        const SINGLE: u32 = FIRST | 1 << 28;
        let extended = |id, data: &[u8]| CanFrame::extended(id, data).unwrap();
        tally.count(&extended(FIRST | 0x123, &[0x43, 16, 2, 1, 0, 9, 0, 9]), false);
        tally.count(&extended(1 << 27 | 0x123, &[0x43, 16, 2, 1, 0, 9, 0, 9]), false);
        tally.count(&extended(SINGLE | 0x2_0001, &[0x44, 0, 0x44]), false);
        tally.count(&extended(SINGLE | 0x124, &[0x43, 4, 2, 1, 0, 9, 0]), false);
        tally.count(&CanFrame::standard(0x123, &[0x43]).unwrap(), false);
        let of = |address| (tally.hub(address).frames, tally.hub(address).packets);
        assert_eq!([of(0x123), of(0x2_0001), of(0x124)], [(2, 1), (1, 0), (0, 0)]);
        assert_eq!(tally.of_no_hub, 1);
        let foreign: Vec<(u32, u32)> = tally.foreign_hubs().map(|h| (h.address, h.packets)).collect();
        assert_eq!(foreign, [(0x124, 1)]);
        tally.clear();
        assert_eq!(tally.foreign_hubs().count(), 0);
        assert_eq!((tally.hub(0x123).frames, tally.of_no_hub), (0, 0));
    }

    #[test]
    fn hubs_with_standard_ids_are_told_from_boards_by_whose_id_it_is() {
        let mut tally = Tally::new(Some(HubIds::Standard), [0x23].into_iter());
        let values = CanFrame::standard(0x523, &[0x43, 4, 2, 1, 0, 9, 0]).unwrap();
        let foreign = CanFrame::standard(0x131, &[0x43, 16, 2, 1, 0, 9, 0, 9]).unwrap();
        tally.count(&values, false);
        tally.count(&foreign, true);
        assert_eq!((tally.hub(0x23).packets, tally.foreign_hubs().count()), (1, 0));
        tally.count(&foreign, false);
        tally.count(&CanFrame::extended(0x1400_0023, &[0x43, 0, 0]).unwrap(), false);
        let foreign: Vec<(u32, u32)> = tally.foreign_hubs().map(|h| (h.address, h.packets)).collect();
        assert_eq!((foreign, tally.of_no_hub), (vec![(0x31, 1)], 1));
    }

    #[test]
    fn more_extended_ids_than_there_is_room_for_still_count_to_the_whole() {
        let mut tally = Tally::new(None, [].into_iter());
        for id in 0..100 {
            tally.count(&CanFrame::extended(id, &[]).unwrap(), false);
        }
        assert_eq!(tally.all.frames, 100);
        tally.clear();
        assert!(tally.loudest().is_none());
    }
}
