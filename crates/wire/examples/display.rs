//! A display driver in Rust: presses actuators as the tactile images say.
//!
//!     cargo run -p taxel-wire --example display -- /run/taxeld/images.sock
//!
//! Put your hardware into [`drive`], which is called with the levels of all pressing actuators, 1 to
//! [`LEVELS`], whenever they change. The display states how many it has: without that a level is one
//! of the daemon's, whose number may change. When no image has come for [`DEAD_MAN`] everything is let go: a display
//! must not press on what the hand no longer feels. When the daemon goes away the driver lets go at
//! once and connects again.

use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM};
use std::collections::BTreeMap;
use std::io::Write;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};
use taxel_hand::Profile;
use taxel_wire::{DecodeError, EventKind, ReadError, Received, Subscribe, Subscriber};

/// Of force, and actuators, of your display.
const LEVELS: u16 = 8;
const ACTUATORS: u16 = 16;
/// A few image periods; at 30 Hz an image comes every 33 ms.
const DEAD_MAN: Duration = Duration::from_millis(200);
const RECONNECT: Duration = Duration::from_millis(500);

/// Level of each actuator that presses, by its id.
type Levels = BTreeMap<u16, u16>;

/// Your hardware: sets each actuator to its level, and lets go of those not named.
fn drive(levels: &Levels, why: &str) {
    let pressed: Vec<String> = levels.iter().map(|(id, level)| format!("{id}={level}")).collect();
    let pressed = if pressed.is_empty() {
        "clear".into()
    } else {
        pressed.join(" ")
    };
    if writeln!(std::io::stdout(), "{why}: {pressed}").is_err() {
        // Whoever read it has seen enough.
        std::process::exit(0);
    }
}

/// What the display shows now.
#[derive(Default)]
struct Display {
    levels: Levels,
}

impl Display {
    /// Drives the hardware where something changes.
    fn show(&mut self, levels: Levels, why: &str) {
        if levels != self.levels {
            drive(&levels, why);
            self.levels = levels;
        }
    }
}

/// Shows images until the connection ends, or the driver is told to stop; false if the daemon cannot give such images. Its own,
/// which it goes on to send, are not of this display.
fn follow(subscriber: &mut Subscriber, display: &mut Display, stop: &AtomicBool) -> Result<bool, ReadError> {
    let profile = Profile {
        levels: LEVELS,
        actuators: ACTUATORS,
        ..Profile::default()
    };
    subscriber.subscribe(&Subscribe {
        profile: Some(profile),
        ..Subscribe::default()
    })?;
    let mut last = Instant::now();
    while !stop.load(Ordering::Relaxed) {
        match subscriber.next_timeout(Duration::from_millis(20)) {
            Ok(Some(Received::Image(_, image))) => {
                // The first may be from before the daemon has heard of LEVELS.
                let own = image.actuators().filter(|a| a.id < ACTUATORS);
                display.show(own.map(|a| (a.id, a.level.min(LEVELS))).collect(), "image");
                last = Instant::now();
            }
            Ok(Some(Received::Event(_, event))) => {
                eprintln!("taxeld: {}", event.message);
                if event.event == EventKind::Refused {
                    return Ok(false);
                }
            }
            Ok(_) => {}
            Err(error) if ends(&error) => return Err(error),
            Err(error) => eprintln!("display: a message was not usable: {error}"),
        }
        // Not by the time-out alone: messages that are not images must not hold the display.
        if last.elapsed() >= DEAD_MAN {
            display.show(Levels::new(), "no image");
        }
    }
    Ok(true)
}

/// Whether nothing more can be read after this error.
fn ends(error: &ReadError) -> bool {
    let gone = error.is_end();
    gone || is_other_version(error)
}

fn is_other_version(error: &ReadError) -> bool {
    matches!(error, ReadError::Decode(DecodeError::MajorVersion { .. }))
}

fn main() -> ExitCode {
    let Some(path) = std::env::args_os().nth(1) else {
        eprintln!("usage: display SOCKET, such as /run/taxeld/images.sock; taxeld logs where it is");
        return ExitCode::from(2);
    };
    let stop = Arc::new(AtomicBool::new(false));
    // A terminal that is closed sends SIGHUP.
    for signal in [SIGINT, SIGTERM, SIGHUP, SIGQUIT] {
        signal_hook::flag::register(signal, Arc::clone(&stop)).expect("these signals can be caught");
    }
    let mut display = Display::default();
    while !stop.load(Ordering::Relaxed) {
        let result = Subscriber::connect(&path)
            .and_then(|mut subscriber| follow(&mut subscriber, &mut display, &stop));
        display.levels.clear();
        let error = match result {
            Ok(true) => break,
            Ok(false) => {
                drive(&display.levels, "refused");
                return ExitCode::FAILURE;
            }
            Err(error) => error,
        };
        drive(&display.levels, "closed");
        eprintln!("display: {error}");
        if is_other_version(&error) {
            return ExitCode::FAILURE;
        }
        sleep(RECONNECT);
    }
    drive(&display.levels, "stopped");
    ExitCode::SUCCESS
}
