//! What a layout file may say.

mod refused;
mod size;

use taxel_skin::{Layout, LayoutError, Protocol};

const HEAD: &str = "name = \"hand\"\nimage = { width = 8, height = 8 }\nbuses = [\"can0\", \"can1\"]\n";

/// A module whose keys are the usual ones, changed or added to by `changes`.
fn module(name: &str, changes: &[&str]) -> String {
    let mut lines: Vec<String> = [
        "part = \"index\"",
        "bus = \"can0\"",
        "board = 0",
        "protocol = \"uskin-l2\"",
        "at = [0, 0]",
    ]
    .map(String::from)
    .to_vec();
    for change in changes {
        let key = &change[..=change.find('=').unwrap()];
        match lines.iter_mut().find(|line| line.starts_with(key)) {
            Some(line) => *line = change.to_string(),
            None => lines.push(change.to_string()),
        }
    }
    format!("[[module]]\nname = \"{name}\"\n{}\n", lines.join("\n"))
}

fn error(text: &str) -> String {
    Layout::parse(text, "hand.toml").unwrap_err().to_string()
}

#[test]
fn the_default_hand_is_the_one_of_the_design() {
    let hand = Layout::builtin("allegro-uskin-15").unwrap();
    assert_eq!((hand.width, hand.height, hand.len()), (16, 16, 240));
    assert_eq!(hand.modules.len(), 15);
    assert_eq!(hand.buses, ["can0", "can1"]);
    assert_eq!((hand.frames_per_sweep(0), hand.frames_per_sweep(1)), (128, 112));
    let places: Vec<(&str, u8, u8)> = hand
        .boards()
        .map(|(_, m, wiring)| (m.part.as_str(), wiring.bus, wiring.board))
        .collect();
    let mut expected = Vec::new();
    for (part, bus, boards) in [
        ("index", 0, 0..4),
        ("middle", 0, 4..8),
        ("ring", 1, 0..4),
        ("thumb", 1, 4..7),
    ] {
        expected.extend(boards.map(|board| (part, bus, board)));
    }
    assert_eq!(places, expected);
    assert!(hand.wiring.iter().all(|m| m.protocol == Protocol::USKIN_L2));
    assert!(hand.taxels.iter().all(|t| t.position_mm.is_some()));

    for y in 0..16 {
        for x in 0..16 {
            let absent = x >= 12 && y >= 12;
            assert_eq!(hand.taxel_at(x, y).is_none(), absent, "({x}, {y})");
            if let Some(i) = hand.taxel_at(x, y) {
                assert_eq!((hand.taxels[i].x, hand.taxels[i].y), (x, y));
                let part = ["index", "middle", "ring", "thumb"][x as usize / 4];
                assert_eq!(hand.module_of(i).part, part);
            }
        }
    }
    assert_eq!(hand.taxel_at(16, 0), None);
    assert_eq!(hand.taxel_at(0, 16), None);
}

#[test]
fn every_built_in_hand_parses_under_its_own_name() {
    for name in Layout::builtin_names() {
        let text = Layout::builtin_text(name).unwrap();
        let hand = Layout::parse(text, name).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(hand.name, name);
        assert_eq!(Layout::builtin(name), Some(hand));
    }
    assert_eq!(Layout::builtin("no such hand"), None);
}

#[test]
fn a_phalange_is_drawn_with_its_middle_columns_swapped() {
    let module = Layout::builtin("uskin-module").unwrap();
    let drawn: Vec<Vec<u16>> = (0..4)
        .map(|y| (0..4).map(|x| module.k[module.taxel_at(x, y).unwrap()]).collect())
        .collect();
    assert_eq!(
        drawn,
        [[0, 2, 1, 3], [4, 6, 5, 7], [8, 10, 9, 11], [12, 14, 13, 15]]
    );
    assert_eq!(module.can_id(5), Some(0x715));
    assert_eq!(
        module.board(0, 1, Protocol::USKIN_L2),
        Some(0),
        "L1 and L2 boards are both MTBs"
    );
    assert_eq!(module.board(0, 1, Protocol::USKIN_L3), None);
}

#[test]
fn rotation_turns_the_tile_clockwise() {
    // The tile before rotation:  0 1 2 / 3 4 5
    let order = "order = [[0, 1, 2], [3, 4, 5]]";
    let cases: [(u16, &[&[i32]]); 4] = [
        (0, &[&[0, 1, 2], &[3, 4, 5]]),
        (90, &[&[3, 0], &[4, 1], &[5, 2]]),
        (180, &[&[5, 4, 3], &[2, 1, 0]]),
        (270, &[&[2, 5], &[1, 4], &[0, 3]]),
    ];
    for (degrees, expected) in cases {
        let rotation = format!("rotation = {degrees}");
        let text = HEAD.to_string() + &module("a", &[order, "at = [2, 3]", &rotation]);
        let hand = Layout::parse(&text, "hand.toml").unwrap();
        for (row, cells) in expected.iter().enumerate() {
            for (column, &k) in cells.iter().enumerate() {
                let taxel = hand.taxel_at(2 + column as u16, 3 + row as u16).unwrap();
                assert_eq!(
                    hand.k[taxel] as i32, k,
                    "{degrees} degrees, row {row}, column {column}"
                );
            }
        }
    }
}

#[test]
fn positions_follow_pitch_and_axes_or_a_list_and_do_not_turn_with_the_image() {
    let text = HEAD.to_string()
        + &module(
            "a",
            &[
                "order = [[0, 1], [-1, 2]]",
                "rotation = 180",
                "pitch_mm = 2.0",
                "origin_mm = [10, 20, 30]",
                "axes = [[0, 0, 1], [-1, 0, 0]]",
            ],
        )
        + &module(
            "b",
            &[
                "board = 1",
                "at = [4, 0]",
                "order = [[1, 0]]",
                "positions_mm = [[1, 2, 3], [4, 5, 6.5]]",
            ],
        )
        + &module("c", &["board = 2", "at = [4, 4]", "order = [[9]]"]);
    let hand = Layout::parse(&text, "hand.toml").unwrap();
    let positions: Vec<_> = hand.taxels.iter().map(|t| t.position_mm).collect();
    assert_eq!(
        positions,
        [
            Some([10.0, 20.0, 30.0]),
            Some([10.0, 20.0, 32.0]),
            Some([8.0, 20.0, 32.0]),
            Some([1.0, 2.0, 3.0]),
            Some([4.0, 5.0, 6.5]),
            None,
        ]
    );
    assert_eq!(hand.modules[1].first_taxel, 3);
    assert_eq!(hand.modules[2].taxels, 1);
}

#[test]
fn a_module_has_a_pose_and_a_joint_where_they_are_given() {
    let text = HEAD.to_string()
        + &module(
            "a",
            &[
                "joint = \"index 3\"",
                "pose = { position_mm = [0, -1.5, 30], orientation = [0.7071, 0, 0.7071, 0] }",
            ],
        )
        + &module("b", &["board = 1", "at = [4, 0]", "joint = \"index 2\""])
        + &module("c", &["board = 2", "at = [4, 4]"]);
    let hand = Layout::parse(&text, "hand.toml").unwrap();
    let pose = hand.modules[0].pose.unwrap();
    assert_eq!(pose.position_mm, [0.0, -1.5, 30.0]);
    // 0.7071 is not quite one half's root: the quaternion is made one of length 1.
    let half = std::f32::consts::FRAC_1_SQRT_2;
    assert_eq!(pose.orientation, [half, 0.0, half, 0.0]);
    let joints: Vec<_> = hand.modules.iter().map(|m| m.joint.as_deref()).collect();
    assert_eq!(joints, [Some("index 3"), Some("index 2"), None]);
    assert_eq!((hand.modules[1].pose, hand.modules[2].pose), (None, None));
}

#[test]
fn a_grid_numbers_its_taxels_row_by_row() {
    let grid = Layout::resolve("grid:3x5").unwrap();
    assert_eq!((grid.width, grid.height, grid.len()), (5, 3, 15));
    for i in 0..15 {
        assert_eq!(grid.taxel_at(i % 5, i / 5), Some(i as usize));
    }
    assert_eq!(grid.modules.len(), 1);
    assert_eq!(grid.k, (0..15).collect::<Vec<u16>>());
    assert_eq!(grid.can_id(0), None);
    assert_eq!(Layout::grid(65_535, 1).unwrap().len(), 65_535);
    assert!(matches!(
        Layout::grid(256, 256),
        Err(LayoutError::GridSize {
            width: 256,
            height: 256
        })
    ));
    for text in [
        "grid:3",
        "grid:0x4",
        "grid:ax4",
        "grid:70000x1",
        "grid:3x5x7",
        "grid:-1x4",
    ] {
        assert!(
            Layout::resolve(text).unwrap_err().to_string().contains("grid"),
            "{text}"
        );
    }
}

#[test]
fn resolve_knows_built_in_names_and_files_and_says_what_it_tried() {
    assert_eq!(Layout::resolve("allegro-uskin-15").unwrap().len(), 240);
    let message = Layout::resolve("no-such-hand").unwrap_err().to_string();
    assert!(
        message.contains("no-such-hand") && message.contains("allegro-uskin-15"),
        "{message}"
    );
    let directory = env!("CARGO_MANIFEST_DIR");
    let file = Layout::resolve(&format!("{directory}/layouts/uskin-module.toml")).unwrap();
    assert_eq!(file.name, "uskin-module");
    assert!(matches!(
        Layout::resolve(directory),
        Err(LayoutError::Read { .. })
    ));
}

/// The part of the guide on layouts.
fn guide() -> &'static str {
    let guide = include_str!("../../../../../docs/guide.md");
    let (_, section) = guide.split_once("\n## Write a layout\n").unwrap();
    section.split_once("\n## ").unwrap().0
}

#[test]
fn the_layout_of_the_guide_is_one() {
    let (_, text) = guide().split_once("```toml\n").unwrap();
    let (text, _) = text.split_once("```").unwrap();
    let hand = Layout::parse(text, "guide.md").unwrap();
    assert_eq!((hand.width, hand.height, hand.len()), (6, 4, 16 + 3));
    // Turned clockwise, the first cell of `order` is at the top right.
    let thumb: Vec<_> = hand.taxels[16..]
        .iter()
        .map(|t| ([t.x, t.y], t.position_mm))
        .collect();
    let at = |x, y, place| ([x, y], Some(place));
    assert_eq!(
        thumb,
        [
            at(5, 0, [60.0, 20.0, 0.0]),
            at(5, 1, [64.7, 20.0, 0.0]),
            at(4, 0, [60.0, 24.7, -1.5])
        ]
    );
    assert_eq!(hand.modules[1].joint.as_deref(), Some("thumb 3"));
}

#[test]
fn the_guide_explains_every_key_of_a_module() {
    let refused = error(&format!("{HEAD}{}", module("a", &["colour = \"red\""])));
    let (_, keys) = refused.split_once("; there are ").expect(&refused);
    let keys: Vec<&str> = keys.split(", ").collect();
    assert!(keys.contains(&"name") && keys.contains(&"joint"), "{refused}");
    for key in keys {
        assert!(guide().contains(&format!("`{key}`")), "{key}");
    }
}
