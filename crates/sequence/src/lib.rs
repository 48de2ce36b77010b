//! Touches and squeezes cut out of a stream of tactile frames, and aligned so that they can be compared.
//!
//! A stream is frames of equal size with their times. [`cut_by_marks`] and [`cut_by_contact`] say which frames belong to
//! which touch; a manifest that names them needs neither. A [`Touch`] is such frames with the place of each along the
//! motion: a depth, an angle or a time. [`align`] averages the frames of each step of the motion and puts the steps of
//! all touches side by side; it never makes up a step that was not recorded.
//!
//! ```
//! use taxel_sequence::{Alignment, Touch, align};
//!
//! let touch = |name: &str, at: &[f64]| Touch {
//!     name: name.into(),
//!     at: at.to_vec(),
//!     taxels: 1,
//!     values: at.iter().map(|depth| 10.0 * depth).collect(),
//! };
//! let touches = [touch("a", &[0.0, 0.5, 1.0]), touch("b", &[0.5, 0.6, 1.0, 1.5])];
//! let aligned = align(&touches, Alignment::Depth, 0.5)?;
//! assert_eq!((aligned.first, aligned.steps), (0.5, 2));
//! assert_eq!(aligned.row(1), [5.5, 10.0]);
//! # Ok::<(), taxel_sequence::SequenceError>(())
//! ```

mod align;
mod cut;
mod motion;

pub use align::{Aligned, Alignment, Touch, align, sure_step};
pub use cut::{ContactCuts, Cut, Mark, cut_by_contact, cut_by_marks};
pub use motion::Motion;

/// Why a stream has no touches, or touches cannot be put side by side.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SequenceError {
    /// A motion that no probe makes.
    #[error(
        "a motion of depth {depth_mm} mm and radius {radius_mm} mm; the depth must be 0.5 to 40 mm, the radius 0 to 100 mm"
    )]
    Motion {
        /// The depth.
        depth_mm: f64,
        /// The radius.
        radius_mm: f64,
    },
    /// No touch.
    #[error("there is no touch; is the stream cut by the right marks or threshold?")]
    NoTouch,
    /// A touch without frames, or whose places do not fit them.
    #[error("touch {}: {places} places and {values} values do not make frames of {taxels} taxels", bare(.touch))]
    Shape {
        /// The touch's name.
        touch: String,
        /// Places along the motion.
        places: usize,
        /// Values of all frames.
        values: usize,
        /// Taxels of a frame.
        taxels: usize,
    },
    /// Touches of different probes.
    #[error("touch {} has {found} taxels, and {expected} were expected; they are of different probes", bare(.touch))]
    Taxels {
        /// The touch's name.
        touch: String,
        /// Its taxels.
        found: usize,
        /// Taxels of the first touch, or of the map.
        expected: usize,
    },
    /// A step of nothing, or places that are no numbers.
    #[error("touch {}: its {along} {at} is not a number that a step of {step} can count", bare(.touch))]
    Place {
        /// The touch's name.
        touch: String,
        /// Depth, angle or time.
        along: Alignment,
        /// The place.
        at: f64,
        /// The step.
        step: f64,
    },
    /// A step that was not recorded.
    #[error("touch {}: no frame at {along} {at}; record it again, or align with a wider step", bare(.touch))]
    StepMissing {
        /// The touch's name.
        touch: String,
        /// Depth, angle or time.
        along: Alignment,
        /// Where.
        at: f64,
    },
    /// No step that all touches have.
    #[error(
        "touches {begins} and {ends} have no {along} in common: one begins at {first}, the other ends at {last}"
    )]
    NothingCommon {
        /// The touch that begins last.
        begins: String,
        /// The touch that ends first.
        ends: String,
        /// Depth, angle or time.
        along: Alignment,
        /// Where the one begins.
        first: f64,
        /// Where the other ends.
        last: f64,
    },
    /// Marks or frames out of order.
    #[error(
        "{what} {index} is at {} s, before the one ahead of it; put them in the order of their times",
        seconds(*.t_ns)
    )]
    Order {
        /// Mark or frame.
        what: &'static str,
        /// Which, from 0.
        index: usize,
        /// Its time.
        t_ns: u64,
    },
    /// Two marks with no frame between them.
    #[error("no frame between the mark {mark:?} at {} s and the next; {}", seconds(*.t_ns), why_none(*.t_ns, *.from_to_ns))]
    EmptyCut {
        /// The mark's text.
        mark: String,
        /// Its time.
        t_ns: u64,
        /// Those of the first and the last frame, if there is any.
        from_to_ns: Option<[u64; 2]>,
    },
}

fn seconds(ns: u64) -> f64 {
    ns as f64 / 1e9
}

/// Why there is no frame at a mark of this time.
fn why_none(t_ns: u64, from_to_ns: Option<[u64; 2]>) -> String {
    match from_to_ns {
        Some([first, last]) if !(first..=last).contains(&t_ns) => format!(
            "the frames are from {} s to {} s, and marks are times on the same clock",
            seconds(first),
            seconds(last)
        ),
        _ => "was the recording interrupted?".into(),
    }
}

/// A touch's name behind the word: that of a mark often begins with it.
fn bare(name: &str) -> &str {
    name.strip_prefix("touch ").unwrap_or(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_touch_that_is_named_as_one_is_not_called_so_twice() {
        for (touch, named) in [("touch 5 SS", "touch 5 SS: "), ("b", "touch b: ")] {
            let error = SequenceError::StepMissing {
                touch: touch.into(),
                along: Alignment::Depth,
                at: 1.0,
            };
            assert!(error.to_string().starts_with(named), "{error}");
        }
    }
}
