use super::*;
use crate::Config;
use taxel_can::{BusState, LinkState};
use taxel_skin::{BoardState, Finding};

const MS: u64 = 1_000_000;

fn config() -> Config {
    let text = "[[bus]]\nsource = \"can:can0\"\n[[bus]]\nsource = \"can:can1\"\n";
    Config::parse(text, std::path::Path::new("taxeld.toml")).expect("valid")
}

/// A hand that is well.
fn well(config: &Config) -> Snapshot {
    let layout = &config.layout;
    let mut snapshot = Snapshot::new(layout.buses.len(), layout.modules.len(), layout.len(), 0);
    for bus in &mut snapshot.buses {
        bus.link = LinkState::Up;
    }
    for board in &mut snapshot.boards {
        board.state = BoardState::Living;
    }
    snapshot
}

struct Bench {
    config: Config,
    problems: Problems,
    snapshot: Snapshot,
    said: Vec<News>,
}

impl Bench {
    fn new() -> Self {
        let config = config();
        let snapshot = well(&config);
        let mut bench = Self {
            config,
            problems: Problems::default(),
            snapshot,
            said: Vec::new(),
        };
        bench.pass(1000, |_| {});
        assert_eq!(bench.said, []);
        bench
    }

    /// Lets time pass, with a change of the hand at each look.
    fn pass(&mut self, ms: u64, mut change: impl FnMut(&mut Snapshot)) {
        for _ in 0..ms / 100 {
            self.snapshot.now_ns += 100 * MS;
            change(&mut self.snapshot);
            self.said
                .extend(self.problems.look(&self.config, &self.snapshot, true));
        }
    }

    fn kinds(&self) -> Vec<Kind> {
        self.problems.current.iter().map(|(p, _)| p.kind).collect()
    }
}

#[test]
fn a_problem_is_told_when_it_comes_and_when_it_is_over() {
    let mut bench = Bench::new();
    bench.pass(2000, |s| s.buses[1].source.bus_state = BusState::BusOff);
    assert_eq!(bench.kinds(), ["bus-off"]);
    let [
        News::Came {
            severe: true,
            sentence,
        },
    ] = &bench.said[..]
    else {
        panic!("{:?}", bench.said);
    };
    assert!(
        sentence.starts_with("can1: ") && sentence.contains("type can restart-ms 100"),
        "{sentence}"
    );
    assert_eq!(bench.problems.kinds(Place::Bus(1)), ["bus-off"]);
    assert!(bench.problems.kinds(Place::Bus(0)).is_empty());

    bench.pass(500, |s| s.buses[1].source.bus_state = BusState::ErrorActive);
    assert_eq!(bench.kinds(), [""; 0]);
    let Some(News::Over { sentence }) = bench.said.last() else {
        panic!("{:?}", bench.said);
    };
    assert_eq!(
        (bench.said.len(), sentence.as_str()),
        (2, "can1: the controller is on the bus again (after 2.0 s)")
    );
}

#[test]
fn flapping_is_one_problem_and_not_hundreds() {
    let mut bench = Bench::new();
    // Fifty changes a second, for a minute; where it stands at a look is chance.
    let mut looks = 0;
    bench.pass(60_000, |s| {
        looks += 1;
        let source = &mut s.buses[0].source;
        source.state_changes += 5;
        source.bus_state = [BusState::ErrorPassive, BusState::ErrorActive][looks % 2];
    });
    assert_eq!(bench.kinds(), ["flapping"]);
    assert!(bench.said.len() <= 4, "{:#?}", bench.said);
    bench.pass(1000, |s| s.buses[0].source.bus_state = BusState::ErrorActive);
    assert_eq!(bench.kinds(), [""; 0]);
}

#[test]
fn what_comes_and_goes_for_hours_is_told_less_and_less() {
    let mut bench = Bench::new();
    let mut looks = 0;
    bench.pass(3_600_000, |s| {
        looks += 1;
        s.boards[3].state = if looks / 5 % 2 == 0 {
            BoardState::Silent
        } else {
            BoardState::Living
        };
    });
    // 7,200 changes in an hour; two kinds of problem, a sentence each per ten seconds.
    assert!(bench.said.len() < 2 * 360 + 10, "{}", bench.said.len());
    assert!(bench.said.iter().any(|news| match news {
        News::Came { sentence, .. } | News::Over { sentence } =>
            sentence.contains("changes in between were not told"),
    }));
    assert!(bench.kinds().contains(&"board-unsteady"));
}

#[test]
fn a_bus_that_is_lost_is_told_once_and_its_boards_are_not() {
    for (link, kind) in [(LinkState::Absent, "link-absent"), (LinkState::Down, "link-down")] {
        let mut bench = Bench::new();
        bench.pass(3000, |s| {
            s.buses[0].link = link;
            for board in &mut s.boards[..8] {
                board.state = BoardState::Silent;
            }
        });
        assert_eq!(bench.kinds(), [kind]);
        assert_eq!(bench.said.len(), 1);
    }
}

#[test]
fn a_bus_on_which_nobody_speaks_is_one_problem_and_one_silent_board_another() {
    let mut bench = Bench::new();
    bench.pass(1000, |s| {
        for board in &mut s.boards[..8] {
            board.state = BoardState::Silent;
        }
        s.boards[9].state = BoardState::Silent;
    });
    assert_eq!(bench.kinds(), ["bus-silent", "board-silent"]);
    let status = bench.problems.status(&bench.config);
    assert_eq!(status[1]["bus"], "can1");
    assert_eq!(status[1]["module"], bench.config.layout.modules[9].name);
}

#[test]
fn findings_are_told_with_their_figures_and_what_to_do() {
    let cases = [
        (
            Finding::IdBabbles {
                bus: 0,
                id: 5,
                extended: false,
                module: None,
                rate_hz: 4000.0,
                share: 0.444,
            },
            "babbling",
            ["id 005", "4000 frames/s, 44 %"],
        ),
        (
            Finding::TwoBoards {
                module: 3,
                sweeps_hz: [100.0, 50.0],
            },
            "two-boards-one-address",
            [
                "two boards answer as board 3 of can0",
                "(can0 board 5) is silent and probably the other one",
            ],
        ),
        (
            Finding::BusesSwapped {
                buses: [0, 1],
                module: 7,
                boards: 1,
            },
            "buses-swapped",
            ["can0 and can1 look swapped", "`source = \"can:can0\"`"],
        ),
        (
            Finding::OnOtherBus { module: 7, bus: 1 },
            "board-on-other-bus",
            ["a board of its address speaks on can1", "bus = \"can1\""],
        ),
    ];
    for (finding, kind, words) in cases {
        let mut bench = Bench::new();
        bench.pass(500, |s| {
            if kind == "two-boards-one-address" {
                s.boards[5].state = BoardState::Silent;
            }
            s.take_findings(&[finding]);
        });
        let said: Vec<&String> = (bench.said.iter())
            .map(|news| match news {
                News::Came { sentence, .. } | News::Over { sentence } => sentence,
            })
            .collect();
        assert!(bench.kinds().contains(&kind));
        assert!(words.iter().all(|w| said[0].contains(w)), "{said:?}");
    }
}

#[test]
fn errors_on_the_bus_are_told_with_what_to_look_at() {
    type Change = fn(&mut SourceCounters);
    let cases: [(Change, Kind, &str); 5] = [
        (|s| s.errors.protocol += 3, "bus-errors", "termination"),
        (|s| s.errors.no_acknowledge += 1, "no-acknowledge", "no power"),
        (
            |s| s.errors.controller_overflow += 1,
            "controller-overflow",
            "USB",
        ),
        (|s| s.lost_in_kernel += 1, "frames-lost", "rmem_max"),
        (|s| s.send_failures += 1, "cannot-send", "txqueuelen"),
    ];
    for (change, kind, word) in cases {
        let mut bench = Bench::new();
        bench.pass(2000, |s| change(&mut s.buses[0].source));
        assert_eq!(bench.kinds(), [kind]);
        assert!(
            matches!(&bench.said[..], [News::Came { sentence, .. }] if sentence.contains(word)),
            "{:?}",
            bench.said
        );
        bench.pass(1000, |_| {});
        assert_eq!(bench.kinds(), [""; 0], "{kind} is not over");
    }
}
