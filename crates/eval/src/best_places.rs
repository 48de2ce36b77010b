//! The least error known for `K` actuators: the reference of the actuator stage.

use crate::plane::squared_distance;
use taxel_cluster::Random;

/// Runs of k-means++ whose best places are compared with.
pub const RESTARTS: u32 = 64;

/// Lloyd's iterations of one run at most; runs on the recordings end after 10 to 20, the longest
/// known after 52.
const ITERATIONS: u32 = 300;

/// The least sum of squared distances, in the unit of the places squared, of `places` from the means of `clusters`
/// clusters that `restarts` runs find.
///
/// A run seeds with k-means++ (Arthur and Vassilvitskii 2007: each further centre is a place drawn
/// with probability proportional to its squared distance from the nearest centre so far) and
/// iterates Lloyd's step until no place changes its cluster. The optimum itself is out of reach
/// (the problem is NP-hard); a method can therefore be better than this. Random numbers are
/// SplitMix64 from a constant seed: the same places in the same order give the same result. Zero
/// where there are no more places than clusters.
pub(crate) fn least_place_error(places: &[[f64; 2]], clusters: usize, restarts: u32) -> f64 {
    if places.len() <= clusters {
        return 0.0;
    }
    assert!(clusters > 0, "places without actuators");
    let mut run = Run::new(places, clusters);
    let mut random = Random::new(0x7461_7865_6c20_6576);
    (0..restarts)
        .map(|_| run.error(&mut random))
        .fold(f64::INFINITY, f64::min)
}

/// One run and its memory.
struct Run {
    places: Vec<[f64; 2]>,
    centres: Vec<[f64; 2]>,
    nearest: Vec<f64>,
    labels: Vec<usize>,
}

impl Run {
    fn new(places: &[[f64; 2]], clusters: usize) -> Self {
        Self {
            places: places.to_vec(),
            centres: Vec::with_capacity(clusters),
            nearest: vec![0.0; places.len()],
            labels: vec![0; places.len()],
        }
    }

    fn error(&mut self, random: &mut Random) -> f64 {
        self.seed(random);
        self.labels.fill(usize::MAX);
        for _ in 0..ITERATIONS {
            if !self.assign() {
                break;
            }
            self.centre();
        }
        self.nearest.iter().sum()
    }

    fn seed(&mut self, random: &mut Random) {
        let clusters = self.centres.capacity();
        self.centres.clear();
        let first = (random.unit() * self.places.len() as f64) as usize;
        self.centres.push(self.places[first]);
        self.nearest.fill(f64::INFINITY);
        while self.centres.len() < clusters {
            let newest = self.centres[self.centres.len() - 1];
            let mut total = 0.0;
            for (place, nearest) in self.places.iter().zip(&mut self.nearest) {
                *nearest = nearest.min(squared_distance(*place, newest));
                total += *nearest;
            }
            let mut left = random.unit() * total;
            let drawn = self.nearest.iter().position(|d| {
                left -= d;
                left < 0.0
            });
            self.centres
                .push(self.places[drawn.unwrap_or(self.places.len() - 1)]);
        }
    }

    /// Gives each place its nearest centre; says whether any has another than before.
    fn assign(&mut self) -> bool {
        let mut changed = false;
        for ((place, label), nearest) in self.places.iter().zip(&mut self.labels).zip(&mut self.nearest) {
            let (mut least, mut at) = (f64::INFINITY, 0);
            for (k, centre) in self.centres.iter().enumerate() {
                let distance = squared_distance(*place, *centre);
                if distance < least {
                    (least, at) = (distance, k);
                }
            }
            changed |= *label != at;
            (*label, *nearest) = (at, least);
        }
        changed
    }

    /// Moves each centre to the mean of its places; a centre without places stays.
    fn centre(&mut self) {
        let mut sums = vec![[0.0; 3]; self.centres.len()];
        for (place, label) in self.places.iter().zip(&self.labels) {
            let sum = &mut sums[*label];
            sum[0] += place[0];
            sum[1] += place[1];
            sum[2] += 1.0;
        }
        for (centre, [x, y, count]) in self.centres.iter_mut().zip(sums) {
            if count > 0.0 {
                *centre = [x / count, y / count];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn least_place_error(pixels: &[[u16; 2]], clusters: usize, restarts: u32) -> f64 {
        let places: Vec<_> = pixels.iter().map(|p| p.map(f64::from)).collect();
        super::least_place_error(&places, clusters, restarts)
    }

    #[test]
    fn small_cases_are_as_computed_by_hand() {
        for (name, places, clusters, want) in [
            ("nothing", &[][..], 2, 0.0),
            ("as many actuators as places", &[[0, 0], [5, 5]], 2, 0.0),
            ("one actuator", &[[0, 0], [2, 0], [0, 2], [2, 2]], 1, 8.0),
            ("a square in halves", &[[0, 0], [2, 0], [0, 2], [2, 2]], 2, 4.0),
            (
                "a line",
                &[[0, 0], [1, 0], [10, 0], [11, 0], [20, 0], [21, 0]],
                3,
                1.5,
            ),
        ] {
            assert_eq!(least_place_error(places, clusters, RESTARTS), want, "{name}");
        }
    }

    #[test]
    fn many_runs_find_what_one_misses() {
        let places: Vec<[u16; 2]> = (0..60).map(|n| [(n * 7) % 16, (n * 13) % 17]).collect();
        let (one, many) = (
            least_place_error(&places, 8, 1),
            least_place_error(&places, 8, RESTARTS),
        );
        assert!(many < one, "{many} and {one}");
    }

    /// Every way to give places to clusters.
    fn exhaustive(places: &[[u16; 2]], clusters: usize) -> f64 {
        let ways = clusters.pow(places.len() as u32);
        let error = |way: usize| {
            let label = |n: usize| way / clusters.pow(n as u32) % clusters;
            let mut total = 0.0;
            for k in 0..clusters {
                let mine: Vec<[f64; 2]> = (0..places.len())
                    .filter(|n| label(*n) == k)
                    .map(|n| places[n].map(f64::from))
                    .collect();
                let count = mine.len() as f64;
                let mean = [0, 1].map(|axis| mine.iter().map(|p| p[axis]).sum::<f64>() / count);
                total += mine.iter().map(|p| squared_distance(*p, mean)).sum::<f64>();
            }
            total
        };
        (0..ways).map(error).fold(f64::INFINITY, f64::min)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn it_is_never_below_the_optimum(
            places in prop::collection::btree_set((0u16..8, 0u16..8), 1..8),
            clusters in 1usize..4,
        ) {
            let places: Vec<[u16; 2]> = places.into_iter().map(|(x, y)| [x, y]).collect();
            let (got, want) = (least_place_error(&places, clusters, RESTARTS), exhaustive(&places, clusters));
            prop_assert!(got > want - 1e-9, "{} and {}", got, want);
        }
    }

    /// Lloyd's step cannot reach every optimum from places as centres: of (0, 6), (4, 0), (7, 5) and (7, 6) in two clusters no
    /// seed leads to it.
    #[test]
    fn of_few_places_it_is_nearly_always_the_optimum() {
        let mut random = Random::new(1);
        let mut draw = |below: u16| (random.unit() * f64::from(below)) as u16;
        let (mut missed, mut worst) = (0, 1.0_f64);
        for _ in 0..400 {
            let count = 1 + draw(7);
            let mut places: Vec<[u16; 2]> = (0..count).map(|_| [draw(8), draw(8)]).collect();
            places.sort_unstable();
            places.dedup();
            let clusters = 1 + usize::from(draw(3));
            let (got, want) = (
                least_place_error(&places, clusters, RESTARTS),
                exhaustive(&places, clusters),
            );
            if got > want + 1e-9 {
                missed += 1;
                worst = worst.max(got / want);
            }
        }
        assert!(missed <= 4 && worst < 1.02, "{missed} missed by up to {worst}");
    }
}
