//! The `[joints]` table beside the rest of the configuration: what goes together, and the line of
//! what does not.

use std::path::Path;
use taxel_config::Config;
use taxel_skin::Layout;

fn parse(bus: &str, joints: &str) -> Result<Config, String> {
    let text = format!("layout = \"allegro-uskin-15\"\n\n{bus}\n{joints}");
    Config::parse(&text, Path::new("taxeld.toml")).map_err(|e| e.to_string())
}

const BUSES: &str = "[[bus]]\nsource = \"can:can0\"\n[[bus]]\nsource = \"can:can1\"\n";
const SERVOS: &str =
    "[joints]\nsource = \"dynamixel:/dev/ttyUSB0\"\n[[joints.servo]]\nid = 1\nname = \"a\"\n";

#[test]
fn servos_are_read_beside_live_buses_and_not_beside_a_recording() {
    let config = parse(BUSES, SERVOS).unwrap();
    assert_eq!(config.joints.as_ref().unwrap().joint_names(), ["a"]);
    assert_eq!(config.joints_bus(), None);
    let error = parse(&BUSES.replace("can:can1", "log:a.log"), SERVOS).unwrap_err();
    for part in [
        "taxeld.toml:8:",
        "/dev/ttyUSB0",
        "log:a.log",
        "leave [joints] out",
    ] {
        assert!(error.contains(part), "{part}: {error}");
    }
}

#[test]
fn a_wrong_joints_table_is_refused_with_its_line() {
    for (joints, parts) in [
        (SERVOS.replace("name", "nmae"), ["taxeld.toml:12:", "nmae"]),
        (SERVOS.replace("id = 1", "id = 253"), ["taxeld.toml:11:", "253"]),
        (
            SERVOS.replace("dynamixel:/dev/ttyUSB0", "serial"),
            ["taxeld.toml:9:", "dynamixel:DEVICE"],
        ),
        (
            "[joints]\nsource = \"allegro:can2\"\n".into(),
            ["taxeld.toml:9:", "version"],
        ),
        (
            "[joints]\nsource = \"allegro:sim:tap\"\nallegro.version = 4\n".into(),
            ["taxeld.toml:8:", "is a scene"],
        ),
        (
            "[joints]\nsource = \"allegro:can2\"\nallegro.version = 4\n[[joints.servo]]\nid = 1\nname = \"a\"\n".into(),
            ["taxeld.toml:8:", "no meaning with source allegro; leave it out"],
        ),
        (SERVOS.replace("[[", "baud = 300\n[["), ["taxeld.toml:8:", "joints.baud = 300"]),
    ] {
        let error = parse(BUSES, &joints).unwrap_err();
        for part in parts {
            assert!(error.contains(part), "{part}: {error}");
        }
    }
}

#[test]
fn a_hand_has_a_bus_of_its_own_or_shares_one_whose_ids_are_not_its_own() {
    let hand =
        |bus: &str, version| format!("[joints]\nsource = \"allegro:{bus}\"\nallegro.version = {version}\n");
    let own = parse(BUSES, &hand("can2", 4)).unwrap();
    let bus = own.joints_bus().unwrap();
    assert_eq!(
        (bus.index, bus.shared, bus.address),
        (2, false, "can:can2".parse().unwrap())
    );

    let error = parse(BUSES, &hand("can0", 4)).unwrap_err();
    for part in ["taxeld.toml:8:", "can:can0", "204", "a bus of its own"] {
        assert!(error.contains(part), "{part}: {error}");
    }

    // 710 to 71F and 201 are no identifiers of the hand.
    let text = "layout = \"uskin-module\"\n[[bus]]\nsource = \"can:can0\"\n";
    let shared = Config::parse(&format!("{text}{}", hand("can0", 3)), Path::new("taxeld.toml"));
    let Ok(shared) = shared else {
        panic!("{}", shared.unwrap_err());
    };
    let bus = shared.joints_bus().unwrap();
    assert_eq!((bus.index, bus.shared), (0, true));
}

#[test]
fn joints_of_the_layout_that_are_read_under_no_such_name_are_told_with_the_nearest() {
    let module = Layout::builtin_text("uskin-module").unwrap();
    let sentence = |joint: &str, joints: &str| {
        let text = format!("layout = \"uskin-module\"\n[[bus]]\nsource = \"can:can0\"\n{joints}");
        let mut config = Config::parse(&text, Path::new("taxeld.toml")).unwrap();
        let on_joint = format!("[[module]]\njoint = \"{joint}\"\n");
        config.layout = Layout::parse(&module.replacen("[[module]]\n", &on_joint, 1), "own.toml").unwrap();
        let sentence = config.unread_joints();
        let shown = sentence
            .as_ref()
            .map(|sentence| config.summary().contains(sentence));
        assert_ne!(shown, Some(false), "a check says it");
        sentence
    };
    let named = |name: &str| SERVOS.replace("\"a\"", &format!("\"{name}\""));
    for (joint, joints, said) in [
        ("thumb 2", named("thumb 2"), None),
        (
            "thumb 2",
            named("thmb 2"),
            Some("does not read: `thumb 2` (there is `thmb 2`); "),
        ),
        ("thumb 2", named("servo 1"), Some("does not read: `thumb 2`; ")),
        // Without servos there is nothing to mend.
        ("thumb 2", String::new(), None),
    ] {
        let told = sentence(joint, &joints);
        let fits = said.map_or(told.is_none(), |said| {
            told.as_ref().is_some_and(|told| told.contains(said))
        });
        assert!(fits, "{joint} {joints}: {told:?}");
    }
}
