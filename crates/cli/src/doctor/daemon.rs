//! A daemon that runs already: what it says of itself and of the hand, so that its buses are left alone.

use super::finding::Check;
use super::picture;
use anyhow::{Context, bail};
use serde_json::Value;
use std::io::{BufRead, BufReader, ErrorKind, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Duration;
use taxel_hand::{Fault, Faults};
use taxel_skin::Layout;

const AREA: &str = "daemon";
const PATIENCE: Duration = Duration::from_secs(3);

/// Whether a daemon answers on its control socket.
#[derive(Debug)]
pub(super) enum Daemon {
    /// Nobody is there.
    Absent,
    /// Its status.
    Running(Box<Value>),
    /// The socket is there and this user may not use it.
    Forbidden,
    /// Something is there that does not answer as it should.
    Strange(String),
}

/// Asks who is at the control socket.
pub(super) fn ask(control: &Path) -> Daemon {
    let mut stream = match UnixStream::connect(control) {
        Ok(stream) => stream,
        Err(error) if error.kind() == ErrorKind::PermissionDenied => return Daemon::Forbidden,
        Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::ConnectionRefused) => {
            return Daemon::Absent;
        }
        Err(error) => return Daemon::Strange(error.to_string()),
    };
    match status(&mut stream) {
        Ok(status) => Daemon::Running(Box::new(status)),
        Err(error) => Daemon::Strange(format!("{error:#}")),
    }
}

fn status(stream: &mut UnixStream) -> anyhow::Result<Value> {
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    writeln!(stream, "{}", serde_json::json!({ "cmd": "status" }))?;
    let mut reply = String::new();
    BufReader::new(stream)
        .read_line(&mut reply)
        .context("no answer")?;
    let mut reply: Value = serde_json::from_str(&reply).context("the answer is not JSON")?;
    match reply["status"].take() {
        Value::Null => bail!("{}", reply["error"].as_str().unwrap_or("no status")),
        status => Ok(status),
    }
}

/// What is to be said of a running daemon and its hand.
pub(super) fn check(status: &Value) -> Vec<Check> {
    let text = |value: &Value| value.as_str().unwrap_or("?").to_string();
    let count = |value: &Value| value.as_u64().unwrap_or(0);
    let mut checks = vec![Check::ok(
        AREA,
        "taxeld",
        "",
        format!(
            "{} runs since {:.0} s with layout {}: {:.1} images/s; its buses are left alone, this is what it says",
            text(&status["version"]),
            status["uptime_s"].as_f64().unwrap_or(0.0),
            text(&status["layout"]),
            status["images"]["rate_hz"].as_f64().unwrap_or(0.0)
        ),
    )];
    let overruns = count(&status["images"]["overruns"]);
    if overruns > 0 {
        checks.push(
            Check::warning(
                AREA,
                "overruns",
                "",
                format!("{overruns} images given up, since it was held up"),
            )
            .wanted("none")
            .advise("real-time priority (see machine), fewer display profiles, or a less busy machine"),
        );
    }
    for bus in array(&status["buses"]) {
        let object = format!("{} ({})", text(&bus["name"]), text(&bus["source"]));
        let link = text(&bus["link"]);
        let state = text(&bus["state"]);
        let found = format!("{link}, {state}, {} frames", count(&bus["received"]));
        checks.push(match (link.as_str(), state.as_str()) {
            ("up", "error-active") => Check::ok(AREA, "bus", &object, found),
            ("up", "bus-off") | ("down" | "absent", _) => {
                Check::error(AREA, "bus", &object, found).wanted("up, error-active")
            }
            _ => Check::warning(AREA, "bus", &object, found).wanted("up, error-active"),
        });
        for (key, words) in [
            ("lost_in_kernel", "frames lost in the kernel"),
            ("unknown", "frames of nobody in the layout"),
            ("malformed", "malformed frames"),
            ("queue_overflows", "transmit queues thrown away by boards"),
            ("send_failures", "commands that could not be sent"),
        ] {
            let n = count(&bus[key]);
            if n > 0 {
                checks.push(Check::warning(AREA, "counts", &object, format!("{n} {words}")).wanted("none"));
            }
        }
        let errors =
            count(&bus["errors"]["frames"]).saturating_sub(count(&bus["errors"]["lost_arbitration"]));
        if errors > 0 {
            checks.push(
                Check::warning(AREA, "error frames", &object, errors.to_string())
                    .wanted("none")
                    .advise("wiring, termination, ground, or a node at another bit rate"),
            );
        }
    }
    for board in array(&status["boards"]) {
        let object = format!(
            "{} ({} board {})",
            text(&board["module"]),
            text(&board["bus"]),
            board["board"]
        );
        let state = text(&board["state"]);
        let rate = match board["period_ms"].as_f64() {
            Some(ms) if ms > 0.0 => format!("{:.1} Hz", 1000.0 / ms),
            _ => state.clone(),
        };
        checks.push(match state.as_str() {
            "living" => Check::ok(AREA, "board", object, rate),
            "settling" => Check::warning(AREA, "board", object, "has just come up"),
            _ => Check::error(
                AREA,
                "board",
                object,
                format!("{state}, started again {} times", count(&board["restarts"])),
            )
            .advise("its supply, its plug, its address, or another bus"),
        });
    }
    for problem in array(&status["problems"]) {
        let object = match problem["module"].as_str() {
            Some(module) => module.to_string(),
            None => match problem["bus"].as_str() {
                Some(bus) => bus.to_string(),
                None => problem["joint"].as_str().unwrap_or("joints").to_string(),
            },
        };
        let sentence = text(&problem["sentence"]);
        checks.push(match problem["severe"].as_bool() {
            Some(true) => Check::error(AREA, "problem", object, sentence),
            _ => Check::warning(AREA, "problem", object, sentence),
        });
    }
    if status["calibrating"] == true {
        checks.push(Check::warning(
            AREA,
            "baseline",
            "",
            "is being measured: do not touch the hand",
        ));
    }
    for fault in array(&status["faults"]) {
        let reasons: Vec<String> = array(&fault["reasons"]).iter().map(text).collect();
        // Taxels of a silent board are all missing, which its board says already.
        if reasons != ["missing"] {
            let object = format!("{} k {}", text(&fault["module"]), fault["k"]);
            checks.push(Check::warning(AREA, "taxel", object, reasons.join(" and ")));
        }
    }
    checks
}

/// The letter of each taxel that is not healthy, for a drawing of this layout; `None` if the daemon has another.
pub(super) fn marks(status: &Value, layout: &Layout) -> Option<Vec<Option<char>>> {
    if status["layout"] != layout.name.as_str() {
        return None;
    }
    let mut marks = vec![None; layout.len()];
    for fault in array(&status["faults"]) {
        let mut faults = Faults::NONE;
        for reason in array(&fault["reasons"]) {
            if let Some(known) = Fault::ALL.into_iter().find(|f| *reason == f.name()) {
                faults.insert(known);
            }
        }
        let taxel = fault["taxel"].as_u64()? as usize;
        *marks.get_mut(taxel)? = picture::letter(faults);
    }
    Some(marks)
}

fn array(value: &Value) -> &[Value] {
    value.as_array().map_or(&[], Vec::as_slice)
}

#[cfg(test)]
mod tests {
    use super::super::finding::State;
    use super::*;
    use serde_json::json;

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

    #[test]
    fn what_a_running_daemon_says_becomes_findings() {
        let checks = check(&running());
        let bad: Vec<_> = checks.iter().filter(|c| c.state != State::Ok).collect();
        assert_eq!(bad.len(), 1, "{bad:?}");
        assert_eq!(
            (bad[0].object.as_str(), bad[0].found.as_str()),
            ("module k 5", "dead")
        );
        assert!(checks.iter().any(|c| c.name == "board" && c.found == "50.0 Hz"));

        let mut status = running();
        status["buses"][0]["link"] = "down".into();
        status["buses"][0]["lost_in_kernel"] = 4.into();
        status["boards"][0]["state"] = "silent".into();
        status["images"]["overruns"] = 2.into();
        status["problems"] = json!([{ "kind": "board-silent", "bus": "can0", "module": "module", "severe": false,
                                      "sentence": "module (can0 board 1) is silent; check its power and cable" }]);
        let checks = check(&status);
        for (name, state) in [
            ("bus", State::Error),
            ("counts", State::Warning),
            ("board", State::Error),
            ("overruns", State::Warning),
            ("problem", State::Warning),
        ] {
            assert!(
                checks.iter().any(|c| c.name == name && c.state == state),
                "{name}: {checks:?}"
            );
        }
    }

    #[test]
    fn faults_are_drawn_where_the_layout_is_the_daemons() {
        let layout = Layout::builtin("uskin-module").unwrap();
        let marks = marks(&running(), &layout).unwrap();
        assert_eq!(marks.iter().filter(|m| m.is_some()).count(), 1);
        assert_eq!(marks[5], Some('D'));
        assert!(super::marks(&running(), &Layout::builtin("cpm-finger").unwrap()).is_none());
    }

    #[test]
    fn nobody_at_the_socket_is_told_from_something_strange() {
        let dir = tempfile::TempDir::new().unwrap();
        let path = dir.path().join("control.sock");
        assert!(matches!(ask(&path), Daemon::Absent));
        let listener = std::os::unix::net::UnixListener::bind(&path).unwrap();
        std::thread::spawn(move || {
            let (mut stream, _) = listener.accept().unwrap();
            // One that closes before it is asked breaks the pipe, which is strange too, but in other words.
            BufReader::new(&stream).read_line(&mut String::new()).unwrap();
            stream.write_all(b"hello\n").unwrap();
        });
        assert!(matches!(ask(&path), Daemon::Strange(why) if why.contains("not JSON")));
    }
}
