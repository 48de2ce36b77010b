mod allegro;
mod boards;
mod daemon;
mod hand;
mod hidden;
mod joints;
mod potentiometers;
mod serial_port;
mod servo_answers;
mod sharing;
mod taxels;
mod telling;

use crate::{BusView, Crowd, DaemonView, HandSetup, HandView, JointsView, Kind, News, NotReloaded, Problems};
use taxel_can::{LinkState, SourceAddress};
use taxel_hand::{Fault, Faults};
use taxel_joints::JointsConfig;
use taxel_skin::{BoardState, BoardStatus, Finding, Layout, Movement};

const MS: u64 = 1_000_000;

/// What is known of a hand, to be changed.
#[derive(Clone)]
struct Known {
    now_ns: u64,
    buses: Vec<BusView>,
    boards: Vec<BoardStatus>,
    findings: Vec<Finding>,
    moved: Movement,
    faults: Vec<Faults>,
    unchanging: Vec<bool>,
    reload_refused: Option<NotReloaded>,
    sockets_lost: Option<&'static str>,
    other_daemons: Vec<Option<String>>,
    crowd: Option<Crowd>,
}

struct Bench {
    layout: Layout,
    sources: Vec<SourceAddress>,
    joints: Option<JointsConfig>,
    problems: Problems,
    known: Known,
    said: Vec<News>,
}

impl Bench {
    /// A hand that is well.
    fn new() -> Self {
        let layout = Layout::builtin("allegro-uskin-15").expect("built in");
        Self::of(layout, &["can:can0", "can:can1"])
    }

    fn of(layout: Layout, sources: &[&str]) -> Self {
        let living = BoardStatus {
            state: BoardState::Streaming,
            ..BoardStatus::default()
        };
        let up = BusView {
            link: LinkState::Up,
            ..BusView::default()
        };
        let mut bench = Self {
            problems: Problems::default(),
            known: Known {
                now_ns: 0,
                buses: vec![up; layout.buses.len()],
                boards: vec![living; layout.modules.len()],
                findings: Vec::new(),
                moved: Movement::None,
                faults: vec![Faults::NONE; layout.len()],
                unchanging: vec![false; layout.len()],
                reload_refused: None,
                sockets_lost: None,
                other_daemons: Vec::new(),
                crowd: None,
            },
            sources: sources.iter().map(|s| s.parse().expect("a source")).collect(),
            joints: None,
            said: Vec::new(),
            layout,
        };
        bench.pass(1000, |_| {});
        assert_eq!(bench.said, []);
        bench
    }

    /// Lets time pass, with a change of the hand at each look.
    fn pass(&mut self, ms: u64, mut change: impl FnMut(&mut Known)) {
        for _ in 0..ms / 100 {
            self.known.now_ns += 100 * MS;
            change(&mut self.known);
            self.look(None);
        }
    }

    fn look(&mut self, joints: Option<&JointsView>) {
        let setup = HandSetup {
            layout: &self.layout,
            sources: &self.sources,
            silence_ns: 100 * MS,
            stale_ns: None,
            joints: self.joints.as_ref(),
            joints_share_bus: false,
        };
        let view = HandView {
            now_ns: self.known.now_ns,
            buses: &self.known.buses,
            boards: &self.known.boards,
            findings: &self.known.findings,
            moved: self.known.moved,
            faults: &self.known.faults,
            unchanging: &self.known.unchanging,
            joints,
            boards_due: true,
            daemon: DaemonView {
                reload_refused: self.known.reload_refused.as_ref(),
                sockets_lost: self.known.sockets_lost,
                other_daemons: &self.known.other_daemons,
                crowd: self.known.crowd.as_ref(),
            },
        };
        self.said.extend(self.problems.handle_view(&setup, &view));
    }

    fn kinds(&self) -> Vec<&'static str> {
        let current = self.problems.current().iter();
        current.map(|p| p.problem.kind.name()).collect()
    }

    /// The names of the modules that the problem of this number is about.
    fn modules(&self, problem: usize) -> Vec<&str> {
        let modules = &self.problems.current()[problem].problem.modules;
        modules
            .iter()
            .map(|m| self.layout.modules[*m].name.as_str())
            .collect()
    }
}

fn sentence(news: &News) -> &str {
    match news {
        News::Came { sentence, .. } | News::Over { sentence } => sentence,
    }
}

#[test]
fn every_kind_has_a_name_of_its_own_and_its_severity_is_that_of_the_guide() {
    let guide = include_str!("../../../../docs/guide.md");
    let table: Vec<&str> = guide.lines().filter(|line| line.starts_with("| `")).collect();
    for kind in Kind::ALL {
        let name = format!("`{kind}`");
        let lines: Vec<_> = (table.iter())
            .filter(|line| line.split('|').nth(1).is_some_and(|cell| cell.contains(&name)))
            .collect();
        let [line] = lines[..] else {
            panic!("{kind}: {lines:?}");
        };
        let severity = format!("{:?}", kind.severity()).to_lowercase();
        assert_eq!(
            line.split('|').nth(2).map(str::trim),
            Some(severity.as_str()),
            "{kind}"
        );
    }
}
