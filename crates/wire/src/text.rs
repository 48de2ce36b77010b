//! Messages in JSON: what a client asks for, what it is told, and long texts in several packets.

use crate::error::DecodeError;
use crate::format::{HEADER_LEN, MAX_MESSAGE};
use crate::header::{Flags, Header, Kind};
use crate::json_in_words::json_in_words;
use crate::message::{Body, decode_packet};
use serde::{Deserialize, Serialize};
use taxel_hand::{FromMap, Profile, ProfileError};

/// The most bytes a SUBSCRIBE packet may have, header included. The longest that makes sense states 255 levels, 256
/// places and the parts of a large hand: some 20,000.
pub const MAX_SUBSCRIBE: usize = 32_768;
/// The most bytes of text a reader puts together from its parts.
pub const MAX_TEXT: usize = 8 << 20;
/// Bytes of text in one packet, unless told otherwise: so few that it fits a socket whose send
/// buffer was made as small as Linux allows, for the sake of fresh images.
pub const TEXT_PART: usize = 8000;
/// The lowest rate that a client may ask for, messages per second: one in a quarter of an hour.
pub const LEAST_RATE_HZ: f64 = 0.001;
/// The most bytes of text in a mark.
pub const MAX_MARK: usize = 500;

/// What a client wants to be sent. Without a subscription it is sent every image; a later one
/// replaces the one before.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Subscribe {
    /// IMAGE messages; true unless said otherwise.
    pub image: bool,
    /// RAW messages.
    pub raw: bool,
    /// STATUS messages.
    pub status: bool,
    /// Every image and raw frame that is asked for, in order, from a queue, instead of the newest;
    /// for recorders and analyses. It goes with no `max_rate_hz`. Daemons of version 1.0 refuse the
    /// key, so it is not sent where false.
    #[serde(skip_serializing_if = "is_false")]
    pub every: bool,
    /// The most images, and the most raw frames, per second on average, from [`LEAST_RATE_HZ`] on; absent or null for
    /// every one. Each is sent when it is made or not at all.
    pub max_rate_hz: Option<f64>,
    /// What this subscriber's display can do; absent or null for the daemon's own profile.
    #[serde(
        skip_serializing_if = "Option::is_none",
        deserialize_with = "FromMap::optional"
    )]
    pub profile: Option<Profile>,
    /// The parts of the hand that this subscriber is shown, as the layout names them; absent or null for all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub region: Option<Vec<String>>,
}

impl Default for Subscribe {
    fn default() -> Self {
        Self {
            image: true,
            raw: false,
            status: false,
            every: false,
            max_rate_hz: None,
            profile: None,
            region: None,
        }
    }
}

/// Why a client's packet is no subscription. The text is fit for the EVENT that answers it.
#[derive(Debug, thiserror::Error)]
pub enum SubscribeError {
    /// Longer than a subscription may be.
    #[error("a client's message may have {MAX_SUBSCRIBE} bytes; this one has more")]
    TooLong {
        /// Bytes of the packet, as far as they were received.
        len: usize,
    },
    /// Not a message at all.
    #[error("not understood: {0}")]
    Decode(#[from] DecodeError),
    /// A message of another type.
    #[error(
        "a client may send SUBSCRIBE (type 16) only, and this is type {number}; commands go to the control socket"
    )]
    WrongKind {
        /// Number of the type.
        number: u16,
    },
    /// Not the JSON of a subscription, or an unknown key.
    #[error("subscription: {}", json_in_words(.0))]
    Json(#[from] serde_json::Error),
    /// A rate that is no rate.
    #[error("subscription: max_rate_hz = {max_rate_hz} must be a number from {LEAST_RATE_HZ} on")]
    Rate {
        /// The rate asked for.
        max_rate_hz: f64,
    },
    /// Every frame, and at most some of them.
    #[error(
        "subscription: every = true asks for all frames and max_rate_hz = {max_rate_hz} for fewer; leave one of them out"
    )]
    EveryAtRate {
        /// The rate asked for.
        max_rate_hz: f64,
    },
    /// A profile that describes no display.
    #[error("subscription: {0}")]
    Profile(#[from] ProfileError),
}

impl Subscribe {
    /// Reads what a client sent: a whole packet.
    pub fn from_packet(packet: &[u8]) -> Result<Self, SubscribeError> {
        if packet.len() > MAX_SUBSCRIBE {
            return Err(SubscribeError::TooLong { len: packet.len() });
        }
        // What it is, before what is wrong inside it.
        let kind = Header::decode(packet)?.kind;
        if kind != Kind::Subscribe {
            return Err(SubscribeError::WrongKind {
                number: kind.number(),
            });
        }
        let message = decode_packet(packet)?;
        match message.body {
            Body::Subscribe(text) => Self::parse(text),
            _ => Err(SubscribeError::WrongKind {
                number: message.header.kind.number(),
            }),
        }
    }

    /// Reads the text of a SUBSCRIBE; refuses unknown keys, and a profile that no display has.
    /// Whether the hand has the parts of the region is for the daemon to say.
    pub fn parse(text: &[u8]) -> Result<Self, SubscribeError> {
        let FromMap(subscribe): FromMap<Self> = serde_json::from_slice(text)?;
        subscribe.profile.as_ref().map_or(Ok(()), Profile::check)?;
        match subscribe.max_rate_hz {
            Some(max_rate_hz) if !(max_rate_hz.is_finite() && max_rate_hz >= LEAST_RATE_HZ) => {
                Err(SubscribeError::Rate { max_rate_hz })
            }
            Some(max_rate_hz) if subscribe.every => Err(SubscribeError::EveryAtRate { max_rate_hz }),
            _ => Ok(subscribe),
        }
    }

    /// The packet to send.
    pub fn to_packet(&self) -> Vec<u8> {
        packet(Header::new(Kind::Subscribe, 0), &to_json(self))
    }
}

fn is_false(value: &bool) -> bool {
    !value
}

/// Something the daemon tells people: why it disconnects, what happens to the hand.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Event {
    /// What happened.
    pub event: EventKind,
    /// A sentence for people.
    pub message: String,
}

/// What happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum EventKind {
    /// What the client sent was not understood and has no effect.
    Refused,
    /// The daemon closes this connection after this message.
    Disconnect,
    /// The baseline is being measured; images are empty until it is done.
    Calibrating,
    /// The baseline has been measured.
    Calibrated,
    /// Images show no contact, so that displays let go, until the daemon is told to resume.
    Paused,
    /// Images show what the hand feels again.
    Resumed,
    /// A mark that somebody made: the sentence is its text, at most [`MAX_MARK`] bytes; `t_ns` and
    /// `seq` of the header say when.
    Mark,
    /// Anything else worth showing.
    Notice,
    /// A kind of a later version.
    #[serde(other)]
    Other,
}

impl Event {
    /// An event with its sentence.
    pub fn new(event: EventKind, message: impl Into<String>) -> Self {
        Self {
            event,
            message: message.into(),
        }
    }

    /// The packet to send; `seq` and `t_ns` are those of the newest frame, and of a mark `t_ns` is
    /// the instant it was made. A sentence longer than 1000 bytes is cut.
    pub fn to_packet(&self, seq: u64, t_ns: u64) -> Vec<u8> {
        // JSON escapes a byte to at most six.
        let mut cut = self.message.len().min(TEXT_PART / 8);
        while !self.message.is_char_boundary(cut) {
            cut -= 1;
        }
        let event = Self::new(self.event, &self.message[..cut]);
        let header = Header {
            seq,
            t_ns,
            ..Header::new(Kind::Event, 0)
        };
        packet(header, &to_json(&event))
    }

    /// Reads the text of an EVENT.
    pub fn parse(text: &[u8]) -> Result<Self, serde_json::Error> {
        serde_json::from_slice(text)
    }
}

/// Cuts the text of a HELLO, STATUS, EVENT, TOUCH or ESTIMATE into messages of at most `part_len`
/// bytes of text each.
///
/// All but the last carry [`Flags::MORE`]; they are sent with nothing in between. An empty text makes one
/// message. A `part_len` of 0, or one too long for a message, is corrected to the nearest that works.
pub fn split_text(kind: Kind, text: &[u8], part_len: usize, seq: u64, t_ns: u64) -> TextParts<'_> {
    TextParts {
        rest: Some(text),
        part_len: part_len.clamp(1, MAX_MESSAGE - HEADER_LEN),
        header: Header {
            seq,
            t_ns,
            ..Header::new(kind, 0)
        },
    }
}

/// The messages of a text: a header and its part of the text, in order. Made by [`split_text`].
#[derive(Debug, Clone)]
pub struct TextParts<'a> {
    rest: Option<&'a [u8]>,
    part_len: usize,
    header: Header,
}

impl<'a> Iterator for TextParts<'a> {
    type Item = (Header, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        let rest = self.rest.take()?;
        let (part, after) = rest.split_at(rest.len().min(self.part_len));
        let more = !after.is_empty();
        if more {
            self.rest = Some(after);
        }
        let header = Header {
            payload_len: part.len() as u32,
            flags: Flags::NONE.with(Flags::MORE, more),
            ..self.header
        };
        Some((header, part))
    }
}

pub(crate) fn split_json(kind: Kind, text: &[u8], seq: u64, t_ns: u64) -> Vec<Vec<u8>> {
    split_text(kind, text, TEXT_PART, seq, t_ns)
        .map(|(header, part)| packet(header, part))
        .collect()
}

pub(crate) fn to_json<T: Serialize>(value: &T) -> Vec<u8> {
    serde_json::to_vec(value).expect("structs of numbers, strings and lists always serialise")
}

fn packet(header: Header, payload: &[u8]) -> Vec<u8> {
    let header = Header {
        payload_len: payload.len() as u32,
        ..header
    };
    [&header.to_bytes(), payload].concat()
}
