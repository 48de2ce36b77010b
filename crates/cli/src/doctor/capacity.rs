//! What a bus can carry and what its boards want of it (docs/protocols.md, "Bus timing").

use super::finding::Check;
use taxel_can::CanFrame;
use taxel_hand::plural;
use taxel_skin::{BoardsConfig, BoardsMode, Layout, Wiring};

/// How often a board sends its sweep, by what is public of it; `None` where nothing is.
fn nominal_hz(wiring: &Wiring, boards: &BoardsConfig) -> Option<f64> {
    let triggered = boards.mode == BoardsMode::Triggered && wiring.can_be_triggered();
    if triggered {
        Some(boards.trigger_hz)
    } else {
        wiring.nominal_hz()
    }
}

/// What the boards of a bus want of it.
struct Load {
    boards: usize,
    /// Sweeps per second of the slowest and of the fastest board.
    wanted_hz: [f64; 2],
    /// Frames per second.
    needed: f64,
    /// Frames per second that the bus carries, at least and at most.
    carried: [f64; 2],
    /// Sweeps per second to trigger those boards at that can be, where that is a way out.
    trigger_hz: Option<f64>,
}

impl Load {
    /// `None` where what boards send is not public.
    fn of(layout: &Layout, bus: u8, boards: &BoardsConfig, bitrate: u64) -> Option<Self> {
        let wired: Vec<&Wiring> = layout.wiring.iter().filter(|m| m.bus == bus).collect();
        let rates: Option<Vec<f64>> = wired.iter().map(|m| nominal_hz(m, boards)).collect();
        let rates = rates.filter(|rates| !rates.is_empty())?;
        let full = CanFrame::standard(0, &[0; 8]).expect("a frame of eight bytes");
        let [most, least] = full.bits_within().map(|bits| bitrate as f64 / f64::from(bits));
        let can_be_triggered = |m: &Wiring| f64::from(u8::from(m.can_be_triggered()));
        let triggered = layout.frames_hz(bus, can_be_triggered);
        let others = layout.frames_hz(bus, |m| match m.can_be_triggered() {
            true => 0.0,
            false => nominal_hz(m, boards).unwrap_or(0.0),
        });
        // With some room, since commands share the bus: 86 % is what is known to work (docs/protocols.md, "Bus timing").
        let trigger_hz = ((least * 0.86 - others) / triggered).floor();
        Some(Self {
            boards: wired.len(),
            wanted_hz: [
                rates.iter().copied().fold(f64::INFINITY, f64::min),
                rates.iter().copied().fold(0.0, f64::max),
            ],
            needed: layout.frames_hz(bus, |m| nominal_hz(m, boards).unwrap_or(0.0)),
            carried: [least, most],
            trigger_hz: (triggered > 0.0 && trigger_hz >= 1.0).then_some(trigger_hz),
        })
    }

    /// Share of the bus, %, at least and at most.
    fn share(&self) -> [f64; 2] {
        let [least, most] = self.carried;
        [most, least].map(|carried| self.needed / carried * 100.0)
    }
}

/// Sweeps per second at which those boards of a hand that can be have to be triggered, since a bus does not carry what
/// they send by themselves; `None` where it does, or where triggering them is no way out.
pub(crate) fn trigger_hz(layout: &Layout, bitrate: u64) -> Option<f64> {
    let buses = 0..layout.buses.len() as u8;
    let loads = buses.filter_map(|bus| Load::of(layout, bus, &BoardsConfig::default(), bitrate));
    let full = loads.filter(|load| load.share()[1] > 100.0);
    full.filter_map(|load| load.trigger_hz).reduce(f64::min)
}

/// Whether a bus carries what its boards send at their usual rate. `None` where that is not public.
pub(crate) fn check(
    layout: &Layout,
    bus: u8,
    boards: &BoardsConfig,
    bitrate: u64,
    object: &str,
) -> Option<Check> {
    const AREA: &str = "hand";
    const NAME: &str = "bus capacity";
    let load = Load::of(layout, bus, boards, bitrate)?;
    let [low, high] = load.share();
    let needed = load.needed;
    let reached = |wanted_hz: f64| load.carried.map(|carried| wanted_hz * carried / needed);
    let (wanted, [slow, fast], unit) = match load.wanted_hz.map(|hz| format!("{hz:.0}")) {
        [slowest, fastest] if slowest == fastest => (slowest, reached(load.wanted_hz[0]), "Hz"),
        [slowest, fastest] => (format!("{slowest} to {fastest}"), reached(100.0), "% of that"),
    };
    let words = format!(
        "{} at {wanted} Hz: {needed:.0} frames/s, {low:.0} to {high:.0} % of {} Mbit/s",
        plural(load.boards, "board"),
        bitrate as f64 / 1e6
    );
    if high <= 100.0 {
        return Some(Check::ok(AREA, NAME, object, words));
    }
    let buses = (high / 86.0).ceil();
    let found = match low > 100.0 {
        true => format!(
            "{words}: they cannot reach {wanted} Hz, at most {slow:.0} to {fast:.0} {unit}, and lose sweeps instead"
        ),
        false => format!("{words}: at the limit, {slow:.0} to {fast:.0} {unit} can be reached"),
    };
    let check = Check::warning(AREA, NAME, object, found).wanted("at most 100 %");
    Some(match load.trigger_hz {
        Some(hz) => check.advise(format!(
            "write [boards] mode = \"triggered\" and trigger_hz = {hz:.0} into the configuration, or spread the boards over \
             {buses:.0} buses"
        )),
        None => check.advise(format!("spread the boards over {buses:.0} buses, or give them a longer period")),
    })
}

#[cfg(test)]
mod tests {
    use super::super::finding::{Mend, State};
    use super::*;

    /// So many L1 phalanges on one bus.
    fn phalanges(n: usize) -> Layout {
        let mut text = format!(
            "name = \"n\"\nimage = {{ width = {}, height = 4 }}\nbuses = [\"b\"]\n",
            4 * n
        );
        for board in 0..n {
            text += &format!(
                "[[module]]\nname = \"m{board}\"\npart = \"p\"\nbus = \"b\"\nboard = {board}\nprotocol = \"uskin-l1\"\n\
                 at = [{}, 0]\n",
                4 * board
            );
        }
        Layout::parse(&text, "n.toml").unwrap()
    }

    #[test]
    fn the_table_of_protocols_2_5_is_met() {
        let free = BoardsConfig::default();
        for (n, share, state) in [
            (1, "1600 frames/s, 18 to 22 %", State::Ok),
            (2, "3200 frames/s, 36 to 43 %", State::Ok),
            (4, "6400 frames/s, 71 to 86 %", State::Ok),
            (5, "8000 frames/s, 89 to 108 %", State::Warning),
            (15, "24000 frames/s, 266 to 324 %", State::Warning),
        ] {
            let check = check(&phalanges(n), 0, &free, 1_000_000, "b").unwrap();
            assert_eq!(check.state, state, "{n}");
            assert!(check.found.contains(share), "{}", check.found);
        }
        let fifteen = check(&phalanges(15), 0, &free, 1_000_000, "b").unwrap();
        assert!(
            fifteen.found.contains("cannot reach 100 Hz, at most 31 to 38 Hz"),
            "{}",
            fifteen.found
        );
        assert!(
            matches!(&fifteen.mend[0], Mend::Do(text) if text.contains("trigger_hz = 26") && text.contains("4 buses"))
        );
    }

    #[test]
    fn the_configuration_that_is_installed_overloads_no_bus() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../systemd/taxeld.toml");
        let config = taxeld::Config::load(path.as_ref()).unwrap();
        for bus in 0..config.sources.len() {
            let check = check(&config.layout, bus as u8, &config.boards, 1_000_000, "b").unwrap();
            assert_eq!(check.state, State::Ok, "{}", check.found);
        }
    }

    #[test]
    fn a_lower_rate_or_a_shorter_hand_fits() {
        let triggered = BoardsConfig {
            mode: BoardsMode::Triggered,
            trigger_hz: 26.0,
            ..BoardsConfig::default()
        };
        assert_eq!(
            check(&phalanges(15), 0, &triggered, 1_000_000, "b")
                .unwrap()
                .state,
            State::Ok
        );
        let finger = Layout::builtin("cpm-finger").unwrap();
        assert_eq!(check(&finger, 0, &triggered, 1_000_000, "b"), None);
        let arm = Layout::builtin("icub-forearm").unwrap();
        assert_eq!(
            check(&arm, 0, &triggered, 1_000_000, "b").unwrap().state,
            State::Ok
        );
    }

    /// Phalanges and iCub boards of one triangle, 20 times a second, on one bus.
    fn mixed(phalanges: usize, icub: usize) -> Layout {
        let boards = phalanges + icub;
        let mut text = format!(
            "name = \"n\"\nimage = {{ width = {}, height = 4 }}\nbuses = [\"b\"]\n",
            4 * boards
        );
        for n in 0..boards {
            let (board, of_protocol) = match n.checked_sub(phalanges) {
                None => (n, "protocol = \"uskin-l2\""),
                Some(n) => (
                    8 + n,
                    "protocol = \"icub-mtb3\"\nicub = { period_ms = 50 }\norder = [[0, 1, 2, 3]]",
                ),
            };
            text += &format!(
                "[[module]]\nname = \"m{n}\"\npart = \"p\"\nbus = \"b\"\nboard = {board}\n{of_protocol}\nat = [{}, 0]\n",
                4 * n
            );
        }
        Layout::parse(&text, "n.toml").unwrap_or_else(|e| panic!("{e}\n{text}"))
    }

    #[test]
    fn each_board_of_a_bus_counts_at_its_own_rate() {
        let free = BoardsConfig::default();
        // A phalange sends 1600 frames a second, such an iCub board 40.
        let cases = [
            (
                1,
                6,
                "7 boards at 20 to 100 Hz: 1840 frames/s, 20 to 25 % of 1 Mbit/s",
                None,
            ),
            (4, 3, "7 boards at 20 to 100 Hz: 6520 frames/s, 72 to 88 %", None),
            (
                5,
                6,
                "11 boards at 20 to 100 Hz: 8240 frames/s, 91 to 111 % of 1 Mbit/s: at the limit, 90 to 109 % of that can be",
                Some(76.0),
            ),
            (
                8,
                6,
                "they cannot reach 20 to 100 Hz, at most 57 to 69 % of that, and lose sweeps instead",
                Some(47.0),
            ),
        ];
        for (phalanges, icub, words, hz) in cases {
            let layout = mixed(phalanges, icub);
            let found = check(&layout, 0, &free, 1_000_000, "b").unwrap();
            assert!(found.found.contains(words), "{}", found.found);
            assert_eq!(found.state == State::Warning, hz.is_some(), "{}", found.found);
            assert_eq!(trigger_hz(&layout, 1_000_000), hz);
            if let Some(trigger_hz) = hz {
                let advice = format!("trigger_hz = {trigger_hz:.0} into");
                assert!(matches!(&found.mend[0], Mend::Do(text) if text.contains(&advice)));
                let triggered = BoardsConfig {
                    mode: BoardsMode::Triggered,
                    trigger_hz,
                    ..BoardsConfig::default()
                };
                let found = check(&layout, 0, &triggered, 1_000_000, "b").unwrap();
                assert_eq!(found.state, State::Ok, "{}", found.found);
            }
        }
    }
}
