//! The real recordings, where they are: in `$TAXEL_DATA` or beside the repository.

use std::path::Path;
use taxel_record::{Columns, ReadOptions, Recording};
use taxel_recordings::find;

fn open(path: &Path, array: &str, columns: Option<Columns>) -> Recording {
    let options = ReadOptions {
        array: Some(array.into()),
        columns,
        ..Default::default()
    };
    Recording::open(path, &options).unwrap()
}

#[test]
fn the_dead_taxel_of_log4_reads_65535_on_every_axis() {
    let Some(path) = find("uskin_waseda.npz") else {
        return;
    };
    let log4 = open(&path, "LOG4", Some(Columns::XyzInterleaved));
    assert_eq!((log4.len(), log4.taxels()), (11, 16));
    let dead = |taxel: usize| (0..log4.len()).all(|t| log4.counts(t).unwrap()[taxel] == Some([65535; 3]));
    assert_eq!((0..16).filter(|k| dead(*k)).count(), 1);
}

#[test]
fn idle_levels_of_log7_are_those_of_the_data_sheet() {
    let Some(path) = find("uskin_waseda.npz") else {
        return;
    };
    let log7 = open(&path, "LOG7", Some(Columns::XyzInterleaved));
    // docs/protocols.md, "uSkin values": idle x 32700..32875, y 32577..32859, z 12300..13400, as means over
    // 100 frames.
    for taxel in 0..16 {
        let mean = |axis: usize| {
            let sum: f64 = (0..log7.len())
                .map(|t| f64::from(log7.counts(t).unwrap()[taxel].unwrap()[axis]))
                .sum();
            sum / log7.len() as f64
        };
        for (axis, range) in [
            (0, 32690.0..32885.0),
            (1, 32567.0..32869.0),
            (2, 12200.0..13500.0),
        ] {
            assert!(
                range.contains(&mean(axis)),
                "taxel {taxel}, axis {axis}: {}",
                mean(axis)
            );
        }
    }
}

#[test]
fn the_pick_and_move_trials_have_blocks_of_axes() {
    let Some(path) = find("uskin_pick_and_move.npz") else {
        return;
    };
    // In blocks, neighbouring taxels of one axis idle near each other; read interleaved, the axes mix.
    let spread = |columns| {
        let trial = open(&path, "trial00", Some(columns));
        assert_eq!(trial.taxels(), 16);
        let x: Vec<f64> = trial
            .counts(0)
            .unwrap()
            .iter()
            .flatten()
            .map(|c| f64::from(c[0]))
            .collect();
        x.iter().copied().fold(f64::MIN, f64::max) - x.iter().copied().fold(f64::MAX, f64::min)
    };
    assert!(spread(Columns::XyzBlocks) < spread(Columns::XyzInterleaved));
}

#[test]
fn the_grasps_of_the_schunk_hand_are_magnitudes() {
    let Some(path) = find("schunk_sdh_grasps.npz") else {
        return;
    };
    let message = Recording::open(&path, &ReadOptions::default())
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("--array") && message.contains("WOOD_1300211441"),
        "{message}"
    );
    let grasp = open(&path, "WOOD_1300211441", None);
    assert_eq!((grasp.taxels(), grasp.has_counts()), (486, false));
}
