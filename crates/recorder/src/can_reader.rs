//! The CAN frames of a recording, one after the other.

use crate::can_block::CanFrames;
use crate::reader::{Item, ReadError, RecordingReader};
use crate::schema::Topic;
use crate::standard::read_text;
use std::path::Path;
use std::sync::Arc;
use taxel_can::Received;
use taxel_wire::Hello;

/// Reads the CAN frames of a recording in the order in which they stand there, which is that of their times.
#[derive(Debug)]
pub struct CanReader {
    reader: RecordingReader,
    names: Vec<Arc<str>>,
    lost: Vec<u64>,
    frames: Vec<(u8, Received)>,
    next: usize,
    /// From the frames' clock to the wall clock, nanoseconds.
    wall_ahead_ns: i64,
    /// Messages that are not what they should be.
    undecodable: u64,
    /// The hand that the daemon told of first.
    hand: Option<Hello>,
    /// The layout of another one that it told of behind frames, and when.
    another_hand: Option<(String, u64)>,
}

impl CanReader {
    /// Opens a recording.
    ///
    /// # Errors
    /// As [`RecordingReader::open`].
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        Self::open_with(path, &[])
    }

    /// Opens a recording of which messages of other topics are wanted, too; [`CanReader::next_frame_with`] shows them.
    ///
    /// # Errors
    /// As [`RecordingReader::open`].
    pub fn open_with(path: &Path, others: &[Topic]) -> Result<Self, ReadError> {
        Ok(Self {
            reader: RecordingReader::open(path, &[&[Topic::Can, Topic::Hello], others].concat())?,
            names: Vec::new(),
            lost: Vec::new(),
            frames: Vec::new(),
            next: 0,
            wall_ahead_ns: 0,
            undecodable: 0,
            hand: None,
            another_hand: None,
        })
    }

    /// Names of the buses that were met so far; frames tell theirs by its place here.
    pub fn names(&self) -> &[Arc<str>] {
        &self.names
    }

    /// Frames that the recorder lost on all buses, so far.
    pub fn lost(&self) -> u64 {
        self.lost.iter().sum()
    }

    /// Messages so far that hold no CAN frames although they should.
    pub fn undecodable(&self) -> u64 {
        self.undecodable
    }

    /// Where the daemon was started anew with another hand: the layout of that, and when, by the wall clock, nanoseconds. The
    /// frame that was given last, and those behind it, are of that hand.
    pub fn another_hand(&self) -> Option<(&str, u64)> {
        self.another_hand
            .as_ref()
            .map(|(layout, wall_ns)| (layout.as_str(), *wall_ns))
    }

    /// What of the file could not be read so far; see [`RecordingReader::left_out`].
    pub fn left_out(&self) -> Vec<String> {
        self.reader.left_out()
    }

    /// How far it is read, bytes; see [`RecordingReader::position`].
    pub fn position(&self) -> u64 {
        self.reader.position()
    }

    /// The next frame, with the place of its bus in [`CanReader::names`]; its time is that of `CLOCK_MONOTONIC` on the machine
    /// that recorded it.
    ///
    /// # Errors
    /// As [`RecordingReader::next_item`].
    pub fn next_frame(&mut self) -> Result<Option<(usize, Received)>, ReadError> {
        self.next_frame_with(&mut |_, _, _| {})
    }

    /// The same, and shows `other` the messages of other topics that stand before it: their times on the wall clock,
    /// nanoseconds, and what they hold.
    ///
    /// # Errors
    /// As [`RecordingReader::next_item`].
    #[inline]
    pub fn next_frame_with(
        &mut self,
        other: &mut dyn FnMut(Topic, u64, &[u8]),
    ) -> Result<Option<(usize, Received)>, ReadError> {
        while self.next == self.frames.len() {
            if !self.next_block(other)? {
                return Ok(None);
            }
        }
        let (bus, received) = self.frames[self.next];
        self.next += 1;
        Ok(Some((usize::from(bus), received)))
    }

    /// When a frame of this time, the last that was given, came by the wall clock of the recording, nanoseconds since 1970.
    pub fn wall_ns(&self, t_ns: u64) -> u64 {
        t_ns.saturating_add_signed(self.wall_ahead_ns)
    }

    fn next_block(&mut self, other: &mut dyn FnMut(Topic, u64, &[u8])) -> Result<bool, ReadError> {
        self.frames.clear();
        self.next = 0;
        let (data, wall_ns) = loop {
            match self.reader.next_item()? {
                None => return Ok(false),
                Some(Item::Message {
                    topic: Topic::Hello,
                    data,
                    wall_ns,
                }) => {
                    let hello = read_text(data).and_then(|text| Hello::parse(text.as_bytes()).ok());
                    let Some(hello) = hello else { continue };
                    match &self.hand {
                        Some(hand) if !self.names.is_empty() => {
                            if self.another_hand.is_none() && !hand.is_of_one_hand_with(&hello) {
                                self.another_hand = Some((hello.layout, wall_ns));
                            }
                        }
                        _ => self.hand = Some(hello),
                    }
                }
                Some(Item::Message {
                    topic: Topic::Can,
                    data,
                    wall_ns,
                }) => break (data, wall_ns),
                Some(Item::Message { topic, data, wall_ns }) => other(topic, wall_ns, data),
                Some(Item::Attached(_) | Item::Damaged) => {}
            }
        };
        let Some(block) = CanFrames::read(data) else {
            self.undecodable += 1;
            return Ok(true);
        };
        self.wall_ahead_ns = wall_ns.wrapping_sub(block.start_ns()) as i64;
        let names = &mut self.names;
        let mut place_of = |name: &&str| {
            names.iter().position(|known| **known == **name).or_else(|| {
                names.push((*name).into());
                u8::try_from(names.len()).is_ok().then(|| names.len() - 1)
            })
        };
        let Some(places) = block
            .buses
            .iter()
            .map(&mut place_of)
            .collect::<Option<Vec<usize>>>()
        else {
            self.undecodable += 1;
            return Ok(true);
        };
        self.lost.resize(self.names.len(), 0);
        for (place, lost) in places.iter().zip(&block.lost) {
            self.lost[*place] = (*lost).max(self.lost[*place]);
        }
        let placed = block
            .iter()
            .map(|(bus, received)| (places[usize::from(bus)] as u8, received));
        self.frames.extend(placed);
        Ok(true)
    }
}
