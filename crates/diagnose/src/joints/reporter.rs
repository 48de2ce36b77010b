//! What is to be said of the joints while all is well: a port that is open, who answers, how they answer.

use super::servo_name;
use crate::joints_view::{JointsView, SourceView};
use crate::kind::Severity;
use crate::rate_limiter::RateLimiter;
use taxel_can::LinkState;
use taxel_joints::bus::{FastState, ServoState};
use taxel_joints::{ALLEGRO_FINGERS, DynamixelConfig, JointsConfig, PortState, PortStatus, ServoSnapshot};

/// How long after a port or a link came up every joint should have been heard, nanoseconds.
const ROLL_CALL_NS: u64 = 2_000_000_000;
/// Return Delay Time from which a cycle takes markedly longer, microseconds.
const LONG_DELAY_US: u16 = 50;

/// Says each thing of the joints once. What is wrong is among the problems.
#[derive(Debug, Default)]
pub struct JointsReporter {
    up: bool,
    opened: u64,
    analogue_opened: u64,
    roll_call_ns: Option<u64>,
    /// What was said last of fast sync read, and how often that may be.
    fast_told: Option<FastState>,
    fast_limiter: Option<RateLimiter>,
    delays: bool,
    /// What was said of it of each servo ([`ServoState::watchdogs_cleared`]).
    watchdogs_cleared: Vec<u64>,
}

impl JointsReporter {
    /// What is new since the last call: sentences, with a warning's severity where it is one.
    pub fn handle_view(
        &mut self,
        config: &JointsConfig,
        view: &JointsView,
    ) -> Vec<(Option<Severity>, String)> {
        let mut news = Vec::new();
        match view.of(config) {
            Some(SourceView::Servos {
                config,
                snapshot,
                port,
            }) => self.of_servos(config, snapshot, port, view.now_ns, &mut news),
            Some(SourceView::Hand(hand)) => self.of_hand(&hand.bus.to_string(), view, &mut news),
            None => {}
        }
        if let (Some(config), Some(analogue)) = (&config.analogue, &view.analogue)
            && analogue
                .counters
                .heard_ns
                .is_some_and(|ns| ns >= analogue.open_ns)
            && analogue.port.opened != std::mem::replace(&mut self.analogue_opened, analogue.port.opened)
        {
            let (count, device) = (config.joint.len(), config.device.display());
            news.push((
                None,
                format!("joints: lines of {count} potentiometers come on {device}"),
            ));
        }
        news
    }

    fn of_servos(
        &mut self,
        config: &DynamixelConfig,
        snapshot: &ServoSnapshot,
        port: &PortStatus,
        now_ns: u64,
        news: &mut Vec<(Option<Severity>, String)>,
    ) {
        let path = port.path.display();
        if port.state != PortState::Open {
            self.roll_call_ns = None;
            return;
        }
        if port.opened != self.opened {
            let device = port.device.as_ref().filter(|device| **device != port.path);
            let device = device.map_or(String::new(), |device| format!(" (now {})", device.display()));
            let verb = if port.opened > 1 { "is back" } else { "is open" };
            let baud = config.baud;
            news.push((None, format!("joints: {path}{device} {verb} at {baud} bit/s")));
            self.opened = port.opened;
            self.roll_call_ns = Some(now_ns + ROLL_CALL_NS);
        }
        let answer = snapshot.servos.iter().filter(|s| s.alive).count();
        self.call_roll(answer, snapshot.servos.len(), "servos answer", now_ns, news);
        self.of_fast_reads(snapshot.fast, now_ns, news);
        news.extend(self.cleared_watchdogs(config, snapshot));
        if !self.delays && self.roll_call_ns.is_none() {
            self.delays = true;
            let named: Vec<String> = (config.servo.iter())
                .map(|s| format!("{} (id {})", s.name, s.id))
                .collect();
            news.extend(long_delays(&named, &snapshot.servos));
        }
    }

    /// Says of which servos the watchdogs were cleared since the last call.
    fn cleared_watchdogs(
        &mut self,
        config: &DynamixelConfig,
        snapshot: &ServoSnapshot,
    ) -> Option<(Option<Severity>, String)> {
        self.watchdogs_cleared.resize(snapshot.servos.len(), 0);
        let servos = config.servo.iter().zip(&snapshot.servos);
        let cleared: Vec<String> = (servos.zip(&mut self.watchdogs_cleared))
            .filter_map(|((servo, state), told)| {
                let before = std::mem::replace(told, state.watchdogs_cleared);
                (state.watchdogs_cleared > before).then(|| servo_name(servo))
            })
            .collect();
        (!cleared.is_empty()).then(|| {
            let text = format!(
                "joints: the bus watchdog of servo {} was left armed, or had tripped, with the motor off, by a taxeld that was killed or by another program; it is cleared",
                cleared.join(", ")
            );
            (None, text)
        })
    }

    /// Says how servos answer, and that they do so no longer. A change that may not be said yet is said later where it still
    /// holds, so that what was said last is so.
    fn of_fast_reads(&mut self, fast: FastState, now_ns: u64, news: &mut Vec<(Option<Severity>, String)>) {
        let sentence = match fast {
            FastState::On => "joints: all servos answer in one packet (fast sync read)",
            FastState::NotSupported => {
                "joints: fast sync read is not answered as it should be; each servo answers with its own packet"
            }
            FastState::Off | FastState::Probing => return,
        };
        let limiter = self.fast_limiter.get_or_insert_with(|| RateLimiter::new(now_ns));
        if self.fast_told != Some(fast) && limiter.poll(now_ns) {
            self.fast_told = Some(fast);
            news.push((None, sentence.into()));
        }
    }

    fn of_hand(&mut self, bus: &str, view: &JointsView, news: &mut Vec<(Option<Severity>, String)>) {
        let up = view.link == LinkState::Up;
        if up && !self.up {
            news.push((None, format!("joints: the hand's bus {bus} is up")));
            self.roll_call_ns = Some(view.now_ns + ROLL_CALL_NS);
        }
        self.up = up;
        if !up {
            self.roll_call_ns = None;
            return;
        }
        let fingers = ALLEGRO_FINGERS.len();
        let speak = (0..fingers)
            .filter(|f| view.finger_speaks(*f) == Some(true))
            .count();
        self.call_roll(speak, fingers, "fingers send their angles", view.now_ns, news);
    }

    /// Says, some time after a port or a bus came up, how many are heard.
    fn call_roll(
        &mut self,
        heard: usize,
        all: usize,
        what: &str,
        now_ns: u64,
        news: &mut Vec<(Option<Severity>, String)>,
    ) {
        if self.roll_call_ns.take_if(|at| *at <= now_ns).is_some() {
            news.push(match heard == all {
                true => (None, format!("joints: all {all} {what}")),
                false => (
                    Some(Severity::Warning),
                    format!("joints: {heard} of {all} {what} so far"),
                ),
            });
        }
    }
}

fn long_delays(names: &[String], servos: &[ServoState]) -> Option<(Option<Severity>, String)> {
    let slow: Vec<String> = (names.iter().zip(servos))
        .filter_map(|(name, servo)| Some((name, servo.identity?.return_delay_us)))
        .filter(|(_, us)| *us > LONG_DELAY_US)
        .map(|(name, us)| format!("{name} {us} us"))
        .collect();
    (!slow.is_empty()).then(|| {
        let text = format!(
            "joints: servos wait before they answer (Return Delay Time, address 9): {}. Set it to 0 with ROBOTIS's tools for faster cycles",
            slow.join(", ")
        );
        (Some(Severity::Warning), text)
    })
}

#[cfg(test)]
mod tests {
    use super::super::test_views::{S, allegro, away, finger, open, servo, servos};
    use super::*;
    use taxel_joints::bus::ServoIdentity;

    /// What is said at this moment: each sentence must hold its words, in order, and there must be no other.
    #[track_caller]
    fn says(reporter: &mut JointsReporter, config: &JointsConfig, view: &JointsView, sentences: &[&[&str]]) {
        let news = reporter.handle_view(config, view);
        assert_eq!(news.len(), sentences.len(), "{news:#?}");
        for ((_, text), words) in news.iter().zip(sentences) {
            for word in *words {
                assert!(text.contains(word), "`{word}` in {text}");
            }
        }
        assert_eq!(reporter.handle_view(config, view), [], "said twice");
    }

    #[test]
    fn a_port_that_opens_and_returns_and_those_behind_it_are_told_once() {
        let (config, mut view) = servos(2);
        let mut reporter = JointsReporter::default();
        says(&mut reporter, &config, &view, &[]);
        open(&mut view, "/dev/ttyUSB0", 16);
        let is_open = ["/dev/servos (now /dev/ttyUSB0) is open at 1000000 bit/s"];
        says(&mut reporter, &config, &view, &[&is_open]);
        servo(&mut view, 0).alive = true;
        says(&mut reporter, &config, &view, &[]);
        view.now_ns += 2 * S;
        says(&mut reporter, &config, &view, &[&["1 of 2 servos answer so far"]]);

        away(&mut view);
        says(&mut reporter, &config, &view, &[]);
        open(&mut view, "/dev/ttyUSB1", 1);
        says(&mut reporter, &config, &view, &[&["(now /dev/ttyUSB1) is back"]]);
        servo(&mut view, 0).alive = true;
        servo(&mut view, 1).alive = true;
        view.now_ns += 2 * S;
        says(&mut reporter, &config, &view, &[&["all 2 servos answer"]]);
    }

    #[test]
    fn how_servos_answer_is_told_at_each_change_and_where_that_is_too_often_the_last_word_is_so() {
        let (config, mut view) = servos(2);
        let mut reporter = JointsReporter::default();
        open(&mut view, "/dev/servos", 1);
        says(&mut reporter, &config, &view, &[&["is open"]]);
        let mut answers = |fast, view: &mut JointsView, sentences: &[&[&str]]| {
            view.servos.as_mut().unwrap().0.fast = fast;
            says(&mut reporter, &config, view, sentences);
        };
        let (in_one, each): (&[&str], &[&str]) = (&["in one packet"], &["with its own packet"]);
        for _ in 0..2 {
            answers(FastState::Probing, &mut view, &[]);
            answers(FastState::On, &mut view, &[in_one]);
            answers(FastState::NotSupported, &mut view, &[each]);
        }
        for _ in 0..5 {
            answers(FastState::On, &mut view, &[]);
            answers(FastState::NotSupported, &mut view, &[]);
        }
        answers(FastState::On, &mut view, &[]);
        view.now_ns += 10 * S;
        answers(
            FastState::On,
            &mut view,
            &[&["0 of 2 servos answer so far"], in_one],
        );
    }

    #[test]
    fn watchdogs_that_were_left_armed_are_told_in_one_line_when_they_are_cleared() {
        let (config, mut view) = servos(3);
        let mut reporter = JointsReporter::default();
        open(&mut view, "/dev/servos", 1);
        says(&mut reporter, &config, &view, &[&["is open"]]);
        servo(&mut view, 0).watchdogs_cleared = 1;
        servo(&mut view, 2).watchdogs_cleared = 1;
        let line = ["bus watchdog of servo 1, 3 was left armed", "it is cleared"];
        says(&mut reporter, &config, &view, &[&line]);
        servo(&mut view, 2).watchdogs_cleared = 2;
        says(&mut reporter, &config, &view, &[&["bus watchdog of servo 3 was"]]);
    }

    #[test]
    fn long_delays_are_told_with_their_servo() {
        let (config, mut view) = servos(2);
        let mut reporter = JointsReporter::default();
        open(&mut view, "/dev/servos", 1);
        says(&mut reporter, &config, &view, &[&["is open"]]);
        for joint in 0..2 {
            servo(&mut view, joint).alive = true;
            servo(&mut view, joint).identity = Some(ServoIdentity {
                model_number: 1030,
                firmware: 46,
                baud_register: 3,
                return_delay_us: if joint == 1 { 500 } else { 0 },
                drive_mode: 0,
            });
        }
        view.now_ns += 2 * S;
        let sentences: [&[&str]; 2] = [&["all 2"], &["servo 2 (id 2) 500 us", "address 9"]];
        says(&mut reporter, &config, &view, &sentences);
    }

    #[test]
    fn the_fingers_of_a_hand_are_counted_when_its_bus_is_up() {
        let (config, mut view) = allegro();
        let mut reporter = JointsReporter::default();
        says(&mut reporter, &config, &view, &[]);
        view.link = LinkState::Up;
        says(&mut reporter, &config, &view, &[&["can:can2 is up"]]);
        view.now_ns += 2 * S;
        (0..3).for_each(|f| finger(&mut view, f));
        says(
            &mut reporter,
            &config,
            &view,
            &[&["3 of 4 fingers send their angles"]],
        );
    }
}
