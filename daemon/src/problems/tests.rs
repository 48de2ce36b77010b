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
        board.state = BoardState::Streaming;
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
        Self::of(config())
    }

    fn of(config: Config) -> Self {
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
                .extend(self.problems.look(&self.config, &self.snapshot, None, true));
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
            BoardState::Streaming
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

/// A bus with a hub of five modules and one of one.
fn two_hubs() -> Config {
    let mut text = "name = \"hubs\"\nbuses = [\"can0\"]\nimage = { width = 42, height = 1 }\n[cyskin]\n\
         byte_order = \"big\"\nchecksum = \"sum\"\nsequence_bytes_above = 5\nsensors_per_module = 12\n\
         [[cyskin.hub]]\nname = \"left\"\nbus = \"can0\"\naddress = 1\n\
         [[cyskin.hub]]\nname = \"right\"\nbus = \"can0\"\naddress = 2\n"
        .to_string();
    for n in 0..6 {
        let hub = if n < 5 { "left" } else { "right" };
        text += &format!(
            "[[module]]\nname = \"m{n}\"\npart = \"p\"\nbus = \"can0\"\nhub = \"{hub}\"\nboard = {n}\n\
             protocol = \"cyskin\"\nat = [{}, 0]\norder = [[1, 2, 3, 4, 5, 6, 7]]\n",
            7 * n
        );
    }
    let layout = taxel_skin::Layout::parse(&text, "hubs.toml").unwrap_or_else(|e| panic!("{e}"));
    Config::new(layout, vec!["can:can0".parse().expect("a source")])
}

#[test]
fn a_silent_hub_is_one_problem_with_its_modules_named() {
    let cases: [(&[usize], &str, &str); 4] = [
        (
            &[0, 1, 2, 3, 4],
            "hub left (can0) with all its modules (m0, m1, m2 and 2 more) is silent; ",
            "hub left (can0) with all its modules (m0, m1, m2 and 2 more) speaks (",
        ),
        (
            &[1, 3],
            "a part of hub left (can0), 2 of its 5 modules (m1, m3), is silent; ",
            "a part of hub left (can0), 2 of its 5 modules (m1, m3) speaks (",
        ),
        (
            &[2],
            "m2 (can0 hub left, board 2) is silent; ",
            "m2 (can0 hub left, board 2) speaks (",
        ),
        (
            &[5],
            "m5 (can0 hub right, board 5) is silent; ",
            "m5 (can0 hub right, board 5) speaks (",
        ),
    ];
    for (silent, came, over) in cases {
        let mut bench = Bench::of(two_hubs());
        bench.pass(1000, |s| {
            silent
                .iter()
                .for_each(|m| s.boards[*m].state = BoardState::Silent)
        });
        assert_eq!(bench.kinds(), ["board-silent"]);
        for module in 0..6 {
            let wanted: &[Kind] = if silent.contains(&module) {
                &["board-silent"]
            } else {
                &[]
            };
            assert_eq!(bench.problems.kinds(Place::Module(module)), wanted, "{module}");
        }
        let status = bench.problems.status(&bench.config);
        let names: Vec<String> = silent.iter().map(|m| format!("m{m}")).collect();
        assert_eq!(
            (&status[0]["bus"], &status[0]["module"], &status[0]["modules"]),
            (&json!("can0"), &json!(names[0]), &json!(names))
        );
        bench.pass(1000, |s| {
            silent
                .iter()
                .for_each(|m| s.boards[*m].state = BoardState::Streaming)
        });
        let [News::Came { sentence, .. }, News::Over { sentence: end }] = &bench.said[..] else {
            panic!("{:?}", bench.said);
        };
        assert!(sentence.starts_with(came), "{sentence}");
        assert!(end.starts_with(over), "{end}");
    }
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
            ["id 005", "4000 frames/s, at least 44 %"],
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

mod joints {
    use super::*;
    use crate::joints::test_views::{S, allegro, away, finger, open, servo, servos};
    use taxel_joints::JointsConfig;
    use taxel_joints::registers::HardwareError;

    struct JointsBench {
        bench: Bench,
        view: JointsView,
    }

    impl JointsBench {
        fn new((joints, view): (JointsConfig, JointsView)) -> Self {
            let mut bench = Bench::new();
            bench.config.joints = Some(joints);
            Self { bench, view }
        }

        /// Servos that all answer.
        fn answering(n: u8) -> Self {
            let (config, mut view) = servos(n);
            open(&mut view, "/dev/ttyUSB0", 1);
            for joint in 0..usize::from(n) {
                servo(&mut view, joint).alive = true;
                view.tick.angles[joint] = 0.0;
            }
            let mut bench = Self::new((config, view));
            bench.pass(1000, |_| {});
            assert_eq!(bench.bench.said, []);
            bench
        }

        fn pass(&mut self, ms: u64, mut change: impl FnMut(&mut JointsView)) {
            let Self { bench, view } = self;
            for _ in 0..ms / 100 {
                bench.snapshot.now_ns += 100 * MS;
                view.now_ns = bench.snapshot.now_ns;
                change(view);
                let news = bench
                    .problems
                    .look(&bench.config, &bench.snapshot, Some(view), true);
                bench.said.extend(news);
            }
        }

        /// What was said of late; each sentence must hold its words.
        #[track_caller]
        fn said(&mut self, sentences: &[&[&str]]) {
            let said: Vec<String> = (self.bench.said.drain(..))
                .map(|news| match news {
                    News::Came { sentence, .. } | News::Over { sentence } => sentence,
                })
                .collect();
            assert_eq!(said.len(), sentences.len(), "{said:#?}");
            for (text, words) in said.iter().zip(sentences) {
                assert!(words.iter().all(|word| text.contains(word)), "{words:?}: {text}");
            }
        }
    }

    #[test]
    fn an_adapter_that_is_unplugged_is_one_problem_and_its_servos_are_none() {
        let mut bench = JointsBench::answering(3);
        bench.pass(3000, away);
        bench.said(&[&["/dev/servos is gone, unplugged", "No such file", "images go on"]]);
        assert_eq!(bench.bench.kinds(), ["serial-absent"]);
        let status = bench.bench.problems.status(&bench.bench.config);
        assert_eq!(
            (&status[0]["bus"], &status[0]["joint"]),
            (&Value::Null, &Value::Null)
        );
        assert_eq!(status[0]["severe"], true);

        open(&mut bench.view, "/dev/ttyUSB1", 1);
        bench.pass(900, |_| {});
        bench.said(&[&["/dev/servos is there", "after 3.0 s"]]);
        bench.pass(500, |_| {});
        bench.said(&[&[
            "no servo answers",
            "baud = 1000000",
            "taxel doctor --joints dynamixel:/dev/servos",
        ]]);
        bench.pass(500, |view| {
            (0..3).for_each(|joint| servo(view, joint).alive = true)
        });
        bench.said(&[&["servos answer"]]);
    }

    #[test]
    fn a_servo_that_is_silent_late_damaged_hot_or_failed_is_named_with_what_to_do() {
        type Change = fn(&mut JointsView);
        let cases: [(Kind, Change, Change, &[&str], &str); 5] = [
            (
                "servo-silent",
                |v| servo(v, 1).alive = false,
                |v| servo(v, 1).alive = true,
                &["servo 2 (id 2) is silent; check its power and cable. "],
                "servo 2 (id 2) answers again",
            ),
            (
                "servo-late",
                |v| servo(v, 1).counters.late += 1,
                |_| {},
                &["servo 2 (id 2) answers after its deadline", "answer_margin_ms"],
                "answers in time",
            ),
            (
                "servo-damaged",
                |v| servo(v, 1).counters.bad_crc += 1,
                |_| {},
                &["answers of servo servo 2 (id 2)", "damaged (CRC)", "termination"],
                "are whole",
            ),
            (
                "servo-error",
                |v| servo(v, 1).hardware_error = Some(HardwareError(0x24)),
                |v| servo(v, 1).hardware_error = Some(HardwareError(0)),
                &[
                    "servo 2 (id 2)",
                    "overheating, overload",
                    "Let it cool down, Free the joint",
                    "reboot",
                ],
                "no hardware error",
            ),
            (
                "servo-hot",
                |v| servo(v, 1).temperature_c = Some(71),
                |v| servo(v, 1).temperature_c = Some(64),
                &["servo 2 (id 2) has 71 degrees"],
                "cooled down",
            ),
        ];
        for (kind, begin, end, words, over) in cases {
            let mut bench = JointsBench::answering(3);
            bench.pass(1500, begin);
            bench.said(&[words]);
            assert_eq!(bench.bench.kinds(), [kind]);
            assert_eq!(bench.bench.problems.kinds(Place::Joint(1)), [kind]);
            let status = bench.bench.problems.status(&bench.bench.config);
            assert_eq!(status[0]["joint"], "servo 2");
            bench.pass(1000, end);
            bench.said(&[&[over]]);
        }
    }

    #[test]
    fn answers_that_are_late_or_damaged_from_all_servos_are_one_problem() {
        type Change = fn(&mut JointsView, usize);
        let cases: [(Kind, Change, &[&str]); 2] = [
            (
                "servo-late",
                |v, joint| servo(v, joint).counters.late += 1,
                &["most servos come after their deadline", "busy machine"],
            ),
            (
                "servo-damaged",
                |v, joint| servo(v, joint).counters.bad_crc += 1,
                &["most servos come damaged", "termination"],
            ),
        ];
        for (kind, change, words) in cases {
            let mut bench = JointsBench::answering(4);
            bench.pass(2000, |view| (0..4).for_each(|joint| change(view, joint)));
            bench.said(&[words]);
            assert_eq!(bench.bench.problems.kinds(Place::Joints), [kind]);
            bench.pass(1000, |_| {});
            assert_eq!(bench.bench.kinds(), [""; 0]);
        }
        // A tenth of the answers late: a machine that was busy.
        let mut bench = JointsBench::answering(4);
        bench.pass(5000, |view| {
            servo(view, 1).counters.ok += 9;
            servo(view, 1).counters.late += 1;
        });
        bench.said(&[]);
    }

    #[test]
    fn what_is_at_the_edge_does_not_come_and_go() {
        let mut bench = JointsBench::answering(2);
        let mut looks = 0;
        bench.pass(20_000, |view| {
            looks += 1;
            servo(view, 0).temperature_c = Some(if looks % 2 == 0 { 70 } else { 66 });
            // An answer in half a second late is none too many; and one keeps up what there is.
            servo(view, 1).counters.late += u64::from(looks % 4 == 0 || looks < 10);
        });
        assert_eq!(bench.bench.kinds(), ["servo-hot", "servo-late"]);
        assert_eq!(bench.bench.said.len(), 2, "{:#?}", bench.bench.said);
        let mut bench = JointsBench::answering(1);
        bench.pass(20_000, |view| {
            servo(view, 0).counters.late += u64::from(view.now_ns % (1000 * MS) == 0)
        });
        assert_eq!(bench.bench.said, [], "one in a second");
    }

    #[test]
    fn a_servo_that_was_never_heard_is_given_time_and_then_other_advice() {
        let (config, mut view) = servos(2);
        open(&mut view, "/dev/ttyUSB0", 16);
        servo(&mut view, 0).alive = true;
        view.tick.angles[0] = 0.0;
        let mut bench = JointsBench::new((config, view));
        bench.pass(900, |_| {});
        bench.said(&[&["16 ms", "/sys/bus/usb-serial/devices/ttyUSB0/latency_timer"]]);
        bench.pass(500, |_| {});
        bench.said(&[&["servo 2 (id 2) is silent", "its id and its baud rate"]]);
        bench.pass(500, |view| {
            let (_, port) = view.servos.as_mut().unwrap();
            port.latency.as_mut().unwrap().ftdi_timer_ms = Some(1);
        });
        bench.said(&[&["within 1 ms"]]);
    }

    #[test]
    fn an_angle_that_nobody_explains_is_told_as_stale() {
        let mut bench = JointsBench::answering(2);
        bench.pass(1000, |view| {
            view.tick.angles[1] = f32::NAN;
            view.tick.age_ns[1] = 400 * MS;
        });
        bench.said(&[&[
            "the angle of servo 2 is unknown",
            "400 ms old, hold_ms = 250",
            "baud rate",
        ]]);
        bench.pass(200, |view| view.tick.angles[1] = 1.0);
        bench.said(&[&["is known"]]);
    }

    #[test]
    fn a_hand_and_its_fingers_that_are_silent_are_told_and_so_is_its_bus() {
        let mut bench = JointsBench::new(allegro());
        bench.pass(500, |_| {});
        bench.said(&[&["the hand's bus can:can2 is not there", "unknown joint angles"]]);
        bench.pass(900, |view| view.link = LinkState::Up);
        bench.said(&[&["can:can2 is up"]]);
        bench.pass(500, |_| {});
        bench.said(&[&[
            "the Allegro hand on can:can2 sends no angles",
            "taxeld only listens",
        ]]);
        let speak = |view: &mut JointsView, fingers: &[usize]| {
            view.tick.angles.fill(0.0);
            fingers.iter().for_each(|f| finger(view, *f));
        };
        bench.pass(1500, |view| speak(view, &[0, 1, 2, 3]));
        bench.said(&[&["can:can2 sends its angles"]]);
        bench.pass(2000, |view| speak(view, &[0, 1, 3]));
        bench.said(&[&["the hand's ring finger sends no angles"]]);
        let status = bench.bench.problems.status(&bench.bench.config);
        assert_eq!(
            (&status[0]["kind"], &status[0]["joint"]),
            (&json!("finger-silent"), &json!("ring 0"))
        );
        bench.pass(1000, |view| view.now_ns += S / 1000);
        assert_eq!(bench.bench.kinds(), ["hand-silent"]);
    }
}
