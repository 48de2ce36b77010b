//! What `taxel forearm` says of a session before it makes anything of it.

use crate::{fails, succeeds};
use std::fs;
use std::path::Path;
use taxel_forearm::{Session, Trial};
use tempfile::TempDir;

/// Simulated squeezes at 13 places, two at each.
fn simulated(dir: &TempDir) -> Session {
    succeeds(
        dir,
        &["forearm", "simulate", "--out", "all.npz", "--repetitions", "2"],
    );
    let mut session = Session::open(&dir.path().join("all.npz")).unwrap();
    session
        .trials
        .iter_mut()
        .for_each(|trial| trial.squeeze.tactile = None);
    session
}

/// Writes squeezes as a folder of the publication's files.
fn write(folder: &Path, trials: &[Trial]) {
    for trial in trials {
        let place = (trial.location_percent * 0.12).round() as usize;
        let of_place = folder.join(place.to_string());
        fs::create_dir_all(&of_place).unwrap();
        let name = format!("distance{place}_{}.mat", trial.number());
        fs::write(of_place.join(name), trial.squeeze.to_mat()).unwrap();
    }
}

#[test]
fn a_backup_in_the_folder_is_told_and_not_trained_on_and_two_arms_are_no_session() {
    let dir = TempDir::new().unwrap();
    let session = simulated(&dir);
    write(&dir.path().join("arm"), &session.trials);
    write(&dir.path().join("arm/backup"), &session.trials);
    let train = ["forearm", "train", "arm", "--out", "arm.model"];
    let (out, said) = succeeds(&dir, &train);
    assert!(out.contains("trained on 26 squeezes at 13 places"), "{out}");
    assert!(
        said.contains("arm: 26 .mat files of the folder are no part of this session")
            && said.contains("as arm/backup/0/distance0_1.mat"),
        "{said}"
    );
    fs::remove_dir_all(dir.path().join("arm/backup")).unwrap();
    let (_, said) = succeeds(&dir, &train);
    assert_eq!(said, "");
    for name in ["anna", "ben"] {
        write(&dir.path().join("data").join(name), &session.trials);
    }
    let error = fails(&dir, &["forearm", "train", "data", "--out", "arm.model"], 1);
    assert!(
        error.contains("there are squeezes in data/anna and in data/ben") && error.contains("name one"),
        "{error}"
    );
}
