//! `taxel config`: the daemon's configuration file.

use crate::doctor::{capacity, link};
use anyhow::{Context, bail};
use serde_json::json;
use std::io::Read;
use std::path::{Path, PathBuf};
use taxel_can::SourceAddress;
use taxel_hand::shell_word;
use taxel_playback::output_file::{OutputFile, refuse_existing};
use taxel_sim::with_stand_in_boards;
use taxel_skin::Layout;
use taxeld::Config;
use taxeld::config::ANNOTATED;
use taxeld::stdout;

/// Where the service has its configuration.
const SERVICE: &str = "/etc/taxeld/taxeld.toml";

/// Write, check or print the daemon's configuration file.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  taxel config init > taxeld.toml                          the default hand on can0 and can1
  taxel config init --layout uskin-module --source udp:    another hand elsewhere
  taxel config check taxeld.toml                           what is wrong with it, or what it would run
  taxel config show taxeld.toml --json                     every value in force, also those it does not state
  taxel config init | taxel config check -                 through stdout and stdin")]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    /// Print a file to start from: the hand, its buses, and every other key with its default behind #
    Init(Init),
    /// Say what is wrong with a file, or what it would run
    Check(Check),
    /// Print every value in force, also those that the file does not state
    Show(Show),
}

#[derive(Debug, clap::Args)]
struct Init {
    /// The hand: a built-in name, or a layout file
    #[arg(long, value_name = "LAYOUT", default_value = "allegro-uskin-15")]
    layout: String,
    /// Where the buses are, once for each in the layout's order [default: can:NAME, by the layout's names]
    #[arg(long, value_name = "SOURCE")]
    source: Vec<SourceAddress>,
    /// Where to write; - for stdout
    #[arg(long, value_name = "FILE", default_value = "-")]
    out: PathBuf,
    /// Write over a file that is there
    #[arg(long)]
    force: bool,
}

#[derive(Debug, clap::Args)]
struct File {
    /// The configuration; - for stdin
    #[arg(value_name = "FILE", default_value = SERVICE)]
    file: PathBuf,
}

#[derive(Debug, clap::Args)]
struct Check {
    #[command(flatten)]
    file: File,
    /// One JSON object: whether a daemon could start with it, or what is wrong
    #[arg(long)]
    json: bool,
}

#[derive(Debug, clap::Args)]
struct Show {
    #[command(flatten)]
    file: File,
    /// One JSON object instead of TOML
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    match &args.command {
        Command::Init(args) => {
            let text = init(&args.layout, &args.source)?;
            match args.out.as_os_str() == "-" {
                true => stdout::print(&text),
                false => {
                    refuse_existing(&args.out, args.force)?;
                    OutputFile::write(&args.out, text)
                }
            }
        }
        Command::Check(args) => {
            let checked = args.file.read().and_then(|(config, text)| {
                taxeld::check(&config, &text, args.file.name())?;
                Ok((config, text))
            });
            if args.json {
                let error = checked.as_ref().err().map(crate::errors::describe);
                let summary = checked.as_ref().ok().map(|(config, _)| config.summary());
                let object = json!({ "valid": error.is_none(), "error": error, "summary": summary });
                stdout::print(&format!("{object}\n"))?;
            }
            let (config, text) = checked?;
            if let Some((path, error)) = taxeld::left_to_service(&config, &text) {
                remark!(
                    "taxel: not checked: {}, whose folder systemd makes for the service; run by this user, taxeld ends: \
                     {error}",
                    path.display()
                );
            }
            match args.json {
                true => Ok(()),
                false => stdout::print(&config.summary()),
            }
        }
        Command::Show(args) => {
            let (config, text) = args.file.read()?;
            let table = in_force(&config, &text)?;
            stdout::print(&match args.json {
                true => format!("{}\n", serde_json::to_string(&table)?),
                false => toml::to_string(&table)?,
            })
        }
    }
}

impl File {
    /// What messages call it.
    fn name(&self) -> &Path {
        match self.file.as_os_str() == "-" {
            true => Path::new("stdin"),
            false => &self.file,
        }
    }

    /// The configuration, and its text.
    fn read(&self) -> anyhow::Result<(Config, String)> {
        if self.file.as_os_str() == "-" {
            let mut text = String::new();
            std::io::stdin().read_to_string(&mut text).context("stdin")?;
            return Ok((Config::parse(&text, self.name())?, text));
        }
        let config = Config::load(&self.file)?;
        let text = std::fs::read_to_string(&self.file).with_context(|| self.file.display().to_string())?;
        Ok((config, text))
    }
}

/// A file for this hand that states nothing else.
fn init(name: &str, sources: &[SourceAddress]) -> anyhow::Result<String> {
    let layout = Layout::resolve(name)?;
    let buses = &layout.buses;
    if buses.is_empty() {
        // What is too great for simulated boards is said to be a pressure array's.
        with_stand_in_boards(&layout).with_context(|| format!("layout {name} has no buses to read"))?;
        bail!(
            "layout {name} has no buses, so there is nothing to read; `taxel sim roll --layout {} --show` prints it with \
             simulated boards",
            shell_word(name)
        );
    }
    anyhow::ensure!(
        sources.is_empty() || sources.len() == buses.len(),
        "layout {name} has {} buses ({}); give --source once for each, in this order",
        buses.len(),
        buses.join(", ")
    );
    if let Some(array) = (0..buses.len()).find(|bus| sources.is_empty() && layout.array_on(*bus).is_some()) {
        bail!(
            "bus {:?} of layout {name} is a pressure array, whose frames come over a Unix socket; give --source pressure:PATH",
            buses[array]
        );
    }
    let is_can = |source: &SourceAddress| matches!(source, SourceAddress::Can { .. });
    let trigger_hz = match sources.iter().all(is_can) {
        true => capacity::trigger_hz(&layout, link::BITRATE),
        false => None,
    };
    let text = text_for(&layout, name, sources, trigger_hz)?;
    Config::parse(&text, Path::new("taxeld.toml"))?;
    Ok(text)
}

/// The text of a file for a hand that it calls `name`, with every key at its default; buses without a source are
/// interfaces of their names. Its boards are triggered where a rate is given.
pub(crate) fn text_for(
    layout: &Layout,
    name: &str,
    sources: &[SourceAddress],
    trigger_hz: Option<f64>,
) -> anyhow::Result<String> {
    let mut text = format!(
        "# taxeld's configuration. What stands behind # is the default; `taxel config check` says what is wrong.\n\n\
         # The hand: a built-in one (`taxel layouts`), or a layout file.\nlayout = {}\n",
        toml::Value::from(name)
    );
    for (index, bus) in layout.buses.iter().enumerate() {
        let source = sources
            .get(index)
            .map_or_else(|| format!("can:{bus}"), ToString::to_string);
        text += &format!(
            "\n# Bus {bus} of the layout.\n[[bus]]\nsource = {}\n",
            toml::Value::from(source)
        );
    }
    text += ANNOTATED;
    match trigger_hz {
        Some(hz) => triggered(&text, hz),
        None => Ok(text),
    }
}

/// The configuration with `[boards]` triggered.
fn triggered(config: &str, hz: f64) -> anyhow::Result<String> {
    let at = config.find("\n[boards]\n").context("a table [boards]")?;
    let (above, boards) = config.split_at(at);
    let mode = "#mode = \"free-running\"";
    let why = "# What all boards of this hand send on their own timer is more than a CAN bus carries.\nmode = \"triggered\"";
    let boards = boards.replacen(mode, why, 1);
    let rate = format!("trigger_hz = {hz:.1}");
    let default = boards
        .lines()
        .find(|line| line.starts_with("#trigger_hz = "))
        .context("a key trigger_hz")?
        .to_owned();
    Ok(format!("{above}{}", boards.replacen(&default, &rate, 1)))
}

/// Every value in force, with the hand as the file names it.
fn in_force(config: &Config, text: &str) -> anyhow::Result<toml::Table> {
    let stated: toml::Table = text.parse()?;
    let mut table = config.in_force();
    let layout = stated.get("layout").cloned();
    table.insert(
        "layout".into(),
        layout.unwrap_or_else(|| config.layout.name.clone().into()),
    );
    Ok(table)
}
