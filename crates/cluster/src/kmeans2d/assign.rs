//! Points, their nearest centroid and the distances to the two nearest.

use super::least::least_cost;
use super::steps::{LANES, fill_steps, lesser};
use super::{FAR, NONE, Sums};
use crate::Plane;
use multiversion::multiversion;

/// The greater of two numbers.
#[inline(always)]
fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The points of a frame and the cluster each belongs to.
#[derive(Debug)]
pub(super) struct Assignment {
    n: usize,
    /// The bits that an id takes.
    ids: u32,
    x: Vec<[f32; LANES]>,
    y: Vec<[f32; LANES]>,
    weight: Vec<f32>,
    /// Height of each point; empty where points have none.
    height: Vec<[f32; LANES]>,
    /// Squared distance to the nearest centroid, heights included; 0 for the points that fill up the last step.
    near: Vec<[f32; LANES]>,
    /// Squared distance to the second nearest, with its id in the lowest bits.
    next: Vec<[f32; LANES]>,
    label: Vec<u16>,
    saved: Saved,
}

/// Labels and distances to go back to.
#[derive(Debug)]
struct Saved {
    near: Vec<[f32; LANES]>,
    next: Vec<[f32; LANES]>,
    label: Vec<u16>,
}

impl Assignment {
    pub(super) fn new(points: usize, clusters: usize) -> Self {
        let steps = points.div_ceil(LANES);
        Self {
            n: 0,
            ids: (clusters.next_power_of_two() - 1) as u32,
            x: Vec::with_capacity(steps),
            y: Vec::with_capacity(steps),
            weight: Vec::with_capacity(points),
            height: Vec::with_capacity(steps),
            near: vec![[0.0; LANES]; steps],
            next: vec![[0.0; LANES]; steps],
            label: Vec::with_capacity(points),
            saved: Saved {
                near: Vec::with_capacity(steps),
                next: Vec::with_capacity(steps),
                label: Vec::with_capacity(points),
            },
        }
    }

    pub(super) fn len(&self) -> usize {
        self.n
    }

    /// The bits of a number that make room for an id.
    pub(super) fn id_bits(&self) -> u32 {
        self.ids
    }

    pub(super) fn labels(&self) -> &[u16] {
        &self.label
    }

    pub(super) fn relabel(&mut self, n: usize, id: usize) {
        self.label[n] = id as u16;
    }

    /// Gives the clusters other ids.
    pub(super) fn rename(&mut self, ids: &[u16]) {
        for label in &mut self.label {
            *label = ids[usize::from(*label)];
        }
        for next in self.next.as_flattened_mut().iter_mut().take(self.n) {
            let id = (next.to_bits() & self.ids) as usize;
            if let Some(id) = ids.get(id) {
                *next = f32::from_bits(next.to_bits() & !self.ids | u32::from(*id));
            }
        }
    }

    /// A point and its weight.
    pub(super) fn point(&self, n: usize) -> (f64, f64, f64) {
        (
            f64::from(self.x.as_flattened()[n]),
            f64::from(self.y.as_flattened()[n]),
            self.weight.get(n).map_or(1.0, |w| f64::from(*w)),
        )
    }

    /// Squared distances of a point to the two nearest centroids.
    pub(super) fn distances(&self, n: usize) -> (f32, f32) {
        let next = self.next.as_flattened()[n].to_bits() & !self.ids;
        (self.near.as_flattened()[n], f32::from_bits(next))
    }

    /// Id of the second nearest centroid of a point.
    pub(super) fn second(&self, n: usize) -> usize {
        (self.next.as_flattened()[n].to_bits() & self.ids) as usize
    }

    /// Height of a point; 0 where points have none.
    pub(super) fn height(&self, n: usize) -> f32 {
        self.height.as_flattened().get(n).copied().unwrap_or(0.0)
    }

    /// Whether points have heights.
    pub(super) fn is_raised(&self) -> bool {
        !self.height.is_empty()
    }

    /// Gives the points their heights.
    pub(super) fn raise(&mut self, heights: Option<&[f64]>) {
        fill_steps(&mut self.height, heights.unwrap_or(&[]));
    }

    /// Whether points have weights.
    pub(super) fn is_weighted(&self) -> bool {
        !self.weight.is_empty()
    }

    /// The greatest weight of a point.
    pub(super) fn greatest_weight(&self) -> f64 {
        if self.weight.is_empty() {
            return 1.0;
        }
        f64::from(self.weight.iter().copied().fold(0.0, greater))
    }

    /// Takes the points of a frame. Steps are filled up with copies of the last point.
    pub(super) fn place(&mut self, points: Plane<'_>, weights: Option<&[f64]>) {
        self.n = points.len();
        fill_steps(&mut self.x, points.x);
        fill_steps(&mut self.y, points.y);
        self.weight.clear();
        self.weight
            .extend(weights.unwrap_or(&[]).iter().map(|w| *w as f32));
        self.label.clear();
        self.label.resize(self.n, u16::MAX);
    }

    /// Assigns every point to its nearest centroid, ties to the lowest id; returns how many labels
    /// changed. `sums`, what the points of each id add up to, follows; every point must have a
    /// label.
    ///
    /// The lowest bits of a squared distance make room for the id, so that the least of these
    /// numbers says both: distances count as equal if they agree to a part in `2^23 / clusters`.
    pub(super) fn assign(&mut self, centroids: [&[f32]; 3], sums: &mut [Sums]) -> usize {
        let points = [&*self.x, &*self.y, &*self.height];
        let distances = [&mut *self.near, &mut *self.next];
        let labels = &mut self.label;
        let changed = if self.height.is_empty() {
            assign_steps::<false>(points, centroids, self.ids, distances, labels, sums)
        } else {
            assign_steps::<true>(points, centroids, self.ids, distances, labels, sums)
        };
        // Sums of whole numbers are exact, whatever their order; others are not.
        if changed > 0 && (self.is_weighted() || self.is_raised()) {
            self.add_up(sums);
        }
        changed
    }

    /// Keeps labels and distances for [`Assignment::restore`].
    pub(super) fn save(&mut self) {
        let steps = self.x.len();
        self.saved.near.clear();
        self.saved.near.extend_from_slice(&self.near[..steps]);
        self.saved.next.clear();
        self.saved.next.extend_from_slice(&self.next[..steps]);
        self.saved.label.clone_from(&self.label);
    }

    /// Labels and distances as they were last saved, of the same points.
    pub(super) fn restore(&mut self) {
        self.near[..self.saved.near.len()].copy_from_slice(&self.saved.near);
        self.next[..self.saved.next.len()].copy_from_slice(&self.saved.next);
        self.label.copy_from_slice(&self.saved.label);
    }

    /// Weighted sum of squared distances to the nearest centroids.
    pub(super) fn cost(&self) -> f64 {
        if self.weight.is_empty() {
            let (steps, rest) = self.near.as_flattened()[..self.n].as_chunks::<LANES>();
            let mut sums = [0.0; LANES];
            for step in steps {
                for lane in 0..LANES {
                    sums[lane] += f64::from(step[lane]);
                }
            }
            return sums.iter().sum::<f64>() + rest.iter().map(|near| f64::from(*near)).sum::<f64>();
        }
        let near = self.near.as_flattened().iter().zip(&self.weight);
        near.map(|(near, weight)| f64::from(*weight) * f64::from(*near))
            .sum()
    }

    /// What clusters of these points, which have heights, cost at least: [`least_cost`].
    pub(super) fn least_cost(&self, clusters: usize) -> f64 {
        least_cost([&self.x, &self.y, &self.height], self.n, clusters)
    }

    /// Takes one more centroid into account.
    pub(super) fn approach(&mut self, [x, y, z]: [f32; 3]) {
        for n in 0..self.n {
            let [px, py] = self.place_of(n);
            let (dx, dy, dz) = (px - x, py - y, self.height(n) - z);
            let near = &mut self.near.as_flattened_mut()[n];
            *near = lesser(dx * dx + dy * dy + dz * dz, *near);
        }
    }

    /// The point farthest from its nearest centroid, the first among equals, and what a centroid
    /// there saves at least; `None` where all stand on centroids.
    pub(super) fn farthest(&self) -> Option<([f32; 3], f64)> {
        let mut farthest = (0, 0.0);
        for n in 0..self.n {
            let near = self.near(n);
            if near > farthest.1 {
                farthest = (n, near);
            }
        }
        let [x, y] = self.place_of(farthest.0);
        let at = [x, y, self.height(farthest.0)];
        (farthest.1 > 0.0).then_some((at, self.weight(farthest.0) * f64::from(farthest.1)))
    }

    /// The first point.
    pub(super) fn first(&self) -> (f32, f32) {
        (self.x[0][0], self.y[0][0])
    }

    /// Labels each point with the id that its key had, or none.
    pub(super) fn adopt(&mut self, keys: &[u16], id_of_key: &[u16]) {
        for (label, key) in self.label.iter_mut().zip(keys) {
            *label = id_of_key[usize::from(*key)];
        }
    }

    /// Labels points that have no label with the nearest centroid's.
    pub(super) fn label_new(&mut self, x: &[f32], y: &[f32]) {
        for n in 0..self.n {
            if self.label[n] == NONE {
                let [px, py] = self.place_of(n);
                let mut nearest = (f32::INFINITY, 0);
                for (id, (x, y)) in x.iter().zip(y).enumerate().filter(|(_, (x, _))| **x != FAR) {
                    let (dx, dy) = (px - x, py - y);
                    let distance = dx * dx + dy * dy;
                    if distance < nearest.0 {
                        nearest = (distance, id);
                    }
                }
                self.label[n] = nearest.1 as u16;
            }
        }
    }

    /// Adds the points of each cluster up.
    pub(super) fn add_up(&self, sums: &mut [Sums]) {
        sums.fill(Sums::default());
        for (n, label) in self.label.iter().enumerate() {
            let [x, y] = self.place_of(n);
            sums[usize::from(*label)].add(x, y, self.height(n), self.weight(n));
        }
    }

    /// Weight of a point.
    pub(super) fn weight(&self, n: usize) -> f64 {
        self.weight.get(n).map_or(1.0, |w| f64::from(*w))
    }

    /// Squared distance of a point to the nearest centroid.
    pub(super) fn near(&self, n: usize) -> f32 {
        self.near.as_flattened()[n]
    }

    /// Place of a point.
    pub(super) fn place_of(&self, n: usize) -> [f32; 2] {
        [self.x.as_flattened()[n], self.y.as_flattened()[n]]
    }
}

/// [`Assignment::assign`] but for the sums of weighted points. Where the machine has vector units of 256 bits, one takes a
/// step at once; the bits are the same.
#[multiversion(targets("x86_64+avx2"))]
fn assign_steps<const RAISED: bool>(
    points: [&[[f32; LANES]]; 3],
    centroids: [&[f32]; 3],
    ids: u32,
    distances: [&mut [[f32; LANES]]; 2],
    labels: &mut [u16],
    sums: &mut [Sums],
) -> usize {
    let mut changed = 0;
    let [near, next] = distances;
    let steps = points[0].iter().zip(points[1]).zip(near.iter_mut().zip(next));
    for (step, (((px, py), (near, next)), labels)) in steps.zip(labels.chunks_mut(LANES)).enumerate() {
        let pz = if RAISED { points[2][step] } else { [0.0; LANES] };
        let mut first = [f32::MAX; LANES];
        let mut second = [f32::MAX; LANES];
        let [x, y, z] = centroids;
        for (((x, y), z), id) in x.iter().zip(y).zip(z).zip(0u32..) {
            for lane in 0..LANES {
                let (dx, dy) = (px[lane] - x, py[lane] - y);
                let mut distance = dx * dx + dy * dy;
                if RAISED {
                    distance += (pz[lane] - z) * (pz[lane] - z);
                }
                let tagged = f32::from_bits(distance.to_bits() & !ids | id);
                second[lane] = lesser(second[lane], greater(first[lane], tagged));
                first[lane] = lesser(first[lane], tagged);
            }
        }
        *next = second;
        for lane in 0..LANES {
            near[lane] = f32::from_bits(first[lane].to_bits() & !ids);
        }
        let nearest = first.map(|first| (first.to_bits() & ids) as u16);
        let same = match <&[u16; LANES]>::try_from(&*labels) {
            Ok(labels) => *labels == nearest,
            Err(_) => nearest[..labels.len()] == *labels,
        };
        if same {
            continue;
        }
        for (lane, label) in labels.iter_mut().enumerate() {
            if *label != nearest[lane] {
                sums[usize::from(*label)].add(px[lane], py[lane], 0.0, -1.0);
                sums[usize::from(nearest[lane])].add(px[lane], py[lane], 0.0, 1.0);
                *label = nearest[lane];
                changed += 1;
            }
        }
    }
    changed
}
