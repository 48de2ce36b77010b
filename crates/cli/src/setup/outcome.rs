//! What is written in the end: checked first, whole or not at all, and never over a file without being told.

use super::answers::{Answers, say};
use crate::config::text_for;
use crate::doctor::{capacity, link};
use anyhow::{Context, bail};
use serde_json::{Value, json};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use taxel_can::SourceAddress;
use taxel_playback::output_file::OutputFile;
use taxel_skin::Layout;
use taxeld::Config;

/// The hand that was set up.
#[derive(Debug)]
pub(super) struct Hand {
    pub(super) layout: Layout,
    /// The layout file to be written; `None` where the layout has a name already.
    pub(super) layout_file: Option<String>,
    /// What the layout is called where no file is written.
    pub(super) layout_name: String,
    /// Where each of the layout's buses is.
    pub(super) sources: Vec<SourceAddress>,
    /// The table `[joints]`.
    pub(super) joints: String,
}

/// The files, as they will be.
#[derive(Debug)]
pub(super) struct Outcome {
    config_path: PathBuf,
    config: String,
    layout: Option<(PathBuf, String)>,
}

impl Outcome {
    /// Makes the files of a hand, and checks them as `taxeld --check` does.
    pub(super) fn new(
        hand: &Hand,
        config_path: &Path,
        answers: &Answers,
        force: bool,
    ) -> anyhow::Result<Self> {
        let folder = config_path.parent().unwrap_or(Path::new(""));
        let layout = match &hand.layout_file {
            Some(text) => Some((layout_path(folder, force, answers)?, text.clone())),
            None => None,
        };
        let file_name = |path: &Path| {
            path.file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned()
        };
        let name = match &layout {
            Some((path, _)) => file_name(path),
            None => hand.layout_name.clone(),
        };
        let mut config = text_for(&hand.layout, &name, &hand.sources);
        if let Some(hz) = capacity::trigger_hz(&hand.layout, link::BITRATE) {
            say(&format!(
                "A bus does not carry what its boards send by themselves, 100 sweeps a second: they are triggered {hz} times \
                 a second instead."
            ));
            config = triggered(&config, hz)?;
        }
        config += &hand.joints;
        let outcome = Self {
            config_path: config_path.into(),
            config,
            layout,
        };
        outcome.check()?;
        Ok(outcome)
    }

    /// Whether a daemon could start with these files.
    fn check(&self) -> anyhow::Result<()> {
        let folder = tempfile::TempDir::new().context("a folder to check the files in")?;
        if let Some((path, text)) = &self.layout {
            let name = path.file_name().unwrap_or_default();
            std::fs::write(folder.path().join(name), text).context("a layout file to check")?;
        }
        let name = self.config_path.file_name().unwrap_or_default();
        let path = folder.path().join(name);
        let config = Config::parse(&self.config, &path)?;
        if let Some(sentence) = config.unread_joints() {
            say(&format!("{sentence}."));
        }
        Ok(taxeld::check(&config, &self.config, &path)?)
    }

    /// Writes the files, the layout first.
    pub(super) fn write(&self) -> anyhow::Result<()> {
        let mut config = OutputFile::begin(&self.config_path)?;
        std::fs::write(config.path(), &self.config)
            .with_context(|| self.config_path.display().to_string())?;
        if let Some((path, text)) = &self.layout {
            OutputFile::write(path, text)?;
            say(&format!("{} is written.", path.display()));
        }
        config.finish()?;
        say(&format!(
            "{} is written, and is what `taxeld --check` accepts.",
            self.config_path.display()
        ));
        Ok(())
    }

    /// Prints the files to stdout instead of writing them.
    pub(super) fn print(&self) -> anyhow::Result<()> {
        let mut out = std::io::stdout().lock();
        let mut text = String::new();
        if let Some((path, layout)) = &self.layout {
            text += &format!("# {}:\n{layout}\n", path.display());
        }
        text += &format!("# {}:\n{}", self.config_path.display(), self.config);
        Ok(out.write_all(text.as_bytes()).and_then(|()| out.flush())?)
    }

    pub(super) fn json(&self, hand: &Hand, is_written: bool) -> Value {
        let modules = hand.layout.modules.iter().zip(&hand.layout.wiring).map(|(module, wiring)| {
            let bus = &hand.layout.buses[usize::from(wiring.bus)];
            json!({ "name": module.name, "bus": bus, "board": wiring.board, "protocol": wiring.protocol.name() })
        });
        let (path, text) = match &self.layout {
            Some((path, text)) => (Some(path.display().to_string()), Some(text)),
            None => (None, None),
        };
        json!({
            "sources": hand.sources.iter().map(ToString::to_string).collect::<Vec<_>>(),
            "modules": modules.collect::<Vec<_>>(),
            "layout": hand.layout_file.is_none().then_some(&hand.layout_name),
            "layout_path": path,
            "layout_file": text,
            "config_path": self.config_path.display().to_string(),
            "config": self.config,
            "written": is_written,
        })
    }

    /// The commands that start the daemon, now and for good.
    pub(super) fn next_steps(&self, hand: &Hand) {
        let config = self.config_path.display();
        eprintln!("\nTry it:\n    taxeld --config {config}\n    taxel view");
        eprintln!("As a service, with the package installed:");
        if let Some((path, _)) = &self.layout {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            eprintln!("    sudo install -m 644 {} /etc/taxeld/{name}", path.display());
        }
        eprintln!("    sudo install -m 644 {config} /etc/taxeld/taxeld.toml");
        eprintln!("    sudo systemctl enable --now taxeld");
        if hand
            .sources
            .iter()
            .any(|s| matches!(s, SourceAddress::Udp { .. }))
        {
            say(
                "The service may open no network socket; docs/guide.md says which file lets it read a udp: bus.",
            );
        }
        if hand.joints.contains("dynamixel:") {
            say("The service sees no serial port; docs/guide.md says which file lets it.");
        }
    }
}

/// A name for the layout file beside the configuration that no file has.
fn layout_path(folder: &Path, force: bool, answers: &Answers) -> anyhow::Result<PathBuf> {
    let mut names = std::iter::once("hand.toml".to_owned()).chain((2..).map(|n| format!("hand-{n}.toml")));
    let free = match force {
        true => names.next(),
        false => names.find(|name| !folder.join(name).exists()),
    };
    let free = free.unwrap_or_default();
    loop {
        let answer = answers.ask("Write the layout to", &folder.join(&free).display().to_string())?;
        let path = PathBuf::from(answer);
        if path.parent() != Some(folder) {
            answers.refuse("the layout file goes beside the configuration, which names it")?;
        } else if !force && path.exists() {
            answers.refuse(&format!("{} exists; --force overwrites it", path.display()))?;
        } else {
            return Ok(path);
        }
    }
}

/// Refuses to overwrite a configuration unless told to, and one that cannot be written.
pub(super) fn may_write(path: &Path, force: bool, answers: &Answers) -> anyhow::Result<()> {
    let may = force || !path.exists();
    if !may && !answers.confirm(&format!("{} exists. Overwrite it", path.display()), false)? {
        bail!(
            "{} exists; --out FILE names another, --force overwrites it",
            path.display()
        );
    }
    OutputFile::begin(path).map(drop)
}

/// The configuration with `[boards]` triggered.
fn triggered(config: &str, hz: f64) -> anyhow::Result<String> {
    let at = config.find("\n[boards]\n").context("a table [boards]")?;
    let (above, boards) = config.split_at(at);
    let mode = "#mode = \"free-running\"";
    let boards = boards.replacen(mode, "mode = \"triggered\"", 1);
    let rate = format!("trigger_hz = {hz:.1}");
    let default = boards
        .lines()
        .find(|line| line.starts_with("#trigger_hz = "))
        .context("a key trigger_hz")?
        .to_owned();
    Ok(format!("{above}{}", boards.replacen(&default, &rate, 1)))
}
