//! Starts and stops an Allegro hand that no other program controls.

use super::config::AllegroConfig;
use taxel_can::CanFrame;

/// A hand that says nothing for this long is started again, nanoseconds.
const SILENCE_NS: u64 = 1_000_000_000;

/// Starts a hand whenever its bus comes up and whenever it has been silent for a second, and stops
/// it at the end. It sends nothing, ever, unless the configuration says `own_bus = true`.
#[derive(Debug, Clone)]
pub struct AllegroStarter {
    start: Vec<CanFrame>,
    stop: Vec<CanFrame>,
    /// Commands of `start`, or at the end of `stop`, that were handed out.
    sent: usize,
    is_up: bool,
    /// The newest could not be sent, and waits for the next round.
    is_held: bool,
    is_stopping: bool,
    heard_ns: Option<u64>,
    again_ns: u64,
}

impl AllegroStarter {
    /// A starter of this hand, whose bus is not up yet.
    pub fn new(config: &AllegroConfig) -> Self {
        Self {
            start: start_commands(config),
            stop: stop_commands(config),
            sent: 0,
            is_up: false,
            is_held: false,
            is_stopping: false,
            heard_ns: None,
            again_ns: 0,
        }
    }

    /// The hand sent an angle at `t_ns`.
    pub fn heard(&mut self, t_ns: u64) {
        self.heard_ns = self.heard_ns.max(Some(t_ns));
    }

    /// Whether its bus can be reached; to be told at every round, before its commands are asked
    /// for. One that comes back is started anew.
    pub fn handle_link(&mut self, is_up: bool) {
        self.is_up = is_up;
        self.is_held = false;
        if !is_up && !self.is_stopping {
            self.sent = 0;
            self.again_ns = 0;
        }
    }

    /// The next command, to be sent now.
    pub fn poll_command(&mut self, now_ns: u64) -> Option<CanFrame> {
        if self.is_stopping {
            let frame = self.stop.get(self.sent).copied();
            self.sent += usize::from(frame.is_some());
            return frame;
        }
        if !self.is_up || self.is_held || self.start.is_empty() {
            return None;
        }
        if self.sent == self.start.len() && now_ns >= self.due_ns() {
            self.sent = 0;
        }
        let frame = self.start.get(self.sent).copied()?;
        self.sent += 1;
        self.again_ns = now_ns.saturating_add(SILENCE_NS);
        Some(frame)
    }

    /// The newest command could not be sent. It is given again at the next round; one that stops
    /// the hand is not.
    pub fn command_not_sent(&mut self) {
        if !self.is_stopping {
            self.sent = self.sent.saturating_sub(1);
            self.is_held = true;
        }
    }

    /// When the next command is due, nanoseconds; `None` while none is, or while it is up to the bus.
    pub fn poll_due_ns(&self) -> Option<u64> {
        let is_waiting = self.is_up && !self.is_stopping && !self.start.is_empty();
        (is_waiting && self.sent == self.start.len()).then(|| self.due_ns())
    }

    /// From now on the commands are those that switch the hand off.
    pub fn stop(&mut self) {
        if !self.is_stopping {
            self.is_stopping = true;
            self.sent = 0;
        }
    }

    /// When a hand that was started and stays silent is started again.
    fn due_ns(&self) -> u64 {
        let silent_ns = self.heard_ns.map_or(0, |heard| heard.saturating_add(SILENCE_NS));
        self.again_ns.max(silent_ns)
    }
}

/// What has to be sent so that a hand without another controller reports its positions, in this
/// order; nothing unless `own_bus` is set.
///
/// For versions 1 to 3 it is the start of the public driver; no torque is sent. For versions 4 and 5 the
/// reporting period is set and the hand switched on. Not tried on a hand.
fn start_commands(config: &AllegroConfig) -> Vec<CanFrame> {
    let frames: &[(u16, &[u8])] = match (config.own_bus, config.version) {
        (false, _) => &[],
        (true, 4 | 5) => &[(0x81 << 2, &[3, 0, 0, 0, 0, 0]), (0x40 << 2, &[])],
        (true, _) => &[
            (0x08A, &[]),
            (0x0CA, &[3]),
            (0x14A, &[]),
            (0x04A, &[]),
            (0x38A, &[]),
        ],
    };
    frames_of(config, frames)
}

/// What has to be sent at the end; nothing unless `own_bus` is set.
fn stop_commands(config: &AllegroConfig) -> Vec<CanFrame> {
    let frames: &[(u16, &[u8])] = match (config.own_bus, config.version) {
        (false, _) => &[],
        (true, 4 | 5) => &[(0x41 << 2, &[])],
        (true, _) => &[(0x08A, &[])],
    };
    frames_of(config, frames)
}

fn frames_of(config: &AllegroConfig, frames: &[(u16, &[u8])]) -> Vec<CanFrame> {
    let device = if config.has_ids_of_4() {
        u16::from(config.device & 3)
    } else {
        0
    };
    frames
        .iter()
        .filter_map(|(id, data)| CanFrame::standard(id | device, data).ok())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: u64 = 1_000_000_000;

    fn starter(version: u8) -> AllegroStarter {
        let mut starter = AllegroStarter::new(&AllegroConfig {
            own_bus: true,
            ..AllegroConfig::new(version)
        });
        starter.handle_link(true);
        starter
    }

    /// Everything that is sent at this moment, by its id.
    fn sends(starter: &mut AllegroStarter, now_ns: u64) -> Vec<u32> {
        std::iter::from_fn(|| starter.poll_command(now_ns))
            .map(|frame| frame.id())
            .collect()
    }

    #[test]
    fn nothing_is_sent_unless_the_bus_is_its_own() {
        for version in 1..=5 {
            let mut listener = AllegroStarter::new(&AllegroConfig::new(version));
            listener.handle_link(true);
            assert_eq!(sends(&mut listener, S), []);
            assert_eq!(listener.poll_due_ns(), None);
            listener.stop();
            assert_eq!(sends(&mut listener, S), []);
            let wanted: &[u32] = match version {
                4 | 5 => &[0x204, 0x100],
                _ => &[0x08A, 0x0CA, 0x14A, 0x04A, 0x38A],
            };
            assert_eq!(sends(&mut starter(version), 0), wanted);
        }
    }

    #[test]
    fn a_hand_is_started_once_and_again_only_after_a_second_of_silence() {
        let mut starter = starter(4);
        assert_eq!(sends(&mut starter, 5 * S).len(), 2);
        assert_eq!(starter.poll_due_ns(), Some(6 * S));
        assert_eq!(sends(&mut starter, 6 * S - 1), []);
        starter.heard(5 * S + S / 2);
        assert_eq!(starter.poll_due_ns(), Some(6 * S + S / 2));
        assert_eq!(sends(&mut starter, 6 * S), []);
        assert_eq!(sends(&mut starter, 6 * S + S / 2).len(), 2);
        assert_eq!(sends(&mut starter, 6 * S + S / 2), []);
    }

    #[test]
    fn a_bus_that_comes_back_has_its_hand_started_at_once() {
        let mut starter = starter(3);
        assert_eq!(sends(&mut starter, S).len(), 5);
        starter.heard(S);
        starter.handle_link(false);
        assert_eq!(
            (sends(&mut starter, S + 1), starter.poll_due_ns()),
            (vec![], None)
        );
        starter.handle_link(true);
        assert_eq!(sends(&mut starter, S + 2).len(), 5);
    }

    #[test]
    fn a_command_that_a_full_queue_refuses_is_given_again_at_the_next_round() {
        let mut starter = starter(4);
        assert_eq!(starter.poll_command(S).unwrap().id(), 0x204);
        assert_eq!(starter.poll_command(S).unwrap().id(), 0x100);
        starter.command_not_sent();
        assert_eq!((starter.poll_command(S), starter.poll_due_ns()), (None, None));
        starter.handle_link(true);
        assert_eq!(sends(&mut starter, S + 1), [0x100]);
    }

    #[test]
    fn a_hand_that_is_stopped_is_not_started_again() {
        let mut starter = starter(4);
        sends(&mut starter, 0);
        starter.stop();
        assert_eq!(starter.poll_command(1).unwrap().id(), 0x104);
        starter.command_not_sent();
        starter.handle_link(true);
        starter.stop();
        assert_eq!(sends(&mut starter, 10 * S), []);
        assert_eq!(starter.poll_due_ns(), None);
    }
}
