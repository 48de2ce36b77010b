//! Which taxels of a hand are out of use, and why, in words.

use crate::flat::Hand;
use crate::picture::{Condition, TaxelNow, fault_in_words};
use taxel_hand::Fault;

/// Numbers of taxels that are told one by one.
const MOST_NAMED: usize = 6;

/// A sentence for the taxels of each module that are out of use for the same reason; none before the first raw frame.
pub(crate) fn out_of_use(hand: &Hand, taxels: &[TaxelNow]) -> Vec<String> {
    let mut sentences = Vec::new();
    for module in &hand.modules {
        let mut reasons: Vec<(&str, Vec<usize>)> = Vec::new();
        let of_module = taxels.get(module.taxel_range()).unwrap_or_default();
        for (number, taxel) in of_module.iter().enumerate() {
            let Some(reason) = reason(taxel) else {
                continue;
            };
            match reasons.iter_mut().find(|(other, _)| *other == reason) {
                Some((_, numbers)) => numbers.push(number),
                None => reasons.push((reason, vec![number])),
            }
        }
        for (reason, numbers) in reasons {
            let which = match numbers.len() == of_module.len() {
                true => format!("all {}", numbers.len()),
                false => listed(&numbers),
            };
            sentences.push(format!("{} {which}: {reason}", module.name));
        }
    }
    sentences
}

fn reason(taxel: &TaxelNow) -> Option<&'static str> {
    if let Condition::Force(_) = taxel.condition() {
        return None;
    }
    // What is missing has a reason of its own, or none.
    let named = taxel.raw.faults().find(|fault| *fault != Fault::Missing);
    Some(fault_in_words(named.unwrap_or(Fault::Missing)))
}

fn listed(numbers: &[usize]) -> String {
    let named: Vec<String> = numbers.iter().take(MOST_NAMED).map(usize::to_string).collect();
    match numbers.len() - named.len() {
        0 => named.join(", "),
        more => format!("{} and {more} more", named.join(", ")),
    }
}
