//! A table is keys with their values: what stands in a list in the order of the keys is refused with its line.

use std::path::Path;
use taxel_config::Config;
use taxel_skin::Layout;

#[test]
fn a_list_of_values_is_no_table() {
    let tables = [
        "tick",
        "boards",
        "sweep",
        "conditioning",
        "profile",
        "profiles",
        "socket",
        "control",
        "realtime",
        "can",
        "joints",
    ];
    let lists = tables.map(|table| (3, format!("{table} = []\n{BUSES}")));
    let joints = |line: &str| format!("{BUSES}[joints]\nsource = 'dynamixel:/dev/a'\n\n{line}\n");
    let more = [
        (3, "bus = [['can:can0'], ['can:can1']]\n".to_owned()),
        (10, joints("servo = [[1, 'a']]")),
        (10, joints("allegro = [4]")),
        (10, joints("analogue = ['/dev/b']")),
        (
            10,
            joints("analogue = { device = '/dev/b', joint = [['a', 0, [0, 1], [0, 1]]] }"),
        ),
    ];
    for (line, text) in lists.into_iter().chain(more) {
        let text = format!("layout = 'allegro-uskin-15'\n\n{text}");
        let error = Config::parse(&text, Path::new("hand.toml"))
            .expect_err(&text)
            .to_string();
        let place = format!("hand.toml:{line}: ");
        assert!(
            error.starts_with(&place)
                && error.contains("a table")
                && error.contains("is wanted here, not a list"),
            "{error}\n{text}"
        );
    }
}

const OFFLINE: &str = "
protocol = \"offline\"
order = [[0, 1, 2, 3], [4, 5, 6, 7], [8, 9, 10, 11], [12, 13, 14, 15]]
";

const BUSES: &str = "[[bus]]\nsource = 'can:can0'\n[[bus]]\nsource = 'can:can1'\n";

#[test]
fn modules_without_a_board_are_told_since_nothing_of_them_comes_live() {
    let of = |offline: &[usize]| {
        let text = Layout::builtin_text("allegro-uskin-15").unwrap();
        let modules: Vec<&str> = text.split("[[module]]").collect();
        let mut own = modules[0].to_owned();
        for (index, module) in modules[1..].iter().enumerate() {
            let wired = |line: &&str| {
                !["bus ", "board ", "protocol "]
                    .iter()
                    .any(|key| line.starts_with(key))
            };
            own += "[[module]]\n";
            own += &match offline.contains(&index) {
                true => module.lines().filter(wired).collect::<Vec<_>>().join("\n") + OFFLINE,
                false => (*module).to_owned(),
            };
        }
        let mut config = Config::parse(BUSES, Path::new("hand.toml")).unwrap();
        config.layout = Layout::parse(&own, "own.toml").unwrap_or_else(|e| panic!("{e}\n{own}"));
        let said = config.boardless_modules();
        let is_shown = said.as_ref().map(|said| config.summary().contains(said));
        assert_ne!(is_shown, Some(false), "a check says it");
        said
    };
    assert_eq!(of(&[]), None);
    let one = of(&[2]).unwrap();
    assert!(
        one.starts_with("module ") && one.contains(" has no board"),
        "{one}"
    );
    let many = of(&[0, 1, 2, 3, 4]).unwrap();
    assert!(
        many.starts_with("modules ") && many.contains(" and 2 more have no board"),
        "{many}"
    );
}
