//! `taxel demo`: simulator, daemon and live view in one process.

mod forearm;
mod meter;
mod palpation;
mod session;

use crate::categorize::PhantomMap;
use crate::compress::{method_parser, methods};
use crate::offline::preset_parser;
use crate::piped_file::layout_parser;
use crate::seconds::seconds;
use crate::sim::{resolve, scene_parser};
use crate::terminal::{self, Shown};
use anyhow::{Context, bail};
use meter::Meter;
use palpation::Palpating;
use ratatui::Frame;
use ratatui::crossterm::event::KeyEvent;
use serde_json::json;
use session::{Control, Session};
use std::io::Write;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};
use taxel_hand::{Method, Profile};
use taxel_playback::interrupt::Interrupt;
use taxel_playback::remarks::Remarks;
use taxel_sim::{Scene, with_stand_in_boards};
use taxel_skin::{Layout, Preset};
use taxel_view::{Action, Palette, Screen};
use taxel_wire::{ReadError, Received, Subscriber};

/// The scene of the default hand, and the one of any.
const GRASP: &str = "ball-grasp";
const ANY_HAND: &str = "roll";

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
/// Keys: q quits, ? lists the others: z measures the baseline anew, p pauses, so that every display lets go, arrow
/// keys look at a taxel.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  taxel demo
  taxel demo --scene slip --actuators 6
  taxel demo --layout icub-forearm     another hand, with the boards it has
  taxel demo --scene phantom-1         touches of a phantom fall into their categories
  taxel demo --scene forearm           a gripper squeezes a simulated forearm and says where it holds
  taxel demo --headless --seconds 10
  taxel sim --list                     the scenes there are")]
pub(crate) struct Args {
    /// A built-in scene, or a scene file [default: ball-grasp, or roll on hands that it does not fit]
    #[arg(long, value_name = "SCENE", value_parser = scene_parser(), hide_possible_values = true)]
    scene: Option<String>,
    /// Another hand than the scene's own: a built-in name or a layout file, - for stdin
    #[arg(long, value_name = "LAYOUT", value_parser = layout_parser())]
    layout: Option<String>,
    /// Stop after so long [default: never, or after the scene when headless]
    #[arg(long, value_name = "S", value_parser = seconds(0.001..=1e9))]
    pub(crate) seconds: Option<Duration>,
    /// Print a summary at the end instead of drawing; so too when stdout is no terminal
    #[arg(long)]
    headless: bool,
    /// Force levels of the display, K_D
    #[arg(long, value_name = "K_D", value_parser = clap::value_parser!(u16).range(1..=255))]
    pub(crate) levels: Option<u16>,
    /// Actuators of the display, K_A
    #[arg(long, value_name = "K_A", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) actuators: Option<u16>,
    #[arg(long, value_name = "METHOD", value_parser = method_parser(), hide_possible_values = true, help = format!("How frames are compressed: {}", methods()))]
    pub(crate) method: Option<Method>,
    /// How counts become forces, robust or paper, the publication's equations (1) and (2) [default: that of the method]
    #[arg(long, value_name = "PRESET", value_parser = preset_parser(), hide_possible_values = true)]
    pub(crate) conditioning: Option<Preset>,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    if args.scene.as_deref() == Some(forearm::SCENE) {
        return forearm::run(args, args.headless || !terminal::can_draw());
    }
    let (scene_name, layout) = scene_and_layout(args)?;
    let scene = resolve(&scene_name)?;
    let interrupt = Interrupt::install()?;
    let map = scene
        .palpation()
        .map(|_| PhantomMap::of_scene(&scene_name))
        .transpose()?;
    let session = Session::start(args, &scene_name, &scene, layout)?;
    let headless = args.headless || !terminal::can_draw();
    let of_scene = Duration::from_secs_f64(scene.seconds());
    let limit = args.seconds.or(headless.then_some(of_scene));
    let deadline = limit.map(|limit| session.began + limit);
    if let (Some(limit), true) = (limit, headless) {
        eprintln!(
            "taxel: the scene {scene_name} is played for {:.0} s without a picture; what came of it is told then",
            limit.as_secs_f64()
        );
    }
    let meter = Arc::new(Mutex::new(Meter::new(
        &session.layout,
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
        false => {
            let mut show = Show {
                meter: &meter,
                control: &session.control,
                own: session.profile.clone(),
                screen: Screen::new(),
                palette: Palette::of_terminal(),
            };
            terminal::show(&mut show, &interrupt, deadline, Remarks::gather())
        }
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
    if meter.seen.images() == 0 {
        bail!(
            "no image came; give it more than --seconds {}",
            args.seconds.unwrap_or(of_scene).as_secs_f64()
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
        None => Layout::resolve(resolve(name)?.layout())?,
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
            Ok(Received::Hello(hello)) => lock(meter).seen.see_hello(hello, taxel_can::monotonic_ns()),
            Ok(Received::Image(header, image)) => {
                let now_ns = taxel_can::monotonic_ns();
                lock(meter).seen.see_image(&header, &image, now_ns);
            }
            Ok(Received::Raw(header, raw)) => lock(meter).seen.see_raw(&header, &raw),
            Ok(Received::Status(_, status)) => lock(meter).seen.see_status(status),
            Ok(Received::Event(_, event)) => lock(meter).seen.see_event(event, taxel_can::monotonic_ns()),
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

/// What is drawn, and what keys do.
struct Show<'a> {
    meter: &'a Mutex<Meter>,
    control: &'a Control,
    /// The profile that the demo was started with.
    own: Profile,
    screen: Screen,
    palette: Palette,
}

impl Shown for Show<'_> {
    fn draw(&mut self, frame: &mut Frame<'_>) -> bool {
        let (picture, heading, palpation) = {
            let mut meter = lock(self.meter);
            if meter.closed {
                return false;
            }
            let picture = meter.seen.picture(&self.screen, taxel_can::monotonic_ns());
            (picture, meter.heading(), meter.palpation.clone())
        };
        let Some(picture) = picture else { return true };
        let (area, palette) = (frame.area(), self.palette);
        let buffer = frame.buffer_mut();
        let has_map = palpation.is_some();
        let map = taxel_view::draw(buffer, area, &picture, &self.screen, &heading, palette, has_map);
        if let (Some(map), Some(palpation)) = (map, &palpation) {
            palpation::draw(buffer, map, palpation, palette);
        }
        true
    }

    fn key(&mut self, key: KeyEvent) -> bool {
        let action = {
            let seen = &mut lock(self.meter).seen;
            seen.hush();
            self.screen.key(key, seen)
        };
        let request = match action {
            Action::Quit => return false,
            Action::Rezero => json!({ "cmd": "rezero" }),
            Action::Pause(true) => json!({ "cmd": "pause" }),
            Action::Pause(false) => json!({ "cmd": "resume" }),
            Action::Mark(text) => json!({ "cmd": "mark", "text": text }),
            // This view is the only display.
            Action::Profile(profile) => {
                json!({ "cmd": "profile", "profile": profile.map_or_else(|| self.own.clone(), |profile| *profile) })
            }
            Action::Record => {
                self.say("the demo records nothing; `taxel view` does, of a daemon".into());
                return true;
            }
            _ => return true,
        };
        if let Err(error) = self.control.request(&request) {
            self.say(format!("{error:#}"));
        }
        true
    }

    fn tell(&mut self, words: String) {
        lock(self.meter).seen.tell(words, taxel_can::monotonic_ns());
    }
}

impl Show<'_> {
    /// Shows what became of a key.
    fn say(&self, words: String) {
        lock(self.meter).seen.say(words, taxel_can::monotonic_ns());
    }
}
