//! Which id stands for which point, when every point has its own.

use super::assign::Assignment;

/// Memory for matching points with ids.
#[derive(Debug)]
pub(super) struct Matching {
    /// Point of each id.
    point: Vec<Option<u16>>,
    /// Candidate pairs: squared distance, point, id.
    pairs: Vec<(f32, u16, u16)>,
    taken: Vec<bool>,
}

/// How far an id may follow a point, in squared units of the coordinates; a point farther away is another one.
const REACH: f32 = 4.0;

impl Matching {
    pub(super) fn new(clusters: usize) -> Self {
        Self {
            point: vec![None; clusters],
            pairs: Vec::with_capacity(clusters * clusters),
            taken: vec![false; clusters],
        }
    }

    /// Gives each point the id that was nearest to it, nearest pairs first; points that no id was near get ids that were not in use, and
    /// ids of points that are gone when those run out.
    pub(super) fn match_points(
        &mut self,
        points: &Assignment,
        x: &mut [f32],
        y: &mut [f32],
        live: &mut [bool],
    ) {
        self.point.fill(None);
        self.taken.fill(false);
        self.pairs.clear();
        for n in 0..points.len() {
            let (px, py, _) = points.point(n);
            for id in (0..x.len()).filter(|id| live[*id]) {
                let (dx, dy) = (px as f32 - x[id], py as f32 - y[id]);
                let distance = dx * dx + dy * dy;
                if distance <= REACH {
                    self.pairs.push((distance, n as u16, id as u16));
                }
            }
        }
        self.pairs
            .sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        for (_, n, id) in &self.pairs {
            let (n, id) = (usize::from(*n), usize::from(*id));
            if !self.taken[n] && self.point[id].is_none() {
                self.taken[n] = true;
                self.point[id] = Some(n as u16);
            }
        }
        for n in 0..points.len() {
            if !self.taken[n] {
                let free = |id: &usize| self.point[*id].is_none();
                let unused = (0..x.len()).filter(free).find(|id| !live[*id]);
                let id = unused
                    .or_else(|| (0..x.len()).find(free))
                    .expect("no more points than ids");
                self.point[id] = Some(n as u16);
            }
        }
        for (id, point) in self.point.iter().enumerate() {
            live[id] = point.is_some();
            if let Some(n) = point {
                let (px, py, _) = points.point(usize::from(*n));
                (x[id], y[id]) = (px as f32, py as f32);
            }
        }
    }

    /// Labels each point with its id.
    pub(super) fn label(&self, points: &mut Assignment) {
        for (id, point) in self.point.iter().enumerate() {
            if let Some(n) = point {
                points.relabel(usize::from(*n), id);
            }
        }
    }
}
