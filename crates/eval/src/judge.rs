//! How well a method compresses: every error, over all frames.

use crate::method::Method;
use crate::plane::{Plane, squared_distance};
use crate::pressure::Places;
use crate::quantile::{mean, quantile};
use crate::sequence::{Felt, Reference, References, Sequence};
use crate::tally::{Tally, share};
use serde::Serialize;
use taxel_compress::Compressor;
use taxel_hand::{ProfileError, TactileImage};
use taxel_wire::{HEADER_LEN, image_payload_len};

/// Force levels count as optimal up to this share above the least error: rounding of sums in another order.
const ROUNDING: f64 = 1e-9;
/// A squared error that is no more than rounding, of the sum of squares.
const NO_ERROR: f64 = 1e-18;
/// One Weber step: the just noticeable difference of force (Pang, Tan and Durlach 1991: about 7 %).
const WEBER: f64 = 0.07;

/// What a method makes of the frames.
///
/// Ratios are means over the frames whose reference is not zero, and 1 where there is no such frame
/// and nothing to be said against the method. A frame has a reference of zero when it has no more
/// different forces than levels, or no more contacts than actuators.
#[derive(Debug, Default, Clone, PartialEq, Serialize)]
pub struct Errors {
    /// Squared error of the force levels over the least there is: mean over frames.
    pub force_sse_ratio_mean: f64,
    /// ... half of the frames have no more; a mean is easily one frame's whose least error is close to zero.
    pub force_sse_ratio_p50: f64,
    /// ... 95 in 100 frames have no more.
    pub force_sse_ratio_p95: f64,
    /// ... the worst frame.
    pub force_sse_ratio_max: f64,
    /// Share of the frames with contacts whose levels are optimal, within 1e-9 of the least error.
    pub force_optimal_fraction: f64,
    /// Frames that the force ratio is over.
    pub force_frames: usize,
    /// Squared distance of contacts from the mean place of those that share their actuator, over
    /// that of the best of 64 k-means++ runs: mean over frames. Both sides are k-means errors;
    /// where the display's actuator stands does not enter. None where no frame has more contacts than
    /// actuators.
    pub position_sse_ratio_mean: Option<f64>,
    /// ... 95 in 100 frames have no more.
    pub position_sse_ratio_p95: Option<f64>,
    /// ... the worst frame.
    pub position_sse_ratio_max: Option<f64>,
    /// Frames that the position ratio is over.
    pub position_frames: usize,
    /// Squared distance of contacts from the pixel on which their actuator stands, over the same
    /// reference: mean over frames.
    pub snapped_sse_ratio_mean: Option<f64>,
    /// ... 95 in 100 frames have no more.
    pub snapped_sse_ratio_p95: Option<f64>,
    /// Share of the actuators (same id in consecutive images that both have contacts) that move
    /// more than [`jump`](crate::Plane::jump).
    pub jump_fraction: f64,
    /// Mean distance that they move in the image, pixels.
    pub moved_px_mean: f64,
    /// Share of the taxels in contact in consecutive frames whose level changes.
    pub level_change_fraction: f64,
    /// Root of the sum of squared errors over the sum of squared forces, all contacts of all
    /// frames; forces are those of the levels. This and what follows is of forces: where the
    /// conditioning gives their squares, of the roots of these.
    pub force_nrmse: f64,
    /// Share of the contacts whose level is within one Weber step, 7 %, of their force.
    pub weber_share: f64,
    /// As `force_nrmse`, for the force with which the contact's actuator presses.
    pub displayed_nrmse: f64,
    /// As `weber_share`, for the force with which the contact's actuator presses.
    pub displayed_weber_share: f64,
    /// Difference of the sum of the forces with which the contacts' actuators press, contact by
    /// contact, from the sum of the measured forces, over that sum: mean over frames with contacts.
    pub displayed_total_error_mean: f64,
    /// Distance of the centre of pressure that actuators give from that of the contacts, per part
    /// of the hand: mean.
    pub cop_error_mean: f64,
    /// ... 95 in 100 are no farther.
    pub cop_error_p95: f64,
    /// Unit of the two: `mm` where the layout knows every taxel's place, else `px`.
    pub cop_unit: String,
    /// Share of the parts in contact without an actuator on them.
    pub cop_missed_fraction: f64,
    /// Information in the images at the frames' rate: per actuator its place and level, per level a
    /// 32-bit force.
    pub bits_per_s: f64,
    /// Bits per second of the daemon's IMAGE messages, which carry the 8-bit image too.
    pub wire_bits_per_s: f64,
}

/// Runs the frames through a method once and compares what comes out with the references.
///
/// # Errors
///
/// A profile that describes no display, or not for this hand.
pub fn judge(sequence: &Sequence, references: &References, method: &Method) -> Result<Errors, ProfileError> {
    let mut compressor = Compressor::new(method.profile.clone(), &sequence.layout)?;
    let mut image = compressor.new_image();
    let places = Places::new(&sequence.layout);
    let mut sums = Sums {
        felt: sequence.felt(),
        ..Sums::default()
    };
    for (frame, reference) in sequence.force.iter().zip(&references.frames) {
        compressor.compress(frame, &mut image);
        let stages = compressor.stages();
        let contacts = Contacts {
            reference,
            level: stages.level,
            actuator: stages.actuator,
            image: &image,
            plane: &references.plane,
        };
        sums.add(&contacts, &places);
    }
    Ok(sums.errors(sequence, method, places.in_mm))
}

/// A frame's contacts and what was made of them.
struct Contacts<'a> {
    reference: &'a Reference,
    level: &'a [u16],
    actuator: &'a [u16],
    image: &'a TactileImage,
    plane: &'a Plane,
}

impl Contacts<'_> {
    /// Measured force and force of the level.
    fn levels(&self) -> impl Iterator<Item = (f64, f64)> {
        let levels = &self.image.levels;
        (self.reference.force.iter().zip(self.level))
            .map(|(force, level)| (*force, levels[usize::from(*level)]))
    }

    /// Place of each contact and number of its actuator in the image's list; `None` where that
    /// actuator does not press.
    fn served(&self) -> impl Iterator<Item = ([f64; 2], Option<usize>)> {
        let at = |id: u16| self.image.actuators.binary_search_by_key(&id, |a| a.id).ok();
        (self.reference.place.iter().zip(self.actuator)).map(move |(place, id)| (*place, at(*id)))
    }

    fn level_error(&self) -> f64 {
        self.levels().map(|(force, shown)| (force - shown).powi(2)).sum()
    }

    /// From the means of those who share an actuator, and from the pixel of the actuator.
    fn place_errors(&self) -> [f64; 2] {
        let mut sums = vec![[0.0; 3]; self.image.actuators.len()];
        for (place, actuator) in self.served() {
            if let Some(n) = actuator {
                for (sum, value) in sums[n].iter_mut().zip([place[0], place[1], 1.0]) {
                    *sum += value;
                }
            }
        }
        let (mut from_mean, mut from_pixel) = (0.0, 0.0);
        for ([x, y], actuator) in self.served() {
            let Some(n) = actuator else { continue };
            let [sum_x, sum_y, count] = sums[n];
            let on = &self.image.actuators[n];
            from_mean += squared_distance([x, y], [sum_x / count, sum_y / count]);
            from_pixel += squared_distance([x, y], self.plane.at([on.x, on.y]));
        }
        [from_mean, from_pixel]
    }
}

/// What is collected over the frames.
#[derive(Debug, Default)]
struct Sums {
    felt: Felt,
    frames: usize,
    contact_frames: u64,
    optimal: u64,
    force_ratios: Vec<f64>,
    place_ratios: Vec<f64>,
    snapped_ratios: Vec<f64>,
    tally: Tally,
    contacts: u64,
    squares: f64,
    level_squares: f64,
    shown_squares: f64,
    level_near: u64,
    shown_near: u64,
    total_errors: f64,
    cop_errors: Vec<f64>,
    cop_missed: u64,
    actuators: u64,
    levels: u64,
    wire_bytes: u64,
}

impl Sums {
    fn add(&mut self, contacts: &Contacts<'_>, places: &Places) {
        let (reference, image) = (contacts.reference, contacts.image);
        self.frames += 1;
        self.actuators += image.actuators.len() as u64;
        // Levels that were spread over several of the display are told once.
        self.levels += image.levels.chunk_by(|a, b| a == b).count() as u64;
        let (levels, actuators) = (image.levels.len(), image.actuators.len());
        let payload = image_payload_len(image.width, image.height, levels, actuators, image.joints.len());
        self.wire_bytes += (HEADER_LEN + payload) as u64;
        self.tally
            .add(image, contacts.plane, &reference.pixel, contacts.level);
        if reference.force.is_empty() {
            return;
        }
        self.contact_frames += 1;
        let squares: f64 = reference.force.iter().map(|f| f * f).sum();
        let level_error = contacts.level_error();
        self.contacts += reference.force.len() as u64;
        let no_error = NO_ERROR * squares;
        self.optimal += u64::from(level_error <= reference.level_error * (1.0 + ROUNDING) + no_error);
        if reference.level_error > no_error {
            self.force_ratios.push(level_error / reference.level_error);
        }
        if reference.place_error > 0.0 {
            let [from_mean, from_pixel] = contacts.place_errors();
            self.place_ratios.push(from_mean / reference.place_error);
            self.snapped_ratios.push(from_pixel / reference.place_error);
        }
        let felt = |force: f64| self.felt.of(force);
        let (mut total, mut shown_total) = (0.0, 0.0);
        for ((force, level), (_, actuator)) in contacts.levels().zip(contacts.served()) {
            let (force, level) = (felt(force), felt(level));
            let shown = actuator.map_or(0.0, |n| felt(image.actuators[n].force));
            total += force;
            shown_total += shown;
            self.squares += force * force;
            self.level_squares += (force - level).powi(2);
            self.shown_squares += (force - shown).powi(2);
            self.level_near += u64::from((level - force).abs() <= WEBER * force);
            self.shown_near += u64::from((shown - force).abs() <= WEBER * force);
        }
        self.total_errors += (shown_total - total).abs() / total;
        self.cop_missed += places.compare(
            &reference.pixel,
            &reference.force,
            image,
            self.felt,
            &mut self.cop_errors,
        );
    }

    fn errors(mut self, sequence: &Sequence, method: &Method, in_mm: bool) -> Errors {
        let per_s = sequence.rate_hz() / self.frames.max(1) as f64;
        let bits = |values: u64| f64::from(values.max(1).next_power_of_two().trailing_zeros());
        let per_actuator = bits(sequence.layout.len() as u64) + bits(u64::from(method.profile.level_count()));
        let parts = self.cop_errors.len() as u64 + self.cop_missed;
        let [force_mean, force_p50, force_p95, force_max] =
            summary(&mut self.force_ratios).unwrap_or([1.0; 4]);
        let place = summary(&mut self.place_ratios);
        let snapped = summary(&mut self.snapped_ratios);
        let root = |error: f64| {
            if self.squares > 0.0 {
                (error / self.squares).sqrt()
            } else {
                0.0
            }
        };
        Errors {
            force_sse_ratio_mean: force_mean,
            force_sse_ratio_p50: force_p50,
            force_sse_ratio_p95: force_p95,
            force_sse_ratio_max: force_max,
            force_optimal_fraction: if self.contact_frames == 0 {
                1.0
            } else {
                share(self.optimal, self.contact_frames)
            },
            force_frames: self.force_ratios.len(),
            position_sse_ratio_mean: place.map(|[mean, ..]| mean),
            position_sse_ratio_p95: place.map(|[_, _, p95, _]| p95),
            position_sse_ratio_max: place.map(|[.., max]| max),
            position_frames: self.place_ratios.len(),
            snapped_sse_ratio_mean: snapped.map(|[mean, ..]| mean),
            snapped_sse_ratio_p95: snapped.map(|[_, _, p95, _]| p95),
            jump_fraction: share(self.tally.jumps, self.tally.kept),
            moved_px_mean: if self.tally.kept > 0 {
                self.tally.moved_px / self.tally.kept as f64
            } else {
                0.0
            },
            level_change_fraction: share(self.tally.level_changes, self.tally.touched),
            force_nrmse: root(self.level_squares),
            weber_share: share(self.level_near, self.contacts),
            displayed_nrmse: root(self.shown_squares),
            displayed_weber_share: share(self.shown_near, self.contacts),
            displayed_total_error_mean: self.total_errors / self.contact_frames.max(1) as f64,
            cop_error_mean: mean(&self.cop_errors),
            cop_error_p95: quantile(&mut self.cop_errors, 0.95),
            cop_unit: if in_mm { "mm" } else { "px" }.into(),
            cop_missed_fraction: share(self.cop_missed, parts),
            bits_per_s: per_s * (self.actuators as f64 * per_actuator + 32.0 * self.levels as f64),
            wire_bits_per_s: per_s * 8.0 * self.wire_bytes as f64,
        }
    }
}

/// Mean, median, 95th percentile and maximum of ratios; 1 of nothing.
fn summary(ratios: &mut [f64]) -> Option<[f64; 4]> {
    if ratios.is_empty() {
        return None;
    }
    let average = mean(ratios);
    Some([
        average,
        quantile(ratios, 0.5),
        quantile(ratios, 0.95),
        quantile(ratios, 1.0),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_hand::{Coordinates, ForceFrame, Profile};
    use taxel_skin::Layout;

    /// Frames of a row of taxels; force 0 is no contact.
    fn sequence(frames: &[&[f64]]) -> Sequence {
        let width = frames[0].len();
        let force = frames.iter().enumerate().map(|(n, forces)| ForceFrame {
            t_ns: n as u64 * 100_000_000,
            contact: forces.iter().map(|f| *f > 0.0).collect(),
            force: forces.to_vec(),
            ..ForceFrame::new(width)
        });
        Sequence {
            layout: Layout::grid(width as u16, 1).unwrap(),
            force: force.collect(),
            tactile: Vec::new(),
            conditioning: None,
        }
    }

    fn errors(frames: &[&[f64]], levels: u16, actuators: u16, method: &str) -> Errors {
        let sequence = sequence(frames);
        let base = Profile {
            levels,
            actuators,
            ..Profile::default()
        };
        let references =
            References::find(&sequence, levels, actuators, Coordinates::Pixels, 64, || ()).unwrap();
        judge(&sequence, &references, &Method::parse(method, &base).unwrap()).unwrap()
    }

    #[test]
    fn exact_levels_have_ratio_one_and_lloyd_stuck_in_a_corner_does_not() {
        // Lloyd starts from three equal bins, of which the middle one stays empty: {1, 2, 3} share one level.
        let frames: &[&[f64]] = &[&[1.0, 2.0, 3.0, 100.0], &[0.0; 4], &[5.0, 0.0, 0.0, 5.0]];
        let optimal = errors(frames, 3, 4, "optimal");
        assert_eq!(
            (optimal.force_sse_ratio_mean, optimal.force_optimal_fraction),
            (1.0, 1.0)
        );
        let paper = errors(frames, 3, 4, "paper");
        // Squared errors 2 and 0.5; the frame of equal forces is optimal whatever is done.
        assert_eq!((paper.force_sse_ratio_mean, paper.force_frames), (4.0, 1));
        assert_eq!(paper.force_optimal_fraction, 0.5);
        // Two of these differ by rounding alone, and so do three levels from four forces.
        let rounded = errors(&[&[0.1 + 0.2, 0.3, 1.0, 5.0]], 3, 4, "paper");
        assert_eq!((rounded.force_sse_ratio_mean, rounded.force_frames), (1.0, 0));
    }

    #[test]
    fn position_is_judged_by_cluster_means_and_by_pixels() {
        // Two groups of three: squared error 2 each from the middle, which is a pixel.
        let odd = errors(&[&[1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0]], 2, 2, "optimal");
        assert_eq!(
            (odd.position_sse_ratio_mean, odd.snapped_sse_ratio_mean),
            (Some(1.0), Some(1.0))
        );
        // Two pairs: 0.5 each from the middle, 1 from a member.
        let even = errors(&[&[1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0]], 2, 2, "optimal");
        assert_eq!(
            (even.position_sse_ratio_mean, even.snapped_sse_ratio_mean),
            (Some(1.0), Some(2.0))
        );
        assert_eq!((even.position_frames, even.jump_fraction), (1, 0.0));
        // An actuator for every contact: nothing is judged.
        let each = errors(&[&[1.0, 1.0]], 2, 2, "optimal");
        assert_eq!((each.position_frames, each.position_sse_ratio_p95), (0, None));
        assert_eq!(each.snapped_sse_ratio_mean, None);
    }

    #[test]
    fn places_on_the_hand_are_judged_in_millimetres() {
        let mut sequence = sequence(&[&[1.0; 4]]);
        for (taxel, x) in sequence
            .layout
            .geometry
            .taxels
            .iter_mut()
            .zip([0.0, 10.0, 11.0, 21.0])
        {
            taxel.position_mm = Some([x, 0.0, 0.0]);
        }
        let method = Method::parse("optimal actuators=2 coordinates=hand", &Profile::default()).unwrap();
        let ratio = |coordinates| {
            let references = References::find(&sequence, 8, 2, coordinates, 64, || ()).unwrap();
            let errors = judge(&sequence, &references, &method).unwrap();
            errors.position_sse_ratio_mean.unwrap()
        };
        // One alone and three, 74 square millimetres; two pairs, which are best in pixels, have 100.
        assert_eq!([Coordinates::Hand, Coordinates::Pixels].map(ratio), [1.0, 2.0]);
    }

    #[test]
    fn force_errors_are_of_the_level_and_of_the_actuator() {
        // One actuator, two levels: every contact is displayed with the higher.
        let got = errors(&[&[10.0, 20.0]], 2, 1, "paper");
        assert_eq!((got.force_nrmse, got.weber_share), (0.0, 1.0));
        assert_eq!(
            (got.displayed_nrmse, got.displayed_weber_share),
            ((100.0f64 / 500.0).sqrt(), 0.5)
        );
        // One level of 15 for both.
        let got = errors(&[&[10.0, 20.0]], 1, 2, "paper");
        assert_eq!(
            (got.force_nrmse, got.weber_share),
            ((50.0f64 / 500.0).sqrt(), 0.0)
        );
    }

    #[test]
    fn the_total_force_is_that_of_all_contacts_as_displayed() {
        // Both are displayed with 20: 40 for 30. Then alone: as it is.
        let got = errors(&[&[10.0, 20.0], &[5.0, 0.0]], 2, 1, "paper");
        assert_eq!(got.displayed_total_error_mean, (10.0 / 30.0) / 2.0);
        // With one level, 15 for both, and nothing is missing in all.
        assert_eq!(
            errors(&[&[10.0, 20.0]], 1, 2, "optimal").displayed_total_error_mean,
            0.0
        );
    }

    #[test]
    fn forces_that_are_squares_are_judged_by_their_roots() {
        // 13 % from 100 to 113 is 6 % of the force.
        let mut squared = sequence(&[&[100.0, 113.0]]);
        squared.conditioning = Some(taxel_skin::ConditionConfig::paper());
        let base = Profile {
            levels: 2,
            actuators: 1,
            ..Profile::default()
        };
        let references = References::find(&squared, 2, 1, Coordinates::Pixels, 4, || ()).unwrap();
        let method = Method::parse("paper", &base).unwrap();
        let got = judge(&squared, &references, &method).unwrap();
        assert_eq!(got.displayed_weber_share, 1.0);
        assert_eq!(
            got.displayed_nrmse,
            ((113.0f64.sqrt() - 10.0).powi(2) / (100.0 + 113.0f64.sqrt().powi(2))).sqrt()
        );
        squared.conditioning = None;
        let got = judge(&squared, &references, &method).unwrap();
        assert_eq!(got.displayed_weber_share, 0.5);
    }

    #[test]
    fn bits_are_counted_at_the_rate_of_the_frames() {
        // 10 frames/s; 8 taxels and 4 levels: 3 + 2 bits per actuator, 32 per level; two actuators
        // and two levels a frame, which are spread over four.
        let frame: &[f64] = &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0];
        let got = errors(&[frame, frame, frame], 4, 16, "optimal");
        assert_eq!(got.bits_per_s, 10.0 * (2.0 * 5.0 + 2.0 * 32.0));
        let message = HEADER_LEN + image_payload_len(8, 1, 4, 2, 0);
        assert_eq!(got.wire_bits_per_s, 10.0 * 8.0 * message as f64);
    }

    #[test]
    fn without_contacts_nothing_is_said_against_a_method() {
        let got = errors(&[&[0.0; 4], &[0.0; 4]], 2, 2, "paper");
        assert_eq!((got.force_sse_ratio_mean, got.force_optimal_fraction), (1.0, 1.0));
        assert_eq!((got.position_sse_ratio_p95, got.force_nrmse), (None, 0.0));
    }
}
