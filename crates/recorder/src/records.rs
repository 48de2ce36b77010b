//! What the records of a recording hold.

use crate::schema::Topic;
use crate::writer::Attached;
use mcap::records::op;
use std::collections::HashMap;

/// Characters of the name of a damaged file that are told.
const LONGEST_NAME: usize = 40;

/// What a record is to the reader.
pub(crate) enum Found {
    Message(Topic, u64),
    Attached(Attached),
    /// An attached file that is damaged: its name, as far as it can be read.
    Damaged(String),
    Channel(u16, Option<Topic>),
    NoTopic,
    End,
    Other,
}

/// Takes a record; a message's bytes are put into `message`. None where the record is cut off.
pub(crate) fn look(
    opcode: u8,
    data: &[u8],
    channels: &HashMap<u16, Option<Topic>>,
    message: &mut Vec<u8>,
) -> Option<Found> {
    let mut fields = Fields(data);
    Some(match opcode {
        op::MESSAGE => {
            let (channel, _sequence, wall_ns, _published_ns) =
                (fields.u16()?, fields.u32()?, fields.u64()?, fields.u64()?);
            match channels.get(&channel) {
                Some(Some(topic)) => {
                    message.clear();
                    message.extend_from_slice(fields.0);
                    Found::Message(*topic, wall_ns)
                }
                Some(None) => Found::Other,
                None => Found::NoTopic,
            }
        }
        op::CHANNEL => {
            let (id, topic, _) = channel(fields)?;
            Found::Channel(id, topic)
        }
        op::ATTACHMENT => attached(data),
        op::DATA_END => Found::End,
        _ => Found::Other,
    })
}

/// A file that is attached, if it is as it was when it was attached.
fn attached(record: &[u8]) -> Found {
    let (mut fields, mut name) = (Fields(record), String::new());
    let mut read = || {
        let (_logged_ns, _created_ns) = (fields.u64()?, fields.u64()?);
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        name = text(fields.text()?);
        let media_type = text(fields.text()?);
        let len = usize::try_from(fields.u64()?).ok()?;
        let data = fields.take(len)?.to_vec();
        // The reader of the format takes for granted that it is there.
        let _checksum = fields.u32()?;
        Some((media_type, data))
    };
    let read = read().filter(|_| mcap::parse_record(op::ATTACHMENT, record).is_ok());
    match read {
        Some((media_type, data)) => Found::Attached(Attached {
            name,
            media_type,
            data,
        }),
        None => Found::Damaged(name.chars().take(LONGEST_NAME).collect()),
    }
}

/// The number of a channel, which of our topics it is, and what it is called.
pub(crate) fn channel(mut fields: Fields<'_>) -> Option<(u16, Option<Topic>, String)> {
    let (id, _schema) = (fields.u16()?, fields.u16()?);
    let (name, encoding) = (fields.text()?, fields.text()?);
    let topic = Topic::ALL
        .into_iter()
        .find(|topic| topic.name().as_bytes() == name);
    let name = String::from_utf8_lossy(name).into_owned();
    Some((id, topic.filter(|_| encoding == b"cdr"), name))
}

/// The fields of a record, one after the other.
pub(crate) struct Fields<'a>(pub(crate) &'a [u8]);

impl<'a> Fields<'a> {
    pub(crate) fn take(&mut self, len: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(len)?;
        self.0 = rest;
        Some(taken)
    }

    pub(crate) fn number<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.take(N)?.try_into().ok()
    }

    pub(crate) fn u16(&mut self) -> Option<u16> {
        self.number().map(u16::from_le_bytes)
    }

    pub(crate) fn u32(&mut self) -> Option<u32> {
        self.number().map(u32::from_le_bytes)
    }

    pub(crate) fn u64(&mut self) -> Option<u64> {
        self.number().map(u64::from_le_bytes)
    }

    pub(crate) fn text(&mut self) -> Option<&'a [u8]> {
        let len = self.u32()? as usize;
        self.take(len)
    }
}
