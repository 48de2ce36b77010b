//! What of a file could not be read: bytes that are damaged, and an end that is missing.

use std::fmt;
use taxel_hand::plural;

/// Places of a file that are named; a file of one place in each megabyte is not listed whole.
const MOST_NAMED: usize = 4;

/// What of a recording could not be read, in the order of the file.
#[derive(Debug, Default)]
pub(crate) struct LeftOut {
    /// Damaged records that were passed over: their first byte, that behind the last, and what is wrong.
    damaged: Vec<(u64, u64, String)>,
    /// Chunks that are compressed in a way of which nothing is known here, and the name of the first one's.
    unknown: Option<(String, usize)>,
    /// From where on nothing was read.
    end: Option<End>,
    /// Messages whose topic stood in what was passed over.
    pub(crate) of_no_topic: u64,
}

#[derive(Debug)]
enum End {
    /// It ends in the middle of a record.
    Torn,
    /// The same, behind all of its messages.
    TornBehindAll,
    /// Where the next record begins is not known.
    Lost { at: u64, behind: u64, why: String },
    /// It was read to its end, and the checksum of all of it does not fit.
    Unsound,
}

impl LeftOut {
    /// A record whose content is damaged.
    pub(crate) fn record(&mut self, from: u64, to: u64, why: String) {
        self.damaged.push((from, to, why));
    }

    /// A chunk whose compression, of this name, is not read.
    pub(crate) fn compressed(&mut self, name: String) {
        self.unknown.get_or_insert((name, 0)).1 += 1;
    }

    /// The file has no end: whoever wrote it was interrupted.
    pub(crate) fn torn(&mut self) {
        self.end = Some(End::Torn);
    }

    /// It has all of its messages, and its index has no end.
    pub(crate) fn torn_behind_all(&mut self) {
        self.end = Some(End::TornBehindAll);
    }

    /// A record whose length is damaged, behind which nothing is found, in a file of so many bytes.
    pub(crate) fn lost(&mut self, at: u64, len: u64, why: String) {
        let is_of_it = |(_, to, _): &mut (u64, u64, String)| *to == at;
        // That of the record before it, then, which seemed to be damaged.
        let at = self.damaged.pop_if(is_of_it).map_or(at, |(from, ..)| from);
        let behind = len.saturating_sub(at);
        self.end = Some(End::Lost { at, behind, why });
    }

    /// The checksum of the whole does not fit.
    pub(crate) fn unsound(&mut self) {
        self.end = Some(End::Unsound).filter(|_| self.damaged.is_empty());
    }

    /// A sentence on each of them; none where the recording is whole.
    pub(crate) fn sentences(&self) -> Vec<String> {
        let mut sentences = Vec::new();
        for (from, to, why) in self.damaged.iter().take(MOST_NAMED) {
            sentences.push(format!(
                "bytes {from} to {} are damaged ({why}) and left out",
                to - 1
            ));
        }
        if self.damaged.len() > MOST_NAMED {
            let others = &self.damaged[MOST_NAMED..];
            let bytes: u64 = others.iter().map(|(from, to, _)| to - from).sum();
            sentences.push(format!(
                "{bytes} bytes in {} other places are damaged, too, and left out",
                others.len()
            ));
        }
        if let Some((name, chunks)) = &self.unknown {
            sentences.push(format!(
                "{} left out, compressed with {name:?}; what is not compressed is read, and lz4 and zstd",
                plural(*chunks, "chunk")
            ));
        }
        if self.of_no_topic > 0 {
            sentences.push(format!(
                "{} messages are left out, since what they are about stood in what is left out",
                self.of_no_topic
            ));
        }
        sentences.extend(self.end.as_ref().map(ToString::to_string));
        sentences
    }
}

impl fmt::Display for End {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Torn => f.write_str("torn off (it ends in the middle); read to its last whole chunk"),
            Self::TornBehindAll => f.write_str("torn off behind its last message; all of it was read"),
            Self::Lost { at, behind, why } => {
                write!(
                    f,
                    "damaged at byte {at} ({why}), {behind} bytes behind it not read"
                )
            }
            Self::Unsound => {
                f.write_str("some byte of it is damaged: its checksum does not fit; all of it was read")
            }
        }
    }
}
