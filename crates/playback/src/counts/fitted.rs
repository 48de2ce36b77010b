//! Which taxel of a recording of counts each taxel of a hand is.

use anyhow::bail;
use taxel_record::Recording;
use taxel_skin::Layout;

/// For each taxel of the hand its number in the recording. With `tile`, the recording is of one module and is repeated on
/// each. Refuses what holds no counts, or does not fit the hand.
pub(crate) fn recorded_taxels(
    recording: &Recording,
    layout: &Layout,
    tile: bool,
) -> anyhow::Result<Vec<usize>> {
    let (name, taxels) = (recording.name(), recording.taxels());
    if !recording.has_counts() {
        bail!(
            "{name} holds magnitudes; boards send counts: T x N x 3, or T x 3N with --columns xyz-interleaved \
             or xyz-blocks"
        );
    }
    if tile {
        if let Some(module) = layout.modules.iter().find(|m| usize::from(m.taxels) != taxels) {
            bail!(
                "{name} has {taxels} taxels and module {} of layout {} has {}; --tile needs a recording of one \
                 module",
                module.name,
                layout.name,
                module.taxels
            );
        }
        let first = |taxel| usize::from(layout.module_of(taxel).first_taxel);
        return Ok((0..layout.len()).map(|taxel| taxel - first(taxel)).collect());
    }
    if layout.len() != taxels {
        bail!(
            "{name} has {taxels} taxels and layout {} has {}; {}",
            layout.name,
            layout.len(),
            if recording.is_of_xela() {
                "XELA's server, whose names these are, numbers the taxels of a module row by row: --layout grid:4x4, grid:4x6 \
                 or another grid:HxW"
            } else if 3 * taxels == layout.len() && !recording.column_names().is_empty() {
                "they are counts x y z by the names of its columns; without its header (`tail -n +2`) all are magnitudes"
            } else if layout.modules.iter().all(|m| usize::from(m.taxels) == taxels) {
                "repeat it on every module with --tile, or use --layout uskin-module"
            } else {
                "name the hand it was recorded on with --layout, or grid:HxW; magnitudes of T x H x 3 cells are told by \
                 --layout grid:Hx3"
            }
        );
    }
    Ok((0..taxels).collect())
}
