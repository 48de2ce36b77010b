//! What a layout file may say, and where the error is when it may not.

use proptest::prelude::*;
use taxel_skin::{Layout, LayoutError, LayoutProblem, Protocol};

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
fn what_cannot_be_is_refused_with_file_and_line() {
    let l1 = "protocol = \"uskin-l1\"";
    let l3 = "protocol = \"uskin-l3\"";
    let second = |changes: &[&str]| {
        let all = [&["board = 1", "at = [4, 4]"], changes].concat();
        HEAD.to_string() + &module("a", &[]) + &module("b", &all)
    };
    let first = |changes: &[&str]| HEAD.to_string() + &module("a", changes);
    // The first module's table starts in line 4 with its name, part, bus, board, protocol and at in
    // lines 5 to 10; the second one's in line 11.
    let cases: Vec<(String, &[&str])> = vec![
        (
            second(&["at = [3, 3]"]),
            &[
                "hand.toml:17:",
                "k = 0 of module \"b\"",
                "pixel (3, 3)",
                "k = 15 of module \"a\" (line 4)",
            ],
        ),
        (
            second(&["at = [5, 4]"]),
            &["hand.toml:17:", "pixel (8, 4)", "8 x 8"],
        ),
        (
            second(&["at = [8, 0, 77]"]),
            &["hand.toml:17:", "a list of 2 is wanted here, not of 3"],
        ),
        (
            HEAD.replace("{ width = 8, height = 8 }", "[8, 8]") + &module("a", &[]),
            &["hand.toml:2:", "a table [name] is wanted here, not a list"],
        ),
        (
            HEAD.to_string() + "module = [[\"a\", \"index\"]]\n",
            &["hand.toml:4:", "a table [name] is wanted here, not a list"],
        ),
        (
            first(&["icub = [50, 0]"]),
            &["hand.toml:11:", "a table [name] is wanted here, not a list"],
        ),
        (
            first(&["pose = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]]"]),
            &["hand.toml:11:", "a table [name] is wanted here, not a list"],
        ),
        (
            HEAD.to_string() + "cyskin = []\n" + &module("a", &[]),
            &["hand.toml:4:", "a table [name] is wanted here, not a list"],
        ),
        (
            HEAD.to_string() + "cyskin = { hub = [[\"a\", \"can0\", 1]] }\n" + &module("a", &[]),
            &["hand.toml:4:", "a table [name] is wanted here, not a list"],
        ),
        (
            HEAD.to_string() + "cyskin = { start = [[0x37]] }\n" + &module("a", &[]),
            &["hand.toml:4:", "a table [name] is wanted here, not a list"],
        ),
        (
            first(&["order = [[1, 2, 3, 4], [5, 6, 7, 8], [9, 10, 11, 12], [13, 14, 15, 16]]"]),
            &[
                "hand.toml:11:",
                "its order has the taxels 1 to 16, and taxels are counted from 0",
            ],
        ),
        (
            first(&[]).replace("[[module]]", "[module]"),
            &["hand.toml:4:", "write [[module]], with two brackets"],
        ),
        (second(&["at = [-1, 4]"]), &["hand.toml:17:", "pixel (-1, 4)"]),
        (
            second(&["at = [9223372036854775807, 0]"]),
            &["hand.toml:17:", "outside the image"],
        ),
        (
            second(&["protocol = \"uskin\""]),
            &["hand.toml:16:", "unknown board protocol \"uskin\"", "uskin-l1"],
        ),
        (
            second(&["board = 0"]),
            &[
                "hand.toml:15:",
                "board 0 on bus \"can0\"",
                "module \"a\" (line 4)",
            ],
        ),
        (
            second(&["board = 0", l1]),
            &[
                "hand.toml:15:",
                "board 0 on bus \"can0\"",
                "module \"a\" (line 4)",
            ],
        ),
        (
            HEAD.to_string() + &module("a", &["board = 7"]) + &module("b", &["board = 2", "at = [4, 4]", l1]),
            &[
                "hand.toml:15:",
                "0x720",
                "\"can0\"",
                "k = 8 of module \"a\" (line 4)",
            ],
        ),
        (
            first(&["board = 8"]),
            &["hand.toml:8:", "board 8", "uskin-l2 has boards 0 to 7"],
        ),
        (first(&["board = -1"]), &["hand.toml:8:", "board -1"]),
        (
            first(&["board = 15", l1]),
            &["hand.toml:8:", "uskin-l1 has boards 0 to 14"],
        ),
        (
            first(&["board = 32", l3]),
            &["hand.toml:8:", "uskin-l3 has boards 0 to 31"],
        ),
        (
            first(&["rotation = 45"]),
            &["hand.toml:11:", "rotation 45", "0, 90, 180 or 270"],
        ),
        (first(&["rotation = -90"]), &["hand.toml:11:", "rotation -90"]),
        (
            first(&["bus = \"can2\""]),
            &["hand.toml:7:", "\"can2\"", "can0, can1"],
        ),
        (
            first(&["order = [[0, 1], [1, 2]]"]),
            &["hand.toml:11:", "taxel 1 twice", "rows 0 and 1"],
        ),
        (
            first(&["order = [[0, 1], [2]]"]),
            &["hand.toml:11:", "row 1", "1 cells", "first has 2"],
        ),
        (
            first(&["order = [[0, 24]]"]),
            &["hand.toml:11:", "taxel 24", "0 to 23"],
        ),
        (first(&["order = [[-2]]"]), &["hand.toml:11:", "taxel -2"]),
        (first(&["order = [[-1]]"]), &["hand.toml:11:", "no taxel"]),
        (first(&["order = []"]), &["hand.toml:11:", "no taxel"]),
        (
            first(&[l3]),
            &["hand.toml:4:", "uskin-l3", "`order` must be written"],
        ),
        (
            first(&["colour = \"red\""]),
            &["hand.toml:11:", "unknown key `colour`"],
        ),
        (first(&["board = \"0\""]), &["hand.toml:8:", "wanted here, not"]),
        (first(&["at = [0, 0"]), &["hand.toml:"]),
        (
            second(&[]).replace("\"b\"", "\"a\""),
            &["hand.toml:11:", "\"a\" is used twice"],
        ),
        (first(&["part = \"\""]), &["hand.toml:4:", "part \"\" is empty"]),
        (
            first(&[]).replace("\"index\"", r#""two\nlines""#),
            &["hand.toml:4:", r#"part "two\nlines""#, "line break"],
        ),
        (
            first(&[]).replace("\"a\"", r#""\u001b[31mred""#),
            &["hand.toml:4:", r#"module "\u{1b}[31mred""#, "control character"],
        ),
        (
            first(&["pitch_mm = 4.7"]),
            &["hand.toml:11:", "both pitch_mm and origin_mm"],
        ),
        (
            first(&["pitch_mm = 0", "origin_mm = [0, 0, 0]"]),
            &["hand.toml:11:", "pitch_mm = 0"],
        ),
        (
            first(&["pitch_mm = 1", "origin_mm = [nan, 0, 0]"]),
            &["hand.toml:12:", "origin_mm"],
        ),
        (
            first(&[
                "pitch_mm = 1",
                "origin_mm = [0, 0, 0]",
                "axes = [[1, 0, 0], [1, 0, 0]]",
            ]),
            &["hand.toml:13:", "right angles"],
        ),
        (
            first(&["positions_mm = [[0, 0, 0]]"]),
            &["hand.toml:11:", "1 places for 16 taxels"],
        ),
        (
            first(&["order = [[0]]", "positions_mm = [[0, 0, inf]]"]),
            &["hand.toml:12:", "place 0"],
        ),
        (
            first(&["order = [[0]]", "positions_mm = [[0, 0, 0]]", "pitch_mm = 1"]),
            &["hand.toml:12:", "not both"],
        ),
        (
            first(&["joint = \"index\\n2\""]),
            &[
                "hand.toml:11:",
                "module \"a\"",
                "joint is no name: it has a line break",
            ],
        ),
        (
            first(&["joint = \" \""]),
            &["hand.toml:11:", "module \"a\"", "joint is empty"],
        ),
        (
            first(&["pose = { position_mm = [0, 0, 0] }"]),
            &["hand.toml:11:", "orientation"],
        ),
        (
            first(&["pose = { position_mm = [0, 0, 0], orientation = [1, 0, 0, 0], frame = 1 }"]),
            &["hand.toml:11:", "frame"],
        ),
        (
            first(&["pose = { position_mm = [0, 0], orientation = [1, 0, 0, 0] }"]),
            &["hand.toml:11:", "3"],
        ),
        (
            first(&["pose = { position_mm = [0, nan, 0], orientation = [1, 0, 0, 0] }"]),
            &["hand.toml:11:", "module \"a\"", "position_mm of its pose"],
        ),
        (
            first(&["pose = { position_mm = [0, 0, 2e6], orientation = [1, 0, 0, 0] }"]),
            &["hand.toml:11:", "1e6 mm"],
        ),
        (
            first(&["pose = { position_mm = [0, 0, 0], orientation = [1, 0, 0.05, 0] }"]),
            &["hand.toml:11:", "length 1.001249", "1 within 0.001"],
        ),
        (
            first(&["pose = { position_mm = [0, 0, 0], orientation = [0, 0, 0, 0] }"]),
            &["hand.toml:11:", "length 0"],
        ),
        (
            first(&["pose = { position_mm = [0, 0, 0], orientation = [inf, 0, 0, 0] }"]),
            &["hand.toml:11:", "length inf"],
        ),
        (
            first(&["pose = { position_mm = [0, 0, 0], orientation = [nan, 0, 0, 0] }"]),
            &["hand.toml:11:", "length NaN"],
        ),
        (HEAD.to_string(), &["hand.toml:", "module"]),
        (
            HEAD.replace("width = 8", "width = 0") + &module("a", &[]),
            &["hand.toml:2:", "image.width is 0", "1 to 65535"],
        ),
        (
            HEAD.replace("8", "65536") + &module("a", &[]),
            &["hand.toml:2:", "65536", "1 to 65535"],
        ),
        (
            HEAD.replace("8", "2000") + &module("a", &[]),
            &["hand.toml:2:", "2000 x 2000", "1048576 pixels"],
        ),
        (
            HEAD.replace("can1", "can0") + &module("a", &[]),
            &["hand.toml:3:", "\"can0\" is used twice"],
        ),
        (
            HEAD.replace("can1", "") + &module("a", &[]),
            &["hand.toml:3:", "bus \"\" is empty"],
        ),
        (
            HEAD.replace("[\"can0\", \"can1\"]", "[]") + &module("a", &[]),
            &["number of buses is 0"],
        ),
        (
            HEAD.replace("hand", "") + &module("a", &[]),
            &["hand.toml:1:", "name", "empty"],
        ),
        (
            HEAD.to_string() + "module = []\n",
            &["number of modules is 0", "1 to 1000"],
        ),
        (String::new(), &["hand.toml:1:", "is missing here"]),
    ];
    for (text, parts) in cases {
        let message = error(&text);
        for part in parts {
            assert!(
                message.contains(part),
                "{message:?} does not say {part:?} of\n{text}"
            );
        }
    }
}

/// `count` modules of one board each, side by side in rows; eight L2 boards to a bus.
fn many_modules(count: usize, order: &str) -> String {
    let buses: Vec<String> = (0..count.div_ceil(8)).map(|i| format!("\"can{i}\"")).collect();
    let mut text = format!(
        "name = \"many\"\nimage = {{ width = 1024, height = 1024 }}\nbuses = [{}]\n",
        buses.join(", ")
    );
    for i in 0..count {
        text += &module(
            &format!("m{i}"),
            &[
                &format!("bus = \"can{}\"", i / 8),
                &format!("board = {}", i % 8),
                &format!("at = [{}, {}]", i % 64 * 16, i / 64 * 16),
                order,
            ],
        );
    }
    text
}

#[test]
fn a_thousand_modules_fit_and_one_more_does_not() {
    let order = "order = [[0]]";
    assert_eq!(
        Layout::parse(&many_modules(1000, order), "big").unwrap().len(),
        1000
    );
    let message = error(&many_modules(1001, order));
    assert!(
        message.contains("number of modules is 1001, and must be 1 to 1000"),
        "{message}"
    );
}

#[test]
fn the_largest_hand_is_a_thousand_boards_of_64_taxels() {
    let order: Vec<String> = (0..8)
        .map(|row| {
            let cells: Vec<String> = (0..8).map(|column| (8 * row + column).to_string()).collect();
            format!("[{}]", cells.join(", "))
        })
        .collect();
    let text = many_modules(1000, &format!("order = [{}]", order.join(", "))).replace("uskin-l2", "uskin-l3");
    let hand = Layout::parse(&text, "big").unwrap();
    assert_eq!(hand.len(), 64_000);
    assert_eq!(hand.modules[999].first_taxel, 63_936);
}

#[test]
fn a_grid_numbers_its_taxels_row_by_row() {
    let grid = Layout::resolve("grid:3x5").unwrap();
    assert_eq!((grid.width, grid.height, grid.len()), (5, 3, 15));
    for i in 0..15 {
        assert_eq!(grid.taxel_at(i % 5, i / 5), Some(i as usize));
    }
    assert_eq!(grid.modules.len(), 1);
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

#[test]
fn an_error_carries_its_objects_for_programs() {
    let text = HEAD.to_string() + &module("a", &["rotation = 30"]);
    let Err(LayoutError::Invalid { file, line, problem }) = Layout::parse(&text, "x.toml") else {
        panic!("30 degrees were accepted");
    };
    assert_eq!((file.as_str(), line), ("x.toml", 11));
    assert_eq!(
        *problem,
        LayoutProblem::Rotation {
            module: "a".into(),
            degrees: 30
        }
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Whatever happened to the file, there is an answer, and if it is a layout then no two taxels
    /// share a pixel.
    #[test]
    fn a_damaged_file_is_refused_or_still_makes_sense(
        start in any::<prop::sample::Index>(),
        cut in 0usize..40,
        insert in "[0-9a-z,=\"\\[\\]\n -]{0,6}",
    ) {
        let mut text = Layout::builtin_text("allegro-uskin-15").unwrap().split_once("\nname").unwrap().1.to_string();
        text.insert_str(0, "name");
        let start = start.index(text.len());
        text.replace_range(start..(start + cut).min(text.len()), &insert);
        match Layout::parse(&text, "hand.toml") {
            Ok(layout) => for (i, taxel) in layout.taxels.iter().enumerate() {
                prop_assert_eq!(layout.taxel_at(taxel.x, taxel.y), Some(i));
            },
            Err(e) => prop_assert!(e.to_string().starts_with("hand.toml:"), "{}", e),
        }
    }
}
