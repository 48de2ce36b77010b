//! `taxel doctor --scan`: what speaks on unknown buses, as a layout file.

use super::bus_listener::{BusListener, Listener};
use super::link;
use super::starting::Asked;
use crate::wrap::wrap;
use anyhow::bail;
use serde_json::json;
use std::io::{self, Write};
use std::path::Path;
use taxel_can::{LinkState, LogSource, Received, SourceAddress, id_text};
use taxel_hand::{plural, shell_word};
use taxel_playback::interrupt::Interrupt;
use taxel_playback::output_file::OutputFile;
use taxel_playback::stand_in::as_named;
use taxel_playback::traffic::Traffic;
use taxel_skin::{Layout, RecognisedBus, Recogniser, Recognition};
use taxeld::stdout;

const RECEIVE_BUFFER: usize = 4 << 20;
/// How the sentence goes on that no board was heard, where none was asked for.
const START: &str =
    "; MTBs and CySkin hubs wait to be started: --start asks for them and starts those that answer";

/// What to scan, and how.
#[derive(Debug)]
pub(super) struct Scan<'a> {
    pub(super) sources: &'a [SourceAddress],
    pub(super) seconds: f64,
    /// Ask silent buses for MTBs, and start those that answer, or CySkin hubs.
    pub(super) start: bool,
    pub(super) out: Option<&'a Path>,
    pub(super) json: bool,
}

/// A bus to listen to, and how it is called in the layout file.
#[derive(Debug, Clone)]
pub(crate) struct Bus {
    pub(crate) name: String,
    pub(crate) source: SourceAddress,
}

/// Listens, recognises, and writes the proposed file; says whether any board was recognised.
pub(super) fn run(scan: &Scan<'_>, root: &Path, interrupt: Interrupt) -> anyhow::Result<bool> {
    let buses = buses(scan.sources, root)?;
    let (found, asked) = hear(&buses, scan.seconds, scan.start, interrupt)?;
    tell(scan, &buses, &found, asked.as_ref())
}

/// Listens to these buses and recognises what speaks there. With `start`, silent buses are asked for boards, and those
/// that answer speak meanwhile: who did is the second; a recording is heard to its end.
pub(crate) fn hear(
    buses: &[Bus],
    seconds: f64,
    start: bool,
    interrupt: Interrupt,
) -> anyhow::Result<(Recognition, Option<Asked>)> {
    let sources: Vec<SourceAddress> = buses.iter().map(|bus| bus.source.clone()).collect();
    let (mut bus_listener, failures) = BusListener::open(&sources, None, RECEIVE_BUFFER, interrupt);
    if let Some((bus, error)) = failures.into_iter().next() {
        return Err(error.context(buses[bus].source.to_string()));
    }
    for (number, bus) in buses.iter().enumerate() {
        if let (SourceAddress::Can { interface }, LinkState::Down | LinkState::Absent) =
            (&bus.source, bus_listener.link(number))
        {
            bail!(
                "{interface} is {}; `taxel doctor` says how to bring it up",
                bus_listener.link(number)
            );
        }
    }
    let mut recogniser = Recogniser::new(buses.len());
    let mut asked = None;
    if start && bus_listener.is_live() {
        asked = Some(Asked::start(
            &mut bus_listener,
            buses.len() as u8,
            &mut recogniser,
        )?);
    }
    let length_ns = if bus_listener.is_live() {
        (seconds * 1e9) as u64
    } else {
        u64::MAX / 2
    };
    let mut hearing = Hearing {
        recogniser: &mut recogniser,
    };
    let go_on = bus_listener.listen(length_ns, "listening", &mut hearing);
    if let Some(asked) = &asked {
        asked.stop(&mut bus_listener);
    }
    if !go_on {
        bail!("stopped before anything was recognised");
    }
    Ok((recogniser.finish(), asked))
}

/// The buses that are meant: a recording of several interfaces is several buses, and nothing named
/// is every CAN interface there is.
pub(crate) fn buses(sources: &[SourceAddress], root: &Path) -> anyhow::Result<Vec<Bus>> {
    let mut found = Vec::new();
    if sources.is_empty() {
        let names = link::can_interfaces(&root.join("sys/class/net"));
        if names.is_empty() {
            bail!(
                "this machine has no CAN interface; name a source, such as can:can0, udp::43113 or log:FILE"
            );
        }
        found.extend(names.into_iter().map(|interface| Bus {
            name: interface.clone(),
            source: SourceAddress::Can { interface },
        }));
    }
    for source in &distinct(sources) {
        match source {
            SourceAddress::Can { interface } => found.push(Bus {
                name: interface.clone(),
                source: source.clone(),
            }),
            SourceAddress::Log {
                path,
                interface: None,
            } => {
                for interface in interfaces(path)? {
                    found.push(Bus {
                        name: interface.clone(),
                        source: SourceAddress::Log {
                            path: path.clone(),
                            interface: Some(interface),
                        },
                    });
                }
            }
            SourceAddress::Log {
                interface: Some(interface),
                ..
            } => found.push(Bus {
                name: interface.clone(),
                source: source.clone(),
            }),
            // A scene is a hand: all of its buses.
            SourceAddress::Sim { scene } => {
                let scene = taxel_sim::Scene::resolve(scene)?;
                let layout = Layout::resolve(scene.layout())?;
                found.extend(layout.buses.iter().map(|name| Bus {
                    name: name.clone(),
                    source: source.clone(),
                }));
            }
            SourceAddress::Pressure { .. } => bail!(
                "{source} has nothing to recognise: an array's rows and columns are in its layout file (docs/hardware.md)"
            ),
            SourceAddress::Udp { .. } => found.push(Bus {
                name: format!("can{}", found.len()),
                source: source.clone(),
            }),
        }
    }
    for i in 0..found.len() {
        let before = found[..i]
            .iter()
            .filter(|b: &&Bus| b.name == found[i].name)
            .count();
        if before > 0 {
            found[i].name = format!("{}-{}", found[i].name, before + 1);
        }
    }
    if found.len() > taxeld::config::MAX_BUSES {
        bail!(
            "{} buses are more than the {} of one hand",
            found.len(),
            taxeld::config::MAX_BUSES
        );
    }
    Ok(found)
}

/// Each source once, however often it is named.
pub(crate) fn distinct(sources: &[SourceAddress]) -> Vec<SourceAddress> {
    let is_first = |(n, source): &(usize, &SourceAddress)| !sources[..*n].contains(source);
    let first = sources.iter().enumerate().filter(is_first);
    first.map(|(_, source)| source.clone()).collect()
}

/// The interfaces that a recording is of, by name.
pub(super) fn interfaces(recording: &Path) -> anyhow::Result<Vec<String>> {
    // Refuses what no bus can be played from, and says how it can.
    LogSource::open(recording, None, 0)?;
    let mut names = Traffic::candump(recording).interfaces()?;
    names.sort();
    Ok(names)
}

struct Hearing<'a> {
    recogniser: &'a mut Recogniser,
}

impl Listener for Hearing<'_> {
    fn handle_frame(&mut self, bus: u8, received: &Received) {
        self.recogniser.handle_frame(bus, received);
    }

    fn handle_turn(&mut self, _: &mut BusListener, _: u64) -> bool {
        true
    }
}

fn tell(scan: &Scan<'_>, buses: &[Bus], found: &Recognition, asked: Option<&Asked>) -> anyhow::Result<bool> {
    let names: Vec<&str> = buses.iter().map(|bus| bus.name.as_str()).collect();
    let name = match scan.out.and_then(Path::file_stem) {
        Some(stem) => stem.to_string_lossy().into_owned(),
        None => "scanned".into(),
    };
    let text = found.layout_file(&name, &names);
    if let (Some(path), Some(text)) = (scan.out, &text) {
        OutputFile::write(path, text)?;
    }
    if scan.json {
        let buses: Vec<_> = buses
            .iter()
            .zip(&found.buses)
            .map(|(bus, found)| json(bus, found))
            .collect();
        let object =
            json!({ "buses": buses, "builtin": found.builtin().map(|(name, _)| name), "layout": text });
        stdout::print(&(as_named(object.to_string()) + "\n"))?;
        return Ok(text.is_some());
    }
    // The file goes to stdout, so that it can be redirected; what is said about it does not.
    let mut said = Vec::new();
    for (number, (bus, found)) in (0u8..).zip(buses.iter().zip(&found.buses)) {
        let unheard = match asked {
            Some(asked) => asked.unheard(number, &bus.source),
            None => START.into(),
        };
        said.extend(words(bus, found, scan.seconds, &unheard));
        said.extend(asked.and_then(|asked| asked.kept_quiet(number, &bus.name, found)));
    }
    if let Some((builtin, silent)) = found.builtin() {
        let but = but_silent(silent);
        said.push(format!(
            "These are the boards of the built-in hand {builtin}{but}."
        ));
    }
    match (&text, scan.out) {
        (None, _) => said.push("No board was recognised, so there is no layout to propose.".into()),
        (Some(_), Some(path)) => said.push(format!(
            "{} is written. Its comments say what is guessed; then try: taxel doctor --layout {} {}",
            path.display(),
            shell_word(path.display()),
            sources(buses, found)
        )),
        (Some(_), None) => {}
    }
    for line in said.iter().flat_map(|text| wrap(text, 80)) {
        let _ = writeln!(io::stderr(), "{line}");
    }
    if let (Some(text), None) = (&text, scan.out) {
        stdout::print(text)?;
    }
    Ok(text.is_some())
}

/// The sources of the buses that have boards.
fn sources(buses: &[Bus], found: &Recognition) -> String {
    let with_boards = buses
        .iter()
        .zip(&found.buses)
        .filter(|(_, found)| !found.boards.is_empty());
    let sources: Vec<String> = with_boards.map(|(bus, _)| shell_word(&bus.source)).collect();
    sources.join(" ")
}

/// What goes on behind the name of a hand of which so many taxels are silent.
pub(crate) fn but_silent(taxels: usize) -> String {
    match taxels {
        0 => String::new(),
        taxels => format!(", but for {} that no frame was heard of", plural(taxels, "taxel")),
    }
}

/// What was found on a bus, a sentence each; `unheard` goes on where no board was heard on a live one.
pub(crate) fn words(bus: &Bus, found: &RecognisedBus, seconds: f64, unheard: &str) -> Vec<String> {
    let name = &bus.name;
    let advice = match &bus.source {
        SourceAddress::Log { .. } => "",
        _ => unheard,
    };
    if found.frames == 0 {
        return vec![format!("{name}: nothing was heard in {seconds} s{advice}")];
    }
    // Somebody, such as a daemon, tells boards to start, and those that are there do not mean themselves by it.
    let is_silent = found.boards.is_empty() && found.others.is_empty();
    if is_silent && found.allegro.is_none() && found.array.is_none() {
        return vec![format!(
            "{name}: no board was heard in {seconds} s, commands and answers alone ({}){advice}",
            plural(found.frames as usize, "frame")
        )];
    }
    if let Some([rows, columns]) = found.array {
        return vec![format!(
            "{name}: a pressure array of {rows} x {columns} taxels; write it into a layout as `protocol = \"pressure-array\"`, \
             rows = {rows}, columns = {columns} (docs/hardware.md)"
        )];
    }
    let doubts = found.doubts.iter().map(|doubt| format!("DOUBT: {doubt}"));
    [boards(found)]
        .into_iter()
        .chain(allegro(bus, found))
        .chain(strangers(found))
        .chain(doubts)
        .map(|said| format!("{name}: {said}"))
        .collect()
}

fn boards(found: &RecognisedBus) -> String {
    let Some(first) = found.boards.first() else {
        return format!("no board of a known skin in {}", plural(found.frames, "frame"));
    };
    let kind = if first.hub.is_some() { "module" } else { "board" };
    let mut protocols: Vec<&str> = found.boards.iter().map(|b| b.protocol.name()).collect();
    protocols.dedup();
    let boards = found.boards.iter().map(|b| match b.hub {
        Some(hub) => format!("{hub:#x}/{} ({})", b.board, b.taxels.len()),
        None => format!("{} ({})", b.board, b.taxels.len()),
    });
    format!(
        "{} of {}: {} (taxels)",
        plural(found.boards.len(), kind),
        protocols.join(" and "),
        boards.collect::<Vec<_>>().join(", ")
    )
}

fn allegro(bus: &Bus, found: &RecognisedBus) -> Option<String> {
    let version = if found.allegro? == 4 {
        "4 or 5"
    } else {
        "1, 2 or 3"
    };
    let beside = match found.boards.is_empty() {
        true => "",
        false => ". Hand and skin overlap in their ids and belong on different buses",
    };
    Some(format!(
        "an Allegro hand of version {version} reports its joints; [joints] source = \"allegro:{}\"{beside}",
        bus.source
    ))
}

/// Ids that nobody is known to have.
fn strangers(found: &RecognisedBus) -> Option<String> {
    let ids: Vec<String> = found.others.iter().take(8).map(|id| id_text(*id)).collect();
    let more = if found.others.len() > ids.len() {
        ", ..."
    } else {
        ""
    };
    let count = plural(found.others.len(), "id");
    (!ids.is_empty()).then(|| format!("{count} of nobody known: {}{more}", ids.join(", ")))
}

pub(crate) fn json(bus: &Bus, found: &RecognisedBus) -> serde_json::Value {
    let boards: Vec<_> = found
        .boards
        .iter()
        .map(|b| {
            json!({
                "protocol": b.protocol.name(),
                "board": b.board,
                "hub": b.hub,
                "taxels": b.taxels,
                "rate_hz": b.rate_hz,
            })
        })
        .collect();
    json!({
        "name": bus.name,
        "source": bus.source.to_string(),
        "frames": found.frames,
        "seconds": found.seconds,
        "boards": boards,
        "allegro": found.allegro,
        "array": found.array,
        "others": found.others.iter().map(|id| id_text(*id)).collect::<Vec<_>>(),
        "doubts": found.doubts,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn where_no_board_speaks_it_is_said_how_to_start_them_whether_or_not_somebody_commands_them() {
        let heard = |frames, others: &[u32]| RecognisedBus {
            frames,
            others: others.to_vec(),
            ..RecognisedBus::default()
        };
        for (source, found, begin, says_start) in [
            ("can:can0", heard(0, &[]), "can0: nothing was heard in 2 s;", true),
            (
                "can:can0",
                heard(9, &[]),
                "can0: no board was heard in 2 s, commands and answers alone (9 frames);",
                true,
            ),
            (
                "can:can0",
                heard(9, &[0x123]),
                "can0: no board of a known skin in 9 frames",
                false,
            ),
            ("log:a.log", heard(9, &[]), "can0: no board was heard", false),
        ] {
            let bus = Bus {
                name: "can0".into(),
                source: source.parse().unwrap(),
            };
            let said = words(&bus, &found, 2.0, START);
            assert!(said[0].starts_with(begin), "{said:?}");
            assert_eq!(said[0].contains("--start"), says_start, "{said:?}");
        }
    }

    #[test]
    fn a_recording_of_two_interfaces_and_a_scene_are_several_buses() {
        let dir = tempfile::TempDir::new().unwrap();
        let log = dir.path().join("two.log");
        std::fs::write(&log, "(0.000000) can1 124#00\n(0.000001) can0 123#00\n").unwrap();
        let source = |text: &str| text.parse::<SourceAddress>().unwrap();
        let log = source(&format!("log:{}", log.display()));
        let names = |sources: &[SourceAddress]| -> Vec<String> {
            let buses = buses(sources, dir.path()).unwrap();
            buses.into_iter().map(|bus| bus.name).collect()
        };
        assert_eq!(names(std::slice::from_ref(&log)), ["can0", "can1"]);
        assert_eq!(names(&[source("sim:idle")]), ["can0", "can1"]);
        assert_eq!(names(&[log, source("can:can0")]), ["can0", "can1", "can0-2"]);
        assert_eq!(
            names(&[source("udp::43113"), source("udp::43114")]),
            ["can0", "can1"]
        );
        assert!(
            buses(&[], dir.path())
                .err()
                .unwrap()
                .to_string()
                .contains("no CAN interface")
        );
    }
}
