//! Which files of a folder are its session.

use std::fs;
use std::path::Path;
use taxel_forearm::{ForearmError, Sample, Session, Squeeze, location_percent};
use tempfile::TempDir;

fn mat() -> Vec<u8> {
    let mut squeeze = Squeeze::default();
    for row in 0..4 {
        let at = f64::from(row);
        squeeze.push(Sample {
            time_ms: 121.0 * at,
            theta_p_deg: [40.0 + at, 41.0 + at],
            theta_a_deg: [20.0 + at, 21.0 + at],
            pwm: 10.0 * at,
        });
    }
    squeeze.to_mat()
}

/// A folder with a squeeze in each of these files.
fn folder(files: &[&str]) -> TempDir {
    let folder = TempDir::new().unwrap();
    for file in files {
        let path = folder.path().join(file);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, mat()).unwrap();
    }
    folder
}

fn open(folder: &TempDir) -> Result<Session, ForearmError> {
    Session::open(folder.path())
}

#[test]
fn a_session_is_the_folder_of_the_places_or_the_only_one_below_and_nothing_else() {
    let cases: [(&[&str], &[usize], &[&str]); 8] = [
        (&["0/distance0_1.mat", "12/distance12_1.mat"], &[0, 12], &[]),
        (&["distance0_1.mat", "distance3_2.mat"], &[0, 3], &[]),
        (
            &["place 3/distance3_1.mat", "Distance_04/distance4_1.mat"],
            &[3, 4],
            &[],
        ),
        (&["arm/0/distance0_1.mat", "arm/1/distance1_1.mat"], &[0, 1], &[]),
        (
            &["session 2/distance0_1.mat", "session 2/distance2_1.mat"],
            &[0, 2],
            &[],
        ),
        // A copy, squeezes that were put aside, and other names.
        (
            &["0/distance0_1.mat", "backup/0/distance0_1.mat"],
            &[0],
            &["backup/0/distance0_1.mat"],
        ),
        (
            &[
                "3/distance3_1.mat",
                "3/bad/distance3_2.mat",
                "bad/distance3_3.mat",
            ],
            &[3],
            &["3/bad/distance3_2.mat", "bad/distance3_3.mat"],
        ),
        (
            &[
                "0/distance0_1.mat",
                "0/Distance0_2.MAT",
                "0/distance0_1 (copy).mat",
            ],
            &[0],
            &["0/Distance0_2.MAT", "0/distance0_1 (copy).mat"],
        ),
    ];
    for (files, places, passed_over) in cases {
        let folder = folder(files);
        let session = open(&folder).unwrap_or_else(|error| panic!("{files:?}: {error}"));
        let at: Vec<f64> = session
            .trials
            .iter()
            .map(|trial| trial.location_percent)
            .collect();
        let expected: Vec<f64> = places.iter().map(|place| location_percent(*place)).collect();
        assert_eq!(at, expected, "{files:?}");
        let passed: Vec<&Path> = (session.passed_over.iter())
            .map(|path| path.strip_prefix(folder.path()).unwrap())
            .collect();
        let expected: Vec<&Path> = passed_over.iter().map(Path::new).collect();
        assert_eq!(passed, expected, "{files:?}");
    }
}

#[test]
fn two_sessions_a_squeeze_twice_and_one_in_the_folder_of_another_place_are_refused() {
    let cases: [(&[&str], &[&str]); 5] = [
        (
            &[
                "anna/0/distance0_1.mat",
                "ben/0/distance0_1.mat",
                "cleo/distance1_1.mat",
            ],
            &["anna and in ", "ben (and 1 more)", "name one of these folders"],
        ),
        (
            &["5/distance5_1.mat", "distance5_1.mat"],
            &[
                "squeeze 1 of place 5 is there twice",
                "/5/distance5_1.mat",
                "/distance5_1.mat",
            ],
        ),
        (
            &["5/distance5_1.mat", "05/distance5_1.mat"],
            &["squeeze 1 of place 5 is there twice"],
        ),
        (
            &["3/distance3_1.mat", "3/distance5_1.mat"],
            &["3/distance5_1.mat: its name is of place 5, and its folder of place 3"],
        ),
        (
            &["0/Distance0_1.MAT", "0/distance0_2 (copy).mat"],
            &[
                "no file such as 0/distance0_1.mat",
                "2 .mat files are of other names, as ",
            ],
        ),
    ];
    for (files, words) in cases {
        let error = open(&folder(files)).unwrap_err().to_string();
        assert!(
            words.iter().all(|word| error.contains(word)),
            "{files:?}: {error}"
        );
    }
}

#[test]
fn a_session_in_a_folder_of_its_own_says_there_what_it_is_of() {
    let folder = folder(&["arm/0/distance0_1.mat"]);
    assert!(!open(&folder).unwrap().simulated);
    fs::write(folder.path().join("arm/session.json"), r#"{"simulated": true}"#).unwrap();
    assert!(open(&folder).unwrap().simulated);
}
