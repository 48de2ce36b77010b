//! Commands of class 2, which every MTB understands, be it the iCub's or uSkin's (docs/protocols.md,
//! "MTB ids" and "MTB commands").

use super::frames::{GET_FW_VERSION, SET_BRD_CFG, SET_TRIANG_CFG, SET_TXMODE};
use crate::protocol::icub::setup::IcubSetup;
use taxel_can::CanFrame;

/// A command to one MTB. Its frame is of class 2 by construction, whatever the address and the
/// data: a class-7 frame would stop the sampling of every board that takes it for its own
/// (docs/protocols.md, "MTB3 firmware").
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MtbCommand {
    address: u8,
    len: u8,
    data: [u8; 8],
}

impl MtbCommand {
    fn new(address: u8, bytes: &[u8]) -> Self {
        let mut data = [0; 8];
        data[..bytes.len()].copy_from_slice(bytes);
        Self {
            address: address & 15,
            len: bytes.len() as u8,
            data,
        }
    }

    /// `SET_TXMODE` 0: the board at this address, 0 to 15, is to send. One of the iCub's has to be
    /// configured before.
    pub fn start(address: u8) -> Self {
        Self::new(address, &[SET_TXMODE, 0])
    }

    /// `SET_TXMODE` 1: the board at this address, 0 to 15, is to be silent.
    pub fn stop(address: u8) -> Self {
        Self::new(address, &[SET_TXMODE, 1])
    }

    /// `SET_BRD_CFG`, which also switches every triangle off.
    pub(crate) fn board_config(address: u8, setup: &IcubSetup) -> Self {
        let skin_type = setup.skin_type & 15;
        Self::new(address, &[SET_BRD_CFG, skin_type, setup.period_ms, setup.noload])
    }

    /// `SET_TRIANG_CFG` for the triangles `first..=last`, which also calibrates them and stops transmission.
    pub(crate) fn triangle_config(
        address: u8,
        [first, last]: [u8; 2],
        enable: bool,
        setup: &IcubSetup,
    ) -> Self {
        let [low, high] = setup.cdc_offset.to_le_bytes();
        let data = [SET_TRIANG_CFG, first, last, setup.shift, enable as u8, low, high];
        Self::new(address, &data)
    }

    /// `GET_FW_VERSION`, with the version of the protocol that is asked for.
    pub(crate) fn firmware_version(address: u8, [major, minor]: [u8; 2]) -> Self {
        Self::new(address, &[GET_FW_VERSION, major, minor])
    }

    /// Whom it is for.
    pub(crate) fn address(&self) -> u8 {
        self.address
    }

    /// Whether it is a question, which the board answers and which changes nothing.
    pub(crate) fn is_question(&self) -> bool {
        self.data[0] == GET_FW_VERSION
    }

    /// The standard id of its frame: `0x200 | address`, source 0.
    pub fn id(&self) -> u16 {
        0x200 | u16::from(self.address)
    }

    /// The frame to send.
    pub fn frame(&self) -> CanFrame {
        CanFrame::standard(self.id(), &self.data[..self.len as usize])
            .expect("11 bits and up to eight bytes make a frame")
    }
}

#[cfg(test)]
mod tests {
    use super::super::frames::is_command;
    use super::*;

    /// The worked example of the official document (docs/protocols.md, "MTB commands").
    #[test]
    fn commands_are_those_of_the_official_example() {
        let setup = IcubSetup::default();
        let cases = [
            (MtbCommand::board_config(1, &setup), "201#4D0032F5"),
            (
                MtbCommand::triangle_config(1, [0, 15], false, &setup),
                "201#50000F02000022",
            ),
            (
                MtbCommand::triangle_config(1, [0, 1], true, &setup),
                "201#50000102010022",
            ),
            (MtbCommand::start(1), "201#0700"),
            (MtbCommand::stop(11), "20B#0701"),
            (MtbCommand::firmware_version(5, [1, 0]), "205#1C0100"),
        ];
        for (command, text) in cases {
            let frame = command.frame();
            assert_eq!(frame.to_string(), text);
            assert!(is_command(frame.data()), "{text}");
        }
    }

    #[test]
    fn no_address_makes_another_class_than_2() {
        for address in 0..=u8::MAX {
            for command in [MtbCommand::start(address), MtbCommand::stop(address)] {
                assert_eq!(command.frame().id() >> 4, 0x20, "address {address}");
            }
        }
    }
}
