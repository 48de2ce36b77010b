//! What is written in the end: checked first, whole or not at all, and never over a file without being told.

use super::answers::{Answers, say};
use crate::config::text_for;
use crate::doctor::{capacity, link};
use anyhow::{Context, bail};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use taxel_can::SourceAddress;
use taxel_hand::shell_word;
use taxel_playback::output_file::{OutputFile, place};
use taxel_skin::Layout;
use taxeld::Config;
use taxeld::stdout;

/// The hand that was set up.
#[derive(Debug)]
pub(super) struct Hand {
    pub(super) layout: Layout,
    pub(super) origin: Origin,
    /// Where each of the layout's buses is.
    pub(super) sources: Vec<SourceAddress>,
    /// The table `[joints]`.
    pub(super) joints: String,
}

/// Where the layout comes from that the configuration names.
#[derive(Debug, Clone)]
pub(super) enum Origin {
    /// Its name.
    BuiltIn(String),
    /// A file of the user's, and its text.
    File(PathBuf, String),
    /// The text of a file that there is not yet.
    New(String),
}

/// The files, as they will be.
#[derive(Debug)]
pub(super) struct Outcome {
    config_path: PathBuf,
    config: String,
    layout: Option<LayoutFile>,
}

/// A layout file beside the configuration, which names it.
#[derive(Debug)]
struct LayoutFile {
    path: PathBuf,
    text: String,
    /// It is there already.
    is_there: bool,
}

impl Outcome {
    /// Makes the files of a hand, and checks them as `taxeld --check` does.
    pub(super) fn new(
        hand: &Hand,
        config_path: &Path,
        answers: &Answers,
        force: bool,
    ) -> anyhow::Result<Self> {
        let layout = LayoutFile::of(&hand.origin, config_path, answers, force)?;
        let name = match &hand.origin {
            Origin::BuiltIn(name) => name.clone(),
            _ => layout.as_ref().map_or(String::new(), LayoutFile::name),
        };
        let trigger_hz = capacity::trigger_hz(&hand.layout, link::BITRATE);
        if let Some(hz) = trigger_hz {
            say(&format!(
                "A bus does not carry what its boards send by themselves: uSkin boards, which would send 100 sweeps a second, \
                 are triggered {hz} times a second instead."
            ));
        }
        let mut config = text_for(&hand.layout, &name, &hand.sources, trigger_hz)?;
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
        if let Some(layout) = &self.layout {
            std::fs::write(folder.path().join(layout.name()), &layout.text)
                .context("a layout file to check")?;
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
        if let Some(layout) = self.new_layout() {
            OutputFile::write(&layout.path, &layout.text)?;
            say(&format!("{} is written.", layout.path.display()));
        }
        config.finish()?;
        say(&format!(
            "{} is written, and is what `taxeld --check` accepts.",
            self.config_path.display()
        ));
        Ok(())
    }

    /// The layout file that is written with the configuration.
    fn new_layout(&self) -> Option<&LayoutFile> {
        self.layout.as_ref().filter(|layout| !layout.is_there)
    }

    /// Prints the files to stdout instead of writing them.
    pub(super) fn print(&self) -> anyhow::Result<()> {
        let mut text = String::new();
        if let Some(layout) = self.new_layout() {
            text += &format!("# {}:\n{}\n", layout.path.display(), layout.text);
        }
        text += &format!("# {}:\n{}", self.config_path.display(), self.config);
        stdout::print(&text)
    }

    pub(super) fn json(&self, hand: &Hand, is_written: bool) -> Value {
        let modules = hand.layout.modules.iter().zip(&hand.layout.wiring).map(|(module, wiring)| {
            let bus = &hand.layout.buses[usize::from(wiring.bus)];
            json!({ "name": module.name, "bus": bus, "board": wiring.board, "protocol": wiring.protocol.name() })
        });
        let layout = self.layout.as_ref();
        let builtin = match &hand.origin {
            Origin::BuiltIn(name) => Some(name),
            _ => None,
        };
        json!({
            "sources": hand.sources.iter().map(ToString::to_string).collect::<Vec<_>>(),
            "modules": modules.collect::<Vec<_>>(),
            "layout": builtin,
            "layout_path": layout.map(|layout| layout.path.display().to_string()),
            "layout_file": layout.map(|layout| &layout.text),
            "config_path": self.config_path.display().to_string(),
            "config": self.config,
            "written": is_written,
        })
    }

    /// The commands that start the daemon, now and for good.
    pub(super) fn next_steps(&self, hand: &Hand) {
        let config = shell_word(self.config_path.display());
        say!("\nTry it:\n    taxeld --config {config}\n    taxel view");
        say!("As a service, with the package installed:");
        if let Some(layout) = &self.layout {
            let (path, installed) = (layout.path.display(), format!("/etc/taxeld/{}", layout.name()));
            let (path, installed) = (shell_word(path), shell_word(installed));
            say!("    sudo install -m 644 {path} {installed}");
        }
        say!("    sudo install -m 644 {config} /etc/taxeld/taxeld.toml");
        say!("    sudo systemctl enable --now taxeld");
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

impl LayoutFile {
    /// `None` for a built-in layout. A file that lies beside the configuration stays as it is; any other is written there,
    /// since a service reads no file of a user's, and the two are to be moved together.
    fn of(
        origin: &Origin,
        config_path: &Path,
        answers: &Answers,
        force: bool,
    ) -> anyhow::Result<Option<Self>> {
        let (text, proposal) = match origin {
            Origin::BuiltIn(_) => return Ok(None),
            Origin::New(text) => (text, "hand".into()),
            Origin::File(path, text) => {
                if are_in_one_folder(path, config_path) {
                    return Ok(Some(Self {
                        path: path.clone(),
                        text: text.clone(),
                        is_there: true,
                    }));
                }
                (text, path.file_stem().unwrap_or_default().to_string_lossy())
            }
        };
        Ok(Some(Self {
            path: layout_path(config_path, &proposal, force, answers)?,
            text: text.clone(),
            is_there: false,
        }))
    }

    fn name(&self) -> String {
        let name = self.path.file_name().unwrap_or_default();
        name.to_string_lossy().into_owned()
    }
}

/// However their folder is spelt.
fn are_in_one_folder(a: &Path, b: &Path) -> bool {
    match (place(a), place(b)) {
        (Some(a), Some(b)) => a.parent() == b.parent(),
        _ => false,
    }
}

/// A name for the layout file beside the configuration that no file has.
fn layout_path(config_path: &Path, stem: &str, force: bool, answers: &Answers) -> anyhow::Result<PathBuf> {
    let folder = config_path.parent().unwrap_or(Path::new(""));
    let names = std::iter::once(format!("{stem}.toml")).chain((2..).map(|n| format!("{stem}-{n}.toml")));
    let mut paths = names.map(|name| folder.join(name));
    let free = paths.find(|path| path != config_path && (force || !path.exists()));
    let free = free.unwrap_or_default();
    loop {
        let answer = answers.ask("Write the layout to", &free.display().to_string())?;
        let path = PathBuf::from(answer);
        if !are_in_one_folder(&path, config_path) {
            answers.refuse("the layout file goes beside the configuration, which names it")?;
        } else if path.file_name() == config_path.file_name() {
            answers.refuse(&format!(
                "{} is the configuration; the layout is a file of its own",
                path.display()
            ))?;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_layout_file_goes_beside_the_configuration_however_its_folder_is_spelt() {
        let write_to = |answer| {
            let path = layout_path(
                Path::new("taxeld.toml"),
                "hand",
                false,
                &Answers::of_lines(&[answer]),
            );
            path.map_err(|error| error.to_string())
        };
        let absolute = std::env::current_dir().unwrap().join("no-such-hand.toml");
        for answer in ["./no-such-hand.toml", absolute.to_str().unwrap()] {
            assert_eq!(write_to(answer), Ok(answer.into()));
        }
        for (answer, refused) in [
            ("src/hand.toml", "goes beside the configuration"),
            ("./taxeld.toml", "is the configuration"),
            ("./Cargo.toml", "exists"),
        ] {
            let said = write_to(answer).unwrap_err();
            assert!(said.contains(refused), "{answer}: {said}");
        }
    }
}
