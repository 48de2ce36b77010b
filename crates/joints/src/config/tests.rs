//! How the `[joints]` table is read and written, and what of it is refused in which words.

use super::*;

fn read(text: &str) -> Result<JointsConfig, String> {
    let config: JointsConfig = toml::from_str(text).map_err(|e| e.message().to_string())?;
    config.check().map_err(|e| e.to_string())?;
    Ok(config)
}

const TWO: &str = r#"
    source = "dynamixel:/dev/ttyUSB0"
    [[servo]]
    id = 1
    name = "a"
    [[servo]]
    id = 2
    name = "b"
"#;

#[test]
fn a_short_table_is_read_only_at_1_mbit_s() {
    let config = read(TWO).unwrap();
    let JointSource::Dynamixel(config) = config.source else {
        panic!("{config:?}");
    };
    assert_eq!((config.baud, config.allow_writes), (1_000_000, false));
    assert_eq!(config.fast_sync_read, FastSyncRead::Auto);
    assert_eq!((config.servo[1].direction, config.servo[1].homing_rad), (1, 0.0));
}

#[test]
fn what_cannot_be_is_refused_in_words() {
    for (from, to, words) in [
        ("id = 2", "id = 1", "servo id 1 is given to both a and b"),
        (
            "id = 2",
            "id = 253",
            "joints.servo[1].id = 253 is outside 0 to 252",
        ),
        ("\"b\"", "\"a\"", "the name \"a\", which is that of another"),
        ("\"b\"", "\" \"", "empty"),
        ("\"b\"", r#""b\n""#, r#"the name "b\n", which is no name"#),
        (
            "\"b\"",
            r#""\u001b[2J""#,
            r#"the name "\u{1b}[2J", which is no name"#,
        ),
        ("id = 2", "id = 2\ndirection = 0", "direction = 0; write 1, or -1"),
        (
            "id = 2",
            "id = 2\nhoming_rad = nan",
            "homing_rad = NaN is outside",
        ),
        (
            "source",
            "baud = 300\nsource",
            "joints.baud = 300 is outside 9600 to 10000000 bit/s",
        ),
        (
            "source",
            "rate_hz = 0\nsource",
            "rate_hz = 0 is outside 1 to 2000 Hz",
        ),
        ("source", "watchdog_ms = 50\nsource", "no multiple of 20"),
        (
            "source",
            "allow_writes = true\nanswer_margin_ms = 191\nsource",
            "watchdog_ms = 200 is shorter than joints.answer_margin_ms = 191 and a cycle of 10 ms",
        ),
        (
            "source",
            "allow_writes = true\nbaud = 57600\nanswer_margin_ms = 180\nsource",
            "answer_margin_ms = 180 and a cycle of 10 ms and 11.8 ms on the wire at 57600 bit/s",
        ),
        ("[[servo]]", "[allegro]\nversion = 4\n[[servo]]", "leave it out"),
    ] {
        let text = TWO.replacen(from, to, 2).replace("id = 2\nid", "id");
        let text = if from == "[[servo]]" || from == "source" {
            TWO.replacen(from, to, 1)
        } else {
            text
        };
        let message = read(&text).unwrap_err();
        assert!(message.contains(words), "{to}: {message}");
    }
}

const POTENTIOMETERS: &str = r#"
    [analogue]
    device = "/dev/ttyACM0"
    [[analogue.joint]]
    name = "left p"
    channel = "p0"
    counts = [100, 900]
    degrees = [0, 80]
    [[analogue.joint]]
    name = "right p"
    channel = 1
    counts = [900, 100]
    degrees = [0, 80]
"#;

#[test]
fn potentiometers_come_behind_the_joints_of_the_source() {
    let config = read(&format!("{TWO}{POTENTIOMETERS}")).unwrap();
    assert_eq!(config.joint_names(), ["a", "b", "left p", "right p"]);
    let analogue = config.analogue.unwrap();
    assert_eq!((analogue.baud, analogue.ends), (115_200, [0.0, 1023.0]));
    assert_eq!(analogue.joint[1].angle_rad(300.0).to_degrees().round(), 60.0);
}

#[test]
fn potentiometers_that_cannot_be_are_refused_in_words() {
    for (from, to, words) in [
        ("\"left p\"", "\"b\"", "the name \"b\" is that of another"),
        ("\"left p\"", r#""left\tp""#, r#"the name "left\tp" is no name"#),
        (
            "\"right p\"",
            "\"left p\"",
            "the name \"left p\" is that of another",
        ),
        (
            "channel = 1",
            "channel = \"p0\"",
            "channel p0 is given to both left p and right p",
        ),
        ("channel = 1", "channel = \"p 1\"", "\"p 1\" is no channel"),
        ("channel = 1", "channel = \"1\"", "\"1\" is no channel"),
        ("[100, 900]", "[100, 100]", "both counts of left p are 100"),
        (
            "[100, 900]",
            "[100, 2000]",
            "joint[0].counts[1] = 2000 is outside 0 to 1023",
        ),
        ("[100, 900]", "[nan, 900]", "joint[0].counts[0] = NaN"),
        ("device", "ends = [5, 5]\ndevice", "ends = [5, 5]"),
        (
            "device",
            "baud = 1\ndevice",
            "joints.analogue.baud = 1 is outside",
        ),
        (
            "/dev/ttyACM0",
            "/dev/ttyUSB0",
            r#"device = "/dev/ttyUSB0" is the servos' own"#,
        ),
    ] {
        let text = POTENTIOMETERS.replacen(from, to, 1);
        let message = read(&format!("{TWO}{text}")).unwrap_err();
        assert!(message.contains(words), "{to}: {message}");
    }
    let folder = tempfile::tempdir().unwrap();
    let [device, link] = ["tty", "by-id"].map(|name| folder.path().join(name));
    std::fs::write(&device, "").unwrap();
    std::os::unix::fs::symlink(&device, &link).unwrap();
    let [device, link] = [device, link].map(|path| path.display().to_string());
    let text = format!("{TWO}{POTENTIOMETERS}")
        .replace("/dev/ttyUSB0", &device)
        .replace("/dev/ttyACM0", &link);
    assert!(read(&text).unwrap_err().contains("is the servos' own"));
    let none = read(&format!("{TWO}[analogue]\ndevice = \"/dev/x\"\njoint = []")).unwrap_err();
    assert!(none.contains("no [[joints.analogue.joint]] tables"), "{none}");
}

#[test]
fn a_watchdog_that_is_too_short_for_the_bus_is_refused_without_an_answer_margin_too() {
    let of = |servos: u8, baud, watchdog_ms| DynamixelConfig {
        allow_writes: true,
        baud,
        watchdog_ms,
        ..DynamixelConfig::new("p", 1..=servos)
    };
    for (servos, baud, too_short, enough) in [
        (16, 57_600, &[20, 60, 80][..], 100),
        (1, 57_600, &[20], 40),
        (48, 57_600, &[200, 240], 260),
        (64, 57_600, &[200, 300], 320),
        (16, 1_000_000, &[20], 40),
        (64, 1_000_000, &[60], 80),
    ] {
        for watchdog_ms in too_short {
            let config = of(servos, baud, *watchdog_ms);
            let error = config.check().unwrap_err().to_string();
            let words = [
                format!("watchdog_ms = {watchdog_ms} is shorter than joints.answer_margin_ms = 4 and"),
                format!("it is to be {enough} or more"),
            ];
            assert!(words.iter().all(|words| error.contains(words)), "{error}");
            let read_only = DynamixelConfig {
                allow_writes: false,
                ..config
            };
            assert_eq!(read_only.check(), Ok(()));
        }
        assert_eq!(of(servos, baud, enough).check(), Ok(()), "{servos} at {baud}");
    }
}

#[test]
fn keys_of_another_source_are_refused_and_those_of_all_are_not() {
    let allegro = "source = \"allegro:can2\"\nallegro.version = 4\n";
    for key in [
        "baud = 57600",
        "rate_hz = 50",
        "fast_sync_read = \"off\"",
        "allow_writes = true",
        "watchdog_ms = 100",
        "answer_margin_ms = 2",
    ] {
        let message = read(&format!("{allegro}{key}")).unwrap_err();
        let name = key.split(' ').next().unwrap();
        let words = format!("joints: {name} has no meaning with source allegro; leave it out");
        assert!(message.contains(&words), "{message}");
    }
    let message = read(&format!("{TWO}[allegro]\nversion = 4")).unwrap_err();
    assert!(
        message.contains("[joints.allegro] has no meaning with source dynamixel"),
        "{message}"
    );
    let config = read(&format!("{allegro}hold_ms = 100\n")).unwrap();
    assert_eq!(read(&toml::to_string(&config).unwrap()).unwrap(), config);
}

#[test]
fn unknown_keys_and_sources_do_not_parse() {
    for (text, words) in [
        (TWO.replace("name", "nmae"), "nmae"),
        (
            TWO.replace("dynamixel:/dev/ttyUSB0", "dynamixel:"),
            "needs the serial device",
        ),
        (
            TWO.replace("dynamixel:/dev/ttyUSB0", "serial:/dev/ttyUSB0"),
            "write dynamixel:DEVICE",
        ),
        (
            TWO.replace("dynamixel:/dev/ttyUSB0", "allegro:a b"),
            "behind `allegro:`",
        ),
        (
            TWO.replace("[[servo]]", "fast_sync_read = \"maybe\"\n[[servo]]"),
            "maybe",
        ),
    ] {
        let error = toml::from_str::<JointsConfig>(&text).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
}

#[test]
fn a_source_is_written_as_it_is_read() {
    for text in [
        "dynamixel:/dev/ttyUSB0",
        "allegro:can:can2",
        "allegro:log:a.log?interface=can2",
    ] {
        let source: JointSource = text.parse().unwrap();
        assert_eq!(source.to_string(), text);
    }
    let short: JointSource = "allegro:can2".parse().unwrap();
    assert_eq!(short.to_string(), "allegro:can:can2");
}

#[test]
fn a_table_is_written_with_every_value_in_force_and_read_as_the_same() {
    for (text, wanted) in [
        (
            format!("{TWO}{POTENTIOMETERS}"),
            &[
                "hold_ms = 250.0",
                "baud = 1000000",
                "fast_sync_read = \"auto\"",
                "allow_writes = false",
                "watchdog_ms = 200",
                "homing_rad = 0.0",
                "baud = 115200",
                "channel = \"p0\"",
            ][..],
        ),
        (
            "source = \"allegro:can2\"\n[allegro]\nversion = 4".into(),
            &["own_bus = false", "enc_dir = [1, 1,"],
        ),
    ] {
        let config = read(&text).unwrap();
        let written = toml::to_string(&config).unwrap();
        for wanted in wanted {
            assert!(written.contains(wanted), "{wanted} in {written}");
        }
        assert_eq!(read(&written), Ok(config));
    }
}

#[test]
fn no_servo_and_too_many_are_refused() {
    for ids in [0, 65] {
        assert_eq!(
            JointsConfig::dynamixel("/dev/x", 0..ids).check(),
            Err(JointsConfigError::ServoCount(usize::from(ids)))
        );
    }
    JointsConfig::dynamixel("/dev/x", 0..64).check().unwrap();
}

#[test]
fn an_allegro_hand_needs_its_version() {
    let bare = r#"source = "allegro:can2""#;
    let config: JointsConfig = toml::from_str(bare).unwrap();
    assert_eq!(config.check(), Err(JointsConfigError::NoAllegro));
    for (version, good) in [(0, false), (1, true), (3, true), (4, true), (5, true), (6, false)] {
        let config: JointsConfig = toml::from_str(&format!("{bare}\nallegro.version = {version}")).unwrap();
        assert_eq!(config.check().is_ok(), good, "{version}");
    }
}
