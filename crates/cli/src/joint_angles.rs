//! Joint angles that are known beside the CAN traffic of a hand: those of a recording, or of a scene.

use crate::offline::Emit;
use taxel_hand::{ForceFrame, TactileFrame, TactileImage};

/// What an instant of the hand is to be shown, with the joint angles of that instant. Nothing changes where there is none.
pub(crate) fn emit_with(
    emit: &mut Emit<'_>,
    angles: Vec<f32>,
    tactile: Option<&TactileFrame>,
    force: &ForceFrame,
    image: &TactileImage,
) -> anyhow::Result<()> {
    if angles.is_empty() {
        return emit(tactile, force, image);
    }
    let tactile = tactile.map(|tactile| TactileFrame {
        joint_age_ns: vec![0; angles.len()],
        joints: angles.clone(),
        ..tactile.clone()
    });
    let image = TactileImage {
        joints: angles,
        ..image.clone()
    };
    emit(tactile.as_ref(), force, &image)
}
