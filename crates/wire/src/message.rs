//! A whole message: header and payload.

use crate::error::DecodeError;
use crate::header::{Header, Kind};
use crate::image::ImageView;
use crate::raw::RawView;

/// A decoded message, borrowed from the bytes it came in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Message<'a> {
    /// Its header.
    pub header: Header,
    /// Its payload.
    pub body: Body<'a>,
}

/// The payload of a message. Text is JSON in UTF-8 that has not been looked at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Body<'a> {
    /// Text of a HELLO; see [`crate::Hello::parse`].
    Hello(&'a [u8]),
    /// A tactile image.
    Image(ImageView<'a>),
    /// Text of a status report.
    Status(&'a [u8]),
    /// Text of an event; see [`crate::Event::parse`].
    Event(&'a [u8]),
    /// Raw counts.
    Raw(RawView<'a>),
    /// Text of a completed touch.
    Touch(&'a [u8]),
    /// Text of an estimate.
    Estimate(&'a [u8]),
    /// Text of a subscription; see [`crate::Subscribe::parse`].
    Subscribe(&'a [u8]),
    /// Payload of a type that a later version defines.
    Unknown(&'a [u8]),
}

/// Decodes the message at the start of `bytes`, as on a stream, and tells how many bytes it has.
///
/// Total over any bytes: it neither panics nor allocates. Where the error's
/// [`DecodeError::needs_more`] holds, try again with more bytes.
pub fn decode(bytes: &[u8]) -> Result<(Message<'_>, usize), DecodeError> {
    let header = Header::decode(bytes)?;
    let expected = header.message_len();
    if bytes.len() < expected {
        return Err(DecodeError::Truncated {
            len: bytes.len(),
            expected,
        });
    }
    let payload = &bytes[usize::from(header.header_len)..expected];
    let body = match header.kind {
        Kind::Hello => Body::Hello(payload),
        Kind::Image => Body::Image(ImageView::decode(payload)?),
        Kind::Status => Body::Status(payload),
        Kind::Event => Body::Event(payload),
        Kind::Raw => Body::Raw(RawView::decode(payload)?),
        Kind::Touch => Body::Touch(payload),
        Kind::Estimate => Body::Estimate(payload),
        Kind::Subscribe => Body::Subscribe(payload),
        Kind::Other(_) => Body::Unknown(payload),
    };
    Ok((Message { header, body }, expected))
}

/// Decodes a packet, which holds exactly one message.
pub fn decode_packet(bytes: &[u8]) -> Result<Message<'_>, DecodeError> {
    let expected = Header::decode(bytes)?.message_len();
    if bytes.len() > expected {
        return Err(DecodeError::Trailing {
            expected,
            extra: bytes.len() - expected,
        });
    }
    decode(bytes).map(|(message, _)| message)
}
