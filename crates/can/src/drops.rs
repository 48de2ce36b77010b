//! What the kernel dropped because a socket's queue was full.

use ::socketcan::SocketOptions;
use nix::libc;

/// The index of the drop counter in what `SO_MEMINFO` gives (`SK_MEMINFO_DROPS` of `linux/sock_diag.h`).
const MEMINFO_DROPS: usize = 8;

/// The kernel's drop counter of one socket, as it was last seen: 32 bits that wrap, from zero when
/// the socket is new.
#[derive(Debug, Default)]
pub(crate) struct DropCounter {
    seen: u32,
}

impl DropCounter {
    /// Adds to `lost` what the counter has grown by. A reading older than one seen before adds
    /// nothing: a queued frame carries the count of the moment it was queued.
    pub(crate) fn take(&mut self, counter: u32, lost: &mut u64) {
        let new = counter.wrapping_sub(self.seen);
        if new <= u32::MAX / 2 {
            *lost += u64::from(new);
            self.seen = counter;
        }
    }

    /// Asks the kernel. By itself it tells only with the next frame that comes, if one comes.
    pub(crate) fn ask(&mut self, socket: &impl SocketOptions, lost: &mut u64) {
        let mut info = [0; 4 * (MEMINFO_DROPS + 1)];
        let read = socket.get_socket_option_bytes(libc::SOL_SOCKET, libc::SO_MEMINFO, &mut info);
        if let (Ok(read), Some((_, counter))) = (read, info.split_last_chunk())
            && read == info.len()
        {
            self.take(u32::from_ne_bytes(*counter), lost);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn growth_is_added_across_the_wrap_and_older_readings_are_not() {
        let mut counter = DropCounter { seen: u32::MAX - 5 };
        let mut lost = 0;
        for (reading, total) in [
            (u32::MAX - 5, 0),
            (u32::MAX, 5),
            (3, 9),
            (u32::MAX, 9),
            (3, 9),
            (10, 16),
        ] {
            counter.take(reading, &mut lost);
            assert_eq!(lost, total, "after {reading}");
        }
    }
}
