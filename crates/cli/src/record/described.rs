//! What a hand is recorded with: the configuration of its daemon, and its buses. It is looked at anew whenever it is
//! connected to a daemon, since a recorder outlives many of them.

use super::{Args, buses_of, buses_of_daemon, same_hand, status_of_daemon};
use crate::recordings::input::DEFAULT_LAYOUT;
use anyhow::Context;
use std::collections::BTreeMap;
use std::path::Path;
use taxel_playback::head::{CONFIG, LAYOUT};
use taxel_recorder::{Attached, CanInput, Described, Preamble};
use taxel_skin::Layout;
use taxel_wire::Hello;
use taxel_wire::status::Status;
use taxeld::Config;

impl Args {
    /// What the hand is recorded with that a daemon describes now: with the configuration as the file has it now, or without
    /// where that is not the daemon's; of its buses, or of those of `before` where they were named or are not known.
    pub(super) fn described(&self, hello: &Hello, status_socket: &Path, before: &[CanInput]) -> Described {
        let names_no_bus = self.names_no_bus();
        let status = names_no_bus
            .then(|| status_of_daemon(status_socket).ok())
            .flatten();
        let (config, preamble, news) = match self.configured(hello, status.as_ref()) {
            Ok((config, preamble)) => (config, preamble, None),
            Err(error) => {
                let news = format!("{error:#}. From here on it is recorded without it");
                (None, bare(), Some(news))
            }
        };
        let can = match (config, status) {
            _ if !names_no_bus => before.to_vec(),
            (Some(config), _) => buses_of(&config),
            (None, Some(status)) => buses_of_daemon(&status),
            (None, None) => before.to_vec(),
        };
        Described { preamble, can, news }
    }

    /// The configuration as the file has it now, where one is named, and what stands at the beginning of files made with it.
    ///
    /// # Errors
    /// Where it cannot be read, or is of another hand than the daemon's.
    fn configured(
        &self,
        hello: &Hello,
        status: Option<&Status>,
    ) -> anyhow::Result<(Option<Config>, Preamble)> {
        let Some(file) = self.config.as_deref() else {
            return Ok((None, bare()));
        };
        let config = Config::load(file)?;
        same_hand::check(&config, file, hello)?;
        if let Some(status) = status {
            same_hand::check_buses(&config, file, status)?;
        }
        Ok((Some(config), preamble(Some(file))?))
    }
}

/// What stands at the beginning of a file without a configuration.
fn bare() -> Preamble {
    let recorder = format!("taxel {}", env!("CARGO_PKG_VERSION"));
    Preamble {
        facts: BTreeMap::from([("recorder".to_owned(), recorder)]),
        attached: Vec::new(),
    }
}

/// What stands at the beginning of every file that is recorded with this configuration.
pub(super) fn preamble(config: Option<&Path>) -> anyhow::Result<Preamble> {
    let mut preamble = bare();
    if let Some(path) = config {
        let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
        let table: toml::Table = toml::from_str(&text)?;
        let name = table
            .get("layout")
            .and_then(toml::Value::as_str)
            .unwrap_or(DEFAULT_LAYOUT);
        preamble.facts.insert("layout".into(), name.into());
        let beside = path.parent().unwrap_or(Path::new("")).join(name);
        let mut attach = |name: &str, text: String| {
            preamble.attached.push(Attached {
                name: name.into(),
                media_type: "application/toml".into(),
                data: text.into_bytes(),
            });
        };
        attach(CONFIG, text);
        if Layout::builtin(name).is_none() && !name.starts_with("grid:") {
            let layout = std::fs::read_to_string(&beside).or_else(|_| std::fs::read_to_string(name));
            attach(LAYOUT, layout.with_context(|| beside.display().to_string())?);
        }
    }
    Ok(preamble)
}
