//! What a configuration file is refused for, and where.

use std::path::PathBuf;
use taxeld::Config;

#[test]
fn configuration_errors_name_file_and_line() {
    let path = PathBuf::from("hand.toml");
    let two = "[[bus]]\nsource = \"udp:\"\n[[bus]]\nsource = \"udp:\"\n";
    let cases = [
        ("layout = 3\n", "hand.toml:1: "),
        ("layout = \"no-such-hand\"\n", "hand.toml:1: "),
        (
            "[[bus]]\nsource = \"udp:\"\n",
            "hand.toml:1: layout allegro-uskin-15 has 2 buses (can0, can1)",
        ),
        (
            "[[bus]]\nsource = \"usb:3\"\n",
            "hand.toml:2: `usb:3` is not a CAN source",
        ),
        (
            &format!("{two}[tick]\nrate_hz = 2000.0\n"),
            "hand.toml:5: tick.rate_hz = 2000",
        ),
        (
            &format!("{two}[tick]\nmode = \"when\"\n"),
            "hand.toml:6: unknown variant `when`",
        ),
        (
            &format!("{two}[profile]\nlevels = 0\n"),
            "hand.toml:5: profile: levels = 0",
        ),
        (
            &format!("{two}[profiles]\nmax = 0\n"),
            "hand.toml:5: profiles.max = 0",
        ),
        (
            &format!("{two}[profiles]\nbudget_percent = 120.0\n"),
            "hand.toml:5: profiles.budget_percent = 120",
        ),
        (
            &format!("{two}[socket]\nmode = \"0999\"\n"),
            "hand.toml:5: socket.mode",
        ),
        (
            &format!("{two}\n\nspeed = 3\n"),
            "hand.toml:7: unknown field `speed`",
        ),
        (
            &format!("{two}[conditioning]\nwindow = 3\n"),
            "hand.toml:6: unknown field `window`",
        ),
    ];
    for (text, expected) in cases {
        let error = Config::parse(text, &path).expect_err(text).to_string();
        assert!(
            error.starts_with(expected),
            "{text:?}\n  gave     {error}\n  expected {expected}"
        );
    }
    Config::parse(two, &path).unwrap();
}
