//! An Allegro hand whose joints are to be read: whether its fingers report, and what it says of its motors. Nothing is sent.

use super::bus_listener::{BusListener, Listener};
use super::finding::Check;
use taxel_can::Received;
use taxel_diagnose::{motor_error, silent_fingers};
use taxel_joints::{AllegroConfig, AllegroDecoder, AllegroSource, MotorErrors};
use taxel_playback::interrupt::Interrupt;

const AREA: &str = "joints";
/// Each finger reports every 3 ms.
const LISTEN_NS: u64 = 500_000_000;
const RECEIVE_BUFFER: usize = 4 << 20;

/// Position frames of each finger, as the frames of versions 1 to 3 and as those of versions 4 and 5; and errors of motors.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub(super) struct AllegroFacts {
    pub(super) positions: [[u64; 4]; 2],
    pub(super) motor_errors: MotorErrors,
    pub(super) end_ns: u64,
    pub(super) seconds: f64,
}

struct FingerListener {
    decoders: [AllegroDecoder; 2],
}

impl Listener for FingerListener {
    fn handle_frame(&mut self, _: u8, received: &Received) {
        for decoder in &mut self.decoders {
            decoder.push(&received.frame, received.t_ns);
        }
    }

    fn handle_turn(&mut self, _: &mut BusListener, _: u64) -> bool {
        true
    }
}

/// Listens to the bus of the hand.
pub(super) fn listen(source: &AllegroSource, interrupt: Interrupt) -> anyhow::Result<AllegroFacts> {
    let decoder = |version| {
        let of_this_hand = source
            .hand
            .as_ref()
            .filter(|c| c.has_ids_of_4() == (version == 4));
        AllegroDecoder::new(
            &of_this_hand
                .cloned()
                .unwrap_or_else(|| AllegroConfig::new(version)),
        )
    };
    let mut hearing = FingerListener {
        decoders: [decoder(3)?, decoder(4)?],
    };
    let (mut bus_listener, failures) =
        BusListener::open(std::slice::from_ref(&source.bus), None, RECEIVE_BUFFER, interrupt);
    if let Some((_, error)) = failures.into_iter().next() {
        return Err(error);
    }
    let begin_ns = bus_listener.now_ns();
    bus_listener.listen(LISTEN_NS, "listening to the Allegro hand", &mut hearing);
    let end_ns = bus_listener.now_ns();
    Ok(AllegroFacts {
        motor_errors: *hearing.decoders[1].motor_errors(),
        positions: hearing.decoders.map(|decoder| decoder.counters().positions),
        end_ns,
        seconds: (end_ns - begin_ns) as f64 / 1e9,
    })
}

/// What is to be said of the hand.
pub(super) fn check(source: &AllegroSource, facts: &AllegroFacts) -> Vec<Check> {
    let object = &source.bus.to_string();
    let mut checks = of_fingers(source, facts, object);
    let errors = facts.motor_errors.current(facts.end_ns);
    checks.extend(errors.map(|error| Check::of_problem(AREA, object, &motor_error(source, error))));
    checks
}

fn of_fingers(source: &AllegroSource, facts: &AllegroFacts, object: &str) -> Vec<Check> {
    let version = source.hand.as_ref().map(|hand| hand.version);
    let [older, four] = facts.positions;
    let speaks = |fingers: [u64; 4]| fingers.iter().all(|n| *n > 0);
    let has_ids_of_4 = source.hand.as_ref().is_some_and(|hand| hand.has_ids_of_4());
    let (own, other) = if has_ids_of_4 {
        (four, older)
    } else {
        (older, four)
    };
    if speaks(own) {
        let hz = own[0] as f64 / facts.seconds.max(1e-3);
        let found = format!("all fingers report, {hz:.0} times a second");
        return vec![Check::ok(AREA, "Allegro hand", object, found)];
    }
    if speaks(other) {
        let is = if has_ids_of_4 { "1, 2 or 3" } else { "4 or 5" };
        let found = format!("a hand of version {is} reports");
        let check = Check::error(AREA, "Allegro hand", object, found)
            .wanted(version.map_or("a version".into(), |v| format!("version {v}")))
            .advise(format!("write [joints.allegro] version = {is}"));
        return vec![check];
    }
    let problems = silent_fingers(source, own.map(|n| n == 0));
    let checks = problems.iter().map(|p| Check::of_problem(AREA, object, p));
    checks.collect()
}

#[cfg(test)]
mod tests {
    use super::super::finding::State;
    use super::*;

    #[test]
    fn fingers_that_report_are_told_from_silent_ones_and_from_another_version() {
        let source = AllegroSource {
            bus: "can:can2".parse().unwrap(),
            hand: Some(AllegroConfig::new(4)),
        };
        let all = [150; 4];
        for (positions, state, words) in [
            ([[0; 4], all], State::Ok, "300 times a second"),
            ([all, [0; 4]], State::Error, "version 1, 2 or 3 reports"),
            (
                [[0; 4], [150, 0, 150, 0]],
                State::Error,
                "middle finger sends no angles, and others do, joints: the hand's thumb finger sends no angles",
            ),
            (
                [[0; 4], [0; 4]],
                State::Error,
                "the Allegro hand on can:can2 sends no angles",
            ),
        ] {
            let facts = AllegroFacts {
                positions,
                seconds: 0.5,
                ..AllegroFacts::default()
            };
            let checks = check(&source, &facts);
            assert!(checks.iter().all(|c| c.state == state), "{checks:?}");
            let found: Vec<&str> = checks.iter().map(|c| c.found.as_str()).collect();
            assert!(found.join(", ").contains(words), "{found:?}");
        }
    }

    #[test]
    fn an_error_that_the_hand_reports_of_a_motor_is_told_beside_its_fingers() {
        let hand = AllegroConfig::new(5);
        let mut decoder = AllegroDecoder::new(&hand).unwrap();
        decoder.push(&taxel_can::CanFrame::standard(0x3B8, &[3, 0x04]).unwrap(), 0);
        let source = AllegroSource {
            bus: "can:can2".parse().unwrap(),
            hand: Some(hand),
        };
        let facts = AllegroFacts {
            positions: [[0; 4], [150; 4]],
            motor_errors: *decoder.motor_errors(),
            end_ns: 1,
            seconds: 0.5,
        };
        let checks = check(&source, &facts);
        let found: Vec<_> = checks.iter().map(|c| (c.state, c.name.as_ref())).collect();
        assert_eq!(found, [(State::Ok, "Allegro hand"), (State::Error, "hand-error")]);
        assert!(checks[1].found.contains("motor 3 (index 3): overheating (0x04)"));
    }
}
