use super::*;
use proptest::prelude::*;

pub(super) const PLAIN: Kmeans2dSettings = Kmeans2dSettings {
    history: 0.0,
    swap_gain: 0.0,
    swaps: 8,
    iterations: 10,
    reach: 2.0,
};

fn plane(points: &[(f64, f64)]) -> (Vec<f64>, Vec<f64>) {
    points.iter().copied().unzip()
}

fn follow<'a>(solver: &'a mut Kmeans2d, points: &[(f64, f64)]) -> Clusters<'a> {
    let (x, y) = plane(points);
    let keys: Vec<u16> = points
        .iter()
        .map(|(x, y)| (x * 2.0) as u16 + 128 * (y * 2.0) as u16)
        .collect();
    solver.follow(Plane { x: &x, y: &y }, &keys, None, None)
}

/// Keys of points at different places, of halves below 64.
const KEYS: usize = 1 << 14;

/// Squared error of a labelling around the means of its clusters.
fn error(points: &[(f64, f64)], labels: &[u16], clusters: usize) -> f64 {
    (0..clusters as u16)
        .map(|id| {
            let members: Vec<_> = points
                .iter()
                .zip(labels)
                .filter(|(_, l)| **l == id)
                .map(|(p, _)| *p)
                .collect();
            let n = members.len() as f64;
            let (sx, sy) = members
                .iter()
                .fold((0.0, 0.0), |(sx, sy), (x, y)| (sx + x, sy + y));
            members
                .iter()
                .map(|(x, y)| (x - sx / n).powi(2) + (y - sy / n).powi(2))
                .sum::<f64>()
        })
        .sum()
}

/// The least error there is, by trying every labelling.
fn exhaustive(points: &[(f64, f64)], clusters: u16) -> f64 {
    let mut labels = vec![0u16; points.len()];
    let mut least = f64::INFINITY;
    loop {
        least = least.min(error(points, &labels, clusters.into()));
        let Some(n) = labels.iter().position(|l| l + 1 < clusters) else {
            return least;
        };
        labels[n] += 1;
        labels[..n].fill(0);
    }
}

fn blob(x: f64, y: f64) -> Vec<(f64, f64)> {
    (0..9)
        .map(|i| (x + f64::from(i % 3), y + f64::from(i / 3)))
        .collect()
}

#[test]
fn separate_blobs_get_a_cluster_each() {
    let points = [blob(0.0, 0.0), blob(10.0, 0.0), blob(0.0, 10.0), blob(10.0, 10.0)].concat();
    let mut solver = Kmeans2d::new(KEYS, 4, PLAIN);
    let clusters = follow(&mut solver, &points);
    assert_eq!(error(&points, clusters.labels, 4), 4.0 * 12.0);
    for blob in clusters.labels.chunks(9) {
        assert!(blob.iter().all(|l| *l == blob[0]));
    }
}

#[test]
fn ids_stay_with_blobs_that_move() {
    let mut solver = Kmeans2d::new(KEYS, 3, PLAIN);
    let at = |t: f64| [blob(0.0, t), blob(12.0, 2.0 * t), blob(t, 12.0)].concat();
    let first = follow(&mut solver, &at(0.0)).labels.to_vec();
    for t in 1..6 {
        assert_eq!(follow(&mut solver, &at(f64::from(t) * 0.5)).labels, first);
    }
}

#[test]
fn a_cluster_whose_points_are_gone_goes_to_where_it_is_needed() {
    let mut solver = Kmeans2d::new(KEYS, 2, PLAIN);
    follow(&mut solver, &[blob(0.0, 0.0), blob(5.0, 0.0)].concat());
    let moved = [blob(0.0, 0.0), blob(0.0, 30.0)].concat();
    let clusters = follow(&mut solver, &moved);
    assert_eq!(error(&moved, clusters.labels, 2), 24.0);
    assert_eq!(clusters.live, [true, true]);
}

#[test]
fn clusters_whose_points_go_all_at_once_are_needed_elsewhere_in_the_same_frame() {
    let row = |y: f64| (0..16).map(move |x| (f64::from(x), y));
    let contact = |y: f64| row(0.0).chain(row(y)).chain([(20.0, 0.0)]).collect::<Vec<_>>();
    let settings = Kmeans2dSettings {
        swap_gain: 0.04,
        swaps: 4,
        iterations: 6,
        ..PLAIN
    };
    let mut solver = Kmeans2d::new(KEYS, 32, settings);
    follow(&mut solver, &contact(4.0));
    // Half of the contact is lifted, as much is pressed beside the other half.
    let clusters = follow(&mut solver, &contact(1.0));
    assert_eq!(clusters.live.iter().filter(|live| **live).count(), 32);
}

#[test]
fn swaps_leave_a_local_optimum_only_when_it_pays() {
    // Warm from three clusters on the left and one on the right, where two and two are best.
    let left: Vec<_> = (0..3).flat_map(|i| blob(0.0, f64::from(i) * 4.0)).collect();
    let before = [left.clone(), blob(40.0, 0.0)].concat();
    let after = [
        left,
        (0..3).flat_map(|i| blob(40.0, f64::from(i) * 9.0)).collect(),
    ]
    .concat();
    let run = |swap_gain| {
        let mut solver = Kmeans2d::new(KEYS, 4, Kmeans2dSettings { swap_gain, ..PLAIN });
        follow(&mut solver, &before);
        let labels = follow(&mut solver, &after).labels.to_vec();
        error(&after, &labels, 4)
    };
    assert!(
        run(0.0) < 0.6 * run(f64::INFINITY),
        "{} and {}",
        run(0.0),
        run(f64::INFINITY)
    );
}

/// Ids of points at 0, 1 and 2 on a line, of these heights, for two clusters.
fn pairs(solver: &mut Kmeans2d, heights: [f64; 3]) -> [u16; 3] {
    let x = [0.0, 1.0, 2.0];
    let y = [0.0; 3];
    let found = solver.follow(Plane { x: &x, y: &y }, &[0, 1, 2], None, Some(&heights));
    [found.labels[0], found.labels[1], found.labels[2]]
}

#[test]
fn heights_decide_between_pairs_that_are_equally_near() {
    for (heights, alike) in [([0.0, 0.1, 0.9], [0, 1]), ([0.9, 0.1, 0.0], [1, 2])] {
        let got = pairs(&mut Kmeans2d::new(3, 2, PLAIN), heights);
        let [a, b] = alike.map(|n: usize| got[n]);
        assert!(a == b && got[0] != got[2], "{heights:?}: {got:?}");
    }
}

#[test]
fn new_heights_of_the_same_points_count_within_four_frames() {
    let mut solver = Kmeans2d::new(3, 2, PLAIN);
    for _ in 0..9 {
        let got = pairs(&mut solver, [0.0, 0.1, 0.9]);
        assert_eq!(got[0], got[1]);
    }
    let changed = (0..4).any(|_| {
        let got = pairs(&mut solver, [0.9, 0.1, 0.0]);
        got[1] == got[2]
    });
    assert!(changed);
}

#[test]
fn with_many_points_one_between_two_clusters_goes_to_the_one_whose_heights_are_like_its_own() {
    // Two rows of seven, and a point in the middle that is a little nearer to the left one.
    let x: [f64; 15] = std::array::from_fn(|n| [0.0, 3.97, 8.0][(n > 6) as usize + (n > 7) as usize]);
    let y: [f64; 15] = std::array::from_fn(|n| if n == 7 { 3.0 } else { (n % 8) as f64 });
    let keys: Vec<u16> = (0..15).collect();
    let beside = |middle: f64, weights: Option<&[f64]>| {
        let heights: [f64; 15] = std::array::from_fn(|n| match n {
            0..7 => 0.1,
            7 => middle,
            _ => 0.9,
        });
        let mut solver = Kmeans2d::new(15, 2, PLAIN);
        // Held: the search knows nothing of it, and is at rest.
        let mut beside = "";
        for _ in 0..9 {
            let found = solver.follow(Plane { x: &x, y: &y }, &keys, weights, Some(&heights));
            assert_ne!(found.labels[0], found.labels[14]);
            beside = if found.labels[7] == found.labels[0] {
                "left"
            } else {
                "right"
            };
        }
        beside
    };
    assert_eq!(beside(0.1, None), "left");
    assert_eq!(beside(0.9, None), "right");
    // Weights say themselves what counts.
    assert_eq!(beside(0.9, Some(&[1.0; 15])), "left");
}

proptest! {
    #[test]
    fn heights_of_many_points_cost_two_per_cent_of_the_squared_distances_at_most(
        frames in prop::collection::vec(
            prop::collection::btree_map((0u8..12, 0u8..12), 0.0..1.0f64, 43..80), 1..12),
        clusters in 1usize..8,
    ) {
        let mut plain = Kmeans2d::new(KEYS, clusters, PLAIN);
        let mut high = Kmeans2d::new(KEYS, clusters, PLAIN);
        for frame in frames {
            // Each is held for a while, with other heights in the end.
            for turned in [false, false, true] {
                let points: Vec<_> = frame.keys().map(|(x, y)| (f64::from(*x), f64::from(*y))).collect();
                let heights: Vec<_> = frame.values().map(|h| if turned { 1.0 - h } else { *h }).collect();
                let (x, y) = plane(&points);
                let keys: Vec<u16> = points.iter().map(|(x, y)| (x * 2.0) as u16 + 128 * (y * 2.0) as u16).collect();
                let before = plain.follow(Plane { x: &x, y: &y }, &keys, None, None);
                let after = high.follow(Plane { x: &x, y: &y }, &keys, None, Some(&heights));
                prop_assert_eq!(before.member, after.member);
                prop_assert_eq!(before.live, after.live);
                for (id, member) in after.member.iter().enumerate() {
                    prop_assert!(member.is_none_or(|n| usize::from(after.labels[n as usize]) == id));
                }
                let (far, allowed) = (error(&points, after.labels, clusters), error(&points, before.labels, clusters));
                prop_assert!(far <= 1.02 * allowed + 1e-9, "{} of {}", far, allowed);
                let tall: Vec<_> = heights.iter().map(|h| (*h, 0.0)).collect();
                let (unlike, was) = (error(&tall, after.labels, clusters), error(&tall, before.labels, clusters));
                prop_assert!(unlike <= was + 1e-9, "{} of {}", unlike, was);
            }
        }
    }
}

#[test]
fn history_holds_centroids_back() {
    let run = |history| {
        let mut solver = Kmeans2d::new(KEYS, 1, Kmeans2dSettings { history, ..PLAIN });
        follow(&mut solver, &blob(0.0, 0.0));
        follow(&mut solver, &blob(3.0, 0.0)).x[0]
    };
    assert_eq!((run(0.0), run(0.5), run(2.0)), (4.0, 3.0, 2.0));
}

#[test]
fn weights_pull_centroids() {
    let (x, y) = ([0.0, 4.0, 4.0], [0.0; 3]);
    let mut solver = Kmeans2d::new(3, 1, PLAIN);
    assert_eq!(
        solver
            .follow(Plane { x: &x, y: &y }, &[0, 1, 2], Some(&[6.0, 1.0, 1.0]), None)
            .x,
        [1.0]
    );
}

#[test]
fn points_in_one_place_are_survived() {
    let mut solver = Kmeans2d::new(20, 4, PLAIN);
    let (x, keys): (_, Vec<u16>) = ([3.0; 20], (0..20).collect());
    for n in [20, 20, 19, 0] {
        let points = Plane {
            x: &x[..n],
            y: &x[..n],
        };
        let clusters = solver.follow(points, &keys[..n], None, None);
        assert_eq!(clusters.live.iter().filter(|l| **l).count(), n.min(1));
        assert!(clusters.x.iter().all(|x| x.is_finite()));
    }
}

#[test]
fn places_a_kilometre_from_the_origin_are_clustered_as_well() {
    // Single precision has steps of a sixteenth of a millimetre there.
    let settings = Kmeans2dSettings { reach: 9.4, ..PLAIN };
    let keys: Vec<u16> = (0..240).collect();
    let at = |origin: f64| {
        let mut solver = Kmeans2d::new(240, 8, settings);
        let place = |n: u16| {
            let (x, y) = (f64::from(n % 16), f64::from(n / 16));
            (origin + 4.7 * x, origin - 4.7 * y)
        };
        let points: Vec<_> = keys.iter().map(|n| place(*n)).collect();
        let near: Vec<_> = keys
            .iter()
            .map(|n| (4.7 * f64::from(n % 16), -4.7 * f64::from(n / 16)))
            .collect();
        let mut errors = Vec::new();
        for frame in 0..60 {
            // Held for a while, then two rows less.
            let some = if frame < 40 { 240 } else { 208 };
            let (x, y) = plane(&points[..some]);
            let found = solver.follow(Plane { x: &x, y: &y }, &keys[..some], None, None);
            assert!(found.live.iter().all(|live| *live));
            errors.push(error(&near[..some], found.labels, 8));
        }
        (errors[39], errors[59])
    };
    let (here, there) = (at(0.0), at(1e6));
    assert!(
        there.0 < 1.01 * here.0 && there.1 < 1.01 * here.1,
        "{here:?} and {there:?}"
    );
}

#[test]
fn an_id_whose_point_flickers_comes_back_and_none_goes_elsewhere() {
    let steady = [blob(0.0, 0.0), blob(20.0, 0.0), blob(0.0, 20.0)].concat();
    let flickering = [steady.clone(), vec![(30.0, 30.0)]].concat();
    let mut solver = Kmeans2d::new(
        KEYS,
        4,
        Kmeans2dSettings {
            swap_gain: 0.2,
            ..PLAIN
        },
    );
    let first = follow(&mut solver, &flickering).labels.to_vec();
    for t in 0..6 {
        let (points, live) = if t % 2 == 0 {
            (&steady, 3)
        } else {
            (&flickering, 4)
        };
        let clusters = follow(&mut solver, points);
        assert_eq!(clusters.labels, &first[..points.len()], "frame {t}");
        assert_eq!(clusters.live.iter().filter(|l| **l).count(), live);
    }
}

#[test]
fn an_id_that_has_rested_is_put_where_it_helps() {
    let steady = [blob(0.0, 0.0), blob(20.0, 0.0), blob(0.0, 20.0)].concat();
    let mut solver = Kmeans2d::new(
        KEYS,
        4,
        Kmeans2dSettings {
            swap_gain: 0.5,
            ..PLAIN
        },
    );
    follow(&mut solver, &[steady.clone(), vec![(30.0, 30.0)]].concat());
    let live = |clusters: Clusters<'_>| clusters.live.iter().filter(|l| **l).count();
    assert_eq!(live(follow(&mut solver, &steady)), 3);
    assert_eq!(live(follow(&mut solver, &steady)), 4);
}

#[test]
fn who_stands_for_a_cluster_stays_while_it_is_hardly_farther() {
    let line = |n: u8| (0..n).map(|x| (f64::from(x), 0.0)).collect::<Vec<_>>();
    let mut solver = Kmeans2d::new(KEYS, 1, PLAIN);
    let stands = [5, 6, 7, 8, 9].map(|n| follow(&mut solver, &line(n)).member[0]);
    assert_eq!(stands, [Some(2), Some(2), Some(3), Some(3), Some(4)]);
}

#[test]
fn frames_that_do_not_change_change_nothing() {
    let points = [blob(0.0, 0.0), blob(4.0, 1.0), blob(9.0, 3.0)].concat();
    let mut solver = Kmeans2d::new(KEYS, 5, PLAIN);
    let first = follow(&mut solver, &points).labels.to_vec();
    for _ in 0..3 {
        assert_eq!(follow(&mut solver, &points).labels, first);
    }
}

#[test]
fn a_bad_arrangement_is_left_while_nothing_changes_though_its_jumps_hardly_pay() {
    // Warm from three clusters on the left and one on the right, where two and two are a little better.
    let left: Vec<_> = (0..3).flat_map(|i| blob(0.0, f64::from(i) * 4.0)).collect();
    let before = [left.clone(), blob(40.0, 0.0)].concat();
    let right: Vec<_> = (0..21)
        .map(|i| (40.0 + f64::from(i % 3), f64::from(i / 3)))
        .collect();
    let after = [left, right].concat();
    let run = |swap_gain, frames| {
        let mut solver = Kmeans2d::new(KEYS, 4, Kmeans2dSettings { swap_gain, ..PLAIN });
        follow(&mut solver, &before);
        let labels = (0..frames)
            .map(|_| follow(&mut solver, &after).labels.to_vec())
            .last();
        error(&after, &labels.unwrap_or_default(), 4)
    };
    let (stuck, best) = (run(1.0, 60), run(0.0, 60));
    assert!((0.8..0.99).contains(&(best / stuck)), "{best} and {stuck}");
    assert_eq!((run(0.95, 1), run(0.95, 60)), (stuck, best));
}

#[test]
fn hard_cases_reach_the_exhaustive_optimum() {
    let line = |n: u8| (0..n).map(|x| (f64::from(x), 3.0)).collect::<Vec<_>>();
    let grid = |w: u8, h: u8| {
        (0..w * h)
            .map(|n| (f64::from(n % w), f64::from(n / w)))
            .collect::<Vec<_>>()
    };
    let ring = [(2, 0), (4, 0), (6, 2), (6, 4), (4, 6), (2, 6), (0, 4), (0, 2)];
    let ring = ring.map(|(x, y)| (f64::from(x), f64::from(y))).to_vec();
    for (name, points, clusters) in [
        ("one contact", vec![(5.0, 5.0)], 3),
        ("as many contacts as actuators", grid(3, 1), 3),
        ("one actuator", grid(3, 3), 1),
        ("a line that divides evenly", line(9), 3),
        ("a line that does not", line(10), 3),
        ("a column", line(8).iter().map(|(x, y)| (*y, *x)).collect(), 3),
        (
            "a diagonal",
            (0..9).map(|n| (f64::from(n), f64::from(n))).collect(),
            3,
        ),
        ("a grid with ties everywhere", grid(3, 3), 3),
        ("another", grid(4, 2), 4),
        ("a ring, symmetric", ring.clone(), 4),
        ("a ring that cannot be shared symmetrically", ring, 3),
        (
            "two pairs a pixel apart, one far away",
            vec![(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (63.0, 63.0)],
            3,
        ),
    ] {
        let mut solver = Kmeans2d::new(KEYS, clusters, PLAIN);
        // Some frames to look around in, as a hand that holds still has.
        let mut labels = Vec::new();
        for _ in 0..300 {
            labels = follow(&mut solver, &points).labels.to_vec();
        }
        let (found, least) = (
            error(&points, &labels, clusters),
            exhaustive(&points, clusters as u16),
        );
        assert!((found - least).abs() < 1e-9, "{name}: {found} over {least}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn small_sets_come_near_the_exhaustive_optimum(cells in prop::collection::btree_set((0u8..8, 0u8..8), 4..10)) {
        let points: Vec<_> = cells.iter().map(|(x, y)| (f64::from(*x), f64::from(*y))).collect();
        let mut solver = Kmeans2d::new(KEYS, 3, PLAIN);
        let labels = follow(&mut solver, &points).labels.to_vec();
        let (found, least) = (error(&points, &labels, 3), exhaustive(&points, 3));
        prop_assert!(found >= least - 1e-9 && found <= 2.0 * least + 1e-9, "{found} over {least}");
    }

    #[test]
    fn how_long_the_hand_was_idle_does_not_matter(
        cells in prop::collection::btree_set((0u8..16, 0u8..16), 40..120),
        idle in 1usize..4,
    ) {
        let points: Vec<_> = cells.iter().map(|(x, y)| (f64::from(*x), f64::from(*y))).collect();
        let settings = Kmeans2dSettings { history: 0.0, swap_gain: 0.02, swaps: 4, iterations: 6, reach: 2.0 };
        let mut soon = Kmeans2d::new(KEYS, 8, settings);
        let mut late = Kmeans2d::new(KEYS, 8, settings);
        for _ in 0..idle {
            follow(&mut late, &[]);
        }
        for frame in 0..40 {
            // The same hold for some frames, then a slightly larger one.
            let held = &points[..points.len() - 20 + frame / 2];
            let labels = follow(&mut soon, held).labels.to_vec();
            prop_assert_eq!(&follow(&mut late, held).labels, &labels, "frame {}", frame);
        }
    }

    #[test]
    fn every_point_has_a_cluster_and_every_live_cluster_a_point(
        frames in prop::collection::vec(prop::collection::btree_set((0u8..16, 0u8..16), 0..60), 1..8),
        clusters in 1usize..20,
        history in prop_oneof![Just(0.0), 0.0..3.0f64],
    ) {
        let mut solver = Kmeans2d::new(KEYS, clusters, Kmeans2dSettings { history, swap_gain: 0.02, swaps: 4, iterations: 6, reach: 2.0 });
        for frame in &frames {
            let points: Vec<_> = frame.iter().map(|(x, y)| (f64::from(*x), f64::from(*y))).collect();
            let found = follow(&mut solver, &points);
            prop_assert_eq!(found.labels.len(), points.len());
            for (id, live) in found.live.iter().enumerate() {
                prop_assert_eq!(*live, found.labels.iter().any(|l| usize::from(*l) == id));
            }
            if points.len() <= clusters {
                prop_assert_eq!(found.live.iter().filter(|l| **l).count(), points.len());
            }
        }
    }
}
