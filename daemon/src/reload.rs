//! Another configuration for a daemon that runs.

use crate::state::State;
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::rc::Rc;
use std::time::Duration;
use taxel_config::{Config, ConfigError};
use taxel_diagnose::NotReloaded;
use tokio::sync::mpsc::UnboundedReceiver;
use tokio::sync::oneshot;
use tokio::time::timeout;

/// A file that is not read by then is a problem until it is.
const PATIENCE: Duration = Duration::from_secs(3);

/// A configuration that was read again, or why it cannot be read.
pub(crate) type Reread = Result<Config, String>;

/// One that is being read.
pub(crate) type Reading = oneshot::Receiver<Reread>;

/// Reads a configuration again. A file that makes that panic is refused as a wrong one is: a fault in what reads files is
/// no reason to end what runs, and nothing of it is touched by reading.
pub(crate) fn reread(read: impl FnOnce() -> Result<Config, ConfigError>) -> Reread {
    match catch_unwind(AssertUnwindSafe(read)) {
        Ok(config) => config.map_err(|error| error.to_string()),
        Err(panic) => Err(format!(
            "it made taxeld fail to read it, which is a fault of taxeld: {}; please report it with the file",
            said_by(&*panic)
        )),
    }
}

/// What a panic said.
fn said_by(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied())
        .unwrap_or("it did not say why")
}

/// Takes up configurations as they come.
pub(crate) async fn take_up(mut readings: UnboundedReceiver<Reading>, state: Rc<State>) {
    while let Some(mut reading) = readings.recv().await {
        let read = match timeout(PATIENCE, &mut reading).await {
            Ok(read) => read,
            Err(_) => {
                note(&state, Some(NotReloaded::Unread(PATIENCE)));
                reading.await
            }
        };
        let taken_up = match read {
            Ok(Ok(config)) => take_up_one(&config, &state).await,
            Ok(Err(why)) => Err(why),
            Err(_) => Err("no thread can be started that reads it".into()),
        };
        note(&state, taken_up.err().map(NotReloaded::Refused));
    }
}

/// Takes note of why the newest configuration is refused, which the [problems](State::problems) tell. Only that another
/// reason took the place of one is said here: to them it is the same problem.
fn note(state: &State, refused: Option<NotReloaded>) {
    let before = state.reload_refused.replace(refused);
    match (before, &*state.reload_refused.borrow()) {
        (Some(before), Some(now)) if before == *now => {}
        (Some(NotReloaded::Refused(_)), Some(NotReloaded::Refused(why))) => {
            tracing::warn!("the configuration was read again and is still refused: {why}");
        }
        (Some(_), Some(now)) => tracing::warn!("{}", now.sentence()),
        _ => {}
    }
    state.reports.outdate();
}

/// The error says why its profile is refused.
async fn take_up_one(config: &Config, state: &State) -> Result<(), String> {
    let differing = differing_tables(&state.config, config);
    if !differing.is_empty() {
        tracing::warn!("taken up only by a restart: {}", differing.join(", "));
    }
    state.call_roster().await;
    if state.roster().own_profile() == config.profile {
        tracing::info!("the configuration was read again; [profile] is as it was");
        return Ok(());
    }
    let taken_up = state.server.set_own_profile(config.profile.clone()).await;
    taken_up.map_err(|error| format!("[profile]: {error}"))?;
    tracing::info!("the configuration was read again; [profile] is taken up");
    Ok(())
}

/// What is different between two configurations but for the display profile, as the file calls it.
fn differing_tables(running: &Config, new: &Config) -> Vec<&'static str> {
    let tables = [
        ("layout", running.layout == new.layout),
        ("[[bus]]", running.sources == new.sources),
        ("[tick]", running.tick == new.tick),
        ("[boards]", running.boards == new.boards),
        ("[sweep]", running.sweep == new.sweep),
        ("[conditioning]", running.conditioning == new.conditioning),
        ("[profiles]", running.profiles == new.profiles),
        ("[socket]", running.socket == new.socket),
        ("[control]", running.control == new.control),
        ("[realtime]", running.realtime == new.realtime),
        ("[can]", running.can == new.can),
        ("[joints]", running.joints == new.joints),
    ];
    let differs = |&(name, same): &(&'static str, bool)| (!same).then_some(name);
    tables.iter().filter_map(differs).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn a_file_that_makes_reading_panic_is_refused_as_a_wrong_one() {
        let index = [0; 256].len();
        let why = reread(|| panic!("the index is {index}")).unwrap_err();
        assert!(why.contains("a fault of taxeld: the index is 256;"), "{why}");
        let why = reread(|| panic!("never")).unwrap_err();
        assert!(why.contains("a fault of taxeld: never;"), "{why}");
        let why = reread(|| Config::load(Path::new("/nowhere/hand.toml"))).unwrap_err();
        assert!(why.contains("/nowhere/hand.toml"), "{why}");
    }

    #[test]
    fn each_table_that_needs_a_restart_is_named_and_the_profile_is_not() {
        let buses = "[[bus]]\nsource = 'can:can0'\n[[bus]]\nsource = 'can:can1'\n";
        let parse = |text: &str| Config::parse(text, Path::new("hand.toml")).expect(text);
        let running = parse(buses);
        let with = |table: &str| differing_tables(&running, &parse(&format!("{buses}{table}")));
        for (table, name) in [
            ("[tick]\nrate_hz = 40.0", "[tick]"),
            ("[boards]\nmode = 'triggered'", "[boards]"),
            ("[sweep]\nsettle_ms = 77.0", "[sweep]"),
            ("[conditioning]\nthreshold_margin = 2.0", "[conditioning]"),
            ("[profiles]\nmax = 3", "[profiles]"),
            ("[socket]\nmax_subscribers = 3", "[socket]"),
            ("[control]\nmode = '0660'", "[control]"),
            ("[realtime]\npriority = 0", "[realtime]"),
            ("[can]\nreceive_buffer_kib = 128", "[can]"),
            (
                "[joints]\nsource = 'allegro:can2'\n[joints.allegro]\nversion = 3",
                "[joints]",
            ),
        ] {
            assert_eq!(with(table), [name], "{table}");
        }
        assert_eq!(with("[profile]\nlevels = 3\nactuators = 5"), [""; 0]);
        let others = buses.replace("can1", "can2");
        assert_eq!(differing_tables(&running, &parse(&others)), ["[[bus]]"]);
        let hand = "layout = 'uskin-module'\n[[bus]]\nsource = 'can:can0'\n";
        assert_eq!(differing_tables(&running, &parse(hand)), ["layout", "[[bus]]"]);
    }
}
