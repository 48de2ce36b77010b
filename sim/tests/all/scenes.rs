//! Scene files: what is refused and where, and what the built-in scenes contain.

use proptest::prelude::*;
use taxel_sim::{Scene, SceneError, Simulator, with_stand_in_boards};
use taxel_skin::Layout;

fn hand() -> Layout {
    Layout::builtin("allegro-uskin-15").unwrap()
}

fn module(layout: &Layout, name: &str) -> std::ops::Range<usize> {
    let m = layout.modules.iter().find(|m| m.name == name).unwrap();
    m.first_taxel as usize..(m.first_taxel + m.taxels) as usize
}

/// Touched taxels at a time, as a list of module names, and their number.
fn touched(sim: &Simulator, layout: &Layout, seconds: f64) -> (Vec<String>, usize) {
    let mut force = vec![0.0; layout.taxels.len()];
    let n = sim.truth((seconds * 1e9) as u64, &mut force);
    let mut names: Vec<String> = Vec::new();
    for (i, f) in force.iter().enumerate() {
        let name = &layout.modules[layout.taxels[i].module as usize].name;
        if *f > 0.0 && !names.contains(name) {
            names.push(name.clone());
        }
    }
    (names, n)
}

#[test]
fn every_built_in_scene_begins_and_ends_untouched() {
    for name in Scene::names() {
        let scene = Scene::builtin(name).unwrap();
        assert_eq!(scene.name(), name);
        let layout = with_stand_in_boards(&Layout::resolve(scene.layout()).unwrap()).unwrap();
        let sim = Simulator::new(&scene, &layout, scene.seed()).unwrap();
        for seconds in [0.0, 1.0, 1.99, scene.seconds() - 0.5, scene.seconds()] {
            assert_eq!(touched(&sim, &layout, seconds).1, 0, "{name} at {seconds} s");
        }
    }
}

#[test]
fn scenes_touch_what_they_say_when_they_say() {
    let layout = hand();
    let tips = ["index tip", "middle tip", "ring tip", "thumb tip"];
    let cases: [(&str, f64, &[&str]); 9] = [
        ("idle", 5.0, &[]),
        ("tap", 2.6, &["index tip"]),
        ("tap", 3.2, &[]),
        ("ball-grasp", 3.0, &["index tip"]),
        ("ball-grasp", 4.4, &[]),
        ("ball-grasp", 5.0, &["thumb tip"]),
        ("ball-grasp", 6.3, &tips),
        ("slip", 3.0, &["index tip", "thumb tip"]),
        ("slip", 5.4, &["index distal", "thumb tip"]),
    ];
    for (name, seconds, expected) in cases {
        let scene = Scene::builtin(name).unwrap();
        let sim = Simulator::new(&scene, &layout, 1).unwrap();
        let (mut names, _) = touched(&sim, &layout, seconds);
        names.sort();
        let mut expected: Vec<_> = expected.to_vec();
        expected.sort_unstable();
        assert_eq!(names, expected, "{name} at {seconds} s");
    }
}

#[test]
fn the_tight_grasp_engages_every_part_and_the_worst_case_every_taxel() {
    let layout = hand();
    let grasp = Simulator::new(&Scene::builtin("ball-grasp").unwrap(), &layout, 1).unwrap();
    let (names, taxels) = touched(&grasp, &layout, 8.5);
    assert!(names.len() >= 13, "{names:?}");
    assert!((100..240).contains(&taxels), "{taxels}");
    let worst = Simulator::new(&Scene::builtin("worst-case").unwrap(), &layout, 1).unwrap();
    for seconds in [2.1, 4.0, 6.0, 8.0, 9.9] {
        assert_eq!(touched(&worst, &layout, seconds).1, 240, "at {seconds} s");
    }
}

#[test]
fn pressure_lies_where_the_contact_is() {
    let layout = hand();
    let sim = Simulator::new(&Scene::builtin("tap").unwrap(), &layout, 1).unwrap();
    let mut force = vec![0.0; layout.taxels.len()];
    sim.truth(5_300_000_000, &mut force);
    let tip = module(&layout, "index tip");
    let strongest = tip
        .clone()
        .max_by(|a, b| force[*a].total_cmp(&force[*b]))
        .unwrap();
    let taxel = &layout.taxels[strongest];
    assert!(
        taxel.x <= 2 && (1..=3).contains(&taxel.y),
        "({}, {})",
        taxel.x,
        taxel.y
    );
    assert!(
        (3000.0..7000.0).contains(&force[strongest]),
        "{}",
        force[strongest]
    );
}

#[test]
fn mistakes_are_refused_with_their_line() {
    let contact = "[[contact]]\nshape = \"sphere\"\non = [\"index tip\"]\n";
    let cases = [
        ("name = \"x\"\nseconds = 5\nspeed = 2\n".to_string(), 3, "speed"),
        ("name = \"x\"\nseconds = -5\n".into(), 1, "seconds"),
        (
            "name = \"x\"\nseconds = 5\nboards = [500]\n".into(),
            3,
            "a table [name] is wanted here, not a list",
        ),
        (
            "name = \"x\"\nseconds = 5\ncontact = [\n[\"sphere\", [\"index tip\"]]]\n".into(),
            4,
            "a table [name] is wanted here, not a list",
        ),
        (
            "name = \"x\"\nseconds = 5\nfault = [\n[\"lost\"]]\n".into(),
            4,
            "a table [name] is wanted here, not a list",
        ),
        (
            "name = \"x\"\npalpation = [[], 1.0]\n".into(),
            2,
            "a table [name] is wanted here, not a list",
        ),
        (
            "name = \"x\"\nseconds = 5\n[boards]\nrate_hz = 5000\n".into(),
            3,
            "1 to 1000",
        ),
        (format!("name = \"x\"\nseconds = 5\n{contact}"), 3, "force"),
        (
            format!("name = \"x\"\nseconds = 5\n{contact}force_n = [[1, 1], [0, 1]]\n"),
            3,
            "not after",
        ),
        (
            format!("name = \"x\"\nseconds = 5\n{contact}force_n = [[9, 1]]\n"),
            3,
            "lasts 5 s",
        ),
        (
            format!("name = \"x\"\nseconds = 5\n{contact}force_n = [[0, nan]]\n"),
            3,
            "not a usable number",
        ),
        (
            format!("name = \"x\"\nseconds = 5\n{contact}force_n = [[0, 1]]\nradius = 0\n"),
            3,
            "radius",
        ),
        (
            format!("name = \"x\"\nseconds = 5\n{contact}force_n = [[0, 1]]\nalong = [1, 0]\n"),
            3,
            "along",
        ),
        (
            "name = \"x\"\nseconds = 5\n\n[[fault]]\nkind = \"dead\"\non = [\"index tip\"]\nfactor = 2\n"
                .into(),
            4,
            "factor",
        ),
        (
            "name = \"x\"\nseconds = 5\n\n[[fault]]\nkind = \"dead\"\n".into(),
            4,
            "needs `on`",
        ),
        (
            "name = \"x\"\nseconds = 5\n\n[[fault]]\nkind = \"lost\"\n".into(),
            4,
            "probability",
        ),
        (
            "name = \"x\"\nseconds = 5\n[[fault]]\nkind = \"reboot\"\non = [\"index tip\"]\nfrom = 1\nto = 2\n".into(),
            3,
            "no `to`",
        ),
        (
            "name = \"x\"\nseconds = 5\n[[fault]]\nkind = \"babble\"\non = [\"index tip\"]\nid = 5\n".into(),
            3,
            "either `on`",
        ),
        (
            "name = \"x\"\nseconds = 5\n\n[[fault]]\nkind = \"eaten\"\n".into(),
            5,
            "eaten",
        ),
        (
            "name = \"x\"\nseconds = 5\n[[fault]]\nkind = \"bus-off\"\nfrom = 4\nto = 3\n".into(),
            3,
            "not a stretch",
        ),
    ];
    for (text, line, word) in cases {
        let error = Scene::parse(&text, "my.toml").unwrap_err().to_string();
        assert!(error.starts_with(&format!("my.toml:{line}: ")), "{error}");
        assert!(error.contains(word), "{error}");
    }
}

#[test]
fn places_that_the_layout_lacks_are_refused_with_what_it_has() {
    let layout = hand();
    let base = "name = \"x\"\nseconds = 5\n";
    let cases = [
        (format!("{base}modules = [\"palm\"]\n"), 3, "index tip"),
        (
            format!("{base}[[contact]]\nshape = \"flat\"\non = [\"palm\"]\nforce_n = [[0, 1]]\n"),
            3,
            "`palm`",
        ),
        (
            format!("{base}[[fault]]\nkind = \"dead\"\non = [\"index tip\"]\ntaxels = [16]\n"),
            3,
            "no taxel 16",
        ),
        (
            format!("{base}[[fault]]\nkind = \"lost\"\nbus = 2\nprobability = 0.5\n"),
            3,
            "2 buses",
        ),
        (
            format!("{base}[[fault]]\nkind = \"wrong-id\"\non = [\"index tip\"]\nboard = 9\n"),
            3,
            "no board 9",
        ),
    ];
    for (text, line, word) in cases {
        let scene = Scene::parse(&text, "my.toml").unwrap();
        let error = Simulator::new(&scene, &layout, 1).unwrap_err().to_string();
        assert!(error.starts_with(&format!("my.toml:{line}: ")), "{error}");
        assert!(error.contains(word), "{error}");
    }
    let grid = Layout::grid(4, 4).unwrap();
    let error = Simulator::new(&Scene::builtin("idle").unwrap(), &grid, 1).unwrap_err();
    assert!(matches!(error, SceneError::Layout { .. }), "{error}");
}

#[test]
fn a_scene_is_found_by_name_or_path_or_the_error_lists_the_names() {
    assert_eq!(Scene::resolve("slip").unwrap().name(), "slip");
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/tap.toml");
    assert_eq!(Scene::resolve(path).unwrap().name(), "tap");
    let unknown = Scene::resolve("juggle").unwrap_err().to_string();
    assert!(
        unknown.contains("juggle") && unknown.contains("ball-grasp"),
        "{unknown}"
    );
    let forearm = Scene::resolve("forearm").unwrap_err().to_string();
    assert!(
        forearm.contains("no scene `forearm` but for `taxel sim` and `taxel demo`"),
        "{forearm}"
    );
    let absent = Scene::resolve("./juggle.toml").unwrap_err().to_string();
    assert!(
        absent.contains("cannot read") && absent.contains("juggle.toml"),
        "{absent}"
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn no_text_makes_it_panic(
        scene in 0..6usize,
        edits in prop::collection::vec((any::<prop::sample::Index>(), "[-0-9.e\\[\\]\"a-z\n]{0,3}"), 1..4),
    ) {
        let mut text = Scene::builtin_text(Scene::names().nth(scene).unwrap()).unwrap();
        for (at, with) in edits {
            let at = at.index(text.len());
            text.replace_range(at..at + 1, &with);
        }
        if let Ok(scene) = Scene::parse(&text, "edited")
            && let Ok(mut sim) = Simulator::looping(&scene, &hand(), 1)
        {
            sim.start_all();
            let mut frames = Vec::new();
            sim.advance(30_000_000, &mut frames);
            let mut force = [0.0; 240];
            sim.truth(7_000_000_000, &mut force);
            prop_assert!(force.iter().all(|f| f.is_finite()));
        }
    }
}
