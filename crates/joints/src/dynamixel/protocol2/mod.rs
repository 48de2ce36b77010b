//! Dynamixel Protocol 2.0 as bytes: packets written, read from a stream, and taken apart. No I/O, no clock.
//!
//! A packet is `FF FF FD 00 ID LEN LEN INST [ERR] parameters CRC CRC`; LEN counts everything after
//! itself, and each `FF FF FD` from INST to the last parameter is written as `FF FF FD FD` (ROBOTIS
//! e-Manual, "Protocol 2.0").

mod crc;
mod encode;
mod fast;
mod parser;

pub use crc::crc16;
pub use encode::{Assignment, Encoder};
pub use fast::{FastBlock, FastBlocks, encode_fast_reply};
pub use parser::{BadCrc, Packet, Parser, ParserCounters};

/// Id that every servo listens to.
pub const BROADCAST_ID: u8 = 0xFE;
/// Highest id of a servo.
pub const MAX_ID: u8 = 252;
/// Bytes of a packet before INST: header, reserved, id, length.
pub const PREFIX_BYTES: usize = 7;
/// Bytes of a status packet that are not data: prefix, INST, ERR, CRC.
pub const STATUS_OVERHEAD: usize = PREFIX_BYTES + 4;
/// Bytes that each servo's block in a fast sync read reply has beside its data: ERR, id, CRC.
pub const FAST_BLOCK_OVERHEAD: usize = 4;

const HEADER: [u8; 4] = [0xFF, 0xFF, 0xFD, 0x00];

/// What a packet asks for, or that it answers ([`Instruction::Status`]).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Instruction {
    /// Is anybody there? Answered with model number and firmware version.
    Ping = 0x01,
    /// Bytes of the control table.
    Read = 0x02,
    /// Bytes into the control table.
    Write = 0x03,
    /// Bytes to be written on [`Instruction::Action`].
    RegWrite = 0x04,
    /// Carry out the registered write.
    Action = 0x05,
    /// Back to the values of the factory.
    FactoryReset = 0x06,
    /// Restart; clears a hardware error.
    Reboot = 0x08,
    /// Forget the revolutions.
    Clear = 0x10,
    /// The answer of a servo.
    Status = 0x55,
    /// The same bytes of several servos; each answers with its own packet.
    SyncRead = 0x82,
    /// Bytes into the same place of several servos; not answered.
    SyncWrite = 0x83,
    /// The same bytes of several servos; all answer in one packet.
    FastSyncRead = 0x8A,
    /// Different bytes of several servos; each answers with its own packet.
    BulkRead = 0x92,
    /// Bytes into different places of several servos; not answered.
    BulkWrite = 0x93,
    /// Different bytes of several servos; all answer in one packet.
    FastBulkRead = 0x9A,
}

impl Instruction {
    const ALL: [Instruction; 15] = [
        Instruction::Ping,
        Instruction::Read,
        Instruction::Write,
        Instruction::RegWrite,
        Instruction::Action,
        Instruction::FactoryReset,
        Instruction::Reboot,
        Instruction::Clear,
        Instruction::Status,
        Instruction::SyncRead,
        Instruction::SyncWrite,
        Instruction::FastSyncRead,
        Instruction::BulkRead,
        Instruction::BulkWrite,
        Instruction::FastBulkRead,
    ];

    /// The instruction of this byte; `None` for one that is not in the list above.
    pub fn from_byte(byte: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|i| *i as u8 == byte)
    }
}

/// The ERR byte of a status packet: a number, and apart from it the alert bit.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct StatusByte(pub u8);

impl StatusByte {
    /// Whether Hardware Error Status (address 70) is not 0. The answer itself is good all the same.
    pub fn alert(self) -> bool {
        self.0 & 0x80 != 0
    }

    /// Why the instruction was not carried out; `None` if it was.
    pub fn error(self) -> Option<StatusError> {
        match self.0 & 0x7F {
            0 => None,
            1 => Some(StatusError::ResultFail),
            2 => Some(StatusError::Instruction),
            3 => Some(StatusError::Crc),
            4 => Some(StatusError::DataRange),
            5 => Some(StatusError::DataLength),
            6 => Some(StatusError::DataLimit),
            7 => Some(StatusError::Access),
            other => Some(StatusError::Unknown(other)),
        }
    }
}

/// Why a servo did not carry out an instruction: a number in bits 0 to 6 of ERR, not a bit field.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum StatusError {
    /// 1.
    #[error("the servo could not process the packet (1, result fail)")]
    ResultFail,
    /// 2.
    #[error("the servo's firmware does not know the instruction (2, instruction error)")]
    Instruction,
    /// 3.
    #[error("the request reached the servo damaged (3, CRC error)")]
    Crc,
    /// 4.
    #[error("the value is outside its range, or the bus watchdog has tripped (4, data range error)")]
    DataRange,
    /// 5.
    #[error("fewer bytes than the register has (5, data length error)")]
    DataLength,
    /// 6.
    #[error("the value is over a limit set in the servo (6, data limit error)")]
    DataLimit,
    /// 7.
    #[error("the address cannot be read or written, or is EEPROM and torque is enabled (7, access error)")]
    Access,
    /// Any other number.
    #[error("error number {0}, which Protocol 2.0 does not list")]
    Unknown(u8),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_alert_bit_and_the_error_number_are_separate() {
        for (byte, alert, error) in [
            (0x00, false, None),
            (0x80, true, None),
            (0x07, false, Some(StatusError::Access)),
            (0x84, true, Some(StatusError::DataRange)),
            (0x03, false, Some(StatusError::Crc)),
            (0x60, false, Some(StatusError::Unknown(0x60))),
        ] {
            let status = StatusByte(byte);
            assert_eq!((status.alert(), status.error()), (alert, error), "{byte:#x}");
        }
    }

    #[test]
    fn instructions_have_the_numbers_of_the_manual() {
        for (byte, instruction) in [
            (0x01, Some(Instruction::Ping)),
            (0x55, Some(Instruction::Status)),
            (0x82, Some(Instruction::SyncRead)),
            (0x8A, Some(Instruction::FastSyncRead)),
            (0x92, Some(Instruction::BulkRead)),
            (0x00, None),
            (0xFF, None),
        ] {
            assert_eq!(Instruction::from_byte(byte), instruction);
        }
        for i in Instruction::ALL {
            assert_eq!(Instruction::from_byte(i as u8), Some(i));
        }
    }
}
