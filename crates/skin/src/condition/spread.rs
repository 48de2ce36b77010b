//! Medians, and how far values are from them.

/// Makes the median absolute deviation of a normal distribution its standard deviation.
pub(super) const MAD_TO_SIGMA: f64 = 1.4826;

/// Median of integers, the mean of the middle two where their number is even. Reorders them; they
/// must not be empty.
pub(super) fn median(values: &mut [i32]) -> f64 {
    let (length, middle) = (values.len(), values.len() / 2);
    let (below, upper, _) = values.select_nth_unstable(middle);
    let upper = f64::from(*upper);
    if length % 2 == 1 {
        return upper;
    }
    let lower = f64::from(
        *below
            .iter()
            .max()
            .expect("an even number of values has one below the middle"),
    );
    (lower + upper) / 2.0
}

/// Median and 1.4826 MAD of finite numbers; zeros where there are none. Reorders them.
pub(super) fn robust_spread(values: &mut [f64]) -> (f64, f64) {
    if values.is_empty() {
        return (0.0, 0.0);
    }
    let middle = values.len() / 2;
    let centre = *values.select_nth_unstable_by(middle, f64::total_cmp).1;
    for v in values.iter_mut() {
        *v = (*v - centre).abs();
    }
    (
        centre,
        MAD_TO_SIGMA * *values.select_nth_unstable_by(middle, f64::total_cmp).1,
    )
}
