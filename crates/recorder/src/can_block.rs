//! CAN frames, many to a message.

use crate::cdr::{CdrReader, CdrWriter, Cells};
use taxel_can::{CanFrame, Received};

/// Most frames of one message.
const MOST: usize = 4096;

/// Frames on their way into one message, in the order in which they are to be read.
#[derive(Debug, Default)]
pub struct CanBlock {
    start_ns: u64,
    after_ns: Vec<u32>,
    bus: Vec<u8>,
    id: Vec<u32>,
    length: Vec<u8>,
    data: Vec<[u8; 8]>,
}

impl CanBlock {
    /// Adds a frame of the bus of this number. False where the message is full, or the frame is too far from its first one in
    /// time: it belongs into the next.
    pub fn push(&mut self, bus: u8, received: &Received) -> bool {
        if self.is_empty() {
            self.start_ns = received.t_ns;
        }
        let after = received.t_ns.checked_sub(self.start_ns);
        let Some(after_ns) = after
            .and_then(|after| u32::try_from(after).ok())
            .filter(|_| self.len() < MOST)
        else {
            return false;
        };
        let frame = &received.frame;
        let mut data = [0; 8];
        data[..frame.data().len()].copy_from_slice(frame.data());
        self.after_ns.push(after_ns);
        self.bus.push(bus);
        self.id.push(frame.raw_id());
        self.length.push(frame.dlc());
        self.data.push(data);
        true
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.bus.len()
    }

    /// Whether there is none yet.
    pub fn is_empty(&self) -> bool {
        self.bus.is_empty()
    }

    /// Time of the first frame, nanoseconds.
    pub fn start_ns(&self) -> u64 {
        self.start_ns
    }

    /// Number of frames of each of so many buses.
    pub(crate) fn frames_of(&self, buses: usize) -> Vec<u64> {
        let mut frames = vec![0; buses];
        self.bus.iter().for_each(|bus| frames[usize::from(*bus)] += 1);
        frames
    }

    /// The message, of buses of these names that have lost these numbers of frames; the block is empty after that.
    pub fn take(&mut self, buses: &[String], lost: &[u64]) -> Vec<u8> {
        let names: usize = buses.iter().map(|name| name.len() + 24).sum();
        let mut cdr = CdrWriter::with_capacity(64 + names + 18 * self.len());
        cdr.texts(buses.iter().map(String::as_str));
        cdr.u64s(lost.iter().copied());
        cdr.u64(self.start_ns);
        cdr.u32s(self.after_ns.iter().copied());
        cdr.bytes(&self.bus);
        cdr.u32s(self.id.iter().copied());
        cdr.bytes(&self.length);
        cdr.bytes(self.data.as_flattened());
        self.after_ns.clear();
        self.bus.clear();
        self.id.clear();
        self.length.clear();
        self.data.clear();
        cdr.finish()
    }
}

/// The frames of one message, as they stand there.
#[derive(Debug, Clone)]
pub struct CanFrames<'a> {
    /// Names of the buses.
    pub buses: Vec<&'a str>,
    /// Frames of each bus that the kernel dropped before the recorder had them, or for which its disk was too slow, since it
    /// began.
    pub lost: Vec<u64>,
    start_ns: u64,
    after_ns: Cells<'a, 4>,
    bus: &'a [u8],
    id: Cells<'a, 4>,
    length: &'a [u8],
    data: Cells<'a, 8>,
}

impl<'a> CanFrames<'a> {
    /// Reads a message; none where it is none, or its lists differ in length.
    pub fn read(message: &'a [u8]) -> Option<Self> {
        let mut cdr = CdrReader::new(message)?;
        let frames = Self {
            buses: cdr.texts()?,
            lost: cdr.list()?.iter().map(|lost| u64::from_le_bytes(*lost)).collect(),
            start_ns: cdr.u64()?,
            after_ns: cdr.list()?,
            bus: cdr.bytes()?,
            id: cdr.list()?,
            length: cdr.bytes()?,
            data: cdr.bytes()?.as_chunks().0,
        };
        let count = frames.bus.len();
        let fit = [
            frames.after_ns.len(),
            frames.id.len(),
            frames.length.len(),
            frames.data.len(),
        ];
        let known = frames
            .bus
            .iter()
            .all(|bus| usize::from(*bus) < frames.buses.len());
        (known && fit.iter().all(|len| *len == count)).then_some(frames)
    }

    /// Time of the first frame, nanoseconds.
    pub fn start_ns(&self) -> u64 {
        self.start_ns
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.bus.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.bus.is_empty()
    }

    /// The frames: index into [`CanFrames::buses`], time on `CLOCK_MONOTONIC`, frame.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (u8, Received)> + '_ {
        let numbers = self.bus.iter().zip(self.after_ns).zip(self.id);
        numbers
            .zip(self.length)
            .zip(self.data)
            .map(|((((bus, after), id), length), data)| {
                let raw_id = u32::from_le_bytes(*id);
                let t_ns = self.start_ns.saturating_add(u32::from_le_bytes(*after).into());
                let data = &data[..usize::from(*length).min(8)];
                let frame = CanFrame::from_raw(raw_id, data).expect("at most eight bytes");
                (*bus, Received { t_ns, frame })
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_read_back_as_they_were_of_whatever_kind() {
        let frames = [
            CanFrame::standard(0x123, &[1, 2, 3]).unwrap(),
            CanFrame::extended(0x1FFF_FFFF, &[0xFF; 8]).unwrap(),
            CanFrame::remote(5, false, 4).unwrap(),
            CanFrame::error(0x40, [9; 8]),
            CanFrame::standard(0, &[]).unwrap(),
        ];
        let buses = ["can0".to_owned(), "can1".to_owned()];
        let mut block = CanBlock::default();
        let received = |i: usize| Received {
            t_ns: 1_000 + i as u64,
            frame: frames[i],
        };
        for i in 0..frames.len() {
            assert!(block.push((i % 2) as u8, &received(i)));
        }
        let message = block.take(&buses, &[0, 7]);
        assert!(block.is_empty());
        let read = CanFrames::read(&message).unwrap();
        assert_eq!(
            (read.buses.clone(), read.lost.clone()),
            (vec!["can0", "can1"], vec![0, 7])
        );
        let all: Vec<_> = read.iter().collect();
        let wanted: Vec<_> = (0..frames.len()).map(|i| ((i % 2) as u8, received(i))).collect();
        assert_eq!(all, wanted);
        for len in 0..message.len() {
            assert!(CanFrames::read(&message[..len]).is_none(), "{len} bytes");
        }
    }

    #[test]
    fn a_frame_before_the_first_or_seconds_later_begins_a_message_of_its_own() {
        let frame = CanFrame::standard(1, &[]).unwrap();
        let mut block = CanBlock::default();
        assert!(block.push(0, &Received { t_ns: 100, frame }));
        assert!(!block.push(0, &Received { t_ns: 99, frame }));
        assert!(!block.push(
            0,
            &Received {
                t_ns: 101 + u64::from(u32::MAX),
                frame
            }
        ));
        assert_eq!(block.len(), 1);
    }
}
