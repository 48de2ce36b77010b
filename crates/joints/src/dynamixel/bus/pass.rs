//! One request and the answers to it.

use crate::dynamixel::protocol2::{FAST_BLOCK_OVERHEAD, PREFIX_BYTES, STATUS_OVERHEAD, StatusError};

/// What a request asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Positions; every servo answers with its own packet.
    Plain,
    /// Positions; all servos answer in one packet.
    Fast,
    /// One servo, for something slower.
    Slow(super::slow::Task),
    /// Servos are asked for their watchdogs, before their motors are told to move.
    Watchdog,
    /// One or several servos are told something in one packet, which nobody answers.
    Told,
    /// Those are asked what they hold.
    ReadBack,
}

/// How far a servo's answer has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Answer {
    Awaited,
    Damaged,
    Got,
}

/// One request: who was asked, in which order, and who has answered.
#[derive(Debug, Clone)]
pub(crate) struct Pass {
    pub(crate) kind: Kind,
    /// Indices of the servos asked, in the order in which they answer.
    pub(crate) order: Vec<usize>,
    pub(crate) answers: Vec<Answer>,
    pub(crate) address: u16,
    pub(crate) data_bytes: u16,
    pub(crate) request_bytes: usize,
    /// Whether the request has been sent, and when.
    pub(crate) sent_ns: Option<u64>,
    /// When bytes came last since.
    pub(crate) heard_ns: Option<u64>,
    /// How long all of it takes on the wire.
    pub(crate) wire_ns: u64,
    /// The one packet of a fast reply has come to its end, good or not.
    pub(crate) fast_done: bool,
    /// An answer said that a servo does not know the instruction.
    pub(crate) fast_refused: bool,
    /// It was left before its deadline, since motors are to be off: who has not answered was not silent.
    pub(crate) left: bool,
    /// The error number of a servo that refused to tell its watchdog, or what it holds.
    pub(crate) refused: Option<StatusError>,
    /// How many of those that were told something have not said that they hold it; what they were told is in front of all else.
    pub(crate) told: usize,
    /// Whether each servo that was told something holds it, as all its answers say; `None` before one does.
    pub(crate) held: Vec<Option<bool>>,
}

impl Pass {
    pub(crate) fn new(servos: usize) -> Self {
        Self {
            kind: Kind::Plain,
            order: Vec::with_capacity(servos),
            answers: Vec::with_capacity(servos),
            address: 0,
            data_bytes: 0,
            request_bytes: 0,
            sent_ns: None,
            heard_ns: None,
            wire_ns: 0,
            fast_done: false,
            fast_refused: false,
            left: false,
            refused: None,
            told: 0,
            held: Vec::with_capacity(servos),
        }
    }

    /// Begins a pass for the servos in `order`.
    pub(crate) fn begin(&mut self, kind: Kind, address: u16, data_bytes: u16) {
        self.kind = kind;
        self.address = address;
        self.data_bytes = data_bytes;
        self.answers.clear();
        self.answers.resize(self.order.len(), Answer::Awaited);
        self.sent_ns = None;
        self.fast_done = false;
        self.fast_refused = false;
        self.left = false;
        self.refused = None;
        self.held.clear();
        self.held.resize(self.order.len(), None);
    }

    /// Bytes that one servo puts on the wire.
    pub(crate) fn answer_bytes(&self) -> usize {
        match self.kind {
            Kind::Fast => usize::from(self.data_bytes) + FAST_BLOCK_OVERHEAD,
            _ => usize::from(self.data_bytes) + STATUS_OVERHEAD,
        }
    }

    /// Bytes on the wire before the answer at this position begins, the request included.
    pub(crate) fn bytes_before(&self, position: usize) -> usize {
        let head = if self.kind == Kind::Fast {
            PREFIX_BYTES + 1
        } else {
            0
        };
        self.request_bytes + head + position * self.answer_bytes()
    }

    /// Whether nothing more is expected.
    pub(crate) fn is_complete(&self) -> bool {
        match self.kind {
            Kind::Fast => self.fast_done,
            Kind::Told => true,
            _ => self.answers.iter().all(|a| *a != Answer::Awaited),
        }
    }

    pub(crate) fn position_of(&self, servo: usize) -> Option<usize> {
        self.order.iter().position(|s| *s == servo)
    }

    /// Whether the servo at this position was silent for sure: it had its time, and did not answer though
    /// one behind it did, or it is the first in the row of those at the end that did not. Those behind
    /// it may only have waited for it.
    pub(crate) fn is_silent(&self, position: usize) -> bool {
        !self.left && self.answers[position] == Answer::Awaited && position <= self.first_unheard()
    }

    /// Position behind the last servo that answered.
    fn first_unheard(&self) -> usize {
        self.answers
            .iter()
            .rposition(|a| *a != Answer::Awaited)
            .map_or(0, |last| last + 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_first_of_those_never_heard_is_blamed() {
        use Answer::{Awaited, Damaged, Got};
        for (answers, silent) in [
            (&[Got, Got, Got][..], &[][..]),
            (&[Got, Awaited, Got], &[1]),
            (&[Got, Awaited, Awaited], &[1]),
            (&[Awaited, Awaited, Awaited], &[0]),
            (&[Awaited, Damaged, Awaited, Awaited], &[0, 2]),
        ] {
            let mut pass = Pass::new(4);
            pass.order.extend(0..answers.len());
            pass.begin(Kind::Plain, 124, 12);
            pass.answers.copy_from_slice(answers);
            let found: Vec<usize> = (0..answers.len()).filter(|p| pass.is_silent(*p)).collect();
            assert_eq!(found, silent, "{answers:?}");
        }
    }
}
