use super::super::finding::State;
use super::*;
use serde_json::{Value, json};
use taxel_joints::JointsConfig;

fn running() -> Value {
    json!({
        "version": "0.1.0", "uptime_s": 12.0, "layout": "uskin-module", "calibrating": false,
        "images": { "rate_hz": 30.0, "overruns": 0 },
        "buses": [{ "name": "can0", "source": "can:can0", "link": "up", "state": "error-active", "received": 9,
                    "lost_in_kernel": 0, "errors": { "frames": 3, "lost_arbitration": 3 } }],
        "boards": [{ "module": "module", "bus": "can0", "board": 1, "state": "living", "period_ms": 20.0 }],
        "faults": [{ "taxel": 5, "module": "module", "k": 5, "reasons": ["dead"] }],
    })
}

fn parsed(status: Value) -> Status {
    serde_json::from_value(status).unwrap()
}

fn bad(status: Value) -> Vec<Check> {
    let checks = check(&parsed(status)).into_iter();
    checks.filter(|c| c.state != State::Ok).collect()
}

#[test]
fn a_daemon_has_what_was_named_if_it_reads_one_of_its_buses_or_its_joints() {
    let mut status = running();
    status["buses"][0]["source"] = "udp:239.74.163.2:43113?hops=0".into();
    status["joints"] = json!({ "source": "dynamixel:/dev/ttyUSB0" });
    let status = parsed(status);
    let layout = || Layout::builtin("uskin-module").unwrap();
    for (source, joints, has) in [
        ("udp:239.74.163.2:43113", None, true),
        ("udp:239.74.163.2:43114", None, false),
        ("can:can0", None, false),
        ("can:can0", Some("dynamixel:/dev/ttyUSB0"), true),
        ("can:can0", Some("dynamixel:/dev/ttyUSB1"), false),
    ] {
        let mut config = Config::new(layout(), vec![source.parse().unwrap()]);
        config.joints = joints.map(|source: &str| JointsConfig::new(source.parse().unwrap()));
        assert_eq!(has_any(&status, &config), has, "{source} {joints:?}");
    }
    // The port by another link.
    let dir = tempfile::tempdir().unwrap();
    let [port, by_id] = ["ttyUSB0", "usb-FTDI"].map(|name| dir.path().join(name));
    std::fs::write(&port, "").unwrap();
    std::os::unix::fs::symlink(&port, &by_id).unwrap();
    let mut linked = running();
    linked["joints"] = json!({ "source": format!("dynamixel:{}", port.display()) });
    let mut config = Config::new(layout(), vec!["can:can1".parse().unwrap()]);
    config.joints = Some(JointsConfig::new(
        format!("dynamixel:{}", by_id.display()).parse().unwrap(),
    ));
    assert!(has_any(&parsed(linked), &config));
    // A recording is nobody's.
    let mut of_a_recording = running();
    of_a_recording["buses"][0]["source"] = "log:tap.log".into();
    let config = Config::new(layout(), vec!["log:tap.log".parse().unwrap()]);
    assert!(!has_any(&parsed(of_a_recording), &config));
}

#[test]
fn what_a_daemon_reads_is_known_by_its_status() {
    let mut status = running();
    status["buses"][0]["source"] = "udp:239.74.163.2:43113".into();
    let status = parsed(status);
    assert_eq!(
        describe(&status),
        "hand uskin-module on can0 = udp:239.74.163.2:43113"
    );
    assert_eq!(sources(&status), ["udp:239.74.163.2:43113".parse().unwrap()]);
    assert_eq!(describe(&parsed(running())), "hand uskin-module on can:can0");
}

#[test]
fn what_a_running_daemon_says_becomes_findings() {
    let bad = bad(running());
    assert_eq!(bad.len(), 1, "{bad:?}");
    assert_eq!(
        (bad[0].object.as_str(), bad[0].found.as_str()),
        ("module k 5", "dead")
    );
    let checks = check(&parsed(running()));
    assert!(checks.iter().any(|c| c.name == "board" && c.found == "50.0 Hz"));

    let mut status = running();
    status["buses"][0]["lost_in_kernel"] = 4.into();
    status["boards"][0]["state"] = "silent".into();
    status["images"]["overruns"] = 2.into();
    status["paused"] = true.into();
    let checks = check(&parsed(status));
    for (name, state) in [
        ("counts", State::Warning),
        ("board", State::Warning),
        ("overruns", State::Warning),
        ("paused", State::Warning),
    ] {
        assert!(
            checks.iter().any(|c| c.name == name && c.state == state),
            "{name}: {checks:?}"
        );
    }
}

#[test]
fn what_a_running_daemon_tells_is_told_once_and_in_its_own_words() {
    let sentence = "module (can0 board 1) is silent; check its power and cable";
    let mut status = running();
    status["faults"] = json!([]);
    status["boards"][0]["state"] = "silent".into();
    status["boards"][0]["problems"] = json!(["board-silent"]);
    status["problems"] = json!([{ "kind": "board-silent", "bus": "can0", "module": "module", "severe": true,
                                  "sentence": sentence }]);
    let checks = bad(status);
    let told: Vec<_> = checks
        .iter()
        .map(|c| (c.state, c.name.as_ref(), c.found.as_str()))
        .collect();
    assert_eq!(told, [(State::Error, "board-silent", sentence)]);

    // A lost bus: nothing of its boards, nothing else of itself.
    let sentence = "can0: the interface can0 is down; `ip link set can0 up`";
    let mut status = running();
    status["faults"] = json!([]);
    status["boards"][0]["state"] = "silent".into();
    status["buses"][0]["link"] = "down".into();
    status["buses"][0]["problems"] = json!(["link-down"]);
    status["problems"] =
        json!([{ "kind": "link-down", "bus": "can0", "severe": true, "sentence": sentence }]);
    let checks = bad(status);
    let told: Vec<_> = checks
        .iter()
        .map(|c| (c.state, c.name.as_ref(), c.found.as_str()))
        .collect();
    assert_eq!(told, [(State::Error, "link-down", sentence)]);
}

#[test]
fn joints_that_are_well_are_told() {
    let joint = |id: Option<u8>, angle_rad: Option<f64>, problems: Value| {
        let mut joint = json!({ "name": "a", "angle_rad": angle_rad, "problems": problems });
        if let Some(id) = id {
            joint["id"] = id.into();
        }
        joint
    };
    let servo = |id| joint(Some(id), Some(0.5), json!([]));
    let other = || joint(None, Some(0.5), json!([]));
    let lost = joint(Some(3), Some(0.5), json!(["servo-silent"]));
    let allegro = json!({ "positions": [1, 1, 1, 1] });
    for (joints, more, wanted) in [
        (
            json!([servo(1), servo(2), other(), other()]),
            &json!({}),
            Some("2 servos and 2 potentiometers report"),
        ),
        (json!([servo(1), lost]), &json!({}), Some("1 servo reports")),
        (json!([joint(Some(1), None, json!([]))]), &json!({}), None),
        (json!([other(), other()]), &allegro, Some("2 joints report")),
    ] {
        let mut status = running();
        status["joints"] = more.clone();
        status["joints"]["joints"] = joints;
        let checks = check(&parsed(status));
        let told = checks.iter().find(|check| check.name == "joints");
        assert_eq!(
            told.map(|check| (check.state, check.found.as_str())),
            wanted.map(|words| (State::Ok, words))
        );
    }
}

#[test]
fn faults_are_drawn_where_the_layout_is_the_daemons() {
    let layout = Layout::builtin("uskin-module").unwrap();
    let marks = marks(&parsed(running()), &layout).unwrap();
    assert_eq!(marks.iter().filter(|m| m.is_some()).count(), 1);
    assert_eq!(marks[5], Some('D'));
    let mut status = running();
    status["saturated"] = json!([{ "taxel": 3, "module": "module", "k": 3, "reasons": ["saturated"] }]);
    assert_eq!(
        super::marks(&parsed(status.clone()), &layout).unwrap()[3],
        Some('X')
    );
    status["faults"] = json!([{ "taxel": 4, "module": "module", "k": 4, "reasons": ["missing"] }]);
    let told = |status: &Value| -> Vec<(String, String)> {
        let checks = bad(status.clone()).into_iter();
        checks.map(|c| (c.object, c.found)).collect()
    };
    let missing = ("module k 4".to_owned(), "missing".to_owned());
    let mut silent = status.clone();
    silent["boards"][0]["state"] = "silent".into();
    assert!(!told(&silent).contains(&missing), "{:?}", told(&silent));
    let told = told(&status);
    assert!(told.contains(&missing), "{told:?}");
    assert!(
        told.contains(&("module k 3".into(), "saturated".into())),
        "{told:?}"
    );
    assert!(super::marks(&parsed(running()), &Layout::builtin("cpm-finger").unwrap()).is_none());
}

#[test]
fn nobody_at_the_socket_is_told_from_something_strange() {
    let dir = tempfile::TempDir::new().unwrap();
    let path = dir.path().join("status.sock");
    assert!(matches!(ask(&path), Daemon::Absent));
    let listener = std::os::unix::net::UnixListener::bind(&path).unwrap();
    std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        // One that closes before it is asked breaks the pipe, which is strange too, but in other words.
        BufReader::new(&stream).read_line(&mut String::new()).unwrap();
        stream.write_all(b"hello\n").unwrap();
    });
    assert!(matches!(ask(&path), Daemon::Strange(why) if why.contains("no JSON")));
}
