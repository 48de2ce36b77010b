//! A daemon's control socket: one request, one reply.

use super::hands;
use anyhow::{Context, anyhow, bail};
use nix::libc::EPROTOTYPE;
use serde_json::Value;
use std::ffi::OsStr;
use std::fmt;
use std::io::{self, BufRead, BufReader, ErrorKind, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Duration;
use taxel_wire::{check_socket_folder, connect_for_requests, who_may_open};

/// How long a reply may take; one to a servo's start, which on a slow bus with silent servos is known late.
const PATIENCE: Duration = Duration::from_secs(5);
const START_PATIENCE: Duration = Duration::from_secs(10);

/// How often something is asked for whose connection has to make room for others before it is begun.
const TRIES: usize = 3;

/// Has the daemon do something and returns its reply; an error is its own words why not.
pub(crate) fn request(socket: &Path, request: &Value) -> anyhow::Result<Value> {
    let ask = || Connection::open(socket)?.reply_to(request);
    let mut reply = ask()?;
    for _ in 1..TRIES {
        if reply["ask_again"] == true {
            reply = ask()?;
        }
    }
    done(reply)
}

/// The reply, if it is that something is done; an error is the daemon's own words why not, [`Held`] where another client drives
/// the motor.
fn done(reply: Value) -> anyhow::Result<Value> {
    if reply["ok"] == true {
        return Ok(reply);
    }
    let why = reply["error"].as_str().unwrap_or("refused");
    match reply.get("held_by") {
        Some(_) => Err(Held(why.into()).into()),
        None => bail!("{why}"),
    }
}

/// A motor is driven by another client of the daemon, in the daemon's words.
#[derive(Debug)]
pub(crate) struct Held(String);

impl fmt::Display for Held {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Held {}

/// A connection that carries request after request.
#[derive(Debug)]
pub(crate) struct Connection(BufReader<UnixStream>);

/// Which table of the configuration has the mode and group of a socket, as its usual name tells it.
fn table_of(socket: &Path) -> &'static str {
    match socket.file_name().and_then(OsStr::to_str) {
        Some("status.sock") => "[socket]",
        Some("control.sock") => "[control]",
        _ => "[socket] for the status socket, [control] for the control socket",
    }
}

impl Connection {
    /// Connects to a daemon.
    pub(crate) fn open(socket: &Path) -> anyhow::Result<Self> {
        check_socket_folder(socket)?;
        let stream = connect_for_requests(socket).map_err(|error| {
            let who = match error.kind() {
                ErrorKind::PermissionDenied => format!(
                    "; {}; its configuration says who: mode and group of {}",
                    who_may_open(socket),
                    table_of(socket)
                ),
                ErrorKind::NotFound | ErrorKind::ConnectionRefused => format!(
                    "; {}",
                    hands::advice(socket, hands::socket_option).unwrap_or_else(|| {
                        "no taxeld runs there: start it (`taxeld --config FILE`), or name the socket of another one"
                            .into()
                    })
                ),
                ErrorKind::TimedOut => "; its log says what it does, and where it hangs, restart it".into(),
                _ if error.raw_os_error() == Some(EPROTOTYPE) => {
                    "; images come from there, requests go to status.sock or control.sock beside it".into()
                }
                _ => String::new(),
            };
            anyhow!("cannot reach taxeld at {}: {error}{who}", socket.display())
        })?;
        Ok(Self(BufReader::new(stream)))
    }

    /// Has the daemon do something and returns its reply; an error is its own words why not, [`Held`] where another client
    /// drives the motor.
    pub(crate) fn ask(&mut self, request: &Value) -> anyhow::Result<Value> {
        done(self.reply_to(request)?)
    }

    /// What the daemon replies, whatever it is.
    fn reply_to(&mut self, request: &Value) -> anyhow::Result<Value> {
        self.0.get_ref().set_read_timeout(Some(patience(request)))?;
        match writeln!(self.0.get_mut(), "{request}") {
            // Who has closed it may have said why.
            Err(error) if is_closed(&error) => {}
            written => written.map_err(|error| unanswered(error, request))?,
        }
        let mut reply = String::new();
        match self.0.read_line(&mut reply) {
            Err(error) if !is_closed(&error) => return Err(unanswered(error, request)),
            Ok(1..) => {}
            _ => bail!("taxeld has closed the connection; if it has ended, its log says why"),
        }
        serde_json::from_str(&reply).context("the daemon's answer")
    }
}

fn patience(request: &Value) -> Duration {
    match request["torque"] == true {
        true => START_PATIENCE,
        false => PATIENCE,
    }
}

/// Whether it is because the other side has closed the connection; it is reset where that side had not read all.
fn is_closed(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::BrokenPipe | ErrorKind::ConnectionReset)
}

/// Why there is no reply.
fn unanswered(error: io::Error, request: &Value) -> anyhow::Error {
    if error.kind() != ErrorKind::WouldBlock {
        return anyhow!(error).context("no answer from the daemon");
    }
    let only_tells =
        matches!(request["cmd"].as_str(), Some("status" | "profile")) && request["profile"].is_null();
    let next = match only_tells {
        true => "its log says what it does, and where it hangs, restart it",
        false => "what it was asked for may still be done: `taxel status` tells, once it is answered",
    };
    anyhow!("taxeld has not answered within {:?}; {next}", patience(request))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::net::UnixListener;

    #[test]
    fn a_daemon_that_has_closed_the_connection_is_no_reader_that_has_seen_enough() {
        let folder = tempfile::tempdir().unwrap();
        let socket = folder.path().join("control.sock");
        let listener = UnixListener::bind(&socket).unwrap();
        for (last_words, wanted) in [
            ("", "taxeld has closed the connection"),
            (
                "{\"ok\":false,\"error\":\"the motors are off\"}\n",
                "the motors are off",
            ),
        ] {
            let mut connection = Connection::open(&socket).unwrap();
            let (mut daemon, _) = listener.accept().unwrap();
            daemon.write_all(last_words.as_bytes()).unwrap();
            drop(daemon);
            let error = connection.ask(&Value::Null).unwrap_err();
            assert!(error.to_string().starts_with(wanted), "{error:#}");
            assert!(!taxeld::stdout::is_broken_pipe(&error), "{error:#}");
        }
    }

    #[test]
    fn a_connection_that_was_reset_over_an_unread_request_was_closed() {
        let folder = tempfile::tempdir().unwrap();
        let socket = folder.path().join("control.sock");
        let listener = UnixListener::bind(&socket).unwrap();
        let refusal = "{\"ok\":false,\"error\":\"the motors are off\"}\n";
        for (last_words, wanted) in [
            (
                refusal,
                &["the motors are off", "taxeld has closed the connection"][..],
            ),
            ("", &["taxeld has closed the connection"]),
        ] {
            let mut connection = Connection::open(&socket).unwrap();
            let (mut daemon, _) = listener.accept().unwrap();
            daemon.write_all(last_words.as_bytes()).unwrap();
            writeln!(connection.0.get_mut(), "{{}}").unwrap();
            drop(daemon);
            for wanted in wanted {
                let error = connection.ask(&Value::Null).unwrap_err();
                assert!(error.to_string().starts_with(wanted), "{error:#}");
            }
        }
        // What was reset between a request and its reply.
        let mut connection = Connection::open(&socket).unwrap();
        let (daemon, _) = listener.accept().unwrap();
        let closing = std::thread::spawn(move || {
            use std::io::Read;
            (&daemon).read_exact(&mut [0]).unwrap();
        });
        let error = connection.ask(&Value::Null).unwrap_err();
        closing.join().unwrap();
        assert!(error.to_string().starts_with("taxeld has closed"), "{error:#}");
    }

    #[test]
    fn what_was_not_begun_when_its_connection_made_room_is_asked_for_again_but_not_for_ever() {
        let folder = tempfile::tempdir().unwrap();
        let socket = folder.path().join("control.sock");
        let listener = UnixListener::bind(&socket).unwrap();
        let again = "{\"ok\":false,\"error\":\"it made room\",\"ask_again\":true}\n";
        let begun = "{\"ok\":false,\"error\":\"may still be done\"}\n";
        for (replies, wanted) in [
            (&[again, "{\"ok\":true}\n"][..], None),
            (&[again, begun], Some("may still be done")),
            (&[begun], Some("may still be done")),
            (&[again; TRIES], Some("it made room")),
        ] {
            let outcome = std::thread::scope(|scope| {
                scope.spawn(|| {
                    for reply in replies {
                        let (mut daemon, _) = listener.accept().unwrap();
                        daemon.write_all(reply.as_bytes()).unwrap();
                    }
                });
                request(&socket, &Value::Null)
            });
            assert_eq!(outcome.err().map(|error| error.to_string()).as_deref(), wanted);
        }
    }

    #[test]
    fn a_daemon_that_does_not_answer_may_still_do_what_it_was_asked_for() {
        let late = || io::Error::from(ErrorKind::WouldBlock);
        for (request, wanted) in [
            (r#"{"cmd":"status"}"#, "within 5s; its log says what it does"),
            (r#"{"cmd":"profile"}"#, "its log says what it does"),
            (
                r#"{"cmd":"profile","profile":{}}"#,
                "may still be done: `taxel status` tells",
            ),
            (
                r#"{"cmd":"servo","joint":"a","torque":true}"#,
                "within 10s; what it was asked for may still be done",
            ),
            (
                r#"{"cmd":"servo","joint":"a","torque":false}"#,
                "within 5s; what it was asked for may still be done",
            ),
        ] {
            let told = unanswered(late(), &serde_json::from_str(request).unwrap()).to_string();
            assert!(told.starts_with("taxeld has not answered within "), "{told}");
            assert!(
                told.contains(wanted) && !told.contains("os error"),
                "{request}: {told}"
            );
        }
    }

    #[test]
    fn who_may_open_a_socket_is_said_by_the_table_that_governs_it() {
        for (socket, tables) in [
            ("/run/taxeld/status.sock", &["[socket]"][..]),
            ("/run/taxeld/control.sock", &["[control]"]),
            ("/tmp/another", &["[socket]", "[control]"]),
        ] {
            let told = table_of(Path::new(socket));
            for table in ["[socket]", "[control]"] {
                assert_eq!(told.contains(table), tables.contains(&table), "{socket}: {told}");
            }
        }
    }
}
