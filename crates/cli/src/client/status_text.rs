//! The daemon's status on one screen of 80 columns.

use crate::seconds::duration_text;
use std::fmt::Write;
use taxel_hand::plural;
use taxel_wire::status::{BoardStatus, BusStatus, JointsStatus, ProblemStatus, QuantileStatus, Status};

/// Boards and joints with problems that are listed; the others are counted.
const LISTED: usize = 6;
/// Subscribers that are listed.
const READERS: usize = 8;

/// A status report in words, a line or more for each part of the daemon.
pub(crate) fn of(status: &Status) -> String {
    let mut out = String::new();
    // Writing to a string cannot fail.
    let _ = write(status, &mut out);
    out
}

fn write(status: &Status, out: &mut String) -> std::fmt::Result {
    write_state(status, out)?;
    write_images(status, out)?;
    write_hand(status, out)?;
    write_buses(&status.buses, out)?;
    write_boards(&status.boards, out)?;
    if let Some(joints) = &status.joints {
        write_joints(joints, out)?;
    }
    write_readers(status, out)?;
    write_problems(&status.problems, out)
}

fn write_state(status: &Status, out: &mut String) -> std::fmt::Result {
    let state = match (status.paused, status.calibrating) {
        (true, _) => "paused",
        (_, true) => "measuring the baseline; do not touch the hand",
        _ => "running",
    };
    let up = duration_text(status.uptime_s);
    writeln!(
        out,
        "taxeld {} on {}, up {up}: {state}",
        status.version, status.layout
    )
}

fn write_images(status: &Status, out: &mut String) -> std::fmt::Result {
    let images = &status.images;
    writeln!(
        out,
        "images   {:.1} Hz ({}), {} made, {} overruns, {} unpublished; tick {}",
        images.rate_hz,
        status.tick.mode,
        images.made,
        images.overruns,
        images.unpublished,
        times(&images.lateness_us, &images.recent.lateness_us),
    )
}

/// Of all since the start, and of those of the last minute where there were any.
fn times(all: &QuantileStatus, recent: &QuantileStatus) -> String {
    let mut text = format!("p50 {} p99 {}", time(all.p50), time(all.p99));
    if recent.max > 0.0 {
        text += &format!(", last minute p99 {}", time(recent.p99));
    }
    text
}

fn write_hand(status: &Status, out: &mut String) -> std::fmt::Result {
    writeln!(
        out,
        "hand     {} in contact, {} missing, {} faulty{}; contact threshold {}",
        status.contacts,
        status.missing,
        status.faulty,
        match status.saturated.len() {
            0 => String::new(),
            saturated => format!(", {saturated} saturated"),
        },
        match status.calibrating {
            true => "not known yet".to_owned(),
            false => format!("{:.0}", status.threshold),
        }
    )
}

fn write_buses(buses: &[BusStatus], out: &mut String) -> std::fmt::Result {
    for (n, bus) in buses.iter().enumerate() {
        let not_used = [
            (bus.unknown, "unknown"),
            (bus.late, "late"),
            (bus.undecodable + bus.malformed, "damaged"),
            (bus.lost_in_kernel, "lost in the kernel"),
        ];
        let not_used = not_used.iter().filter(|(count, _)| *count > 0);
        writeln!(
            out,
            "{:8} {:8} {} {}, {:.0} frames/s, load {:.0} %, {} used{}",
            if n == 0 { "buses" } else { "" },
            bus.name,
            bus.link,
            bus.state,
            bus.frames_hz,
            bus.load_percent,
            bus.used,
            not_used
                .map(|(count, what)| format!(", {count} {what}"))
                .collect::<String>(),
        )?;
    }
    Ok(())
}

fn write_boards(boards: &[BoardStatus], out: &mut String) -> std::fmt::Result {
    let silent: Vec<String> = boards
        .iter()
        .filter(|board| board.state != "living")
        .map(|board| {
            format!(
                "{} ({}, board {}) {}",
                board.module, board.bus, board.board, board.state
            )
        })
        .collect();
    let living = boards.len() - silent.len();
    writeln!(out, "boards   {living} of {} speak", boards.len())?;
    listed(out, &silent)
}

fn write_readers(status: &Status, out: &mut String) -> std::fmt::Result {
    write!(out, "readers  {}", status.subscribers.len())?;
    let sent = &status.images.sent;
    match sent.images {
        0 => writeln!(out)?,
        _ => writeln!(
            out,
            "; age of images when sent {}",
            times(&sent.age_us, &status.images.recent.age_us)
        )?,
    }
    for reader in status.subscribers.iter().take(READERS) {
        let wants = match (reader.raw, reader.every) {
            (true, true) => ", raw frames, every one",
            (true, false) => ", raw frames",
            (false, true) => ", every image",
            (false, false) => "",
        };
        writeln!(
            out,
            "         pid {}: {}, {} skipped{} in {}; p99 {} old, gap {}{wants}",
            reader.pid.map_or("?".into(), |pid| pid.to_string()),
            plural(reader.images, "image"),
            reader.skipped,
            match reader.paced {
                0 => String::new(),
                paced => format!(", {paced} paced"),
            },
            duration_text(reader.connected_s),
            time(reader.age_us.p99),
            time(reader.longest_gap_ms * 1000.0),
        )?;
    }
    more(out, status.subscribers.len(), READERS)
}

fn write_problems(problems: &[ProblemStatus], out: &mut String) -> std::fmt::Result {
    match problems.len() {
        0 => writeln!(out, "problems none"),
        count => {
            writeln!(out, "problems {count}")?;
            for problem in problems {
                let mark = if problem.severe { "error" } else { "warning" };
                writeln!(
                    out,
                    "  {mark} for {}: {}",
                    duration_text(problem.since_s),
                    problem.sentence
                )?;
            }
            Ok(())
        }
    }
}

fn write_joints(joints: &JointsStatus, out: &mut String) -> std::fmt::Result {
    let known = joints
        .joints
        .iter()
        .filter(|joint| joint.angle_rad.is_some())
        .count();
    writeln!(
        out,
        "joints   {known} of {} known, {:.0} readings/s, {} {}",
        joints.joints.len(),
        joints.cycle_hz,
        joints.source,
        joints.state,
    )?;
    let unknown: Vec<String> = joints
        .joints
        .iter()
        .filter(|joint| joint.angle_rad.is_none())
        .map(|joint| format!("{}: {}", joint.name, joint.state))
        .collect();
    listed(out, &unknown)
}

fn listed(out: &mut String, lines: &[String]) -> std::fmt::Result {
    for line in lines.iter().take(LISTED) {
        writeln!(out, "         {line}")?;
    }
    more(out, lines.len(), LISTED)
}

fn more(out: &mut String, count: usize, shown: usize) -> std::fmt::Result {
    match count.saturating_sub(shown) {
        0 => Ok(()),
        more => writeln!(out, "         and {more} more"),
    }
}

/// Microseconds, in the unit that fits.
fn time(us: f64) -> String {
    match us {
        us if us < 1000.0 => format!("{us:.0} us"),
        us => format!("{:.1} ms", us / 1000.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn status(more: serde_json::Value) -> Status {
        let mut all = json!({
            "version": "0.1.0", "layout": "allegro-uskin-15", "uptime_s": 11_520.0, "contacts": 12,
            "images": { "made": 345_600, "rate_hz": 30.0, "lateness_us": { "p50": 81.0, "p99": 1216.0 },
                        "recent": { "lateness_us": { "p50": 80.0, "p99": 95.0, "max": 99.0 } } },
            "tick": { "mode": "timer" },
            "buses": [{ "name": "can0", "link": "up", "state": "error-active", "used": 9, "late": 2 }],
            "boards": [{ "module": "index tip", "bus": "can0", "board": 3, "state": "silent" },
                       { "module": "thumb tip", "bus": "can0", "board": 4, "state": "living" }],
        });
        for (key, value) in more.as_object().unwrap() {
            all[key] = value.clone();
        }
        serde_json::from_value(all).unwrap()
    }

    #[test]
    fn every_part_of_the_daemon_has_its_lines() {
        let text = of(&status(json!({
            "joints": { "source": "dynamixel:/dev/ttyUSB0", "state": "connected", "cycle_hz": 100.0,
                "joints": [{ "name": "index 0", "state": "silent" }, { "name": "index 1", "angle_rad": 0.1 }] },
            "saturated": [{ "taxel": 3, "module": "index tip", "k": 3, "reasons": ["saturated"] }],
            "problems": [{ "sentence": "can0: nobody acknowledges; is the hand switched on?", "severe": true, "since_s": 4.0 }],
        })));
        for line in [
            "taxeld 0.1.0 on allegro-uskin-15, up 3 h 12 min: running",
            "images   30.0 Hz (timer), 345600 made, 0 overruns, 0 unpublished; tick p50 81 us p99 1.2 ms, last minute p99 95 us",
            "hand     12 in contact, 0 missing, 0 faulty, 1 saturated",
            "buses    can0     up error-active, 0 frames/s, load 0 %, 9 used, 2 late",
            "boards   1 of 2 speak",
            "         index tip (can0, board 3) silent",
            "joints   1 of 2 known, 100 readings/s, dynamixel:/dev/ttyUSB0 connected",
            "         index 0: silent",
            "readers  0",
            "problems 1",
            "  error for 4 s: can0: nobody acknowledges; is the hand switched on?",
        ] {
            assert!(text.contains(line), "{line}\n{text}");
        }
    }

    #[test]
    fn a_reader_is_told_with_how_old_its_images_were_when_sent_and_how_long_none_was() {
        let text = of(&status(json!({
            "images": { "sent": { "images": 149, "age_us": { "p50": 109.0, "p99": 14_000.0 } } },
            "subscribers": [
                { "pid": 7, "images": 52, "skipped": 97, "connected_s": 5.2, "age_us": { "p50": 110.0, "p99": 37_250.0 },
                  "longest_gap_ms": 532.1 },
                { "pid": 8, "images": 97, "paced": 48, "raw": true, "age_us": { "p99": 216.0 }, "longest_gap_ms": 33.4 },
            ],
        })));
        for line in [
            "readers  2; age of images when sent p50 109 us p99 14.0 ms",
            "         pid 7: 52 images, 97 skipped in 5 s; p99 37.2 ms old, gap 532.1 ms",
            "         pid 8: 97 images, 0 skipped, 48 paced in 0 s; p99 216 us old, gap 33.4 ms, raw frames",
        ] {
            assert!(text.contains(line), "{line}\n{text}");
        }
    }

    #[test]
    fn many_of_a_kind_are_counted_and_not_listed() {
        let boards: Vec<_> = (0..20)
            .map(|n| json!({ "module": format!("m{n}"), "state": "unheard" }))
            .collect();
        let readers: Vec<_> = (0..900).map(|n| json!({ "pid": n })).collect();
        let text = of(&status(
            json!({ "boards": boards, "subscribers": readers, "paused": true }),
        ));
        assert!(
            text.contains("0 of 20 speak") && text.contains("and 14 more"),
            "{text}"
        );
        assert!(
            text.contains("readers  900") && text.contains("and 892 more"),
            "{text}"
        );
        assert!(
            text.contains(": paused") && text.contains("problems none"),
            "{text}"
        );
        assert!(text.lines().count() < 24, "more than a screen:\n{text}");
    }
}
