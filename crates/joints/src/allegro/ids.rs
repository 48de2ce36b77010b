//! The CAN ids of an Allegro hand, and which of them the boards of a skin use as well.

use super::config::AllegroConfig;
use taxel_can::IdFilter;
use taxel_skin::Layout;

/// QUERY_CONTROL_DATA of versions 1 to 3: a finger's position report.
pub(super) const V3_POSITION: u16 = 0x0F;
/// FINGER_POSE_1 of versions 4 and 5.
pub(super) const V4_POSITION: u16 = 0x20;
/// An error of a motor of version 5.
pub(super) const V5_ERROR: u16 = 0xEE;

impl AllegroConfig {
    /// What a CAN source has to let through for [`crate::AllegroDecoder`].
    pub fn filters(&self) -> Vec<IdFilter> {
        let of_device = |message: u16, mask| IdFilter::standard(message << 2 | u16::from(self.device), mask);
        // Four fingers, bits 2 and 3, of one device, bits 0 and 1.
        let positions = of_device(V4_POSITION, 0x7F3);
        match self.version {
            5 => vec![positions, of_device(V5_ERROR, 0x7FF)],
            4 => vec![positions],
            _ => vec![IdFilter::standard(V3_POSITION << 6, 0x7C0)],
        }
    }
}

/// Whether a standard id belongs to this hand: what it sends, and what its controller sends to it.
fn is_hand_id(config: &AllegroConfig, id: u16) -> bool {
    if config.has_ids_of_4() {
        let known = matches!(id >> 2,
            0x20..=0x23 | 0x30 | 0x38..=0x3B | 0x40 | 0x41 | 0x60..=0x63 | 0x68 | 0x80 | 0x81 | 0x88 | 0xE0..=0xE3);
        // Grasps, calibration, errors and the fingertips' pressure.
        let of_5 = matches!(
            id >> 2,
            0x11 | 0x12 | 0x50 | 0x52 | 0x89 | 0x92 | V5_ERROR | 0xF0 | 0xF2
        );
        (known || (of_5 && config.version == 5)) && id & 3 == u16::from(config.device)
    } else {
        let (cmd, dst, src) = (id >> 6, id >> 3 & 7, id & 7);
        let from_host = src == 2 && dst == 1 && (0x01..=0x11).contains(&cmd);
        let from_hand = (3..=6).contains(&src) && (0x0E..=0x15).contains(&cmd);
        from_host || from_hand
    }
}

/// The standard ids that both this hand and the skin's boards on bus `bus` (index into
/// [`Layout::buses`]) use, in order; empty if they may share the bus.
///
/// A board uses the ids of its taxels' frames and, if it is an MTB, the one by which it is started,
/// `0x200 | board`; a CySkin hub with standard ids uses those of its packets and of what all hubs are
/// told. Hand and skin are best on different buses.
pub fn overlapping_ids(layout: &Layout, bus: u8, config: &AllegroConfig) -> Vec<u16> {
    let mut ids: Vec<u16> = (0..layout.len())
        .filter(|taxel| layout.wiring_of(*taxel).bus == bus)
        .flat_map(|taxel| {
            let wiring = layout.wiring_of(taxel);
            let frame = wiring.protocol.frame_id(wiring.board, layout.k[taxel]);
            [frame, wiring.protocol.command_id(wiring.board)]
        })
        .flatten()
        .chain(hub_ids(layout, bus))
        .filter(|id| is_hand_id(config, *id))
        .collect();
    ids.sort_unstable();
    ids.dedup();
    ids
}

/// The standard ids of the CySkin hubs of a bus.
fn hub_ids(layout: &Layout, bus: u8) -> impl Iterator<Item = u16> {
    layout.cyskin.iter().flat_map(move |setup| {
        let here = setup.hubs.iter().filter(move |hub| hub.bus == bus);
        here.flat_map(|hub| [hub.address, setup.ids.everybody()])
            .flat_map(|address| setup.ids.standard_ids(address))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cyskin_hub_with_standard_ids_and_a_hand_that_share_ids_are_told() {
        let hub = |address: u32| {
            let text = format!(
                "name = \"h\"\nbuses = [\"can0\"]\nimage = {{ width = 1, height = 1 }}\n[[cyskin.hub]]\nname = \"h\"\n\
                 bus = \"can0\"\naddress = {address}\n[[module]]\nname = \"m\"\npart = \"p\"\nbus = \"can0\"\n\
                 hub = \"h\"\nboard = 0\nprotocol = \"cyskin\"\nat = [0, 0]\norder = [[1]]\n"
            );
            Layout::parse(&text, "h.toml").unwrap()
        };
        let ids = |version, address| overlapping_ids(&hub(address), 0, &AllegroConfig::new(version));
        // 0x204 sets the period of a hand of version 4, 0x104 switches it off.
        assert_eq!(ids(4, 0x04), [0x104, 0x204]);
        assert!(ids(4, 0x05).is_empty());
        assert_eq!(ids(3, 0x4A), [0x14A, 0x24A, 0x44A]);
    }

    #[test]
    fn a_hand_and_a_skin_that_share_ids_are_told() {
        let layout = Layout::builtin("allegro-uskin-15").unwrap();
        for version in [3, 4] {
            let config = AllegroConfig::new(version);
            let ids = overlapping_ids(&layout, 0, &config);
            assert!(!ids.is_empty());
            assert!(ids.windows(2).all(|w| w[0] < w[1]));
            assert!(ids.iter().all(|id| is_hand_id(&config, *id)));
            // A bus the layout does not have carries nothing.
            assert!(overlapping_ids(&layout, 200, &config).is_empty());
        }
        // Version 4's set-period is the start command of board 4.
        assert!(overlapping_ids(&layout, 0, &AllegroConfig::new(4)).contains(&0x204));
    }
}
