//! A whole recording at once.

use crate::change::{Change, Changes, Recorded};
use crate::config::EngineConfig;
use crate::engine::{Engine, EngineError};
use crate::frames::Frames;
use std::ops::ControlFlow;
use taxel_hand::TactileFrame;

/// Runs a whole recording through an engine, in the recording's own time: the offline path of `taxel compress`. What it
/// feels is bit for bit what the daemon feels of the same recording, and [`Display`](crate::Display) makes the same images
/// of it.
///
/// `frames`, and what a daemon did meanwhile, are in the order of their times, which start at zero. After the last frame,
/// ticks go on until `end_ns`. `emit` is given what each tick felt; where it breaks off, nothing more is made.
pub fn run_recorded(
    config: &EngineConfig,
    frames: impl IntoIterator<Item = impl Into<Recorded>>,
    end_ns: Option<u64>,
    mut emit: impl FnMut(&Frames) -> ControlFlow<()>,
) -> Result<(), EngineError> {
    let mut engine = Engine::new(config, 0)?;
    // Asked for one by one: many may be due before one frame.
    let mut make_due = |engine: &mut Engine| {
        while let Some(frames) = engine.poll_output() {
            emit(frames)?;
        }
        ControlFlow::Continue(())
    };
    let mut last_ns = 0;
    for recorded in frames {
        let (bus, received) = match recorded.into() {
            Recorded::Frame(bus, received) => (bus, received),
            Recorded::Change(t_ns, change) => {
                engine.handle_change(t_ns, change);
                continue;
            }
        };
        last_ns = received.t_ns;
        engine.handle_frame(bus, &received);
        if make_due(&mut engine).is_break() {
            return Ok(());
        }
    }
    engine.handle_time(end_ns.unwrap_or(last_ns).max(last_ns));
    let _ = make_due(&mut engine);
    Ok(())
}

/// Runs tactile frames that are whole already, as recorded ones are, whatever is missing in them: a tick for each,
/// through the same conditioning, and no sweep to be put together. `changes` are what the daemon did meanwhile, each before
/// the first frame of its time or a later one.
///
/// `fill` makes the next frame of the one before it, in the order of their times, and says whether there was one: counts,
/// their age, whether they are fresh, and joints. `emit` is given what each felt; where it breaks off, nothing more is made.
pub fn run_whole_frames(
    config: &EngineConfig,
    changes: Vec<(u64, Box<Change>)>,
    mut fill: impl FnMut(&mut TactileFrame) -> bool,
    mut emit: impl FnMut(&Frames) -> ControlFlow<()>,
) -> Result<(), EngineError> {
    let mut conditioner = config.conditioner()?;
    let mut frames = Frames::new(config.layout.len());
    let (mut ahead, mut paused) = (Changes::default(), false);
    changes
        .into_iter()
        .for_each(|(t_ns, change)| ahead.push(t_ns, change));
    while fill(&mut frames.tactile) {
        frames.due_ns = frames.tactile.t_ns;
        ahead.make(frames.due_ns, &mut conditioner, &mut paused);
        frames.feel(&mut conditioner, paused);
        if emit(&frames).is_break() {
            break;
        }
        frames.tactile.seq += 1;
    }
    Ok(())
}
