//! What a configuration file is refused for, and where; what it means.

mod refused;

use std::path::PathBuf;
use taxel_hand::Method;
use taxel_skin::{ConditionConfig, Preset};
use taxeld::Config;

#[test]
fn configuration_errors_name_file_and_line() {
    let path = PathBuf::from("hand.toml");
    let two = "[[bus]]\nsource = \"udp:\"\n[[bus]]\nsource = \"udp::43114\"\n";
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
            "[[bus]]\nsource = \"can:can0\"\n[[bus]]\nsource = \"can:can0\"\n",
            "hand.toml:4: can:can0 is given twice",
        ),
        (
            &two.replace("::43114", "::43113"),
            "hand.toml:4: udp:239.74.163.2:43113 is given twice",
        ),
        (
            "[[bus]]\nsource = \"log:a.log\"\n[[bus]]\nsource = \"log:a.log?interface=can0\"\n",
            "hand.toml:4: log:a.log?interface=can0 is given twice",
        ),
        (
            &format!("{two}[tick]\nrate_hz = 2000.0\n"),
            "hand.toml:6: tick.rate_hz = 2000",
        ),
        (
            &format!("{two}[tick]\nmode = \"when\"\n"),
            "hand.toml:6: unknown word `when`",
        ),
        (
            &format!("{two}[profile]\nlevels = 0\n"),
            "hand.toml:6: profile: levels = 0",
        ),
        (
            &format!("{two}[profiles]\nmax = 0\n"),
            "hand.toml:6: profiles.max = 0",
        ),
        (
            &format!("{two}[profiles]\nbudget_percent = 120.0\n"),
            "hand.toml:6: profiles.budget_percent = 120",
        ),
        (
            &format!("{two}[socket]\nmode = \"0999\"\n"),
            "hand.toml:6: socket.mode",
        ),
        (
            &format!("{two}\n\nspeed = 3\n"),
            "hand.toml:7: unknown key `speed`",
        ),
        (
            &format!("{two}[conditioning]\nwindow = 3\n"),
            "hand.toml:6: unknown key `window`; there are preset, ",
        ),
        (
            &format!("{two}[conditioning]\npreset = \"best\"\n"),
            "hand.toml:6: unknown word `best`",
        ),
        (
            "[bus]\nsource = \"can:can0\"\n",
            "hand.toml:1: write [[bus]], with two brackets",
        ),
        (
            "bus = \"can:can0\"\n",
            "hand.toml:1: write [[bus]], with two brackets",
        ),
        (
            "source = \"can:can0\"\n",
            "hand.toml:1: unknown key `source` here: it belongs below a line [[bus]]",
        ),
        (
            "rate_hz = 30.0\n",
            "hand.toml:1: unknown key `rate_hz`; there are layout, bus, ",
        ),
        (
            "calibration_ms = 30.0\n",
            "hand.toml:1: unknown key `calibration_ms` here: it belongs below a line [conditioning]",
        ),
        (
            &format!("{two}[tick]\nrate_hz = \"30\"\n"),
            "hand.toml:6: a number is wanted here, not the text \"30\"; leave out the quotes",
        ),
        (
            &format!("{two}[profile]\nlvels = 3\n"),
            "hand.toml:6: unknown key `lvels`; did you mean `levels`? There are method, ",
        ),
        (
            "layout = \"tekscan-6077\"\n[[bus]]\nsource = \"can:can0\"\n",
            "hand.toml:3: bus \"touch\" of layout tekscan-6077 is a pressure array, whose frames come over a Unix socket",
        ),
        (
            "layout = \"uskin-module\"\n[[bus]]\nsource = \"pressure:/run/touch.sock\"\n",
            "hand.toml:3: pressure:/run/touch.sock is for a pressure array, and bus \"can0\" of layout uskin-module has none",
        ),
        (
            &format!(
                "layout = \"tekscan-6077\"\n[[bus]]\nsource = \"pressure:/{}\"\n",
                "x".repeat(107)
            ),
            "hand.toml:3: socket path /xxx",
        ),
        (
            &format!("{two}[tick]\nrate_hz = 30,5\n"),
            "hand.toml:6: 30,5 has a decimal comma; write 30.5",
        ),
        (
            &format!("{two}[tick]\nrate_hz = 30\n[tick]\nmode = \"timer\"\n"),
            "hand.toml:7: the table [tick] is there twice",
        ),
        (
            "[bus]\nsource = \"udp:\"\n[bus]\nsource = \"udp::43114\"\n",
            "hand.toml:3: write [[bus]], with two brackets",
        ),
        (
            &format!("{two}[boards]\nsilence_ms = 200\nrestart_first_ms = 1000\n"),
            "hand.toml:7: boards: restart_first_ms = 1000 is outside 10 to 250 ms, the restart_longest_ms",
        ),
        (
            &format!("{two}[boards]\nrestart_longest_ms = 50\n"),
            "hand.toml:6: boards: restart_longest_ms = 50 is outside 100 to 600000 ms, from restart_first_ms on",
        ),
        (
            &format!("{two}[profile]\nactuators = 1\nfixed = [[1, 1, 9]]\n"),
            "hand.toml:7: a list of 2 is wanted here, not of 3",
        ),
        (
            &format!(
                "{two}[joints]\nsource = \"dynamixel:a\"\n[[joints.servo]]\nid = 1\nname = \"a\"\nhoming_rad = 180\n"
            ),
            "hand.toml:10: joints.servo[0].homing_rad = 180 is outside -6.3 to 6.3 rad (180 degrees are 3.1416)",
        ),
        (
            &format!(
                "{two}[joints]\nsource = \"allegro:can:can2\"\n[joints.allegro]\nversion = 4\nenc_dir = [{}1]\n",
                "1, ".repeat(17)
            ),
            "hand.toml:9: a list of 16 is wanted here, not of 18",
        ),
        (
            "layout = \"uskin-modul\"\n",
            "hand.toml:1: there is no layout \"uskin-modul\": it is neither a file nor built in",
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
    let array = "layout = \"tekscan-6077\"\n[[bus]]\nsource = \"pressure:/run/touch.sock\"\n";
    for text in [
        array.to_owned(),
        array.replace("pressure:", "log:"),
        array.replace("pressure:/run/", "sim:"),
    ] {
        Config::parse(&text, &path).unwrap();
    }
}

#[test]
fn conditioning_is_that_of_the_method_unless_the_file_says_otherwise() {
    let buses = "[[bus]]\nsource = \"udp:\"\n[[bus]]\nsource = \"udp::43114\"\n";
    let paper = "[profile]\nmethod = \"paper\"\n";
    let (papers, robust) = (ConditionConfig::paper(), ConditionConfig::robust());
    let with_margin = |config: &ConditionConfig| ConditionConfig {
        threshold_margin: 2.0,
        ..config.clone()
    };
    for (text, want) in [
        ("", &robust),
        (paper, &papers),
        ("[conditioning]\npreset = \"paper\"\n", &papers),
        (&format!("[conditioning]\npreset = \"robust\"\n{paper}"), &robust),
        (
            &format!("[conditioning]\nthreshold_margin = 2.0\n{paper}"),
            &with_margin(&papers),
        ),
        (
            "[conditioning]\nthreshold_margin = 2.0\npreset = \"paper\"\n",
            &with_margin(&papers),
        ),
    ] {
        let config = Config::parse(&format!("{buses}{text}"), &PathBuf::from("hand.toml")).expect(text);
        assert_eq!(config.conditioning, *want, "{text}");
    }
    let mut config = Config::parse(
        &format!("{buses}[conditioning]\nthreshold_margin = 2.0\n"),
        &PathBuf::from("hand.toml"),
    )
    .expect("a configuration");
    config.set_method(Method::Paper, None);
    assert_eq!(config.conditioning, with_margin(&papers));
    config.set_method(Method::Paper, Some(Preset::Robust));
    assert_eq!(config.conditioning, with_margin(&robust));
}
