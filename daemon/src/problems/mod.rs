//! What is wrong with the hand and its joints now, in words that a user can act on, and what of it is new.
//!
//! Problems are looked for on the socket thread, ten times a second, in what the tick thread has counted. Each is told
//! once when it comes and once when it is over; one that comes and goes is told less and less often.

mod boards;
mod bus;
mod joints;

use crate::config::Config;
use crate::joints::JointsView;
use crate::snapshot::Snapshot;
use serde_json::{Value, json};
use std::collections::{HashMap, VecDeque};
use taxel_can::SourceCounters;
use taxel_joints::JointsConfig;

/// Counters are compared with those of this long ago, nanoseconds.
const RECENT_NS: u64 = 500_000_000;
/// So many sentences on one problem may follow each other; after that one per `SENTENCE_NS`.
const SENTENCES: u64 = 4;
const SENTENCE_NS: u64 = 10_000_000_000;

/// What kind of problem it is: the stable name that programs go by.
pub(crate) type Kind = &'static str;

/// Whose problem it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Place {
    /// A bus, by its index in the layout.
    Bus(usize),
    /// The board of a module, by its index in the layout.
    Module(usize),
    /// A CySkin hub, by its index in the layout; [`Problems`] knows which of its modules.
    Hub(u8),
    /// The joints as a whole: the servos' port, an Allegro hand.
    Joints,
    /// A joint, by its index; of an Allegro hand, the first of a finger.
    Joint(usize),
    /// Something on a bus that is not of the hand: an identifier, an address, another bus.
    Stranger(usize, u32),
}

/// One thing that is wrong.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Problem {
    pub(crate) kind: Kind,
    pub(crate) place: Place,
    /// Whether the bus or board is of no use until it is mended.
    pub(crate) severe: bool,
    /// What is wrong and what to do.
    pub(crate) sentence: String,
    /// What is right again when it is over.
    pub(crate) over: String,
}

/// Something to tell.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum News {
    Came { severe: bool, sentence: String },
    Over { sentence: String },
}

/// The problems there are, and what was told of them.
#[derive(Debug, Default)]
pub(crate) struct Problems {
    current: Vec<(Problem, u64)>,
    told: HashMap<(Kind, Place), Told>,
    recent: VecDeque<(u64, Vec<SourceCounters>, joints::Counts)>,
    steadiness: boards::Steadiness,
    /// The modules that each problem of a hub is about.
    of_hubs: boards::OfHubs,
    patience: joints::Patience,
    now_ns: u64,
}

/// How much was said of one problem.
#[derive(Debug, Clone, Copy)]
struct Told {
    /// Sentences that may be said, and since when that many.
    left: u64,
    at_ns: u64,
    unsaid: u64,
}

/// What a judgement is made from.
pub(crate) struct Look<'a> {
    pub(crate) config: &'a Config,
    pub(crate) now: &'a Snapshot,
    /// Counters of the buses a while ago.
    pub(crate) before: &'a [SourceCounters],
    /// What `before` is older by, seconds.
    pub(crate) seconds: f64,
    /// Whether every board had the time to speak up since the start.
    pub(crate) boards_due: bool,
}

impl Problems {
    /// Looks at the hand, and returns what is new.
    pub(crate) fn look(
        &mut self,
        config: &Config,
        now: &Snapshot,
        joints: Option<&JointsView>,
        boards_due: bool,
    ) -> Vec<News> {
        self.now_ns = now.now_ns;
        let counters: Vec<SourceCounters> = now.buses.iter().map(|b| b.source).collect();
        self.recent
            .push_back((now.now_ns, counters, joints::Counts::of(joints)));
        while self.recent.len() > 2 && now.now_ns.saturating_sub(self.recent[1].0) >= RECENT_NS {
            self.recent.pop_front();
        }
        let (then_ns, before, joints_before) = &self.recent[0];
        let look = Look {
            config,
            now,
            before,
            seconds: now.now_ns.saturating_sub(*then_ns).max(1) as f64 / 1e9,
            boards_due,
        };
        let mut found = Vec::new();
        for index in 0..now.buses.len() {
            let flaps = self.has("flapping", Place::Bus(index));
            bus::judge(&look, index, flaps, &mut found);
        }
        self.of_hubs = boards::judge(&look, &mut self.steadiness, &mut found);
        if let (Some(config), Some(view)) = (&config.joints, joints) {
            let current = &self.current;
            let judge = joints::Judge {
                config,
                view,
                before: joints_before,
                look: &look,
                has: &|kind, place| is_among(current, kind, place),
            };
            judge.judge(&mut self.patience, &mut found);
        }
        self.replace(found)
    }

    fn replace(&mut self, found: Vec<Problem>) -> Vec<News> {
        let now_ns = self.now_ns;
        let mut news = Vec::new();
        let old = std::mem::take(&mut self.current);
        let key = |p: &Problem| (p.kind, p.place);
        for (problem, since_ns) in &old {
            if !found.iter().any(|p| key(p) == key(problem))
                && let Some(more) = self.may_say(key(problem))
            {
                let lasted_s = now_ns.saturating_sub(*since_ns) as f64 / 1e9;
                let sentence = format!("{} (after {lasted_s:.1} s{more})", problem.over);
                news.push(News::Over { sentence });
            }
        }
        for problem in found {
            let since_ns = old
                .iter()
                .find(|(p, _)| key(p) == key(&problem))
                .map(|(_, since)| *since);
            if since_ns.is_none()
                && let Some(more) = self.may_say(key(&problem))
            {
                news.push(News::Came {
                    severe: problem.severe,
                    sentence: match more.is_empty() {
                        true => problem.sentence.clone(),
                        false => format!("{} ({})", problem.sentence, &more[2..]),
                    },
                });
            }
            self.current.push((problem, since_ns.unwrap_or(now_ns)));
        }
        news
    }

    /// Whether a sentence on this problem may be said now, with what to add on those that were not.
    fn may_say(&mut self, key: (Kind, Place)) -> Option<String> {
        let now_ns = self.now_ns;
        let told = self.told.entry(key).or_insert(Told {
            left: SENTENCES,
            at_ns: now_ns,
            unsaid: 0,
        });
        let earned = now_ns.saturating_sub(told.at_ns) / SENTENCE_NS;
        if told.left + earned >= SENTENCES {
            (told.left, told.at_ns) = (SENTENCES, now_ns);
        } else {
            told.left += earned;
            told.at_ns += earned * SENTENCE_NS;
        }
        if told.left == 0 {
            told.unsaid += 1;
            return None;
        }
        told.left -= 1;
        Some(match std::mem::take(&mut told.unsaid) {
            0 => String::new(),
            unsaid => format!(", {unsaid} changes in between were not told"),
        })
    }

    fn has(&self, kind: Kind, place: Place) -> bool {
        is_among(&self.current, kind, place)
    }

    /// The kinds of problems of one bus or board.
    pub(crate) fn kinds(&self, place: Place) -> Vec<Kind> {
        let of_place = |p: &Problem| match (p.place, place) {
            (Place::Stranger(bus, _), Place::Bus(index)) => bus == index,
            (Place::Hub(_), Place::Module(index)) => self.modules_of(p).contains(&index),
            (own, asked) => own == asked,
        };
        (self.current.iter())
            .filter(|(p, _)| of_place(p))
            .map(|(p, _)| p.kind)
            .collect()
    }

    /// The modules of a problem of a hub, one at least.
    fn modules_of(&self, problem: &Problem) -> &[usize] {
        self.of_hubs
            .get(&(problem.kind, problem.place))
            .map_or(&[], |modules| modules)
    }

    /// How many there are, and of which kinds.
    pub(crate) fn summary(&self) -> Option<String> {
        let mut kinds: Vec<Kind> = self.current.iter().map(|(p, _)| p.kind).collect();
        kinds.sort_unstable();
        kinds.dedup();
        let s = if self.current.len() == 1 { "" } else { "s" };
        (!kinds.is_empty()).then(|| format!("{} problem{s} ({})", self.current.len(), kinds.join(", ")))
    }

    /// All of them, as the status report has them.
    pub(crate) fn status(&self, config: &Config) -> Vec<Value> {
        let layout = &config.layout;
        let joints = config
            .joints
            .as_ref()
            .map_or_else(Vec::new, JointsConfig::joint_names);
        let of = |(problem, since_ns): &(Problem, u64)| {
            let modules = match &problem.place {
                Place::Module(module) => std::slice::from_ref(module),
                Place::Hub(_) => self.modules_of(problem),
                _ => &[],
            };
            let wiring = modules.first().map(|module| &layout.wiring[*module]);
            let bus = match problem.place {
                Place::Bus(bus) | Place::Stranger(bus, _) => Some(bus),
                _ => wiring.map(|w| usize::from(w.bus)),
            };
            let names: Vec<&String> = modules.iter().map(|m| &layout.modules[*m].name).collect();
            let joint = match problem.place {
                Place::Joint(joint) => joints.get(joint),
                _ => None,
            };
            json!({
                "kind": problem.kind,
                "bus": bus.map(|bus| &layout.buses[bus]),
                "board": wiring.map(|w| w.board),
                "module": names.first(),
                "modules": names,
                "joint": joint,
                "severe": problem.severe,
                "sentence": problem.sentence,
                "since_s": self.now_ns.saturating_sub(*since_ns) as f64 / 1e9,
            })
        };
        self.current.iter().map(of).collect()
    }
}

fn is_among(problems: &[(Problem, u64)], kind: Kind, place: Place) -> bool {
    problems.iter().any(|(p, _)| p.kind == kind && p.place == place)
}

#[cfg(test)]
mod tests;
