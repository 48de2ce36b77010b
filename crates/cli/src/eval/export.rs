//! Conditioned frames and measured times for other programs to judge.

use ndarray::{Array1, Array2, Array3};
use ndarray_npy::NpzWriter;
use std::io::Cursor;
use std::path::Path;
use taxel_eval::{Lap, References, Sequence, Timings};

/// Writes `force` (f64) and `contact` (u8) `T x N`, 0 where a taxel has a fault; `x`, `y` (u16)
/// `N`; `t_ns` (u64) `T`; and what a method's errors are divided by: `level_error`, `place_error`
/// (f64) `T`.
pub(super) fn write(path: &Path, sequence: &Sequence, references: &References) -> anyhow::Result<()> {
    let shape = (sequence.len(), sequence.layout.len());
    let usable = |t: usize, n: usize| sequence.force[t].contact[n] && sequence.force[t].faults[n].is_empty();
    let contact = Array2::from_shape_fn(shape, |(t, n)| u8::from(usable(t, n)));
    let force = Array2::from_shape_fn(shape, |(t, n)| sequence.force[t].force[n]);
    let taxels = &sequence.layout.taxels;
    let mut npz = NpzWriter::new_compressed(Cursor::new(Vec::new()));
    npz.add_array("force", &force)?;
    npz.add_array("contact", &contact)?;
    npz.add_array("x", &taxels.iter().map(|t| t.x).collect::<Array1<u16>>())?;
    npz.add_array("y", &taxels.iter().map(|t| t.y).collect::<Array1<u16>>())?;
    npz.add_array(
        "t_ns",
        &sequence.force.iter().map(|f| f.t_ns).collect::<Array1<u64>>(),
    )?;
    let best = &references.frames;
    npz.add_array(
        "level_error",
        &best.iter().map(|f| f.level_error).collect::<Array1<f64>>(),
    )?;
    npz.add_array(
        "place_error",
        &best.iter().map(|f| f.place_error).collect::<Array1<f64>>(),
    )?;
    Ok(std::fs::write(path, npz.finish()?.into_inner())?)
}

/// Writes `condition_us`, `compress_us` (f32) `M x T x P`: of each method, each frame with
/// contacts, each pass.
pub(super) fn write_times(path: &Path, timings: &[Timings]) -> anyhow::Result<()> {
    let frames = timings.first().map_or(&[][..], Timings::laps);
    let shape = (timings.len(), frames.len(), frames.first().map_or(0, Vec::len));
    let times = |of: fn(&Lap) -> f32| Array3::from_shape_fn(shape, |(m, t, p)| of(&timings[m].laps()[t][p]));
    let mut npz = NpzWriter::new_compressed(Cursor::new(Vec::new()));
    npz.add_array("condition_us", &times(|lap| lap.condition_us))?;
    npz.add_array("compress_us", &times(|lap| lap.compress_us))?;
    Ok(std::fs::write(path, npz.finish()?.into_inner())?)
}
