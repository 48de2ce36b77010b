//! A whole recording at once.

use crate::config::EngineConfig;
use crate::display::Display;
use crate::engine::{Engine, EngineError};
use crate::frames::Frames;
use std::ops::ControlFlow;
use taxel_can::Received;
use taxel_hand::TactileImage;

/// Runs a whole recording through an engine and compresses it for `display`, in the recording's own
/// time: the offline path of `taxel compress`, and bit for bit what the daemon makes of the same
/// recording.
///
/// `frames` are in the order of their times, which start at zero. After the last frame, ticks go on
/// until `end_ns`. `emit` is given what each tick felt, and the image of it; where it breaks off, nothing
/// more is made.
pub fn run_recorded(
    config: &EngineConfig,
    mut display: Display,
    frames: impl IntoIterator<Item = (u8, Received)>,
    end_ns: Option<u64>,
    mut emit: impl FnMut(&Frames, &TactileImage) -> ControlFlow<()>,
) -> Result<(), EngineError> {
    let mut engine = Engine::new(config, 0)?;
    // Asked for one by one: many may be due before one frame.
    let mut make_due = |engine: &mut Engine| {
        while let Some(frames) = engine.poll_output() {
            emit(frames, display.compress(frames))?;
        }
        ControlFlow::Continue(())
    };
    let mut last_ns = 0;
    for (bus, received) in frames {
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
