//! What display drivers receive from taxeld: the bytes, and the Rust reader of them.
//!
//! The format is specified in `docs/wire.md`; `python/taxel_reader.py` and `c/taxel_reader.h` read the same
//! bytes, and all three are checked against the files in `vectors/`.
//!
//! - Encoding: [`encode_image_payload`] and [`encode_raw_payload`] once per tick, [`Header`] once per reader.
//! - Decoding: [`decode`] and [`decode_packet`] take any bytes, borrow from them and never panic.
//! - Reading: [`Subscriber`] connects to a running daemon.
//!
//! Everything but [`reader`], [`connect_for_requests`], [`check_socket_folder`] and [`who_may_open`] is free of I/O, clocks and threads.
//!
//! ```
//! use taxel_wire::{Body, Header, Kind, decode_packet, encode_image_payload};
//!
//! let image = taxel_hand::TactileImage { width: 2, height: 1, pixels: vec![0, 255], ..Default::default() };
//! let mut payload = Vec::new();
//! encode_image_payload(&image, &mut payload).unwrap();
//! let mut packet = Header::new(Kind::Image, payload.len()).to_bytes().to_vec();
//! packet.extend_from_slice(&payload);
//!
//! let message = decode_packet(&packet).unwrap();
//! let Body::Image(view) = message.body else { panic!("not an image") };
//! assert_eq!(view.pixels(), [0, 255]);
//! ```

mod connect;
mod encode;
mod error;
mod fields;
mod format;
mod header;
mod hello;
mod image;
mod json_in_words;
mod message;
mod raw;
pub mod reader;
mod socket_access;
mod socket_folder;
pub mod status;
mod text;

pub use connect::connect_for_requests;
pub use encode::Encode;
pub use error::{DecodeError, EncodeError};
pub use format::{HEADER_LEN, MAGIC, MAJOR, MAX_MESSAGE, MINOR};
pub use header::{Flags, Header, Kind};
pub use hello::{
    Clock, Hello, HelloModule, HelloProfile, HelloProtocol, HelloRate, HelloTaxel, HelloText, Subscription,
};
pub use image::{ImageView, WireActuator, encode_image_payload, image_payload_len};
pub use json_in_words::json_in_words;
pub use message::{Body, Message, decode, decode_packet};
pub use raw::{RawTaxel, RawView, encode_raw_payload, raw_payload_len};
pub use reader::{ReadError, Received, Subscriber};
pub use socket_access::who_may_open;
pub use socket_folder::{UntrustedFolder, check_socket_folder};
pub use status::Status;
pub use text::{
    Event, EventKind, LEAST_RATE_HZ, MAX_MARK, MAX_SUBSCRIBE, MAX_TEXT, Subscribe, SubscribeError, TEXT_PART,
    TextParts, split_text,
};

/// The examples of the README compile, and those that can run do.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
