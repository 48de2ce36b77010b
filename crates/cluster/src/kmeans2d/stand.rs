//! The point that stands for each cluster.

use super::assign::Assignment;
use super::steps::squared;

/// Where actuators stand.
#[derive(Debug)]
pub(super) struct Stands {
    /// Place of each id when it last had points; not a number where it never had.
    place: Vec<[f32; 2]>,
    member: Vec<Option<u32>>,
    least: Vec<f32>,
}

impl Stands {
    pub(super) fn new(clusters: usize) -> Self {
        Self {
            place: vec![[f32::NAN; 2]; clusters],
            member: vec![None; clusters],
            least: vec![0.0; clusters],
        }
    }

    pub(super) fn forget(&mut self) {
        self.place.fill([f32::NAN; 2]);
    }

    /// Where each id stood when it last had points.
    pub(super) fn places(&self) -> &[[f32; 2]] {
        &self.place
    }

    pub(super) fn members(&self) -> &[Option<u32>] {
        &self.member
    }

    /// Every point stands for itself.
    pub(super) fn stand_on_points(&mut self, points: &Assignment) {
        self.member.fill(None);
        for (n, id) in points.labels().iter().enumerate() {
            let id = usize::from(*id);
            self.member[id] = Some(n as u32);
            self.place[id] = points.place_of(n);
        }
    }

    /// The point nearest the centroid stands for a cluster, the first among equals. One that did
    /// not stand for it in the last frame counts as farther away, by an eighth of the squared reach
    /// in squared distance, and by as much again if it is out of reach from there.
    pub(super) fn stand(&mut self, points: &Assignment, pinned: &[bool], reach: f32) {
        let step = 0.125 * reach * reach;
        self.member.fill(None);
        self.least.fill(f32::INFINITY);
        for (n, id) in points.labels().iter().enumerate() {
            let id = usize::from(*id);
            let mut distance = points.near(n);
            if distance < self.least[id] {
                if pinned[id] {
                    let way = squared(points.place_of(n), self.place[id]);
                    distance += step * (f32::from(way > 0.0) + f32::from(way > reach * reach));
                }
                if distance < self.least[id] {
                    self.least[id] = distance;
                    self.member[id] = Some(n as u32);
                }
            }
        }
        for (member, place) in self.member.iter().zip(&mut self.place) {
            if let Some(n) = member {
                *place = points.place_of(*n as usize);
            }
        }
    }
}
