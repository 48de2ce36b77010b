//! Whose connections are too many where all places are taken.

use std::collections::BTreeMap;

/// The process with the most connections, and how many those are, where it has more than an eighth of all places: one of
/// them makes room. Given the process of each connection; those that the kernel does not tell apart count as one.
pub fn most_crowding<Process: Ord>(
    places: usize,
    processes: impl Iterator<Item = Process>,
) -> Option<(Process, usize)> {
    let mut connections = BTreeMap::<Process, usize>::new();
    for process in processes {
        *connections.entry(process).or_default() += 1;
    }
    let most = connections
        .into_iter()
        .max_by_key(|(_, connections)| *connections);
    most.filter(|(_, connections)| *connections > (places / 8).max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_process_with_the_most_crowds_the_others_once_it_has_more_than_an_eighth() {
        let connections = |of: &[(u32, usize)]| -> Vec<u32> {
            let of = of.iter().copied();
            of.flat_map(|(process, n)| std::iter::repeat_n(process, n))
                .collect()
        };
        for (places, of, expected) in [
            (128, vec![(1, 128)], Some((1, 128))),
            (128, vec![(1, 17), (2, 20), (3, 18)], Some((2, 20))),
            (128, (0..8).map(|process| (process, 16)).collect(), None),
            (8, vec![(1, 2), (2, 1)], Some((1, 2))),
            (3, vec![(1, 1), (2, 1), (3, 1)], None),
            (128, vec![], None),
        ] {
            let crowding = most_crowding(places, connections(&of).into_iter());
            assert_eq!(crowding, expected, "{places}, {of:?}");
        }
    }
}
