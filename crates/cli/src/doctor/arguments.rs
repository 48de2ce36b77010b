//! The arguments of `taxel doctor`, and the configuration that they name.

use super::hand_text::describe_hand;
use super::scan;
use super::{asked, daemon};
use crate::errors::wrong_use;
use crate::piped_file::{layout_parser, source_parser, text_parser};
use crate::recordings::input::DEFAULT_LAYOUT;
use crate::seconds::seconds;
use anyhow::{Context, anyhow, bail};
use std::path::{Path, PathBuf};
use std::time::Duration;
use taxel_can::SourceAddress;
use taxel_joints::{DynamixelConfig, JointSource, JointsConfig};
use taxel_skin::Layout;
use taxeld::Config;

/// Where the service has its configuration.
const CONFIG: &str = "/etc/taxeld/taxeld.toml";

/// Look at this machine and this hand, and say what is wrong and how to mend it.
///
/// Without options the configuration of the service is taken (/etc/taxeld/taxeld.toml), else what a
/// daemon that runs reads, else the default hand on can0 and can1. While a daemon runs, it is asked, and its buses are left alone;
/// of several (taxeld@left) the one that reads a bus or the servos of the configuration.
/// Otherwise the boards are asked who they are, started, listened to and stopped again, but only on
/// buses where nobody else speaks; servos are pinged and read. The hand must not be touched
/// meanwhile.
///
/// Exit code: 0 if nothing is an error, 1 otherwise.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  taxel doctor                                   this machine, and the hand of the service
  taxel doctor --config hand.toml --json
  taxel doctor --layout uskin-module can:can0    one module on can0
  taxel doctor log:candump.log                   a recording of all buses of the hand
  taxel doctor --config hand.toml log:candump.log
                                                 the same of the configuration's hand
  taxel doctor --listen-only                     send nothing at all
  taxel doctor --joints dynamixel:/dev/ttyUSB0 --ids 1-16
  taxel doctor --scan can:can0 can:can1 --out hand.toml
                                                 what speaks there, as a layout file
  taxel doctor --scan log:candump.log            the same from a recording")]
pub(crate) struct Args {
    /// Where the buses of the hand are, in the layout's order: can:INTERFACE, udp:GROUP:PORT, log:FILE or sim:SCENE; a
    /// recording or a scene alone is all of them, - for a candump log on stdin [default: those of
    /// the configuration, or can: and the layout's names]
    #[arg(value_name = "SOURCE", value_parser = source_parser())]
    pub(super) sources: Vec<SourceAddress>,
    /// The daemon's configuration file; beside a SOURCE only the hand is taken from it; - for stdin
    #[arg(long, value_name = "FILE", conflicts_with = "layout", value_parser = text_parser())]
    pub(super) config: Option<PathBuf>,
    /// The hand: a built-in name or a layout file, - for stdin [default: allegro-uskin-15]
    #[arg(long, value_name = "LAYOUT", value_parser = layout_parser())]
    pub(super) layout: Option<String>,
    /// Where joint angles come from: dynamixel:DEVICE or allegro:INTERFACE
    #[arg(long, value_name = "SOURCE", conflicts_with = "config")]
    pub(super) joints: Option<JointSource>,
    /// With --joints: ids of the servos, such as 1-16 or 1,2,11-14
    #[arg(long, value_name = "IDS", requires = "joints", conflicts_with_all = ["config", "scan"])]
    pub(super) ids: Option<String>,
    /// With --joints: bits per second of the servos
    #[arg(long, value_name = "N", requires = "joints", conflicts_with_all = ["config", "scan"], default_value_t = 1_000_000)]
    pub(super) baud: u32,
    /// How long to listen to the hand; below 2.5 s there is no verdict on its taxels
    #[arg(long, value_name = "S", value_parser = seconds(0.001..=3600.0), default_value = "4")]
    pub(super) seconds: Duration,
    /// Send nothing, neither to boards nor to servos
    #[arg(long)]
    pub(super) listen_only: bool,
    /// Recognise what speaks on the buses, and propose a layout file for it; it listens and sends nothing
    #[arg(long, conflicts_with_all = OF_A_KNOWN_HAND)]
    pub(super) scan: bool,
    /// With --scan: ask for boards on buses where nobody speaks, and start those that answer; where none does, CySkin hubs
    #[arg(long, requires = "scan", conflicts_with_all = OF_A_KNOWN_HAND, conflicts_with = "listen_only")]
    pub(super) start: bool,
    /// With --scan: write the proposed layout file there instead of to stdout
    #[arg(long, value_name = "FILE", requires = "scan", conflicts_with_all = OF_A_KNOWN_HAND)]
    pub(super) out: Option<PathBuf>,
    /// With --out: write over a file that is there
    #[arg(long, requires = "out", conflicts_with_all = OF_A_KNOWN_HAND)]
    pub(super) force: bool,
    /// Print one JSON object
    #[arg(long)]
    pub(super) json: bool,
}

/// What excludes `--scan`, and its options, too: clap does not miss `--scan` beside what excludes it.
const OF_A_KNOWN_HAND: [&str; 5] = ["layout", "joints", "ids", "baud", "config"];

impl Args {
    /// What the daemon would run, and where that comes from.
    pub(super) fn configuration(&self) -> anyhow::Result<(Config, String)> {
        let named_here = self.layout.is_some() || self.names_sources();
        let service = Path::new(CONFIG);
        let file = match &self.config {
            Some(file) => Some(file.as_path()),
            None => (!named_here && service.is_file()).then_some(service),
        };
        if let Some(file) = file {
            let mut config = Config::load(file)?;
            if !self.sources.is_empty() {
                config.sources = self.named_sources(&config.layout)?;
                config.joints = None;
            }
            let origin = format!("{}: {}", file.display(), describe(&config));
            return Ok((config, origin));
        }
        let layout = Layout::resolve(self.layout.as_deref().unwrap_or(DEFAULT_LAYOUT))?;
        let mut config = Config::new(layout.clone(), self.named_sources(&layout)?);
        config.joints = self.joints()?;
        config.socket.control = taxeld::config::running_socket("control.sock");
        if !named_here && let Some(status) = asked::only(&config.socket.status_path()) {
            // What it reads, rather than a hand that nobody has named.
            config.sources = daemon::sources(&status);
            let hand = daemon::describe(&status);
            return Ok((
                config,
                format!("no configuration file; the daemon that runs has {hand}"),
            ));
        }
        let origin = format!("no configuration file: {}", describe(&config));
        Ok((config, origin))
    }

    /// Where the buses of this hand are.
    fn named_sources(&self, layout: &Layout) -> anyhow::Result<Vec<SourceAddress>> {
        let sources = match &self.sources[..] {
            [] => layout
                .buses
                .iter()
                .map(|bus| format!("can:{bus}").parse())
                .collect::<Result<_, _>>()?,
            [hand] if layout.buses.len() > 1 => of_each_bus(hand, layout)?,
            named => named.to_vec(),
        };
        let sources = taxeld::config::told_apart(sources, layout).map_err(|(_, message)| anyhow!(message))?;
        if sources.len() != layout.buses.len() {
            bail!(
                "layout {} needs a source for each of its buses ({}): {}, not {}",
                layout.name,
                layout.buses.join(", "),
                layout.buses.len(),
                sources.len()
            );
        }
        Ok(sources)
    }

    /// Whether it was said which buses or joints to look at.
    pub(super) fn names_sources(&self) -> bool {
        !self.sources.is_empty() || self.joints.is_some()
    }

    fn joints(&self) -> anyhow::Result<Option<JointsConfig>> {
        let Some(source) = &self.joints else {
            return Ok(None);
        };
        let JointSource::Dynamixel(servos) = source else {
            return Ok(Some(JointsConfig::new(source.clone())));
        };
        let ids = self
            .ids
            .as_deref()
            .ok_or_else(|| wrong_use("--joints dynamixel: needs --ids, such as --ids 1-16"))?;
        let config = JointsConfig::new(JointSource::Dynamixel(DynamixelConfig {
            baud: self.baud,
            ..DynamixelConfig::new(&servos.path, parse_ids(ids).map_err(wrong_use)?)
        }));
        config.check()?;
        Ok(Some(config))
    }
}

/// The sources of a hand's buses where one is named for all of them: a recording has the interfaces of several buses, and a
/// scene is a whole hand.
fn of_each_bus(source: &SourceAddress, layout: &Layout) -> anyhow::Result<Vec<SourceAddress>> {
    match source {
        SourceAddress::Log {
            path,
            interface: None,
        } => {
            let of = |name: &String| SourceAddress::Log {
                path: path.clone(),
                interface: Some(name.clone()),
            };
            let recorded = scan::interfaces(path)?;
            if !layout.buses.iter().any(|bus| recorded.contains(bus)) {
                let each: Vec<String> = recorded.iter().map(|name| of(name).to_string()).collect();
                bail!(
                    "{source} has the interfaces {}, and the buses of layout {} are {}: name the recording once for each of \
                     these, in their order, such as {}",
                    recorded.join(", "),
                    layout.name,
                    layout.buses.join(", "),
                    each.join(" ")
                );
            }
            Ok(layout.buses.iter().map(of).collect())
        }
        SourceAddress::Sim { .. } => Ok(vec![source.clone(); layout.buses.len()]),
        _ => Ok(vec![source.clone()]),
    }
}

fn describe(config: &Config) -> String {
    let sources = config.sources.iter().map(ToString::to_string);
    describe_hand(&config.layout.name, config.layout.buses.iter().zip(sources))
}

/// Ids such as `1-16` or `1,2,11-14`.
fn parse_ids(text: &str) -> anyhow::Result<Vec<u8>> {
    let mut ids = Vec::new();
    for part in text.split(',') {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        let id = |id: &str| {
            let id = id.trim().parse::<u8>().ok();
            id.with_context(|| format!("--ids {text}: ids are 0 to 252, as in 1-16 or 1,2,11-14"))
        };
        let range = id(first)?..=id(last)?;
        if range.is_empty() {
            bail!("--ids {text}: {part} is empty; the lower id comes first, as in 1-16");
        }
        ids.extend(range);
    }
    Ok(ids)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_are_ranges_and_lists() {
        assert_eq!(parse_ids("1-4").unwrap(), [1, 2, 3, 4]);
        assert_eq!(parse_ids("1,2,11-13").unwrap(), [1, 2, 11, 12, 13]);
        for text in ["", "a", "1-", "300", "1-300", "1,5-1"] {
            let error = parse_ids(text).unwrap_err();
            assert!(
                format!("{error:#}").starts_with(&format!("--ids {text}: ")),
                "{error:#}"
            );
            assert!(!format!("{error:#}").contains("integer"), "{error:#}");
        }
    }
}
