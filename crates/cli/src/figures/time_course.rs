//! The force that a fingertip feels and the force that a display shows, over time, under each codebook.

use super::take::Take;
use taxel_compress::learn_codebook;
use taxel_hand::{ActuatorForce, LevelSteps, Method, Profile, TactileImage};
use taxel_plot::{Axis, Chart, Sheet};

/// A row for each codebook: the force that is felt and the one that is shown, and what the display is driven with.
///
/// What is felt holds until the next frame, and what a display shows until the next image.
pub(super) fn sheet(take: &Take, module: usize) -> anyhow::Result<Sheet> {
    let name = &take.layout.modules[module].name;
    let time = |index: usize| take.time_s(index);
    let felt: Vec<(f64, f64)> = (0..take.force.len())
        .map(|index| (time(index), take.force_on(module, index)))
        .collect();
    let mut sheet = Sheet::new(format!(
        "{}: {name}, force felt and force shown (actuator_force = \"max\")",
        take.name
    ))
    .columns(2)
    .panel_size(440, 190);
    let force_axis = match take.unit {
        Some(unit) => format!("force, {unit}"),
        None => "force".into(),
    };
    for (title, profile) in codebooks(take) {
        let images = take.images(&profile)?;
        let shown: Vec<(f64, u8)> = images.iter().map(|image| shown(take, module, image)).collect();
        let force = shown.iter().enumerate();
        let force = force.map(|(index, (force, _))| (time(index), *force));
        let grey = shown.iter().enumerate();
        let grey = grey.map(|(index, (_, grey))| (time(index), f64::from(*grey)));
        let forces = Chart::new(&title, Axis::new("time, s"), Axis::new(&force_axis).from_zero());
        // Above the full drive there is room, so that it is not taken for the edge.
        let drive = Chart::new(
            format!("{title}: drive of the display"),
            Axis::new("time, s"),
            Axis::new("grey, of 255").range(0.0, 270.0),
        );
        sheet = sheet
            .chart(forces.steps("felt", felt.iter().copied()).steps(&title, force))
            .chart(drive.steps(&title, grey));
    }
    Ok(sheet)
}

/// The largest force and grey of the actuators that stand on a module; 0 where none does.
fn shown(take: &Take, module: usize, image: &TactileImage) -> (f64, u8) {
    let here = image.actuators.iter().filter(|actuator| {
        let taxel = take.layout.taxel_at(actuator.x, actuator.y);
        taxel.is_some_and(|taxel| usize::from(take.layout.taxels[taxel].module) == module)
    });
    here.fold((0.0, 0), |(force, grey), actuator| {
        let pixel =
            image.pixels[usize::from(actuator.y) * usize::from(image.width) + usize::from(actuator.x)];
        (actuator.force.max(force), pixel.max(grey))
    })
}

/// Every codebook, each with a name: those that are fitted to each frame, those that stay, and the configuration's own
/// where it stays.
fn codebooks(take: &Take) -> Vec<(String, Profile)> {
    let plain = |method| Profile {
        method,
        codebook: Vec::new(),
        jnd: None,
        codebook_learning: None,
        level_steps: LevelSteps::Fitted,
        // What is compared is codebooks, at the strongest taxel.
        actuator_force: Some(ActuatorForce::Max),
        levels: take.profile.level_count(),
        ..take.profile.clone()
    };
    let touched = take
        .force
        .iter()
        .flat_map(|frame| frame.force.iter().zip(&frame.contact));
    let touched = || {
        touched
            .clone()
            .filter(|(_, contact)| **contact)
            .map(|(force, _)| *force)
    };
    let (least, most) = touched().fold((f64::INFINITY, 0.0), |(a, b), f: f64| {
        (f64::min(a, f), f64::max(b, f))
    });
    let range = |level_steps| Profile {
        level_steps,
        force_min: Some(least),
        force_max: Some(most),
        ..plain(Method::Optimal)
    };
    let mut all = vec![
        ("each frame its own (optimal)".to_owned(), plain(Method::Optimal)),
        (
            "learned (constant)".into(),
            Profile {
                codebook: learn_codebook(&take.force, take.profile.level_count()),
                ..plain(Method::Optimal)
            },
        ),
    ];
    let paper = plain(Method::Paper);
    if paper.check().is_ok() {
        all.insert(1, ("each frame its own (paper)".into(), paper));
    }
    if least < most {
        all.push(("equal steps (constant)".into(), range(LevelSteps::Equal)));
        all.push(("Weber steps (constant)".into(), range(LevelSteps::Weber)));
    }
    let own = &take.profile;
    if !own.fits_frames() && own.codebook_learning.is_none() {
        let own = Profile {
            actuator_force: Some(ActuatorForce::Max),
            ..own.clone()
        };
        all.push(("configured (constant)".into(), own));
    }
    all
}
