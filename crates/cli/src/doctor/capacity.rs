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
    can_be_triggered: bool,
    /// Sweeps per second of the fastest board.
    wanted_hz: f64,
    /// Frames per second.
    needed: f64,
    /// Share of the bus, %, at least and at most.
    share: [f64; 2],
    /// Sweeps per second that the bus carries, at least and at most.
    carried_hz: [f64; 2],
}

impl Load {
    /// `None` where what boards send is not public.
    fn of(layout: &Layout, bus: u8, boards: &BoardsConfig, bitrate: u64) -> Option<Self> {
        let wired: Vec<&Wiring> = layout.wiring.iter().filter(|m| m.bus == bus).collect();
        let rates: Vec<f64> = wired.iter().filter_map(|m| nominal_hz(m, boards)).collect();
        let wanted_hz = rates.iter().copied().fold(0.0, f64::max);
        if rates.len() < wired.len() || wanted_hz == 0.0 {
            return None;
        }
        let frames = layout.frames_per_sweep(bus) as f64;
        let full = CanFrame::standard(0, &[0; 8]).expect("a frame of eight bytes");
        let [most, least] = full.bits_within().map(|bits| bitrate as f64 / f64::from(bits));
        let needed = frames * wanted_hz;
        Some(Self {
            boards: wired.len(),
            can_be_triggered: wired.iter().all(|m| m.can_be_triggered()),
            wanted_hz,
            needed,
            share: [needed / most, needed / least].map(|share| share * 100.0),
            carried_hz: [least / frames, most / frames],
        })
    }

    /// Sweeps per second to trigger the boards at, with some room, since commands share the bus: 86 % is what is known
    /// to work (docs/protocols.md, "Bus timing").
    fn trigger_hz(&self) -> f64 {
        (self.carried_hz[0] * 0.86).floor().max(1.0)
    }
}

/// Sweeps per second at which the boards of a hand have to be triggered, since a bus does not carry what they send by
/// themselves; `None` where it does, or where triggering them is no way out.
pub(crate) fn trigger_hz(layout: &Layout, bitrate: u64) -> Option<f64> {
    let buses = 0..layout.buses.len() as u8;
    let loads = buses.filter_map(|bus| Load::of(layout, bus, &BoardsConfig::default(), bitrate));
    let full = loads.filter(|load| load.share[1] > 100.0 && load.can_be_triggered);
    full.map(|load| load.trigger_hz()).reduce(f64::min)
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
    let Load {
        wanted_hz,
        needed,
        share: [low, high],
        carried_hz: [slow, fast],
        ..
    } = load;
    let words = format!(
        "{} at {wanted_hz:.0} Hz: {needed:.0} frames/s, {low:.0} to {high:.0} % of {} Mbit/s",
        plural(load.boards, "board"),
        bitrate as f64 / 1e6
    );
    if high <= 100.0 {
        return Some(Check::ok(AREA, NAME, object, words));
    }
    let buses = (high / 86.0).ceil();
    let found = match low > 100.0 {
        true => format!(
            "{words}: they cannot reach {wanted_hz:.0} Hz, at most {slow:.0} to {fast:.0} Hz, and lose sweeps instead"
        ),
        false => format!("{words}: at the limit, {slow:.0} to {fast:.0} Hz can be reached"),
    };
    let check = Check::warning(AREA, NAME, object, found).wanted("at most 100 %");
    Some(match load.can_be_triggered {
        true => check.advise(format!(
            "write [boards] mode = \"triggered\" and trigger_hz = {:.0} into the configuration, or spread the boards over \
             {buses:.0} buses",
            load.trigger_hz()
        )),
        false => check.advise(format!("spread the boards over {buses:.0} buses, or give them a longer period")),
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
}
