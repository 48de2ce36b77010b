//! Conditioned frames and measured times for other programs to judge.

use std::path::Path;
use taxel_eval::{References, Sequence, Timings};
use taxel_record::NpzWriter;

/// Writes `force` (f64) and `contact` (u8) `T x N`, 0 where a taxel has a fault; `x`, `y` (u16)
/// `N`; `t_ns` (u64) `T`; and what a method's errors are divided by: `level_error`, `place_error`
/// (f64) `T`.
pub(super) fn write(path: &Path, sequence: &Sequence, references: &References) -> anyhow::Result<()> {
    let usable = |t: usize, n: usize| sequence.force[t].contact[n] && sequence.force[t].faults[n].is_empty();
    let taxels = &sequence.layout.taxels;
    let (frames, each) = (sequence.len(), taxels.len());
    let cells = || (0..frames * each).map(|cell| (cell / each, cell % each));
    let mut npz = NpzWriter::compressed(path);
    npz.add(
        "force",
        &[frames, each],
        cells().map(|(t, n)| sequence.force[t].force[n]),
    )?;
    npz.add(
        "contact",
        &[frames, each],
        cells().map(|(t, n)| u8::from(usable(t, n))),
    )?;
    npz.add("x", &[each], taxels.iter().map(|t| t.x))?;
    npz.add("y", &[each], taxels.iter().map(|t| t.y))?;
    npz.add("t_ns", &[frames], sequence.force.iter().map(|f| f.t_ns))?;
    let best = &references.frames;
    npz.add("level_error", &[best.len()], best.iter().map(|f| f.level_error))?;
    npz.add("place_error", &[best.len()], best.iter().map(|f| f.place_error))?;
    Ok(npz.finish()?)
}

/// Writes `condition_us`, `compress_us` (f32) `M x T x P`: of each method, each frame with
/// contacts, each pass.
pub(super) fn write_times(path: &Path, timings: &[Timings]) -> anyhow::Result<()> {
    let frames = timings.first().map_or(&[][..], Timings::laps);
    let shape = [timings.len(), frames.len(), frames.first().map_or(0, Vec::len)];
    let laps = || timings.iter().flat_map(Timings::laps).flatten();
    let mut npz = NpzWriter::compressed(path);
    npz.add("condition_us", &shape, laps().map(|lap| lap.condition_us))?;
    npz.add("compress_us", &shape, laps().map(|lap| lap.compress_us))?;
    Ok(npz.finish()?)
}
