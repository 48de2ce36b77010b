//! Taxels that are dead, stuck, noisy or saturated.

use super::{AREA, HandFacts, board_name};
use crate::doctor::finding::{Check, State};
use taxel_diagnose::is_broken;
use taxel_hand::{Fault, Module, plural};
use taxel_skin::{BoardState, Layout};

pub(super) fn check(layout: &Layout, facts: &HandFacts) -> Vec<Check> {
    let speaks = |module: usize| {
        facts
            .boards
            .get(module)
            .is_some_and(|b| matches!(b.state, BoardState::Streaming | BoardState::Settling))
    };
    if !(0..layout.modules.len()).any(speaks) {
        return Vec::new();
    }
    if facts.faults.is_empty() {
        return vec![
            Check::skipped(
                AREA,
                "taxels",
                "",
                format!("no baseline in the {:.1} s that were listened to", facts.seconds),
            )
            .advise("give --seconds more"),
        ];
    }
    let mut checks = Vec::new();
    if facts.touched > 0 {
        checks.push(
            Check::warning(
                AREA,
                "touch",
                "",
                format!(
                    "{} moved while the baseline was measured",
                    plural(facts.touched as usize, "taxel")
                ),
            )
            .wanted("an untouched hand: faults of touched taxels are doubtful"),
        );
    }
    for (index, module) in layout.modules.iter().enumerate().filter(|(i, _)| speaks(*i)) {
        let (bad, words) = faults_of(layout, facts, module);
        let object = board_name(layout, index);
        let found = format!("{bad} of {}: {words}", module.taxels);
        checks.push(match (bad, is_broken(bad, module)) {
            (0, _) => Check::ok(AREA, "taxels", object, format!("{} healthy", module.taxels)),
            (_, false) => Check::warning(AREA, "taxels", object, found),
            _ => {
                Check::error(AREA, "taxels", object, found).advise("the module, its I2C cable, or its supply")
            }
        });
    }
    // What is wrong first; the rest is then told in one.
    checks.sort_by_key(|c| c.state == State::Ok);
    checks
}

/// How many taxels of a module have a fault, and which have which: `k 1, 4-7 stuck; k 9 dead`.
fn faults_of(layout: &Layout, facts: &HandFacts, module: &Module) -> (usize, String) {
    let first = usize::from(module.first_taxel);
    let mut faults: Vec<(String, Vec<u16>)> = Vec::new();
    let mut bad = 0;
    for taxel in first..first + usize::from(module.taxels) {
        let reasons: Vec<&str> = match facts.dead[taxel] {
            // Whatever else is wrong with it follows from that.
            true => vec!["dead"],
            false => facts.faults[taxel]
                .iter()
                .filter(|f| *f != Fault::Masked)
                .map(Fault::name)
                .chain(facts.saturated[taxel].then_some("saturated"))
                .collect(),
        };
        if reasons.is_empty() {
            continue;
        }
        bad += 1;
        let (reasons, k) = (reasons.join(" and "), layout.k[taxel]);
        match faults.iter_mut().find(|(known, _)| *known == reasons) {
            Some((_, numbers)) => numbers.push(k),
            None => faults.push((reasons, vec![k])),
        }
    }
    let words = faults
        .into_iter()
        .map(|(reasons, numbers)| format!("k {} {reasons}", ranges(numbers)));
    (bad, words.collect::<Vec<_>>().join("; "))
}

/// Numbers in ascending order, three or more that follow one another as a range: `1, 4-7`.
fn ranges(mut numbers: Vec<u16>) -> String {
    numbers.sort_unstable();
    let runs = numbers
        .chunk_by(|a, b| a.checked_add(1) == Some(*b))
        .map(|run| match run {
            [first, _, .., last] => format!("{first}-{last}"),
            few => few.iter().map(u16::to_string).collect::<Vec<_>>().join(", "),
        });
    runs.collect::<Vec<_>>().join(", ")
}
