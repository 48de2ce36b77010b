//! The format's fixed numbers.

/// The first four bytes of every message.
pub const MAGIC: [u8; 4] = *b"TCT1";
/// Major version: readers refuse any other.
pub const MAJOR: u8 = 1;
/// Minor version: grows when something is added that older readers pass over.
pub const MINOR: u8 = 1;
/// Length of this version's header in bytes, and the least a header may have.
pub const HEADER_LEN: usize = 40;
/// The most bytes a message may have, header included.
///
/// A Linux Unix socket carries it with `SO_SNDBUF` set to 212992, the default `net.core.wmem_max`. It is
/// enough for the raw counts of 20,000 taxels, and for those of 12,000 with their baselines.
pub const MAX_MESSAGE: usize = 409_600;
