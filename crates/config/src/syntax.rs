//! What is wrong with a configuration file that cannot be read as one, in words for who wrote it.

use crate::{
    CanConfig, ConditionSettings, ControlConfig, JointsConfig, Profile, ProfilesConfig, RealtimeConfig,
    SocketConfig,
};
use serde::de::DeserializeOwned;
use std::ops::Range;
use taxel_engine::TickConfig;
use taxel_hand::plain_words;
use taxel_skin::{BoardsConfig, SweepConfig};

/// The message of the parser in plain words, with what the place in the file adds to it.
pub(crate) fn problem(text: &str, span: Option<Range<usize>>, message: &str) -> String {
    let said = plain_words(message);
    let at = span.map_or(0, |span| span.start).min(text.len());
    let line_start = text.as_bytes()[..at]
        .iter()
        .rposition(|b| *b == b'\n')
        .map_or(0, |i| i + 1);
    let line = text.get(line_start..).and_then(|rest| rest.lines().next());
    let line = line.unwrap_or_default().trim_start();
    let is_bus = line.starts_with("[bus]") || line.starts_with("bus");
    let is_twice = message == "duplicate key" && line.starts_with('[') && !line.starts_with("[[");
    if is_bus && (is_twice || said.starts_with("a list is wanted")) {
        return "write [[bus]], with two brackets, once for each bus of the hand, and below it a line such as \
                source = \"can:can0\""
            .into();
    }
    if is_twice {
        let table = line.trim_matches(['[', ']']);
        return format!("the table [{table}] is there twice; an entry of a list is written [[{table}]]");
    }
    if let Some(number) = decimal_comma(line) {
        return format!("{number} has a decimal comma; write {}", number.replace(',', "."));
    }
    let unknown = said
        .strip_prefix("unknown key `")
        .and_then(|rest| rest.split_once('`'));
    let belongs = unknown.and_then(|(key, _)| Some((key, table_of(key)?)));
    match belongs {
        Some((key, table)) => format!("unknown key `{key}` here: it belongs below a line {table}"),
        None => said,
    }
}

/// The number of `key = 30,5`.
fn decimal_comma(line: &str) -> Option<&str> {
    let value = line.split_once('=')?.1.split('#').next()?.trim();
    let (whole, fraction) = value.split_once(',')?;
    let is_digits = |text: &str| !text.is_empty() && text.bytes().all(|digit| digit.is_ascii_digit());
    (is_digits(whole.trim_start_matches(['+', '-'])) && is_digits(fraction)).then_some(value)
}

/// The table that has this key, as its line in the file.
fn table_of(key: &str) -> Option<&'static str> {
    if key == "source" {
        return Some("[[bus]]");
    }
    let tables = [
        ("[tick]", keys::<TickConfig>()),
        ("[boards]", keys::<BoardsConfig>()),
        ("[sweep]", keys::<SweepConfig>()),
        ("[conditioning]", keys::<ConditionSettings>()),
        ("[profile]", keys::<Profile>()),
        ("[profiles]", keys::<ProfilesConfig>()),
        ("[socket]", keys::<SocketConfig>()),
        ("[control]", keys::<ControlConfig>()),
        ("[realtime]", keys::<RealtimeConfig>()),
        ("[can]", keys::<CanConfig>()),
        ("[joints]", keys::<JointsConfig>()),
    ];
    let mut having = tables.iter().filter(|(_, keys)| keys.iter().any(|k| k == key));
    match (having.next(), having.next()) {
        (Some((table, _)), None) => Some(table),
        // In several tables it would be a guess.
        _ => None,
    }
}

/// Every key that a table may have: the parser lists them where it refuses one.
pub(crate) fn keys<T: DeserializeOwned>() -> Vec<String> {
    match toml::from_str::<T>("'?' = 0") {
        Err(error) => {
            let names = error.message().split('`').skip(3).step_by(2);
            names.map(str::to_owned).collect()
        }
        Ok(_) => Vec::new(),
    }
}
