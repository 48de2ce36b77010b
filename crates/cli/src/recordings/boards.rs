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
    for (module, address) in hand.modules.iter().zip(&addresses) {
        let index = sorted.partition_point(|other| other < address);
        let first: usize = boards[..index].iter().map(|(_, taxels)| taxels).sum();
        let taxels = boards[index].1;
        if taxels != usize::from(module.taxels) {
            bail!(
                "{}: board {address} has columns of {taxels} taxels, and module {} of layout {} has {}",
                recording.name(),
                module.name,
                hand.name,
                module.taxels
            );
        }
        order.extend(first..first + taxels);
    }
    recording.reorder_taxels(&order);
    Ok(None)
}
