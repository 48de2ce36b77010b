//! The problems there are, and what of them is new. Each is told once when it comes and once when
//! it is over; one that comes and goes is told less and less often, and how it is in the end is told all the same.

use crate::hidden::hides;
use crate::joints::{self, AnglesUsed, JointsReadings, Patience};
use crate::kind::Kind;
use crate::news::{self, News, Told};
use crate::problem::{Place, Problem};
use crate::rate_limiter::Telling;
use crate::view::{HandSetup, HandView, Look};
use crate::{array, boards, bus, contacts, malformed, readers, reload, sharing, taxels, traffic};
use std::collections::{HashMap, VecDeque};
use taxel_can::SourceCounters;
use taxel_joints::JointsConfig;
use taxel_skin::{BoardStatus, Layout};

/// Counters are compared with those of this long ago, nanoseconds.
const RECENT_NS: u64 = 500_000_000;
/// Whoever looks several times a second was held up where two views are farther apart than this, nanoseconds: it was
/// stopped, or the machine slept.
const HELD_UP_NS: u64 = 500_000_000;
/// What was hidden is judged again so long after it was so last, nanoseconds: until boards and servos were heard or waited for
/// and their counters say how they stand.
const HIDDEN_NS: u64 = 1_500_000_000;

/// A problem that there is.
#[derive(Debug, Clone, PartialEq)]
pub struct CurrentProblem {
    /// The problem, in its newest figures.
    pub problem: Problem,
    /// Since when, nanoseconds on the clock of the views.
    pub since_ns: u64,
}

/// A problem that is over.
#[derive(Debug)]
struct Gone {
    problem: Problem,
    /// How long it was there, nanoseconds.
    lasted_ns: u64,
}

/// What had been counted at an earlier look.
#[derive(Debug)]
struct Past {
    at_ns: u64,
    buses: Vec<SourceCounters>,
    boards: Vec<BoardStatus>,
    joints: JointsReadings,
}

/// The problems there are, and what was told of them. It is given a [`HandView`] several times a second.
#[derive(Debug, Default)]
pub struct Problems {
    current: Vec<CurrentProblem>,
    /// Those that were found before something hid whether there still are, and when it did last. Nothing is said of them.
    hidden: Vec<(CurrentProblem, u64)>,
    /// Those that are over, which is still to be told.
    gone: Vec<Gone>,
    tellings: HashMap<(Kind, Place), Telling>,
    recent: VecDeque<Past>,
    steadiness: boards::Steadiness,
    broken: taxels::Broken,
    sharing: sharing::Sharing,
    patience: Patience,
    angles_used: AnglesUsed,
    now_ns: u64,
    /// The time of the first view behind the last that was held up; 0 where none was.
    awake_ns: u64,
}

impl Problems {
    /// Judges what is known of the hand now, and returns what is new.
    pub fn handle_view(&mut self, setup: &HandSetup<'_>, view: &HandView<'_>) -> Vec<News> {
        self.now_ns = view.now_ns;
        let before_ns = self.recent.back().map_or(view.now_ns, |past| past.at_ns);
        if view.now_ns.saturating_sub(before_ns) > HELD_UP_NS {
            self.awake_ns = view.now_ns;
        }
        self.recent.push_back(Past {
            at_ns: view.now_ns,
            buses: view.buses.iter().map(|b| b.counters).collect(),
            boards: view.boards.to_vec(),
            joints: JointsReadings::of(view.joints),
        });
        while self.recent.len() > 2 && view.now_ns.saturating_sub(self.recent[1].at_ns) >= RECENT_NS {
            self.recent.pop_front();
        }
        let past = &self.recent[0];
        let look = Look {
            setup,
            view,
            before: &past.buses,
            boards_before: &past.boards,
            seconds: view.now_ns.saturating_sub(past.at_ns).max(1) as f64 / 1e9,
            awake_ns: self.awake_ns,
        };
        let hidden = self.hidden.iter().map(|(hidden, _)| hidden);
        let there: Vec<&CurrentProblem> = self.current.iter().chain(hidden).collect();
        let had = |kind, place| among(&there, kind, place);
        let mut found = Vec::new();
        for index in 0..view.buses.len() {
            let flapped = had(Kind::Flapping, Place::Bus(index)).is_some();
            bus::judge(&look, index, flapped, &mut found);
            array::judge(&look, index, &mut found);
        }
        traffic::judge(&look, &mut found);
        let had_malformed = |place| had(Kind::BoardMalformed, place).is_some();
        malformed::judge(&look, had_malformed, &mut found);
        boards::judge(&look, &mut self.steadiness, &mut found);
        self.broken.judge(&look, &mut found);
        contacts::judge(&look, &mut found);
        self.sharing.judge(&look, &mut found);
        if let (Some(config), Some(view)) = (setup.joints, view.joints) {
            let judge = joints::Judge {
                config,
                view,
                before: &past.joints,
                look: &look,
                had: &had,
            };
            judge.judge(&mut self.patience, &mut self.angles_used, &mut found);
        }
        found.extend(view.daemon.reload_refused.map(reload::refused));
        found.extend(view.daemon.sockets_lost.map(sockets_lost));
        found.extend(view.daemon.crowd.map(readers::turned_away));
        let joints = setup.joints.map(JointsConfig::joint_names).unwrap_or_default();
        self.replace(found, setup.layout, &joints)
    }

    fn replace(&mut self, found: Vec<Problem>, layout: &Layout, joints: &[String]) -> Vec<News> {
        let now_ns = self.now_ns;
        let seen = std::mem::take(&mut self.current).into_iter();
        let mut old: Vec<_> = seen.map(|seen| (seen, None)).collect();
        let hidden = std::mem::take(&mut self.hidden).into_iter();
        old.extend(hidden.map(|(hidden, at_ns)| (hidden, Some(at_ns))));
        for problem in found {
            let before = old.iter().position(|(p, _)| p.problem.is_same(&problem));
            let since_ns = match before {
                Some(before) => old.remove(before).0.since_ns,
                None => {
                    self.telling(&problem).change(now_ns);
                    now_ns
                }
            };
            self.gone.retain(|gone| !gone.problem.is_same(&problem));
            self.current.push(CurrentProblem { problem, since_ns });
        }
        for (one, hidden_ns) in old {
            let is_hidden = self
                .current
                .iter()
                .any(|p| hides(&p.problem, &one.problem, layout));
            let hidden_ns = if is_hidden { Some(now_ns) } else { hidden_ns };
            if let Some(at_ns) = hidden_ns.filter(|at_ns| now_ns.saturating_sub(*at_ns) < HIDDEN_NS) {
                self.hidden.push((one, at_ns));
                continue;
            }
            let CurrentProblem { problem, since_ns } = one;
            let lasted_ns = now_ns.saturating_sub(since_ns);
            self.telling(&problem).change(now_ns);
            self.gone.push(Gone { problem, lasted_ns });
        }
        [self.tell_over(joints), self.tell_came(joints)].concat()
    }

    /// Says of those that are over what may be said now. Nothing is to be said of one that was not told when it came.
    fn tell_over(&mut self, joints: &[String]) -> Vec<News> {
        let gone = std::mem::take(&mut self.gone);
        let mut over = Vec::new();
        for one in gone {
            let now_ns = self.now_ns;
            let telling = self.telling(&one.problem);
            match telling.poll(false, now_ns) {
                Some(unsaid) => over.push((one, unsaid)),
                None if telling.owes(false) => self.gone.push(one),
                None => {}
            }
        }
        let told: Vec<Told<'_>> = (over.iter())
            .map(|(Gone { problem, lasted_ns }, unsaid)| Told {
                problem,
                lasted_ns: *lasted_ns,
                unsaid: *unsaid,
            })
            .collect();
        news::over(&told, joints)
    }

    /// Says of those that there are what may be said now.
    fn tell_came(&mut self, joints: &[String]) -> Vec<News> {
        let mut told = Vec::new();
        for CurrentProblem { problem, .. } in &self.current {
            let telling = self.tellings.get_mut(&(problem.kind, problem.place));
            if let Some(unsaid) = telling.and_then(|telling| telling.poll(true, self.now_ns)) {
                told.push(Told {
                    problem,
                    lasted_ns: 0,
                    unsaid,
                });
            }
        }
        news::came(&told, joints)
    }

    fn telling(&mut self, problem: &Problem) -> &mut Telling {
        let now_ns = self.now_ns;
        (self.tellings.entry((problem.kind, problem.place))).or_insert_with(|| Telling::new(now_ns))
    }

    /// Those there are now.
    pub fn current(&self) -> &[CurrentProblem] {
        &self.current
    }

    /// The time of the newest view, nanoseconds.
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// The kinds of problems of one bus, board or joint.
    pub fn kinds(&self, place: Place) -> Vec<Kind> {
        let of_place = self.current.iter().filter(|p| p.problem.is_of(place));
        of_place.map(|p| p.problem.kind).collect()
    }

    /// How many there are, and of which kinds; `None` where there are none.
    pub fn summary(&self) -> Option<String> {
        let mut kinds: Vec<&str> = self.current.iter().map(|p| p.problem.kind.name()).collect();
        kinds.sort_unstable();
        kinds.dedup();
        let s = if self.current.len() == 1 { "" } else { "s" };
        (!kinds.is_empty()).then(|| format!("{} problem{s} ({})", self.current.len(), kinds.join(", ")))
    }
}

fn sockets_lost(which: &str) -> Problem {
    Problem::new(
        Kind::SocketsLost,
        Place::Daemon,
        format!("nobody can connect any more to {which}"),
        "Whoever is connected has stayed so; it is tried again each second",
        "every socket can be connected to again",
    )
}

fn among<'a>(problems: &[&'a CurrentProblem], kind: Kind, place: Place) -> Option<&'a Problem> {
    let mut problems = problems.iter().map(|p| &p.problem);
    problems.find(|p| (p.kind, p.place) == (kind, place))
}
