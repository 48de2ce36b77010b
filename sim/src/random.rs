//! Randomness as a function: a number that depends on a seed and on where it is used, never on what
//! was drawn before.
//!
//! Only integer arithmetic and exactly rounded floating point is used, so that every platform draws the same.

/// Standard deviation of the sum of four independent uniform 16 bit numbers: `sqrt(4 * (65536^2 - 1) / 12)`.
const SUM_SD: f64 = 37_837.226_988_046_87;
/// Mean of that sum.
const SUM_MEAN: f64 = 131_070.0;

/// 64 random bits that belong to `(seed, stream, index)`.
pub(crate) fn bits(seed: u64, stream: u64, index: u64) -> u64 {
    scramble(scramble(scramble(seed ^ 0x9E37_79B9_7F4A_7C15) ^ stream) ^ index)
}

/// A number in `from..=to`, from 64 random bits.
pub(crate) fn between(bits: u64, from: f64, to: f64) -> f64 {
    from + (to - from) * ((bits >> 11) as f64 / ((1u64 << 53) - 1) as f64)
}

/// Whether something of this probability happens.
pub(crate) fn happens(bits: u64, probability: f64) -> bool {
    ((bits >> 11) as f64) < probability * (1u64 << 53) as f64
}

/// A bell-shaped number of mean 0 and standard deviation 1: four uniform numbers added, so never beyond 3.47.
pub(crate) fn bell(bits: u64) -> f64 {
    let sum = (bits & 0xFFFF) + (bits >> 16 & 0xFFFF) + (bits >> 32 & 0xFFFF) + (bits >> 48);
    (sum as f64 - SUM_MEAN) / SUM_SD
}

/// The finaliser of splitmix64: a bijection that spreads every input bit over the whole word.
fn scramble(x: u64) -> u64 {
    let x = x.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ (x >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bell_has_the_mean_and_deviation_it_claims() {
        let n = 100_000;
        let (mut sum, mut squares) = (0.0, 0.0);
        for i in 0..n {
            let v = bell(bits(1, 2, i));
            sum += v;
            squares += v * v;
        }
        let mean = sum / n as f64;
        assert!(mean.abs() < 0.02, "mean {mean}");
        assert!(
            (squares / n as f64 - 1.0).abs() < 0.02,
            "variance {}",
            squares / n as f64
        );
    }

    #[test]
    fn a_probability_is_met() {
        let hits = (0..100_000).filter(|i| happens(bits(3, 4, *i), 0.1)).count();
        assert!((9_500..10_500).contains(&hits), "{hits}");
        assert!((0..1000).all(|i| happens(bits(5, 6, i), 1.0)));
        assert!(!(0..1000).any(|i| happens(bits(5, 6, i), 0.0)));
    }

    #[test]
    fn seed_stream_and_index_all_matter() {
        let all = [bits(0, 0, 0), bits(1, 0, 0), bits(0, 1, 0), bits(0, 0, 1)];
        for (i, a) in all.iter().enumerate() {
            assert!(all.iter().skip(i + 1).all(|b| a != b));
        }
    }
}
