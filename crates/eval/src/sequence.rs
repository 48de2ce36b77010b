//! The frames that methods are judged on, and the best there is for each.

use crate::best_levels::least_level_error;
use crate::best_places::least_place_error;
use crate::jump_bound::unavoidable_jumps;
use crate::plane::Plane;
use crate::tally::share;
use std::collections::HashMap;
use taxel_compress::Compressor;
use taxel_hand::{Coordinates, ForceFrame, Profile, ProfileError, TactileFrame};
use taxel_skin::{ConditionConfig, Layout};

/// Frames in the order of their times.
#[derive(Debug, Clone)]
pub struct Sequence {
    /// The hand.
    pub layout: Layout,
    /// Conditioned frames, as compression takes them.
    pub force: Vec<ForceFrame>,
    /// What they were made from, one per force frame; empty where the recording holds magnitudes.
    pub tactile: Vec<TactileFrame>,
    /// How they were made from it.
    pub conditioning: Option<ConditionConfig>,
}

impl Sequence {
    /// Number of frames.
    pub fn len(&self) -> usize {
        self.force.len()
    }

    /// Whether there is no frame.
    pub fn is_empty(&self) -> bool {
        self.force.is_empty()
    }

    /// What its numbers are.
    pub(crate) fn felt(&self) -> Felt {
        let squared = self
            .conditioning
            .as_ref()
            .is_some_and(|c| c.magnitude.is_squared());
        if squared { Felt::Square } else { Felt::Force }
    }

    /// Frames per second, by the first and the last frame's time; 0 of fewer than two frames.
    pub fn rate_hz(&self) -> f64 {
        match (self.force.first(), self.force.last()) {
            (Some(first), Some(last)) if last.t_ns > first.t_ns => {
                (self.len() - 1) as f64 * 1e9 / (last.t_ns - first.t_ns) as f64
            }
            _ => 0.0,
        }
    }
}

/// What force a number of a force frame is.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Felt {
    /// A force.
    #[default]
    Force,
    /// The square of one, [`taxel_skin::MagnitudeMode::is_squared`].
    Square,
}

impl Felt {
    pub(crate) fn of(self, magnitude: f64) -> f64 {
        match self {
            Self::Force => magnitude,
            Self::Square => magnitude.sqrt(),
        }
    }
}

/// The contacts of one frame and the best that can be done with them.
#[derive(Debug, Clone, PartialEq)]
pub struct Reference {
    /// Column and row of each contact, in raster order.
    pub pixel: Vec<[u16; 2]>,
    /// Where it is, in the coordinates of the [`Plane`].
    pub place: Vec<[f64; 2]>,
    /// Its force.
    pub force: Vec<f64>,
    /// Least squared error that the force levels can have.
    pub level_error: f64,
    /// Least squared error known of the actuators' places, in the unit of the [`Plane`] squared.
    pub place_error: f64,
}

/// The [`Reference`] of every frame, for a number of levels and actuators.
#[derive(Debug, Clone)]
pub struct References {
    /// One per frame; without contacts, an empty one.
    pub frames: Vec<Reference>,
    /// `K_D`.
    pub levels: u16,
    /// `K_A`.
    pub actuators: u16,
    /// In which coordinates places are judged.
    pub plane: Plane,
    /// Share of the actuators that must jump between consecutive frames with contacts, whatever the
    /// method, if no frame's position error is more than 1.08 times the best known: a lower bound.
    pub jump_bound: f64,
}

impl References {
    /// Finds the references in these coordinates, with `restarts` runs per set of contacts; calls `progress` after each frame.
    ///
    /// Which taxels are contacts is read off [`Compressor::stages`]: it does not depend on the method.
    ///
    /// # Errors
    ///
    /// Numbers of levels or actuators that no profile may have; places on the hand that the layout does not know.
    pub fn find(
        sequence: &Sequence,
        levels: u16,
        actuators: u16,
        coordinates: Coordinates,
        restarts: u32,
        mut progress: impl FnMut(),
    ) -> Result<Self, ProfileError> {
        let profile = Profile {
            levels,
            actuators,
            ..Profile::default()
        };
        let mut compressor = Compressor::new(profile, &sequence.layout)?;
        let mut image = compressor.new_image();
        // Hands at rest and hands pressed all over have the same contacts frame after frame.
        let mut known: HashMap<Vec<[u16; 2]>, f64> = HashMap::new();
        let mut frames: Vec<Reference> = Vec::with_capacity(sequence.len());
        let (mut jumps, mut kept) = (0, 0);
        let plane = Plane::new(&sequence.layout, coordinates)?;
        for frame in &sequence.force {
            compressor.compress(frame, &mut image);
            let stages = compressor.stages();
            let pixel = stages.pixel.to_vec();
            let place: Vec<[f64; 2]> = pixel.iter().map(|pixel| plane.at(*pixel)).collect();
            let force = stages.force.to_vec();
            let place_error = *known
                .entry(pixel.clone())
                .or_insert_with(|| least_place_error(&place, usize::from(actuators), restarts));
            if let Some(before) = frames.last().filter(|f| !f.pixel.is_empty())
                && !pixel.is_empty()
            {
                let most = usize::from(actuators);
                // No more ids than that can be in both images.
                kept += most.min(before.pixel.len()).min(pixel.len()) as u64;
                if before.pixel != pixel {
                    let (before, now) = ((&before.place[..], before.place_error), (&place[..], place_error));
                    jumps += unavoidable_jumps(before, now, most, restarts, plane.jump);
                }
            }
            frames.push(Reference {
                level_error: least_level_error(&force, usize::from(levels)),
                place_error,
                pixel,
                place,
                force,
            });
            progress();
        }
        Ok(Self {
            frames,
            levels,
            actuators,
            plane,
            jump_bound: share(jumps, kept),
        })
    }

    /// Frames with a contact.
    pub fn contact_frames(&self) -> usize {
        self.frames.iter().filter(|f| !f.force.is_empty()).count()
    }
}
