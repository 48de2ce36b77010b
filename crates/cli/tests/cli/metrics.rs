//! `taxel metrics`, of a real daemon in this process.

use crate::{HANGS_AFTER, command, fails, simulated, succeeds};
use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::process::{Child, ChildStderr, Command, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// `taxel metrics --listen`, gone with the test.
struct Exporter {
    child: Child,
    address: String,
    /// What it says later.
    said: BufReader<ChildStderr>,
}

impl Exporter {
    fn start(dir: &TempDir) -> Self {
        Self::run(dir, Command::new(env!("CARGO_BIN_EXE_taxel")), "control.sock")
    }

    /// With at most this many open files.
    fn start_with_files(dir: &TempDir, files: usize) -> Self {
        let mut limited = Command::new("sh");
        let program = env!("CARGO_BIN_EXE_taxel");
        limited.args(["-c", &format!("ulimit -n {files} && exec \"$0\" \"$@\""), program]);
        Self::run(dir, limited, "control.sock")
    }

    fn run(dir: &TempDir, mut command: Command, socket: &str) -> Self {
        command.args(["metrics", "--listen", "127.0.0.1:0", "--socket", socket]);
        let mut child = command
            .current_dir(dir.path())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut said = BufReader::new(child.stderr.take().unwrap());
        let mut line = String::new();
        said.read_line(&mut line).unwrap();
        let address = line
            .split("http://")
            .nth(1)
            .expect(&line)
            .split('/')
            .next()
            .unwrap()
            .to_owned();
        Self { child, address, said }
    }

    fn get(&self, request: &str) -> String {
        let mut stream = TcpStream::connect(&self.address).unwrap();
        write!(stream, "{request}\r\nHost: a\r\n\r\n").unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    }
}

impl Drop for Exporter {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn an_exporter_says_once_why_no_daemon_answers() {
    let dir = TempDir::new().unwrap();
    let daemon = simulated(dir.path(), "tap");
    let mut exporter = Exporter::run(&dir, Command::new(env!("CARGO_BIN_EXE_taxel")), "images.sock");
    let (mut said, mut rest) = (String::new(), String::new());
    for _ in 0..3 {
        assert!(exporter.get("GET /metrics HTTP/1.1").contains("\ntaxeld_up 0\n"));
        if said.is_empty() {
            exporter.said.read_line(&mut said).unwrap();
        }
    }
    let wanted =
        "images come from there, requests go to status.sock or control.sock beside it; so taxeld_up is 0\n";
    assert!(said.ends_with(wanted), "{said}");
    exporter.child.kill().unwrap();
    exporter.said.read_to_string(&mut rest).unwrap();
    assert_eq!(rest, "");
    daemon.stop().unwrap();
}

#[test]
fn an_exporter_that_could_not_take_a_connection_takes_the_next() {
    let dir = TempDir::new().unwrap();
    let exporter = Exporter::start_with_files(&dir, 24);
    // More than it has files for; nobody asks anything.
    let clients: Vec<TcpStream> = (0..40)
        .map(|_| TcpStream::connect(&exporter.address).unwrap())
        .collect();
    let waits = TcpStream::connect(&exporter.address).unwrap();
    drop(clients);
    assert!(exporter.get("GET /metrics HTTP/1.1").contains("\ntaxeld_up 0\n"));
    drop(waits);
}

#[test]
fn the_metrics_of_a_daemon_are_fetched_over_http_while_it_runs_and_after() {
    let dir = TempDir::new().unwrap();
    let exporter = Exporter::start(&dir);
    assert!(exporter.get("GET /metrics HTTP/1.1").contains("\ntaxeld_up 0\n"));
    let daemon = simulated(dir.path(), "tap");
    let answer = exporter.get("GET /metrics HTTP/1.1");
    assert!(
        answer.starts_with("HTTP/1.1 200 OK\r\nContent-Type: text/plain; version=0.0.4;"),
        "{answer}"
    );
    let asked =
        "GET /metrics HTTP/1.1\r\naccept: application/openmetrics-text;version=1.0.0,text/plain;q=0.5";
    let open_metrics = exporter.get(asked);
    assert!(
        open_metrics.contains("\r\nContent-Type: application/openmetrics-text; version=1.0.0;")
            && open_metrics.ends_with("# EOF\n"),
        "{open_metrics}"
    );
    for wanted in [
        "\ntaxeld_up 1\n",
        "layout=\"allegro-uskin-15\"",
        "taxeld_bus_received_total{bus=\"can1\"} ",
    ] {
        assert!(answer.contains(wanted), "{wanted} in {answer}");
    }
    let (out, err) = succeeds(&dir, &["metrics", "--socket", "images.sock"]);
    assert!(
        out.contains("\ntaxeld_up 0\n") && err.contains("cannot reach taxeld at images.sock: "),
        "{out}{err}"
    );
    let err = fails(&dir, &["metrics", "--listen", "localhost"], 2);
    assert!(err.contains("such as 127.0.0.1:9464"), "{err}");
    let (out, _) = succeeds(&dir, &["metrics", "--socket", "control.sock"]);
    assert!(
        out.starts_with("# TYPE taxeld_up gauge\n") && !out.contains("# EOF"),
        "{out}"
    );
    daemon.stop().unwrap();
    assert!(
        exporter
            .get("GET /metrics?a=b HTTP/1.1")
            .contains("\ntaxeld_up 0\n")
    );
    assert!(exporter.get("GET / HTTP/1.1").starts_with("HTTP/1.1 404"));
    let head = exporter.get("HEAD /metrics HTTP/1.1");
    let (head, body) = head.split_once("\r\n\r\n").unwrap();
    assert!(head.starts_with("HTTP/1.1 200") && body.is_empty(), "{head}");
    assert!(!head.contains("Content-Length: 0"), "{head}");
    assert!(exporter.get("POST /metrics HTTP/1.1").starts_with("HTTP/1.1 405"));
    assert!(exporter.get("POST /metrics HTTP/1.1").starts_with("HTTP/1.1 405"));
}

#[test]
fn a_client_that_asks_nothing_or_byte_by_byte_keeps_nobody_waiting() {
    /// More than are served at once, each of which may take its two seconds.
    const IDLE: usize = 100;
    let dir = TempDir::new().unwrap();
    let exporter = Exporter::start(&dir);
    let connect = || TcpStream::connect(&exporter.address).unwrap();
    let _idle: Vec<TcpStream> = (0..IDLE).map(|_| connect()).collect();
    let scrape = |exporter: &Exporter| {
        let mut stream = connect();
        stream.set_read_timeout(Some(HANGS_AFTER)).unwrap();
        write!(stream, "GET /metrics HTTP/1.1\r\n\r\n").unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).expect(&exporter.address);
        assert!(answer.contains("\ntaxeld_up 0\n"), "{answer}");
    };
    scrape(&exporter);

    let mut slow = connect();
    let ended_by = Instant::now() + HANGS_AFTER;
    write!(slow, "GET /metrics HTTP/1.1\r\na").unwrap();
    scrape(&exporter);
    slow.set_read_timeout(Some(Duration::from_millis(100))).unwrap();
    let is_waiting = |read: std::io::Result<usize>| {
        read.is_err_and(|error| matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut))
    };
    while is_waiting(slow.read(&mut [0])) {
        assert!(Instant::now() < ended_by, "it may go on asking");
        let _ = slow.write(b"a");
    }
}

#[test]
fn a_file_of_metrics_that_cannot_be_written_for_a_while_is_written_again() {
    let dir = TempDir::new().unwrap();
    let (folder, away) = (dir.path().join("collected"), dir.path().join("away"));
    let textfile = [
        "metrics",
        "--socket",
        "control.sock",
        "--every",
        "0.1",
        "--textfile",
    ];
    let err = fails(&dir, &[&textfile[..], &["collected/taxeld.prom"]].concat(), 1);
    assert!(err.contains("collected/taxeld.prom"), "{err}");
    std::fs::create_dir(&folder).unwrap();
    let mut child = command(&dir, &textfile)
        .arg("collected/taxeld.prom")
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut said = BufReader::new(child.stderr.take().unwrap()).lines();
    let deadline = Instant::now() + HANGS_AFTER;
    while !folder.join("taxeld.prom").exists() {
        assert!(Instant::now() < deadline && child.try_wait().unwrap().is_none());
        std::thread::yield_now();
    }
    let up = said.next().unwrap().unwrap();
    assert!(up.ends_with("; so taxeld_up is 0"), "{up}");
    for _ in 0..2 {
        std::fs::rename(&folder, &away).unwrap();
        let failed = said.next().unwrap().unwrap();
        assert!(
            failed.contains("collected/taxeld.prom") && failed.ends_with("; it is tried again every 100ms"),
            "{failed}"
        );
        std::fs::rename(&away, &folder).unwrap();
        let again = said.next().unwrap().unwrap();
        assert_eq!(again, "taxel: collected/taxeld.prom: is written again");
    }
    child.kill().unwrap();
    child.wait().unwrap();
}
