//! Which taxels take part: the contact list.

use taxel_hand::{FORCE_MAX, FORCE_MIN, ForceFrame, Geometry};

/// The contacts of a frame in raster order (row by row, left to right), as columns.
#[derive(Debug)]
pub(crate) struct Contacts {
    /// Every taxel of the geometry in raster order.
    raster: Vec<Place>,
    /// First coordinates of the places: columns of pixels, or millimetres.
    pub(crate) x: Vec<f64>,
    /// Second coordinates.
    pub(crate) y: Vec<f64>,
    /// Forces, from [`FORCE_MIN`] to [`FORCE_MAX`].
    pub(crate) force: Vec<f64>,
    /// The pixels themselves.
    pub(crate) pixel: Vec<[u16; 2]>,
    /// Numbers of the taxels in raster order.
    pub(crate) rank: Vec<u16>,
    /// Part of the hand each contact lies on.
    pub(crate) part: Vec<u16>,
    /// Taxels refused in this frame.
    pub(crate) refused: usize,
}

/// A taxel and its pixel.
#[derive(Debug, Clone, Copy)]
struct Place {
    taxel: usize,
    pixel: [u16; 2],
    at: [f64; 2],
    part: u16,
}

impl Contacts {
    /// An empty list with memory for every taxel of the geometry. `places` are where the taxels are
    /// in the coordinates asked for.
    pub(crate) fn new(geometry: &Geometry, places: &[[f64; 2]]) -> Self {
        let parts = crate::actuator_groups::parts(geometry);
        let part_of = |module: u16| {
            let module = geometry.modules.get(usize::from(module))?;
            parts.binary_search(&module.part.as_str()).ok()
        };
        let mut raster: Vec<Place> = (geometry.taxels.iter().zip(places).enumerate())
            .map(|(taxel, (t, at))| Place {
                taxel,
                pixel: [t.x, t.y],
                at: *at,
                part: part_of(t.module).map_or(0, |part| part as u16),
            })
            .collect();
        raster.sort_by_key(|p| (p.pixel[1], p.pixel[0]));
        let taxels = raster.len();
        Self {
            raster,
            x: Vec::with_capacity(taxels),
            y: Vec::with_capacity(taxels),
            force: Vec::with_capacity(taxels),
            pixel: Vec::with_capacity(taxels),
            rank: Vec::with_capacity(taxels),
            part: Vec::with_capacity(taxels),
            refused: 0,
        }
    }

    /// Takes the contacts of a frame, and counts what it refuses: a force that is no number, or a
    /// contact without a force in range.
    pub(crate) fn collect(&mut self, frame: &ForceFrame) {
        self.x.clear();
        self.y.clear();
        self.force.clear();
        self.pixel.clear();
        self.rank.clear();
        self.part.clear();
        self.refused = 0;
        let known = frame.force.len().min(frame.contact.len()).min(frame.faults.len());
        let (force, contact) = (&frame.force[..known], &frame.contact[..known]);
        let faults = &frame.faults[..known];
        for (rank, place) in self.raster.iter().enumerate() {
            if place.taxel >= known || !faults[place.taxel].is_empty() {
                continue;
            }
            let contact = contact[place.taxel];
            if !is_force(force[place.taxel], contact) {
                self.refused += 1;
            } else if contact {
                self.rank.push(rank as u16);
            }
        }
        if frame.calibrating {
            self.rank.clear();
        }
        let places = self.rank.iter().map(|rank| &self.raster[usize::from(*rank)]);
        self.force.extend(places.clone().map(|place| force[place.taxel]));
        self.x.extend(places.clone().map(|place| place.at[0]));
        self.y.extend(places.clone().map(|place| place.at[1]));
        self.pixel.extend(places.clone().map(|place| place.pixel));
        self.part.extend(places.map(|place| place.part));
    }

    /// Numbers of all taxels in raster order.
    pub(crate) fn raster(&self) -> Vec<usize> {
        self.raster.iter().map(|place| place.taxel).collect()
    }

    /// `N_C`.
    pub(crate) fn len(&self) -> usize {
        self.force.len()
    }

    /// Number of taxels of the geometry.
    pub(crate) fn taxels(&self) -> usize {
        self.raster.len()
    }
}

/// Whether a taxel's force can be used: a finite number, and in range where the taxel is in contact.
#[inline]
pub(crate) fn is_force(force: f64, contact: bool) -> bool {
    if contact {
        (FORCE_MIN..=FORCE_MAX).contains(&force)
    } else {
        force.is_finite()
    }
}
