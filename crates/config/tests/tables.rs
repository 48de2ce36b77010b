//! A table is keys with their values: what stands in a list in the order of the keys is refused with its line.

use std::path::Path;
use taxel_config::Config;

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

const BUSES: &str = "[[bus]]\nsource = 'can:can0'\n[[bus]]\nsource = 'can:can1'\n";
