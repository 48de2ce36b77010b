//! Counts in columns that name boards, on the modules of a hand.

use anyhow::bail;
use taxel_record::Recording;
use taxel_skin::Layout;

/// Puts the taxels of a recording whose columns name boards (`3B0X`) where the modules of the hand are. 0, 1, 2, .. are its
/// modules in order, as `taxel convert` names them, and other numbers the addresses of its boards. Returns what is to be said.
pub(super) fn place(
    recording: &mut Recording,
    hand: impl FnOnce() -> anyhow::Result<Layout>,
) -> anyhow::Result<Option<String>> {
    let Some(boards) = recording.boards() else {
        return Ok(None);
    };
    // What does not fit at all is told by whoever uses it.
    let Some(hand) = hand().ok().filter(|hand| {
        let have_boards =
            !hand.wiring.is_empty() && hand.boards().all(|(_, _, wiring)| wiring.protocol.has_board());
        have_boards && hand.modules.len() == boards.len() && hand.len() == recording.taxels()
    }) else {
        return Ok(None);
    };
    let addresses: Vec<u32> = hand.wiring.iter().map(|wiring| wiring.board.into()).collect();
    let is_one_bus = hand.wiring.iter().all(|wiring| wiring.bus == hand.wiring[0].bus);
    let mut sorted = addresses.clone();
    sorted.sort_unstable();
    let are_addresses = is_one_bus && sorted.iter().eq(boards.iter().map(|(number, _)| number));
    let counts_from = |first: usize| {
        boards
            .iter()
            .zip(first..)
            .all(|((number, _), n)| *number as usize == n)
    };
    if are_addresses || counts_from(0) || counts_from(1) {
        let are_modules = counts_from(0) || !are_addresses;
        refuse_other_taxels(recording.name(), &hand, &boards, are_modules)?;
    }
    if counts_from(0) {
        let may_be_either = are_addresses && addresses != sorted;
        return Ok(may_be_either.then(|| {
            format!(
                "the boards in the names of its columns are taken for the modules of layout {} in order, 0 for {}, and not for \
                 the addresses of their boards",
                hand.name, hand.modules[0].name
            )
        }));
    }
    if !are_addresses {
        if counts_from(1) {
            return Ok(Some(format!(
                "the boards in the names of its columns, from 1 on, are taken for the modules of layout {} in order",
                hand.name
            )));
        }
        let numbers = |numbers: &[u32]| {
            numbers
                .iter()
                .map(u32::to_string)
                .collect::<Vec<String>>()
                .join(", ")
        };
        let named: Vec<u32> = boards.iter().map(|(number, _)| *number).collect();
        bail!(
            "{}: its columns are of boards {}, and the boards of layout {} are {}; name them so, or by the modules in order, \
             0 to {}",
            recording.name(),
            numbers(&named),
            hand.name,
            numbers(&addresses),
            addresses.len() - 1
        );
    }
    let mut order = Vec::with_capacity(recording.taxels());
    for address in &addresses {
        let index = sorted.partition_point(|other| other < address);
        let first: usize = boards[..index].iter().map(|(_, taxels)| taxels.len()).sum();
        order.extend(first..first + boards[index].1.len());
    }
    recording.reorder_taxels(&order);
    Ok(None)
}

/// Refuses columns of other taxels than the boards of the hand have: those of a board go in their order to the taxels of its
/// module, so that all behind a gap would be on the taxel before theirs. A board's own numbers may have gaps, and who counts
/// its taxels from 0 or 1 means them in order.
fn refuse_other_taxels(
    name: &str,
    hand: &Layout,
    boards: &[(u32, Vec<u32>)],
    are_modules: bool,
) -> anyhow::Result<()> {
    for (index, module) in hand.modules.iter().enumerate() {
        let address = u32::from(hand.wiring[index].board);
        let named = boards.iter().enumerate().find(|(n, (number, _))| {
            if are_modules {
                *n == index
            } else {
                *number == address
            }
        });
        let Some((_, (number, taxels))) = named else {
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
