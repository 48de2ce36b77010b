//! `docs/configuration.md`, and the file that `taxel config init` writes, are what the code says.
//!
//! `TAXEL_UPDATE=1 cargo test -p taxel-config --test page` writes both anew.

#[path = "page/source.rs"]
mod source;

use serde::Serialize;
use source::{Key, Source};
use std::path::Path;
use taxel_config::Config;
use taxel_config::{ANNOTATED, CanConfig, ControlConfig, RealtimeConfig, SocketConfig};
use taxel_hand::Profile;
use taxel_skin::{BoardsConfig, ConditionConfig, Layout, SweepConfig};

const FILES: [&str; 13] = [
    "crates/config/src/lib.rs",
    "crates/config/src/sockets.rs",
    "crates/engine/src/config.rs",
    "crates/serve/src/config.rs",
    "crates/hand/src/profile.rs",
    "crates/skin/src/boards/config.rs",
    "crates/skin/src/sweep/config.rs",
    "crates/skin/src/condition/config.rs",
    "crates/skin/src/condition/magnitude.rs",
    "crates/joints/src/config.rs",
    "crates/joints/src/dynamixel/config.rs",
    "crates/joints/src/allegro/config.rs",
    "crates/joints/src/analogue/config.rs",
];

/// A table of the file with its keys and their defaults.
struct Table {
    name: &'static str,
    about: String,
    keys: Vec<(Key, Option<toml::Value>)>,
    /// Without it nothing of it is in force.
    optional: bool,
}

fn defaults(value: impl Serialize) -> toml::Table {
    toml::Table::try_from(value).unwrap()
}

/// Where the sockets are depends on the user; in the page they are those of the service.
fn socket() -> SocketConfig {
    SocketConfig {
        images: "/run/taxeld/images.sock".into(),
        control: "/run/taxeld/control.sock".into(),
        ..SocketConfig::default()
    }
}

fn tables() -> Vec<Table> {
    let source = Source::read(&FILES);
    let table = |name, of: &str, known: toml::Table| {
        let keys = source.keys(of).into_iter().map(|key| {
            let default = known.get(&key.name).cloned();
            (key, default)
        });
        Table {
            name,
            about: match of {
                "settings" => source.about("ConditionSettings"),
                _ => source.about(of),
            },
            keys: keys.collect(),
            optional: false,
        }
    };
    let mut conditioning = table("[conditioning]", "settings", defaults(ConditionConfig::robust()));
    conditioning.keys.insert(
        0,
        (
            source
                .keys("ConditionSettings")
                .into_iter()
                .find(|key| key.name == "preset")
                .unwrap(),
            Some("robust".into()),
        ),
    );
    let config = Config::new(Layout::builtin("uskin-module").unwrap(), Vec::new());
    let joints = |name, of| Table {
        optional: true,
        ..table(name, of, joint_defaults())
    };
    let mut servos = joints("[joints]", "DynamixelConfig");
    servos.about =
        "Where joint angles come from; without this table none are read. Servos of Dynamixel:".into();
    // What the table writes as text, or as tables of their own.
    servos
        .keys
        .retain(|(key, _)| !["path", "servo"].contains(&key.name.as_str()));
    servos.keys.splice(0..0, joints("", "JointsConfig").keys);
    servos.keys.retain(|(key, _)| key.name != "analogue");
    let mut potentiometers = Table {
        optional: true,
        ..table(
            "[joints.analogue]",
            "AnalogueConfig",
            toml::from_str("baud = 115200\nends = [0.0, 1023.0]\n").unwrap(),
        )
    };
    potentiometers.keys.retain(|(key, _)| key.name != "joint");
    vec![
        table("[tick]", "TickConfig", defaults(config.tick)),
        table("[boards]", "BoardsConfig", defaults(BoardsConfig::default())),
        table("[sweep]", "SweepConfig", defaults(SweepConfig::default())),
        conditioning,
        table("[profile]", "Profile", defaults(Profile::default())),
        table("[profiles]", "ProfilesConfig", defaults(config.profiles)),
        table("[socket]", "SocketConfig", defaults(socket())),
        table("[control]", "ControlConfig", defaults(ControlConfig::default())),
        table(
            "[realtime]",
            "RealtimeConfig",
            defaults(RealtimeConfig::default()),
        ),
        table("[can]", "CanConfig", defaults(CanConfig::default())),
        servos,
        joints("[[joints.servo]]", "ServoConfig"),
        joints("[joints.allegro]", "AllegroConfig"),
        potentiometers,
        joints("[[joints.analogue.joint]]", "AnalogueJointConfig"),
    ]
}

/// Joints are only read, so their defaults are told here; a test below checks them.
fn joint_defaults() -> toml::Table {
    toml::from_str(JOINT_DEFAULTS).unwrap()
}

const JOINT_DEFAULTS: &str = "hold_ms = 250.0\nbaud = 1000000\nrate_hz = 100.0\nfast_sync_read = \"auto\"\n\
    allow_writes = false\nwatchdog_ms = 200\nhoming_rad = 0.0\ndirection = 1\ndevice = 0\nown_bus = false\n\
    enc_dir = [1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1]\n\
    enc_offset = [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]\n";

const INTRODUCTION: &str = "\
# Configuration

Every key of the daemon's configuration file, with its default. This page is made from the comments in the code by
`TAXEL_UPDATE=1 cargo test -p taxel-config --test page`; [the guide](guide.md#configure) says what to do with
it. `taxel config init` writes a file with all of it to start from, `taxel config check FILE` says what is wrong with
one, and `taxel config show FILE` prints every value in force.

Only `[[bus]]` is required, and only by what reads a bus:

| key | default | meaning |
|---|---|---|
| `layout` | `\"allegro-uskin-15\"` | The hand: a built-in one (`taxel layouts`), or a layout file, beside this file or with its path. |
| `[[bus]]` `source` | | One table for each bus of the layout, in its order: `can:INTERFACE`, `udp:GROUP:PORT`, `log:FILE` (the interface of the bus's name, or the only one; `?interface=can1` for another; without a folder, in the one in which taxeld is started), `sim:SCENE`; for a pressure array the socket that its frames are sent to, `pressure:PATH`. |
";

fn page() -> String {
    let mut text = INTRODUCTION.to_owned();
    for table in tables() {
        text += &format!("\n## {}\n\n{}\n\n", table.name, table.about);
        text += "| key | default | meaning |\n|---|---|---|\n";
        for (key, default) in &table.keys {
            let default = default
                .as_ref()
                .map_or_else(String::new, |value| format!("`{value}`"));
            let meaning = key.meaning.replace('|', "\\|");
            text += &format!("| `{}` | {default} | {meaning} |\n", key.name);
        }
    }
    text
}

/// The tables as TOML: every key with its default behind `#`, below what it means.
fn annotated() -> String {
    let mut text = String::new();
    for table in tables() {
        let off = if table.optional { "#" } else { "" };
        text += &format!("\n{}{off}{}\n", wrapped(&table.about), table.name);
        for (key, default) in &table.keys {
            text += &wrapped(&key.meaning);
            text += &match default {
                Some(value) => format!("#{} = {value}\n", key.name),
                None => format!("#{} =\n", key.name),
            };
        }
    }
    text
}

/// A comment of TOML, at most 100 columns wide.
fn wrapped(text: &str) -> String {
    let mut lines = vec![String::from("#")];
    for word in text.split_whitespace() {
        let line = lines.last_mut().unwrap();
        if line.len() + 1 + word.len() > 100 {
            lines.push(format!("# {word}"));
        } else {
            *line += &format!(" {word}");
        }
    }
    lines.join("\n") + "\n"
}

fn is_up_to_date(file: &str, wanted: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
    if std::env::var_os("TAXEL_UPDATE").is_some() {
        return std::fs::write(path, wanted).unwrap();
    }
    let found = std::fs::read_to_string(path).unwrap_or_default();
    let differs = found.lines().zip(wanted.lines()).position(|(a, b)| a != b);
    assert!(
        found == wanted,
        "{file}:{} is not what the code says; TAXEL_UPDATE=1 cargo test -p taxel-config --test page",
        differs.map_or(0, |line| line + 1)
    );
}

#[test]
fn the_page_and_the_file_to_start_from_are_what_the_code_says() {
    is_up_to_date("../../docs/configuration.md", &page());
    is_up_to_date("src/annotated.toml", &annotated());
}

#[test]
fn every_key_that_the_daemon_reads_is_told_with_its_meaning() {
    for table in tables() {
        let mut told: Vec<&str> = table.keys.iter().map(|(key, _)| key.name.as_str()).collect();
        let heading = table.name.trim_matches(['[', ']']);
        let unknown = match heading.strip_prefix("joints") {
            None => format!("[{heading}]\nno_such_key = 0\n"),
            Some("") => "[joints]\nno_such_key = 0\n".into(),
            Some(".servo") => "[joints]\nsource = 'dynamixel:a'\n[[joints.servo]]\nno_such_key = 0\n".into(),
            Some(".allegro") => {
                "[joints]\nsource = 'allegro:can2'\n[joints.allegro]\nno_such_key = 0\n".into()
            }
            Some(table) => {
                let table = match table.matches('.').count() {
                    1 => format!("[joints{table}]"),
                    _ => format!("[[joints{table}]]"),
                };
                format!("[joints]\nsource = 'allegro:can2'\n{table}\nno_such_key = 0\n")
            }
        };
        let error = Config::parse(&unknown, Path::new("a.toml"))
            .unwrap_err()
            .to_string();
        let listed = error.split_once("; there ").expect(&error).1;
        let listed = listed.trim_start_matches("are ").trim_start_matches("is only ");
        let mut read: Vec<&str> = listed.split(", ").collect();
        // Tables of their own.
        read.retain(|key| match heading {
            "joints" => !["servo", "allegro", "analogue"].contains(key),
            "joints.analogue" => *key != "joint",
            _ => true,
        });
        told.sort_unstable();
        read.sort_unstable();
        assert_eq!(told, read, "{heading}");
        for (key, _) in &table.keys {
            assert!(key.meaning.len() > 3, "{heading}.{} has no comment", key.name);
        }
    }
}

#[test]
fn the_file_to_start_from_is_the_defaults_with_and_without_its_marks() {
    let head = "layout = \"uskin-module\"\n[[bus]]\nsource = \"udp:\"\n";
    let (stated, joints) = ANNOTATED.split_once("\n#[joints]").unwrap();
    let is_setting = |line: &&str| line.starts_with('#') && !line.starts_with("# ") && !line.ends_with('=');
    let lines = |text: &str| -> String {
        let settings = text.lines().map(|line| match is_setting(&line) {
            true => &line[1..],
            false => line,
        });
        settings.map(|line| format!("{line}\n")).collect()
    };
    let path = Path::new("a.toml");
    let bare = Config::parse(&format!("{head}{ANNOTATED}"), path).unwrap();
    let uncommented = lines(stated);
    let told = Config::parse(&format!("{head}{uncommented}"), path).expect(&uncommented);
    let mut wanted = Config::new(
        Layout::builtin("uskin-module").unwrap(),
        vec!["udp:".parse().unwrap()],
    );
    assert_eq!(format!("{bare:?}"), format!("{wanted:?}"));
    wanted.socket = socket();
    wanted.stated_conditioning = told.stated_conditioning.clone();
    assert_eq!(format!("{told:?}"), format!("{wanted:?}"));
    // Joints, as servos and as a hand.
    let joints = format!("[joints]{}", lines(joints));
    for (source, left_out) in [
        ("dynamixel:/dev/ttyUSB0", "joints.allegro]"),
        ("allegro:can2", "[joints.servo]]"),
    ] {
        let parts = joints.split("\n[");
        let parts = parts.filter(|part| !part.starts_with(left_out) && !part.contains("joints.analogue"));
        let mut text = parts.collect::<Vec<_>>().join("\n[");
        if source.starts_with("allegro") {
            // The keys of servos, the rest of the table, are refused beside a hand.
            let (before, rest) = text.split_once("# Bits per second").unwrap();
            text = format!("{before}\n[{}", rest.split_once("\n[").unwrap().1);
        }
        text = text.replacen("[joints]", &format!("[joints]\nsource = {source:?}"), 1);
        for (key, value) in [("id", "1"), ("name", "\"a\""), ("version", "4")] {
            text = text.replace(&format!("\n#{key} =\n"), &format!("\n{key} = {value}\n"));
        }
        let with = Config::parse(&format!("{head}{text}"), path).expect(&text);
        // The same as where nothing but what has no default is said.
        let least = match source.starts_with("allegro") {
            true => "[joints.allegro]\nversion = 4\n",
            false => "[[joints.servo]]\nid = 1\nname = \"a\"\n",
        };
        let least = format!("{head}[joints]\nsource = {source:?}\n{least}");
        let least = Config::parse(&least, path).unwrap();
        assert_eq!(format!("{:?}", with.joints), format!("{:?}", least.joints));
    }
}
