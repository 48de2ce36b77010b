//! `taxel demo`: simulator, daemon and live view in one process.

mod colour;
mod grid;
mod joints;
mod meter;
mod palpation;
mod session;
mod view;

use crate::categorize::PhantomMap;
use crate::compress::{method, methods};
use crate::interrupt::Interrupt;
use crate::offline::preset;
use anyhow::{Context, bail};
use meter::{Meter, Picture};
use palpation::Palpating;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use session::{Control, Session};
use std::io::{IsTerminal, Write};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};
use taxel_hand::Method;
use taxel_sim::{Scene, with_stand_in_boards};
use taxel_skin::{Layout, Preset};
use taxel_wire::{ReadError, Received, Subscriber};

/// The scene of the default hand, and the one of any.
const GRASP: &str = "ball-grasp";
const ANY_HAND: &str = "roll";
/// Time between two pictures on the terminal.
const REDRAW: Duration = Duration::from_millis(33);

/// A simulated hand, the real daemon and a live view of both, here and now: no hardware, no root.
///
/// The simulator plays the scene as CAN traffic of the hand's boards (15 uSkin modules, unless
/// --layout names another hand); the daemon starts them and reads them as it would on a bus and
/// publishes tactile images on a socket in a temporary directory; the view subscribes to that
/// socket as any display does. Left is what the skin feels, right is what a display with few
/// actuators is given. Simulated servos on a pseudo terminal close the fingers as the scene has it;
/// the daemon reads them as it would read a serial bus, and the angles that each image carries are
/// the bars below the fingers.
///
/// Where the scene palpates a phantom, the demo makes its marks, and each touch falls into its category on a map of the
/// touches' first two components.
///
/// Keys: q quits, z measures the baseline anew (as after a warm-up; not while the hand is touched),
/// p pauses, so that every display lets go.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  taxel demo
  taxel demo --scene slip --actuators 6
  taxel demo --layout icub-forearm     another hand, with the boards it has
  taxel demo --scene phantom-1         touches of a phantom fall into their categories
  taxel demo --headless --seconds 10
  taxel sim --list                     the scenes there are")]
pub(crate) struct Args {
    /// A built-in scene, or a scene file [default: ball-grasp, or roll on hands that it does not fit]
    #[arg(long, value_name = "SCENE")]
    scene: Option<String>,
    /// Another hand than the scene's own: a built-in name or a layout file
    #[arg(long, value_name = "LAYOUT")]
    layout: Option<String>,
    /// Stop after so long [default: never, or after the scene when headless]
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
    /// Print a summary at the end instead of drawing; so too when stdout is no terminal
    #[arg(long)]
    headless: bool,
    /// Force levels of the display, K_D
    #[arg(long, value_name = "K_D")]
    pub(crate) levels: Option<u16>,
    /// Actuators of the display, K_A
    #[arg(long, value_name = "K_A")]
    pub(crate) actuators: Option<u16>,
    #[arg(long, value_name = "METHOD", value_parser = method, help = format!("How frames are compressed: {}", methods()))]
    pub(crate) method: Option<Method>,
    /// How counts become forces, robust or paper, the publication's equations (1) and (2) [default: that of the method]
    #[arg(long, value_name = "PRESET", value_parser = preset)]
    pub(crate) conditioning: Option<Preset>,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let seconds = match args.seconds {
        Some(s) if !(s > 0.0 && s < 1e9) => bail!("--seconds {s} is no time to run a demo"),
        seconds => seconds,
    };
    let (scene_name, layout) = scene_and_layout(args)?;
    let scene = Scene::resolve(&scene_name)?;
    let interrupt = Interrupt::install()?;
    let map = scene
        .palpation()
        .map(|_| PhantomMap::of_scene(&scene_name))
        .transpose()?;
    let session = Session::start(args, &scene_name, &scene, layout)?;
    let headless = args.headless || !std::io::stdout().is_terminal();
    let limit = match (seconds, headless) {
        (Some(seconds), _) => Some(Duration::from_secs_f64(seconds)),
        (None, true) => Some(Duration::from_secs_f64(scene.seconds())),
        (None, false) => None,
    };
    let deadline = limit.map(|limit| session.began + limit);
    let meter = Arc::new(Mutex::new(Meter::new(
        session.layout.clone(),
        session.scene_began_ns,
        &scene,
    )));
    let reader = {
        let (meter, subscriber) = (meter.clone(), session.subscribe()?);
        std::thread::Builder::new()
            .name("reader".into())
            .spawn(move || read(subscriber, &meter))?
    };
    let palpating = map.map(|map| {
        let sockets = [session.images.clone(), session.control.0.clone()];
        Palpating::start(&scene, map, session.began, sockets, &meter)
    });
    let palpating = palpating.transpose()?;
    let outcome = match headless {
        true => wait(&interrupt, deadline, &meter),
        false => show(&interrupt, deadline, &meter, &session.control),
    };
    drop(palpating);
    let stopped = session.stop();
    // The daemon has closed the socket, so the reader has come to its end.
    let _ = reader.join();
    outcome?;
    stopped?;
    let meter = lock(&meter);
    if let Some(failure) = &meter.failure {
        bail!("the demo's daemon: {failure}");
    }
    let mut out = std::io::stdout().lock();
    out.write_all(meter.summary().as_bytes())
        .and_then(|()| out.flush())
        .context("stdout")?;
    if meter.images() == 0 {
        bail!(
            "no image came; give it more than --seconds {}",
            seconds.unwrap_or(scene.seconds())
        );
    }
    Ok(())
}

/// The scene's name and the hand it is played on.
fn scene_and_layout(args: &Args) -> anyhow::Result<(String, Layout)> {
    let named = args.layout.as_deref().map(Layout::resolve).transpose()?;
    let fits =
        |name: &str, layout: &Layout| Scene::builtin(name).is_ok_and(|scene| scene.fits(layout).is_ok());
    let usual = match &named {
        Some(layout) if !fits(GRASP, layout) => ANY_HAND,
        _ => GRASP,
    };
    let name = args.scene.as_deref().unwrap_or(usual);
    let layout = match named {
        Some(layout) => layout,
        None => Layout::resolve(Scene::resolve(name)?.layout())?,
    };
    if layout.buses.is_empty() {
        eprintln!(
            "{} has no boards on a bus; simulated ones stand in for them",
            layout.name
        );
    }
    Ok((name.into(), with_stand_in_boards(&layout)?))
}

fn lock(meter: &Mutex<Meter>) -> MutexGuard<'_, Meter> {
    // A reader that panicked leaves numbers that can still be read.
    meter.lock().unwrap_or_else(|e| e.into_inner())
}

/// Takes what the daemon publishes until it closes the connection.
fn read(mut subscriber: Subscriber, meter: &Mutex<Meter>) {
    loop {
        match subscriber.next() {
            Ok(Received::Hello(hello)) => lock(meter).hello(hello),
            Ok(Received::Image(header, image)) => {
                let now_ns = taxel_can::monotonic_ns();
                lock(meter).image(&header, &image, now_ns);
            }
            Ok(Received::Raw(header, raw)) => lock(meter).raw(&header, &raw),
            Ok(Received::Event(_, event)) => lock(meter).event(event),
            Ok(_) => {}
            Err(error) => {
                let mut meter = lock(meter);
                meter.closed = true;
                if !matches!(error, ReadError::Closed) {
                    meter.failure = Some(error.to_string());
                }
                return;
            }
        }
    }
}

/// Until the time is up, Ctrl-C, or the daemon's end.
fn wait(interrupt: &Interrupt, deadline: Option<Instant>, meter: &Mutex<Meter>) -> anyhow::Result<()> {
    let look = Duration::from_millis(50);
    while !lock(meter).closed && deadline.is_none_or(|deadline| Instant::now() < deadline) {
        let next = Instant::now() + look;
        if !interrupt.sleep_until(deadline.map_or(next, |deadline| next.min(deadline))) {
            break;
        }
    }
    Ok(())
}

/// Draws until the time is up, `q`, Ctrl-C, or the daemon's end.
fn show(
    interrupt: &Interrupt,
    deadline: Option<Instant>,
    meter: &Mutex<Meter>,
    control: &Control,
) -> anyhow::Result<()> {
    let keys = keys()?;
    // Restores the terminal on panic, too.
    let mut terminal = ratatui::try_init().context("the terminal; --headless does without")?;
    let palette = colour::Palette::of_terminal();
    let mut drawn = || -> anyhow::Result<()> {
        let mut next = Instant::now();
        while !interrupt.is_set() && deadline.is_none_or(|deadline| Instant::now() < deadline) {
            let picture: Picture = {
                let mut meter = lock(meter);
                if meter.closed {
                    break;
                }
                meter.picture(taxel_can::monotonic_ns())
            };
            terminal
                .draw(|frame| view::draw(frame, &picture, &palette))
                .context("the terminal")?;
            next = (next + REDRAW).max(Instant::now());
            loop {
                match keys.recv_timeout(next.saturating_duration_since(Instant::now())) {
                    Ok(key) if press(key, meter, control) => {}
                    Ok(_) => return Ok(()),
                    Err(RecvTimeoutError::Timeout) => break,
                    Err(RecvTimeoutError::Disconnected) => {
                        interrupt.sleep_until(next);
                        break;
                    }
                }
            }
        }
        Ok(())
    };
    let outcome = drawn();
    if ratatui::try_restore().is_err() {
        // The terminal was closed. Dropped, it would complain on it, and panic.
        std::mem::forget(terminal);
    }
    outcome
}

/// The keys pressed from now on.
///
/// They are read on a thread of their own, which ends with the process: reading from a terminal
/// that was closed may never return.
fn keys() -> anyhow::Result<mpsc::Receiver<KeyEvent>> {
    let (sender, keys) = mpsc::channel();
    let read = move || {
        while let Ok(event) = event::read() {
            if let Event::Key(key) = event
                && sender.send(key).is_err()
            {
                return;
            }
        }
    };
    std::thread::Builder::new()
        .name("keys".into())
        .spawn(read)
        .context("a thread for the keyboard")?;
    Ok(keys)
}

/// Does what a key asks; returns whether to go on.
fn press(key: KeyEvent, meter: &Mutex<Meter>, control: &Control) -> bool {
    if key.kind == KeyEventKind::Release {
        return true;
    }
    let command = match key.code {
        KeyCode::Char('q') | KeyCode::Esc => return false,
        KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => return false,
        KeyCode::Char('z') => "rezero",
        KeyCode::Char('p') => match lock(meter).paused {
            true => "resume",
            false => "pause",
        },
        _ => return true,
    };
    let note = match control.command(command) {
        Ok(()) => {
            let mut meter = lock(meter);
            if command != "rezero" {
                meter.paused = command == "pause";
            }
            String::new()
        }
        Err(error) => format!("{command}: {error:#}"),
    };
    lock(meter).note = note;
    true
}
