//! A tactile frame as colours, and raw beside compressed at chosen instants.

use super::take::{Instant, Take};
use taxel_hand::{Freshness, Method, Profile, TactileImage};
use taxel_plot::{Picture, Sheet};

/// The publication's Figure 3: x, y, z of each taxel as red, green and blue, at the tightest frame. None for magnitudes.
pub(super) fn frame(take: &Take) -> Option<Sheet> {
    let index = take.tightest().filter(|index| *index < take.tactile.len())?;
    let frame = &take.tactile[index];
    // What has no value has no colour: 0 is one.
    let counts = |taxel: usize| {
        (frame.freshness[taxel] == Freshness::Fresh).then(|| frame.counts[taxel].map(f64::from))
    };
    let whole = picture(take, counts, |count| (count as u16 >> 8) as u8).caption("0 to 65535 counts");
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
pub(super) fn amount(force: f64, unit: Option<&str>) -> String {
    let digits = match force {
        0.0 => "0".into(),
        force if !(0.01..1e6).contains(&force) => format!("{force:.2e}"),
        force if force >= 100.0 => format!("{force:.0}"),
        force => format!("{force:.2}").trim_end_matches(".00").into(),
    };
    unit.map_or(digits.clone(), |unit| format!("{digits} {unit}"))
}

/// The forces of the taxels in contact, in grey, and in their own unit beside the figure: the tactile frame of the
/// publication. A taxel that is out of use has no number and no grey.
pub(super) fn felt(take: &Take, index: usize, title: String) -> Picture {
    let frame = &take.force[index];
    let strongest = (0..take.layout.len())
        .filter(|n| frame.contact[*n])
        .map(|n| frame.force[n])
        .fold(0.0, f64::max);
    let forces = pixels(take, |taxel| match frame.contact[taxel] {
        true => Some(frame.force[taxel]),
        false => frame.faults[taxel].is_empty().then_some(0.0),
    });
    let forces: Vec<Option<f64>> = forces.into_iter().map(Option::flatten).collect();
    let grey = |force: f64| (255.0 * force / strongest.max(f64::MIN_POSITIVE)).round() as u8;
    let grey = forces.iter().map(|force| force.map(|force| [grey(force); 3]));
    let caption = format!(
        "taxels in contact {}, strongest {}",
        frame.contacts(),
        amount(strongest, take.unit)
    );
    Picture::rgb(title, take.layout.width.into(), grey)
        .caption(caption)
        .numbers("", forces.iter().copied())
}

/// How far every taxel is from its baseline, stretched to the largest change: grey is none.
fn change(take: &Take, index: usize) -> Picture {
    let frame = &take.tactile[index];
    let moved = |taxel: usize| -> Option<[f64; 3]> {
        let (counts, rest) = (frame.counts[taxel].map(f64::from), take.rest[taxel]);
        let is_usable = take.force[index].faults[taxel].is_empty() && !rest[0].is_nan();
        is_usable.then(|| std::array::from_fn(|axis| counts[axis] - f64::from(rest[axis])))
    };
    let all = (0..take.layout.len()).filter_map(moved).flatten();
    let largest = all.map(f64::abs).fold(1.0, f64::max);
    let colour = |change: f64| (128.0 + 127.0 * change / largest).round().clamp(0.0, 255.0) as u8;
    picture(take, moved, colour).caption(format!("grey: none; full colour: {largest:.0} counts"))
}

/// Three numbers of each taxel that has them as red, green and blue, and the numbers beside the figure.
fn picture(take: &Take, xyz: impl Fn(usize) -> Option<[f64; 3]>, colour: impl Fn(f64) -> u8) -> Picture {
    let all: Vec<_> = pixels(take, xyz).into_iter().map(Option::flatten).collect();
    let colours = all.iter().map(|xyz| xyz.map(|xyz| xyz.map(&colour)));
    let picture = Picture::rgb("", take.layout.width.into(), colours);
    ["x", "y", "z"]
        .iter()
        .enumerate()
        .fold(picture, |picture, (axis, name)| {
            picture.numbers(*name, all.iter().map(|xyz| xyz.map(|xyz| xyz[axis])))
        })
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
