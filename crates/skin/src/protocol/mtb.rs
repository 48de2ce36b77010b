//! What every MTB understands, be it the iCub's or uSkin's: commands of class 2 (protocols.md 1.2, 1.4).

use super::icub::IcubSetup;
use taxel_can::CanFrame;

/// `SET_TXMODE`, first data byte of a start or stop command.
pub(crate) const SET_TXMODE: u8 = 0x07;
/// `GET_FW_VERSION`, first data byte of the request and of its answer.
pub(crate) const GET_FW_VERSION: u8 = 0x1C;
const SET_BRD_CFG: u8 = 0x4D;
const SET_TRIANG_CFG: u8 = 0x50;

/// Commands by first data byte and length, to tell those of another program from frames of unknown boards.
const COMMANDS: [(u8, usize); 9] = [
    (SET_TXMODE, 2),
    (0x08, 2),
    (GET_FW_VERSION, 3),
    (0x32, 2),
    (0x4C, 8),
    (SET_BRD_CFG, 4),
    (0x4E, 8),
    (0x4F, 3),
    (SET_TRIANG_CFG, 7),
];

/// Whether this is the data of a command to an MTB.
pub(crate) fn is_command(data: &[u8]) -> bool {
    data.first()
        .is_some_and(|first| COMMANDS.contains(&(first & 0x7F, data.len())))
}

/// The board that answers a question of ours, by the answer: `0x200 | address << 4`, eight bytes.
pub(crate) fn answering(frame: &CanFrame) -> Option<u8> {
    let id = frame.standard_id().filter(|id| id & 0x70F == 0x200)?;
    (frame.data().len() == 8 && frame.data()[0] == GET_FW_VERSION).then_some((id >> 4 & 15) as u8)
}

/// A command to one MTB. Its frame is of class 2 by construction, whatever the address and the data: a class-7 frame
/// would stop the sampling of every board that takes it for its own (protocols.md 1.9).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct MtbCommand {
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

    /// `SET_TXMODE`: 0 starts, 1 stops.
    pub(crate) fn tx_mode(address: u8, stop: bool) -> Self {
        Self::new(address, &[SET_TXMODE, stop as u8])
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

    /// The frame to send: id `0x200 | address`, source 0.
    pub(crate) fn frame(&self) -> CanFrame {
        CanFrame::standard(0x200 | self.address as u16, &self.data[..self.len as usize])
            .expect("11 bits and up to eight bytes make a frame")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The worked example of protocols.md 1.4, from the official document.
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
            (MtbCommand::tx_mode(1, false), "201#0700"),
            (MtbCommand::tx_mode(11, true), "20B#0701"),
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
            let id = MtbCommand::tx_mode(address, true).frame().id();
            assert_eq!(id >> 4, 0x20, "address {address}");
        }
    }
}
