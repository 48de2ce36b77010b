//! Numbers of categories.

/// Labels numbered in the order of their first touches: equal for equal partitions.
pub(crate) fn canonical(labels: &[usize]) -> Vec<usize> {
    let mut seen: Vec<usize> = Vec::new();
    let number = |label: &usize| match seen.iter().position(|s| s == label) {
        Some(number) => number,
        None => {
            seen.push(*label);
            seen.len() - 1
        }
    };
    labels.iter().map(number).collect()
}
