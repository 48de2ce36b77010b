//! The example display drivers and the Python reader's command, run against a daemon that misbehaves.

mod c_program;
mod fake_daemon;
mod vectors;

use fake_daemon::FakeDaemon;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};
use taxel_hand::{Actuator, TactileImage};
use taxel_wire::{Event, EventKind, Subscribe};
use tempfile::TempDir;

fn here(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// A driver that is running; stopped when the test ends, however it ends.
struct Driver {
    child: Child,
    lines: BufReader<ChildStdout>,
}

impl Driver {
    fn start(mut program: Command) -> Self {
        let mut child = program.stdout(Stdio::piped()).spawn().unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap());
        Self { child, lines }
    }

    fn line(&mut self) -> String {
        let mut line = String::new();
        self.lines.read_line(&mut line).unwrap();
        line.trim_end().to_owned()
    }
}

impl Drop for Driver {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn image(seq: u64, levels: &[(u16, u16)]) -> Vec<u8> {
    let actuators = levels.iter().map(|&(id, level)| Actuator {
        id,
        x: 1,
        y: 1,
        level,
        force: 100.0,
    });
    vectors::image_packet(
        &TactileImage {
            seq,
            actuators: actuators.collect(),
            levels: (1..=64).map(f64::from).collect(),
            ..vectors::example()
        },
        0,
    )
}

/// Shows, lets go when the stream stops, shows again, lets go when the daemon closes, connects again.
fn behaves(daemon: &FakeDaemon, mut driver: Driver, signal: &str) {
    let client = daemon.accept();
    for part in vectors::hello().to_packets(0, 0) {
        client.send(&part);
    }
    let asked = Subscribe::from_packet(&client.receive()).unwrap();
    let profile = asked.profile.expect("the display states what it can do");
    assert_eq!((profile.levels, profile.actuators), (8, 16));
    // One is of 64 levels, as of the daemon's own profile from before.
    client.send(&image(1, &[(0, 1), (3, 61)]));
    assert_eq!(driver.line(), "image: 0=1 3=8");
    client.send(&Event::new(EventKind::Notice, "all is well").to_packet(1, 0));
    assert_eq!(
        driver.line(),
        "no image: clear",
        "the stream stopped, and nothing else"
    );
    client.send(b"not a message");
    client.send(&image(2, &[(3, 1)]));
    assert_eq!(driver.line(), "image: 3=1");
    drop(client);
    let mut line = driver.line();
    if line == "no image: clear" {
        // On a slow machine the display may let go before it sees that the daemon has left.
        line = driver.line();
    }
    assert_eq!(line, "closed: clear");
    let client = daemon.accept();
    client.send(&image(1, &[(5, 2)]));
    assert_eq!(driver.line(), "image: 5=2");
    assert_eq!(driver.line(), "no image: clear");
    let pid = driver.child.id();
    let stopped = Command::new("kill")
        .args([signal, &pid.to_string()])
        .status()
        .unwrap();
    assert!(stopped.success());
    assert_eq!(driver.line(), "stopped: clear");
    let mut rest = String::new();
    driver.lines.read_to_string(&mut rest).unwrap();
    assert_eq!(rest, "");
    assert!(driver.child.wait().unwrap().success());
}

/// Lets go and ends when its profile is refused: the images that go on to come are the daemon's own.
fn ends_where_it_is_refused(program: impl Fn() -> Command, last: &str) {
    let daemon = FakeDaemon::new();
    let mut program = program();
    let mut driver = Driver::start({
        program.arg(daemon.path());
        program
    });
    let client = daemon.accept();
    client.receive();
    // Of 16 actuators there is no 16.
    client.send(&image(1, &[(3, 2), (16, 5)]));
    assert_eq!(driver.line(), "image: 3=2");
    client.send(&Event::new(EventKind::Refused, "3 profiles are in use").to_packet(1, 0));
    let mut lines = String::new();
    driver.lines.read_to_string(&mut lines).unwrap();
    let lines: Vec<&str> = lines.lines().filter(|line| *line != "no image: clear").collect();
    assert_eq!(lines, [last]);
    assert_eq!(driver.child.wait().unwrap().code(), Some(1));
}

#[test]
fn displays_whose_profile_is_refused_let_go_and_end() {
    ends_where_it_is_refused(in_rust, "refused: clear");
    if let Some((dir, _)) = in_c("../../examples/display.c") {
        ends_where_it_is_refused(|| Command::new(dir.path().join("display")), "refused: clear");
    }
    if python().is_none() {
        println!("SKIPPED: no python3 on this machine; examples/display.py was NOT run");
        return;
    }
    let in_python = || {
        let mut python = python().unwrap();
        python.arg(here("../../examples/display.py"));
        python
    };
    ends_where_it_is_refused(in_python, "stopped: clear");
}

fn python() -> Option<Command> {
    let works = Command::new("python3")
        .arg("--version")
        .output()
        .is_ok_and(|out| out.status.success());
    works.then(|| {
        let mut python = Command::new("python3");
        python
            .env("PYTHONPATH", here("python"))
            .env("PYTHONDONTWRITEBYTECODE", "1");
        python
    })
}

/// A program in C, compiled into a folder of its own and named as its source is; `None`, and said,
/// where no compiler is there.
fn in_c(source: &str) -> Option<(TempDir, Command)> {
    let dir = tempfile::tempdir().unwrap();
    let program = dir.path().join(Path::new(source).file_stem().unwrap());
    c_program::compile(source, &program)?;
    Some((dir, Command::new(program)))
}

/// The example in Rust. Examples are built with the tests, beside the folder of these.
fn in_rust() -> Command {
    let tests = std::env::current_exe().unwrap();
    let program = tests.parent().unwrap().with_file_name("examples").join("display");
    assert!(
        program.exists(),
        "cargo build -p taxel-wire --examples makes {program:?}"
    );
    Command::new(program)
}

#[test]
fn the_display_in_c_lets_go_when_images_stop() {
    let Some((_dir, mut display)) = in_c("../../examples/display.c") else {
        return;
    };
    let daemon = FakeDaemon::new();
    display.arg(daemon.path());
    behaves(&daemon, Driver::start(display), "-HUP");
}

#[test]
fn the_display_in_rust_lets_go_when_images_stop() {
    let daemon = FakeDaemon::new();
    let mut display = in_rust();
    display.arg(daemon.path());
    behaves(&daemon, Driver::start(display), "-QUIT");
}

#[test]
fn the_display_in_python_lets_go_when_images_stop() {
    let Some(mut display) = python() else {
        println!("SKIPPED: no python3 on this machine; examples/display.py was NOT run");
        return;
    };
    let daemon = FakeDaemon::new();
    display.arg(here("../../examples/display.py")).arg(daemon.path());
    behaves(&daemon, Driver::start(display), "-TERM");
}

/// A driver whose hardware takes long to let go, while every signal that ends a driver comes again.
const TOLD_TWICE: &str = r#"
import os, sys, display
def drive(levels, why):
    print(why, "begins", flush=True)
    if why == "stopped":
        for number in display.ENDING:
            os.kill(os.getpid(), number)
    print(why, "ends", flush=True)
display.drive = drive
sys.exit(display.main())
"#;

#[test]
fn a_second_signal_does_not_keep_the_display_in_python_from_letting_go() {
    let path = std::env::join_paths([here("python"), here("../../examples")]).unwrap();
    for signal in ["-INT", "-TERM", "-HUP", "-QUIT"] {
        let Some(mut display) = python() else {
            println!("SKIPPED: no python3 on this machine; examples/display.py was NOT run");
            return;
        };
        display.env("PYTHONPATH", &path).stderr(Stdio::null());
        // Nobody is there to be connected to.
        display.args(["-c", TOLD_TWICE, "/nowhere"]);
        let mut driver = Driver::start(display);
        assert_eq!(driver.line(), "closed begins");
        let pid = driver.child.id().to_string();
        assert!(
            Command::new("kill")
                .args([signal, &pid])
                .status()
                .unwrap()
                .success()
        );
        let mut rest = String::new();
        driver.lines.read_to_string(&mut rest).unwrap();
        let lines: Vec<&str> = rest.lines().collect();
        assert!(
            lines.ends_with(&["stopped begins", "stopped ends"]),
            "{signal}: {rest}"
        );
        assert!(driver.child.wait().unwrap().success(), "{signal}");
    }
}

#[test]
fn drivers_say_how_they_are_run() {
    let says = |mut driver: Command, words: &str| {
        let output = driver.output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(
            !output.status.success() && said.contains(words),
            "{driver:?}: {said}"
        );
        assert!(!said.contains("Traceback"), "{said}");
    };
    says(in_rust(), "usage: display SOCKET");
    if let Some((_dir, display)) = in_c("../../examples/display.c") {
        says(display, "display SOCKET, such as");
    }
    let Some(mut in_python) = python() else {
        println!("SKIPPED: no python3 on this machine; examples/display.py was NOT run");
        return;
    };
    in_python.arg(here("../../examples/display.py"));
    says(in_python, "usage: display.py SOCKET");
    let mut without_reader = Command::new("python3");
    without_reader
        .env_remove("PYTHONPATH")
        .args(["-S".as_ref(), here("../../examples/display.py").as_os_str()]);
    says(without_reader, "PYTHONPATH=crates/wire/python");
}

#[test]
fn the_python_reader_prints_a_line_per_image_and_the_reason_of_the_end() {
    let Some(mut reader) = python() else {
        println!("SKIPPED: no python3 on this machine; taxel_reader.py was NOT run");
        return;
    };
    let daemon = FakeDaemon::new();
    reader.arg(here("python/taxel_reader.py")).arg(daemon.path());
    let mut driver = Driver::start({
        reader.stderr(Stdio::piped());
        reader
    });
    let client = daemon.accept();
    client.send(&image(7, &[(0, 1)]));
    for part in taxel_wire::split_text(taxel_wire::Kind::Hello, &vectors::hello().to_json(), 99, 7, 0) {
        client.send(&[&part.0.to_bytes()[..], part.1].concat());
    }
    client.send(&image(8, &[(2, 2)]));
    client.send(&Event::new(EventKind::Disconnect, "the hand was unplugged").to_packet(8, 0));
    assert_eq!(driver.line(), "7 contacts=2 missing=1 | 0@1,1=1");
    let second = driver.line();
    assert!(
        second.starts_with("8 ") && second.contains("us contacts=2 missing=1 | 2@1,1=2"),
        "{second}"
    );
    drop(client);
    let mut said = String::new();
    driver
        .child
        .stderr
        .take()
        .unwrap()
        .read_to_string(&mut said)
        .unwrap();
    assert!(said.contains("the hand was unplugged"), "{said}");
    assert_eq!(driver.child.wait().unwrap().code(), Some(1));
}

/// One whose output is no longer read: ends well, and says nothing of it.
fn ends_with_its_reader(mut program: Command) {
    let daemon = FakeDaemon::new();
    let mut driver = Driver::start({
        program.arg(daemon.path()).stderr(Stdio::piped());
        program
    });
    let client = daemon.accept();
    client.send(&image(1, &[(0, 1)]));
    assert!(driver.line().contains('1'));
    let mut stderr = driver.child.stderr.take().unwrap();
    // The pipe's only reader goes.
    let (_, nothing) = std::io::pipe().unwrap();
    driver.lines = BufReader::new(std::process::ChildStdout::from(std::os::fd::OwnedFd::from(
        nothing,
    )));
    client.send(&image(2, &[(0, 2)]));
    let mut said = String::new();
    stderr.read_to_string(&mut said).unwrap();
    assert_eq!(said, "");
    assert_eq!(driver.child.wait().unwrap().code(), Some(0));
}

#[test]
fn drivers_and_readers_end_quietly_when_nobody_reads_their_output() {
    ends_with_its_reader(in_rust());
    for script in ["../../examples/display.py", "python/taxel_reader.py"] {
        let Some(mut python) = python() else {
            println!("SKIPPED: no python3 on this machine; {script} was NOT run");
            return;
        };
        python.arg(here(script));
        ends_with_its_reader(python);
    }
}

#[test]
fn the_python_reader_waits_in_a_process_with_many_open_files() {
    let Some(mut python) = python() else {
        println!("SKIPPED: no python3 on this machine; taxel_reader.py was NOT run");
        return;
    };
    let daemon = FakeDaemon::new();
    let script = "import os, resource, sys, taxel_reader\n\
                  _, most = resource.getrlimit(resource.RLIMIT_NOFILE)\n\
                  if most < 1100:\n    print('SKIPPED'); sys.exit()\n\
                  resource.setrlimit(resource.RLIMIT_NOFILE, (1100, most))\n\
                  held = [os.open(os.devnull, os.O_RDONLY) for _ in range(1030)]\n\
                  with taxel_reader.connect(sys.argv[1]) as reader:\n\
                  \x20   assert reader.fileno() > 1023\n\
                  \x20   print(reader.receive(0.001), flush=True)\n\
                  \x20   print(reader.receive(20).seq)\n";
    python.args(["-c", script]).arg(daemon.path());
    let mut driver = Driver::start(python);
    let nothing = driver.line();
    if nothing == "SKIPPED" {
        println!("SKIPPED: this machine lets no process have 1100 open files");
        return;
    }
    assert_eq!(nothing, "None");
    let client = daemon.accept();
    client.send(&image(7, &[(0, 1)]));
    assert_eq!(driver.line(), "7");
}

#[test]
fn a_daemon_that_leaves_with_a_subscription_unread_has_closed_the_connection_in_c_too() {
    let Some((_dir, mut leaves)) = in_c("tests/leaves.c") else {
        return;
    };
    let daemon = FakeDaemon::new();
    leaves.arg(daemon.path());
    let mut driver = Driver::start(leaves);
    assert_eq!(driver.line(), "subscribed");
    drop(daemon.accept());
    assert_eq!(driver.line(), "closed");
}

#[test]
fn who_is_let_go_before_it_subscribes_is_told_why_in_c_too() {
    let Some((_dir, mut leaves)) = in_c("tests/leaves.c") else {
        return;
    };
    let daemon = FakeDaemon::new();
    leaves.arg(daemon.path()).arg("late");
    let mut driver = Driver::start(leaves);
    let client = daemon.accept();
    client.send(&Event::new(EventKind::Disconnect, "all places are taken").to_packet(0, 0));
    drop(client);
    assert_eq!(driver.line(), "subscribed");
    let farewell = driver.line();
    assert!(farewell.contains("all places are taken"), "{farewell}");
    assert_eq!(driver.line(), "closed");
}

#[test]
fn no_reader_follows_a_socket_in_a_folder_of_a_user_that_another_user_owns() {
    let daemon = FakeDaemon::new();
    // Of a user that no machine has. The socket behind it answers, so that it is the folder that is refused.
    let folder = PathBuf::from(format!("/tmp/taxeld-{}", u32::MAX - 11));
    std::fs::create_dir_all(&folder).unwrap();
    let socket = folder.join("images.sock");
    let _ = std::fs::remove_file(&socket);
    std::os::unix::fs::symlink(daemon.path(), &socket).unwrap();

    let rust = taxel_wire::Subscriber::connect(&socket);
    let python = Command::new("python3")
        .arg(here("python/taxel_reader.py"))
        .arg(&socket)
        .output()
        .unwrap();
    let c = in_c("tests/leaves.c").map(|(_dir, mut leaves)| leaves.arg(&socket).output().unwrap());
    std::fs::remove_dir_all(&folder).unwrap();

    let error = rust.unwrap_err().to_string();
    assert!(error.contains("belongs to user"), "{error}");
    let said = String::from_utf8_lossy(&python.stderr);
    assert!(
        !python.status.success() && said.contains("only the user of its name"),
        "{said}"
    );
    assert!(c.is_none_or(|c| !c.status.success() && c.stdout.is_empty()));
}
