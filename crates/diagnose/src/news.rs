//! What is told of problems that come and are over: a sentence for each, and one for all servos that are late at the
//! same look, since a machine that is busy for a while makes many of them so.

use crate::kind::{Kind, Severity};
use crate::problem::{Place, Problem};

/// Servos that are named beside the first; further ones are counted.
const NAMED: usize = 3;

/// Something to tell.
#[derive(Debug, Clone, PartialEq)]
pub enum News {
    /// A problem has come.
    Came {
        /// How much it matters.
        severity: Severity,
        /// What is wrong and what to do.
        sentence: String,
    },
    /// A problem is over.
    Over {
        /// What is right again.
        sentence: String,
    },
}

/// A problem that is to be told of.
pub(crate) struct Told<'a> {
    pub(crate) problem: &'a Problem,
    /// How long it has been there, nanoseconds.
    pub(crate) lasted_ns: u64,
    /// Changes of it that were not told before.
    pub(crate) unsaid: u64,
}

/// That these problems have come; the joints' names are in the order of their indices.
pub(crate) fn came(told: &[Told<'_>], joints: &[String]) -> Vec<News> {
    let sentence = |group: &Vec<&Told<'_>>| {
        let first = group[0].problem;
        let found = first.found.clone() + &others(group, joints);
        let advice = first.advice.clone();
        let more = unsaid(group).map_or(String::new(), |unsaid| format!(" ({unsaid})"));
        News::Came {
            severity: first.severity(),
            sentence: Problem {
                found,
                advice,
                ..first.clone()
            }
            .sentence()
                + &more,
        }
    };
    groups(told).iter().map(sentence).collect()
}

/// That these problems are over.
pub(crate) fn over(told: &[Told<'_>], joints: &[String]) -> Vec<News> {
    let sentence = |group: &Vec<&Told<'_>>| {
        let over = &group[0].problem.over;
        let longest_ns = group.iter().map(|told| told.lasted_ns).max().unwrap_or(0);
        let lasted_s = longest_ns as f64 / 1e9;
        let more = unsaid(group).map_or(String::new(), |unsaid| format!(", {unsaid}"));
        News::Over {
            sentence: format!("{over}{} (after {lasted_s:.1} s{more})", others(group, joints)),
        }
    };
    groups(told).iter().map(sentence).collect()
}

/// Those of one sentence each, the first of which has the words.
fn groups<'a>(told: &'a [Told<'a>]) -> Vec<Vec<&'a Told<'a>>> {
    let is_late = |told: &Told<'_>| {
        told.problem.kind == Kind::ServoLate && matches!(told.problem.place, Place::Joint(_))
    };
    let mut groups: Vec<Vec<&Told<'_>>> = Vec::new();
    for one in told {
        match groups.iter_mut().find(|group| is_late(one) && is_late(group[0])) {
            Some(group) => group.push(one),
            None => groups.push(vec![one]),
        }
    }
    groups
}

/// Of how many servos beside the first the same is said, and of which.
fn others(group: &[&Told<'_>], joints: &[String]) -> String {
    let names: Vec<&str> = (group[1..].iter())
        .filter_map(|told| match told.problem.place {
            Place::Joint(joint) => Some(joints.get(joint)?.as_str()),
            _ => None,
        })
        .collect();
    let servos = match names.len() {
        0 => return String::new(),
        1 => "1 more servo".into(),
        more => format!("{more} more servos"),
    };
    let list = names[..names.len().min(NAMED)].join(", ");
    let dots = if names.len() > NAMED { ", ..." } else { "" };
    format!("; the same of {servos} ({list}{dots})")
}

fn unsaid(group: &[&Told<'_>]) -> Option<String> {
    let unsaid: u64 = group.iter().map(|told| told.unsaid).sum();
    (unsaid > 0).then(|| format!("{unsaid} changes in between were not told"))
}
