//! Codebooks in equal steps: of force, or of its logarithm.

use taxel_hand::LevelSteps;

/// Fills a codebook with the middles of equal steps from `least` to `greatest`, both positive:
/// `least + (k - 1/2) (greatest - least) / K` of force, or `least * r^(2k - 1)` with `r = (greatest
/// / least)^(1 / 2K)` of its logarithm.
pub(crate) fn steps(of: LevelSteps, least: f64, greatest: f64, codebook: &mut [f64]) {
    if of == LevelSteps::Weber {
        let r = root(greatest / least, 2 * codebook.len() as u32);
        let mut level = least * r;
        for entry in codebook.iter_mut() {
            *entry = level.min(greatest);
            level *= r * r;
        }
    } else {
        taxel_cluster::uniform(least, greatest, codebook);
    }
}

/// The level nearest in ratio to a force: the first whose border with the next, `sqrt(mu_k
/// mu_(k+1))`, is not below the force.
pub(crate) fn nearest_in_ratio(force: f64, codebook: &[f64]) -> usize {
    let borders = codebook.windows(2);
    borders
        .take_while(|pair| force * force > pair[0] * pair[1])
        .count()
}

/// The `n`-th root of `x >= 1`, by halving and multiplication alone, so that it is the same on
/// every platform.
fn root(x: f64, n: u32) -> f64 {
    let (mut below, mut above) = (1.0, 1.0 + (x - 1.0) / f64::from(n));
    for _ in 0..1200 {
        let middle = 0.5 * (below + above);
        if middle <= below || middle >= above {
            break;
        }
        if power(middle, n) <= x {
            below = middle;
        } else {
            above = middle;
        }
    }
    below
}

/// `x^n` by squaring.
fn power(mut x: f64, mut n: u32) -> f64 {
    let mut product = 1.0;
    while n > 0 {
        if n & 1 == 1 {
            product *= x;
        }
        x *= x;
        n >>= 1;
    }
    product
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_are_roots() {
        for (x, n) in [
            (1.0, 2),
            (2.0, 2),
            (50.0, 16),
            (1e5, 510),
            (1e100, 3),
            (1.0 + 1e-12, 8),
        ] {
            let r = root(x, n);
            assert!(
                (power(r, n) / x - 1.0).abs() < 1e-12 * f64::from(n),
                "{x} {n}: {r}"
            );
        }
    }

    #[test]
    fn weber_steps_have_equal_ratios_and_equal_steps_equal_differences() {
        let mut codebook = [0.0; 5];
        steps(LevelSteps::Weber, 1.0, 1024.0, &mut codebook);
        for (level, want) in codebook.iter().zip([2.0, 8.0, 32.0, 128.0, 512.0]) {
            assert!((level / want - 1.0).abs() < 1e-12, "{codebook:?}");
        }
        steps(LevelSteps::Equal, 0.5, 10.5, &mut codebook);
        assert_eq!(codebook, [1.5, 3.5, 5.5, 7.5, 9.5]);
    }

    #[test]
    fn a_force_has_the_level_nearest_in_ratio() {
        let codebook = [2.0, 8.0, 32.0];
        for (force, want) in [(0.1, 0), (4.0, 0), (4.1, 1), (15.9, 1), (16.1, 2), (1e9, 2)] {
            assert_eq!(nearest_in_ratio(force, &codebook), want, "{force}");
        }
    }
}
