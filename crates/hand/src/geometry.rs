//! Where the taxels of a hand sit: on which module, at which pixel of the tactile image, where in
//! millimetres.

use crate::Pose;

/// Most modules of a hand.
pub const MAX_MODULES: usize = 1000;
/// Most taxels of a hand: their numbers fit in 16 bits with one left over for "none".
pub const MAX_TAXELS: usize = 65_535;
/// Most pixels in a tactile image: a strip 65,535 pixels long and 16 high just fits.
pub const MAX_PIXELS: usize = 1 << 20;

const NO_TAXEL: u16 = u16::MAX;

/// A hand's modules and every taxel's place.
///
/// Taxels are numbered `0..N` in the order of `modules`, and within a module by the board's own numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Geometry {
    /// Name of the hand, such as `allegro-uskin-15`.
    pub name: String,
    /// Width of the tactile image, pixels.
    pub width: u16,
    /// Height of the tactile image, pixels.
    pub height: u16,
    /// The modules, in the order of the layout file.
    pub modules: Vec<Module>,
    /// The taxels, indexed by taxel number.
    pub taxels: Vec<Taxel>,
    /// Taxel of each pixel, row by row; `NO_TAXEL` where there is none.
    pixels: Vec<u16>,
}

/// One board's patch of taxels.
#[derive(Debug, Clone, PartialEq)]
pub struct Module {
    /// Name for people, such as `index tip`.
    pub name: String,
    /// Part of the hand it belongs to, such as `index`; actuators of different parts are not neighbours.
    pub part: String,
    /// Number of its first taxel.
    pub first_taxel: u16,
    /// How many taxels it has.
    pub taxels: u16,
    /// Where it sits on its link, where known.
    pub pose: Option<Pose>,
    /// Name of the joint that moves its link; `None` where it sits on the hand's base, or nobody
    /// knows. Nothing here checks that a joint of this name is read.
    pub joint: Option<String>,
}

/// One taxel's place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Taxel {
    /// Index of its module in [`Geometry::modules`].
    pub module: u16,
    /// Column in the tactile image, from the left.
    pub x: u16,
    /// Row in the tactile image, from the top.
    pub y: u16,
    /// Place on the hand, millimetres, where known.
    pub position_mm: Option<[f32; 3]>,
}

/// Why taxels and an image are no hand.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum GeometryError {
    /// No taxel in a grid, more taxels than there are numbers for, or more pixels than an image may have.
    #[error(
        "{taxels} taxels in {width}x{height} pixels; there may be {MAX_TAXELS} taxels and {MAX_PIXELS} pixels"
    )]
    Size {
        /// Number of taxels.
        taxels: usize,
        /// Width of the image.
        width: u16,
        /// Height of the image.
        height: u16,
    },
    /// A taxel outside the image, on the pixel of another one, or of a module that is not there.
    #[error("taxel {taxel} at ({x}, {y}) lies outside the image, on another taxel's pixel, or in no module")]
    BadTaxel {
        /// Number of the taxel.
        taxel: usize,
        /// Its column.
        x: u16,
        /// Its row.
        y: u16,
    },
}

impl Geometry {
    /// Puts a hand together. Every taxel lies in the image and in a module, no two on one pixel.
    pub fn new(
        name: impl Into<String>,
        [width, height]: [u16; 2],
        modules: Vec<Module>,
        taxels: Vec<Taxel>,
    ) -> Result<Self, GeometryError> {
        let size = usize::from(width) * usize::from(height);
        if size > MAX_PIXELS || taxels.len() > MAX_TAXELS {
            return Err(GeometryError::Size {
                taxels: taxels.len(),
                width,
                height,
            });
        }
        let mut pixels = vec![NO_TAXEL; size];
        for (index, taxel) in taxels.iter().enumerate() {
            let Taxel { x, y, module, .. } = *taxel;
            let pixel = (x < width && y < height)
                .then(|| &mut pixels[usize::from(y) * usize::from(width) + usize::from(x)])
                .filter(|pixel| **pixel == NO_TAXEL && usize::from(module) < modules.len());
            let Some(pixel) = pixel else {
                return Err(GeometryError::BadTaxel { taxel: index, x, y });
            };
            *pixel = index as u16;
        }
        Ok(Self {
            name: name.into(),
            width,
            height,
            modules,
            taxels,
            pixels,
        })
    }

    /// Names of the joints that move modules, each once, in the order of the modules.
    pub fn joints(&self) -> Vec<&str> {
        let mut names: Vec<&str> = Vec::new();
        for name in self.modules.iter().filter_map(|module| module.joint.as_deref()) {
            if !names.contains(&name) {
                names.push(name);
            }
        }
        names
    }

    /// An array without modules of its own: one taxel per pixel, numbered row by row, in one pseudo
    /// module `grid`.
    ///
    /// Refuses empty arrays and those of more than [`MAX_TAXELS`] taxels.
    pub fn grid(width: u16, height: u16) -> Result<Self, GeometryError> {
        Self::grid_of_cells(width, height, |_| true)
    }

    /// The same of an array in which only some cells are taxels; these are asked for row by row, by their numbers from 0.
    pub fn grid_of_cells(
        width: u16,
        height: u16,
        is_taxel: impl Fn(usize) -> bool,
    ) -> Result<Self, GeometryError> {
        let cells = usize::from(width) * usize::from(height);
        let count = (0..cells).filter(|cell| is_taxel(*cell)).count();
        if count == 0 || count > MAX_TAXELS {
            return Err(GeometryError::Size {
                taxels: count,
                width,
                height,
            });
        }
        let module = Module {
            name: "grid".into(),
            part: "grid".into(),
            first_taxel: 0,
            taxels: count as u16,
            pose: None,
            joint: None,
        };
        let taxel = |cell: usize| Taxel {
            module: 0,
            x: (cell % usize::from(width)) as u16,
            y: (cell / usize::from(width)) as u16,
            position_mm: None,
        };
        let taxels = (0..cells).filter(|cell| is_taxel(*cell)).map(taxel).collect();
        Self::new(
            format!("grid:{height}x{width}"),
            [width, height],
            vec![module],
            taxels,
        )
    }

    /// Number of taxels, `N`.
    pub fn len(&self) -> usize {
        self.taxels.len()
    }

    /// Whether there is no taxel.
    pub fn is_empty(&self) -> bool {
        self.taxels.is_empty()
    }

    /// The taxel at this pixel; `None` where the image is padding, and outside it.
    pub fn taxel_at(&self, x: u16, y: u16) -> Option<usize> {
        if x >= self.width {
            return None;
        }
        let taxel = *self
            .pixels
            .get(usize::from(y) * usize::from(self.width) + usize::from(x))?;
        (taxel != NO_TAXEL).then_some(usize::from(taxel))
    }

    /// The module a taxel belongs to. `taxel` is below [`Geometry::len`].
    pub fn module_of(&self, taxel: usize) -> &Module {
        &self.modules[usize::from(self.taxels[taxel].module)]
    }
}

impl Module {
    /// Numbers of its taxels.
    pub fn taxel_range(&self) -> std::ops::Range<usize> {
        let first = usize::from(self.first_taxel);
        first..first + usize::from(self.taxels)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hand(size: [u16; 2], places: &[[u16; 3]]) -> Result<Geometry, GeometryError> {
        let module = Module {
            name: "tip".into(),
            part: "index".into(),
            first_taxel: 0,
            taxels: places.len() as u16,
            pose: None,
            joint: None,
        };
        let taxels = places.iter().map(|&[module, x, y]| Taxel {
            module,
            x,
            y,
            position_mm: None,
        });
        Geometry::new("test", size, vec![module], taxels.collect())
    }

    #[test]
    fn each_pixel_knows_its_taxel() {
        let hand = hand([3, 2], &[[0, 2, 0], [0, 0, 1]]).unwrap();
        assert_eq!(hand.taxel_at(2, 0), Some(0));
        assert_eq!(hand.taxel_at(0, 1), Some(1));
        for outside in [(0, 0), (3, 0), (0, 2), (u16::MAX, u16::MAX)] {
            assert_eq!(hand.taxel_at(outside.0, outside.1), None);
        }
        assert_eq!(hand.module_of(1).taxel_range(), 0..2);
    }

    #[test]
    fn what_is_no_hand_is_refused() {
        for (size, places) in [
            ([3, 2], [[0, 3, 0], [0, 0, 0]]),
            ([3, 2], [[0, 1, 1], [0, 1, 1]]),
            ([3, 2], [[0, 1, 1], [1, 2, 1]]),
            ([0, 0], [[0, 0, 0], [0, 0, 1]]),
            ([u16::MAX, u16::MAX], [[0, 0, 0], [0, 0, 1]]),
        ] {
            assert!(hand(size, &places).is_err(), "{size:?} {places:?}");
        }
    }
}
