//! Squeezes in and out of files.

use std::fs;
use std::path::Path;
use taxel_forearm::{PLACES, Sample, Session, Squeeze, TACTELS, Trial, location_percent};

fn squeeze(place: usize, samples: usize) -> Squeeze {
    let mut squeeze = Squeeze::default();
    for row in 0..samples {
        let at = row as f64 + place as f64;
        squeeze.push(Sample {
            time_ms: 121.3 * row as f64,
            theta_p_deg: [40.0 + at, 41.0 + at],
            theta_a_deg: [20.0 + at, 21.0 + at],
            pwm: 10.0 * row as f64,
        });
        squeeze.undocumented_deg[row] = -at;
    }
    squeeze
}

fn trial(place: usize, repetition: usize, samples: usize) -> Trial {
    Trial {
        location_percent: location_percent(place),
        repetition,
        squeeze: squeeze(place, samples),
    }
}

fn session(name: impl AsRef<Path>, trials: impl Into<Vec<Trial>>) -> Session {
    Session {
        name: name.as_ref().display().to_string(),
        simulated: false,
        passed_over: Vec::new(),
        trials: trials.into(),
    }
}

fn write(folder: &Path, place: usize, repetition: usize, bytes: &[u8]) {
    fs::create_dir_all(folder.join(place.to_string())).unwrap();
    let name = format!("{place}/distance{place}_{repetition}.mat");
    fs::write(folder.join(name), bytes).unwrap();
}

#[test]
fn a_folder_of_mat_files_is_a_session_in_the_order_of_places_and_repetitions() {
    let folder = tempfile::tempdir().unwrap();
    for (place, repetition) in [(10, 1), (2, 2), (2, 1)] {
        write(
            folder.path(),
            place,
            repetition,
            &squeeze(place, 4 + repetition).to_mat(),
        );
    }
    let session = Session::open(folder.path()).unwrap();
    assert_eq!(session.trials, [trial(2, 0, 5), trial(2, 1, 6), trial(10, 0, 5)]);
    assert_eq!(session.locations(), [location_percent(2), location_percent(10)]);
}

#[test]
fn an_npz_holds_squeezes_of_unequal_length_and_leaves_out_those_that_were_not_made() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("session.npz");
    let mut session = session(&path, [trial(0, 0, 5), trial(0, 1, 7), trial(12, 1, 3)]);
    session.write_npz(&path).unwrap();
    assert_eq!(Session::open(&path).unwrap(), session);
    for (n, trial) in session.trials.iter_mut().enumerate() {
        let counts = (0..trial.squeeze.len() * TACTELS).map(|c| (c * 7 + n) as u16);
        trial.squeeze.tactile = Some(counts.collect());
    }
    session.write_npz(&path).unwrap();
    assert_eq!(Session::open(&path).unwrap(), session);
    assert!(session.has_touch());
}

#[test]
fn what_is_simulated_says_so_in_every_kind_of_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("session.npz");
    for simulated in [true, false] {
        let session = Session {
            simulated,
            ..session(&path, [trial(0, 0, 5), trial(12, 0, 5)])
        };
        session.write_npz(&path).unwrap();
        assert_eq!(Session::open(&path).unwrap(), session);
    }
    write(folder.path(), 3, 1, &squeeze(3, 4).to_mat());
    for (settings, simulated) in [
        (r#"{"version": 1, "simulated": true}"#, true),
        (r#"{"version": 1}"#, false),
    ] {
        fs::write(folder.path().join("session.json"), settings).unwrap();
        assert_eq!(Session::open(folder.path()).unwrap().simulated, simulated);
    }
    fs::write(folder.path().join("session.json"), "torn").unwrap();
    let error = Session::open(folder.path()).unwrap_err().to_string();
    assert!(error.contains("session.json"), "{error}");
}

#[test]
fn a_squeeze_of_an_npz_is_cut_off_where_no_row_follows_and_nowhere_else() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("session.npz");
    let mut session = session(&path, [trial(0, 0, 9), trial(12, 0, 9)]);
    session.trials[1].squeeze.time_ms[4] = f64::NAN;
    session.write_npz(&path).unwrap();
    let error = Session::open(&path).unwrap_err().to_string();
    assert!(
        error.contains("session.npz, squeeze 1 at 100.0 %: row 4 is at NaN ms"),
        "{error}"
    );
}

#[test]
fn a_file_is_read_with_the_touch_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut touched = squeeze(3, 4);
    touched.tactile = Some((0..4 * TACTELS).map(|n| n as u16).collect());
    write(folder.path(), 3, 1, &touched.to_mat());
    let file = folder.path().join("3/distance3_1.mat");
    assert_eq!(Squeeze::open(&file).unwrap().tactile, None);
    fs::write(folder.path().join("3/tactile3_1.npy"), touched.to_npy().unwrap()).unwrap();
    assert_eq!(Squeeze::open(&file).unwrap().tactile, touched.tactile);
    fs::write(folder.path().join("3/tactile3_1.npy"), "torn").unwrap();
    assert!(
        Squeeze::open(&file)
            .unwrap_err()
            .to_string()
            .contains("tactile3_1.npy")
    );
}

#[test]
fn what_cannot_be_read_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let error = |what: &str| {
        let error = Session::open(folder.path()).unwrap_err().to_string();
        assert!(error.contains(what), "{error}");
    };
    error("no file such as 0/distance0_1.mat");
    write(folder.path(), 3, 1, &squeeze(3, 4).to_mat()[..300]);
    error("3/distance3_1.mat: byte 128");
    let mut backwards = squeeze(3, 4);
    backwards.time_ms[2] = 0.0;
    write(folder.path(), 3, 1, &backwards.to_mat());
    error("3/distance3_1.mat: row 2 is at 0 ms, after one at 121.3 ms");
    let mut strong = squeeze(3, 4);
    strong.pwm[1] = 1000.0;
    write(folder.path(), 3, 1, &strong.to_mat());
    error("row 1 commands PWM 1000");
    write(folder.path(), 3, 1, &squeeze(3, 4).to_mat());
    write(folder.path(), PLACES, 1, &squeeze(3, 4).to_mat());
    error("places are 0 to 12");
    let path = folder.path().join("none.npz");
    fs::write(&path, "no archive").unwrap();
    let error = Session::open(&path).unwrap_err().to_string();
    assert!(error.contains("none.npz: not a readable npz"), "{error}");
    let trials = [0, PLACES - 1].map(|place| Trial {
        location_percent: location_percent(place) / 100.0,
        repetition: 0,
        squeeze: squeeze(place, 4),
    });
    let shares = session("shares", trials);
    shares.write_npz(&path).unwrap();
    let error = Session::open(&path).unwrap_err().to_string();
    assert!(error.contains("multiply shares of the forearm by 100"), "{error}");
}

#[test]
fn a_copy_with_a_date_for_its_number_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), 3, 1000, &squeeze(3, 4).to_mat());
    assert_eq!(Session::open(folder.path()).unwrap().trials.len(), 1);
    write(folder.path(), 3, 20_261_126, &squeeze(3, 4).to_mat());
    let error = Session::open(folder.path()).unwrap_err().to_string();
    assert!(
        error.contains("distance3_20261126.mat: ") && error.contains("repetitions 1 to 1000"),
        "{error}"
    );
}

#[test]
fn one_squeeze_without_touch_costs_no_others_theirs() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("session.npz");
    let mut session = session("touched", [trial(0, 0, 5), trial(1, 0, 5), trial(1, 1, 5)]);
    for n in [0, 1] {
        session.trials[n].squeeze.tactile = Some(vec![1; 5 * TACTELS]);
    }
    let error = session.write_npz(&path).unwrap_err().to_string();
    assert!(
        error.contains("squeeze 2 at 8.3 %: it has no tactile images, and others have") && !path.exists(),
        "{error}"
    );
}

#[test]
fn the_public_session_is_read_whole() {
    let Some(path) = taxel_recordings::find("forearm_kinesthetic.npz") else {
        return;
    };
    let session = Session::open(&path).unwrap();
    assert_eq!((session.trials.len(), session.locations().len()), (780, PLACES));
    for trial in &session.trials {
        assert_eq!(trial.squeeze.len(), 95);
        let peak = trial.squeeze.pwm.iter().copied().fold(0.0, f64::max);
        assert!((395.0..=405.0).contains(&peak), "{peak}");
    }
    // And comes back from the publication's own kind of file.
    let folder = tempfile::tempdir().unwrap();
    for trial in session.trials.iter().step_by(60) {
        let place = (trial.location_percent * 0.12).round() as usize;
        write(folder.path(), place, 1, &trial.squeeze.to_mat());
    }
    let back = Session::open(folder.path()).unwrap();
    for (back, trial) in back.trials.iter().zip(session.trials.iter().step_by(60)) {
        assert_eq!(back.squeeze, trial.squeeze);
        assert!((back.location_percent - trial.location_percent).abs() < 0.01);
    }
}

#[test]
fn times_in_seconds_are_refused_wherever_they_come_from() {
    let folder = tempfile::tempdir().unwrap();
    for (factor, words) in [(1e-3, "rows are 0.121"), (1e3, "rows are 121")] {
        let mut trial = trial(1, 2, 5);
        trial.squeeze.time_ms.iter_mut().for_each(|time| *time *= factor);
        write(folder.path(), 1, 3, &trial.squeeze.to_mat());
        let path = folder.path().join("1/distance1_3.mat");
        let of_mat = Squeeze::read_mat(&path).unwrap_err().to_string();
        let session = session("in seconds", [trial]);
        let path = folder.path().join("session.npz");
        session.write_npz(&path).unwrap();
        let of_npz = Session::open(&path).unwrap_err().to_string();
        assert!(of_npz.contains("session.npz, squeeze 3 at 8.3 %: "), "{of_npz}");
        for error in [of_mat, of_npz] {
            assert!(
                error.contains(words) && error.contains("Multiply seconds by 1000"),
                "{error}"
            );
        }
    }
}
