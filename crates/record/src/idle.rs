//! The level at which a taxel idles, taken off its magnitudes.

use crate::error::RecordError;

/// Takes from each taxel's magnitudes the median of its first `frames`; what is not a number stays so, and does not count.
/// `values` is frame after frame of `taxels` each.
///
/// # Errors
/// Where `frames` is none or more than there are.
pub(crate) fn subtract(
    at: &str,
    taxels: usize,
    frames: usize,
    values: &mut [f64],
) -> Result<(), RecordError> {
    let len = values.len() / taxels;
    if !(1..=len).contains(&frames) {
        let reason = format!("has {len} frames; taxels cannot idle in the first {frames} of them");
        return Err(RecordError::unfit(at, reason));
    }
    let mut first = Vec::with_capacity(frames);
    for taxel in 0..taxels {
        let of_taxel = values.iter().skip(taxel).step_by(taxels);
        first.clear();
        first.extend(of_taxel.take(frames).filter(|value| !value.is_nan()));
        let idle = median(&mut first);
        for value in values.iter_mut().skip(taxel).step_by(taxels) {
            *value -= idle;
        }
    }
    Ok(())
}

/// The middle value, or the mean of the two; 0 where there is none.
fn median(values: &mut [f64]) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() {
        0 => 0.0,
        odd if odd % 2 == 1 => values[middle],
        _ => values[middle - 1] / 2.0 + values[middle] / 2.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_taxel_idles_at_the_median_of_its_first_frames() {
        let nan = f64::NAN;
        let mut values = [
            5.0, 100.0, nan, 6.0, 104.0, nan, 50.0, 101.0, 3.0, 9.0, 130.0, 4.0,
        ];
        subtract("test", 3, 3, &mut values).unwrap();
        assert_eq!(values[..2], [-1.0, -1.0]);
        // What is missing does not count.
        assert!(values[2].is_nan() && values[5].is_nan());
        assert_eq!(values[8..], [0.0, 3.0, 29.0, 1.0]);

        let mut unheard = [nan, nan, 7.0];
        subtract("test", 1, 2, &mut unheard).unwrap();
        assert_eq!(unheard[2], 7.0);

        let mut even = [1.0, 3.0, 10.0];
        subtract("test", 1, 2, &mut even).unwrap();
        assert_eq!(even, [-1.0, 1.0, 8.0]);
    }

    #[test]
    fn there_is_a_frame_to_idle_in() {
        for frames in [0, 3] {
            let error = subtract("test", 2, frames, &mut [1.0; 4])
                .unwrap_err()
                .to_string();
            assert!(error.contains("test has 2 frames"), "{error}");
        }
    }
}
