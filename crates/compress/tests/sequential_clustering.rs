//! The compressor's promises, on frames of every kind.

use proptest::prelude::*;
use taxel_compress::Compressor;
use taxel_hand::{
    Actuator, ActuatorForce, Fault, ForceFit, ForceFrame, Geometry, Grey, Method, Placement, Profile,
    ProfileError, TactileImage,
};

fn grid(width: u16, height: u16) -> Geometry {
    Geometry::grid(width, height).expect("a grid that fits")
}

/// A grid with its taxels moved to other pixels.
fn layout(width: u16, height: u16, pixels: &[(u16, u16)]) -> Geometry {
    let mut layout = grid(width, height);
    layout.taxels.truncate(pixels.len());
    for (taxel, (x, y)) in layout.taxels.iter_mut().zip(pixels) {
        (taxel.x, taxel.y) = (*x, *y);
    }
    layout
}

/// Every taxel with a force above zero is in contact.
fn pressed(forces: &[f64]) -> ForceFrame {
    let mut frame = ForceFrame::new(forces.len());
    frame.force.copy_from_slice(forces);
    for (contact, force) in frame.contact.iter_mut().zip(forces) {
        *contact = *force > 0.0;
    }
    frame
}

fn profile(levels: u16, actuators: u16) -> Profile {
    Profile {
        method: Method::Paper,
        levels,
        actuators,
        ..Profile::default()
    }
}

fn compress(profile: Profile, layout: &Geometry, frame: &ForceFrame) -> TactileImage {
    let mut compressor = Compressor::new(profile, layout).expect("a valid profile");
    let mut image = compressor.new_image();
    compressor.compress(frame, &mut image);
    image
}

fn actuator(id: u16, x: u16, y: u16, level: u16, force: f64) -> Actuator {
    Actuator {
        id,
        x,
        y,
        level,
        force,
    }
}

#[test]
fn few_contacts_pass_through() {
    let image = compress(
        profile(2, 4),
        &grid(3, 2),
        &pressed(&[0.0, 10.0, 0.0, 12.0, 0.0, 50.0]),
    );
    assert_eq!(image.pixels, [0, 128, 0, 128, 0, 255]);
    assert_eq!(image.levels, [11.0, 50.0]);
    assert_eq!(
        image.actuators,
        [
            actuator(0, 1, 0, 1, 11.0),
            actuator(1, 0, 1, 1, 11.0),
            actuator(2, 2, 1, 2, 50.0)
        ]
    );
    assert_eq!((image.contacts, image.faulty, image.missing), (3, 0, 0));
}

#[test]
fn as_many_contacts_as_actuators_pass_through() {
    let image = compress(profile(3, 3), &grid(3, 1), &pressed(&[3.0, 1.0, 2.0]));
    assert_eq!(image.pixels, [255, 85, 170]);
    assert_eq!(image.actuators.len(), 3);
}

#[test]
fn many_contacts_are_gathered_at_members_with_the_strongest_level() {
    let forces = [10.0, 10.0, 50.0, 0.0, 0.0, 0.0, 10.0, 10.0, 10.0];
    let image = compress(profile(2, 2), &grid(9, 1), &pressed(&forces));
    assert_eq!(image.pixels, [0, 255, 0, 0, 0, 0, 0, 128, 0]);
    assert_eq!(
        image.actuators,
        [actuator(0, 1, 0, 2, 50.0), actuator(1, 7, 0, 1, 10.0)]
    );
    assert_eq!(image.contacts, 6);
}

#[test]
fn a_cluster_presses_with_the_level_nearest_its_mean_when_asked() {
    let forces = [10.0, 10.0, 50.0, 0.0, 0.0, 0.0, 10.0, 10.0, 10.0];
    let mean = Profile {
        actuator_force: Some(ActuatorForce::Mean),
        ..profile(2, 2)
    };
    let image = compress(mean, &grid(9, 1), &pressed(&forces));
    assert_eq!(image.actuators[0], actuator(0, 1, 0, 1, 10.0));
}

#[test]
fn forces_pull_the_actuator_to_the_centre_of_pressure_when_asked() {
    let forces = [1.0, 1.0, 1.0, 1.0, 100.0];
    let weighted = Profile {
        force_weighted: true,
        ..profile(2, 1)
    };
    assert_eq!(
        compress(profile(2, 1), &grid(5, 1), &pressed(&forces)).actuators[0].x,
        2
    );
    assert_eq!(
        compress(weighted, &grid(5, 1), &pressed(&forces)).actuators[0].x,
        4
    );
}

#[test]
fn edges_are_defined() {
    let constant = Profile {
        codebook: vec![10.0, 20.0],
        ..profile(4, 4)
    };
    let saturated = 3.0 * 65535.0 * 65535.0;
    for (name, profile, forces, pixels, levels) in [
        ("no contact", profile(4, 4), [0.0; 4], [0; 4], vec![]),
        (
            "no contact, constant codebook",
            constant.clone(),
            [0.0; 4],
            [0; 4],
            vec![10.0, 20.0],
        ),
        (
            "constant codebook",
            constant,
            [1.0, 15.0, 16.0, 99.0],
            [64, 64, 128, 128],
            vec![10.0, 20.0],
        ),
        (
            "one contact",
            profile(4, 4),
            [0.0, 9.0, 0.0, 0.0],
            [0, 255, 0, 0],
            vec![9.0; 4],
        ),
        (
            "one contact, one level",
            profile(1, 1),
            [0.0, 9.0, 0.0, 0.0],
            [0, 255, 0, 0],
            vec![9.0],
        ),
        (
            "fewer contacts than K_D",
            profile(4, 4),
            [0.0, 9.0, 0.0, 3.0],
            [0, 255, 0, 64],
            vec![3.0, 5.25, 6.75, 9.0],
        ),
        (
            "fewer contacts than K_D, optimal",
            Profile {
                method: Method::Optimal,
                ..profile(4, 4)
            },
            [0.0, 9.0, 0.0, 3.0],
            [0, 255, 0, 128],
            vec![3.0, 3.0, 9.0, 9.0],
        ),
        ("all equal", profile(4, 4), [5.0; 4], [255; 4], vec![5.0; 4]),
        (
            "saturated",
            profile(4, 4),
            [saturated; 4],
            [255; 4],
            vec![saturated; 4],
        ),
    ] {
        let image = compress(profile, &grid(4, 1), &pressed(&forces));
        assert_eq!(image.pixels, pixels, "{name}");
        assert_eq!(image.levels, levels, "{name}");
    }
}

#[test]
fn every_taxel_faulty_gives_an_empty_image_and_the_counts() {
    let mut frame = pressed(&[5.0; 4]);
    for (faults, fault) in
        frame
            .faults
            .iter_mut()
            .zip([Fault::Dead, Fault::Missing, Fault::Noisy, Fault::Masked])
    {
        faults.insert(fault);
    }
    let image = compress(profile(4, 4), &grid(4, 1), &frame);
    assert_eq!(image.pixels, [0; 4]);
    assert_eq!((image.contacts, image.faulty, image.missing), (0, 3, 1));
    assert!(image.actuators.is_empty() && image.levels.is_empty());
}

#[test]
fn forces_that_are_no_forces_are_refused_and_counted() {
    let layout = grid(9, 1);
    let mut frame = pressed(&[
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        -1.0,
        0.0,
        1e39,
        7.0,
        f64::NAN,
        1e-39,
    ]);
    frame.contact.fill(true);
    frame.contact[7] = false;
    let mut compressor = Compressor::new(profile(4, 4), &layout).expect("a valid profile");
    let mut image = compressor.new_image();
    for round in 1..=2 {
        compressor.compress(&frame, &mut image);
        assert_eq!(image.pixels, [0, 0, 0, 0, 0, 0, 255, 0, 0]);
        assert_eq!((image.contacts, image.faulty), (1, 8));
        assert_eq!(compressor.refused(), 8 * round);
    }
}

#[test]
fn a_calibrating_frame_gives_an_empty_image() {
    let mut frame = pressed(&[5.0; 4]);
    frame.calibrating = true;
    let image = compress(profile(4, 4), &grid(4, 1), &frame);
    assert!(image.calibrating);
    assert_eq!((image.pixels, image.contacts), (vec![0; 4], 0));
}

#[test]
fn a_frame_of_another_size_is_survived() {
    let layout = grid(4, 1);
    let short = compress(profile(4, 4), &layout, &pressed(&[1.0, 2.0]));
    assert_eq!((short.contacts, short.missing), (2, 2));
    let long = compress(profile(4, 4), &layout, &pressed(&[1.0; 9]));
    assert_eq!((long.contacts, long.missing), (4, 0));
}

#[test]
fn grey_by_centroid_keeps_the_ratio_of_forces() {
    let grey = Profile {
        grey: Grey::Centroid,
        codebook: vec![0.001, 25.0, 50.0, 100.0],
        ..profile(4, 4)
    };
    let image = compress(grey, &grid(4, 1), &pressed(&[100.0, 50.0, 25.0, 0.001]));
    assert_eq!(image.pixels, [255, 128, 64, 1]);
}

#[test]
fn layouts_without_a_pixel_for_each_taxel_are_refused() {
    for (pixels, want) in [
        (
            vec![(0, 0), (2, 1)],
            ProfileError::TaxelOutsideImage {
                taxel: 1,
                x: 2,
                y: 1,
                width: 2,
                height: 2,
            },
        ),
        (
            vec![(1, 1), (0, 0), (1, 1)],
            ProfileError::PixelShared {
                first: 0,
                second: 2,
                x: 1,
                y: 1,
            },
        ),
    ] {
        let refused = Compressor::new(Profile::default(), &layout(2, 2, &pixels));
        assert_eq!(refused.map(|_| ()).unwrap_err(), want);
    }
}

#[test]
fn profiles_survive_a_round_trip_and_refuse_unknown_keys() {
    let profile = Profile {
        codebook: vec![1.0, 2.0],
        ..profile(4, 4)
    };
    let text = serde_json::to_string(&profile).expect("serialises");
    assert_eq!(serde_json::from_str::<Profile>(&text).expect("parses"), profile);
    assert!(serde_json::from_str::<Profile>(r#"{"level": 4}"#).is_err());
}

/// Forces on an 8x8 grid: some untouched, some equal, heavy-tailed.
fn forces() -> impl Strategy<Value = Vec<f64>> {
    let force = prop_oneof![
        2 => Just(0.0),
        2 => (1u32..20).prop_map(f64::from),
        2 => 0.5..100.0f64,
        1 => 100.0..65535.0f64,
    ];
    prop::collection::vec(force, 64)
}

fn any_profile() -> impl Strategy<Value = Profile> {
    let force = prop_oneof![
        Just(ActuatorForce::Max),
        Just(ActuatorForce::Mean),
        Just(ActuatorForce::Closest)
    ];
    (1u16..12, 1u16..20, 1u16..12, force, any::<[bool; 5]>()).prop_map(
        |(levels, actuators, iterations, force, [grey, weighted, exact, follow, drag])| Profile {
            force_iterations: iterations,
            actuator_iterations: iterations,
            grey: if grey { Grey::Level } else { Grey::Centroid },
            actuator_force: Some(force),
            force_weighted: weighted,
            force_fit: Some(if exact { ForceFit::Exact } else { ForceFit::Lloyd }),
            placement: Some(if follow {
                Placement::Follow
            } else {
                Placement::Lloyd
            }),
            history: if drag { 0.5 } else { 0.0 },
            ..profile(levels, actuators)
        },
    )
}

proptest! {
    #[test]
    fn an_image_keeps_to_what_the_display_can_do(profile in any_profile(), forces in forces()) {
        let frame = pressed(&forces);
        let image = compress(profile.clone(), &grid(8, 8), &frame);
        prop_assert!(image.actuators.len() <= usize::from(profile.actuators));
        prop_assert!(image.levels.len() <= usize::from(profile.levels));
        prop_assert!(image.levels.is_sorted());
        prop_assert!(image.actuators.is_sorted_by(|a, b| a.id < b.id));
        prop_assert_eq!(usize::from(image.contacts), frame.contacts());
        prop_assert_eq!(image.actuators.is_empty(), frame.contacts() == 0);
        for a in &image.actuators {
            let place = usize::from(a.y) * 8 + usize::from(a.x);
            prop_assert!(a.id < profile.actuators);
            prop_assert!(frame.contact[place], "an actuator stands on a contact");
            prop_assert_eq!(a.force, image.levels[usize::from(a.level) - 1]);
            let (level, levels) = (f64::from(a.level), f64::from(profile.levels));
            let greatest = image.levels[image.levels.len() - 1];
            let grey = match profile.grey {
                Grey::Level => (255.0 * level / levels).round(),
                Grey::Centroid => (255.0 * a.force / greatest).round().max(1.0),
            };
            prop_assert_eq!(f64::from(image.pixels[place]), grey);
        }
        prop_assert_eq!(image.pixels.iter().filter(|p| **p > 0).count(), image.actuators.len());
    }

    #[test]
    fn a_stronger_force_never_gets_a_lower_level(exact in any::<bool>(), levels in 1u16..12, iterations in 1u16..12, forces in forces()) {
        let fit = if exact { ForceFit::Exact } else { ForceFit::Lloyd };
        let every = Profile { force_iterations: iterations, force_fit: Some(fit), ..profile(levels, 64) };
        let image = compress(every, &grid(8, 8), &pressed(&forces));
        let mut pairs: Vec<(f64, u8)> = forces.iter().copied().zip(image.pixels).collect();
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        for pair in pairs.windows(2) {
            prop_assert!(pair[0].1 <= pair[1].1, "{pair:?}");
            prop_assert!(pair[0].0 < pair[1].0 || pair[0].1 == pair[1].1, "equal forces, equal levels: {pair:?}");
        }
    }

    #[test]
    fn an_image_does_not_depend_on_the_numbering_of_taxels(
        profile in any_profile(),
        forces in forces(),
        order in Just((0..64).collect::<Vec<usize>>()).prop_shuffle(),
    ) {
        let straight = grid(8, 8);
        let pixels: Vec<_> = order.iter().map(|i| (straight.taxels[*i].x, straight.taxels[*i].y)).collect();
        let shuffled = layout(8, 8, &pixels);
        let moved: Vec<f64> = order.iter().map(|i| forces[*i]).collect();
        prop_assert_eq!(
            compress(profile.clone(), &straight, &pressed(&forces)),
            compress(profile, &shuffled, &pressed(&moved))
        );
    }

    #[test]
    fn the_paper_s_method_remembers_nothing(exact in any::<bool>(), profile in any_profile(), first in forces(), second in forces()) {
        let layout = grid(8, 8);
        let fit = if exact { ForceFit::Exact } else { ForceFit::Lloyd };
        let profile = Profile { placement: None, force_fit: Some(fit), ..profile };
        let mut compressor = Compressor::new(profile.clone(), &layout).expect("a valid profile");
        let mut image = compressor.new_image();
        compressor.compress(&pressed(&first), &mut image);
        compressor.compress(&pressed(&second), &mut image);
        prop_assert_eq!(image, compress(profile, &layout, &pressed(&second)));
    }

    #[test]
    fn compressing_the_recovered_forces_again_changes_nothing(levels in 1u16..12, forces in forces()) {
        let whole = Profile { force_iterations: 1000, ..profile(levels, 64) };
        let first = compress(whole.clone(), &grid(8, 8), &pressed(&forces));
        let mut recovered = vec![0.0; 64];
        for a in &first.actuators {
            recovered[usize::from(a.y) * 8 + usize::from(a.x)] = a.force;
        }
        let constant = Profile { codebook: first.levels.clone(), ..whole };
        prop_assert_eq!(compress(constant, &grid(8, 8), &pressed(&recovered)), first);
    }
}
