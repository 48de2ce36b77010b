//! What became of a recording: its files, what is in them, and what is missing.

use serde_json::{Value, json};
use std::path::PathBuf;
use taxel_hand::plural;
use taxel_journal::Priority;
use taxel_recorder::{CanInput, CanRead, Finished, Plan};
use taxel_wire::status::ProblemStatus;

/// Problems that are told; `taxel status` has the others.
const MOST_TOLD: usize = 4;

/// The files of the recording that are where they were written, and those that others moved or removed since.
fn there_and_away(finished: &Finished) -> [Vec<&PathBuf>; 2] {
    let (there, away) = finished.files.iter().partition(|file| file.exists());
    [there, away]
}

/// The buses of which nothing came.
fn silent(finished: &Finished) -> impl Iterator<Item = &CanInput> {
    let silent = finished.can.iter().filter(|bus| bus.frames == 0);
    silent.map(|bus| &bus.input)
}

fn can_frames(finished: &Finished) -> u64 {
    finished.can.iter().map(|bus| bus.frames).sum()
}

/// What the daemon said last that is missing now, of sources other than the buses that were read here.
fn lacking(finished: &Finished) -> impl Iterator<Item = &ProblemStatus> {
    let is_of = |read: &CanRead, bus: &Option<String>| Some(&read.input.name) == bus.as_ref();
    let is_read = move |bus: &Option<String>| finished.can.iter().any(|read| is_of(read, bus));
    let problems = finished.problems.iter();
    problems.filter(move |problem| problem.severe && !is_read(&problem.bus))
}

/// What became of a recording, and what is missing of it, a sentence each with how much it matters.
pub(crate) fn words(plan: &Plan, finished: &Finished) -> Vec<(Priority, String)> {
    let Finished {
        files: _,
        gone,
        removed: _,
        can: _,
        can_lost,
        is_described: _,
        images: _,
        skipped,
        dropped,
        messages: _,
        problems: _,
        failure: _,
    } = finished;
    let [files, away] = there_and_away(finished);
    let mut lines = Vec::new();
    lines.extend(gone.iter().map(|gone| format!("taxel: {gone}")));
    if let (Some(first), Some(last)) = (away.first(), away.last()) {
        let (first, last) = (first.display(), last.display());
        lines.push(match away.len() {
            1 => format!("taxel: {first} is not there any more: others moved or removed it when it was finished"),
            count => format!(
                "taxel: {count} files are not there any more, {first} to {last}: others moved or removed them when they \
                 were finished"
            ),
        });
    }
    for CanInput { name, address } in silent(finished) {
        lines.push(format!(
            "taxel: no CAN frame came of {name} from {address}: no board sends there, or the hand's bus is another; \
             --can {name}=SOURCE names it"
        ));
    }
    let lacking: Vec<_> = lacking(finished).collect();
    let told = lacking.iter().take(MOST_TOLD);
    lines.extend(told.map(|problem| format!("taxel: at the end: {}", problem.sentence)));
    if lacking.len() > MOST_TOLD {
        let others = lacking.len() - MOST_TOLD;
        lines.push(format!("taxel: and {others} more; `taxel status` has them"));
    }
    for (count, what) in [
        (
            *can_lost,
            "CAN frames were lost in the kernel; a larger net.core.rmem_max holds more",
        ),
        (
            *skipped,
            "images or frames were passed over by the daemon, since this machine is too busy",
        ),
        (*dropped, "messages were dropped, since the disk is too slow"),
    ] {
        if count > 0 {
            lines.push(format!("taxel: {count} {what}"));
        }
    }
    let missing = lines.into_iter().map(|line| (Priority::Warning, line));
    let there_is = what_there_is(plan, finished, &files, &away);
    std::iter::once(there_is).chain(missing).collect()
}

/// The files that there are and what is in them, or that there are none.
fn what_there_is(
    plan: &Plan,
    finished: &Finished,
    files: &[&PathBuf],
    away: &[&PathBuf],
) -> (Priority, String) {
    let bytes: u64 = files
        .iter()
        .filter_map(|file| std::fs::metadata(file).ok())
        .map(|file| file.len())
        .sum();
    let removed = finished.removed;
    let name = match files {
        [] if !finished.gone.is_empty() || !away.is_empty() => {
            "taxel: no file of the recording is there".into()
        }
        [] if finished.failure.is_some() => "taxel: nothing was recorded".into(),
        [] if plan.around.is_some() => {
            "taxel: nothing was kept: no trigger came, or nothing before one".into()
        }
        [] => "taxel: nothing came of a daemon or of a bus, and no file was made".into(),
        [only] => only.display().to_string(),
        files if removed == 0 => format!("{} files of {}", files.len(), plan.out.display()),
        files => format!(
            "{} files of {}, after {removed} older ones were removed",
            files.len(),
            plan.out.display()
        ),
    };
    match files.is_empty() {
        true => (Priority::Warning, name),
        false => (
            Priority::Info,
            format!(
                "{name}: {:.1} MB, {}; {} and {} were read",
                bytes as f64 / 1e6,
                plural(finished.messages, "message"),
                plural(finished.images, "image"),
                plural(can_frames(finished), "CAN frame")
            ),
        ),
    }
}

/// The same as one object.
pub(super) fn in_json(finished: &Finished) -> Value {
    let names = |files: Vec<&PathBuf>| -> Vec<String> {
        files.into_iter().map(|file| file.display().to_string()).collect()
    };
    let [there, away] = there_and_away(finished);
    json!({
        "files": names(there),
        "away": names(away),
        "removed": finished.removed,
        "gone": finished.gone.iter().map(|gone| gone.path.display().to_string()).collect::<Vec<_>>(),
        "can_frames": can_frames(finished),
        "silent": silent(finished).map(|bus| &bus.name).collect::<Vec<_>>(),
        "lacking": lacking(finished).map(|problem| &problem.kind).collect::<Vec<_>>(),
        "can_lost": finished.can_lost,
        "images": finished.images,
        "skipped": finished.skipped,
        "dropped": finished.dropped,
        "messages": finished.messages,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_recorder::{Around, Preamble, Split};

    /// What is told, one like the other.
    fn texts(plan: &Plan, finished: &Finished) -> Vec<String> {
        words(plan, finished).into_iter().map(|(_, line)| line).collect()
    }

    fn plan(out: PathBuf, can: Vec<CanInput>) -> Plan {
        Plan {
            out,
            socket: None,
            can,
            split: Split::default(),
            around: None,
            mark_triggers: false,
            duration: None,
            preamble: Preamble::default(),
        }
    }

    #[test]
    fn what_the_daemon_misses_is_told_where_it_is_not_of_a_bus_that_was_read() {
        let problem = |kind: &str, bus: Option<&str>, severe| ProblemStatus {
            kind: kind.into(),
            bus: bus.map(str::to_owned),
            severe,
            sentence: format!("{kind} is wrong"),
            ..ProblemStatus::default()
        };
        let can0 = CanInput {
            name: "can0".into(),
            address: "can:can0".parse().unwrap(),
        };
        let plan = plan("day.mcap".into(), Vec::new());
        let mut finished = Finished {
            can: vec![CanRead {
                input: can0,
                frames: 1,
            }],
            problems: vec![
                problem("bus-silent", Some("can0"), true),
                problem("bus-silent", Some("touch"), true),
                problem("analogue-silent", None, true),
                problem("servo-hot", None, false),
            ],
            ..Finished::default()
        };
        let lines = texts(&plan, &finished);
        let told = [
            "taxel: at the end: bus-silent is wrong",
            "taxel: at the end: analogue-silent is wrong",
        ];
        assert_eq!(lines[1..], told);
        let kinds = ["bus-silent", "analogue-silent"];
        assert_eq!(in_json(&finished)["lacking"], json!(kinds));
        finished.problems = vec![problem("servo-silent", None, true); 7];
        let last = texts(&plan, &finished).pop().unwrap();
        assert_eq!(last, "taxel: and 3 more; `taxel status` has them");
    }

    #[test]
    fn finished_files_that_others_took_away_are_not_counted_as_there() {
        let folder = tempfile::tempdir().unwrap();
        let [first, second, third] = [1, 2, 3].map(|n| folder.path().join(format!("day-000{n}.mcap")));
        std::fs::write(&third, "there").unwrap();
        let mut plan = plan(folder.path().join("day.mcap"), Vec::new());
        let mut finished = Finished {
            files: vec![first.clone(), second.clone(), third.clone()],
            ..Finished::default()
        };
        assert_eq!(there_and_away(&finished), [vec![&third], vec![&first, &second]]);
        let lines = texts(&plan, &finished);
        assert!(
            lines[0].starts_with(&format!("{}: 0.0 MB", third.display())),
            "{lines:?}"
        );
        let said = format!(
            "taxel: 2 files are not there any more, {} to {}: ",
            first.display(),
            second.display()
        );
        assert!(lines[1].starts_with(&said), "{lines:?}");
        finished.files.truncate(1);
        let lines = texts(&plan, &finished);
        assert!(
            lines[0].starts_with("taxel: no file of the recording is there"),
            "{lines:?}"
        );
        assert!(
            lines[1].contains("day-0001.mcap is not there any more"),
            "{lines:?}"
        );
        // So it is where a trigger had it kept, and what else is missing is told too.
        plan.around = Some(Around {
            before_ns: 1,
            after_ns: 1,
        });
        assert_eq!(texts(&plan, &finished), lines);
        finished.files.clear();
        finished.dropped = 3;
        let lines = texts(&plan, &finished);
        assert!(lines[0].starts_with("taxel: nothing was kept"), "{lines:?}");
        assert!(
            lines[1].starts_with("taxel: 3 messages were dropped"),
            "{lines:?}"
        );
    }
}
