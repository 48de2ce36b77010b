//! MCAP recordings of a running hand: what is in them, how they are written beside the daemon, and how they are read.
//!
//! A recording holds raw CAN from sockets of its own, every tactile frame and image that the daemon made, joints, marks
//! and events, what was wrong, and the configuration. All messages are ROS 2's encoding (CDR) with their definitions in
//! the file, so that stock tools read them; `docs/recordings.md` has the list.
//!
//! - [`RecordingWriter`], [`RecordingReader`]: a file, one way and the other.
//! - [`Store`]: what comes, into files that are split, or only around a trigger.
//! - [`record`]: the threads that read a hand and write it.
//! - [`Translation`]: from what a daemon sends to messages, for others who send these on.

mod can_block;
mod can_reader;
mod cdr;
mod gone;
mod left_out;
mod live;
mod reader;
mod records;
mod roomy_file;
mod schema;
mod series;
mod standard;
mod store;
mod store_error;
mod tactile;
mod translation;
mod writer;
mod zstd;

pub use can_block::{CanBlock, CanFrames};
pub use can_reader::CanReader;
pub use gone::Gone;
pub use live::{CanInput, CanRead, Described, Finished, LiveError, Plan, Signals, record};
pub use reader::{Item, ReadError, RecordingReader};
pub use schema::Topic;
pub use series::{numbered_beside, parts};
pub use standard::{clock_message, event_message, event_name, read_event, read_text, text_message};
pub use store::{Around, Split, Store, Written};
pub use store_error::StoreError;
pub use tactile::{RecordedFrame, frame_message, image_message, read_image};
pub use translation::{Taker, Translation};
pub use writer::{Attached, Entry, Preamble, RecordingWriter};
