//! `taxel doctor`: what is wrong with this machine and this hand, and how to mend it.

mod access;
mod allegro;
mod analogue;
mod arguments;
pub(crate) mod asked;
pub(crate) mod bus_listener;
pub(crate) mod capacity;
pub(crate) mod daemon;
pub(crate) mod finding;
mod hand;
mod hand_text;
mod hear;
pub(crate) mod link;
mod live;
mod machine;
mod picture;
pub(crate) mod report;
pub(crate) mod scan;
mod servos;
pub(crate) mod starting;

pub(crate) use arguments::Args;

use crate::wrap::wrap;
use access::{FileFacts, PortFacts, User};
use anyhow::{Context, bail};
use daemon::Daemon;
use finding::{Check, State};
use report::{Report, Style};
use serde_json::json;
use std::collections::BTreeSet;
use std::io;
use std::path::{Path, PathBuf};
use taxel_can::SourceAddress;
use taxel_joints::{DynamixelConfig, JointSource};
use taxel_playback::interrupt::Interrupt;
use taxel_playback::output_file::refuse_existing;
use taxel_playback::progress::Progress;
use taxel_playback::stand_in::as_named;
use taxel_skin::Layout;
use taxeld::Config;
use taxeld::stdout;

/// Bit rates that servos may be set to, the likely ones first.
pub(crate) const BAUDS: [u32; 7] = [
    57_600, 1_000_000, 3_000_000, 4_000_000, 2_000_000, 115_200, 4_500_000,
];

/// Runs the checks; says whether there was no error.
pub(crate) fn run(args: &Args) -> anyhow::Result<bool> {
    let interrupt = Interrupt::install()?;
    if args.scan {
        // Before minutes of listening.
        if let Some(out) = &args.out {
            refuse_existing(out, args.force)?;
        }
        let is_live = |source: &SourceAddress| !matches!(source, SourceAddress::Log { .. });
        if args.start && (args.sources.is_empty() || args.sources.iter().any(is_live)) {
            let hangs = |(_, socket): &(String, PathBuf)| matches!(daemon::ask(socket), Daemon::Hung);
            if let Some((_, socket)) = asked::services().into_iter().find(hangs) {
                bail!(
                    "{} is there, and nobody answers: its buses are left alone. Restart the daemon where it hangs, or leave \
                     --start out, and nothing is sent",
                    socket.display()
                );
            }
        }
        let scan = scan::Scan {
            sources: &args.sources,
            seconds: args.seconds.as_secs_f64(),
            start: args.start,
            out: args.out.as_deref(),
            json: args.json,
        };
        return scan::run(&scan, Path::new("/"), interrupt);
    }
    let (config, origin) = args.configuration()?;
    let mut doctor = Doctor {
        output: (!args.json).then(|| Report::new(io::stdout(), Style::of_stdout())),
        checks: Vec::new(),
    };
    if !args.json {
        stdout::print(&(wrap(&origin, 80).join("\n") + "\n\n"))?;
    }
    let root = Path::new("/");
    let links = doctor.check_machine(root, &config)?;
    let running = doctor.check_daemon(root, &config, args.names_sources())?;
    if !running {
        doctor.check_hand(args, &config, &links, interrupt.clone())?;
        doctor.check_joints(args, &config, root, interrupt)?;
    }
    let healthy = doctor.checks.iter().all(|c| c.state != State::Error);
    if args.json {
        let checks: Vec<_> = doctor.checks.iter().map(Check::json).collect();
        let object = json!({ "checks": checks, "healthy": healthy });
        stdout::print(&(as_named(object.to_string()) + "\n"))?;
    } else {
        let summary = report::summary(&doctor.checks, Style::of_stdout());
        stdout::print(&format!("\n{summary}\n"))?;
    }
    Ok(healthy)
}

/// Findings as they come: shown at once, kept for the summary.
struct Doctor {
    output: Option<Report<io::Stdout>>,
    checks: Vec<Check>,
}

impl Doctor {
    fn report(&mut self, checks: Vec<Check>) -> anyhow::Result<()> {
        if let Some(output) = &mut self.output {
            output.write(&checks).context("stdout")?;
        }
        self.checks.extend(checks);
        Ok(())
    }

    fn draw(&mut self, layout: &Layout, marks: &[Option<char>]) -> anyhow::Result<()> {
        match &mut self.output {
            Some(output) => output.lines(&picture::draw(layout, marks)).context("stdout"),
            None => Ok(()),
        }
    }

    /// The machine and its CAN interfaces; returns what was read of those.
    fn check_machine(&mut self, root: &Path, config: &Config) -> anyhow::Result<Vec<link::LinkFacts>> {
        let joints = config.joints.as_ref();
        let joints_bus = joints.and_then(|joints| joints.source.config().can_bus());
        let interfaces: BTreeSet<&str> = config
            .sources
            .iter()
            .chain(joints_bus)
            .filter_map(|source| match source {
                SourceAddress::Can { interface } => Some(interface.as_str()),
                _ => None,
            })
            .collect();
        let needs = machine::Needs {
            can: !interfaces.is_empty(),
            sockets: (config.sources.iter())
                .any(|s| matches!(s, SourceAddress::Can { .. } | SourceAddress::Udp { .. })),
            receive_buffer_kib: config.can.receive_buffer_kib,
            priority: config.realtime.priority,
            lock_memory: config.realtime.lock_memory,
        };
        let facts = machine::MachineFacts::read(root).with_can_sockets();
        self.report(machine::check(&facts, &needs))?;
        let mut links = Vec::new();
        for name in interfaces {
            if facts.no_af_can.is_some() {
                let why = "not looked at: the kernel has no CAN sockets (see AF_CAN)";
                self.report(vec![Check::skipped("link", "interface", name, why)])?;
                continue;
            }
            let link = link::LinkFacts::read(root, name);
            self.report(link::check(&link, bitrate_of(config, name)))?;
            links.push(link);
        }
        Ok(links)
    }

    /// A daemon that runs, or the place where one would have its sockets; says whether one runs that has the hand. One that
    /// has nothing of what was `named` does not.
    fn check_daemon(&mut self, root: &Path, config: &Config, named: bool) -> anyhow::Result<bool> {
        const AREA: &str = "daemon";
        let asked = asked::look(config, named);
        let socket = &asked.socket;
        let path = socket.display().to_string();
        self.report(asked.found)?;
        match asked.daemon {
            Daemon::Running(status) if named && !daemon::has_any(&status, config) => {
                let runs = format!(
                    "runs with layout {} on other buses, and is not asked",
                    status.layout
                );
                self.report(vec![Check::ok(AREA, "taxeld", "", runs)])?;
            }
            Daemon::Running(status) => {
                self.report(daemon::check(&status))?;
                if let Some(marks) = daemon::marks(&status, &config.layout) {
                    self.draw(&config.layout, &marks)?;
                }
                return Ok(true);
            }
            Daemon::Forbidden => {
                let check = Check::error(
                    AREA,
                    "status socket",
                    path,
                    "is there, and this user may not use it",
                );
                let check = match FileFacts::read(root, socket).and_then(|file| file.join_its_group()) {
                    Some(command) => check.run(command),
                    None => check
                        .advise("its owner alone may use it: run the doctor as the user that taxeld runs as"),
                };
                self.report(vec![
                    check.advise("a daemon seems to run, so its buses are left alone"),
                ])?;
                return Ok(true);
            }
            Daemon::Hung => {
                let found = "is there, and nobody answers";
                self.report(vec![Check::error(AREA, "status socket", path, found).advise(
                    "its log says what it does, and where it hangs, restart it; its buses are left alone",
                )])?;
                return Ok(true);
            }
            Daemon::Strange(why) => self.report(vec![
                Check::warning(
                    AREA,
                    "status socket",
                    path,
                    format!("does not answer as taxeld does: {why}"),
                )
                .run("systemctl status taxeld"),
            ])?,
            Daemon::Absent => self.report(vec![check_folder(root, socket)])?,
        }
        Ok(false)
    }

    fn check_joints(
        &mut self,
        args: &Args,
        config: &Config,
        root: &Path,
        interrupt: Interrupt,
    ) -> anyhow::Result<()> {
        let Some(joints) = &config.joints else {
            return Ok(());
        };
        match &joints.source {
            JointSource::Dynamixel(servos) => self.check_servos(args, servos, root)?,
            JointSource::Allegro(hand) => {
                let checks = match allegro::listen(hand, interrupt.clone()) {
                    Ok(facts) => allegro::check(hand, &facts),
                    Err(error) => {
                        let object = hand.bus.to_string();
                        vec![Check::error(
                            "joints",
                            "Allegro hand",
                            object,
                            format!("{error:#}"),
                        )]
                    }
                };
                self.report(checks)?;
            }
        }
        let Some(potentiometers) = &joints.analogue else {
            return Ok(());
        };
        let first = joints.joint_names().len() - potentiometers.joint.len();
        let heard = analogue::listen(potentiometers, &interrupt)?;
        self.report(analogue::check(potentiometers, first, &heard))
    }

    fn check_servos(&mut self, args: &Args, servos: &DynamixelConfig, root: &Path) -> anyhow::Result<()> {
        const AREA: &str = "servos";
        let path = servos.path.as_path();
        let port = PortFacts::read(root, path);
        let checks = access::check_port(&port, &User::read(root));
        let usable = checks.iter().all(|c| c.state != State::Error);
        self.report(checks)?;
        if !usable {
            return Ok(());
        }
        let name = path.display().to_string();
        if args.listen_only {
            let why = "not asked: servos speak only when they are spoken to (--listen-only)";
            return self.report(vec![Check::skipped(AREA, "bus", name, why)]);
        }
        let expected: Vec<u8> = servos.servo.iter().map(|s| s.id).collect();
        let asking = Progress::busy(format!("asking the servos on {name} what they are"));
        let survey = match taxel_joints::survey(path, servos.baud, &expected) {
            Ok(survey) => survey,
            Err(error) => {
                drop(asking);
                return self
                    .report(vec![Check::error(AREA, "port", name, error.to_string()).run(
                        format!("sudo fuser -v {}    # who has it open", path.display()),
                    )]);
            }
        };
        let mut elsewhere = Vec::new();
        if survey.servos.is_empty() {
            for baud in BAUDS.into_iter().filter(|baud| *baud != servos.baud) {
                let found = taxel_joints::scan(path, baud).unwrap_or_default();
                if !found.is_empty() {
                    elsewhere.push((baud, found.iter().map(|s| s.id).collect()));
                    break;
                }
            }
        }
        drop(asking);
        let facts = servos::ServoFacts { survey, elsewhere };
        self.report(servos::check(servos, &facts))
    }
}

/// What is wrong where the kernel of this machine has no CAN sockets; `None` where it has them.
pub(crate) fn without_can_sockets(root: &Path) -> Option<Check> {
    let facts = machine::MachineFacts::read(root).with_can_sockets();
    let check = machine::check_af_can(&facts, true);
    (check.state == State::Error).then_some(check)
}

/// What bit rate the boards on an interface need; `None` where that is not public (CySkin).
fn bitrate_of(config: &Config, interface: &str) -> Option<u64> {
    let bus = config
        .sources
        .iter()
        .position(|s| matches!(s, SourceAddress::Can { interface: i } if i == interface));
    let Some(bus) = bus else {
        // Only the joints'.
        return Some(link::BITRATE);
    };
    let mut modules = config.layout.wiring.iter().filter(|m| usize::from(m.bus) == bus);
    modules.find_map(|m| m.protocol.bit_rate()).map(u64::from)
}

/// Whether a daemon could have its sockets here.
fn check_folder(root: &Path, socket: &Path) -> Check {
    const NAME: &str = "taxeld";
    let folder = socket.parent().unwrap_or(Path::new("."));
    let not_running = format!("does not run (nobody answers at {})", socket.display());
    let user = User::read(root);
    let existing = folder
        .ancestors()
        .find(|dir| dir.is_dir())
        .unwrap_or(Path::new("/"));
    match FileFacts::read(root, existing) {
        Some(file) if !user.may_use(&file) => {
            let check = Check::warning(
                "daemon",
                NAME,
                "",
                format!(
                    "{not_running}, and this user could not start it: {} is not writable",
                    existing.display()
                ),
            );
            check.run("sudo systemctl enable --now taxeld").advise(format!(
                "or run taxeld by hand with [socket] paths in a folder of your own, or as a member of group {}",
                file.group
            ))
        }
        _ => Check::ok("daemon", NAME, "", not_running),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bit_rate_is_asked_of_those_boards_whose_it_is_public() {
        let layout = Layout::builtin("uskin-module").unwrap();
        let config = Config::new(layout, vec!["can:can0".parse().unwrap()]);
        assert_eq!(bitrate_of(&config, "can0"), Some(1_000_000));
        assert_eq!(bitrate_of(&config, "can9"), Some(1_000_000), "an Allegro hand's");
    }
}
