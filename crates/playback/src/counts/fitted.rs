//! Which taxel of a recording of counts each taxel of a hand is.

use anyhow::bail;
use taxel_record::Recording;
use taxel_skin::Layout;

/// Counts T x N x 3 of modules of 4x4 taxels, from row by row to the order of their chips.
pub(crate) const IN_ORDER_OF_CHIPS: &str = "a.reshape(len(a), -1, 4, 3)[:, :, [0, 2, 1, 3]].reshape(a.shape)";

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
        tell_rows(recording, layout);
        let first = |taxel| usize::from(layout.module_of(taxel).first_taxel);
        return Ok((0..layout.len()).map(|taxel| taxel - first(taxel)).collect());
    }
    if layout.len() != taxels {
        let columns = match recording.column_names() {
            [first, .., last] => format!(" ({first:?} to {last:?})"),
            _ => String::new(),
        };
        bail!(
            "{name} has {taxels} taxels{columns} and layout {} has {}; {}",
            layout.name,
            layout.len(),
            if recording.is_of_xela() {
                format!(
                    "XELA's server, whose names these are, numbers the taxels of a module row by row: {}",
                    layout_of_modules(taxels)
                )
            } else if 3 * taxels == layout.len() && !recording.column_names().is_empty() {
                "they are counts x y z by the names of its columns; without its header (`tail -n +2`) all are magnitudes".into()
            } else if layout.modules.iter().all(|m| usize::from(m.taxels) == taxels) {
                "repeat it on every module with --tile, or use --layout uskin-module".into()
            } else {
                "name the hand it was recorded on with --layout, or grid:HxW; magnitudes of T x H x 3 cells are told by \
                 --layout grid:Hx3"
                    .into()
            }
        );
    }
    tell_rows(recording, layout);
    Ok((0..taxels).collect())
}

/// Says that taxels which XELA's server has numbered row by row are read as the chips of modules that are drawn otherwise.
pub fn tell_rows(recording: &Recording, layout: &Layout) {
    let taxels = layout
        .modules
        .iter()
        .map(|module| &layout.taxels[module.taxel_range()]);
    let mut next = taxels.filter_map(|taxels| Some((taxels.first()?, taxels.get(1)?)));
    let is_drawn_otherwise = next.any(|(a, b)| a.x.abs_diff(b.x) + a.y.abs_diff(b.y) > 1);
    if recording.is_of_xela() && is_drawn_otherwise {
        let order = match layout.modules.iter().all(|module| module.taxels == 16) {
            true => format!(", whose order is {IN_ORDER_OF_CHIPS}"),
            false => String::new(),
        };
        remark!(
            "taxel: {}: XELA's server, whose names these are, numbers taxels row by row, {}; {} takes them for the chips of a \
             board{order}",
            recording.name(),
            layout_of_modules(recording.taxels()),
            layout.name
        );
    }
}

/// The layout of so many taxels, numbered row by row of modules that nobody knows: the grid of one of 4x4 or 4x6, or those
/// of several which stand below one another, if they are all alike.
fn layout_of_modules(taxels: usize) -> String {
    let widths = [4, 6].into_iter();
    let grids: Vec<String> = widths
        .filter(|width| taxels.is_multiple_of(4 * width))
        .map(|width| match taxels / width {
            4 => format!("grid:4x{width}"),
            rows => format!("grid:{rows}x{width} (modules of 4x{width} below one another)"),
        })
        .collect();
    let file = "a layout file says which modules they are (docs/guide.md, \"Write a layout\")";
    match grids[..] {
        [] => format!("{file}, or --layout grid:HxW"),
        _ if [16, 24].contains(&taxels) => format!("--layout {}", grids[0]),
        _ => format!(
            "--layout {} where all modules are of that kind; where not, as on the Allegro hand of 368 taxels, {file}",
            grids.join(" or ")
        ),
    }
}
