//! A daemon that runs already: what it says of itself and of the hand, so that its buses are left alone.

use super::finding::Check;
use super::hand_text::describe_hand;
use super::picture;
use anyhow::{Context, bail};
use serde::Deserialize;
use std::io::{self, BufRead, BufReader, ErrorKind, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Duration;
use taxel_can::SourceAddress;
use taxel_diagnose::Kind;
use taxel_hand::{Fault, Faults, plural};
use taxel_joints::JointSource;
use taxel_skin::Layout;
use taxel_wire::status::{BoardStatus, BusStatus, JointStatus, JointsStatus, ProblemStatus, Status};
use taxel_wire::{check_socket_folder, connect_for_requests};
use taxeld::Config;

const AREA: &str = "daemon";
/// How long an answer may take.
const PATIENCE: Duration = Duration::from_secs(3);

/// Whether a daemon answers on its status socket.
#[derive(Debug)]
pub(crate) enum Daemon {
    /// Nobody is there.
    Absent,
    /// Its status.
    Running(Box<Status>),
    /// The socket is there and this user may not use it.
    Forbidden,
    /// It is waited for in vain.
    Hung,
    /// Something is there that does not answer as it should.
    Strange(String),
}

/// The answer to a request for the status.
#[derive(Deserialize)]
struct Reply {
    status: Option<Status>,
    error: Option<String>,
}

/// Asks who is at the status socket.
pub(crate) fn ask(socket: &Path) -> Daemon {
    if let Err(untrusted) = check_socket_folder(socket) {
        return Daemon::Strange(untrusted.to_string());
    }
    let mut stream = match connect_for_requests(socket) {
        Ok(stream) => stream,
        Err(error) if error.kind() == ErrorKind::PermissionDenied => return Daemon::Forbidden,
        Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::ConnectionRefused) => {
            return Daemon::Absent;
        }
        Err(error) if is_late(&error) => return Daemon::Hung,
        Err(error) => return Daemon::Strange(error.to_string()),
    };
    match status(&mut stream) {
        Ok(status) => Daemon::Running(Box::new(status)),
        Err(error) if error.downcast_ref().is_some_and(is_late) => Daemon::Hung,
        Err(error) => Daemon::Strange(format!("{error:#}")),
    }
}

/// Whether the time was over, of a connect, a read or a write.
fn is_late(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock)
}

fn status(stream: &mut UnixStream) -> anyhow::Result<Status> {
    stream.set_read_timeout(Some(PATIENCE))?;
    writeln!(stream, "{}", serde_json::json!({ "cmd": "status" }))?;
    let mut reply = String::new();
    BufReader::new(stream)
        .read_line(&mut reply)
        .context("no answer")?;
    let reply: Reply = serde_json::from_str(&reply).context("the answer is no JSON of a status")?;
    match reply.status {
        Some(status) => Ok(status),
        None => bail!("{}", reply.error.as_deref().unwrap_or("no status")),
    }
}

/// What is to be said of a running daemon and its hand: what it tells of problems, in its own
/// words, and what is well.
pub(super) fn check(status: &Status) -> Vec<Check> {
    let mut checks = vec![Check::ok(
        AREA,
        "taxeld",
        "",
        format!(
            "{} runs since {:.0} s with layout {}: {:.1} images/s; its buses are left alone, this is what it says",
            status.version, status.uptime_s, status.layout, status.images.rate_hz
        ),
    )];
    let overruns = status.images.overruns;
    if overruns > 0 {
        checks.push(
            Check::warning(
                AREA,
                "overruns",
                "",
                format!("{} given up, since it was held up", plural(overruns, "image")),
            )
            .wanted("none")
            .advise("real-time priority (see machine), fewer display profiles, or a less busy machine"),
        );
    }
    checks.extend(status.problems.iter().map(|p| Check::told(AREA, object(p), p)));
    for bus in &status.buses {
        checks.extend(check_bus(bus));
    }
    for board in &status.boards {
        let bus = status.buses.iter().find(|bus| bus.name == board.bus);
        let is_told = !board.problems.is_empty() || bus.is_some_and(|bus| !bus.problems.is_empty());
        checks.extend(check_board(board, is_told));
    }
    checks.extend(status.joints.as_ref().and_then(check_joints));
    if status.calibrating {
        checks.push(Check::warning(
            AREA,
            "baseline",
            "",
            "is being measured: do not touch the hand",
        ));
    }
    if status.paused {
        let paused = Check::warning(
            AREA,
            "paused",
            "",
            "images show no contact, whatever the hand touches",
        );
        checks.push(paused.advise("`taxel resume`"));
    }
    // Taxels of a silent board are all missing, which its board says already.
    let speaks = |module: &str| {
        let board = status.boards.iter().find(|board| board.module == module);
        board.is_some_and(|board| board.state == "living")
    };
    for fault in status.faults.iter().chain(&status.saturated) {
        if fault.reasons != ["missing"] || speaks(&fault.module) {
            let object = format!("{} k {}", fault.module, fault.k);
            checks.push(Check::warning(AREA, "taxel", object, fault.reasons.join(" and ")));
        }
    }
    checks
}

/// Whose problem it is.
fn object(problem: &ProblemStatus) -> String {
    let ProblemStatus {
        bus, module, joint, ..
    } = problem;
    match (module, bus, joint) {
        (Some(module), ..) => module.clone(),
        (_, Some(bus), _) => bus.clone(),
        (_, _, Some(joint)) => joint.clone(),
        _ if problem.kind == Kind::ReloadRefused.name() => "configuration".into(),
        _ if problem.kind == Kind::SocketsLost.name() => "sockets".into(),
        _ if problem.kind == Kind::ReadersTurnedAway.name() => "readers".into(),
        _ => "joints".into(),
    }
}

/// What is to be said of a bus beside its problems: that it is well, and what has happened since
/// the daemon's start.
fn check_bus(bus: &BusStatus) -> Vec<Check> {
    let object = format!("{} ({})", bus.name, bus.source);
    let has = |kinds: &[Kind]| {
        kinds
            .iter()
            .any(|kind| bus.problems.iter().any(|p| p == kind.name()))
    };
    let mut checks = Vec::new();
    if bus.problems.is_empty() {
        let found = format!("{}, {}, {}", bus.link, bus.state, plural(bus.received, "frame"));
        checks.push(Check::ok(AREA, "bus", &object, found));
    }
    let errors = bus.errors.frames.saturating_sub(bus.errors.lost_arbitration);
    let of_errors = [Kind::BusErrors, Kind::NoAcknowledge, Kind::BusOff, Kind::Flapping];
    let counts: [(u64, &str, &[Kind]); 6] = [
        (
            bus.lost_in_kernel,
            "frames lost in the kernel",
            &[Kind::FramesLost],
        ),
        (
            bus.unknown,
            "frames of nobody in the layout",
            &[Kind::Babbling, Kind::BoardNotInLayout],
        ),
        (bus.malformed, "malformed frames", &[]),
        (bus.queue_overflows, "transmit queues thrown away by boards", &[]),
        (
            bus.send_failures,
            "commands that could not be sent",
            &[Kind::CannotSend],
        ),
        (errors, "error frames", &of_errors),
    ];
    for (count, what, told_as) in counts {
        if count > 0 && !has(told_as) {
            let found = format!("{count} {what} since its start");
            checks.push(Check::warning(AREA, "counts", &object, found).wanted("none"));
        }
    }
    checks
}

/// What is to be said of a board beside its problems; `is_told` says that there are some, or of its bus.
fn check_board(board: &BoardStatus, is_told: bool) -> Option<Check> {
    let object = format!("{} ({} board {})", board.module, board.bus, board.board);
    match (board.state.as_str(), board.period_ms) {
        _ if !board.problems.is_empty() => None,
        ("living", Some(ms)) if ms > 0.0 => {
            Some(Check::ok(AREA, "board", object, format!("{:.1} Hz", 1000.0 / ms)))
        }
        ("living", _) => Some(Check::ok(AREA, "board", object, "speaks")),
        ("settling", _) => Some(Check::warning(AREA, "board", object, "has just come up")),
        _ if is_told => None,
        (state, _) => Some(Check::warning(
            AREA,
            "board",
            object,
            format!("{state} at this moment"),
        )),
    }
}

/// That joints are well: those that have an angle and no problem.
fn check_joints(joints: &JointsStatus) -> Option<Check> {
    let is_well = |joint: &&JointStatus| joint.problems.is_empty() && joint.angle_rad.is_some();
    let well = || joints.joints.iter().filter(is_well);
    let servos = well().filter(|joint| joint.servo.is_some()).count();
    let others = well().count() - servos;
    let what = match joints.allegro {
        Some(_) => "joint",
        None => "potentiometer",
    };
    let counts = [(servos, "servo"), (others, what)]
        .into_iter()
        .filter(|(count, _)| *count > 0);
    let counts: Vec<String> = counts.map(|(count, what)| plural(count, what)).collect();
    let verb = if servos + others == 1 { "reports" } else { "report" };
    (servos + others > 0).then(|| Check::ok(AREA, "joints", "", format!("{} {verb}", counts.join(" and "))))
}

/// Where a daemon reads its buses.
pub(super) fn sources(status: &Status) -> Vec<SourceAddress> {
    let parsed = |bus: &BusStatus| bus.source.parse().ok();
    status.buses.iter().filter_map(parsed).collect()
}

/// The hand of a daemon and where its buses are, in words.
pub(super) fn describe(status: &Status) -> String {
    let buses = status.buses.iter().map(|bus| (&bus.name, bus.source.clone()));
    describe_hand(&status.layout, buses)
}

/// Those of these sources that a daemon reads. Recordings may be read by any number of programs.
pub(crate) fn shared<'a>(status: &Status, sources: &'a [SourceAddress]) -> Vec<&'a SourceAddress> {
    // What is behind the question mark are options.
    let same = |source: &SourceAddress, theirs: &str| {
        let source = source.to_string();
        source.split('?').next() == theirs.split('?').next()
    };
    let is_live = |source: &&SourceAddress| !matches!(source, SourceAddress::Log { .. });
    let is_read = |source: &&SourceAddress| status.buses.iter().any(|bus| same(source, &bus.source));
    sources.iter().filter(is_live).filter(is_read).collect()
}

/// Whether a daemon reads any of the buses or joints of a configuration.
pub(super) fn has_any(status: &Status, config: &Config) -> bool {
    let joints = config.joints.as_ref().is_some_and(|joints| {
        let theirs = status.joints.as_ref();
        let theirs = theirs.and_then(|joints| joints.source.parse::<JointSource>().ok());
        theirs.is_some_and(|theirs| theirs.is_same(&joints.source))
    });
    joints || !shared(status, &config.sources).is_empty()
}

/// The letter of each taxel that is not healthy, for a drawing of this layout; `None` if the daemon
/// has another.
pub(super) fn marks(status: &Status, layout: &Layout) -> Option<Vec<Option<char>>> {
    if status.layout != layout.name {
        return None;
    }
    let mut marks = vec![None; layout.len()];
    for saturated in &status.saturated {
        *marks.get_mut(saturated.taxel)? = Some(picture::SATURATED);
    }
    for fault in &status.faults {
        let mut faults = Faults::NONE;
        for known in Fault::ALL {
            if fault.reasons.iter().any(|reason| reason == known.name()) {
                faults.insert(known);
            }
        }
        *marks.get_mut(fault.taxel)? = picture::letter(faults);
    }
    Some(marks)
}

#[cfg(test)]
mod tests;
