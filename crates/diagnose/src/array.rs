//! What is wrong with a pressure array, whose frames a program sends to a socket.

use crate::kind::Kind;
use crate::names::board_name;
use crate::problem::{Place, Problem};
use crate::view::Look;
use taxel_can::{ArrayCounters, SourceAddress};
use taxel_hand::plural;
use taxel_skin::{BoardState, Layout, stale_after_ns};

/// Arrays send a few frames a second: one is silent after this long, nanoseconds.
pub(crate) const SILENCE_NS: u64 = 1_000_000_000;
/// So many sequences that begin anew within the time looked at are two programs.
const SENDERS: u64 = 2;

pub(crate) fn judge(look: &Look<'_>, index: usize, found: &mut Vec<Problem>) {
    let address = &look.setup.sources[index];
    if !matches!(address, SourceAddress::Pressure { .. }) {
        return;
    }
    let name = &look.setup.layout.buses[index];
    let (now, before) = (&look.view.buses[index].counters.array, &look.before[index].array);
    let size = look.setup.layout.array_on(index).unwrap_or_default();
    let mut report = |kind, what: String, advice: &str, over: &str| {
        let (what, over) = (format!("{name}: {what}"), format!("{name}: {over}"));
        found.push(Problem::new(kind, Place::Bus(index), what, advice, over));
    };
    if let Some((what, advice)) = refused(now, before, size) {
        report(Kind::ArrayRefused, what, advice, "nothing is refused any more");
    }
    if now.restarts - before.restarts >= SENDERS {
        report(
            Kind::ArraySenders,
            format!(
                "two programs seem to send frames to {address}: their sequence numbers jump back again and again"
            ),
            "end one of them, or have the one that sends count its frames",
            "one program sends",
        );
    } else if now.lost > before.lost {
        report(
            Kind::ArrayLost,
            format!(
                "{} did not come, by their sequence numbers",
                plural(now.lost - before.lost, "frame")
            ),
            "the sending program drops them: its send would block, or it is too slow for the sensor",
            "no more frames are missing",
        );
    }
    let timed = now.timed - before.timed;
    let age_ns = (now.aged_ns - before.aged_ns).checked_div(timed).unwrap_or(0);
    let stale_ns = stale_ns(look, index).filter(|stale_ns| age_ns > *stale_ns);
    // The mean of frames that have just begun to come late is still on its way.
    let age_ms = age_ns.max(now.newest_age_ns) / 1_000_000;
    if let Some(stale_ns) = stale_ns {
        report(
            Kind::ArrayLate,
            format!(
                "frames come {age_ms} ms after they were measured, and a value is stale after {} ms: its taxels are missing",
                stale_ns / 1_000_000
            ),
            "set `stale_after_ms` in [sweep] well over that, or have the sending program send sooner, or with the time 0; its \
             time has to be CLOCK_MONOTONIC of this machine",
            "frames come in time",
        );
    } else if now.late > before.late {
        report(
            Kind::ArrayLate,
            "frames come more than 250 ms after they were measured".into(),
            "the sending program is too slow, or its time is not CLOCK_MONOTONIC of this machine (0 where it has none)",
            "frames come in time",
        );
    }
}

/// Why frames were refused, and what to do; `None` where none was.
fn refused(
    now: &ArrayCounters,
    before: &ArrayCounters,
    [rows, columns]: [u16; 2],
) -> Option<(String, &'static str)> {
    if now.refused() == before.refused() {
        return None;
    }
    let [other_rows, other_columns] = now.other_size;
    Some(match () {
        () if now.size > before.size => (
            format!("frames of {other_rows} x {other_columns} are refused; the array has {rows} x {columns}"),
            "send rows x columns as the layout has them, or mend the layout",
        ),
        () if now.torn > before.torn => (
            format!(
                "frames with too few or too many counts are refused; {rows} x {columns} have {}",
                u32::from(rows) * u32::from(columns)
            ),
            "each count is two bytes, least significant first",
        ),
        () if now.version > before.version => (
            "frames of another version are refused".into(),
            "the version is the fifth byte, 1 (docs/protocols.md, \"Pressure arrays\")",
        ),
        () => (
            "what is sent there is no frame of a pressure array".into(),
            "see docs/protocols.md, \"Pressure arrays\"; does another program send to this socket?",
        ),
    })
}

/// How old a value of the array on a bus (index) is when it is stale, nanoseconds; `None` where its period is still to be
/// measured.
fn stale_ns(look: &Look<'_>, index: usize) -> Option<u64> {
    let wiring = look.setup.layout.wiring.iter();
    let here = look
        .view
        .boards
        .iter()
        .zip(wiring)
        .filter(|(_, wiring)| usize::from(wiring.bus) == index);
    let slowest_ns = here.filter_map(|(board, _)| board.period_ns).max();
    look.setup.stale_ns.or(slowest_ns.map(stale_after_ns))
}

/// Whether the frames of an array on a bus (index) come, though late: then nothing has stopped.
pub(crate) fn is_late(found: &[Problem], index: usize) -> bool {
    found
        .iter()
        .any(|p| (p.kind, p.place) == (Kind::ArrayLate, Place::Bus(index)))
}

/// An array of which nothing comes.
pub(crate) fn silent(address: &SourceAddress, layout: &Layout, module: usize, state: BoardState) -> Problem {
    let name = board_name(layout, module);
    let (kind, what) = match state {
        BoardState::NeverSeen => (Kind::BoardUnheard, "no frame has come since the start"),
        _ => (Kind::BoardSilent, "no more frames come"),
    };
    let advice = match address {
        SourceAddress::Pressure { .. } => {
            format!("check that the program of its sensor runs, and sends to {address}. The rest goes on")
        }
        _ => "check what sends its frames. The rest goes on".into(),
    };
    Problem::new(
        kind,
        Place::Module(module),
        format!("{name}: {what}"),
        advice,
        format!("{name}: frames come"),
    )
}

/// What is said of an array whose frames stopped several times of late, and what to do.
pub(crate) fn unsteady(name: &str, times: usize) -> (String, String) {
    (
        format!("{name}: its frames stopped {times} times within half a minute"),
        "look at the program of its sensor, which pauses or is started anew, and at the sensor's plug".into(),
    )
}
