//! What was seen in the end: a few lines for people, one object for programs.

use anyhow::{Context, bail};
use serde::Serialize;
use serde_json::{Value, json};
use taxel_hand::plural;
use taxel_view::{Seen, Summary};
use taxeld::stdout;

const NO_HAND: &str = "no description of a hand came";

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

/// When it began, and now where that goes on without images ([`Seen::summary`]).
type Time = (u64, Option<u64>);

/// The object of what was seen, and what more there is to it.
///
/// # Errors
/// Where no hand was described.
pub(crate) fn object(
    seen: &Seen,
    name: &str,
    (began_ns, now_ns): Time,
    more: Value,
) -> anyhow::Result<String> {
    let hello = seen.hello().context(NO_HAND)?;
    let object = Object {
        name,
        layout: &hello.layout,
        taxels: hello.taxels.len(),
        method: &hello.profile.method,
        levels: hello.profile.levels,
        actuators: hello.profile.actuators,
        summary: seen.summary(began_ns, now_ns),
        more,
    };
    Ok(serde_json::to_string(&object)? + "\n")
}

/// Prints what was seen, for whoever has no terminal.
///
/// # Errors
/// Where no image came, and, once it is printed, where the daemon is gone at the end.
pub(super) fn print(seen: &Seen, name: &str, time: Time, as_json: bool) -> anyhow::Result<()> {
    if seen.images() == 0 {
        return ended(seen, name);
    }
    if as_json {
        stdout::print(&object(seen, name, time, json!({}))?)?;
    } else {
        let hello = seen.hello().context(NO_HAND)?;
        stdout::print(&format!(
            "{name}: {}, {}; method {}, {}, {}\n{}",
            hello.layout,
            plural(hello.taxels.len(), "taxel"),
            hello.profile.method,
            plural(hello.profile.levels, "level"),
            plural(hello.profile.actuators, "actuator"),
            seen.summary(time.0, time.1)
        ))?;
    }
    ended(seen, name)
}

/// What became of it.
///
/// # Errors
/// Where no image came, or the daemon is gone at the end.
pub(super) fn ended(seen: &Seen, name: &str) -> anyhow::Result<()> {
    match seen.gone() {
        Some(why) => bail!("{name}: {why}"),
        None if seen.images() == 0 => bail!("{name}: no image came"),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_hand::{Profile, TactileImage};
    use taxel_skin::Layout;
    use taxel_wire::{Clock, Header, Hello, HelloRate, ImageView, encode_image_payload};

    #[test]
    fn figures_of_a_daemon_that_is_gone_are_told_with_why_and_no_image_is_no_figure() {
        let layout = Layout::builtin("uskin-module").unwrap();
        let rate = HelloRate {
            mode: "timer".into(),
            hz: None,
        };
        let mut seen = Seen::new();
        let hello = Hello::new("taxeld", &layout, &Profile::default(), rate, Clock::Monotonic);
        seen.see_hello(&hello, 0);
        let failure = |seen: &Seen| print(seen, "hand", (0, None), true).map_err(|error| error.to_string());
        assert_eq!(failure(&seen), Err("hand: no image came".into()));
        let image = TactileImage {
            width: 1,
            height: 1,
            pixels: vec![0],
            ..TactileImage::default()
        };
        let mut payload = Vec::new();
        encode_image_payload(&image, &mut payload).unwrap();
        let header = Header::of_image(&image, payload.len());
        seen.see_image(&header, &ImageView::decode(&payload).unwrap(), 1);
        assert_eq!(failure(&seen), Ok(()));
        seen.set_gone("it ended");
        assert_eq!(failure(&seen), Err("hand: it ended".into()));
        let object: Value =
            serde_json::from_str(&object(&seen, "hand", (0, None), json!({})).unwrap()).unwrap();
        assert_eq!(object["gone"], json!("it ended"));
    }
}
