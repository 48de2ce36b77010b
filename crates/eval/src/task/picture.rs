//! What is shown of a frame, as a picture, and how many bits it takes.

use crate::method::Method;
use std::time::Instant;
use taxel_compress::Compressor;
use taxel_hand::{ForceFrame, Geometry, ProfileError};

/// Standard deviation of the blur that pictures are compared after, pixels.
pub const BLUR_PX: f64 = 1.0;

/// What is shown of a frame.
#[derive(Debug, Clone)]
pub enum Shown {
    /// Every force.
    Raw,
    /// The forces of the contacts, as measured.
    Contacts,
    /// The greatest force in each cell of a regular grid, in so many equal steps of the frame's greatest
    /// force: what one would do without clustering.
    Blocks {
        /// Force levels.
        levels: u16,
        /// Cells.
        cells: u16,
    },
    /// What a method makes of it.
    Method(Box<Method>),
}

/// Places of a regular grid of `actuators` over an image, in pixels: as many rows as are nearest to a
/// square of cells.
///
/// ```
/// use taxel_hand::Geometry;
/// let places = taxel_eval::grid_places(&Geometry::grid(16, 16)?, 16);
/// assert_eq!((places[0], places[15]), ([1.5, 1.5], [13.5, 13.5]));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn grid_places(geometry: &Geometry, actuators: u16) -> Vec<[f64; 2]> {
    let [columns, rows] = grid_shape(geometry, actuators);
    let place = |n: u16, of: u16, size: u16| (f64::from(n) + 0.5) * f64::from(size) / f64::from(of) - 0.5;
    (0..rows)
        .flat_map(|row| (0..columns).map(move |column| (column, row)))
        .map(|(column, row)| {
            [
                place(column, columns, geometry.width),
                place(row, rows, geometry.height),
            ]
        })
        .collect()
}

/// Columns and rows of a grid of exactly so many cells, as nearly square as can be.
pub(super) fn grid_shape(geometry: &Geometry, cells: u16) -> [u16; 2] {
    let slender = |rows: u16| {
        let cell = f64::from(geometry.width) * f64::from(rows)
            / f64::from(cells / rows)
            / f64::from(geometry.height);
        cell.ln().abs()
    };
    let rows = (1..=cells).filter(|rows| cells.is_multiple_of(*rows));
    let rows = rows
        .min_by(|a, b| slender(*a).total_cmp(&slender(*b)))
        .unwrap_or(1);
    [cells / rows, rows]
}

/// What a person or a program sees of every frame.
pub(super) struct Pictures {
    /// Forces by pixel, of each frame.
    pub(super) force: Vec<Vec<f64>>,
    /// Numbers of the levels by pixel, where there are levels.
    pub(super) level: Option<Vec<Vec<f64>>>,
    pub(super) level_bits: f64,
    pub(super) bits: f64,
    pub(super) us: Vec<f64>,
}

impl Pictures {
    /// Room for so many frames.
    pub(super) fn new(frames: usize, shown: &Shown) -> Self {
        let none = vec![Vec::new(); frames];
        Self {
            level: matches!(shown, Shown::Method(_)).then(|| none.clone()),
            force: none,
            level_bits: 0.0,
            bits: 0.0,
            us: Vec::new(),
        }
    }

    /// Adds what is shown of frame `n`, a method's image by the compressor that runs on, after the hand has let go, or
    /// else by one that has seen none before.
    pub(super) fn add(
        &mut self,
        n: usize,
        geometry: &Geometry,
        frame: &ForceFrame,
        shown: &Shown,
        running: Option<&mut Compressor>,
    ) -> Result<(), ProfileError> {
        let width = usize::from(geometry.width);
        let empty = || vec![0.0; width * usize::from(geometry.height)];
        let at = |x: u16, y: u16| usize::from(y) * width + usize::from(x);
        let place_bits = bits(geometry.taxels.len());
        let mut picture = empty();
        match shown {
            Shown::Raw | Shown::Contacts => {
                let all = matches!(shown, Shown::Raw);
                for ((taxel, force), contact) in geometry.taxels.iter().zip(&frame.force).zip(&frame.contact)
                {
                    if all || *contact {
                        picture[at(taxel.x, taxel.y)] = *force;
                    }
                }
                self.bits += if all {
                    16.0 * geometry.taxels.len() as f64
                } else {
                    frame.contacts() as f64 * (place_bits + 16.0)
                };
            }
            Shown::Blocks { levels, cells } => {
                let places = grid_places(geometry, *cells);
                let [columns, rows] = grid_shape(geometry, *cells).map(usize::from);
                let greatest = frame.force.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
                let steps = f64::from(*levels);
                for (taxel, force) in geometry.taxels.iter().zip(&frame.force) {
                    let column = usize::from(taxel.x) * columns / width;
                    let row = usize::from(taxel.y) * rows / usize::from(geometry.height);
                    let [x, y] = places[row * columns + column].map(|v| v.max(0.0) as u16);
                    let level = (steps * force / greatest).round();
                    let pixel = &mut picture[at(x, y)];
                    *pixel = pixel.max(level);
                }
                self.bits += f64::from(*cells) * bits(usize::from(*levels) + 1) + 32.0;
            }
            Shown::Method(method) => {
                let mut fresh = Compressor::new(method.profile.clone(), geometry)?;
                let mut image = fresh.new_image();
                let compressor = match running {
                    Some(running) => {
                        running.compress(&ForceFrame::new(frame.force.len()), &mut image);
                        running
                    }
                    None => &mut fresh,
                };
                let start = Instant::now();
                compressor.compress(frame, &mut image);
                self.us.push(start.elapsed().as_secs_f64() * 1e6);
                let mut level = empty();
                for actuator in &image.actuators {
                    picture[at(actuator.x, actuator.y)] = actuator.force;
                    level[at(actuator.x, actuator.y)] = f64::from(actuator.level);
                }
                if let Some(levels) = &mut self.level {
                    levels[n] = level;
                }
                let levels = usize::from(method.profile.level_count());
                let sent = if method.profile.fixed.is_empty() {
                    image.actuators.len() as f64 * (place_bits + bits(levels))
                } else {
                    f64::from(method.profile.actuators) * bits(levels + 1)
                };
                self.level_bits += sent;
                // Levels that were spread over several of the display are told once.
                let levels = image.levels.chunk_by(|a, b| a == b).count();
                self.bits += sent + 32.0 * levels as f64;
            }
        }
        self.force[n] = picture;
        Ok(())
    }
}

/// Bits that tell so many things apart.
fn bits(things: usize) -> f64 {
    f64::from(things.max(1).next_power_of_two().trailing_zeros())
}

/// A picture blurred by a Gaussian, and divided by its sum.
pub(super) fn blur(picture: &[f64], width: usize, height: usize) -> Vec<f64> {
    let reach = (4.0 * BLUR_PX) as isize;
    let weight = |d: isize| (-0.5 * (d as f64 / BLUR_PX).powi(2)).exp();
    let kernel: Vec<(isize, f64)> = (-reach..=reach).map(|d| (d, weight(d))).collect();
    let along = |from: &[f64], count: usize, step: usize, at: usize| -> f64 {
        let place = (at / step % count) as isize;
        let terms = kernel
            .iter()
            .filter(|(d, _)| (0..count as isize).contains(&(place + d)));
        terms
            .map(|(d, w)| w * from[at.wrapping_add_signed(d * step as isize)])
            .sum()
    };
    let rows: Vec<f64> = (0..picture.len())
        .map(|at| along(picture, width, 1, at))
        .collect();
    let both: Vec<f64> = (0..picture.len())
        .map(|at| along(&rows, height, width, at))
        .collect();
    let sum = both.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    both.into_iter().map(|v| v / sum).collect()
}
