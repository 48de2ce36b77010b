//! The problems there are, and what of them is new. Each is told once when it comes and once when
//! it is over; one that comes and goes is told less and less often.

use crate::joints::{self, AnglesUsed, JointsReadings, Patience};
use crate::kind::Kind;
use crate::news::{self, News, Told};
use crate::problem::{Place, Problem};
use crate::rate_limiter::RateLimiter;
use crate::view::{HandSetup, HandView, Look};
use crate::{array, boards, bus, readers, traffic};
use std::collections::{HashMap, VecDeque};
use taxel_can::SourceCounters;
use taxel_joints::JointsConfig;

/// Counters are compared with those of this long ago, nanoseconds.
const RECENT_NS: u64 = 500_000_000;

/// A problem that there is.
#[derive(Debug, Clone, PartialEq)]
pub struct CurrentProblem {
    /// The problem, in its newest figures.
    pub problem: Problem,
    /// Since when, nanoseconds on the clock of the views.
    pub since_ns: u64,
}

/// The problems there are, and what was told of them. It is given a [`HandView`] several times a second.
#[derive(Debug, Default)]
pub struct Problems {
    current: Vec<CurrentProblem>,
    limiters: HashMap<(Kind, Place), RateLimiter>,
    recent: VecDeque<(u64, Vec<SourceCounters>, JointsReadings)>,
    steadiness: boards::Steadiness,
    patience: Patience,
    angles_used: AnglesUsed,
    now_ns: u64,
}

impl Problems {
    /// Judges what is known of the hand now, and returns what is new.
    pub fn handle_view(&mut self, setup: &HandSetup<'_>, view: &HandView<'_>) -> Vec<News> {
        self.now_ns = view.now_ns;
        let counters: Vec<SourceCounters> = view.buses.iter().map(|b| b.counters).collect();
        let readings = JointsReadings::of(view.joints);
        self.recent.push_back((view.now_ns, counters, readings));
        while self.recent.len() > 2 && view.now_ns.saturating_sub(self.recent[1].0) >= RECENT_NS {
            self.recent.pop_front();
        }
        let (then_ns, before, joints_before) = &self.recent[0];
        let look = Look {
            setup,
            view,
            before,
            seconds: view.now_ns.saturating_sub(*then_ns).max(1) as f64 / 1e9,
        };
        let current = &self.current;
        let has = |kind, place| is_among(current, kind, place);
        let mut found = Vec::new();
        for index in 0..view.buses.len() {
            let flapped = has(Kind::Flapping, Place::Bus(index));
            bus::judge(&look, index, flapped, &mut found);
            array::judge(&look, index, &mut found);
        }
        traffic::judge(&look, &mut found);
        boards::judge(&look, &mut self.steadiness, &mut found);
        if let (Some(config), Some(view)) = (setup.joints, view.joints) {
            let judge = joints::Judge {
                config,
                view,
                before: joints_before,
                look: &look,
                has: &has,
            };
            judge.judge(&mut self.patience, &mut self.angles_used, &mut found);
        }
        found.extend(view.reload_refused.map(reload_refused));
        found.extend(view.sockets_lost.map(sockets_lost));
        found.extend(view.crowd.map(readers::turned_away));
        let joints = setup.joints.map(JointsConfig::joint_names).unwrap_or_default();
        self.replace(found, &joints)
    }

    fn replace(&mut self, found: Vec<Problem>, joints: &[String]) -> Vec<News> {
        let now_ns = self.now_ns;
        let old = std::mem::take(&mut self.current);
        let (mut over, mut came) = (Vec::new(), Vec::new());
        for CurrentProblem { problem, since_ns } in &old {
            if !found.iter().any(|p| p.is_same(problem))
                && let Some(unsaid) = self.poll_limiter(problem)
            {
                over.push(Told {
                    problem,
                    lasted_ns: now_ns.saturating_sub(*since_ns),
                    unsaid,
                });
            }
        }
        for problem in &found {
            let before = old.iter().find(|p| p.problem.is_same(problem));
            if before.is_none()
                && let Some(unsaid) = self.poll_limiter(problem)
            {
                came.push(Told {
                    problem,
                    lasted_ns: 0,
                    unsaid,
                });
            }
            self.current.push(CurrentProblem {
                problem: problem.clone(),
                since_ns: before.map_or(now_ns, |p| p.since_ns),
            });
        }
        [news::over(&over, joints), news::came(&came, joints)].concat()
    }

    /// Whether a sentence on this problem may be said now, with how many changes of it were not told.
    fn poll_limiter(&mut self, problem: &Problem) -> Option<u64> {
        let limiter = (self.limiters.entry((problem.kind, problem.place)))
            .or_insert_with(|| RateLimiter::new(self.now_ns));
        limiter.poll(self.now_ns)
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

fn reload_refused(why: &str) -> Problem {
    Problem::new(
        Kind::ReloadRefused,
        Place::Daemon,
        format!("the configuration was read again and is refused: {why}"),
        "The one before goes on. Mend the file, and have it read again",
        "the configuration was read again and is taken up",
    )
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

fn is_among(problems: &[CurrentProblem], kind: Kind, place: Place) -> bool {
    problems
        .iter()
        .any(|p| (p.problem.kind, p.problem.place) == (kind, place))
}
