//! k-means in the plane that follows a moving scene: warm from the last frame, out of local optima
//! when it pays, with clusters that keep their identity.
//!
//! The optimum in the plane is out of reach in real time (the problem is NP-hard), and for a
//! display it is not even wanted: an actuator that jumps across the hand whenever another
//! arrangement is a per mille better is felt as flicker. So each frame starts from the clusters of
//! the last one, and is improved by three moves, each of which lowers the cost:
//!
//! 1. Lloyd's iteration, with the last frame's centroids as an optional pull (evolutionary k-means,
//!    Chakrabarti et al. 2006).
//! 2. Single points that move to another cluster where that lowers the cost though they are nearer
//!    to their own (Hartigan's criterion, `n / (n - 1) * d1 > m / (m + 1) * d2`).
//! 3. A swap: a cluster that is missed little is dissolved and one that gains much is split, if the
//!    gain is worth what it makes people feel. Only this move makes an actuator jump. While nothing
//!    changes less and less is asked of one, so that a bad arrangement does not last.
//!
//! Where a cluster would jump in the end though others lie between, each takes the place of the next (`exchange.rs`):
//! so a contact that slides by a pixel takes all its actuators along.
//!
//! An actuator whose points are gone rests where it stood, for a frame at least, and returns when a
//! point returns there. Only after that rest it may be put elsewhere for little: it has been lifted
//! then, and does not jump. So a point that flickers at the contact threshold does not send an actuator back
//! and forth.
//!
//! Points may have heights, which decide between arrangements that are nearly as good in the plane. With few points for
//! each cluster they are a third coordinate of moves 2 and 3. With many, a last step trades a little of the distance
//! for them (`trade.rs`), unknown to the search.
//!
//! Coordinates are single precision: pixels are exact, millimetres good to a micrometre. Every
//! operation is elementwise or in index order, so results are the same at every vector width.

mod assign;
mod exchange;
mod identity;
mod improve;
mod least;
mod settle;
mod stand;
mod steps;
mod swap;
mod trade;

use assign::Assignment;
use exchange::Exchange;
use settle::Joined;
use stand::Stands;

use crate::Plane;
use swap::Splits;
use trade::{GIVEN_AT_REST, GIVEN_IN_CHANGE, Traded};

/// What [`Kmeans2d`] may do in a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kmeans2dSettings {
    /// History cost: a centroid is drawn towards its place in the last frame as if by this many
    /// times its own members. 0 follows the points alone.
    pub history: f64,
    /// Share of the cost that must be saved for each cluster that a swap makes jump, less while nothing changes;
    /// 0 makes every swap that saves anything, 1 or more none.
    pub swap_gain: f64,
    /// Most swaps in a frame.
    pub swaps: u16,
    /// Most assignments of all points between two swaps.
    pub iterations: u16,
    /// How far an actuator may go between two frames without jumping, in the unit of the coordinates.
    pub reach: f64,
}

/// Clusters points in the plane frame by frame.
#[derive(Debug)]
pub struct Kmeans2d {
    settings: Kmeans2dSettings,
    assignment: Assignment,
    /// Where each cluster is, by id; [`FAR`] where it has never been anywhere.
    x: Vec<f32>,
    y: Vec<f32>,
    /// Mean height of each cluster.
    height: Vec<f32>,
    /// Where each cluster was at the end of the last frame.
    last_x: Vec<f32>,
    last_y: Vec<f32>,
    /// Whether each id has points.
    live: Vec<bool>,
    /// Whether each id had points in the last frame, and cannot go elsewhere without jumping.
    pinned: Vec<bool>,
    /// Whether each id was put elsewhere in this frame, so that where it was does not matter.
    moved: Vec<bool>,
    /// What the points of each id add up to.
    sums: Vec<Sums>,
    /// How much nearer than another centroid points of each id must be to be sure to stay.
    asks: Vec<f32>,
    /// What a point that leaves each id saves at most, of its squared distance.
    saves: Vec<f64>,
    /// The clusters while single points move.
    joined: Vec<Joined>,
    /// Id that each key had in the last frame; [`NONE`] where it had none.
    id_of_key: Vec<u16>,
    /// Keys of the last frame.
    keys: Vec<u16>,
    /// Whether the last frame ended with nothing left to do.
    settled: bool,
    /// The least that any clusters of the points can cost, once it was looked for.
    least: Option<f64>,
    /// Cost at which swaps were last found not to pay, and points that have come or gone since.
    judged: Option<f64>,
    changes: usize,
    /// Frames in which swaps in doubt were tried since one was made.
    turn: usize,
    /// Swaps tried in quiet frames since then, and quiet frames since the last change.
    further: usize,
    quiet: u32,
    /// Frames since the last swap.
    patience: u32,
    /// The same, when the swaps of quiet frames were last begun with.
    began: u32,
    splits: Splits,
    saved: Saved,
    stands: Stands,
    traded: Traded,
    identity: identity::Matching,
    exchange: Exchange,
}

/// No id.
const NONE: u16 = u16::MAX;

/// Most points for each cluster whose heights are a third coordinate.
const MOST_RAISED: usize = 5;

/// With more clusters no pairs are ranked for swaps, and no ids exchanged: the time for both grows with their square.
const MOST_PAIRED: usize = 64;

/// Where clusters are that have never been anywhere: farther from any point than anything, but
/// finite when squared.
const FAR: f32 = 1e17;

/// What a cluster adds up to.
#[derive(Debug, Default, Clone, Copy)]
struct Sums {
    x: f64,
    y: f64,
    height: f64,
    weight: f64,
}

impl Sums {
    /// Adds a point; with a negative weight, takes it away.
    #[inline]
    fn add(&mut self, x: f32, y: f32, height: f32, weight: f64) {
        self.x += weight * f64::from(x);
        self.y += weight * f64::from(y);
        self.height += weight * f64::from(height);
        self.weight += weight;
    }

    /// The mean place and height.
    fn mean(&self) -> [f64; 3] {
        [self.x, self.y, self.height].map(|sum| sum / self.weight)
    }
}

/// Clusters as they were before a swap, or before ids are exchanged.
#[derive(Debug)]
struct Saved {
    x: Vec<f32>,
    y: Vec<f32>,
    height: Vec<f32>,
    sums: Vec<Sums>,
}

/// The clusters of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clusters<'a> {
    /// Id of the cluster of each point. Points between two clusters may have been given to the second nearest for the
    /// sake of their heights; centroids know nothing of it.
    pub labels: &'a [u16],
    /// Where the centroid of each cluster is, by id; of those without points, where it was.
    pub x: &'a [f32],
    /// Second coordinate of the same.
    pub y: &'a [f32],
    /// Whether each cluster has points.
    pub live: &'a [bool],
    /// The point that stands for each cluster: the one nearest its centroid, or the one that stood
    /// for it before if that is hardly farther. `None` for a cluster without points.
    pub member: &'a [Option<u32>],
}

impl Kmeans2d {
    /// Memory for points with keys below `keys`, and exactly `clusters` clusters (fewer where there
    /// are fewer points).
    pub fn new(keys: usize, clusters: usize, settings: Kmeans2dSettings) -> Self {
        Self {
            settings,
            assignment: Assignment::new(keys, clusters),
            x: vec![FAR; clusters],
            y: vec![FAR; clusters],
            height: vec![0.0; clusters],
            last_x: vec![FAR; clusters],
            last_y: vec![FAR; clusters],
            live: vec![false; clusters],
            pinned: vec![false; clusters],
            moved: vec![false; clusters],
            sums: vec![Sums::default(); clusters],
            asks: vec![0.0; clusters],
            saves: vec![0.0; clusters],
            joined: Joined::steps(clusters),
            least: None,
            id_of_key: vec![NONE; keys],
            keys: Vec::with_capacity(keys),
            settled: false,
            judged: None,
            changes: 0,
            turn: 0,
            further: 0,
            quiet: 0,
            patience: 0,
            began: 0,
            splits: Splits::new(clusters),
            saved: Saved {
                x: vec![0.0; clusters],
                y: vec![0.0; clusters],
                height: vec![0.0; clusters],
                sums: vec![Sums::default(); clusters],
            },
            stands: Stands::new(clusters),
            traded: Traded::new(keys, clusters),
            identity: identity::Matching::new(clusters),
            exchange: Exchange::new(clusters),
        }
    }

    /// Forgets all frames.
    pub fn forget(&mut self) {
        self.x.fill(FAR);
        self.y.fill(FAR);
        self.live.fill(false);
        self.id_of_key.fill(NONE);
        self.keys.clear();
        self.settled = false;
        self.judged = None;
        (self.further, self.quiet, self.patience, self.turn) = (0, 0, 0, 0);
        self.splits.forget();
        self.stands.forget();
    }

    /// Whether heights of points with these keys, and with weights or without, would change anything in the next frame. Not
    /// with as many clusters as points, nor in a frame without changes that tries no further swaps.
    pub fn asks_for_heights(&self, keys: &[u16], weighted: bool) -> bool {
        keys.len() > self.x.len()
            && (self.searches_with_heights(keys) || !weighted)
            && (!self.is_resting(keys, weighted) || self.looks_further_next())
    }

    /// Whether heights of so many points are a third coordinate.
    fn searches_with_heights(&self, keys: &[u16]) -> bool {
        keys.len() <= MOST_RAISED * self.x.len()
    }

    /// Whether the points are those of the last frame, which left nothing to do.
    fn is_resting(&self, keys: &[u16], weighted: bool) -> bool {
        self.settled && !weighted && self.keys == keys
    }

    /// Clusters the points of the next frame.
    ///
    /// `keys` names the points: a key is always at the same place, and in a frame at most once.
    /// `weights`, where given, must be positive. `heights`, in the unit of the coordinates, decide between
    /// arrangements that are nearly as good in the plane. With no more than five points for each cluster they are a
    /// third coordinate where single points move; with more, and no weights, points between two clusters are shared out
    /// by them in the end, for no more than 2 % of the squared distances. While the points stay the same, new heights
    /// count in the frames that try further swaps.
    ///
    /// With no more points than clusters each point is a cluster of its own. It keeps its id, or
    /// takes that of an actuator within reach, nearest pairs first; other points get ids that were
    /// not in use.
    ///
    /// # Panics
    ///
    /// If the lengths do not match, or a key is out of range.
    pub fn follow(
        &mut self,
        points: Plane<'_>,
        keys: &[u16],
        weights: Option<&[f64]>,
        heights: Option<&[f64]>,
    ) -> Clusters<'_> {
        assert_eq!(points.x.len(), points.y.len(), "as many x as y");
        assert_eq!(points.x.len(), keys.len(), "a key for each point");
        assert!(
            weights.is_none_or(|w| w.len() == points.len()),
            "one weight per point"
        );
        let (raised, traded) = match self.searches_with_heights(keys) {
            true => (heights, None),
            false => (None, heights.filter(|_| weights.is_none())),
        };
        let resting = self.is_resting(keys, weights.is_some());
        if resting {
            if !self.looks_further() {
                return self.clusters();
            }
            if self.rest(raised) {
                self.finish();
                self.remember(keys);
            }
        } else {
            self.splits.forget();
            self.quiet = 0;
            self.changes += self.count_changes(keys);
            self.pinned.copy_from_slice(&self.live);
            self.assignment.place(points, weights);
            self.assignment.raise(raised);
            self.least = None;
            self.height.fill(0.0);
            if points.len() <= self.x.len() {
                self.follow_few(keys);
            } else {
                self.follow_many(keys);
            }
            self.remember(keys);
        }
        match traded {
            Some(heights) => {
                let given = if resting { GIVEN_AT_REST } else { GIVEN_IN_CHANGE };
                let members = self.stands.members();
                self.traded.trade(&self.assignment, heights, members, given);
            }
            None => self.traded.forget(),
        }
        self.clusters()
    }

    fn clusters(&self) -> Clusters<'_> {
        Clusters {
            labels: self.traded.labels(&self.assignment),
            x: &self.x,
            y: &self.y,
            live: &self.live,
            member: self.stands.members(),
        }
    }

    /// Points that have come since the last frame, or gone.
    fn count_changes(&self, keys: &[u16]) -> usize {
        let stay = keys
            .iter()
            .filter(|key| self.id_of_key[usize::from(**key)] != NONE)
            .count();
        (keys.len() - stay) + (self.keys.len() - stay)
    }

    fn remember(&mut self, keys: &[u16]) {
        self.last_x.copy_from_slice(&self.x);
        self.last_y.copy_from_slice(&self.y);
        for key in &self.keys {
            self.id_of_key[usize::from(*key)] = NONE;
        }
        for (key, id) in keys.iter().zip(self.assignment.labels()) {
            self.id_of_key[usize::from(*key)] = *id;
        }
        self.keys.clear();
        self.keys.extend_from_slice(keys);
    }

    fn follow_few(&mut self, keys: &[u16]) {
        self.assignment.adopt(keys, &self.id_of_key);
        self.identity.match_points(
            &mut self.assignment,
            &self.pinned,
            self.stands.places(),
            self.settings.reach as f32,
        );
        self.live.fill(false);
        for n in 0..self.assignment.len() {
            let id = usize::from(self.assignment.labels()[n]);
            let (x, y, _) = self.assignment.point(n);
            (self.x[id], self.y[id]) = (x as f32, y as f32);
            self.live[id] = true;
        }
        self.exchange();
        self.stands.stand_on_points(&self.assignment);
        self.settled = true;
        // What comes next does not depend on how long the hand was idle.
        self.judged = None;
        (self.patience, self.turn) = (0, 0);
    }

    fn follow_many(&mut self, keys: &[u16]) {
        self.moved.fill(false);
        self.patience = self.patience.saturating_add(1);
        self.assignment.adopt(keys, &self.id_of_key);
        if self.x.iter().all(|x| *x == FAR) {
            let (x, y) = self.assignment.first();
            (self.x[0], self.y[0]) = (x, y);
        }
        self.assignment.label_new(&self.x, &self.y);
        self.assignment.add_up(&mut self.sums);
        self.centre();
        self.settle();
        if self.wake() {
            self.settle();
        }
        self.improve();
        self.finish();
    }

    /// Finds out which ids have points, and where they stand.
    fn finish(&mut self) {
        self.find_live();
        self.exchange();
        let rests = self.pinned.iter().zip(&self.live).any(|(was, is)| *was && !*is);
        self.settled &= !rests && self.live.iter().all(|live| *live);
        self.stands
            .stand(&self.assignment, &self.pinned, self.settings.reach as f32);
    }

    /// Where an id would jump and others near it could go a little way instead, each takes the place of the next.
    fn exchange(&mut self) {
        let (stands, reach) = (self.stands.places(), self.settings.reach as f32);
        let near = |id: usize, to: usize| {
            let (dx, dy) = (self.x[to] - stands[id][0], self.y[to] - stands[id][1]);
            !self.pinned[id] || dx * dx + dy * dy <= reach * reach
        };
        if !self.exchange.find(&self.live, near) {
            return;
        }
        let Saved { x, y, height, sums } = &mut self.saved;
        x.copy_from_slice(&self.x);
        y.copy_from_slice(&self.y);
        height.copy_from_slice(&self.height);
        sums.copy_from_slice(&self.sums);
        for (id, cluster) in self.exchange.clusters().iter().enumerate() {
            let cluster = usize::from(*cluster);
            (self.x[id], self.y[id]) = (x[cluster], y[cluster]);
            (self.height[id], self.sums[id]) = (height[cluster], sums[cluster]);
        }
        self.assignment.rename(self.exchange.ids());
    }

    /// Puts a centroid somewhere.
    fn put(&mut self, id: usize, place: [f32; 3]) {
        [self.x[id], self.y[id], self.height[id]] = place;
    }

    fn find_live(&mut self) {
        for (live, sums) in self.live.iter_mut().zip(&self.sums) {
            *live = sums.weight > 0.0;
        }
    }

    /// Puts ids without points to the points farthest from all clusters: those that rested in the
    /// last frame wherever it helps, the others where it saves enough for a jump, the less of each
    /// the more there are: many lose their points at once where a contact moves, and not where one
    /// flickers. Says whether it put any.
    fn wake(&mut self) -> bool {
        let mut woke = false;
        let lost = |(pinned, sums): &(&bool, &Sums)| **pinned && sums.weight <= 0.0;
        let lost = self.pinned.iter().zip(&self.sums).filter(lost).count() as f64;
        for jumps in [false, true] {
            for id in 0..self.x.len() {
                if self.sums[id].weight > 0.0 || self.moved[id] || self.pinned[id] != jumps {
                    continue;
                }
                let Some((place, saving)) = self.assignment.farthest() else {
                    return woke;
                };
                if jumps && saving * lost <= self.swap_gain() * self.cost() {
                    return woke;
                }
                self.put(id, place);
                self.moved[id] = true;
                self.assignment.approach(place);
                woke = true;
            }
        }
        woke
    }
}

#[cfg(test)]
mod tests;
