//! What was seen in the end: a few lines for people, one object for programs.

use crate::stdout;
use anyhow::anyhow;
use serde::Serialize;
use serde_json::{Value, json};
use taxel_view::{Seen, Summary};

/// One JSON object: of whom it is, and the figures of the whole time.
#[derive(Serialize)]
struct Object<'a> {
    name: &'a str,
    layout: &'a str,
    taxels: usize,
    method: &'a str,
    levels: u16,
    actuators: u16,
    #[serde(flatten)]
    summary: Summary,
    #[serde(flatten)]
    more: Value,
}

/// The object of what was seen, and what more there is to it.
///
/// # Errors
/// Where no hand was described.
pub(crate) fn object(seen: &Seen, name: &str, began_ns: u64, more: Value) -> anyhow::Result<String> {
    let hello = seen.hello().ok_or_else(|| anyhow!("{name}: {}", why_not(seen)))?;
    let object = Object {
        name,
        layout: &hello.layout,
        taxels: hello.taxels.len(),
        method: &hello.profile.method,
        levels: hello.profile.levels,
        actuators: hello.profile.actuators,
        summary: seen.summary(began_ns),
        more,
    };
    Ok(serde_json::to_string(&object)? + "\n")
}

/// Prints what was seen, for whoever has no terminal.
pub(super) fn print(seen: &Seen, name: &str, began_ns: u64, as_json: bool) -> anyhow::Result<()> {
    if as_json {
        return stdout::print(&object(seen, name, began_ns, json!({}))?);
    }
    let text = match seen.hello() {
        Some(hello) => format!(
            "{name}: {}, {} taxels; method {}, {} levels, {} actuators\n",
            hello.layout,
            hello.taxels.len(),
            hello.profile.method,
            hello.profile.levels,
            hello.profile.actuators,
        ),
        None => format!("{name}: {}\n", why_not(seen)),
    };
    stdout::print(&format!("{text}{}", seen.summary(began_ns)))
}

/// Why no hand was described.
fn why_not(seen: &Seen) -> &str {
    seen.gone().unwrap_or("no description of a hand came")
}
