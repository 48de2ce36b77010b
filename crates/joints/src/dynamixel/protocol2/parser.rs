//! Packets, read from a stream that may hold anything.

use super::{BROADCAST_ID, HEADER, Instruction, MAX_ID, PREFIX_BYTES, crc16};

/// Finds packets in a stream of bytes: half packets, noise, false headers and damaged lengths cost
/// the bytes they damaged and no more than that.
///
/// A packet whose CRC is wrong is given back as [`BadCrc`] and only its first byte is skipped, so
/// that a good packet behind a damaged length is found. Memory is fixed when it is made: twice the
/// longest packet.
#[derive(Debug, Clone)]
pub struct Parser {
    buffer: Box<[u8]>,
    start: usize,
    end: usize,
    longest: usize,
    clean: Box<[u8]>,
    counters: ParserCounters,
}

/// What a parser has seen since it was made.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct ParserCounters {
    /// Packets with a good CRC.
    pub packets: u64,
    /// Headers with a plausible length whose CRC was wrong.
    pub bad_crc: u64,
    /// Bytes that belong to no packet.
    pub skipped_bytes: u64,
}

/// One packet with a good CRC.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Packet<'a> {
    /// The servo it is for, or the one that answers; [`BROADCAST_ID`] in the reply to a fast read.
    pub id: u8,
    /// The instruction byte; see [`Instruction::from_byte`].
    pub instruction: u8,
    /// What follows the instruction, without stuffing and CRC. A status packet's first is its ERR
    /// byte. The reply to a fast read is not stuffed and stands here as it came.
    pub parameters: &'a [u8],
    /// The whole packet as it was on the bus.
    pub raw: &'a [u8],
}

/// A packet whose CRC is wrong. What it says about itself may be wrong as well.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BadCrc<'a> {
    /// The id it claims.
    pub id: u8,
    /// The bytes from its header to the end of the length it claims.
    pub raw: &'a [u8],
}

impl Parser {
    /// A parser for packets whose LEN is at most `longest` (3 to 65,535). A header with a larger
    /// one is noise: the tighter this bound, the fewer bytes a damaged length can hold up.
    pub fn new(longest: usize) -> Self {
        let longest = longest.clamp(3, usize::from(u16::MAX));
        Self {
            buffer: vec![0; 2 * (longest + PREFIX_BYTES)].into_boxed_slice(),
            start: 0,
            end: 0,
            longest,
            clean: vec![0; longest].into_boxed_slice(),
            counters: ParserCounters::default(),
        }
    }

    /// A parser without memory, to stand in for one that is lent out; it takes nothing and allocates nothing.
    pub(crate) fn placeholder() -> Self {
        Self {
            buffer: Box::default(),
            start: 0,
            end: 0,
            longest: 0,
            clean: Box::default(),
            counters: ParserCounters::default(),
        }
    }

    /// What it has seen.
    pub fn counters(&self) -> ParserCounters {
        self.counters
    }

    /// Room for more bytes, at least one longest packet if [`Parser::next_packet`] has been called
    /// until it gave `None`. Say with [`Parser::take_bytes`] how many were put there.
    pub fn space(&mut self) -> &mut [u8] {
        if self.start > 0 {
            self.buffer.copy_within(self.start..self.end, 0);
            self.end -= self.start;
            self.start = 0;
        }
        &mut self.buffer[self.end..]
    }

    /// Takes the first `bytes` of [`Parser::space`] as received.
    pub fn take_bytes(&mut self, bytes: usize) {
        self.end = (self.end + bytes).min(self.buffer.len());
    }

    /// Copies as many of `bytes` as there is room for and says how many that were.
    #[must_use = "what did not fit has to be pushed again"]
    pub fn push(&mut self, bytes: &[u8]) -> usize {
        let space = self.space();
        let n = bytes.len().min(space.len());
        space[..n].copy_from_slice(&bytes[..n]);
        self.take_bytes(n);
        n
    }

    /// The next whole packet; `None` if it takes more bytes to tell.
    pub fn next_packet(&mut self) -> Option<Result<Packet<'_>, BadCrc<'_>>> {
        let (start, total) = loop {
            self.skip_to_header();
            let have = &self.buffer[self.start..self.end];
            if have.len() < PREFIX_BYTES {
                return None;
            }
            let length = usize::from(u16::from_le_bytes([have[5], have[6]]));
            let plausible_id = have[4] <= MAX_ID || have[4] == BROADCAST_ID;
            if !plausible_id || length < 3 || length > self.longest {
                self.skip(1);
                continue;
            }
            if have.len() < PREFIX_BYTES + length {
                return None;
            }
            break (self.start, PREFIX_BYTES + length);
        };
        let raw = &self.buffer[start..start + total];
        let (id, instruction) = (raw[4], raw[PREFIX_BYTES]);
        let crc = u16::from_le_bytes([raw[total - 2], raw[total - 1]]);
        if crc16(0, &raw[..total - 2]) != crc {
            self.counters.bad_crc += 1;
            self.counters.skipped_bytes += 1;
            self.start += 1;
            return Some(Err(BadCrc { id, raw }));
        }
        self.counters.packets += 1;
        self.start += total;
        let body = &raw[PREFIX_BYTES + 1..total - 2];
        let stuffed = !(id == BROADCAST_ID && instruction == Instruction::Status as u8);
        let parameters = if stuffed && body.windows(4).any(|w| w == [0xFF, 0xFF, 0xFD, 0xFD]) {
            let n = remove_stuffing(body, &mut self.clean);
            &self.clean[..n]
        } else {
            body
        };
        Some(Ok(Packet {
            id,
            instruction,
            parameters,
            raw,
        }))
    }

    /// The bytes from the header of a packet that has not ended; empty if there is none.
    pub fn incomplete(&self) -> &[u8] {
        let have = &self.buffer[self.start..self.end];
        if have.starts_with(&HEADER) { have } else { &[] }
    }

    /// Gives up waiting for the end of the packet that has begun, for instance at a deadline. Call
    /// [`Parser::next_packet`] again afterwards: whole packets may stand behind its damaged length.
    /// Says whether there was one.
    pub fn give_up(&mut self) -> bool {
        if self.incomplete().is_empty() {
            return false;
        }
        self.skip(1);
        true
    }

    /// Forgets the bytes it holds; they count as skipped.
    pub fn clear(&mut self) {
        self.skip(self.end - self.start);
    }

    fn skip(&mut self, bytes: usize) {
        self.start += bytes;
        self.counters.skipped_bytes += bytes as u64;
    }

    /// Skips what cannot be the beginning of a header.
    fn skip_to_header(&mut self) {
        let have = &self.buffer[self.start..self.end];
        let at = (0..have.len())
            .find(|i| {
                let rest = &have[*i..];
                let n = rest.len().min(HEADER.len());
                rest[..n] == HEADER[..n]
            })
            .unwrap_or(have.len());
        self.skip(at);
    }
}

/// Copies `body` without the byte that follows each `FF FF FD`, and gives the new length.
fn remove_stuffing(body: &[u8], clean: &mut [u8]) -> usize {
    let mut n = 0;
    let mut i = 0;
    while i < body.len() {
        clean[n] = body[i];
        n += 1;
        i += 1;
        if body[..i].ends_with(&[0xFF, 0xFF, 0xFD]) && body.get(i) == Some(&0xFD) {
            i += 1;
        }
    }
    n
}
