//! `taxel setup` without anybody to press a module: what it writes for boards that were heard, and what it refuses.

use crate::{command, config, fails, simulated, succeeds, taxel, texts};
use serde_json::Value;
use std::fs;
use std::net::UdpSocket;
use taxel_skin::Layout;
use taxeld::Daemon;
use tempfile::TempDir;

/// A recording of a built-in hand, as both its buses are named on the command line.
fn recording(layout: &str) -> (TempDir, String) {
    let dir = TempDir::new().unwrap();
    succeeds(
        &dir,
        &[
            "sim",
            "roll",
            "--layout",
            layout,
            "--to",
            "log:hand.log",
            "--seconds",
            "1",
        ],
    );
    (dir, "log:hand.log".into())
}

#[test]
fn a_built_in_hand_is_known_by_its_boards_and_needs_no_layout_file() {
    let (dir, log) = recording("allegro-uskin-15");
    let (_, said) = succeeds(&dir, &["setup", "--yes", &log]);
    assert!(
        said.contains("8 boards of uskin-l2") && said.contains("sudo systemctl enable"),
        "{said}"
    );
    let config = taxeld::Config::load(&dir.path().join("taxeld.toml")).unwrap();
    assert_eq!(config.layout.name, "allegro-uskin-15");
    // Eight boards on a bus would send more than it carries.
    assert_eq!(config.boards.trigger_hz, 49.0);
    assert!(!dir.path().join("hand.toml").exists());
}

#[test]
fn boards_of_no_known_hand_are_taken_as_they_were_heard() {
    let (dir, log) = recording("uskin-module");
    succeeds(
        &dir,
        &["setup", "--yes", "--layout", "new", "--out", "a.toml", &log],
    );
    let layout = Layout::load(&dir.path().join("hand.toml")).unwrap();
    assert_eq!(
        (layout.name.as_str(), layout.modules.len(), layout.len()),
        ("a", 1, 16)
    );
    // A layout of one module that has other taxels is no question of where to press.
    let said = fails(&dir, &["setup", "--yes", "--layout", "icub-forearm", &log], 1);
    assert!(
        said.contains("whose 16 taxels are not the 80 of") && !said.contains("--touch"),
        "{said}"
    );
    // The next hand takes the next name.
    succeeds(
        &dir,
        &["setup", "--yes", "--layout", "new", "--out", "b.toml", &log],
    );
    assert_eq!(Layout::load(&dir.path().join("hand-2.toml")).unwrap().name, "b");
}

#[test]
fn what_is_said_of_one_bus_is_said_whole_of_another_that_is_the_same() {
    let (dir, log) = recording("icub-forearm");
    let path = dir.path().join("hand.log");
    let text = fs::read_to_string(&path).unwrap();
    let both = (text.lines()).map(|line| format!("{line}\n{}\n", line.replace(" can0 ", " can1 ")));
    fs::write(&path, both.collect::<String>()).unwrap();
    let (_, said) = succeeds(&dir, &["setup", "--yes", "--dry-run", "--layout", "new", &log]);
    // The ends of lines that were wrapped.
    for end in ["(discovery tells which)", "skin_type = 0, shift = 2,"] {
        assert_eq!(said.matches(end).count(), 2, "{end}: {said}");
    }
}

#[test]
fn the_layout_file_that_is_named_is_beside_the_configuration_and_goes_with_it_to_the_service() {
    let (dir, log) = recording("uskin-module");
    let at = |name: &str| dir.path().join(name);
    let text = Layout::builtin_text("uskin-module").unwrap();
    for folder in ["elsewhere", "here"] {
        fs::create_dir(at(folder)).unwrap();
        fs::write(at(folder).join("mine.toml"), text).unwrap();
    }
    let absolute = at("here/mine.toml").display().to_string();
    // Whose layout lies elsewhere gets a copy, and who has the file there already keeps it, however its folder is spelt.
    for (layout, out, copied) in [
        ("elsewhere/mine.toml", "taxeld.toml", "mine.toml"),
        ("elsewhere/mine.toml", "mine-2.toml", "mine-3.toml"),
        ("here/mine.toml", "here/taxeld.toml", ""),
        ("here/mine.toml", "./here/again.toml", ""),
        (&absolute, "here/absolute.toml", ""),
        ("./mine.toml", "again.toml", ""),
    ] {
        let (_, said) = succeeds(&dir, &["setup", "--yes", "--layout", layout, "--out", out, &log]);
        let (from, name) = match copied {
            "" => (layout, "mine.toml"),
            copied => (copied, copied),
        };
        assert_eq!(fs::read_to_string(at(from)).unwrap(), text);
        let config = fs::read_to_string(at(out)).unwrap();
        assert!(
            config.contains(&format!("\nlayout = \"{name}\"\n")),
            "{out}: {config}"
        );
        taxeld::Config::load(&at(out)).unwrap();
        let install = format!("sudo install -m 644 {from} /etc/taxeld/{name}\n");
        assert!(said.contains(&install), "{said}");
        assert_eq!(
            said.contains(&format!("{from} is written")),
            !copied.is_empty(),
            "{said}"
        );
    }
    assert_eq!(fs::read_dir(at("here")).unwrap().count(), 4);
}

#[test]
fn a_source_that_is_named_twice_is_one_bus() {
    let (dir, log) = recording("uskin-module");
    let (_, said) = succeeds(&dir, &["setup", "--yes", "--layout", "new", &log, &log]);
    let layout = Layout::load(&dir.path().join("hand.toml")).unwrap();
    assert_eq!(layout.buses.len(), 1, "{said}");
}

#[test]
fn a_dry_run_writes_nothing_and_prints_all_of_it() {
    let (dir, log) = recording("uskin-module");
    let arguments = ["setup", "--yes", "--dry-run", "--layout", "new", &log];
    let (files, _) = succeeds(&dir, &arguments);
    assert!(
        files.contains("# hand.toml:") && files.contains("# taxeld.toml:"),
        "{files}"
    );
    let (object, _) = succeeds(&dir, &[&arguments[..], &["--json"]].concat());
    let object: Value = serde_json::from_str(&object).unwrap();
    assert_eq!(object["written"], false);
    assert_eq!(object["modules"][0]["protocol"], "uskin-l1");
    Layout::parse(object["layout_file"].as_str().unwrap(), "hand.toml").unwrap();
    assert_eq!(
        fs::read_dir(dir.path()).unwrap().count(),
        1,
        "the recording alone"
    );
}

#[test]
fn what_cannot_be_done_is_refused_before_anything_is_written() {
    let (dir, log) = recording("uskin-module");
    fs::write(dir.path().join("mine.toml"), "mine").unwrap();
    for (arguments, named) in [
        (&["--yes", "--out", "mine.toml"][..], "--force"),
        // Before any question: nobody answers.
        (&["--out", "none/a.toml"], "none/a.toml: No such file"),
        (&["--yes", "--layout", "allegro-uskin-15"], "--layout new"),
        // Nobody answers.
        (&["--layout", "new", "--no-touch"], "--yes"),
    ] {
        let said = fails(&dir, &[&["setup", &log][..], arguments].concat(), 1);
        assert!(said.contains(named), "{arguments:?}: {said}");
    }
    assert!(fails(&dir, &["setup", "--yes", "sim:tap"], 1).contains("taxel sim"));
    let touched = fails(&dir, &["setup", "--yes", "--touch", &log], 2);
    assert!(
        touched.contains("--touch: nobody can press a recording"),
        "{touched}"
    );
    assert_eq!(fs::read_to_string(dir.path().join("mine.toml")).unwrap(), "mine");
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 2);
}

#[test]
fn where_the_kernel_has_no_can_setup_says_what_the_doctor_says() {
    let dir = TempDir::new().unwrap();
    // Lines are wrapped, and how long they are is the kernel's name.
    let in_one_line = |text: String| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let arguments = [
        "doctor",
        "--layout",
        "uskin-module",
        "--listen-only",
        "can:nosuch0",
    ];
    let report = in_one_line(texts(&taxel(&dir, &arguments)).0);
    let has_no_can = report.contains("has no CAN sockets");
    let said = in_one_line(fails(&dir, &["setup", "--yes", "can:nosuch0"], 1));
    assert_eq!(said.contains("has no CAN sockets"), has_no_can, "{said}");
    assert_ne!(said.contains("does not exist"), has_no_can, "{said}");
}

/// What `taxel setup` says of a bus beside the daemon that has its sockets in this folder; it finds no board there.
fn said_beside_a_daemon(dir: &TempDir, source: &str, options: &[&str]) -> String {
    let setup = ["setup", "--yes", "--dry-run", "--seconds", "0.1", source];
    let mut taxel = command(dir, &setup);
    taxel.args(options).env("RUNTIME_DIRECTORY", dir.path());
    let output = taxel.output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    texts(&output).1
}

#[test]
fn a_daemon_is_to_be_stopped_only_where_it_reads_one_of_the_buses() {
    let port = || UdpSocket::bind("0.0.0.0:0").unwrap().local_addr().unwrap().port();
    let udp = || format!("udp:239.74.163.2:{}?hops=0", port());
    let [first, second, other] = [udp(), udp(), udp()];
    let dir = TempDir::new().unwrap();
    let sources = [&first, &second].map(|source| source.parse().unwrap());
    let daemon = Daemon::start(config(dir.path(), sources)).unwrap();
    let listen_only = &["--listen-only"];
    let said = said_beside_a_daemon(&dir, &second, listen_only);
    assert!(
        said.contains("A daemon reads udp:") && said.contains("Ctrl-C"),
        "{said}"
    );
    assert!(said.contains("no board was recognised"), "{said}");
    // Nobody says that its boards are to be started all the same.
    let said = said_beside_a_daemon(&dir, &second, &[]);
    assert!(said.contains("starting and stopping its boards [no]"), "{said}");
    assert!(!said.contains("Ask for boards"), "{said}");
    let said = said_beside_a_daemon(&dir, &other, listen_only);
    assert!(!said.contains("A daemon"), "{said}");
    daemon.stop().unwrap();
    let daemon = simulated(dir.path(), "tap");
    let said = said_beside_a_daemon(&dir, &first, listen_only);
    assert!(!said.contains("A daemon"), "{said}");
    daemon.stop().unwrap();
}

#[test]
fn boards_with_a_few_taxels_are_those_of_the_layout_that_is_named() {
    let dir = TempDir::new().unwrap();
    let module = |name: &str, board, at| {
        format!(
            "[[module]]\nname = \"{name}\"\npart = \"p\"\nbus = \"can0\"\nboard = {board}\nprotocol = \"uskin-l2\"\n\
             at = [{at}, 0]\norder = [[0, 1]]\n"
        )
    };
    let head = "name = \"two\"\nimage = { width = 4, height = 1 }\nbuses = [\"can0\"]\n";
    let text = format!("{head}{}{}", module("a", 3, 0), module("b", 1, 2));
    fs::write(dir.path().join("two.toml"), text).unwrap();
    let sweeps: String = (0..50)
        .flat_map(|sweep| ["300", "301", "100", "101"].map(|id| (sweep, id)))
        .map(|(sweep, id)| format!("(0.{:06}) can0 {id}#0080008000800083\n", 20_000 * sweep))
        .collect();
    fs::write(dir.path().join("tips.log"), sweeps).unwrap();
    let setup = |layout| {
        [
            "setup",
            "log:tips.log",
            "--layout",
            layout,
            "--no-touch",
            "--joints",
            "none",
            "--yes",
        ]
    };
    let said = fails(&dir, &setup("new"), 1);
    assert!(said.contains("nobody known"), "{said}");
    let (_, said) = succeeds(&dir, &setup("two.toml"));
    assert!(
        said.contains("2 boards of uskin-l2: 1 (2), 3 (2)") && !said.contains("nobody known"),
        "{said}"
    );
    let config = taxeld::Config::load(&dir.path().join("taxeld.toml")).unwrap();
    assert_eq!(config.layout, Layout::load(&dir.path().join("two.toml")).unwrap());
    // Another board's.
    fs::remove_file(dir.path().join("taxeld.toml")).unwrap();
    let other = format!("{head}{}{}", module("a", 4, 0), module("b", 5, 2));
    fs::write(dir.path().join("two.toml"), other).unwrap();
    let said = fails(&dir, &setup("two.toml"), 1);
    assert!(said.contains("nobody known"), "{said}");
}

/// A layout of modules of one part, one below the other: address and `order` of each, and what it has besides.
fn layout_of(head: &str, module: &str, modules: &[(u8, &str)]) -> String {
    let mut text =
        format!("name = \"mine\"\nimage = {{ width = 40, height = 40 }}\nbuses = [\"can0\"]\n{head}");
    for (place, (board, order)) in modules.iter().enumerate() {
        text += &format!(
            "[[module]]\nname = \"m{place}\"\npart = \"p\"\nbus = \"can0\"\nboard = {board}\nat = [0, {}]\n{module}\norder = {order}\n",
            5 * place
        );
    }
    text
}

/// A second of such boards.
fn recording_of(layout: &str) -> TempDir {
    let dir = TempDir::new().unwrap();
    fs::write(dir.path().join("real.toml"), layout).unwrap();
    let sim = [
        "sim",
        "roll",
        "--layout",
        "real.toml",
        "--to",
        "log:hand.log",
        "--seconds",
        "1",
    ];
    succeeds(&dir, &sim);
    dir
}

/// What is said, in one line each, where these boards are set up as this layout; `Err` where they are refused.
fn set_up_as(dir: &TempDir, layout: &str) -> Result<String, String> {
    fs::write(dir.path().join("mine.toml"), layout).unwrap();
    let taxel = taxel(
        dir,
        &[
            "setup",
            "--yes",
            "--force",
            "--layout",
            "mine.toml",
            "log:hand.log",
        ],
    );
    let said = texts(&taxel).1.split_whitespace().collect::<Vec<_>>().join(" ");
    match taxel.status.success() {
        true => Ok(said),
        false => Err(said),
    }
}

const CYSKIN: &str = "protocol = \"cyskin\"\nhub = \"hub\"";
const HUB: &str = "[[cyskin.hub]]\nname = \"hub\"\nbus = \"can0\"\naddress = 0x21\n";
/// Sensor 0 is the temperature.
const SENSORS: &str = "[[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]]";

#[test]
fn a_cyskin_hub_is_set_up_as_it_was_heard() {
    let dir = recording_of(&layout_of(HUB, CYSKIN, &[(0, SENSORS), (1, SENSORS)]));
    succeeds(&dir, &["setup", "--yes", "log:hand.log"]);
    let config = taxeld::Config::load(&dir.path().join("taxeld.toml")).unwrap();
    let hubs = &config.layout.cyskin.as_ref().unwrap().hubs;
    assert_eq!((hubs[0].name.as_str(), hubs[0].address), ("can0 hub 0x21", 0x21));
    assert_eq!((config.layout.name.as_str(), config.layout.len()), ("taxeld", 22));
}

#[test]
fn a_layout_that_is_named_may_have_fewer_boards_and_taxels_than_those_that_were_heard() {
    let cyskin = layout_of(HUB, CYSKIN, &[(0, SENSORS), (1, SENSORS)]);
    let seven = layout_of(HUB, CYSKIN, &[(1, "[[1, 2, 3, 4, 5, 6, 7]]")]);
    let four_by_six =
        "[[0, 1, 2, 3, 16, 17], [4, 5, 6, 7, 18, 19], [8, 9, 10, 11, 20, 21], [12, 13, 14, 15, 22, 23]]";
    let four_by_five = "[[0, 1, 2, 3, 16], [4, 5, 6, 7, 18], [8, 9, 10, 11, 20], [12, 13, 14, 15, 22]]";
    let l2 = |modules| layout_of("", "protocol = \"uskin-l2\"", modules);
    // Two of the four triangles, and a few pads of them.
    let triangles: Vec<u8> = (0..48).filter(|k| !matches!(k % 12, 6 | 10)).collect();
    let [triangles, pads] = [format!("{:?}", [triangles]), "[[0, 1, 2, 3, 24, 25, 35]]".into()];
    let icub = |kind, order: &String| layout_of("", &format!("protocol = \"icub-{kind}\""), &[(9, order)]);
    for (heard, layout, told) in [
        (cyskin, seven, "read: 4 taxels of can0 hub 0x21 module 1"),
        (
            l2(&[(3, four_by_six), (5, four_by_six)]),
            l2(&[(5, four_by_five)]),
            "read: 4 taxels of can0 board 5",
        ),
        // Which MTB it is stands in no frame.
        (
            icub("mtb4", &triangles),
            icub("mtb4", &pads),
            "read: 33 taxels of can0 board 9",
        ),
    ] {
        let dir = recording_of(&heard);
        let said = set_up_as(&dir, &layout).unwrap();
        assert!(said.contains(told) && !said.contains("Silent"), "{said}");
        let config = taxeld::Config::load(&dir.path().join("taxeld.toml")).unwrap();
        assert_eq!(config.layout, Layout::parse(&layout, "mine.toml").unwrap());
    }
}

#[test]
fn silent_taxels_are_told_and_are_no_other_board_where_they_are_few() {
    let four_by_four = "[[0, 1, 2, 3], [4, 5, 6, 7], [8, 9, 10, 11], [12, 13, 14, 15]]";
    let l2 = |board, order| layout_of("", "protocol = \"uskin-l2\"", &[(board, order)]);
    let dir = recording_of(&l2(
        1,
        "[[0, 1, 2, 3], [4, 5, 6, 7], [8, -1, 10, 11], [12, 13, 14, 15]]",
    ));
    for board in [1, 4] {
        let said = set_up_as(&dir, &l2(board, four_by_four)).unwrap();
        assert!(
            said.contains("Silent: taxels k = 9 of the 16 of the m0 (can0 board 1)"),
            "{said}"
        );
    }
    let four_by_six =
        "[[0, 1, 2, 3, 16, 17], [4, 5, 6, 7, 18, 19], [8, 9, 10, 11, 20, 21], [12, 13, 14, 15, 22, 23]]";
    let said = set_up_as(&dir, &l2(1, four_by_six)).unwrap_err();
    assert!(
        said.contains("whose 15 taxels are not the 24 of the m0"),
        "{said}"
    );
    // With another board beside it, it is told by where it is.
    let dir = recording_of(&layout_of(
        "",
        "protocol = \"uskin-l2\"",
        &[(1, four_by_four), (2, four_by_four)],
    ));
    let said = set_up_as(&dir, &l2(1, four_by_six)).unwrap_err();
    assert!(
        said.contains("at the address of the m0 is can0 board 1, whose 16 taxels"),
        "{said}"
    );
    let said = set_up_as(&dir, &l2(4, four_by_four)).unwrap_err();
    assert!(
        said.contains("no board was heard at the address of the m0. Press"),
        "{said}"
    );
}

#[test]
fn a_built_in_hand_is_known_where_one_of_its_taxels_is_silent() {
    let (dir, log) = recording("allegro-uskin-15");
    let path = dir.path().join("hand.log");
    let text = fs::read_to_string(&path).unwrap();
    let heard: Vec<&str> = text.lines().filter(|line| !line.contains(" can1 613#")).collect();
    assert!(heard.len() < text.lines().count());
    fs::write(&path, heard.join("\n") + "\n").unwrap();
    let (_, said) = succeeds(&dir, &["setup", "--yes", &log]);
    assert!(
        said.contains("The boards fit allegro-uskin-15, but for 1 taxel"),
        "{said}"
    );
    assert!(
        said.contains("Silent: taxels k = 7 of the 16 of the thumb proximal"),
        "{said}"
    );
    let config = taxeld::Config::load(&dir.path().join("taxeld.toml")).unwrap();
    assert_eq!(config.layout.name, "allegro-uskin-15");
    let (_, said) = succeeds(&dir, &["doctor", "--scan", &log]);
    let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(
        said.contains("allegro-uskin-15, but for 1 taxel that no frame was heard of."),
        "{said}"
    );
}
