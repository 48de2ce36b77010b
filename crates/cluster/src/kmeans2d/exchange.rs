//! Ids change places, so that few near each other go a little way each where one would jump.

use super::{MOST_PAIRED, NONE};

/// Memory for exchanges.
#[derive(Debug)]
pub(super) struct Exchange {
    /// The cluster that each id takes, and the id that takes each cluster.
    cluster: Vec<u16>,
    id: Vec<u16>,
    /// The id from which each cluster was reached; [`NONE`] where it was not.
    from: Vec<u16>,
    /// Ids to go on from.
    queue: Vec<u16>,
}

impl Exchange {
    pub(super) fn new(clusters: usize) -> Self {
        let clusters = if clusters <= MOST_PAIRED { clusters } else { 0 };
        Self {
            cluster: vec![NONE; clusters],
            id: vec![NONE; clusters],
            from: vec![NONE; clusters],
            queue: Vec::with_capacity(clusters),
        }
    }

    /// Finds exchanges by which ids that would jump do not. `near` says whether an id may take the cluster of another
    /// without jumping; those that are not `live` keep theirs. The lowest id that would jump comes first; its way is
    /// the one over the fewest others, the lowest ids among equals. Says whether there are any.
    pub(super) fn find(&mut self, live: &[bool], near: impl Fn(usize, usize) -> bool) -> bool {
        let mut found = false;
        for (n, (cluster, id)) in self.cluster.iter_mut().zip(&mut self.id).enumerate() {
            (*cluster, *id) = (n as u16, n as u16);
        }
        for id in 0..self.cluster.len() {
            let left = usize::from(self.cluster[id]);
            if live[id] && !near(id, left) && self.reach(id, left, live, &near) {
                found = true;
                let mut to = left;
                loop {
                    let taker = usize::from(self.from[to]);
                    let next = usize::from(self.cluster[taker]);
                    (self.cluster[taker], self.id[to]) = (to as u16, taker as u16);
                    if taker == id {
                        break;
                    }
                    to = next;
                }
            }
        }
        found
    }

    /// Looks for a way from an id to the cluster that it leaves, breadth first: each id on it takes the cluster of the
    /// next.
    fn reach(&mut self, id: usize, left: usize, live: &[bool], near: &impl Fn(usize, usize) -> bool) -> bool {
        self.from.fill(NONE);
        self.queue.clear();
        self.queue.push(id as u16);
        let mut next = 0;
        while let Some(taker) = self.queue.get(next).copied() {
            next += 1;
            for ((to, from), live) in self.from.iter_mut().enumerate().zip(live) {
                if *live && *from == NONE && near(usize::from(taker), to) {
                    *from = taker;
                    if to == left {
                        return true;
                    }
                    self.queue.push(self.id[to]);
                }
            }
        }
        false
    }

    /// The cluster that each id takes.
    pub(super) fn clusters(&self) -> &[u16] {
        &self.cluster
    }

    /// The id that takes each cluster.
    pub(super) fn ids(&self) -> &[u16] {
        &self.id
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Plane;
    use crate::kmeans2d::{Clusters, Kmeans2d, Kmeans2dSettings};

    /// A line of `clusters` at whole numbers; each id stood at `stood`, if it was in use.
    fn exchanged(clusters: &[f64], stood: &[Option<f64>]) -> Vec<u16> {
        let mut exchange = Exchange::new(clusters.len());
        let live = vec![true; clusters.len()];
        exchange.find(&live, |id, to| {
            stood[id].is_none_or(|stood| (clusters[to] - stood).abs() <= 2.0)
        });
        let (taken, ids) = (exchange.clusters(), exchange.ids());
        assert!((0..ids.len()).all(|id| usize::from(ids[usize::from(taken[id])]) == id));
        taken.to_vec()
    }

    #[test]
    fn others_go_a_little_way_where_one_would_jump() {
        for (clusters, stood, taken) in [
            // All are near where they stood.
            (vec![0.0, 2.0], vec![Some(0.0), Some(1.0)], vec![0, 1]),
            // The first would go from one end to the other.
            (
                vec![4.0, 1.0, 2.0, 3.0],
                vec![Some(0.0), Some(1.0), Some(2.0), Some(3.0)],
                vec![2, 1, 0, 3],
            ),
            (
                vec![5.0, 2.0, 3.5],
                vec![Some(0.0), Some(2.0), Some(3.5)],
                vec![1, 2, 0],
            ),
            // Too wide a gap on the way.
            (
                vec![9.0, 1.0, 2.0],
                vec![Some(0.0), Some(1.0), Some(2.0)],
                vec![0, 1, 2],
            ),
            // One that was lifted goes as far as it likes.
            (vec![9.0, 1.0], vec![Some(0.0), None], vec![1, 0]),
            // Two that would jump.
            (
                vec![4.0, 5.0, 2.0, 3.0],
                vec![Some(0.0), Some(1.0), Some(2.0), Some(3.0)],
                vec![2, 3, 0, 1],
            ),
        ] {
            assert_eq!(exchanged(&clusters, &stood), taken, "{clusters:?} {stood:?}");
        }
    }

    const SETTINGS: Kmeans2dSettings = Kmeans2dSettings {
        history: 0.0,
        swap_gain: 0.04,
        swaps: 4,
        iterations: 6,
        reach: 2.0,
    };
    const WIDTH: usize = 32;

    fn follow<'a>(solver: &'a mut Kmeans2d, points: &[(usize, usize)]) -> Clusters<'a> {
        let (x, y): (Vec<f64>, Vec<f64>) = points.iter().map(|(x, y)| (*x as f64, *y as f64)).unzip();
        let keys: Vec<u16> = points.iter().map(|(x, y)| (y * WIDTH + x) as u16).collect();
        solver.follow(Plane { x: &x, y: &y }, &keys, None, None)
    }

    /// Where each cluster stands.
    fn stands(points: &[(usize, usize)], clusters: &Clusters<'_>) -> Vec<Option<(usize, usize)>> {
        clusters
            .member
            .iter()
            .map(|n| n.map(|n| points[n as usize]))
            .collect()
    }

    #[test]
    fn a_contact_that_slides_by_a_pixel_a_frame_takes_its_clusters_along() {
        for (width, height, clusters) in [(4, 4, 16), (4, 4, 17), (5, 4, 16), (17, 1, 16), (6, 3, 16)] {
            let mut solver = Kmeans2d::new(WIDTH * WIDTH, clusters, SETTINGS);
            let mut last = Vec::new();
            for t in 0..24usize {
                let (left, top) = (t.div_ceil(2), t / 2);
                let points: Vec<_> = (0..width * height)
                    .map(|n| (left + n % width, top + n / width))
                    .collect();
                let now = stands(&points, &follow(&mut solver, &points));
                for (id, (from, to)) in last.iter().zip(&now).enumerate() {
                    let (Some((fx, fy)), Some((x, y))) = (*from, *to) else {
                        continue;
                    };
                    let (fx, fy): (usize, usize) = (fx, fy);
                    assert!(
                        fx.abs_diff(x).pow(2) + fy.abs_diff(y).pow(2) <= 4,
                        "{width} x {height} for {clusters}: {id} from {from:?} to {to:?}"
                    );
                }
                last = now;
            }
        }
    }
}
