//! What a profile can say of a display: where its actuators are, how many a finger has, which
//! forces it can tell apart.

mod settings;

use proptest::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use taxel_compress::Compressor;
use taxel_hand::{
    CodebookLearning, Coordinates, ForceFrame, LevelSteps, Method, Profile, ProfileError, TactileImage,
};
use taxel_skin::Layout;

fn hand() -> Layout {
    Layout::builtin("allegro-uskin-15").expect("built in")
}

fn grid(width: u16, height: u16) -> Layout {
    Layout::grid(width, height).expect("a grid that fits")
}

fn optimal() -> Profile {
    Profile {
        method: Method::Optimal,
        ..Profile::default()
    }
}

/// A frame in which these pixels are touched, with these forces.
fn touched(layout: &Layout, touches: impl IntoIterator<Item = (u16, u16, f64)>) -> ForceFrame {
    let mut frame = ForceFrame::new(layout.len());
    for (x, y, force) in touches {
        let taxel = layout.taxel_at(x, y).expect("a taxel");
        (frame.contact[taxel], frame.force[taxel]) = (true, force);
    }
    frame
}

fn compressed(profile: &Profile, layout: &Layout, frame: &ForceFrame) -> (Compressor, TactileImage) {
    let mut compressor = Compressor::new(profile.clone(), layout).expect("a valid profile");
    let mut image = compressor.new_image();
    compressor.compress(frame, &mut image);
    (compressor, image)
}

fn refused(profile: Profile, layout: &Layout) -> ProfileError {
    Compressor::new(profile, layout).expect_err("refused")
}

fn block(x: u16, y: u16, size: u16) -> impl Iterator<Item = (u16, u16, f64)> {
    (0..size * size).map(move |n| (x + n % size, y + n / size, 10.0))
}

fn fixed(places: &[[f64; 2]]) -> Profile {
    Profile {
        actuators: places.len() as u16,
        fixed: places.to_vec(),
        ..optimal()
    }
}

fn ids(image: &TactileImage) -> Vec<u16> {
    image.actuators.iter().map(|a| a.id).collect()
}

#[test]
fn a_contact_is_felt_at_the_nearest_of_fixed_actuators() {
    let layout = grid(16, 16);
    let profile = fixed(&[[1.0, 1.0], [14.0, 1.0], [1.0, 14.0], [14.0, 14.0]]);
    for (x, y, want) in [(0, 0, 0), (12, 3, 1), (2, 9, 2), (15, 15, 3)] {
        let (_, image) = compressed(&profile, &layout, &touched(&layout, [(x, y, 5.0)]));
        assert_eq!(ids(&image), [want], "({x}, {y})");
    }
}

#[test]
fn a_large_contact_is_felt_at_every_fixed_actuator_it_covers_and_at_no_other() {
    let layout = grid(16, 16);
    let profile = fixed(&[[2.0, 2.0], [6.0, 2.0], [10.0, 2.0], [14.0, 2.0]]);
    let (_, image) = compressed(&profile, &layout, &touched(&layout, block(2, 0, 6)));
    assert_eq!(ids(&image), [0, 1]);
}

#[test]
fn two_regions_are_not_felt_as_one_while_an_actuator_nearby_is_free() {
    let layout = grid(16, 16);
    // Both regions are nearest to actuator 1; actuator 0 is free and near, actuator 2 is free and far.
    let profile = fixed(&[[2.0, 8.0], [7.0, 8.0], [15.0, 15.0]]);
    let frame = touched(&layout, block(5, 4, 2).chain(block(7, 8, 3)));
    let (compressor, image) = compressed(&profile, &layout, &frame);
    assert_eq!(ids(&image), [0, 1]);
    let stages = compressor.stages();
    for (pixel, actuator) in stages.pixel.iter().zip(stages.actuator) {
        assert_eq!(*actuator, u16::from(pixel[1] >= 8), "{pixel:?}");
    }
    // Alone, each is felt at its nearest.
    let (_, alone) = compressed(&profile, &layout, &touched(&layout, block(5, 4, 2)));
    assert_eq!(ids(&alone), [1]);
}

#[test]
fn regions_that_find_no_actuator_nearby_share_one() {
    let layout = grid(16, 16);
    let profile = fixed(&[[2.0, 2.0], [15.0, 15.0]]);
    let frame = touched(&layout, block(0, 0, 1).chain(block(3, 3, 2)));
    assert_eq!(ids(&compressed(&profile, &layout, &frame).1), [0]);
    let many = touched(&layout, (0..6).map(|n| (2 * (n % 3), 2 * (n / 3), 1.0)));
    assert_eq!(ids(&compressed(&profile, &layout, &many).1), [0]);
}

#[test]
fn a_contact_half_way_between_fixed_actuators_stays_where_it_is_felt() {
    let layout = Layout::grid(16, 16).expect("a grid that fits");
    let profile = fixed(&[[2.0, 2.0], [12.0, 2.0]]);
    let mut compressor = Compressor::new(profile, &layout).expect("a valid profile");
    let mut image = compressor.new_image();
    let mut felt_at = |contacts: &[[usize; 2]]| {
        let mut frame = ForceFrame::new(256);
        for [x, y] in contacts {
            (frame.contact[y * 16 + x], frame.force[y * 16 + x]) = (true, 10.0);
        }
        compressor.compress(&frame, &mut image);
        compressor.stages().actuator.to_vec()
    };
    let (half_way, at_first) = ([7, 2], [2, 2]);
    assert_eq!(felt_at(&[half_way]), [0], "ties go to the first");
    assert_eq!(felt_at(&[at_first, half_way]), [0, 1]);
    assert_eq!(felt_at(&[half_way]), [1], "and stay where they are felt");
    assert_eq!(felt_at(&[]), [] as [u16; 0]);
    assert_eq!(felt_at(&[half_way]), [0], "unless let go");
}

#[test]
fn fixed_actuators_are_painted_where_they_are() {
    let layout = grid(8, 8);
    let profile = fixed(&[[1.2, 0.9], [6.0, 6.0]]);
    let (_, image) = compressed(&profile, &layout, &touched(&layout, [(3, 3, 5.0), (7, 7, 5.0)]));
    let places: Vec<_> = image.actuators.iter().map(|a| (a.x, a.y)).collect();
    assert_eq!(places, [(1, 1), (6, 6)]);
    let lit = image
        .pixels
        .iter()
        .enumerate()
        .filter(|(_, g)| **g > 0)
        .map(|(n, _)| n);
    assert_eq!(lit.collect::<Vec<_>>(), [9, 54]);
}

#[test]
fn places_in_millimetres_are_the_layout_s() {
    let layout = hand();
    let at = |taxel: usize| {
        let [x, y, _] = layout.taxels[taxel]
            .position_mm
            .expect("the built-in hand has places");
        [f64::from(x), f64::from(y)]
    };
    let profile = Profile {
        coordinates: Coordinates::Hand,
        ..fixed(&[at(0), at(100), at(239)])
    };
    let mut frame = ForceFrame::new(layout.len());
    (frame.contact[100], frame.force[100]) = (true, 3.0);
    assert_eq!(ids(&compressed(&profile, &layout, &frame).1), [1]);
    // At the edge, between the fingers and where the thumb has no module, as in pixels.
    let reached = fixed(&[[-9.0, 0.0], [25.0, 10.0], [137.0, 110.0]]);
    let hand_coordinates = |profile| Profile {
        coordinates: Coordinates::Hand,
        ..profile
    };
    compressed(&hand_coordinates(reached), &layout, &frame);
    let off = hand_coordinates(fixed(&[at(0), [-400.0, 3.0]]));
    let message = refused(off, &layout).to_string();
    assert!(
        message.contains("place 1 of fixed, [-400, 3], is 400 mm from the nearest taxel"),
        "{message}"
    );
    let without = grid(4, 4);
    assert_eq!(
        refused(
            Profile {
                coordinates: Coordinates::Hand,
                ..optimal()
            },
            &without
        ),
        ProfileError::NoPosition { taxel: 0 }
    );
}

#[test]
fn in_millimetres_actuators_gather_what_is_near_on_the_hand() {
    let layout = hand();
    // Columns 3 and 4 are neighbours in the image, and on different fingers.
    let frame = touched(&layout, (0..16).flat_map(|y| [(3, y, 5.0), (4, y, 5.0)]));
    let profile = Profile {
        coordinates: Coordinates::Hand,
        actuators: 8,
        ..optimal()
    };
    let (compressor, _) = compressed(&profile, &layout, &frame);
    let stages = compressor.stages();
    let mut columns: BTreeMap<u16, BTreeSet<u16>> = BTreeMap::new();
    for (pixel, actuator) in stages.pixel.iter().zip(stages.actuator) {
        columns.entry(*actuator).or_default().insert(pixel[0]);
    }
    assert_eq!(columns.len(), 8);
    assert!(columns.values().all(|c| c.len() == 1), "{columns:?}");
}

#[test]
fn in_millimetres_a_skin_is_compressed_alike_however_its_image_is_drawn() {
    // 14 x 14 taxels, 5 mm apart, in each pixel or in every second one; a bump goes round.
    let skin = |apart: u16| {
        let grid = taxel_hand::Geometry::grid(14, 14).expect("a grid that fits");
        let mut taxels = grid.taxels.clone();
        for taxel in &mut taxels {
            taxel.position_mm = Some([5.0 * f32::from(taxel.x), 5.0 * f32::from(taxel.y), 0.0]);
            (taxel.x, taxel.y) = (apart * taxel.x, apart * taxel.y);
        }
        taxel_hand::Geometry::new("sole", [14 * apart; 2], grid.modules, taxels).expect("a skin")
    };
    let profile = Profile {
        coordinates: Coordinates::Hand,
        ..optimal()
    };
    let skins = [1, 2].map(skin);
    let mut compressors =
        (skins.each_ref()).map(|skin| Compressor::new(profile.clone(), skin).expect("a valid profile"));
    for t in 0..60 {
        let at = [0.1, 0.075].map(|turn| 6.5 + 4.0 * (turn * f64::from(t)).sin());
        let mut frame = ForceFrame::new(196);
        for n in 0..196 {
            let away = [n % 14, n / 14].map(|n| n as f64);
            let force = 500.0 / (1.0 + (away[0] - at[0]).powi(2) + (away[1] - at[1]).powi(2));
            (frame.contact[n], frame.force[n]) = (force > 40.0, force);
        }
        let [near, spread] = compressors.each_mut().map(|compressor| {
            let mut image = compressor.new_image();
            compressor.compress(&frame, &mut image);
            image.actuators
        });
        let near: Vec<_> = near.iter().map(|a| (a.id, 2 * a.x, 2 * a.y, a.level)).collect();
        let spread: Vec<_> = spread.iter().map(|a| (a.id, a.x, a.y, a.level)).collect();
        assert_eq!(near, spread, "frame {t}");
    }
}

#[test]
fn no_part_has_more_actuators_than_its_budget_and_its_ids_stay_its_own() {
    let layout = hand();
    let mut frame = ForceFrame::new(layout.len());
    frame.contact.fill(true);
    frame
        .force
        .iter_mut()
        .enumerate()
        .for_each(|(n, f)| *f = 1.0 + n as f64);
    let budgets: BTreeMap<String, u16> = [("index".into(), 4), ("thumb".into(), 6)].into();
    let profile = Profile {
        budgets: budgets.clone(),
        ..optimal()
    };
    let (compressor, image) = compressed(&profile, &layout, &frame);
    let mut of_part: BTreeMap<&str, BTreeSet<u16>> = BTreeMap::new();
    let stages = compressor.stages();
    for ([x, y], actuator) in stages.pixel.iter().zip(stages.actuator) {
        let taxel = layout.taxel_at(*x, *y).expect("a taxel");
        let part = layout.module_of(taxel).part.as_str();
        let part = if budgets.contains_key(part) {
            part
        } else {
            "others"
        };
        of_part.entry(part).or_default().insert(*actuator);
    }
    let want: BTreeMap<&str, BTreeSet<u16>> = [
        ("index", (0..4).collect()),
        ("thumb", (4..10).collect()),
        ("others", (10..16).collect()),
    ]
    .into();
    assert_eq!(of_part, want);
    assert_eq!(image.actuators.len(), 16);
    // Few contacts on a part pass through on their own, whatever happens elsewhere.
    let few = touched(
        &layout,
        (0..16).map(|y| (0, y, 5.0)).chain([(12, 0, 5.0), (14, 5, 5.0)]),
    );
    let (compressor, image) = compressed(&profile, &layout, &few);
    assert_eq!(image.actuators.iter().filter(|a| a.id < 4).count(), 4);
    assert_eq!(
        image.actuators.iter().filter(|a| (4..10).contains(&a.id)).count(),
        2
    );
    assert!(compressor.stages().actuator.iter().all(|a| *a < 10));
}

#[test]
fn the_number_of_levels_follows_from_the_jnd() {
    for (jnd, least, greatest, want) in [
        (0.07, 1.0, 50.0, 58),
        (0.10, 1.0, 50.0, 42),
        (0.20, 1.0, 50.0, 22),
        (0.07, 10.0, 10.1, 1),
        (0.001, 1.0, 1e9, 255),
        (1.0, 3.0, 24.0, 3),
    ] {
        let profile = Profile {
            jnd: Some(jnd),
            force_min: Some(least),
            force_max: Some(greatest),
            ..optimal()
        };
        assert_eq!(profile.level_count(), want, "{jnd} {least} {greatest}");
        let compressor = Compressor::new(profile, &grid(4, 4)).expect("a valid profile");
        assert_eq!(compressor.profile().levels, want);
    }
    assert_eq!(optimal().level_count(), 8);
}

#[test]
fn steps_over_a_given_range_are_constant_and_over_a_frame_s_own_follow_it() {
    let layout = grid(4, 1);
    let frame = touched(&layout, [(0, 0, 1.0), (1, 0, 15.0), (2, 0, 17.0), (3, 0, 256.0)]);
    let with = |level_steps, range: Option<(f64, f64)>, levels| Profile {
        level_steps,
        force_min: range.map(|r| r.0),
        force_max: range.map(|r| r.1),
        levels,
        ..optimal()
    };
    let close = |a: &[f64], b: &[f64]| {
        assert!(
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a / b - 1.0).abs() < 1e-12),
            "{a:?} {b:?}"
        );
    };
    for (profile, levels, level) in [
        (
            with(LevelSteps::Weber, Some((1.0, 256.0)), 2),
            vec![4.0, 64.0],
            [1, 1, 2, 2],
        ),
        (
            with(LevelSteps::Weber, None, 4),
            vec![2.0, 8.0, 32.0, 128.0],
            [1, 2, 3, 4],
        ),
        (
            with(LevelSteps::Equal, Some((0.5, 40.5)), 4),
            vec![5.5, 15.5, 25.5, 35.5],
            [1, 2, 2, 4],
        ),
    ] {
        let (compressor, image) = compressed(&profile, &layout, &frame);
        close(&image.levels, &levels);
        let got: Vec<u16> = compressor.stages().level.iter().map(|l| l + 1).collect();
        assert_eq!(got, level, "{:?}", profile.level_steps);
    }
}

#[test]
fn a_learned_codebook_changes_less_and_less_and_forgets() {
    let layout = grid(4, 1);
    let profile = Profile {
        levels: 2,
        codebook_learning: Some(CodebookLearning { forgetting: 0.05 }),
        ..optimal()
    };
    let mut compressor = Compressor::new(profile, &layout).expect("a valid profile");
    let mut image = compressor.new_image();
    let mut levels = |forces: [f64; 4]| {
        let frame = touched(&layout, (0..4).zip(forces).map(|(x, f)| (x, 0, f)));
        compressor.compress(&frame, &mut image);
        image.levels.clone()
    };
    for _ in 0..100 {
        levels([10.0, 11.0, 100.0, 101.0]);
    }
    let before = levels([10.0, 11.0, 100.0, 101.0]);
    let after = levels([10.0, 11.0, 100.0, 120.0]);
    assert!((after[1] / before[1] - 1.0).abs() < 0.01, "{before:?} {after:?}");
    for _ in 0..300 {
        levels([10.0, 11.0, 500.0, 500.0]);
    }
    assert!((levels([10.0, 11.0, 500.0, 500.0])[1] / 500.0 - 1.0).abs() < 0.01);
}

#[test]
fn levels_are_learned_of_forces_of_every_size_that_is_accepted() {
    let layout = grid(8, 4);
    let profile = Profile {
        levels: 8,
        codebook_learning: Some(CodebookLearning { forgetting: 0.01 }),
        ..optimal()
    };
    // Six octaves from 1, so that times a power of two they are from 1e-38 to 1e38.
    let learned = |scale: f64| {
        let mut compressor = Compressor::new(profile.clone(), &layout).expect("a valid profile");
        let mut image = compressor.new_image();
        for step in 0..20 {
            let force = |n: u16| scale * 1.14f64.powi(i32::from((n * 7 + step * 3) % 32));
            let touches = (0..32).map(|n| (n % 8, n / 8, force(n)));
            compressor.compress(&touched(&layout, touches), &mut image);
        }
        image.levels
    };
    let want = learned(1.0);
    assert_eq!(want.len(), 8);
    for octave in [-126, -120, -100, -40, -20, -10, 10, 30, 45, 50, 66, 100, 120] {
        let scale = 2f64.powi(octave);
        let scaled: Vec<f64> = want.iter().map(|level| level * scale).collect();
        assert_eq!(learned(scale), scaled, "2^{octave}");
    }
}

proptest! {
    #[test]
    fn fixed_actuators_stand_for_every_contact_and_only_near_ones_alone(
        cells in prop::collection::btree_set((0u16..12, 0u16..12), 0..100),
        places in prop::collection::btree_set((0u8..12, 0u8..12), 1..12),
    ) {
        let layout = grid(12, 12);
        let places: Vec<[f64; 2]> = places.iter().map(|(x, y)| [f64::from(*x), f64::from(*y)]).collect();
        let frame = touched(&layout, cells.iter().map(|(x, y)| (*x, *y, 1.0)));
        let (compressor, image) = compressed(&fixed(&places), &layout, &frame);
        let used: BTreeSet<u16> = compressor.stages().actuator.iter().copied().collect();
        prop_assert_eq!(ids(&image), used.into_iter().collect::<Vec<_>>());
        prop_assert_eq!(compressor.stages().actuator.len(), cells.len());
        if cells.len() == 1 {
            let (x, y) = cells.iter().next().expect("one");
            let d = |p: &[f64; 2]| (p[0] - f64::from(*x)).powi(2) + (p[1] - f64::from(*y)).powi(2);
            let nearest = places.iter().map(d).fold(f64::INFINITY, f64::min);
            prop_assert_eq!(d(&places[usize::from(image.actuators[0].id)]), nearest);
        }
    }
}
