//! The message of a pressure array (docs/protocols.md, "Pressure arrays"), and the frames that one is cut into.

use crate::CanFrame;

/// What a message begins with.
const MAGIC: [u8; 4] = *b"TXPA";
const VERSION: u8 = 1;
/// Bytes before the counts.
pub(super) const HEADER: usize = 24;
/// Taxels in a frame.
const PER_FRAME: usize = 4;
/// Most taxels of an array: what 2047 frames carry behind the first.
pub const MAX_ARRAY_TAXELS: u16 = 8188;

/// What a message says before its counts; and, but for the time, the first frame of those it is cut into.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ArrayHead {
    /// Rows of the array.
    pub rows: u16,
    /// Columns of the array.
    pub columns: u16,
    /// One more with every message; begins anew with the program that sends.
    pub sequence: u32,
    /// When it was measured, `CLOCK_MONOTONIC` nanoseconds; 0 where the sender does not know.
    pub measured_ns: u64,
}

/// Why a message is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Refusal {
    /// It is no message of a pressure array.
    Foreign,
    /// Another version.
    Version,
    /// An array of other rows or columns.
    Size([u16; 2]),
    /// Fewer or more counts than its rows and columns have.
    Torn,
}

impl ArrayHead {
    /// Its taxels.
    pub fn taxels(&self) -> usize {
        usize::from(self.rows) * usize::from(self.columns)
    }

    /// Frames that a message is cut into.
    pub fn frames(&self) -> usize {
        1 + self.taxels().div_ceil(PER_FRAME)
    }

    /// The head of a message for an array of so many rows and columns.
    pub(super) fn of_message(bytes: &[u8], [rows, columns]: [u16; 2]) -> Result<Self, Refusal> {
        if bytes.get(..4) != Some(&MAGIC[..]) {
            return Err(Refusal::Foreign);
        }
        if bytes.get(4) != Some(&VERSION) {
            return Err(Refusal::Version);
        }
        let Some((header, counts)) = bytes.split_at_checked(HEADER) else {
            return Err(Refusal::Torn);
        };
        let [sides, number, time] = [&header[6..10], &header[12..16], &header[16..24]];
        let side = |at: usize| u16::from_le_bytes([sides[at], sides[at + 1]]);
        let head = Self {
            rows: side(0),
            columns: side(2),
            sequence: number
                .iter()
                .rev()
                .fold(0, |all, byte| all << 8 | u32::from(*byte)),
            measured_ns: time.iter().rev().fold(0, |all, byte| all << 8 | u64::from(*byte)),
        };
        if [head.rows, head.columns] != [rows, columns] {
            return Err(Refusal::Size([head.rows, head.columns]));
        }
        match counts.len() == 2 * head.taxels() {
            true => Ok(head),
            false => Err(Refusal::Torn),
        }
    }

    /// The bytes of a header.
    pub(super) fn to_header(self) -> [u8; HEADER] {
        let mut header = [0; HEADER];
        header[..4].copy_from_slice(&MAGIC);
        header[4] = VERSION;
        header[6..8].copy_from_slice(&self.rows.to_le_bytes());
        header[8..10].copy_from_slice(&self.columns.to_le_bytes());
        header[12..16].copy_from_slice(&self.sequence.to_le_bytes());
        header[16..].copy_from_slice(&self.measured_ns.to_le_bytes());
        header
    }

    /// The head that the first frame of a message carries; `None` for a frame that is none, or one of more taxels than an
    /// array has.
    pub fn of_frame(data: &[u8]) -> Option<Self> {
        let [a, b, c, d, sequence @ ..] = <[u8; 8]>::try_from(data).ok()?;
        let head = Self {
            rows: u16::from_le_bytes([a, b]),
            columns: u16::from_le_bytes([c, d]),
            sequence: u32::from_le_bytes(sequence),
            measured_ns: 0,
        };
        (1..=MAX_ARRAY_TAXELS.into())
            .contains(&head.taxels())
            .then_some(head)
    }

    /// Frame `index` of a message with these counts, two bytes each: id 0 is the head, id `n` carries the taxels from
    /// `4 (n - 1)` on.
    pub(super) fn frame(&self, index: usize, counts: &[u8]) -> CanFrame {
        let frame = match index.checked_sub(1) {
            None => {
                let ([a, b], [c, d]) = (self.rows.to_le_bytes(), self.columns.to_le_bytes());
                let [e, f, g, h] = self.sequence.to_le_bytes();
                CanFrame::standard(0, &[a, b, c, d, e, f, g, h])
            }
            Some(place) => {
                let from = 2 * PER_FRAME * place;
                let data = &counts[from..counts.len().min(from + 2 * PER_FRAME)];
                CanFrame::standard(index as u16, data)
            }
        };
        frame.expect("up to 2047 frames of eight bytes")
    }
}

/// The frames of one message of these counts, row by row, as the source of a pressure array gives them. For simulators
/// and recordings.
pub fn pressure_frames([rows, columns]: [u16; 2], sequence: u32, counts: &[u16]) -> Vec<CanFrame> {
    let head = ArrayHead {
        rows,
        columns,
        sequence,
        measured_ns: 0,
    };
    let bytes: Vec<u8> = counts.iter().flat_map(|count| count.to_le_bytes()).collect();
    (0..head.frames())
        .map(|index| head.frame(index, &bytes))
        .collect()
}
