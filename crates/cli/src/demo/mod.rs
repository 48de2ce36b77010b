//! `taxel demo`: simulator, daemon and live view in one process.

mod forearm;
mod meter;
mod palpation;
mod session;

use crate::categorize::PhantomMap;
use crate::client::control;
use crate::compress::{method_parser, methods};
use crate::piped_file::layout_parser;
use crate::recordings::offline::preset_parser;
use crate::seconds::seconds;
use crate::sim::{resolve, scene_parser};
use crate::terminal;
use crate::view::{Source, lock, look, request_of};
use anyhow::bail;
use meter::Meter;
use palpation::{Palpating, Palpation};
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use serde_json::json;
use session::Session;
use std::sync::Arc;
use std::time::{Duration, Instant};
use taxel_hand::Method;
use taxel_playback::interrupt::Interrupt;
use taxel_playback::remarks::Remarks;
use taxel_sim::{Scene, with_stand_in_boards};
use taxel_skin::{Layout, Preset};
use taxel_view::{Action, Heading, Palette, Screen, Seen};
use taxel_wire::{ReadError, Subscriber};
use taxeld::stdout;

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
With --json one object is printed at the end, with the keys of `taxel view --json`; name is the scene,
and where a phantom is palpated it has
  \"touches\":{\"count\",\"right\",\"unknown\"}

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
    /// The summary as one JSON object; implies --headless
    #[arg(long)]
    json: bool,
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
    let headless = args.headless || args.json || !terminal::can_draw();
    if args.scene.as_deref() == Some(forearm::SCENE) {
        return forearm::run(args, headless);
    }
    let (scene_name, layout) = scene_and_layout(args)?;
    let scene = resolve(&scene_name)?;
    let interrupt = Interrupt::install()?;
    let map = scene
        .palpation()
        .map(|_| PhantomMap::of_scene(&scene_name))
        .transpose()?;
    let session = Session::start(args, &scene_name, &scene, layout)?;
    let of_scene = Duration::from_secs_f64(scene.seconds());
    let limit = args.seconds.or(headless.then_some(of_scene));
    let deadline = limit.map(|limit| session.began + limit);
    if let (Some(limit), true) = (limit, headless) {
        remark!(
            "taxel: the scene {scene_name} is played for {:.0} s without a picture; what came of it is told then",
            limit.as_secs_f64()
        );
    }
    let meter = Arc::new(Meter::new(
        &session.layout,
        session.scene_began_ns,
        &scene,
        map.as_ref().map(Palpation::new),
    ));
    let reader = {
        let (meter, subscriber) = (meter.clone(), session.subscribe()?);
        std::thread::Builder::new()
            .name("reader".into())
            .spawn(move || read(subscriber, &meter))?
    };
    let palpating = map.map(|map| {
        let sockets = [session.images.clone(), session.control.clone()];
        Palpating::start(&scene, map.live, session.began, sockets, &meter)
    });
    let palpating = palpating.transpose()?;
    let outcome = match headless {
        true => wait(&interrupt, deadline, &meter),
        false => {
            let played = Played {
                meter: &meter,
                session: &session,
            };
            let (screen, remarks) = (Screen::new(), Remarks::gather());
            look(&meter.seen, &played, screen, &interrupt, deadline, remarks)
        }
    };
    drop(palpating);
    let stopped = session.stop();
    // The daemon has closed the socket, so the reader has come to its end.
    let _ = reader.join();
    outcome?;
    stopped?;
    if let Some(Some(failure)) = meter.end.get() {
        bail!("the demo's daemon: {failure}");
    }
    if !args.json {
        stdout::print(&meter.summary())?;
    }
    if lock(&meter.seen).images() == 0 {
        bail!(
            "no image came; give it more than --seconds {}",
            args.seconds.unwrap_or(of_scene).as_secs_f64()
        );
    }
    if args.json {
        stdout::print(&meter.object()?)?;
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
        remark!(
            "{} has no boards on a bus; simulated ones stand in for them",
            layout.name
        );
    }
    Ok((name.into(), with_stand_in_boards(&layout)?))
}

/// Takes what the daemon publishes until it closes the connection.
fn read(mut subscriber: Subscriber, meter: &Meter) {
    loop {
        match subscriber.next() {
            Ok(received) => lock(&meter.seen).see(received, taxel_can::monotonic_ns()),
            Err(error) if error.is_end() => {
                let failure = (!matches!(error, ReadError::Closed)).then(|| error.to_string());
                let _ = meter.end.set(failure);
                return;
            }
            // The next message may be read.
            Err(error) => meter.tell(error.to_string()),
        }
    }
}

/// Until the time is up, Ctrl-C, or the daemon's end.
fn wait(interrupt: &Interrupt, deadline: Option<Instant>, meter: &Meter) -> anyhow::Result<()> {
    let look = Duration::from_millis(50);
    while meter.end.get().is_none() && deadline.is_none_or(|deadline| Instant::now() < deadline) {
        let next = Instant::now() + look;
        if !interrupt.sleep_until(deadline.map_or(next, |deadline| next.min(deadline))) {
            break;
        }
    }
    Ok(())
}

/// The scene that is played, and the daemon that keys ask.
struct Played<'a> {
    meter: &'a Meter,
    session: &'a Session,
}

impl Source for Played<'_> {
    fn heading(&self, seen: &Seen) -> Heading {
        self.meter.heading(seen)
    }

    fn now_ns(&self, _: &Seen) -> u64 {
        taxel_can::monotonic_ns()
    }

    fn is_over(&self) -> bool {
        self.meter.end.get().is_some()
    }

    fn act(&self, action: Action) -> Option<String> {
        let request = match action {
            // This view is the only display.
            Action::Profile(profile) => {
                let profile = profile.as_deref().unwrap_or(&self.session.profile);
                json!({ "cmd": "profile", "profile": profile })
            }
            Action::Record => return Some("the demo records nothing; `taxel view` does, of a daemon".into()),
            action => request_of(&action)?,
        };
        let refused = control::request(&self.session.control, &request).err()?;
        Some(format!("{refused:#}"))
    }

    fn has_pane(&self) -> bool {
        self.meter.palpation.is_some()
    }

    fn draw_pane(&self, buffer: &mut Buffer, area: Rect, palette: Palette) {
        if let Some(palpation) = &self.meter.palpation {
            palpation::draw(buffer, area, &lock(palpation), palette);
        }
    }
}
