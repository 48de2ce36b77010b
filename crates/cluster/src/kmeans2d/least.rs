//! The least that any clusters of some points can cost.

use super::steps::{LANES, lesser};

/// Steps of points whose least cost is looked for: with more it takes longer than it saves.
const MOST_STEPS: usize = 8;
/// The bits of a number that make room for a point.
const TAG: u32 = (LANES * MOST_STEPS - 1) as u32;
/// No distance.
const NONE: f32 = f32::MAX;

/// A number that the sum of squared distances of points from the means of their clusters cannot be less than (but for
/// rounding), however they are clustered: half the `n - clusters` shortest edges of their minimum spanning tree, squared.
/// 0 where there are too many points to look for it.
///
/// A cluster of `m` points costs the squared distances of all its pairs, divided by `m`. Of all paths through its points
/// each pair is on the share `2 / m`. So the mean of the paths is twice the cost; none is shorter than the least tree.
/// Trees of all clusters are a forest of `n - clusters` edges or more, and those of the spanning tree are the least.
pub(super) fn least_cost(points: [&[[f32; LANES]]; 3], n: usize, clusters: usize) -> f64 {
    let [x, y, z] = points;
    let mut edges = [NONE; LANES * MOST_STEPS];
    if n > edges.len() || n <= clusters {
        return 0.0;
    }
    // Prim's algorithm. What is in the tree has no place any more, and is nearest to nothing.
    let mut out = [[f32::NAN; LANES]; MOST_STEPS];
    out[..x.len()].copy_from_slice(x);
    out.as_flattened_mut()[n..].fill(f32::NAN);
    let mut near = [[NONE; LANES]; MOST_STEPS];
    let mut last = 0;
    for edge in &mut edges[..n - 1] {
        let (step, lane) = (last / LANES, last % LANES);
        let at = [x[step][lane], y[step][lane], z[step][lane]];
        out[step][lane] = f32::NAN;
        near[step][lane] = NONE;
        let mut least = [NONE; LANES];
        for (step, ((x, y), z)) in out.iter().zip(y).zip(z).enumerate() {
            for lane in 0..LANES {
                let (dx, dy, dz) = (x[lane] - at[0], y[lane] - at[1], z[lane] - at[2]);
                let distance = dx * dx + dy * dy + dz * dz;
                let tag = (LANES * step + lane) as u32;
                let tagged = f32::from_bits(distance.to_bits() & !TAG | tag);
                near[step][lane] = lesser(tagged, near[step][lane]);
                least[lane] = lesser(near[step][lane], least[lane]);
            }
        }
        for half in [4, 2, 1] {
            for lane in 0..half {
                least[lane] = lesser(least[lane + half], least[lane]);
            }
        }
        *edge = f32::from_bits(least[0].to_bits() & !TAG);
        last = (least[0].to_bits() & TAG) as usize;
    }
    let (shortest, ..) = edges[..n].select_nth_unstable_by(n - clusters, f32::total_cmp);
    0.5 * shortest.iter().map(|edge| f64::from(*edge)).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn least(points: &[[f32; 3]], clusters: usize) -> f64 {
        let column = |c: usize| -> Vec<[f32; LANES]> {
            let steps = points.chunks(LANES);
            steps
                .map(|step| std::array::from_fn(|lane| step.get(lane).unwrap_or(&step[step.len() - 1])[c]))
                .collect()
        };
        least_cost([&column(0), &column(1), &column(2)], points.len(), clusters)
    }

    /// Sum of squared distances of points from the means of their clusters.
    fn cost(points: &[[f32; 3]], labels: &[usize], clusters: usize) -> f64 {
        let of = |id| points.iter().zip(labels).filter(move |(_, label)| **label == id);
        let sum = |id: usize, c: usize| of(id).map(|(point, _)| f64::from(point[c])).sum::<f64>();
        (0..clusters)
            .flat_map(|id| (0..3).map(move |c| (id, c)))
            .map(|(id, c)| {
                let mean = sum(id, c) / of(id).count() as f64;
                of(id)
                    .map(|(point, _)| (f64::from(point[c]) - mean).powi(2))
                    .sum::<f64>()
            })
            .sum()
    }

    proptest! {
        #[test]
        fn no_clusters_cost_less_than_the_least(
            points in prop::collection::vec((0u8..9, 0u8..9, 0.0f32..1.0, 0usize..9), 1..=64),
            clusters in 1usize..9,
        ) {
            let labels: Vec<usize> = points.iter().map(|(.., label)| label % clusters).collect();
            let points: Vec<_> = points.iter().map(|(x, y, z, _)| [f32::from(*x), f32::from(*y), *z]).collect();
            prop_assert!(0.999_9 * least(&points, clusters) <= cost(&points, &labels, clusters));
        }
    }

    #[test]
    fn pairs_that_are_nearest_to_each_other_cost_the_least() {
        let points: Vec<[f32; 3]> = (0..64u8)
            .map(|n| [f32::from(n / 2) * 5.0 + f32::from(n % 2), 3.0, f32::from(n % 2)])
            .collect();
        for pairs in 1..32 {
            let least = least(&points, points.len() - pairs);
            assert!(
                (least - pairs as f64).abs() < 1e-4 * least,
                "{pairs} pairs: {least}"
            );
        }
    }

    #[test]
    fn points_in_one_place_cost_nothing_and_too_many_are_not_looked_at() {
        assert_eq!(least(&[[1.0; 3]; 9], 4), 0.0);
        assert_eq!(least(&[[1.0; 3], [2.0; 3]], 2), 0.0);
        let line: Vec<[f32; 3]> = (0..65u8).map(|n| [f32::from(n), 0.0, 0.0]).collect();
        assert_eq!(least(&line, 4), 0.0);
        assert!(least(&line[..64], 4) > 29.9);
    }
}
