//! Which settings of a display profile go together, and which keys may be left out.

use super::*;
use taxel_hand::{CodebookLearning, Coordinates, LevelSteps, Method, Placement, Profile};

#[test]
fn settings_that_do_not_go_together_are_refused() {
    let layout = hand();
    let budgets = |of: &[(&str, u16)]| of.iter().map(|(p, n)| ((*p).into(), *n)).collect();
    let learning = Some(CodebookLearning { forgetting: 0.1 });
    let profiles = [
        (
            Profile {
                jnd: Some(0.07),
                ..optimal()
            },
            "needs force_min",
        ),
        (
            Profile {
                jnd: Some(0.0),
                ..optimal()
            },
            "jnd = 0",
        ),
        (
            Profile {
                force_min: Some(1.0),
                ..optimal()
            },
            "needs force_max",
        ),
        (
            Profile {
                force_min: Some(2.0),
                force_max: Some(1.0),
                ..optimal()
            },
            "no range",
        ),
        (
            Profile {
                force_min: Some(f64::NAN),
                force_max: Some(1.0),
                ..optimal()
            },
            "no range",
        ),
        (
            Profile {
                codebook: vec![1.0],
                codebook_learning: learning,
                ..optimal()
            },
            "codebook cannot be combined",
        ),
        (
            Profile {
                level_steps: LevelSteps::Weber,
                codebook_learning: learning,
                ..optimal()
            },
            "cannot be combined",
        ),
        (
            Profile {
                codebook_learning: Some(CodebookLearning { forgetting: 1.5 }),
                ..optimal()
            },
            "forgetting = 1.5",
        ),
        (
            Profile {
                placement: Some(Placement::Lloyd),
                coordinates: Coordinates::Hand,
                ..optimal()
            },
            "needs placement",
        ),
        (
            Profile {
                method: Method::Paper,
                budgets: budgets(&[("index", 3)]),
                ..optimal()
            },
            "budgets needs placement",
        ),
        (
            Profile {
                budgets: budgets(&[("tail", 3)]),
                ..optimal()
            },
            "parts of this hand are index, middle",
        ),
        (
            Profile {
                budgets: budgets(&[("index", 0)]),
                ..optimal()
            },
            "budgets = 0",
        ),
        (
            Profile {
                budgets: budgets(&[("index", 9), ("thumb", 9)]),
                ..optimal()
            },
            "add up to 18",
        ),
        (
            Profile {
                budgets: budgets(&[("index", 8), ("thumb", 8)]),
                ..optimal()
            },
            "2 parts have none",
        ),
        (
            Profile {
                actuators: 3,
                ..fixed(&[[0.0, 0.0], [1.0, 1.0]])
            },
            "2 places and actuators = 3",
        ),
        (fixed(&[[0.0, 0.0], [0.0, 0.0]]), "place 1 of fixed"),
        (fixed(&[[0.0, f64::NAN]]), "place 0 of fixed"),
        (
            Profile {
                placement: Some(Placement::Follow),
                ..fixed(&[[0.0, 0.0]])
            },
            "fixed cannot be combined",
        ),
    ];
    for (profile, want) in profiles {
        let message = refused(profile, &layout).to_string();
        assert!(message.contains(want), "{message:?} does not say {want:?}");
    }
}

#[test]
fn a_profile_survives_json_and_keys_may_be_left_out() {
    let profile = Profile {
        jnd: Some(0.07),
        force_min: Some(10.0),
        force_max: Some(5000.0),
        level_steps: LevelSteps::Weber,
        coordinates: Coordinates::Hand,
        ..fixed(&[[1.0, 2.0]])
    };
    let text = serde_json::to_string(&profile).expect("JSON");
    assert_eq!(
        serde_json::from_str::<Profile>(&text).expect("a profile"),
        profile
    );
    let short =
        r#"{"method": "optimal", "budgets": {"thumb": 6}, "codebook_learning": {"forgetting": 0.01}}"#;
    let short: Profile = serde_json::from_str(short).expect("a profile");
    assert_eq!((short.budgets["thumb"], short.level_count()), (6, 8));
    assert!(serde_json::from_str::<Profile>(r#"{"budget": {}}"#).is_err());
}
