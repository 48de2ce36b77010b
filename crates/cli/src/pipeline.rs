//! The daemon's pipeline for frames that were recorded or made: what each instant felt and shows is shown to whoever
//! asked.

use std::ops::ControlFlow;
use taxel_can::Received;
use taxel_engine::{Display, Frames, run_recorded};
use taxel_hand::{ForceFrame, TactileFrame, TactileImage};
use taxeld::Config;

/// What is made of each instant of a recording: counts, where it holds counts; what the skin feels;
/// the image.
pub(crate) type Emit<'a> =
    dyn FnMut(Option<Measured<'_>>, &ForceFrame, &TactileImage) -> anyhow::Result<()> + 'a;

/// The counts of an instant, and of what they are above.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Measured<'a> {
    pub(crate) tactile: &'a TactileFrame,
    /// Baseline of each taxel, counts x, y, z; not a number where it has none.
    pub(crate) baseline: &'a [[f32; 3]],
}

impl std::ops::Deref for Measured<'_> {
    type Target = TactileFrame;

    fn deref(&self) -> &TactileFrame {
        self.tactile
    }
}

/// Takes CAN frames, in the order of their times, through the daemon's pipeline; stops at a failure
/// to show what comes out.
pub(crate) fn pipeline(
    config: &Config,
    frames: impl Iterator<Item = (u8, Received)>,
    emit: &mut Emit<'_>,
) -> anyhow::Result<()> {
    let mut failure = None;
    let display = Display::new(config.profile.clone(), None, &config.layout)?;
    run_recorded(
        &config.engine(false)?,
        display,
        frames,
        None,
        |frames: &Frames, image| {
            let measured = Measured {
                tactile: &frames.tactile,
                baseline: &frames.baseline,
            };
            failure = emit(Some(measured), &frames.force, image).err();
            match failure {
                None => ControlFlow::Continue(()),
                Some(_) => ControlFlow::Break(()),
            }
        },
    )?;
    failure.map_or(Ok(()), Err)
}

/// What an instant of the hand is to be shown, with the joint angles of that instant. Nothing changes where there is none.
pub(crate) fn emit_with(
    emit: &mut Emit<'_>,
    angles: Vec<f32>,
    measured: Option<Measured<'_>>,
    force: &ForceFrame,
    image: &TactileImage,
) -> anyhow::Result<()> {
    if angles.is_empty() {
        return emit(measured, force, image);
    }
    let tactile = measured.map(|measured| TactileFrame {
        joint_age_ns: vec![0; angles.len()],
        joints: angles.clone(),
        ..measured.tactile.clone()
    });
    let measured = measured
        .zip(tactile.as_ref())
        .map(|(measured, tactile)| Measured { tactile, ..measured });
    let image = TactileImage {
        joints: angles,
        ..image.clone()
    };
    emit(measured, force, &image)
}
