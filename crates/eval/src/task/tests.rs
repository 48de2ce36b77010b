//! Tasks, small enough to know the answer.

use super::picture::grid_shape;
use super::*;
use crate::method::Method;
use taxel_hand::Geometry;
use taxel_hand::Profile;

/// Presses of two kinds on an 8 x 8 skin, with noise everywhere: an upright bar and a flat one.
fn bars(threshold: f64) -> Task {
    let mut random = Random::new(1);
    let frame = |label: usize, random: &mut Random| -> Vec<f64> {
        let on = |x: usize, y: usize| [x, y][label] == 3 && (1..7).contains(&[y, x][label]);
        let noise = |random: &mut Random| 1.0 + random.unit();
        let force =
            |n: usize, random: &mut Random| f64::from(u8::from(on(n % 8, n / 8))) * 90.0 + noise(random);
        (0..64).map(|n| force(n, random)).collect()
    };
    let labels: Vec<usize> = (0..40).map(|n| 5 + n % 2).collect();
    let frames: Vec<Vec<f64>> = labels.iter().map(|label| frame(label - 5, &mut random)).collect();
    Task::new(Layout::grid(8, 8).unwrap(), &frames, &labels, threshold).unwrap()
}

fn method(text: &str, actuators: u16) -> Shown {
    let base = Profile {
        actuators,
        ..Profile::default()
    };
    Shown::Method(Box::new(Method::parse(text, &base).unwrap()))
}

#[test]
fn what_differs_is_told_apart_raw_and_compressed_and_moved() {
    let task = bars(10.0);
    for shown in [Shown::Raw, Shown::Contacts, method("optimal", 4)] {
        let row = task.judge("it", &shown).unwrap();
        assert_eq!((row.nearest, row.logistic), (1.0, 1.0), "{shown:?}");
        assert!(row.moved_nearest > 0.7, "{shown:?}: {row:?}");
    }
}

#[test]
fn what_remembers_is_judged_while_it_runs_too() {
    let task = bars(10.0);
    for (shown, remembers) in [
        (Shown::Raw, false),
        (Shown::Blocks { levels: 8, cells: 4 }, false),
        (method("paper", 4), false),
        // The hand lets go between any two frames, and fixed places forget then.
        (method("optimal fixed=[[1,1],[5,1],[1,5],[5,5]]", 4), false),
        (method("optimal", 4), true),
        (method("paper codebook_learning={forgetting=0.001}", 4), true),
    ] {
        let running = || task.judge_running("it, running", &shown).unwrap();
        assert_eq!(running().is_some(), remembers, "{shown:?}");
        let untimed = |row: TaskRow| TaskRow {
            compress_us_p50: None,
            ..row
        };
        assert_eq!(
            running().map(untimed),
            running().map(untimed),
            "another order: {shown:?}"
        );
    }
}

#[test]
fn a_compressor_that_runs_on_has_seen_the_frames_before() {
    // Presses of 10 and of 1000 at the same taxel, one force a frame: a fresh codebook is that force alone, one that is
    // learned holds both, so that the weaker press has the lower of two levels.
    let forces = |n: usize| vec![if n.is_multiple_of(2) { 10.0 } else { 1000.0 }, 0.0];
    let frames: Vec<Vec<f64>> = (0..40).map(forces).collect();
    let labels: Vec<usize> = (0..40).map(|n| n % 2).collect();
    let task = Task::new(Layout::grid(2, 1).unwrap(), &frames, &labels, 0.0).unwrap();
    let shown = method("optimal codebook_learning={forgetting=0.001}", 1);
    let order: Vec<usize> = (0..40).rev().collect();
    let bits = |order| task.pictures(&shown, None, order).unwrap().bits;
    let level_bits = 1.0 + 3.0;
    assert_eq!(bits(None), level_bits + 32.0);
    // All but the first know both forces.
    assert_eq!(
        bits(Some(&order[..])),
        level_bits + 32.0 * (1.0 + 39.0 * 2.0) / 40.0
    );
}

#[test]
fn one_actuator_that_is_always_in_the_middle_tells_nothing() {
    let row = task_of_noise().judge("it", &method("optimal", 1)).unwrap();
    assert!((0.2..0.8).contains(&row.nearest), "{row:?}");
}

/// Two classes that do not differ.
fn task_of_noise() -> Task {
    let mut random = Random::new(3);
    let frames: Vec<Vec<f64>> = (0..40)
        .map(|_| (0..16).map(|_| random.unit()).collect())
        .collect();
    let labels: Vec<usize> = (0..40).map(|n| n % 2).collect();
    Task::new(Layout::grid(4, 4).unwrap(), &frames, &labels, 0.0).unwrap()
}

#[test]
fn bits_are_counted_by_what_is_sent() {
    let task = bars(10.0);
    let bits = |shown: &Shown| {
        let point = task.point("it", shown, 8, 4).unwrap();
        point.bits
    };
    assert_eq!(bits(&Shown::Raw), 64.0 * 16.0);
    assert_eq!(bits(&Shown::Contacts), 6.0 * (6.0 + 16.0));
    assert_eq!(bits(&Shown::Blocks { levels: 8, cells: 4 }), 4.0 * 4.0 + 32.0);
    // Six contacts of six forces: six levels. Four actuators of 64 places and eight levels.
    let row = task.judge("it", &method("optimal", 4)).unwrap();
    assert_eq!(
        (row.level_bits, row.bits),
        (Some(4.0 * 9.0), 4.0 * 9.0 + 6.0 * 32.0)
    );
    let fixed = method("optimal fixed=[[1.5,1.5],[5.5,1.5],[1.5,5.5],[5.5,5.5]]", 4);
    assert_eq!(bits(&fixed), 4.0 * 4.0 + 6.0 * 32.0);
}

#[test]
fn a_grid_has_cells_as_square_as_they_can_be() {
    for (size, cells, want) in [
        ([16, 16], 8, [4, 2]),
        ([16, 16], 16, [4, 4]),
        ([32, 8], 4, [4, 1]),
        ([8, 32], 7, [1, 7]),
    ] {
        let geometry = Geometry::grid(size[0], size[1]).unwrap();
        let got = grid_shape(&geometry, cells);
        assert_eq!((got[0] * got[1], got), (cells, want), "{size:?} {cells}");
    }
}

#[test]
fn frames_that_are_no_task_are_refused() {
    let layout = || Layout::grid(2, 1).unwrap();
    let frames = vec![vec![1.0, 2.0]; 8];
    for (labels, wanted) in [
        (vec![1; 8], "1 classes"),
        (vec![1, 2], "2 labels"),
        (vec![1, 1, 1, 1, 1, 2, 2, 2], "class 2 has 3 frames"),
    ] {
        let message = Task::new(layout(), &frames, &labels, 0.0)
            .unwrap_err()
            .to_string();
        assert!(message.contains(wanted), "{message}");
    }
}
