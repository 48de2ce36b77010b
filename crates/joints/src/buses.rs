//! Joints beside a skin: which bus they are on, and what cannot go together.

use crate::config::JointsConfig;
use crate::error::JointsConfigError;
use taxel_can::{IdFilter, SourceAddress};
use taxel_skin::Layout;

/// The CAN bus that joint angles come over.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JointsBus {
    /// Its number: that of a bus of the skin, or, for a bus of its own, the one after the last of these.
    pub index: u8,
    /// Whether it is one of the skin's.
    pub shared: bool,
    /// Where it is.
    pub address: SourceAddress,
    /// What a bus of its own has to let through.
    pub filters: Vec<IdFilter>,
}

/// Why joints cannot be read as the configuration has it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum JointsError {
    /// The table itself makes no sense.
    #[error(transparent)]
    Config(#[from] JointsConfigError),
    /// What a thread reads is read now; a recording was made at another time.
    #[error(
        "joints: the {what} on {device} would be read now, and {source_address} is a recording of another time; leave [joints] out, or take live buses"
    )]
    Recording {
        /// What is read.
        what: &'static str,
        /// The serial device.
        device: String,
        /// The recording.
        source_address: String,
    },
    /// Joints and skin would be mistaken for each other.
    #[error(
        "joints: the {what} and the skin share {address} (bus {bus}), where both use the CAN ids {}; give the hand a bus of its own, or the boards other addresses",
        hex(ids)
    )]
    SharedIds {
        /// What shares the bus with the skin.
        what: &'static str,
        /// The CAN source.
        address: String,
        /// Name of the bus in the layout.
        bus: String,
        /// The identifiers, in order.
        ids: Vec<u16>,
    },
    /// A scene has no joints that send.
    #[error(
        "joints: {address} is a scene, in which no {what} sends; take the bus of a hand, or servos (`taxel sim --servos`)"
    )]
    Scene {
        /// What would send.
        what: &'static str,
        /// The scene.
        address: String,
    },
}

fn hex(ids: &[u16]) -> String {
    let ids: Vec<String> = ids.iter().map(|id| format!("{id:03X}")).collect();
    ids.join(", ")
}

impl JointsConfig {
    /// The CAN bus of these joints beside a skin whose buses are `skin`, in the layout's order;
    /// `None` where they are on none.
    pub fn can_bus(&self, layout: &Layout, skin: &[SourceAddress]) -> Option<JointsBus> {
        let source = self.source.config();
        let address = source.can_bus()?;
        let shared = skin.iter().position(|bus| bus == address);
        Some(JointsBus {
            index: shared.unwrap_or(layout.buses.len()) as u8,
            shared: shared.is_some(),
            address: address.clone(),
            filters: source.filters(),
        })
    }

    /// Refuses joints that make no sense, by themselves or with this skin on these buses.
    pub fn check_beside(&self, layout: &Layout, skin: &[SourceAddress]) -> Result<(), JointsError> {
        self.check()?;
        let source = self.source.config();
        let what = source.device();
        let recording = |bus: &&SourceAddress| matches!(bus, SourceAddress::Log { .. });
        let potentiometers = self.analogue.as_ref().map(|analogue| analogue.device.as_path());
        let (what, device) = match source.serial_device() {
            Some(device) => (what, Some(device)),
            None => ("potentiometers", potentiometers),
        };
        if let (Some(device), Some(recording)) = (device, skin.iter().find(recording)) {
            return Err(JointsError::Recording {
                what,
                device: device.display().to_string(),
                source_address: recording.to_string(),
            });
        }
        let what = source.device();
        let Some(address) = source.can_bus() else {
            return Ok(());
        };
        if let SourceAddress::Sim { .. } = address {
            return Err(JointsError::Scene {
                what,
                address: address.to_string(),
            });
        }
        for (bus, _) in skin.iter().enumerate().filter(|(_, bus)| *bus == address) {
            let ids = source.overlapping_ids(layout, bus as u8);
            if !ids.is_empty() {
                return Err(JointsError::SharedIds {
                    what,
                    address: address.to_string(),
                    bus: layout.buses.get(bus).cloned().unwrap_or_default(),
                    ids,
                });
            }
        }
        Ok(())
    }
}
