//! What `taxel watch` asks the daemon for.

use super::Args;
use anyhow::{Context, anyhow, bail};
use serde_json::{Value, json};
use std::fs::read_to_string;
use std::io;
use taxel_hand::Profile;
use taxel_wire::{EventKind, Hello, LEAST_RATE_HZ, Received, Subscribe};

/// A subscription, and whether the daemon has answered it.
#[derive(Debug)]
pub(super) struct Asked {
    /// None where all is as without a subscription.
    pub(super) subscribe: Option<Subscribe>,
    /// HELLOs until it is in force: the first of a connection, and the answer.
    unanswered: u8,
}

impl Asked {
    /// What the options say.
    pub(super) fn of(args: &Args) -> anyhow::Result<Self> {
        let asked = Subscribe {
            image: !args.raw,
            raw: args.raw,
            every: args.every,
            max_rate_hz: args.max_rate,
            profile: args.profile.as_deref().map(profile).transpose()?,
            region: (!args.region.is_empty()).then(|| args.region.clone()),
            ..Subscribe::default()
        };
        Ok(Self {
            subscribe: (asked != Subscribe::default()).then_some(asked),
            unanswered: 0,
        })
    }

    /// It has been sent over a new connection.
    pub(super) fn sent(&mut self) {
        self.unanswered = if self.subscribe.is_some() { 2 } else { 0 };
    }

    /// Whether what comes is as it was asked for.
    pub(super) fn is_in_force(&self) -> bool {
        self.unanswered == 0
    }

    /// Looks for the answer in what came. It is an error where the daemon refuses.
    pub(super) fn look_into(&mut self, received: &Received<'_>) -> anyhow::Result<()> {
        match received {
            Received::Hello(hello) => {
                let answers = if self.is_told_of(hello) { 1 } else { 2 };
                self.unanswered = self.unanswered.saturating_sub(answers);
                Ok(())
            }
            Received::Event(_, event) if event.event == EventKind::Refused && self.unanswered > 0 => {
                bail!("taxeld refuses that: {}", event.message)
            }
            _ => Ok(()),
        }
    }

    /// Whether a daemon that describes itself so describes itself again when it takes the subscription.
    fn is_told_of(&self, hello: &Hello) -> bool {
        let shown = |asked: &Subscribe| asked.profile.is_some() || asked.region.is_some();
        hello.subscription.is_some() || self.subscribe.as_ref().is_some_and(shown)
    }
}

/// A rate on the command line.
pub(super) fn rate(text: &str) -> Result<f64, String> {
    let rate = text
        .parse()
        .ok()
        .filter(|hz: &f64| hz.is_finite() && *hz >= LEAST_RATE_HZ);
    rate.ok_or_else(|| format!("{text} is no rate; give images per second, {LEAST_RATE_HZ} or more"))
}

/// A display's profile as it was given: a JSON object, or the file that has one.
fn profile(given: &str) -> anyhow::Result<Profile> {
    let (name, text) = match given {
        "-" => ("stdin", io::read_to_string(io::stdin()).context("stdin")?),
        text if text.trim_start().starts_with('{') => ("--profile", text.to_owned()),
        file => (
            file,
            read_to_string(file)
                .with_context(|| format!("--profile: {file}, which is neither a file nor a JSON object"))?,
        ),
    };
    let value: Value = serde_json::from_str(&text).map_err(|error| {
        if text.lines().any(|line| line.trim() == "[profile]") {
            anyhow!(
                "{name}: it has a table [profile], which is a part of the daemon's configuration: what is there is asked for \
                 without --profile"
            )
        } else {
            anyhow!("{name}: {error}; a profile is a JSON object such as {{\"levels\": 4}}")
        }
    })?;
    // As the daemon would say it.
    let asked = Subscribe::parse(json!({ "profile": value }).to_string().as_bytes()).map_err(|error| {
        let error = error.to_string();
        let error = error.strip_prefix("subscription: ").unwrap_or(&error);
        anyhow!("{name}: {}", error.strip_prefix("profile: ").unwrap_or(error))
    })?;
    asked
        .profile
        .with_context(|| format!("{name}: no profile is in it"))
}
