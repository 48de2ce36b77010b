//! `taxel sim`: a scene on a real or virtual bus.

use crate::client::scene_marks::SceneMarks;
use crate::errors::wrong_use;
use crate::forearm::play;
use crate::notices;
use crate::offered::offering;
use crate::piped_file::layout_parser;
use crate::seconds::seconds;
use anyhow::{Context, anyhow, bail};
use clap::builder::{StringValueParser, TypedValueParser};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use taxel_can::Received;
use taxel_hand::{did_you_mean, plural, shell_word};
use taxel_playback::interrupt::Interrupt;
use taxel_playback::target::{TargetAddress, Targets, of_buses, refuse_shared_ids};
use taxel_sim::servo::{SERVO_BAUD, ServoBus, ServoPty, StableLink, servo_clock_ns, servos_of_scene};
use taxel_sim::{Scene, SceneError, Simulator, stand_in_layout_file, with_stand_in_boards};
use taxel_skin::Layout;
use taxeld::stdout;

/// The longest that a command on a bus waits to be heard.
const LISTEN: Duration = Duration::from_millis(1);
/// Simulated at once when a scene is written to a log.
const LOG_STEP_NS: u64 = 10_000_000;

/// Put a simulated hand on a bus: its boards wait for start commands there, answer them, and feel
/// what the scene says.
///
/// On a bus the scene runs in real time, again and again until Ctrl-C or --seconds. Into a log it
/// is written once, at once, with every board started. The same scene, seed and commands give the
/// same frames.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  taxel sim --list
  taxel sim ball-grasp --to can:vcan0 --to can:vcan1
  taxel sim slip --to udp::43113 --to udp::43114 --seconds 60
  taxel sim tap --to log:tap.log
  taxel sim roll --layout icub-forearm --to udp:           any other hand; roll fits all of them
  taxel sim roll --layout schunk-sdh --show > sdh.toml     the layout file, with boards, of a hand that has none
  taxel sim ball-grasp --to udp::43113 --to udp::43114 --servos /tmp/servos > joints.toml
                                              the table [joints] for taxeld.toml, to read these servos
  taxel sim phantom-1 --to can:vcan0 --control /run/taxeld/control.sock
                                              a phantom's touches, and the marks that cut them (docs/palpation.md)
  taxel sim forearm --to pressure:/tmp/touch.sock --servos /tmp/servos --place 40
                                              a gripper's tactile finger, as its servos squeeze (docs/forearm.md)
  taxel sim ball-grasp --show > mine.toml     a scene file to start one's own from")]
pub(crate) struct Args {
    /// A built-in scene, or a scene file
    #[arg(value_name = "SCENE", required_unless_present = "list", value_parser = scene_parser(), hide_possible_values = true)]
    scene: Option<String>,
    /// Where the buses of the hand are: once for each bus in the layout's order, or once for all of them;
    /// can:INTERFACE, udp:GROUP:PORT, pressure:SOCKET of a daemon, log:FILE (candump), or - for candump lines on stdout
    #[arg(long, value_name = "SOURCE", required_unless_present_any = ["list", "show"])]
    to: Vec<TargetAddress>,
    /// Stop after so long [default: on a bus never, in a log when the scene ends]
    #[arg(long, value_name = "S", value_parser = seconds(0.001..=1e9))]
    seconds: Option<Duration>,
    /// Another seed for the noise than the scene's own
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Another hand than the scene's own: a built-in name or a layout file, - for stdin
    #[arg(long, value_name = "LAYOUT", value_parser = layout_parser())]
    layout: Option<String>,
    /// Boards send without having been started, for looking at the bus with candump
    #[arg(long)]
    autostart: bool,
    /// Offer simulated Dynamixel servos of the fingers, too, that move with the scene: LINK is
    /// made, a link to the pseudo terminal to be read as their serial port; stdout tells how, as the
    /// table `[joints]` of a taxeld.toml
    #[arg(long, value_name = "LINK")]
    servos: Option<PathBuf>,
    /// With --servos, for the scene `forearm`: offer the lines of the fingers' potentiometers, too, at
    /// this link; the table has them as `[joints.analogue]`
    #[arg(long, value_name = "LINK", requires = "servos")]
    potentiometers: Option<PathBuf>,
    /// Where on the forearm the gripper holds, percent from wrist to elbow; for the scene `forearm` [default: 50]
    #[arg(long, value_name = "PERCENT", value_parser = place)]
    place: Option<f64>,
    /// Make the scene's marks on the daemon with this control socket, as a robot would; phantoms have marks
    #[arg(long, value_name = "SOCKET")]
    control: Option<PathBuf>,
    /// Print the text of a built-in scene; with --layout, that of the layout that is simulated
    #[arg(long, conflicts_with_all = ["to", "list"])]
    show: bool,
    /// List the built-in scenes
    #[arg(long, conflicts_with = "scene")]
    list: bool,
    /// With --list: as JSON; `seconds` is null where the scene has no end
    #[arg(long, requires = "list", conflicts_with = "scene")]
    json: bool,
}

fn place(text: &str) -> Result<f64, String> {
    let percent = text
        .parse()
        .ok()
        .filter(|percent| (0.0..=100.0).contains(percent));
    percent.ok_or_else(|| {
        format!("{text} is no place on the forearm; give percent, from 0 (wrist) to 100 (elbow)")
    })
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    if args.list {
        return list(args.json);
    }
    let name = args
        .scene
        .as_deref()
        .context("name a scene; `taxel sim --list` lists them")?;
    if let (true, Some(layout)) = (args.show, args.layout.as_deref()) {
        return show_layout(layout);
    }
    if args.show {
        if name == play::SCENE {
            return Err(wrong_use(format!(
                "--show: the scene {name} is a gripper that is simulated, and has no file"
            )));
        }
        let meant = || did_you_mean(name, built_in());
        let text = Scene::builtin_text(name);
        return stdout::print(&text.with_context(|| {
            format!(
                "{name} is not built in; `taxel sim --list` lists what is{}",
                meant()
            )
        })?);
    }
    let limit_ns = args.seconds.map(|limit| limit.as_nanos() as u64);
    if name == play::SCENE {
        return play::run(&play::Playing {
            to: &args.to,
            servos: args.servos.as_deref(),
            potentiometers: args.potentiometers.as_deref(),
            place_percent: args.place.unwrap_or(50.0),
            seed: args.seed.unwrap_or(1),
            limit_ns,
        });
    }
    if args.potentiometers.is_some() {
        return Err(wrong_use(format!(
            "--potentiometers: only the gripper of the scene {} has them",
            play::SCENE
        )));
    }
    if args.place.is_some() {
        return Err(wrong_use(format!(
            "--place: only the gripper of the scene {} is put somewhere",
            play::SCENE
        )));
    }
    play_scene(args, name, limit_ns)
}

/// Plays a scene on the buses of a hand, or writes it into logs.
fn play_scene(args: &Args, name: &str, limit_ns: Option<u64>) -> anyhow::Result<()> {
    let scene = resolve(name)?;
    let named = Layout::resolve(args.layout.as_deref().unwrap_or(scene.layout()))?;
    let layout = with_stand_in_boards(&named)?;
    if named.buses.is_empty() {
        say!(
            "{} has no boards on a bus; simulated ones stand in for them. Their layout file for who reads the bus: taxel sim {} \
             --layout {} --show",
            named.name,
            shell_word(name),
            shell_word(&named.name)
        );
    }
    let seed = args.seed.unwrap_or(scene.seed());
    let named = of_buses(&args.to, &layout)?;
    refuse_shared_ids(&named, &layout)?;
    let mut targets = Targets::open(&named)?;
    if targets.are_logs() {
        args.refuse_real_time()?;
        let mut simulator = Simulator::new(&scene, &layout, seed)?;
        simulator.start_all();
        let length_ns = limit_ns.unwrap_or(u64::MAX).min(scene.length_ns());
        if limit_ns > Some(length_ns) {
            say!(
                "taxel: {} ends after {} s, and a log has it once",
                scene.name(),
                scene.seconds()
            );
        }
        write_log(simulator, &Interrupt::install()?, length_ns, &mut targets)?;
    } else {
        let places: Vec<String> = named
            .iter()
            .map(|(bus, address)| format!("{bus} on {address}"))
            .collect();
        let mut simulator = Simulator::looping(&scene, &layout, seed)?;
        if args.autostart {
            simulator.start_all();
        }
        say!("{}: {}; Ctrl-C stops it", scene.name(), places.join(", "));
        args.play_live(simulator, &scene, &layout, limit_ns, &mut targets)?;
    }
    targets.finish()?;
    say!(
        "{} sent{}",
        plural(targets.sent(), "frame"),
        match targets.failed() {
            0 => String::new(),
            failed => format!(", {failed} failed"),
        }
    );
    targets.check()
}

impl Args {
    /// Refuses, beside a log, what moves or marks in real time.
    fn refuse_real_time(&self) -> anyhow::Result<()> {
        if let Some(link) = &self.servos {
            return Err(wrong_use(format!(
                "--servos {}: servos move in real time; a log is written at once and has none",
                link.display()
            )));
        }
        if let Some(socket) = &self.control {
            return Err(wrong_use(format!(
                "--control {}: marks are made in real time; a log is written at once and has none",
                socket.display()
            )));
        }
        Ok(())
    }

    /// Plays a scene with its servos and marks.
    fn play_live(
        &self,
        simulator: Simulator,
        scene: &Scene,
        layout: &Layout,
        limit_ns: Option<u64>,
        targets: &mut Targets,
    ) -> anyhow::Result<()> {
        let servos = self.servos.as_deref();
        let _servos = servos.map(|link| offer_servos(scene, layout, link)).transpose()?;
        let begin = Instant::now();
        let control = self.control.clone();
        let report = |text| notices::warn(&format!("taxel: {text}"));
        let marks = control.map(|socket| SceneMarks::start(scene, begin, socket, report));
        let _marks = marks.transpose()?;
        play(simulator, begin, limit_ns, layout.buses.len(), targets)
    }
}

fn show_layout(name: &str) -> anyhow::Result<()> {
    let layout = Layout::resolve(name)?;
    let text = match Layout::builtin_text(name) {
        _ if layout.buses.is_empty() => stand_in_layout_file(&layout)?,
        Some(text) => text.into(),
        None => std::fs::read_to_string(name).with_context(|| name.to_string())?,
    };
    stdout::print(&text)
}

/// The scenes that can be a recording too.
fn built_in() -> impl Iterator<Item = &'static str> {
    Scene::names().chain(Scene::objects())
}

/// Every scene of `taxel sim` and `taxel demo`.
fn names() -> impl Iterator<Item = &'static str> {
    built_in().chain([play::SCENE])
}

/// Reads the name of a scene, or a file of one; `sim:SCENE` is the same.
pub(crate) fn scene_parser() -> impl TypedValueParser<Value = String> {
    offering(names(), named())
}

/// The same without the gripper's, which is no recording.
pub(crate) fn recorded_scene_parser() -> impl TypedValueParser<Value = String> {
    offering(built_in(), named())
}

fn named() -> impl TypedValueParser<Value = String> {
    StringValueParser::new().map(|name| name.strip_prefix("sim:").unwrap_or(&name).to_owned())
}

/// The scene of a command that plays the gripper's too.
pub(crate) fn resolve(name: &str) -> anyhow::Result<Scene> {
    Scene::resolve(name).map_err(|error| match error {
        SceneError::UnknownScene { .. } => anyhow!(
            "there is no scene `{name}`: neither a file nor one of {}{}",
            names().collect::<Vec<_>>().join(", "),
            did_you_mean(name, names())
        ),
        error => error.into(),
    })
}

fn list(as_json: bool) -> anyhow::Result<()> {
    let mut text = String::new();
    if as_json {
        let scenes = built_in().map(|name| {
            let scene = Scene::builtin(name)?;
            let (seconds, about, layout) = (scene.seconds(), scene.about(), scene.layout());
            Ok(json!({ "name": name, "seconds": seconds, "about": about, "layout": layout }))
        });
        let mut scenes = scenes.collect::<anyhow::Result<Vec<Value>>>()?;
        scenes.push(
            json!({ "name": play::SCENE, "seconds": null, "about": play::ABOUT, "layout": play::LAYOUT }),
        );
        return stdout::print(&format!("{}\n", Value::from(scenes)));
    }
    for name in built_in() {
        let scene = Scene::builtin(name)?;
        text += &format!("{name:12} {:>5.1} s  {}\n", scene.seconds(), scene.about());
    }
    text += &format!("{:12} endless  {}\n", play::SCENE, play::ABOUT);
    stdout::print(&text)
}

/// The servos of the scene's fingers behind a link, as long as the returned values live.
fn offer_servos(scene: &Scene, layout: &Layout, link: &Path) -> anyhow::Result<(StableLink, ServoPty)> {
    let servos = servos_of_scene(scene, layout, servo_clock_ns());
    if servos.is_empty() {
        bail!(
            "--servos: layout {} has no fingers to be moved; leave it out, or take a hand, such as --layout \
             allegro-uskin-15",
            layout.name
        );
    }
    let (count, baud) = (servos.len(), SERVO_BAUD);
    let names: Vec<String> = servos.iter().map(|servo| servo.name.clone()).collect();
    let bus = ServoBus::new(servos.into_iter().map(|servo| servo.build), baud);
    let pty = ServoPty::open(bus).context("a pseudo terminal for the servos")?;
    let link_made = StableLink::new(link, pty.path())
        .with_context(|| format!("--servos {}: cannot make this link", link.display()))?;
    say!(
        "{}, ids 1 to {count}, at {baud} bit/s on {}",
        plural(count, "servo"),
        link.display()
    );
    stdout::print(&joints_table(&std::path::absolute(link)?, baud, &names))?;
    Ok((link_made, pty))
}

/// The table `[joints]` with which taxeld reads these servos, ids from 1.
fn joints_table(link: &Path, baud: u32, names: &[String]) -> String {
    let source = format!("dynamixel:{}", link.display());
    let mut text = format!("[joints]\nsource = {source:?}\nbaud = {baud}\n");
    for (id, name) in (1..).zip(names) {
        text += &format!("\n[[joints.servo]]\nid = {id}\nname = {name:?}\n");
    }
    text
}

fn write_log(
    mut simulator: Simulator,
    interrupt: &Interrupt,
    length_ns: u64,
    targets: &mut Targets,
) -> anyhow::Result<()> {
    let mut frames = Vec::new();
    let mut now_ns = 0;
    while now_ns < length_ns {
        if interrupt.is_set() {
            return targets.give_up_logs();
        }
        now_ns = (now_ns + LOG_STEP_NS).min(length_ns);
        simulator.advance(now_ns, &mut frames);
        for (bus, received) in frames.drain(..) {
            targets.send(bus.into(), received.t_ns, &received.frame)?;
        }
    }
    Ok(())
}

/// Runs the scene in real time and obeys what is commanded on the buses.
fn play(
    mut simulator: Simulator,
    begin: Instant,
    limit_ns: Option<u64>,
    buses: usize,
    targets: &mut Targets,
) -> anyhow::Result<()> {
    let interrupt = Interrupt::install()?;
    let mut frames = Vec::new();
    let mut commands: Vec<Received> = Vec::new();
    loop {
        let now_ns = begin.elapsed().as_nanos() as u64;
        if limit_ns.is_some_and(|limit| now_ns >= limit) {
            return Ok(());
        }
        for bus in 0..buses {
            targets.receive(bus, &mut commands);
            for command in commands.drain(..) {
                // A full queue is for the host to notice: its watchdog sends the command again.
                let _ = simulator.command(bus as u8, &command.frame, now_ns);
            }
        }
        simulator.advance(now_ns, &mut frames);
        for (bus, received) in frames.drain(..) {
            targets.send(bus.into(), received.t_ns, &received.frame)?;
        }
        let next = simulator.next_at_ns().map(|at| begin + Duration::from_nanos(at));
        let latest = Instant::now() + LISTEN;
        if !interrupt.sleep_until(next.map_or(latest, |next| next.min(latest))) {
            return Ok(());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_of_the_simulated_servos_is_one_that_taxeld_reads() {
        let scene = Scene::builtin("ball-grasp").unwrap();
        let layout = Layout::resolve(scene.layout()).unwrap();
        let names: Vec<String> = servos_of_scene(&scene, &layout, 0)
            .into_iter()
            .map(|servo| servo.name)
            .collect();
        let table = joints_table(Path::new("/tmp/the \"servos\""), SERVO_BAUD, &names);
        let text = format!(
            "layout = {:?}\n{}{table}",
            layout.name,
            "[[bus]]\nsource = \"sim:idle\"\n".repeat(2)
        );
        let config = taxeld::Config::parse(&text, Path::new("taxeld.toml")).unwrap();
        let joints = config.joints.unwrap();
        assert_eq!(joints.joint_names(), names);
    }
}
