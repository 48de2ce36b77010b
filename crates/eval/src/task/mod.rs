//! What a display keeps, as a task: whether what was touched can still be told from one image.

mod picture;

pub use picture::{BLUR_PX, Shown, grid_places};

use crate::classify::{Logistic, nearest};
use crate::quantile::quantile;
use picture::{Pictures, blur};
use serde::Serialize;
use std::borrow::Cow;
use std::collections::BTreeMap;
use taxel_cluster::Random;
use taxel_compress::Compressor;
use taxel_hand::{ForceFrame, ProfileError};
use taxel_skin::Layout;

/// Draws of the examples.
const DRAWS: usize = 10;
/// Examples of each class.
pub const EXAMPLES: usize = 2;
/// The same where things are moved, and how far at most, pixels along each axis.
const MOVED_DRAWS: usize = 5;
const MOVED_EXAMPLES: usize = 10;
const MOVED_PX: i32 = 3;
/// Seed of the examples and moves, and of the orders in which a compressor that runs on sees frames.
const SEED: u64 = 0x6f62_6a65_6374;
const ORDERS: u64 = 1;

/// Frames of things that are touched, and what is asked: which thing is it?
///
/// The first half of each class's frames is there to learn from, the second to be recognised: two
/// examples a class are drawn, ten times over. Then everything is moved at random by up to 3 pixels along
/// each axis, the examples too, and ten examples a class are drawn, or all it has, five times. Each frame is compressed by a
/// compressor that has seen none before ([`Task::judge`]), or by one that runs on ([`Task::judge_running`]).
#[derive(Debug)]
pub struct Task {
    layout: Layout,
    frames: Vec<ForceFrame>,
    class: Vec<usize>,
    classes: usize,
    /// Frames of each class to learn from.
    examples: Vec<Vec<usize>>,
    /// Frames to be recognised.
    unknown: Vec<usize>,
}

/// Why frames are no task.
#[derive(Debug, thiserror::Error)]
pub enum TaskError {
    /// Frames and labels, or frames and taxels, do not fit each other.
    #[error("{frames} frames of {taxels} taxels with {labels} labels on a hand of {places} taxels")]
    Sizes {
        /// Frames.
        frames: usize,
        /// Forces of one of them.
        taxels: usize,
        /// Labels.
        labels: usize,
        /// Taxels of the layout.
        places: usize,
    },
    /// One class, or a class of too few frames.
    #[error(
        "class {label} has {frames} frames, and there are {classes} classes; a task needs two classes of four frames each"
    )]
    TooFew {
        /// The smallest class.
        label: usize,
        /// Its frames.
        frames: usize,
        /// Classes.
        classes: usize,
    },
}

/// How much of the touched things is recognised, and at what cost.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TaskRow {
    /// What is shown.
    pub name: String,
    /// Share recognised by the nearest of two examples a class.
    pub nearest: f64,
    /// Share recognised by logistic regression on two examples a class.
    pub logistic: f64,
    /// The same with everything moved, and ten examples a class, or all it has ([`Task::moved_examples`]).
    pub moved_nearest: f64,
    /// The same by logistic regression.
    pub moved_logistic: f64,
    /// Bits a frame, mean: of each actuator place (unless it is fixed) and level, 32 for each level's force.
    pub bits: f64,
    /// As `nearest`, from the levels' numbers alone, without their forces.
    pub level_nearest: Option<f64>,
    /// Bits a frame without the levels' forces.
    pub level_bits: Option<f64>,
    /// Median time of both stages, microseconds.
    pub compress_us_p50: Option<f64>,
}

/// A point of a curve.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TaskPoint {
    /// What is shown.
    pub name: String,
    /// `K_D`.
    pub levels: u16,
    /// `K_A`.
    pub actuators: u16,
    /// As in [`TaskRow`].
    pub nearest: f64,
    /// As in [`TaskRow`].
    pub bits: f64,
}

impl Task {
    /// A task of frames, each of the class that `labels` has for it; a taxel is in contact above `threshold`.
    ///
    /// # Errors
    ///
    /// [`TaskError`], with the numbers.
    pub fn new(
        layout: Layout,
        forces: &[Vec<f64>],
        labels: &[usize],
        threshold: f64,
    ) -> Result<Self, TaskError> {
        let taxels = layout.len();
        if labels.len() != forces.len() || forces.iter().any(|f| f.len() != taxels) {
            return Err(TaskError::Sizes {
                frames: forces.len(),
                taxels: forces
                    .iter()
                    .map(Vec::len)
                    .find(|n| *n != taxels)
                    .unwrap_or(taxels),
                labels: labels.len(),
                places: taxels,
            });
        }
        let mut of_label: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (n, label) in labels.iter().enumerate() {
            of_label.entry(*label).or_default().push(n);
        }
        let classes = of_label.len();
        let smallest = of_label.iter().min_by_key(|(_, frames)| frames.len());
        let (label, least) = smallest.map_or((0, 0), |(label, frames)| (*label, frames.len()));
        if classes < 2 || least < 2 * EXAMPLES {
            return Err(TaskError::TooFew {
                label,
                frames: least,
                classes,
            });
        }
        let mut task = Self {
            layout,
            frames: forces.iter().map(|forces| frame(forces, threshold)).collect(),
            class: vec![0; labels.len()],
            classes,
            examples: Vec::new(),
            unknown: Vec::new(),
        };
        for (class, frames) in of_label.into_values().enumerate() {
            frames.iter().for_each(|n| task.class[*n] = class);
            let (examples, unknown) = frames.split_at(frames.len() / 2);
            task.examples.push(examples.to_vec());
            task.unknown.extend_from_slice(unknown);
        }
        Ok(task)
    }

    /// Number of classes.
    pub fn classes(&self) -> usize {
        self.classes
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// Whether there is no frame: never.
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// Least and most examples of a class that are drawn where things are moved: ten, or all that the class has.
    pub fn moved_examples(&self) -> [usize; 2] {
        let counts = || {
            self.examples
                .iter()
                .map(|examples| examples.len().min(MOVED_EXAMPLES))
        };
        [counts().min().unwrap_or(0), counts().max().unwrap_or(0)]
    }

    /// Median number of contacts.
    pub fn contacts_median(&self) -> f64 {
        let mut contacts: Vec<f64> = self.frames.iter().map(|f| f.contacts() as f64).collect();
        quantile(&mut contacts, 0.5)
    }

    /// How much is recognised of what is shown, where every frame has a compressor of its own.
    ///
    /// # Errors
    ///
    /// A profile that describes no display, or not for this hand.
    pub fn judge(&self, name: &str, shown: &Shown) -> Result<TaskRow, ProfileError> {
        let pictures = vec![self.pictures(shown, None, None)?];
        self.row(name, pictures, |moves| self.pictures(shown, Some(moves), None))
    }

    /// The same where one compressor sees all frames, in a random order with a frame without contacts between any two,
    /// so that what it remembers is of other things mostly. Each draw has an order of its own. `None` where that
    /// changes no picture: what is shown has no memory.
    ///
    /// # Errors
    ///
    /// As [`Task::judge`].
    pub fn judge_running(&self, name: &str, shown: &Shown) -> Result<Option<TaskRow>, ProfileError> {
        let fresh = self.pictures(shown, None, None)?;
        let mut random = Random::for_purpose(SEED, ORDERS);
        let mut order = || {
            let mut order: Vec<usize> = (0..self.frames.len()).collect();
            random.shuffle(&mut order);
            order
        };
        let pictures: Result<Vec<Pictures>, _> = (0..DRAWS)
            .map(|_| self.pictures(shown, None, Some(&order())))
            .collect();
        let pictures = pictures?;
        if (pictures.iter()).all(|running| (&running.force, &running.level) == (&fresh.force, &fresh.level)) {
            return Ok(None);
        }
        self.row(name, pictures, |moves| {
            self.pictures(shown, Some(moves), Some(&order()))
        })
        .map(Some)
    }

    /// Judges pictures, those of the draws in turn, and of frames that are moved.
    fn row(
        &self,
        name: &str,
        mut of_draws: Vec<Pictures>,
        mut moved: impl FnMut(&[[i32; 2]]) -> Result<Pictures, ProfileError>,
    ) -> Result<TaskRow, ProfileError> {
        let mut random = Random::new(SEED);
        let (mut nearest, mut logistic, mut level_nearest) = (0.0, 0.0, 0.0);
        for pictures in of_draws.iter().cycle().take(DRAWS) {
            let drawn = self.draw(EXAMPLES, &mut random);
            nearest += self.nearest(&pictures.force, &drawn);
            logistic += self.logistic(&pictures.force, &drawn);
            if let Some(level) = &pictures.level {
                level_nearest += self.nearest(level, &drawn);
            }
        }
        let mean = |of: fn(&Pictures) -> f64| of_draws.iter().map(of).sum::<f64>() / of_draws.len() as f64;
        let (bits, level_bits) = (mean(|p| p.bits), mean(|p| p.level_bits));
        let has_levels = of_draws.iter().all(|pictures| pictures.level.is_some());
        let mut us: Vec<f64> = (of_draws.iter_mut())
            .flat_map(|pictures| pictures.us.drain(..))
            .collect();
        let mut row = TaskRow {
            name: name.into(),
            nearest: nearest / DRAWS as f64,
            logistic: logistic / DRAWS as f64,
            moved_nearest: 0.0,
            moved_logistic: 0.0,
            bits,
            level_nearest: has_levels.then_some(level_nearest / DRAWS as f64),
            level_bits: has_levels.then_some(level_bits),
            compress_us_p50: (!us.is_empty()).then(|| quantile(&mut us, 0.5)),
        };
        for _ in 0..MOVED_DRAWS {
            let mut step = || random.below(2 * MOVED_PX as usize + 1) as i32 - MOVED_PX;
            let moves: Vec<[i32; 2]> = self.frames.iter().map(|_| [step(), step()]).collect();
            let pictures = moved(&moves)?;
            let drawn = self.draw(MOVED_EXAMPLES, &mut random);
            row.moved_nearest += self.nearest(&pictures.force, &drawn);
            row.moved_logistic += self.logistic(&pictures.force, &drawn);
        }
        row.moved_nearest /= MOVED_DRAWS as f64;
        row.moved_logistic /= MOVED_DRAWS as f64;
        Ok(row)
    }

    /// Share recognised by the nearest of two examples, and the bits it takes: for curves.
    ///
    /// # Errors
    ///
    /// A profile that describes no display, or not for this hand.
    pub fn point(
        &self,
        name: &str,
        shown: &Shown,
        levels: u16,
        actuators: u16,
    ) -> Result<TaskPoint, ProfileError> {
        let mut random = Random::new(SEED);
        let pictures = self.pictures(shown, None, None)?;
        let of_draw = |_| self.nearest(&pictures.force, &self.draw(EXAMPLES, &mut random));
        Ok(TaskPoint {
            name: name.into(),
            levels,
            actuators,
            nearest: (0..DRAWS).map(of_draw).sum::<f64>() / DRAWS as f64,
            bits: pictures.bits,
        })
    }

    /// So many examples of each class, or all there are.
    fn draw(&self, count: usize, random: &mut Random) -> Vec<usize> {
        let mut drawn = Vec::new();
        for examples in &self.examples {
            let mut left = examples.clone();
            for _ in 0..count.min(examples.len()) {
                drawn.push(left.swap_remove(random.below(left.len())));
            }
        }
        drawn
    }

    fn nearest(&self, pictures: &[Vec<f64>], drawn: &[usize]) -> f64 {
        let examples = self.examples_of(pictures, drawn);
        self.recognised(|n| nearest(&examples, &pictures[n]))
    }

    fn logistic(&self, pictures: &[Vec<f64>], drawn: &[usize]) -> f64 {
        let model = Logistic::learn(&self.examples_of(pictures, drawn), self.classes);
        self.recognised(|n| model.class(&pictures[n]))
    }

    fn examples_of<'a>(&self, pictures: &'a [Vec<f64>], drawn: &[usize]) -> Vec<(&'a [f64], usize)> {
        drawn
            .iter()
            .map(|n| (&pictures[*n][..], self.class[*n]))
            .collect()
    }

    fn recognised(&self, class: impl Fn(usize) -> usize) -> f64 {
        let right = self
            .unknown
            .iter()
            .filter(|n| class(**n) == self.class[**n])
            .count();
        right as f64 / self.unknown.len() as f64
    }

    /// What is shown of every frame, by one compressor in the order given, or else each by its own.
    fn pictures(
        &self,
        shown: &Shown,
        moves: Option<&[[i32; 2]]>,
        order: Option<&[usize]>,
    ) -> Result<Pictures, ProfileError> {
        let mut pictures = Pictures::new(self.frames.len(), shown);
        let mut running = match shown {
            Shown::Method(method) if order.is_some() => {
                Some(Compressor::new(method.profile.clone(), &self.layout)?)
            }
            _ => None,
        };
        for at in 0..self.frames.len() {
            let n = order.map_or(at, |order| order[at]);
            let frame = match moves {
                Some(moves) => Cow::Owned(self.moved(&self.frames[n], moves[n])),
                None => Cow::Borrowed(&self.frames[n]),
            };
            pictures.add(n, &self.layout, &frame, shown, running.as_mut())?;
        }
        pictures.bits /= self.frames.len() as f64;
        pictures.level_bits /= self.frames.len() as f64;
        let [width, height] = [self.layout.width, self.layout.height].map(usize::from);
        let blurred = |picture: &mut Vec<f64>| *picture = blur(picture, width, height);
        pictures.force.iter_mut().for_each(blurred);
        pictures.level.iter_mut().flatten().for_each(blurred);
        Ok(pictures)
    }

    /// The frame moved by so many pixels; what leaves the skin is gone.
    fn moved(&self, frame: &ForceFrame, [dx, dy]: [i32; 2]) -> ForceFrame {
        let mut moved = ForceFrame::new(frame.force.len());
        for (n, taxel) in self.layout.taxels.iter().enumerate() {
            let to = |v: u16, d: i32| u16::try_from(i32::from(v) + d).ok();
            let other = to(taxel.x, dx).zip(to(taxel.y, dy));
            if let Some(to) = other.and_then(|(x, y)| self.layout.taxel_at(x, y)) {
                moved.force[to] = frame.force[n];
                moved.contact[to] = frame.contact[n];
            }
        }
        moved
    }
}

fn frame(forces: &[f64], threshold: f64) -> ForceFrame {
    let mut frame = ForceFrame::new(forces.len());
    frame.threshold = threshold;
    for ((to, contact), force) in frame.force.iter_mut().zip(&mut frame.contact).zip(forces) {
        *to = force.max(0.0);
        *contact = *force > threshold;
    }
    frame
}

#[cfg(test)]
mod tests;
