//! Where the error is when a layout file says what it may not.

use super::*;
use proptest::prelude::*;
use taxel_skin::LayoutProblem;

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
                "-1 in its place",
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

    /// Numbers that any protocol allows, that only some do, and that none does.
    #[test]
    fn a_file_with_any_numbers_is_refused_or_still_makes_sense(
        protocol in prop::sample::select(Protocol::boards().chain([Protocol::OFFLINE]).collect::<Vec<_>>()),
        order in prop::option::of((1usize..20).prop_flat_map(|columns| {
            prop::collection::vec(prop::collection::vec(any_number(), columns), 1..4)
        })),
        keys in prop::collection::vec((any_key(), any_number()), 0..4),
        at in [any_number(), any_number()],
    ) {
        let mut changes = vec![format!("protocol = \"{}\"", protocol.name()), format!("at = {at:?}")];
        changes.extend(order.map(|order| format!("order = {order:?}")));
        changes.extend(keys.iter().map(|(key, number)| format!("{key} = {number}")));
        let changes: Vec<&str> = changes.iter().map(String::as_str).collect();
        let head = HEAD.replace("width = 8, height = 8", "width = 512, height = 8");
        match Layout::parse(&(head + &module("a", &changes)), "hand.toml") {
            Ok(layout) => for (i, taxel) in layout.taxels.iter().enumerate() {
                prop_assert_eq!(layout.taxel_at(taxel.x, taxel.y), Some(i));
                prop_assert!(i == 0 || layout.k[i - 1] < layout.k[i]);
            },
            Err(e) => prop_assert!(e.to_string().starts_with("hand.toml:"), "{}", e),
        }
    }
}

fn any_number() -> impl Strategy<Value = i64> {
    prop_oneof![
        8 => 0i64..65_535,
        4 => 0i64..24,
        1 => prop::sample::select(vec![-1, 255, 256, 65_534, 65_535, 65_536, i64::MAX, i64::MIN]),
    ]
}

fn any_key() -> impl Strategy<Value = &'static str> {
    prop::sample::select(vec!["board", "rotation", "rows", "columns", "module", "pitch_mm"])
}
