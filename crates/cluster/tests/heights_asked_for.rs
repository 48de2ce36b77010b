//! When the heights of points are looked at: whoever works them out need not do so in other frames.

use proptest::prelude::*;
use taxel_cluster::{Kmeans2d, Kmeans2dSettings, Plane};

const KEYS: usize = 64;

const SETTINGS: Kmeans2dSettings = Kmeans2dSettings {
    history: 0.0,
    swap_gain: 0.1,
    swaps: 8,
    iterations: 10,
    reach: 2.0,
};

/// Keys of points on a grid of 8 x 8, and their heights.
type Frame = (Vec<u16>, Vec<f64>);

/// Follows the points, with heights in every frame or only where they are asked for. Returns the frames in which they were,
/// and all labels.
fn followed(
    clusters: usize,
    weighted: bool,
    frames: &[Frame],
    only_if_asked: bool,
) -> (Vec<bool>, Vec<Vec<u16>>) {
    let mut solver = Kmeans2d::new(KEYS, clusters, SETTINGS);
    let (mut asked, mut labels) = (Vec::new(), Vec::new());
    for (keys, heights) in frames {
        let places = keys.iter().map(|key| (f64::from(key % 8), f64::from(key / 8)));
        let (x, y): (Vec<_>, Vec<_>) = places.unzip();
        let weights: Vec<_> = keys.iter().map(|key| 1.0 + f64::from(*key)).collect();
        let asks = solver.asks_for_heights(keys, weighted);
        let heights = (asks || !only_if_asked).then_some(&heights[..keys.len()]);
        let weights = weighted.then_some(&weights[..]);
        let found = solver.follow(Plane { x: &x, y: &y }, keys, weights, heights);
        asked.push(asks);
        labels.push(found.labels.to_vec());
    }
    (asked, labels)
}

#[test]
fn of_points_that_stay_heights_are_looked_at_in_the_first_frames_and_then_in_one_of_four() {
    // Two clusters, for which ten points have heights in the search, and eleven after it.
    for points in [10, 11] {
        let frame: Frame = (
            (0..points).collect(),
            (0..points).map(|n| f64::from(n % 3)).collect(),
        );
        let (asked, _) = followed(2, false, &vec![frame; 60], true);
        assert!(asked[..5].iter().all(|asked| *asked), "{points}: {asked:?}");
        let held = asked[44..].iter().filter(|asked| **asked).count();
        assert_eq!(held, 4, "{points}: {asked:?}");
    }
}

#[test]
fn no_heights_are_looked_at_where_no_points_share_a_cluster_or_weights_say_what_counts_of_many() {
    let asks = |points: u16, weighted| {
        let frame = ((0..points).collect(), vec![1.0; usize::from(points)]);
        followed(2, weighted, &[frame], true).0[0]
    };
    assert!(!asks(2, false) && asks(3, false));
    assert!(asks(10, true) && !asks(11, true) && asks(11, false));
}

proptest! {
    #[test]
    fn heights_that_nobody_asks_for_change_nothing(
        contacts in prop::collection::vec(
            (prop::collection::btree_set(0..KEYS as u16, 1..40), 1usize..12), 1..6),
        heights in prop::collection::vec(0.0..2.0f64, KEYS),
        clusters in 1usize..8,
        weighted: bool,
    ) {
        // Each contact is held for a while, with other heights in every frame.
        let frames = contacts.iter().flat_map(|(keys, times)| {
            let heights = &heights;
            (0..*times).map(move |turn| {
                let mut heights = heights.clone();
                heights.rotate_left(turn);
                (keys.iter().copied().collect(), heights)
            })
        });
        let frames: Vec<Frame> = frames.collect();
        let [always, asked] = [false, true].map(|only| followed(clusters, weighted, &frames, only).1);
        prop_assert_eq!(always, asked);
    }
}
