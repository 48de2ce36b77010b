//! A tactile frame as colours, and raw beside compressed at chosen instants.

use super::take::{Instant, Take};
use taxel_hand::{Method, Profile, TactileImage};
use taxel_plot::{Picture, Sheet};

/// The publication's Figure 3: x, y, z of each taxel as red, green and blue, at the tightest frame. None for magnitudes.
pub(super) fn frame(take: &Take) -> Option<Sheet> {
    let index = take.tightest().filter(|index| *index < take.tactile.len())?;
    let whole = |_: usize, xyz: [u16; 3]| Some(xyz.map(|count| (count >> 8) as u8));
    let whole = picture(take, index, whole).caption("0 to 65535 counts");
    Some(
        Sheet::new(format!(
            "{}: x y z as red green blue, {:.2} s",
            take.name,
            take.time_s(index)
        ))
        .columns(2)
        .panel_size(300, 330)
        .picture(whole.title("counts"))
        .picture(change(take, index).title("change from rest")),
    )
}

/// A row of pictures for what is read, for what is felt, and for each method; a column for each instant.
///
/// `by_paper` is the same recording under the publication's conditioning; none where that is left out.
pub(super) fn sheet(take: &Take, by_paper: Option<&Take>, instants: &[Instant]) -> anyhow::Result<Sheet> {
    let mut sheet = Sheet::new(format!("{}: raw beside compressed", take.name))
        .columns(instants.len())
        .panel_size(250, 280);
    let title = |what: &str, instant: &Instant| {
        format!("{what}: {} ({:.2} s)", instant.name, take.time_s(instant.index))
    };
    for instant in instants {
        if !take.tactile.is_empty() {
            sheet = sheet.picture(change(take, instant.index).title(title("raw", instant)));
        }
    }
    for instant in instants {
        sheet = sheet.picture(felt(take, instant.index, title("felt", instant)));
    }
    // The publication's method on the publication's conditioning, and on that of this recording.
    let by_paper = by_paper.map(|take| (take, Method::Paper));
    for (take, method) in by_paper.into_iter().chain([(take, Method::Optimal)]) {
        let profile = Profile {
            method,
            ..take.profile.clone()
        };
        let images = take.images(&profile)?;
        let name = format!("{method:?}").to_lowercase();
        for instant in instants {
            let image = images.get(instant.index).unwrap_or(&images[images.len() - 1]);
            sheet = sheet.picture(compressed(take, image, title(&name, instant)));
        }
    }
    Ok(sheet)
}

/// A tactile image as the display is given it.
pub(super) fn compressed(take: &Take, image: &TactileImage, title: String) -> Picture {
    let strongest = image.actuators.iter().map(|a| a.force).fold(0.0, f64::max);
    Picture::grey(title, image.width.into(), image.pixels.iter().copied()).caption(format!(
        "actuators {}, levels {}, strongest {}",
        image.actuators.len(),
        image.levels.len(),
        amount(strongest, take.unit)
    ))
}

/// A force in a few digits, with its unit.
fn amount(force: f64, unit: Option<&str>) -> String {
    let digits = match force {
        0.0 => "0".into(),
        force if !(0.01..1e6).contains(&force) => format!("{force:.2e}"),
        force if force >= 100.0 => format!("{force:.0}"),
        force => format!("{force:.2}").trim_end_matches(".00").into(),
    };
    unit.map_or(digits.clone(), |unit| format!("{digits} {unit}"))
}

/// The forces of the taxels in contact, in grey: the tactile frame of the publication.
pub(super) fn felt(take: &Take, index: usize, title: String) -> Picture {
    let frame = &take.force[index];
    let strongest = (0..take.layout.len())
        .filter(|n| frame.contact[*n])
        .map(|n| frame.force[n])
        .fold(0.0, f64::max);
    let grey = pixels(take, |taxel| {
        let force = if frame.contact[taxel] {
            frame.force[taxel]
        } else {
            0.0
        };
        (255.0 * force / strongest.max(f64::MIN_POSITIVE)).round() as u8
    });
    let grey = grey.into_iter().map(|pixel| pixel.unwrap_or(0));
    let caption = format!(
        "taxels in contact {}, strongest {}",
        frame.contacts(),
        amount(strongest, take.unit)
    );
    Picture::grey(title, take.layout.width.into(), grey).caption(caption)
}

/// How far every taxel is from its counts at rest, stretched to the largest change: grey is none.
fn change(take: &Take, index: usize) -> Picture {
    let rest = take.at_rest();
    let frame = &take.tactile[index];
    let usable = |taxel: usize| take.force[index].faults[taxel].is_empty();
    let moved = |taxel: usize, xyz: [u16; 3]| -> [f64; 3] {
        std::array::from_fn(|axis| f64::from(xyz[axis]) - rest[taxel][axis])
    };
    let all = (0..take.layout.len()).filter(|taxel| usable(*taxel));
    let largest = all
        .flat_map(|taxel| moved(taxel, frame.counts[taxel]))
        .map(f64::abs)
        .fold(1.0, f64::max);
    let shown = |taxel: usize, xyz: [u16; 3]| {
        let colour = moved(taxel, xyz)
            .map(|change| (128.0 + 127.0 * change / largest).round().clamp(0.0, 255.0) as u8);
        usable(taxel).then_some(colour)
    };
    picture(take, index, shown).caption(format!("grey: none; full colour: {largest:.0} counts"))
}

/// A frame's counts as colours.
fn picture(take: &Take, index: usize, colour: impl Fn(usize, [u16; 3]) -> Option<[u8; 3]>) -> Picture {
    let counts = &take.tactile[index].counts;
    let colours = pixels(take, |taxel| colour(taxel, counts[taxel]));
    Picture::rgb(
        "",
        take.layout.width.into(),
        colours.into_iter().map(Option::flatten),
    )
}

/// Every pixel of the image, none where there is no taxel.
fn pixels<T>(take: &Take, of_taxel: impl Fn(usize) -> T) -> Vec<Option<T>> {
    let (width, height) = (take.layout.width, take.layout.height);
    let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    places
        .map(|(x, y)| take.layout.taxel_at(x, y).map(&of_taxel))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forces_are_told_in_few_digits_with_their_unit() {
        for (force, unit, wanted) in [
            (5_877.4, Some("counts"), "5877 counts"),
            (185_125_785.0, Some("counts²"), "1.85e8 counts²"),
            (0.5, None, "0.50"),
            (42.0, None, "42"),
            (1e-38, None, "1.00e-38"),
            (0.0, Some("counts"), "0 counts"),
        ] {
            assert_eq!(amount(force, unit), wanted);
        }
    }
}
