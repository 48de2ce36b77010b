//! Counts in columns that name boards, on the modules of a hand.

use anyhow::{anyhow, bail};
use taxel_record::Recording;
use taxel_skin::Layout;

/// Puts the taxels of a recording whose columns name boards (`3B0X`) where the modules of the hand are. 0, 1, 2, .. are its
/// modules in order, as `taxel convert` names them, and other numbers the addresses of its boards; modules without a board
/// have what is no address, ascending. Returns what is to be said.
pub(super) fn place(
    recording: &mut Recording,
    hand: impl FnOnce() -> anyhow::Result<Layout>,
) -> anyhow::Result<Option<String>> {
    let Some(boards) = recording.boards() else {
        return Ok(None);
    };
    // What does not fit at all is told by whoever uses it.
    let Some(hand) = hand().ok().filter(|hand| {
        let have_boards = hand.boards().any(|(_, _, wiring)| wiring.protocol.has_board());
        have_boards && hand.modules.len() == boards.len() && hand.len() == recording.taxels()
    }) else {
        return Ok(None);
    };
    let named: Vec<u32> = boards.iter().map(|(number, _)| *number).collect();
    let mut wired = hand.wiring.iter().filter(|wiring| wiring.protocol.has_board());
    let first_bus = wired.clone().next().map(|wiring| wiring.bus);
    let is_one_bus = wired.all(|wiring| Some(wiring.bus) == first_bus);
    let addresses = addresses(&hand, &named).filter(|_| is_one_bus);
    let counts_from = |first: u32| named.iter().copied().eq((first..).take(named.len()));
    let of_modules = match &addresses {
        Some(addresses) if !counts_from(0) => Some(addresses),
        _ if counts_from(0) || counts_from(1) => Some(&named),
        _ => None,
    };
    if let Some(of_modules) = of_modules {
        refuse_other_taxels(recording.name(), &hand, &boards, of_modules)?;
    }
    if counts_from(0) {
        let may_be_either = addresses.is_some_and(|addresses| addresses != named);
        return Ok(may_be_either.then(|| {
            format!(
                "the boards in the names of its columns are taken for the modules of layout {} in order, 0 for {}, and not for \
                 the addresses of their boards",
                hand.name, hand.modules[0].name
            )
        }));
    }
    let Some(addresses) = addresses else {
        if counts_from(1) {
            return Ok(Some(format!(
                "the boards in the names of its columns, from 1 on, are taken for the modules of layout {} in order",
                hand.name
            )));
        }
        return Err(other_boards(recording.name(), &hand, &named));
    };
    let order = addresses.iter().flat_map(|address| {
        let index = named.partition_point(|other| other < address);
        let first: usize = boards[..index].iter().map(|(_, taxels)| taxels.len()).sum();
        first..first + boards[index].1.len()
    });
    recording.reorder_taxels(&order.collect::<Vec<usize>>());
    let without: Vec<String> = (hand.boards().zip(&addresses))
        .filter(|((_, _, wiring), _)| !wiring.protocol.has_board())
        .map(|((_, module, _), number)| format!("{number} for module {}, which has no board", module.name))
        .collect();
    Ok((!without.is_empty()).then(|| {
        format!(
            "the boards in the names of its columns are taken for the addresses of those of layout {}, and {}",
            hand.name,
            without.join(", ")
        )
    }))
}

/// That the boards of a recording are none of the hand's, and how they are to be called.
fn other_boards(name: &str, hand: &Layout, named: &[u32]) -> anyhow::Error {
    let list = |numbers: &mut dyn Iterator<Item = u32>| {
        let numbers: Vec<String> = numbers.map(|number| number.to_string()).collect();
        numbers.join(", ")
    };
    let wired = hand.wiring.iter().filter(|wiring| wiring.protocol.has_board());
    let without: Vec<&str> = hand.without_board().map(|module| module.name.as_str()).collect();
    let others = match without[..] {
        [] => String::new(),
        _ => format!(" (any others for {}, without a board)", without.join(", ")),
    };
    anyhow!(
        "{name}: its columns are of boards {}, and the boards of layout {} are {}{others}; name them so, or by the modules in \
         order, 0 to {}",
        list(&mut named.iter().copied()),
        hand.name,
        list(&mut wired.map(|wiring| wiring.board.into())),
        hand.modules.len() - 1
    )
}

/// The number among `named`, ascending, that each module of the hand has, where these are the addresses of its boards; a
/// module without one has what is no address. None where they are not.
fn addresses(hand: &Layout, named: &[u32]) -> Option<Vec<u32>> {
    let own: Vec<Option<u32>> = (hand.boards())
        .map(|(_, _, wiring)| wiring.protocol.has_board().then_some(wiring.board.into()))
        .collect();
    let mut others = named
        .iter()
        .copied()
        .filter(|number| !own.contains(&Some(*number)));
    let of_modules: Vec<u32> = (own.iter())
        .map(|number| number.or_else(|| others.next()))
        .collect::<Option<_>>()?;
    let mut sorted = of_modules.clone();
    sorted.sort_unstable();
    (sorted == named).then_some(of_modules)
}

/// Refuses columns of other taxels than the boards of the hand have: those of a board go in their order to the taxels of its
/// module, so that all behind a gap would be on the taxel before theirs. A board's own numbers may have gaps, and who counts
/// its taxels from 0 or 1 means them in order. `of_modules` is the number in the names that each module has.
fn refuse_other_taxels(
    name: &str,
    hand: &Layout,
    boards: &[(u32, Vec<u32>)],
    of_modules: &[u32],
) -> anyhow::Result<()> {
    for (module, of_module) in hand.modules.iter().zip(of_modules) {
        let Some((number, taxels)) = boards.iter().find(|(number, _)| number == of_module) else {
            continue;
        };
        let mut own: Vec<u32> = hand.k_of(module).iter().copied().map(u32::from).collect();
        own.sort_unstable();
        let count = own.len() as u32;
        if *taxels == own || taxels.iter().copied().eq(0..count) || taxels.iter().copied().eq(1..=count) {
            continue;
        }
        bail!(
            "{name}: its columns of board {number} are of the taxels {}, and module {} of layout {} has the taxels {}; name \
             them so, and leave the cells of one without values empty",
            ranges(taxels),
            module.name,
            hand.name,
            ranges(&own)
        );
    }
    Ok(())
}

/// Ascending numbers in words: `0 to 2, 4, 6 to 15`.
fn ranges(numbers: &[u32]) -> String {
    let mut runs: Vec<[u32; 2]> = Vec::new();
    for &number in numbers {
        match runs.last_mut() {
            Some([_, last]) if *last + 1 == number => *last = number,
            _ => runs.push([number; 2]),
        }
    }
    let words = runs.iter().map(|[first, last]| match last - first {
        0 => first.to_string(),
        1 => format!("{first}, {last}"),
        _ => format!("{first} to {last}"),
    });
    words.collect::<Vec<_>>().join(", ")
}
