//! Messages of ROS 2's own types, and both clocks.

use crate::cdr::{CdrReader, CdrWriter};
use taxel_hand::Freshness;
use taxel_wire::status::Status;
use taxel_wire::{EventKind, ImageView, RawView};

fn put_time(cdr: &mut CdrWriter, wall_ns: u64) {
    cdr.i32(i32::try_from(wall_ns / 1_000_000_000).unwrap_or(i32::MAX));
    cdr.u32((wall_ns % 1_000_000_000) as u32);
}

fn put_header(cdr: &mut CdrWriter, wall_ns: u64, frame_id: &str) {
    put_time(cdr, wall_ns);
    cdr.text(frame_id);
}

/// `std_msgs/String`.
pub fn text_message(text: &str) -> Vec<u8> {
    let mut cdr = CdrWriter::with_capacity(text.len() + 8);
    cdr.text(text);
    cdr.finish()
}

/// The text of a `std_msgs/String`.
pub fn read_text(message: &[u8]) -> Option<&str> {
    CdrReader::new(message)?.text()
}

/// `sensor_msgs/Image` of the greys, `mono8`.
pub(crate) fn picture_message(image: &ImageView<'_>, wall_ns: u64) -> Vec<u8> {
    let mut cdr = CdrWriter::with_capacity(64 + image.pixels().len());
    put_header(&mut cdr, wall_ns, "hand");
    cdr.u32(image.height.into());
    cdr.u32(image.width.into());
    cdr.text("mono8");
    cdr.u8(0);
    cdr.u32(image.width.into());
    cdr.bytes(image.pixels());
    cdr.finish()
}

/// `sensor_msgs/JointState`: angles, and velocities where they are known. Efforts are unknown: currents are no torques.
pub(crate) fn joints_message(names: &[String], raw: &RawView<'_>, wall_ns: u64) -> Vec<u8> {
    let mut cdr = CdrWriter::with_capacity(64 + 48 * names.len());
    put_header(&mut cdr, wall_ns, "");
    cdr.texts(names.iter().map(String::as_str));
    cdr.f64s(raw.joints().map(f64::from));
    match raw.joint_velocities_rad_s() {
        Some(velocities) => cdr.f64s(velocities.map(f64::from)),
        None => cdr.u32(0),
    }
    cdr.u32(0);
    cdr.finish()
}

/// `diagnostic_msgs/DiagnosticArray`: one status per problem, or one that all is well.
pub(crate) fn diagnostics_message(status: &Status, wall_ns: u64) -> Vec<u8> {
    let mut cdr = CdrWriter::with_capacity(1024);
    put_header(&mut cdr, wall_ns, "");
    cdr.u32(status.problems.len().max(1) as u32);
    if status.problems.is_empty() {
        cdr.u8(0);
        cdr.text("taxeld");
        cdr.text("no problem");
        cdr.text(&status.layout);
        cdr.u32(0);
    }
    for problem in &status.problems {
        let board = problem.board.map(|board| board.to_string());
        let facts = [
            ("kind", Some(problem.kind.as_str())),
            ("bus", problem.bus.as_deref()),
            ("board", board.as_deref()),
            ("module", problem.module.as_deref()),
            ("joint", problem.joint.as_deref()),
        ];
        let facts: Vec<(&str, &str)> = facts
            .into_iter()
            .filter_map(|(key, value)| Some((key, value?)))
            .collect();
        let place = facts.get(1).map_or("hand", |(_, place)| place);
        cdr.u8(if problem.severe { 2 } else { 1 });
        cdr.text(&format!("taxeld: {place}: {}", problem.kind));
        cdr.text(&problem.sentence);
        cdr.text(&status.layout);
        cdr.u32(facts.len() as u32);
        for (key, value) in facts {
            cdr.text(key);
            cdr.text(value);
        }
    }
    cdr.finish()
}

/// `rcl_interfaces/Log` of what was told to people; its name is the kind of event, such as `mark`. A notice is a warning, as
/// most are of a problem; which one is over, its text says.
pub fn event_message(kind: &str, text: &str, wall_ns: u64) -> Vec<u8> {
    const INFO: u8 = 20;
    const WARN: u8 = 30;
    let mut cdr = CdrWriter::with_capacity(64 + text.len());
    put_time(&mut cdr, wall_ns);
    cdr.u8(
        if matches!(kind, "refused" | "disconnect" | "recorder" | "notice") {
            WARN
        } else {
            INFO
        },
    );
    cdr.text(kind);
    cdr.text(text);
    cdr.text("");
    cdr.text("");
    cdr.u32(0);
    cdr.finish()
}

/// Kind and text of an event.
pub fn read_event(message: &[u8]) -> Option<(&str, &str)> {
    let mut cdr = CdrReader::new(message)?;
    let (_sec, _nanosec, _level) = (cdr.u32()?, cdr.u32()?, cdr.u8()?);
    Some((cdr.text()?, cdr.text()?))
}

/// The name of an event's kind on the wire.
pub fn event_name(kind: EventKind) -> &'static str {
    match kind {
        EventKind::Refused => "refused",
        EventKind::Disconnect => "disconnect",
        EventKind::Calibrating => "calibrating",
        EventKind::Calibrated => "calibrated",
        EventKind::Paused => "paused",
        EventKind::Resumed => "resumed",
        EventKind::Mark => "mark",
        EventKind::Notice | EventKind::Other => "notice",
    }
}

/// Both clocks at one instant, nanoseconds.
pub fn clock_message(monotonic_ns: u64, realtime_ns: u64) -> Vec<u8> {
    let mut cdr = CdrWriter::with_capacity(16);
    cdr.u64(monotonic_ns);
    cdr.u64(realtime_ns);
    cdr.finish()
}

pub(crate) fn freshness_number(freshness: Freshness) -> u8 {
    match freshness {
        Freshness::Missing => 0,
        Freshness::Stale => 1,
        Freshness::Fresh => 2,
    }
}
