//! The daemon's pipeline for frames that were recorded or made: what each instant felt is shown to whoever asked.

use crate::buses::recorded_buses::read_ahead;
use crate::buses::traffic::Traffic;
use crate::counts::pauses::shown_ns;
use crate::counts::sweep::{Sweeps, can_carry_counts};
use crate::counts::whole_frames::WholeFrames;
use crate::mcap::daemon_changes::{DaemonChange, DaemonChanges};
use crate::progress::Progress;
use std::ops::ControlFlow;
use taxel_engine::{EngineConfig, EngineError, Frames, Recorded, TickMode, run_recorded, run_whole_frames};
use taxel_hand::{Fault, Faults, ForceFrame, TactileFrame};
use taxel_record::Recording;
use taxel_skin::Movement;

/// Takes what each instant of a recording felt.
pub type Emit<'a> = dyn FnMut(&Felt<'_>) -> anyhow::Result<()> + 'a;

/// An instant of a recording.
#[derive(Debug, Clone, Copy)]
pub struct Felt<'a> {
    /// Counts, where it holds counts.
    pub measured: Option<Measured<'a>>,
    /// What the skin feels.
    pub force: &'a ForceFrame,
    /// Angles of the joints, radians; not a number where unknown.
    pub joints: &'a [f32],
}

/// The counts of an instant, and of what they are above.
#[derive(Debug, Clone, Copy)]
pub struct Measured<'a> {
    /// The counts.
    pub tactile: &'a TactileFrame,
    /// Baseline of each taxel, counts x, y, z; not a number where it has none.
    pub baseline: &'a [[f32; 3]],
    /// What moved while the hand was calibrated ([`Frames::moved`]).
    pub moved: Movement,
}

impl std::ops::Deref for Measured<'_> {
    type Target = TactileFrame;

    fn deref(&self) -> &TactileFrame {
        self.tactile
    }
}

/// Takes CAN frames, and what a daemon did meanwhile, in the order of their times, through the daemon's pipeline; stops at
/// a failure to show what comes out.
pub(crate) fn pipeline(
    config: &EngineConfig,
    frames: impl Iterator<Item = impl Into<Recorded>>,
    emit: &mut Emit<'_>,
) -> anyhow::Result<()> {
    showing(emit, |take| run_recorded(config, frames, None, take))
}

/// Shows what each tick of an engine felt, until that fails.
fn showing(
    emit: &mut Emit<'_>,
    run: impl FnOnce(&mut dyn FnMut(&Frames) -> ControlFlow<()>) -> Result<(), EngineError>,
) -> anyhow::Result<()> {
    let mut failure = None;
    run(&mut |frames| {
        let felt = Felt {
            measured: Some(Measured {
                tactile: &frames.tactile,
                baseline: &frames.baseline,
                moved: frames.moved,
            }),
            force: &frames.force,
            joints: &frames.tactile.joints,
        };
        failure = emit(&felt).err();
        match failure {
            None => ControlFlow::Continue(()),
            Some(_) => ControlFlow::Break(()),
        }
    })?;
    failure.map_or(Ok(()), Err)
}

/// Shows an instant at this time, and with the joint angles of that instant where there are any.
pub(crate) fn emit_at(emit: &mut Emit<'_>, t_ns: u64, angles: &[f32], felt: &Felt<'_>) -> anyhow::Result<()> {
    if angles.is_empty() && t_ns == felt.force.t_ns {
        return emit(felt);
    }
    let tactile = felt.measured.map(|measured| {
        let mut tactile = measured.tactile.clone();
        tactile.t_ns = t_ns;
        if !angles.is_empty() {
            tactile.joint_age_ns = vec![0; angles.len()];
            tactile.joints = angles.to_vec();
        }
        tactile
    });
    let measured =
        (felt.measured.zip(tactile.as_ref())).map(|(measured, tactile)| Measured { tactile, ..measured });
    let force = ForceFrame {
        t_ns,
        ..felt.force.clone()
    };
    emit(&Felt {
        measured,
        force: &force,
        joints: if angles.is_empty() { felt.joints } else { angles },
    })
}

/// Takes recorded traffic through the pipeline, the interface of each bus as named, with what its daemon did meanwhile.
pub fn run_traffic(
    traffic: &Traffic,
    interfaces: &[String],
    config: &EngineConfig,
    changes: Option<DaemonChanges>,
    emit: &mut Emit<'_>,
) -> anyhow::Result<()> {
    read_ahead(traffic, interfaces, changes, |frames| {
        pipeline(config, frames, emit)
    })
}

/// Takes recorded counts through the pipeline, at their recorded times. Each recorded frame is a frame, since the
/// recording says which values belong together: as what boards would have sent, or as it is where they have no CAN frame
/// for each taxel. Boards at a fixed tick are sampled instead, as a daemon samples them. With `tile`, the recording of one
/// module is repeated on every module of the hand. `changes` are what its daemon did, at times of the recording.
pub fn run_counts(
    recording: &Recording,
    config: &EngineConfig,
    changes: Vec<DaemonChange>,
    tile: bool,
    emit: &mut Emit<'_>,
) -> anyhow::Result<()> {
    let same_time = |frame: &usize| recording.t_ns(*frame) == recording.t_ns(frame - 1);
    let doubled = (1..recording.len()).filter(same_time).count();
    if doubled > 0 {
        remark!(
            "taxel: {}: no image of their own for {doubled} of {} frames, which have the time of the frame before",
            recording.name(),
            recording.len()
        );
    }
    // The time of a frame is that of its newest reading.
    let times: Vec<u64> = (0..recording.len()).map(|frame| recording.t_ns(frame)).collect();
    let frame_from = |t_ns| times.partition_point(|time| *time < t_ns).min(times.len() - 1);
    if !can_carry_counts(&config.layout) {
        let shown_ns = shown_ns(recording);
        let changes = changes.into_iter();
        let changes = changes.filter(|(t_ns, _)| *t_ns <= times[times.len() - 1]);
        let changes = changes.map(|(t_ns, change)| (shown_ns[frame_from(t_ns)], change));
        let changes = changes.collect();
        let frames = WholeFrames::bare(recording, &config.layout, tile, &shown_ns)?;
        return run_whole(frames, config, changes, emit);
    }
    let sweeps = Sweeps::new(recording, &config.layout, tile)?;
    let played = |(t_ns, change)| (sweeps.end_ns(frame_from(t_ns)), change);
    let changes = changes.into_iter().map(played).collect();
    match config.tick.mode {
        TickMode::Timer => {
            remark!(
                "taxel: {}: its frames are sampled at the configuration's {} Hz; mode = \"sweep\" in its [tick] gives an \
                 image for each of them",
                recording.name(),
                config.tick.rate_hz
            );
            run_sampled(&sweeps, config, changes, emit)
        }
        TickMode::Sweep => run_whole(WholeFrames::of_boards(&sweeps), config, changes, &mut |felt| {
            let index = sweeps.index_at(felt.force.t_ns);
            emit_at(emit, sweeps.time_ns(index), &[], felt)
        }),
    }
}

fn run_sampled(
    sweeps: &Sweeps<'_>,
    config: &EngineConfig,
    changes: Vec<DaemonChange>,
    emit: &mut Emit<'_>,
) -> anyhow::Result<()> {
    let (recording, origin_ns) = (sweeps.recording(), sweeps.origin_ns());
    let total = recording.len() as u64 * config.layout.len() as u64;
    let progress = Progress::new(total, "frames");
    let frames = sweeps.frames().inspect(|_| progress.advance(1));
    let changes = changes.into_iter();
    let changes = changes.map(|(t_ns, change)| Recorded::Change(t_ns, change));
    pipeline(config, changes.chain(frames.map(Recorded::from)), &mut |felt| {
        let played_ns = felt.force.t_ns;
        let angles = recording.joints(sweeps.index_at(played_ns));
        emit_at(emit, origin_ns + played_ns, angles, felt)
    })
}

fn run_whole(
    mut frames: WholeFrames<'_>,
    config: &EngineConfig,
    changes: Vec<DaemonChange>,
    emit: &mut Emit<'_>,
) -> anyhow::Result<()> {
    let progress = Progress::new(frames.len(), "frames");
    let fill = |frame: &mut TactileFrame| {
        progress.advance(1);
        frames.fill(frame)
    };
    showing(emit, |take| run_whole_frames(config, changes, fill, take))
}

/// Shows magnitudes, which are forces already, without pauses that are too long; contacts begin above `threshold` and end at `release`.
pub fn run_magnitudes(
    recording: &Recording,
    [threshold, release]: [f64; 2],
    emit: &mut Emit<'_>,
) -> anyhow::Result<()> {
    let mut force = ForceFrame::new(recording.taxels());
    force.threshold = threshold;
    let progress = Progress::new(recording.len() as u64, "frames");
    for (index, t_ns) in shown_ns(recording).into_iter().enumerate() {
        let magnitudes = recording.magnitudes(index).unwrap_or_default();
        force.seq = index as u64;
        force.t_ns = t_ns;
        for ((magnitude, force), contact) in magnitudes.iter().zip(&mut force.force).zip(&mut force.contact) {
            *contact = *magnitude > if *contact { release } else { threshold };
            *force = magnitude.max(0.0);
        }
        for (magnitude, faults) in magnitudes.iter().zip(&mut force.faults) {
            *faults = Faults::NONE;
            if magnitude.is_nan() {
                faults.insert(Fault::Missing);
            }
        }
        emit(&Felt {
            measured: None,
            force: &force,
            joints: recording.joints(index),
        })?;
        progress.advance(1);
    }
    Ok(())
}
