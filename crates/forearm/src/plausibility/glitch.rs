//! Single samples of a potentiometer that their neighbours know nothing of.

/// A sample further than this from the middle one of itself and its two neighbours is a glitch, degrees. Nine are in the
/// 148,200 public samples of potentiometers.
const GLITCH_DEG: f64 = 4.0;

/// A column with the middle value of three in place of glitches. The first and the newest sample are compared with the two
/// beside them. What is not a number stays so, and is nobody's neighbour.
pub(crate) fn without_glitches(column: &[f64]) -> Vec<f64> {
    let known: Vec<usize> = (0..column.len()).filter(|row| column[*row].is_finite()).collect();
    let mut sound = column.to_vec();
    for (n, row) in known.iter().enumerate() {
        let first = n.saturating_sub(1).min(known.len().saturating_sub(3));
        if let Some(&[a, b, c]) = known.get(first..first + 3) {
            let [a, b, c] = [a, b, c].map(|row| column[row]);
            let middle = a.max(b).min(a.min(b).max(c));
            if (column[*row] - middle).abs() > GLITCH_DEG {
                sound[*row] = middle;
            }
        }
    }
    sound
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_that_neither_neighbour_knows_of_is_passed_over_and_a_step_is_not() {
        let ramp: Vec<f64> = (0..20).map(|row| 40.0 + 5.0 * f64::from(row)).collect();
        let inner = |column: &[f64]| without_glitches(column)[1..19].to_vec();
        assert_eq!(inner(&ramp), ramp[1..19]);
        let flat = [40.0, f64::NAN, 40.5, 40.0, f64::NAN, f64::NAN, 41.0, 41.0];
        for row in [0, 2, 3, 6, 7] {
            for off in [6.0, -20.0] {
                let mut column = flat;
                column[row] += off;
                let sound = without_glitches(&column);
                for (sound, flat) in sound.iter().zip(flat) {
                    assert!(
                        (sound - flat).abs() <= 1.0 || flat.is_nan() && sound.is_nan(),
                        "{row}: {sound}"
                    );
                }
            }
        }
        let step = [40.0, 40.0, 40.0, 60.0, 60.0];
        assert_eq!(without_glitches(&step), step);
        assert_eq!(without_glitches(&[40.0, 60.0]), [40.0, 60.0]);
    }
}
