//! What the daemon of an MCAP recording did while that was made: new calibrations, pauses, and that it was started anew.

use super::calibrated::{calibrated, is_of_it, window_ns};
use super::head::Head;
use std::collections::VecDeque;
use taxel_config::Config;
use taxel_engine::Change;
use taxel_recorder::{Item, RecordedFrame, RecordingReader, Topic, event_name, read_event};
use taxel_wire::EventKind;

/// What the daemon did, and from when on, nanoseconds.
pub type DaemonChange = (u64, Box<Change>);

/// Frames that are farther apart are not of one stretch, nanoseconds: the daemon may have calibrated in between, unseen.
const GAP_NS: u64 = 1_000_000_000;

/// How far daemon and recorder may be apart in when a frame came, nanoseconds: on a network each has a copy of its own.
const APART_NS: u64 = 5_000_000;

/// Finds in the messages of a recording, as they come, what its daemon did. Times are those of its frames.
#[derive(Debug)]
pub struct DaemonChanges {
    taxels: usize,
    /// Whether the daemon calibrated as is done here.
    is_of_it: bool,
    gap_ns: u64,
    last: Option<Last>,
    /// From when on no frame has had a contact; none where the newest has one.
    free_ns: Option<u64>,
    /// When the daemon last said that it is paused, until a contact is seen behind it.
    paused_ns: Option<u64>,
    /// Whether it has not said since that it goes on.
    is_paused: bool,
    /// Whether it said that it is paused, and no frame has come since.
    has_just_paused: bool,
    changes: VecDeque<DaemonChange>,
}

/// What is remembered of a frame.
#[derive(Debug, Clone, Copy)]
struct Last {
    seq: u64,
    t_ns: u64,
    wall_ns: u64,
    is_calibrating: bool,
}

impl DaemonChanges {
    /// The messages that it is found in.
    pub(crate) const TOPICS: [Topic; 2] = [Topic::Frames, Topic::Events];

    /// Of the recording that begins so, for this configuration: where the daemon calibrated otherwise, new calibrations are
    /// found, and not what they measured.
    pub fn new(head: &Head, config: &Config) -> anyhow::Result<Self> {
        Ok(Self {
            taxels: config.layout.len(),
            is_of_it: is_of_it(head, config)?,
            gap_ns: window_ns(config).max(GAP_NS),
            last: None,
            free_ns: None,
            paused_ns: None,
            is_paused: false,
            has_just_paused: false,
            changes: VecDeque::new(),
        })
    }

    /// All of a recording up to where its times go back, by the times that its frames have as
    /// [`recorded::frames`](crate::mcap::recorded::frames) reads them.
    pub fn of_frames(mut self, head: &Head) -> anyhow::Result<Vec<DaemonChange>> {
        let mut reader = RecordingReader::open(head.path(), &Self::TOPICS)?;
        let (mut first_ns, mut last_ns) = (None, 0);
        while reader.may_hold(Topic::Frames)
            && let Some(item) = reader.next_item()?
        {
            let Item::Message { topic, wall_ns, data } = item else {
                continue;
            };
            if let Some(frame) = RecordedFrame::read(data).filter(|_| topic == Topic::Frames) {
                if frame.t_ns < last_ns {
                    break;
                }
                last_ns = frame.t_ns;
                first_ns = first_ns.or_else(|| frame.has_values().then_some(frame.t_ns));
            }
            self.take(topic, wall_ns, data);
        }
        let first_ns = first_ns.unwrap_or_default();
        let changes = self.changes.into_iter();
        Ok(changes
            .map(|(t_ns, change)| (t_ns.saturating_sub(first_ns), change))
            .collect())
    }

    /// Takes a message of one of its topics; its time on the wall clock is in nanoseconds.
    pub(crate) fn take(&mut self, topic: Topic, wall_ns: u64, data: &[u8]) {
        match topic {
            Topic::Frames => {
                let frame = RecordedFrame::read(data);
                if let Some(frame) = frame.filter(|frame| frame.contacts().len() == self.taxels) {
                    self.take_frame(&frame, wall_ns);
                }
            }
            _ => {
                let kind = read_event(data).map(|(kind, _)| kind);
                let is_it = |wanted| kind == Some(event_name(wanted));
                if is_it(EventKind::Paused) || is_it(EventKind::Resumed) {
                    self.take_pause(is_it(EventKind::Paused), wall_ns);
                }
            }
        }
    }

    pub(crate) fn next(&mut self) -> Option<DaemonChange> {
        self.changes.pop_front()
    }

    fn take_frame(&mut self, frame: &RecordedFrame<'_>, wall_ns: u64) {
        let t_ns = frame.t_ns;
        let since_ns = self.last.map_or(t_ns, |last| t_ns.saturating_sub(last.t_ns));
        // A change is between two frames.
        let at_ns = t_ns.saturating_sub(APART_NS.min(since_ns / 2));
        let before = self.last.replace(Last {
            seq: frame.seq,
            t_ns,
            wall_ns,
            is_calibrating: frame.is_calibrating,
        });
        let is_anew = before.is_some_and(|before| frame.seq < before.seq);
        let is_behind_gap = before.is_some_and(|before| t_ns.saturating_sub(before.t_ns) > self.gap_ns);
        let has_contact = frame.contacts().any(|contact| contact);
        // A pause that was told behind the last frame of the daemon before is that of the next, which tells it at once.
        let is_over = !std::mem::take(&mut self.has_just_paused) && is_anew;
        // What it said of a pause may stand before frames that are older.
        match self.paused_ns {
            Some(paused_ns) if has_contact || is_over => {
                self.pause(false, at_ns);
                if t_ns > paused_ns || is_over {
                    (self.paused_ns, self.is_paused) = (None, false);
                }
            }
            Some(_) if self.free_ns.is_none() => self.pause(true, at_ns),
            _ => {}
        }
        if is_anew {
            self.free_ns = None;
        }
        match has_contact {
            true => self.free_ns = None,
            false => _ = self.free_ns.get_or_insert(at_ns),
        }
        let was_calibrating = before.is_some_and(|before| before.is_calibrating);
        if frame.is_calibrating && (!was_calibrating || is_anew || is_behind_gap) {
            self.changes.push_back((at_ns, Box::new(Change::Calibrating)));
        }
        let has_ended = was_calibrating || is_anew || is_behind_gap;
        if has_ended && !frame.is_calibrating && self.is_of_it && frame.baselines().len() > 0 {
            let change = Change::Calibrated(calibrated(frame));
            self.changes.push_back((at_ns, Box::new(change)));
        }
    }

    /// The daemon says so a moment later: a pause is from behind the last contact on, and up to the next.
    fn take_pause(&mut self, is_paused: bool, wall_ns: u64) {
        let last = self.last.map_or([0; 2], |last| [last.t_ns, last.wall_ns]);
        let said_ns = last[0].saturating_add(wall_ns.saturating_sub(last[1]));
        self.has_just_paused = is_paused;
        if is_paused == self.is_paused {
            return;
        }
        self.is_paused = is_paused;
        match is_paused {
            true => {
                self.paused_ns = Some(said_ns);
                self.pause(true, self.free_ns.unwrap_or(said_ns));
            }
            false => {
                self.pause(false, said_ns);
                self.free_ns = self.free_ns.map(|free_ns| free_ns.max(said_ns));
            }
        }
    }

    fn pause(&mut self, is_paused: bool, t_ns: u64) {
        self.changes
            .push_back((t_ns, Box::new(Change::Paused(is_paused))));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_hand::{ForceFrame, TactileFrame};
    use taxel_recorder::{event_message, frame_message};
    use taxel_wire::{Header, RawView, encode_raw_payload};

    const MS: u64 = 1_000_000;
    /// From the daemon's clock to the wall clock.
    const WALL_NS: u64 = 1_000_000 * MS;

    /// A message: its time, milliseconds, and what it tells.
    enum Told {
        /// A frame of this number; whether it is of a calibration, and has a contact.
        Frame(u64, bool, bool),
        Event(EventKind),
    }

    fn found(told: &[(u64, Told)]) -> Vec<(u64, &'static str)> {
        let mut changes = DaemonChanges {
            taxels: 1,
            is_of_it: true,
            gap_ns: 1500 * MS,
            last: None,
            free_ns: None,
            paused_ns: None,
            is_paused: false,
            has_just_paused: false,
            changes: VecDeque::new(),
        };
        for (t_ms, told) in told {
            let t_ns = t_ms * MS;
            let (topic, data) = match told {
                Told::Event(kind) => (
                    Topic::Events,
                    event_message(event_name(*kind), "", t_ns + WALL_NS),
                ),
                Told::Frame(seq, is_calibrating, has_contact) => {
                    let (mut tactile, mut force) = (TactileFrame::new(1), ForceFrame::new(1));
                    (tactile.seq, tactile.t_ns) = (*seq, t_ns);
                    (force.calibrating, force.contact[0]) = (*is_calibrating, *has_contact);
                    let mut payload = Vec::new();
                    let baselines = (!is_calibrating).then_some(&[[1.0; 3]][..]);
                    encode_raw_payload(&tactile, &force, baselines, &mut payload).unwrap();
                    let header = Header::of_frame(&tactile, &force, payload.len());
                    (
                        Topic::Frames,
                        frame_message(&header, &RawView::decode(&payload).unwrap()),
                    )
                }
            };
            changes.take(topic, t_ns + WALL_NS, &data);
        }
        let name = |change: &Change| match change {
            Change::Calibrating => "calibrating",
            Change::Calibrated(_) => "calibrated",
            Change::Paused(true) => "paused",
            Change::Paused(false) => "resumed",
        };
        let changes = changes.changes.iter();
        changes.map(|(t_ns, change)| (t_ns / MS, name(change))).collect()
    }

    use EventKind::{Paused, Resumed};
    use Told::{Event, Frame};

    #[test]
    fn a_new_calibration_begins_and_ends_between_two_frames() {
        let told = [
            (100, Frame(7, false, true)),
            (110, Frame(8, true, false)),
            (120, Frame(9, true, false)),
            (122, Frame(10, false, false)),
        ];
        assert_eq!(found(&told), [(105, "calibrating"), (121, "calibrated")]);
    }

    #[test]
    fn what_a_daemon_that_began_anew_or_was_not_seen_for_long_had_calibrated_holds() {
        let told = [
            (100, Frame(7, true, false)),
            // Killed while it calibrated, and again.
            (900, Frame(0, true, false)),
            (910, Frame(1, false, false)),
            (1500, Frame(0, false, false)),
            (3000, Frame(1, false, false)),
            (4510, Frame(2, false, false)),
        ];
        let wanted = [
            (95, "calibrating"),
            (895, "calibrating"),
            (905, "calibrated"),
            (1495, "calibrated"),
            (4505, "calibrated"),
        ];
        assert_eq!(found(&told), wanted);
    }

    #[test]
    fn frames_may_come_behind_what_was_said_later() {
        let told = [
            (100, Frame(0, false, true)),
            (200, Event(Paused)),
            (110, Frame(1, false, true)),
            (120, Frame(2, false, false)),
            (300, Event(Resumed)),
            (280, Frame(3, false, true)),
        ];
        let wanted = [
            (200, "paused"),
            (105, "resumed"),
            (115, "paused"),
            (300, "resumed"),
            (275, "resumed"),
        ];
        assert_eq!(found(&told), wanted);
    }

    #[test]
    fn a_pause_is_from_behind_the_last_contact_to_the_next() {
        let told = [
            (100, Frame(0, false, true)),
            (110, Frame(1, false, false)),
            (200, Frame(20, false, false)),
            (205, Event(Paused)),
            (210, Frame(21, false, false)),
            (220, Frame(22, false, true)),
            (300, Event(Resumed)),
            // Twice, in which nothing touches the hand.
            (310, Frame(30, false, false)),
            (400, Event(Paused)),
            (500, Event(Resumed)),
            (600, Event(Paused)),
            (700, Event(Paused)),
            (790, Frame(31, false, false)),
            // The daemon that begins anew is not paused.
            (800, Frame(0, false, false)),
        ];
        let wanted = [
            (105, "paused"),
            (215, "resumed"),
            (305, "paused"),
            (500, "resumed"),
            (500, "paused"),
            (795, "resumed"),
            (795, "calibrated"),
        ];
        assert_eq!(found(&told), wanted);
    }

    #[test]
    fn a_pause_that_a_daemon_told_before_its_first_frame_holds() {
        let told = |was_paused: bool| {
            let before = if was_paused { Paused } else { Resumed };
            [
                (100, Frame(7, false, true)),
                (150, Event(before)),
                (160, Frame(8, false, false)),
                (200, Frame(9, false, false)),
                (300, Event(Paused)),
                (310, Frame(0, true, false)),
                (320, Frame(1, true, false)),
                (330, Frame(2, false, true)),
                (400, Frame(3, false, false)),
            ]
        };
        let pauses = |told: &[(u64, Told)]| {
            let mut found = found(told);
            found.retain(|(_, what)| ["paused", "resumed"].contains(what));
            found
        };
        // From behind its last contact, as far as is known, to the first of the next.
        assert_eq!(pauses(&told(false)), [(155, "paused"), (325, "resumed")]);
        // The daemon before it was paused as well.
        assert_eq!(
            pauses(&told(true)),
            [(150, "paused"), (155, "paused"), (325, "resumed")]
        );
    }
}
