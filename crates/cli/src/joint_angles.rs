//! Joint angles that are known beside the CAN traffic of a hand: those of a recording, or of a scene.

use crate::offline::{Emit, Measured};
use taxel_hand::{ForceFrame, TactileFrame, TactileImage};

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
