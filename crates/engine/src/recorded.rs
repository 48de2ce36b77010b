//! A whole recording at once.

use crate::config::EngineConfig;
use crate::display::Display;
use crate::engine::{Engine, EngineError};
use crate::frames::Frames;
use taxel_can::Received;
use taxel_hand::TactileImage;

/// Runs a whole recording through an engine and compresses it for `display`, in the recording's own
/// time: the offline path of `taxel compress`, and bit for bit what the daemon makes of the same
/// recording.
///
/// `frames` are in the order of their times, which start at zero. After the last frame, ticks go on
/// until `end_ns`. `emit` is given what each tick felt, and the image of it.
pub fn run_recorded(
    config: &EngineConfig,
    mut display: Display,
    frames: impl IntoIterator<Item = (u8, Received)>,
    end_ns: Option<u64>,
    mut emit: impl FnMut(&Frames, &TactileImage),
) -> Result<(), EngineError> {
    let mut engine = Engine::new(config, 0)?;
    let mut emit = |frames: &Frames| emit(frames, display.compress(frames));
    let mut last_ns = 0;
    for (bus, received) in frames {
        last_ns = received.t_ns;
        engine.handle_frame(bus, &received);
        engine.drain(&mut emit);
    }
    engine.handle_time(end_ns.unwrap_or(last_ns).max(last_ns));
    engine.drain(&mut emit);
    Ok(())
}
