//! Which servos are on a bus.

use crate::dynamixel::bus::wire_ns;
use crate::dynamixel::protocol2::{BROADCAST_ID, Encoder, Instruction, MAX_ID, Parser, StatusByte};
use crate::serial::{Port, PortError};
use std::path::Path;
use std::time::Duration;
use taxel_can::monotonic_ns;

/// A servo that answered a ping.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FoundServo {
    /// Its id.
    pub id: u8,
    /// Its Model Number.
    pub model_number: u16,
    /// Its Firmware Version.
    pub firmware: u8,
    /// Whether it reports a hardware error.
    pub alert: bool,
}

/// How long each id may take to answer a broadcast ping, as in ROBOTIS's SDK.
const PER_ID_NS: u64 = 3_000_000;
const ANSWER_BYTES: usize = 14;

/// Pings all servos of a bus and lists those that answer, by id. It takes about a second, and
/// nothing else may use the port meanwhile.
pub fn scan(path: &Path, baud: u32) -> Result<Vec<FoundServo>, PortError> {
    let mut port = Port::open(path, baud, None)?;
    port.write(Encoder::default().ping(BROADCAST_ID))?;
    let answers = usize::from(MAX_ID) + 1;
    let end_ns = monotonic_ns() + answers as u64 * PER_ID_NS + wire_ns(answers * ANSWER_BYTES, baud);
    let mut parser = Parser::new(64);
    let mut found: Vec<FoundServo> = Vec::new();
    loop {
        let left_ns = end_ns.saturating_sub(monotonic_ns());
        if left_ns == 0 {
            break;
        }
        let n = port.read(parser.space(), Duration::from_nanos(left_ns))?;
        parser.take_bytes(n);
        while let Some(packet) = parser.next_packet() {
            let Ok(packet) = packet else { continue };
            if packet.instruction != Instruction::Status as u8 {
                continue;
            }
            if let [error, lo, hi, firmware] = *packet.parameters
                && found.iter().all(|f| f.id != packet.id)
            {
                found.push(FoundServo {
                    id: packet.id,
                    model_number: u16::from_le_bytes([lo, hi]),
                    firmware,
                    alert: StatusByte(error).alert(),
                });
            }
        }
    }
    found.sort_unstable_by_key(|f| f.id);
    Ok(found)
}
