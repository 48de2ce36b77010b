//! Packets over one or more frames: `p[0]` command, `p[1]` size, data, checksum.

use super::setup::{Checksum, CyskinSetup, FIRST, HubIds, LAST, MIDDLE, MODULES, SENSOR_DATA, SINGLE};
use std::ops::Range;
use taxel_can::CanFrame;

/// A first byte below this is a sequence number.
const FIRST_COMMAND: u8 = 0x10;
/// Command, size, up to 255 bytes of data, checksum.
const LONGEST: usize = 258;

/// Why there are no frames of a packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum CyskinPacketError {
    /// More data than the size byte can say.
    #[error("a CySkin packet carries at most 255 data bytes, not {0}")]
    TooLong(usize),
    /// The checksum is not known.
    #[error("with checksum = \"unchecked\" no packet can be made: write the checksum the hub uses")]
    NoChecksum,
    /// A code that would be read as a sequence number.
    #[error("command {0:#04X} is below 0x10, where sequence numbers are")]
    NotACommand(u8),
    /// An address the ids have no room for.
    #[error("hub address {address:#X} is not 1 to {largest:#X}")]
    Address {
        /// The address.
        address: u32,
        /// The largest one, which means all hubs.
        largest: u32,
    },
}

/// The frames of a packet with this address, which may be [`HubIds::everybody`]: for simulators and tests, and
/// for the commands to hubs.
pub fn cyskin_frames(
    setup: &CyskinSetup,
    address: u32,
    command: u8,
    data: &[u8],
) -> Result<Vec<CanFrame>, CyskinPacketError> {
    let largest = setup.ids.everybody();
    if !(1..=largest).contains(&address) {
        return Err(CyskinPacketError::Address { address, largest });
    }
    if command < FIRST_COMMAND {
        return Err(CyskinPacketError::NotACommand(command));
    }
    let size = u8::try_from(data.len()).map_err(|_| CyskinPacketError::TooLong(data.len()))?;
    let mut packet = vec![command, size];
    packet.extend(data);
    packet.push(setup.checksum.of(&packet).ok_or(CyskinPacketError::NoChecksum)?);
    let frame = |place: u32, bytes: &[u8]| {
        let id = setup.ids.id(place, address);
        let frame = match setup.ids {
            HubIds::Standard => CanFrame::standard(id as u16, bytes),
            HubIds::Extended => CanFrame::extended(id, bytes),
        };
        frame.expect("11 or 29 bits and up to eight bytes make a frame")
    };
    if packet.len() <= 8 {
        return Ok(vec![frame(SINGLE, &packet)]);
    }
    let (first, rest) = packet.split_at(8);
    let mut frames = vec![frame(FIRST, first)];
    let numbered = size > setup.sequence_bytes_above;
    let chunks: Vec<&[u8]> = rest.chunks(if numbered { 7 } else { 8 }).collect();
    for (i, chunk) in chunks.iter().enumerate() {
        let place = if i + 1 == chunks.len() { LAST } else { MIDDLE };
        let mut bytes = Vec::with_capacity(8);
        if numbered {
            bytes.push((i as u8 + 1) & 15);
        }
        bytes.extend(*chunk);
        frames.push(frame(place, &bytes));
    }
    Ok(frames)
}

/// Whether a frame at this place is the first, or the only, of any packet.
pub(crate) fn begins_packet(place: u32) -> bool {
    matches!(place, FIRST | SINGLE)
}

/// Whether a frame at this place is the first, or the only, of a packet of values, by its command and
/// its size: the place of the first value, and one value at least.
pub(crate) fn begins_with_values(place: u32, data: &[u8]) -> bool {
    let &[SENSOR_DATA, size, ..] = data else {
        return false;
    };
    let packet = usize::from(size) + 3;
    let fits = match place {
        SINGLE => data.len() == packet,
        FIRST => data.len() == 8 && packet > 8,
        _ => false,
    };
    fits && size >= 4 && size.is_multiple_of(2)
}

/// The numbers of the modules that values run over, from this module and sensor on; `None` where a hub has no such
/// places. At least the first is among them.
pub(crate) fn modules_of_values(
    [module, sensor]: [u8; 2],
    values: usize,
    sensors_per_module: u8,
) -> Option<Range<usize>> {
    let ends = (usize::from(sensor) + values).div_ceil(usize::from(sensors_per_module));
    let modules = usize::from(module)..usize::from(module) + ends.max(1);
    (sensor < sensors_per_module && modules.end <= usize::from(MODULES)).then_some(modules)
}

/// A packet under assembly: a buffer of fixed size, whatever the bus carries.
#[derive(Debug, Clone)]
pub(super) struct Assembly {
    bytes: [u8; LONGEST],
    len: usize,
    open: bool,
    /// Number of the last continuation frame; `None` before the first.
    sequence: Option<u8>,
    newest_ns: u64,
}

/// What a frame did to the assembly.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Step {
    /// A packet goes on.
    Partial,
    /// A packet is complete, and its checksum is right: length of it.
    Complete(usize),
    /// The frame belongs to no packet, or the packet is not one.
    Malformed,
}

impl Assembly {
    pub(super) fn new() -> Self {
        Self {
            bytes: [0; LONGEST],
            len: 0,
            open: false,
            sequence: None,
            newest_ns: 0,
        }
    }

    /// The bytes of the packet that is complete: command, size, data, checksum.
    pub(super) fn bytes(&self, len: usize) -> &[u8] {
        &self.bytes[..len]
    }

    /// Takes a frame of the hub. Also returns whether a packet that was under way had to be given up.
    #[inline]
    pub(super) fn handle_frame(&mut self, place: u32, data: &[u8], t_ns: u64, rules: &Rules) -> (Step, bool) {
        let late = self.open && t_ns.saturating_sub(self.newest_ns) > rules.timeout_ns;
        let begins = begins_packet(place);
        let lost = self.open && (late || begins);
        self.open &= !lost;
        self.newest_ns = t_ns;
        let step = match place {
            FIRST | SINGLE => {
                (self.len, self.sequence) = (0, None);
                let begun = data.first().is_some_and(|command| *command >= FIRST_COMMAND);
                if begun && self.append(data) {
                    self.open = place == FIRST;
                    Step::Partial
                } else {
                    Step::Malformed
                }
            }
            MIDDLE | LAST if self.open => {
                let data = if self.size().is_some_and(|size| size > rules.sequence_bytes_above) {
                    self.continuation(data)
                } else {
                    Some(data)
                };
                match data {
                    Some(data) if self.append(data) => Step::Partial,
                    _ => Step::Malformed,
                }
            }
            _ => Step::Malformed,
        };
        let broken = step == Step::Malformed && self.open && !begins;
        if broken {
            self.open = false;
            return (step, true);
        }
        if step == Step::Partial && place & LAST != 0 {
            self.open = false;
            return (self.finish(rules.checksum), lost);
        }
        (step, lost)
    }

    fn size(&self) -> Option<u8> {
        (self.len >= 2).then(|| self.bytes[1])
    }

    /// A continuation frame's bytes without its number; `None` if the number is not the next one.
    /// Whether counting starts at 0 or 1 is not public, so both are taken.
    fn continuation<'a>(&mut self, data: &'a [u8]) -> Option<&'a [u8]> {
        let (&number, rest) = data.split_first()?;
        let expected = match self.sequence {
            None => number <= 1,
            Some(last) => number == (last + 1) & 15,
        };
        self.sequence = Some(number);
        (expected && number < FIRST_COMMAND).then_some(rest)
    }

    /// Appends bytes, unless the packet becomes longer than it says it is.
    fn append(&mut self, data: &[u8]) -> bool {
        let len = self.len + data.len();
        let Some(place) = self.bytes.get_mut(self.len..len) else {
            return false;
        };
        place.copy_from_slice(data);
        self.len = len;
        self.size().is_none_or(|size| len <= 3 + usize::from(size))
    }

    fn finish(&self, checksum: Checksum) -> Step {
        let bytes = &self.bytes[..self.len];
        let Some((&last, before)) = bytes.split_last() else {
            return Step::Malformed;
        };
        let whole = self
            .size()
            .is_some_and(|size| bytes.len() == 3 + usize::from(size));
        let right = checksum.of(before).is_none_or(|sum| sum == last);
        if whole && right {
            Step::Complete(self.len)
        } else {
            Step::Malformed
        }
    }
}

/// What the assembly has to know of the configuration.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rules {
    pub(super) checksum: Checksum,
    pub(super) sequence_bytes_above: u8,
    pub(super) timeout_ns: u64,
}
