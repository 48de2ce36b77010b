//! What a client was sent and has not read yet, as far as it is known.
//!
//! What a socket takes a client has not read: the buffers of two kernels lie between, which hold seconds of a hand, and half a
//! minute for who reads slowly. So a ping goes behind every so many bytes, which a client answers when it has read up to there.

use std::time::{Duration, Instant};

/// Bytes between two pings.
const A_PING: u64 = 32 << 10;
/// Bytes that may be on their way, and what is sent with the last of them.
const MOST: u64 = 128 << 10;

/// Bytes on their way to a client.
#[derive(Debug)]
pub(crate) struct Flight {
    /// Bytes sent, those up to the newest ping, and those that the client has read.
    sent: u64,
    pinged: u64,
    read: u64,
    /// When it last read something, or had nothing to read.
    moved: Instant,
}

impl Flight {
    pub(crate) fn new(now: Instant) -> Self {
        Self {
            sent: 0,
            pinged: 0,
            read: 0,
            moved: now,
        }
    }

    /// Counts what is sent; returns what a ping behind it says, where one is due.
    pub(crate) fn send(&mut self, bytes: usize, now: Instant) -> Option<[u8; 8]> {
        self.sent += bytes as u64;
        if self.sent - self.pinged < A_PING {
            return None;
        }
        if self.pinged == self.read {
            self.moved = now;
        }
        self.pinged = self.sent;
        Some(self.sent.to_le_bytes())
    }

    /// The client answers a ping. What it says is its own: nothing is believed that was not sent.
    pub(crate) fn is_answered(&mut self, pong: &[u8], now: Instant) {
        let Ok(read) = pong.try_into().map(u64::from_le_bytes) else {
            return;
        };
        if (self.read + 1..=self.pinged).contains(&read) {
            self.read = read;
            self.moved = now;
        }
    }

    /// Whether nothing more is to be sent until a ping is answered.
    pub(crate) fn is_full(&self) -> bool {
        self.sent - self.read >= MOST
    }

    /// For how long it has read nothing of what it was sent.
    pub(crate) fn stands(&self, now: Instant) -> Duration {
        match self.pinged == self.read {
            true => Duration::ZERO,
            false => now.saturating_duration_since(self.moved),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: Duration = Duration::from_secs(1);

    #[test]
    fn so_much_is_sent_until_pings_are_answered() {
        let begun = Instant::now();
        let mut flight = Flight::new(begun);
        let mut pings = Vec::new();
        while !flight.is_full() {
            pings.extend(flight.send(10_000, begun));
        }
        assert_eq!(flight.sent, 140_000);
        assert_eq!(
            pings.iter().map(|p| u64::from_le_bytes(*p)).collect::<Vec<_>>(),
            [40_000, 80_000, 120_000]
        );
        flight.is_answered(&pings[0], begun);
        assert!(!flight.is_full());
        // One that answers the newest alone has read the others.
        flight.is_answered(&pings[2], begun);
        flight.is_answered(&pings[1], begun);
        assert_eq!(flight.read, 120_000);
    }

    #[test]
    fn who_reads_slowly_does_not_stand_and_who_has_nothing_to_read_does_not_either() {
        let begun = Instant::now();
        let mut flight = Flight::new(begun);
        assert!(flight.send(100, begun).is_none());
        assert_eq!(flight.stands(begun + 9 * S), Duration::ZERO);
        let [first, second] = [0, 0].map(|_| flight.send(40_000, begun + 10 * S).unwrap());
        assert_eq!(flight.stands(begun + 14 * S), 4 * S);
        flight.is_answered(&first, begun + 14 * S);
        assert_eq!(flight.stands(begun + 16 * S), 2 * S);
        flight.is_answered(&second, begun + 16 * S);
        assert_eq!(flight.stands(begun + 60 * S), Duration::ZERO);
    }

    #[test]
    fn an_answer_to_what_was_not_asked_changes_nothing() {
        let begun = Instant::now();
        let mut flight = Flight::new(begun);
        let ping = flight.send(200_000, begun).unwrap();
        for pong in [&b""[..], &[1; 7], &[0xFF; 8], &[0; 8], &200_001u64.to_le_bytes()] {
            flight.is_answered(pong, begun + S);
            assert!(flight.is_full() && flight.stands(begun + S) == S, "{pong:?}");
        }
        flight.is_answered(&ping, begun + S);
        assert!(!flight.is_full());
    }
}
