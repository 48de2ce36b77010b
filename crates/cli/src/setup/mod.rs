//! `taxel setup`: from boards on a bus to a configuration in which each module is where it was pressed.

mod answers;
mod hand;
mod joints;
mod layout_text;
mod outcome;
mod place;
mod touch;

use crate::doctor;
use crate::doctor::asked;
use crate::doctor::daemon::{self, Daemon};
use crate::doctor::finding::{Check, State};
use crate::doctor::link::{self, LinkFacts};
use crate::doctor::report::{Report, Style};
use crate::doctor::scan::{self, Bus};
use crate::errors::wrong_use;
use crate::seconds::seconds;
use answers::{Answers, say};
use anyhow::{Context, bail};
use hand::Heard;
use joints::Joints;
use outcome::{Hand, Origin, Outcome, may_write};
use place::Pressing;
use std::path::{Path, PathBuf};
use std::time::Duration;
use taxel_can::{AddressError, SourceAddress};
use taxel_hand::plural;
use taxel_playback::interrupt::Interrupt;
use taxel_skin::{Layout, Recognition};
use taxeld::stdout;

/// Boards that were heard, taken as they are: a hand of one's own.
const NEW: &str = "new";

/// Set a hand up: find its buses and boards, place each module by pressing it, write the configuration.
///
/// Each step is a question with a proposal in [ ]; Enter takes it. Options answer questions beforehand, the lines of
/// stdin answer the rest in their order, and --yes takes every proposal. Boards that wait for it are started and
/// stopped again. Nothing is written before the end, and no file is overwritten without being told.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  taxel setup                                  every CAN interface there is, questions as they come
  taxel setup can:can0 --out left.toml         one bus
  taxel setup --layout allegro-uskin-15        whatever the boards, it is this hand
  taxel setup --yes                            no questions: a built-in hand, or the boards as they were heard
  taxel setup --yes --touch --patience 120     no questions but presses
  taxel setup --dry-run --json log:hand.log    what would be written for a recording")]
pub(crate) struct Args {
    /// Where the buses are: can:INTERFACE, udp:GROUP:PORT or log:FILE [default: every CAN interface that is up]
    #[arg(value_name = "SOURCE")]
    sources: Vec<SourceAddress>,
    /// The hand: a built-in name, a layout file, or `new` for one whose modules are named as they are pressed
    #[arg(long, value_name = "LAYOUT")]
    layout: Option<String>,
    /// Place the modules by pressing them
    #[arg(long, overrides_with = "no_touch")]
    touch: bool,
    /// Take the boards as the layout has them, without pressing
    #[arg(long)]
    no_touch: bool,
    /// Where joint angles come from: dynamixel:DEVICE, allegro:INTERFACE or none
    #[arg(long, value_name = "SOURCE")]
    joints: Option<Joints>,
    /// Where to write; the layout file, where the hand is not built in, goes beside it
    #[arg(long, value_name = "FILE", default_value = "taxeld.toml")]
    out: PathBuf,
    /// Overwrite files that exist
    #[arg(long)]
    force: bool,
    /// Write nothing, print what would be written
    #[arg(long)]
    dry_run: bool,
    /// Answer every question with its proposal
    #[arg(long, short)]
    yes: bool,
    /// Send nothing: boards that wait to be started are not found
    #[arg(long)]
    listen_only: bool,
    /// How long to listen for boards
    #[arg(long, value_name = "S", value_parser = seconds(0.001..=86_400.0), default_value = "2")]
    seconds: Duration,
    /// How long to wait for each press where nobody types
    #[arg(long, value_name = "S", value_parser = seconds(0.001..=86_400.0), default_value = "60")]
    patience: Duration,
    /// One JSON object on stdout in the end: the hand, the files and their text
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let interrupt = Interrupt::install()?;
    let answers = Answers::new(args.yes, interrupt.clone())?;
    if !args.dry_run {
        may_write(&args.out, args.force, &answers)?;
    }
    let buses = find_buses(args, Path::new("/"), &answers)?;
    let named = args.layout.as_deref().filter(|layout| *layout != NEW);
    let named = named.map(Layout::resolve).transpose()?;
    let found = find_boards(args, &buses, named.as_ref(), &answers, &interrupt)?;
    let name = args.out.file_stem().unwrap_or_default().to_string_lossy();
    let heard = Heard::new(&buses, &found, &name)?.context(
        "no board was recognised, so there is nothing to set up; `taxel doctor` looks at the buses",
    )?;
    let allegro = buses
        .iter()
        .zip(&found.buses)
        .find_map(|(bus, found)| Some((bus.source.clone(), found.allegro?)));
    // Before anybody has pressed anything.
    let stated = args.joints.as_ref();
    let stated = stated
        .map(|joints| joints::stated(joints, allegro.as_ref(), &answers))
        .transpose()?;
    let mut hand = choose(args, &heard, &name, &answers, &interrupt)?;
    let joints = match stated {
        Some(joints) => joints,
        None => joints::asked(allegro.as_ref(), &answers)?,
    };
    hand.joints = joints.named(&hand.layout.joints(), &answers)?;
    let outcome = Outcome::new(&hand, &args.out, &answers, args.force)?;
    if interrupt.is_set() {
        bail!(answers::STOPPED);
    }
    if !args.dry_run {
        outcome.write()?;
        outcome.next_steps(&hand);
    }
    if args.json {
        stdout::print(&format!("{}\n", outcome.json(&hand, !args.dry_run)))?;
    } else if args.dry_run {
        outcome.print()?;
    }
    Ok(())
}

/// The buses that are named, or the CAN interfaces that are up; says what is wrong with the others.
fn find_buses(args: &Args, root: &Path, answers: &Answers) -> anyhow::Result<Vec<Bus>> {
    if let Some(scene) = args
        .sources
        .iter()
        .find(|s| matches!(s, SourceAddress::Sim { .. }))
    {
        bail!("{scene}: a scene is no bus; `taxel sim SCENE --to udp:` puts it on one");
    }
    let named = scan::distinct(&args.sources);
    let names: Vec<String> = match named.is_empty() {
        true => link::can_interfaces(&root.join("sys/class/net")),
        false => named.iter().filter_map(interface).collect(),
    };
    let sources = match named.is_empty() {
        true => names.iter().map(|name| can(name)).collect::<Result<_, _>>()?,
        false => named,
    };
    refuse_shared(&sources, args, answers)?;
    let mut usable = Vec::new();
    let mut report = Report::new(std::io::stderr(), Style::of_stderr());
    let needs_can = args.sources.is_empty() || !names.is_empty();
    if let Some(check) = doctor::without_can_sockets(root).filter(|_| needs_can) {
        report.write(&[check]).context("stderr")?;
        bail!(
            "no CAN interface can be heard here; a bus elsewhere is named, such as udp::43113, and a recording log:FILE"
        );
    }
    for name in names {
        let checks = link::check(&LinkFacts::read(root, &name), None);
        let is_wrong = |check: &Check| matches!(check.state, State::Error | State::Warning);
        let is_down =
            |check: &Check| check.state == State::Error && ["interface", "link"].contains(&&*check.name);
        let wrong: Vec<Check> = checks.iter().filter(|check| is_wrong(check)).cloned().collect();
        report.write(&wrong).context("stderr")?;
        if !checks.iter().any(is_down) {
            usable.push(name);
        }
    }
    if !args.sources.is_empty() {
        if let Some(down) = args
            .sources
            .iter()
            .filter_map(interface)
            .find(|name| !usable.contains(name))
        {
            bail!("{down} cannot be heard; what stands above brings it up");
        }
        return scan::buses(&args.sources, root);
    }
    if usable.is_empty() {
        bail!(
            "there is no CAN interface that is up; `taxel doctor` says what is wrong, and a bus elsewhere is named, such as \
             udp::43113"
        );
    }
    let proposal = usable.join(" ");
    let chosen = answers.ask("CAN interfaces of this hand", &proposal)?;
    let sources = chosen
        .split_whitespace()
        .map(|name| can(name.trim_start_matches("can:")))
        .collect::<Result<Vec<_>, _>>()?;
    scan::buses(&sources, root)
}

fn can(interface: &str) -> Result<SourceAddress, AddressError> {
    format!("can:{interface}").parse()
}

/// Refuses the boards of a running daemon, which two must not start and stop, unless told to go on. Who only listens
/// is told of it.
fn refuse_shared(sources: &[SourceAddress], args: &Args, answers: &Answers) -> anyhow::Result<()> {
    for service in asked::services() {
        refuse_shared_with(&service, sources, args, answers)?;
    }
    Ok(())
}

/// The same of the daemon of this service, at this status socket.
fn refuse_shared_with(
    (service, socket): &(String, PathBuf),
    sources: &[SourceAddress],
    args: &Args,
    answers: &Answers,
) -> anyhow::Result<()> {
    let stop = format!("`sudo systemctl stop {service}`, or Ctrl-C where you have started it");
    let (who, question) = match daemon::ask(socket) {
        Daemon::Running(status) => {
            let shared = daemon::shared(&status, sources);
            if shared.is_empty() {
                return Ok(());
            }
            let shared: Vec<String> = shared.iter().map(ToString::to_string).collect();
            let shared = shared.join(" and ");
            (
                format!(
                    "A daemon reads {shared} (it is asked at {}). Stop it first: {stop}.",
                    socket.display()
                ),
                format!("Set up {shared} beside it, starting and stopping its boards"),
            )
        }
        untold @ (Daemon::Forbidden | Daemon::Hung) if sources.iter().any(is_live) => (
            format!(
                "A daemon runs on this machine, and {}. If these are its boards, stop it first: {stop}.",
                match untold {
                    Daemon::Hung => "does not answer which boards it has",
                    _ => "this user may not ask it which boards it has",
                }
            ),
            "Go on, since these are not its boards".into(),
        ),
        Daemon::Forbidden | Daemon::Hung | Daemon::Absent | Daemon::Strange(_) => return Ok(()),
    };
    say(&who);
    if !args.listen_only && !answers.confirm(&question, false)? {
        bail!("nothing was sent and nothing written; stop the daemon, or --listen-only sends nothing");
    }
    Ok(())
}

fn is_live(source: &SourceAddress) -> bool {
    !matches!(source, SourceAddress::Log { .. })
}

fn interface(source: &SourceAddress) -> Option<String> {
    match source {
        SourceAddress::Can { interface } => Some(interface.clone()),
        _ => None,
    }
}

/// Listens, and starts boards that wait for it, where that is allowed; says what was found. Of the layout that was `named`
/// also boards with too few taxels to be recognised are.
fn find_boards(
    args: &Args,
    buses: &[Bus],
    named: Option<&Layout>,
    answers: &Answers,
    interrupt: &Interrupt,
) -> anyhow::Result<Recognition> {
    let seconds = args.seconds.as_secs_f64();
    let hear = |start| {
        let (mut found, asked) = scan::hear(buses, seconds, start, interrupt.clone())?;
        // Boards of one's own may have too few taxels to be known by themselves.
        if let Some(layout) = named {
            found.take_boards_of(layout);
        }
        anyhow::Ok((found, asked))
    };
    let (mut found, mut asked) = hear(false)?;
    let silent: Vec<&str> = buses
        .iter()
        .zip(&found.buses)
        .filter(|(bus, found)| is_live(&bus.source) && found.boards.is_empty())
        .map(|(bus, _)| bus.name.as_str())
        .collect();
    if !silent.is_empty() && !args.listen_only {
        let question = format!(
            "No board speaks on {}. Ask for boards there and start them",
            silent.join(", ")
        );
        if answers.confirm(&question, true)? {
            (found, asked) = hear(true)?;
        }
    }
    for (number, (bus, found)) in (0u8..).zip(buses.iter().zip(&found.buses)) {
        let unheard = (asked.as_ref()).map_or(String::new(), |asked| asked.unheard(number, &bus.source));
        let quiet = (asked.as_ref()).and_then(|asked| asked.kept_quiet(number, &bus.name, found));
        for line in scan::words(bus, found, seconds, &unheard)
            .into_iter()
            .chain(quiet)
        {
            say(&line);
        }
    }
    Ok(found)
}

/// The hand that these boards are, each module with its board.
fn choose(
    args: &Args,
    heard: &Heard,
    name: &str,
    answers: &Answers,
    interrupt: &Interrupt,
) -> anyhow::Result<Hand> {
    let layout = match &args.layout {
        Some(layout) => layout.clone(),
        None => which_hand(args, heard, answers)?,
    };
    let can_press = heard.sources.iter().all(is_live);
    if args.touch && !can_press {
        return Err(wrong_use("--touch: nobody can press a recording"));
    }
    let press = |proposal: bool| match (args.touch, args.no_touch || !can_press) {
        (true, _) => Ok(true),
        (_, true) => Ok(false),
        _ => answers.confirm("Place the modules by pressing them", proposal),
    };
    let begin = || Pressing::begin(heard, answers, args.listen_only, args.patience, interrupt.clone());
    if layout == NEW {
        let names = match press(!args.yes)? {
            true => begin()?.name()?,
            false => Vec::new(),
        };
        let text = heard.named_hand(&names, name)?;
        return hand_of(text, heard);
    }
    let (template, text) = hand::resolve(&layout)?;
    let wired = heard
        .wired_as(&template)
        .map(|buses| (heard.places(&template, &buses), buses));
    let as_it_is = |buses: &[usize]| Hand {
        layout: template.clone(),
        origin: match Layout::builtin_text(&layout) {
            Some(_) => Origin::BuiltIn(layout.clone()),
            None => Origin::File(layout.clone().into(), text.clone()),
        },
        sources: buses.iter().map(|bus| heard.sources[*bus].clone()).collect(),
        joints: String::new(),
    };
    // One board for one module: there is nothing to tell apart by pressing.
    let is_one = template.modules.len() == 1 && heard.layout.modules.len() == 1;
    if is_one && !heard.can_be(0, &template, 0) {
        bail!(
            "the one board that was heard is {}; name a layout that it fits, or take it as it is (--layout new)",
            heard.misfit(0, &template, 0)
        );
    }
    let places = match &wired {
        _ if !is_one && press(!args.yes)? => begin()?.place(&template)?,
        Some((places, _)) => places.clone(),
        None if is_one => vec![Some(0)],
        None => bail!(
            "the boards of {layout} are wired otherwise than those that were heard: {}. Press its modules (--touch), or take the \
             boards as they are (--layout new)",
            heard.miswired(&template)
        ),
    };
    tell_fits(heard, &template, &places);
    if !places.iter().any(Option::is_some) {
        bail!("no module has a board, so there is no hand; nothing was written");
    }
    match wired.filter(|(wired, _)| *wired == places) {
        Some((_, buses)) => Ok(as_it_is(&buses)),
        None => hand_of(heard.placed(&template, &text, &places, name)?, heard),
    }
}

/// Asks which hand it is: a built-in one that the boards fit is proposed.
fn which_hand(args: &Args, heard: &Heard, answers: &Answers) -> anyhow::Result<String> {
    let fitting: Vec<(usize, &str, Layout)> = Layout::builtin_names()
        .filter_map(|name| Some((name, Layout::builtin(name)?)))
        .filter_map(|(name, layout)| Some((heard.fits(&layout)?, name, layout)))
        .collect();
    let least = fitting.iter().map(|(silent, ..)| *silent).min();
    let fitting: Vec<(&str, Layout)> = (fitting.into_iter())
        .filter(|(silent, ..)| Some(*silent) == least)
        .map(|(_, name, layout)| (name, layout))
        .collect();
    let is_same = |(_, layout): &&(&str, Layout)| heard.wired_as(layout).is_some();
    let proposal = match fitting.iter().find(is_same) {
        Some((name, _)) => name,
        // Without anybody to press its modules, a hand cannot be told from another of as many.
        None if args.yes && !args.touch => NEW,
        None => fitting.first().map_or(NEW, |(name, _)| name),
    };
    if let Some(silent) = least {
        let names: Vec<&str> = fitting.iter().map(|(name, _)| *name).collect();
        say(&format!(
            "The boards fit {}{}.",
            names.join(" and "),
            scan::but_silent(silent)
        ));
    }
    answers.ask("Which hand is it (a layout's name or file, or `new`)", proposal)
}

/// Says what the layout and what was heard do not have in common.
fn tell_fits(heard: &Heard, template: &Layout, places: &[Option<usize>]) {
    let modules = template
        .modules
        .iter()
        .zip(places)
        .filter(|(_, place)| place.is_none());
    let modules: Vec<&str> = modules.map(|(module, _)| module.name.as_str()).collect();
    if !modules.is_empty() {
        say(&format!("Without a board, and left out: {}", modules.join(", ")));
    }
    let boards = (0..heard.layout.modules.len()).filter(|board| !places.contains(&Some(*board)));
    let boards: Vec<String> = boards.map(|board| heard.board(board)).collect();
    if !boards.is_empty() {
        say(&format!("On no module, and not read: {}", boards.join(", ")));
    }
    let mut unread = Vec::new();
    for (place, (module, board)) in template.modules.iter().zip(places).enumerate() {
        let Some(board) = *board else { continue };
        let Some(fit) = heard.fit(board, template, place) else {
            continue;
        };
        let (called, name) = (heard.board(board), &module.name);
        if !fit.silent.is_empty() {
            let silent: Vec<String> = fit.silent.iter().map(|k| k.to_string()).collect();
            let [silent, of] = [silent.join(", "), module.taxels.to_string()];
            say(&format!(
                "Silent: taxels k = {silent} of the {of} of the {name} ({called})"
            ));
        }
        if fit.unread > 0 {
            unread.push(format!("{} of {called}", plural(fit.unread, "taxel")));
        }
    }
    if !unread.is_empty() {
        say(&format!("Not in the layout, and not read: {}", unread.join(", ")));
    }
}

/// A hand with a layout file of its own, its buses as they were heard.
fn hand_of(text: String, heard: &Heard) -> anyhow::Result<Hand> {
    let layout = Layout::parse(&text, "the layout")?;
    Ok(Hand {
        layout,
        origin: Origin::New(text),
        sources: heard.sources.clone(),
        joints: String::new(),
    })
}
