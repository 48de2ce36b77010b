//! What the method `optimal` promises: the least force error there is, and actuators that hold still.

use proptest::prelude::*;
use taxel_compress::Compressor;
use taxel_hand::{
    Actuator, ActuatorForce, ForceFit, ForceFrame, Method, Placement, Profile, ProfileError, TactileImage,
};
use taxel_skin::Layout;

fn grid(width: u16, height: u16) -> Layout {
    Layout::grid(width, height).expect("a grid that fits")
}

fn pressed(forces: &[f64]) -> ForceFrame {
    let mut frame = ForceFrame::new(forces.len());
    frame.force.copy_from_slice(forces);
    for (contact, force) in frame.contact.iter_mut().zip(forces) {
        *contact = *force > 0.0;
    }
    frame
}

fn optimal(levels: u16, actuators: u16) -> Profile {
    Profile {
        method: Method::Optimal,
        levels,
        actuators,
        ..Profile::default()
    }
}

/// The images of a sequence of frames.
fn images(profile: &Profile, layout: &Layout, frames: &[Vec<f64>]) -> Vec<TactileImage> {
    let mut compressor = Compressor::new(profile.clone(), layout).expect("a valid profile");
    let mut image = compressor.new_image();
    frames
        .iter()
        .map(|forces| {
            compressor.compress(&pressed(forces), &mut image);
            image.clone()
        })
        .collect()
}

/// Forces of round contacts on a grid 16 wide: centre, radius.
fn touches(height: u16, centres: &[(f64, f64, f64)]) -> Vec<f64> {
    (0..16 * height)
        .map(|i| {
            let (x, y) = (f64::from(i % 16), f64::from(i / 16));
            let force = |(cx, cy, r): &(f64, f64, f64)| {
                let d = ((x - cx).powi(2) + (y - cy).powi(2)) / (r * r);
                if d < 1.0 { 1000.0 * (1.0 - d) + 1.0 } else { 0.0 }
            };
            centres.iter().map(force).fold(0.0, f64::max)
        })
        .collect()
}

fn by_id(image: &TactileImage, id: u16) -> Option<&Actuator> {
    image.actuators.iter().find(|a| a.id == id)
}

/// Actuators that are in both images more than 2 pixels apart.
fn jumps(before: &TactileImage, after: &TactileImage) -> usize {
    let far = |a: &&Actuator| {
        by_id(after, a.id).is_some_and(|b| {
            let (dx, dy) = (f64::from(a.x) - f64::from(b.x), f64::from(a.y) - f64::from(b.y));
            dx.hypot(dy) > 2.0
        })
    };
    before.actuators.iter().filter(far).count()
}

#[test]
fn levels_reach_the_optimum_where_lloyd_s_iterations_do_not() {
    let forces = [10.0, 12.0, 20.0, 22.0, 98.0, 100.0];
    let image = &images(&optimal(3, 8), &grid(6, 1), &[forces.to_vec()])[0];
    assert_eq!(image.levels, [11.0, 21.0, 99.0]);
    assert_eq!(image.pixels, [85, 85, 170, 170, 255, 255]);
    let paper = Profile {
        method: Method::Paper,
        ..optimal(3, 8)
    };
    assert_ne!(
        images(&paper, &grid(6, 1), &[forces.to_vec()])[0].levels,
        image.levels
    );
}

#[test]
fn actuators_of_a_resting_contact_come_to_rest() {
    let frame = touches(16, &[(5.0, 5.0, 4.5), (11.0, 10.0, 3.5)]);
    let images = images(&optimal(8, 8), &grid(16, 16), &vec![frame; 400]);
    assert!(images[0].contacts > 60);
    let moved: usize = images.windows(2).map(|pair| jumps(&pair[0], &pair[1])).sum();
    assert!(moved <= 4, "{moved} jumps");
    for image in &images[300..] {
        assert_eq!(image.actuators, images[300].actuators);
    }
}

#[test]
fn actuators_go_along_with_a_sliding_contact() {
    let frames: Vec<_> = (0..60)
        .map(|t| touches(16, &[(4.0 + 0.1 * f64::from(t), 7.0, 4.0)]))
        .collect();
    let images = images(&optimal(8, 6), &grid(16, 16), &frames);
    let moved: usize = images.windows(2).map(|pair| jumps(&pair[0], &pair[1])).sum();
    assert!(moved <= 3, "{moved} jumps in {} frames", frames.len());
    let mean = |image: &TactileImage| image.actuators.iter().map(|a| f64::from(a.x)).sum::<f64>() / 6.0;
    assert!((mean(&images[59]) - mean(&images[0]) - 5.9).abs() < 1.0);
}

#[test]
fn few_contacts_keep_their_actuators_when_others_come_and_go() {
    let mut frames = vec![vec![0.0; 40]; 4];
    for (frame, touched) in frames
        .iter_mut()
        .zip([&[5, 20, 35][..], &[5, 35], &[0, 5, 35], &[0, 5, 20, 36]])
    {
        touched.iter().for_each(|n| frame[*n] = 9.0);
    }
    let images = images(&optimal(4, 8), &grid(40, 1), &frames);
    let ids = |image: &TactileImage| {
        image
            .actuators
            .iter()
            .map(|a| (a.x, a.id))
            .collect::<std::collections::BTreeMap<_, _>>()
    };
    let first = ids(&images[0]);
    for image in &images[1..] {
        assert_eq!(ids(image)[&5], first[&5]);
    }
    assert_eq!(ids(&images[2])[&35], first[&35]);
    assert_eq!(
        ids(&images[3])[&36],
        first[&35],
        "a contact one pixel further is the same contact"
    );
    assert_ne!(ids(&images[2])[&0], first[&35]);
}

#[test]
fn a_new_contact_far_away_gets_an_actuator_at_once() {
    let one = touches(16, &[(4.0, 4.0, 4.0)]);
    let two = touches(16, &[(4.0, 4.0, 4.0), (13.0, 13.0, 1.5)]);
    let images = images(&optimal(8, 4), &grid(16, 16), &[one.clone(), one, two]);
    assert!(
        images[2].actuators.iter().any(|a| a.x >= 12 && a.y >= 12),
        "{:?}",
        images[2].actuators
    );
}

#[test]
fn parts_of_the_hand_share_no_actuator_when_kept_apart() {
    let layout = Layout::builtin("allegro-uskin-15").expect("built in");
    let mut frame = ForceFrame::new(layout.taxels.len());
    for (n, taxel) in layout.taxels.iter().enumerate() {
        // Two fingers touch along the border between their columns.
        frame.contact[n] = taxel.x == 3 || taxel.x == 4;
        frame.force[n] = 10.0;
    }
    let part = |n: usize| layout.modules[usize::from(layout.taxels[n].module)].part.as_str();
    for (apart, shared) in [(false, true), (true, false)] {
        let profile = Profile {
            parts_apart: apart,
            ..optimal(4, 4)
        };
        let mut compressor = Compressor::new(profile, &layout).expect("a valid profile");
        let mut image = compressor.new_image();
        compressor.compress(&frame, &mut image);
        let stages = compressor.stages();
        let touches = |id: u16, wanted: &str| {
            stages.pixel.iter().zip(stages.actuator).any(|([x, y], a)| {
                let taxel = layout
                    .taxels
                    .iter()
                    .position(|t| (t.x, t.y) == (*x, *y))
                    .expect("a taxel");
                *a == id && part(taxel) == wanted
            })
        };
        let parts: Vec<&str> = (0..layout.taxels.len())
            .filter(|n| frame.contact[*n])
            .map(part)
            .collect();
        let (a, b) = (
            parts[0],
            *parts.iter().find(|p| **p != parts[0]).expect("two parts"),
        );
        let both = image
            .actuators
            .iter()
            .any(|actuator| touches(actuator.id, a) && touches(actuator.id, b));
        assert_eq!(both, shared, "apart: {apart}");
    }
}

#[test]
fn an_actuator_of_several_contacts_is_as_near_to_their_forces_as_a_level_can_be() {
    // One actuator; two levels, 2.5 and 20; the mean of the forces is 6.9.
    let (layout, forces) = (grid(4, 1), [2.0, 3.0, 2.5, 20.0]);
    let pressed = |actuator_force| {
        let profile = Profile {
            actuator_force,
            ..optimal(2, 1)
        };
        images(&profile, &layout, &[forces.to_vec()])[0].actuators[0].force
    };
    assert_eq!(pressed(None), 2.5);
    assert_eq!(pressed(Some(ActuatorForce::Max)), 20.0);
}

#[test]
fn contacts_of_like_force_share_an_actuator() {
    for forces in [[10.0, 11.0, 900.0], [900.0, 11.0, 10.0]] {
        let image = &images(&optimal(8, 2), &grid(3, 1), &[forces.to_vec()])[0];
        let alone = image.actuators.iter().find(|a| a.force == 900.0);
        let strongest = forces.iter().position(|f| *f == 900.0);
        assert_eq!(
            alone.map(|a| usize::from(a.x)),
            strongest,
            "{forces:?}: {image:?}"
        );
        assert!(image.actuators.iter().all(|a| a.force != 11.0), "{image:?}");
    }
}

#[test]
fn what_shares_an_actuator_depends_on_how_forces_differ_and_not_on_their_size() {
    let frames = [touches(4, &[(3.0, 2.0, 2.5), (11.0, 1.0, 3.0)])];
    let whole: Vec<f64> = frames[0].iter().map(|f| f.round()).collect();
    let larger = whole
        .iter()
        .map(|f| if *f > 0.0 { 4.0 * f + 1024.0 } else { 0.0 });
    let [of_whole, of_larger] = [whole.clone(), larger.collect()].map(|forces| {
        let mut compressor = Compressor::new(optimal(8, 12), &grid(16, 4)).unwrap();
        let mut image = compressor.new_image();
        compressor.compress(&pressed(&forces), &mut image);
        compressor.stages().actuator.to_vec()
    });
    assert!(of_whole.len() > 24, "{}", of_whole.len());
    assert_eq!(of_whole, of_larger);
}

#[test]
fn with_more_than_five_contacts_for_each_actuator_forces_move_none_of_them() {
    let frames = [touches(4, &[(3.0, 2.0, 2.5), (11.0, 1.0, 3.0)])];
    let contacts = frames[0].iter().filter(|f| **f > 0.0).count() as u16;
    let differ = |actuators, of: fn(&Actuator) -> Actuator| {
        let by_place = Profile {
            force_distance: 0.0,
            ..optimal(8, actuators)
        };
        let [a, b] = [&optimal(8, actuators), &by_place].map(|p| {
            let images = images(p, &grid(16, 4), &frames);
            images[0].actuators.iter().map(of).collect::<Vec<_>>()
        });
        a != b
    };
    let place = |a: &Actuator| Actuator {
        level: 0,
        force: 0.0,
        ..*a
    };
    let few = (contacts - 1) / 5;
    assert!(!differ(few, place), "they stand where places alone say");
    assert!(
        differ(few, |a| *a),
        "and press with what contacts like each other press with"
    );
    assert!(differ(contacts / 2, place), "with fewer contacts they do not");
}

#[test]
fn hysteresis_holds_the_level_of_an_actuator_of_several_contacts() {
    let layout = grid(2, 1);
    let frames = [[14.0, 14.5], [15.5, 15.6], [17.5, 17.6], [14.8, 14.9]].map(Vec::from);
    let forces = |level_hysteresis| {
        let profile = Profile {
            codebook: vec![10.0, 20.0],
            level_hysteresis,
            ..optimal(2, 1)
        };
        let images = images(&profile, &layout, &frames);
        images
            .iter()
            .map(|image| image.actuators[0].force)
            .collect::<Vec<_>>()
    };
    assert_eq!(forces(0.0), [10.0, 20.0, 20.0, 10.0]);
    assert_eq!(forces(0.2), [10.0, 10.0, 20.0, 20.0]);
}

#[test]
fn hysteresis_holds_the_level_of_an_actuator_that_stood_for_one_contact_before() {
    let layout = grid(2, 1);
    let frames = [[14.0, 0.0], [15.5, 15.6], [0.0, 0.0], [15.5, 15.6]].map(Vec::from);
    for method in [Method::Paper, Method::Optimal] {
        let profile = Profile {
            method,
            codebook: vec![10.0, 20.0],
            level_hysteresis: 0.2,
            actuator_force: Some(ActuatorForce::Closest),
            ..optimal(2, 1)
        };
        let images = images(&profile, &layout, &frames);
        let force = |image: &TactileImage| image.actuators.first().map(|a| a.force);
        let forces: Vec<_> = images.iter().map(force).collect();
        assert_eq!(forces, [Some(10.0), Some(10.0), None, Some(20.0)], "{method:?}");
    }
}

#[test]
fn each_difference_from_the_paper_can_be_switched_alone() {
    let layout = grid(16, 16);
    let frames: Vec<_> = (0..10)
        .map(|t| touches(16, &[(4.0 + f64::from(t) * 0.3, 6.0, 4.0), (12.0, 9.0, 3.0)]))
        .collect();
    let paper = Profile {
        method: Method::Paper,
        ..optimal(5, 6)
    };
    let with = |force_fit, placement| {
        images(
            &Profile {
                force_fit,
                placement,
                actuator_force: Some(ActuatorForce::Closest),
                ..paper.clone()
            },
            &layout,
            &frames,
        )
    };
    let whole = images(&optimal(5, 6), &layout, &frames);
    let base = with(None, None);
    assert_eq!(with(Some(ForceFit::Lloyd), Some(Placement::Lloyd)), base);
    assert_eq!(with(Some(ForceFit::Exact), Some(Placement::Follow)), whole);
    let levels = |images: &[TactileImage]| images.iter().map(|i| i.levels.clone()).collect::<Vec<_>>();
    let places = |images: &[TactileImage]| {
        images
            .iter()
            .flat_map(|i| &i.actuators)
            .map(|a| (a.id, a.x, a.y))
            .collect::<Vec<_>>()
    };
    let exact = with(Some(ForceFit::Exact), None);
    assert_eq!((levels(&exact), places(&exact)), (levels(&whole), places(&base)));
    let follow = with(None, Some(Placement::Follow));
    assert_eq!(
        (levels(&follow), places(&follow)),
        (levels(&base), places(&whole))
    );
}

#[test]
fn a_force_on_a_border_keeps_its_level_with_hysteresis() {
    let frames = |forces: &[f64]| forces.iter().map(|f| vec![*f]).collect::<Vec<_>>();
    let swinging = [14.0, 15.5, 14.8, 15.9, 16.2, 15.2, 14.2, 13.9];
    for (share, want) in [(0.0, [1, 2, 1, 2, 2, 2, 1, 1]), (0.1, [1, 1, 1, 1, 2, 2, 2, 1])] {
        let profile = Profile {
            codebook: vec![10.0, 20.0],
            level_hysteresis: share,
            ..optimal(2, 1)
        };
        let levels: Vec<u16> = images(&profile, &grid(1, 1), &frames(&swinging))
            .iter()
            .map(|i| i.actuators[0].level)
            .collect();
        assert_eq!(levels, want, "share {share}");
    }
}

#[test]
fn a_released_taxel_forgets_its_level() {
    let profile = Profile {
        codebook: vec![10.0, 20.0],
        level_hysteresis: 0.5,
        ..optimal(2, 1)
    };
    let frames = [vec![19.0], vec![0.0], vec![14.0]];
    assert_eq!(images(&profile, &grid(1, 1), &frames)[2].actuators[0].level, 1);
}

#[test]
fn shares_outside_their_range_are_refused() {
    for (profile, field) in [
        (
            Profile {
                level_hysteresis: 0.6,
                ..optimal(4, 4)
            },
            "level_hysteresis",
        ),
        (
            Profile {
                history: f64::NAN,
                ..optimal(4, 4)
            },
            "history",
        ),
        (
            Profile {
                jump_gain: -0.1,
                ..optimal(4, 4)
            },
            "jump_gain",
        ),
        (
            Profile {
                force_distance: 2.1,
                ..optimal(4, 4)
            },
            "force_distance",
        ),
    ] {
        let refused = profile.check().unwrap_err();
        assert!(
            matches!(&refused, ProfileError::Range(range) if range.key == field),
            "{refused}"
        );
    }
}

/// The least squared error of `levels` levels, by the plain quadratic recurrence.
fn least_error(forces: &[f64], levels: usize) -> f64 {
    let mut sorted: Vec<f64> = forces.iter().copied().filter(|f| *f > 0.0).collect();
    sorted.sort_by(f64::total_cmp);
    let mut least = vec![f64::INFINITY; sorted.len() + 1];
    least[0] = 0.0;
    for _ in 0..levels {
        let mut next = least.clone();
        for (i, next) in next.iter_mut().enumerate().skip(1) {
            let (mut mean, mut error) = (0.0, 0.0);
            for j in (0..i).rev() {
                let from_mean = sorted[j] - mean;
                mean += from_mean / (i - j) as f64;
                error += from_mean * (sorted[j] - mean);
                *next = next.min(least[j] + error);
            }
        }
        least = next;
    }
    least[sorted.len()]
}

proptest! {
    #[test]
    fn the_force_error_is_the_least_there_is_in_every_frame(
        frames in prop::collection::vec(prop::collection::vec(prop_oneof![Just(0.0), 0.5..100.0f64, 1.0..65_535.0f64], 64), 1..5),
        levels in 1u16..12,
    ) {
        let mut compressor = Compressor::new(optimal(levels, 8), &grid(8, 8)).expect("a valid profile");
        let mut image = compressor.new_image();
        for forces in &frames {
            compressor.compress(&pressed(forces), &mut image);
            let stages = compressor.stages();
            let error: f64 = stages.force.iter().zip(stages.level).map(|(f, l)| (f - image.levels[usize::from(*l)]).powi(2)).sum();
            let least = least_error(forces, levels.into());
            prop_assert!(error <= least * (1.0 + 1e-9) + 1e-9, "{error} over {least}");
        }
    }

    #[test]
    fn the_same_frames_give_the_same_images(
        frames in prop::collection::vec(prop::collection::vec(prop_oneof![Just(0.0), 0.5..1000.0f64], 64), 2..8),
        actuators in 1u16..20,
    ) {
        let profile = optimal(6, actuators);
        prop_assert_eq!(images(&profile, &grid(8, 8), &frames), images(&profile, &grid(8, 8), &frames));
    }
}
