//! A codebook for a whole session, learned from recordings: mark (*) of Table I.

use taxel_cluster::Kmeans1d;
use taxel_hand::ForceFrame;

use crate::contacts::is_force;

/// Learns at most `levels` force levels from the contacts of recorded frames, to be kept constant as
/// [`Profile::codebook`](taxel_hand::Profile::codebook).
///
/// They are the levels with the least squared error over all contacts of all frames at once. There
/// are fewer where there are fewer different forces, and none without contact. Ascending, in the
/// unit of [`ForceFrame::force`].
pub fn learn_codebook<'a>(frames: impl IntoIterator<Item = &'a ForceFrame>, levels: u16) -> Vec<f64> {
    let mut forces = Vec::new();
    for frame in frames.into_iter().filter(|frame| !frame.calibrating) {
        let taxels = frame.force.iter().zip(&frame.contact).zip(&frame.faults);
        forces.extend(
            taxels
                .filter(|((force, contact), faults)| {
                    **contact && faults.is_empty() && is_force(**force, true)
                })
                .map(|((force, _), _)| *force),
        );
    }
    forces.sort_unstable_by(f64::total_cmp);
    let (mut values, mut weights) = (Vec::new(), Vec::new());
    for equal in forces.chunk_by(|a, b| a == b) {
        values.push(equal[0]);
        weights.push(equal.len() as u32);
    }
    let levels = usize::from(levels.max(1));
    match Kmeans1d::new(values.len(), levels).solve_weighted(&values, &weights, levels) {
        Ok(found) => {
            let mut codebook = found.centroids.to_vec();
            codebook.dedup();
            codebook
        }
        Err(error) => unreachable!("contacts have finite forces, sorted here: {error}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_hand::Profile;

    fn frame(forces: &[f64]) -> ForceFrame {
        let mut frame = ForceFrame::new(forces.len());
        frame.force.copy_from_slice(forces);
        frame.contact.fill(true);
        frame
    }

    #[test]
    fn a_codebook_holds_the_levels_of_all_frames_together() {
        let frames = [frame(&[10.0, 20.0]), frame(&[12.0, 100.0]), frame(&[98.0, 22.0])];
        assert_eq!(learn_codebook(&frames, 3), [11.0, 21.0, 99.0]);
    }

    #[test]
    fn taxels_without_contact_or_with_a_bad_value_teach_nothing() {
        let mut released = frame(&[500.0, 10.0]);
        released.contact[0] = false;
        let mut broken = frame(&[700.0, 10.0]);
        broken.faults[0].insert(taxel_hand::Fault::Noisy);
        let mut calibrating = frame(&[900.0]);
        calibrating.calibrating = true;
        let frames = [
            released,
            broken,
            calibrating,
            frame(&[f64::NAN, f64::INFINITY, -3.0, 1e200]),
        ];
        assert_eq!(learn_codebook(&frames, 4), [10.0]);
    }

    #[test]
    fn no_contact_gives_no_codebook() {
        assert_eq!(learn_codebook(&[ForceFrame::new(5)], 4), [] as [f64; 0]);
    }

    #[test]
    fn a_learned_codebook_is_accepted_by_a_profile() {
        let frames = [frame(&[1.0, 2.0, 1000.0, 1001.0]), frame(&[3.0; 10])];
        let codebook = learn_codebook(&frames, 8);
        let profile = Profile {
            levels: 8,
            codebook,
            ..Profile::default()
        };
        assert_eq!(profile.check(), Ok(()));
    }
}
