//! Which taxels take part: the contact list.

use taxel_hand::{FORCE_MAX, FORCE_MIN, Faults, ForceFrame, Geometry};

/// Taxels that are looked at together.
const AT_ONCE: usize = 8;
/// Bits of a word.
const BITS: usize = u64::BITS as usize;

/// The contacts of a frame in raster order (row by row, left to right), as columns.
#[derive(Debug)]
pub(crate) struct Contacts {
    /// Every taxel of the geometry in raster order.
    raster: Vec<Place>,
    /// Where each taxel is in that order.
    rank_of: Vec<u16>,
    /// A bit for each taxel in raster order: the contacts of this frame.
    listed: Vec<u64>,
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
        let mut rank_of = vec![0; taxels];
        for (rank, place) in raster.iter().enumerate() {
            rank_of[place.taxel] = rank as u16;
        }
        Self {
            rank_of,
            listed: vec![0; taxels.div_ceil(BITS)],
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
        self.find(frame);
        if frame.calibrating {
            self.rank.clear();
        }
        let force = &frame.force;
        let places = self.rank.iter().map(|rank| &self.raster[usize::from(*rank)]);
        self.force.extend(places.clone().map(|place| force[place.taxel]));
        self.x.extend(places.clone().map(|place| place.at[0]));
        self.y.extend(places.clone().map(|place| place.at[1]));
        self.pixel.extend(places.clone().map(|place| place.pixel));
        self.part.extend(places.map(|place| place.part));
    }

    /// Lists the contacts by their numbers in raster order. Most taxels of most frames are at rest, so they are looked at
    /// several at once.
    fn find(&mut self, frame: &ForceFrame) {
        let known = frame.force.len().min(frame.contact.len()).min(frame.faults.len());
        let known = known.min(self.raster.len());
        self.listed.fill(0);
        self.refused = 0;
        let (force, force_left) = frame.force[..known].as_chunks::<AT_ONCE>();
        let (contact, contact_left) = frame.contact[..known].as_chunks::<AT_ONCE>();
        let (faults, faults_left) = frame.faults[..known].as_chunks::<AT_ONCE>();
        let (ranks, ranks_left) = self.rank_of[..known].as_chunks::<AT_ONCE>();
        for (((force, contact), faults), ranks) in force.iter().zip(contact).zip(faults).zip(ranks) {
            let at_rest = *contact == [false; AT_ONCE] && *faults == [Faults::NONE; AT_ONCE];
            if at_rest && force.iter().fold(true, |all, force| all & force.is_finite()) {
                continue;
            }
            self.refused += list(&mut self.listed, force, contact, faults, ranks);
        }
        self.refused += list(
            &mut self.listed,
            force_left,
            contact_left,
            faults_left,
            ranks_left,
        );
        for (word, first) in self.listed.iter().zip((0u16..).step_by(BITS)) {
            let mut left = *word;
            while left != 0 {
                self.rank.push(first + left.trailing_zeros() as u16);
                left &= left - 1;
            }
        }
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

/// Lists those of some taxels that are contacts, without a branch for any of them. Returns how many are refused.
fn list(listed: &mut [u64], force: &[f64], contact: &[bool], faults: &[Faults], ranks: &[u16]) -> usize {
    let mut refused = 0;
    for (((force, contact), faults), rank) in force.iter().zip(contact).zip(faults).zip(ranks) {
        let (sound, usable) = (faults.is_empty(), is_force(*force, *contact));
        let rank = usize::from(*rank);
        listed[rank / BITS] |= u64::from(sound & usable & contact) << (rank % BITS);
        refused += usize::from(sound & !usable);
    }
    refused
}

/// Whether a taxel's force can be used: a finite number, and in range where the taxel is in contact.
#[inline]
pub(crate) fn is_force(force: f64, contact: bool) -> bool {
    let (in_range, finite) = ((FORCE_MIN..=FORCE_MAX).contains(&force), force.is_finite());
    in_range | (finite & !contact)
}
