//! Which id stands for which point, when every point has its own.

use super::NONE;
use super::assign::Assignment;
use super::steps::squared;

/// Memory for matching points with ids.
#[derive(Debug)]
pub(super) struct Matching {
    /// Whether each id stands for a point.
    used: Vec<bool>,
    /// Candidate pairs: squared distance, point, id.
    pairs: Vec<(f32, u16, u16)>,
}

impl Matching {
    pub(super) fn new(clusters: usize) -> Self {
        Self {
            used: vec![false; clusters],
            pairs: Vec::with_capacity(clusters * clusters),
        }
    }

    /// Labels each point with an id of its own. `pinned` are the ids in use in the last frame,
    /// `stands` where each stood when last in use.
    ///
    /// An id stays on the point it stood on. Then ids go to points within reach of where they
    /// stood, nearest pairs first, ties to the first point and the lowest id. Points left over get,
    /// in their order, an id that was not in use: the one that stood nearest to them if within
    /// twice the reach, else the lowest that never was in use, else the nearest; when these run
    /// out, the nearest whose point is gone.
    pub(super) fn match_points(
        &mut self,
        points: &mut Assignment,
        pinned: &[bool],
        stands: &[[f32; 2]],
        reach: f32,
    ) {
        self.used.fill(false);
        for n in 0..points.len() {
            let id = points.labels()[n];
            if id == NONE {
                continue;
            }
            if pinned[usize::from(id)] && points.place_of(n) == stands[usize::from(id)] {
                self.used[usize::from(id)] = true;
            } else {
                points.relabel(n, usize::from(NONE));
            }
        }
        self.pairs.clear();
        for n in 0..points.len() {
            if points.labels()[n] == NONE {
                for id in (0..stands.len()).filter(|id| pinned[*id] && !self.used[*id]) {
                    let distance = squared(points.place_of(n), stands[id]);
                    if distance <= reach * reach {
                        self.pairs.push((distance, n as u16, id as u16));
                    }
                }
            }
        }
        self.pairs
            .sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        for (_, n, id) in &self.pairs {
            let (n, id) = (usize::from(*n), usize::from(*id));
            if points.labels()[n] == NONE && !self.used[id] {
                points.relabel(n, id);
                self.used[id] = true;
            }
        }
        for n in 0..points.len() {
            if points.labels()[n] == NONE {
                let id = self.unused(points.place_of(n), pinned, stands, reach);
                points.relabel(n, id);
                self.used[id] = true;
            }
        }
    }

    /// The id for a point that no id was near.
    fn unused(&self, place: [f32; 2], pinned: &[bool], stands: &[[f32; 2]], reach: f32) -> usize {
        let mut best = (usize::MAX, [f32::INFINITY; 2]);
        for (id, stand) in stands.iter().enumerate().filter(|(id, _)| !self.used[*id]) {
            let distance = squared(place, *stand);
            let rank = match (pinned[id], distance.is_nan()) {
                (true, _) => 3.0,
                (false, true) => 1.0,
                (false, false) if distance <= 4.0 * reach * reach => 0.0,
                (false, false) => 2.0,
            };
            let key = [rank, if rank == 1.0 { 0.0 } else { distance }];
            if best.0 == usize::MAX || key < best.1 {
                best = (id, key);
            }
        }
        best.0
    }
}
