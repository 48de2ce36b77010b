//! `taxel eval --task`: what can still be told from one image.

use super::Args;
use anyhow::{Context, bail};
use serde::Serialize;
use std::fmt::Write as _;
use std::io::{self, Write};
use taxel_eval::{BLUR_PX, Method, Shown, Task, TaskPoint, TaskRow, grid_places};
use taxel_hand::{ActuatorForce, Coordinates, Profile};
use taxel_playback::output_file::OutputFile;
use taxel_playback::progress::Progress;
use taxel_plot::{Axis, Chart, Sheet};
use taxel_record::Labelled;
use taxel_skin::Layout;

/// What is judged where no method is named; places in a regular grid besides.
const METHODS: [&str; 5] = [
    "paper",
    "optimal",
    "optimal actuator_force=max",
    "optimal force_weighted=true",
    "optimal force_weighted=true actuator_force=max",
];
/// Levels and actuators of the curves; each is varied while the other is as it is.
const SIZES: [u16; 5] = [2, 4, 8, 16, 32];

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct Report {
    input: String,
    frames: usize,
    classes: usize,
    taxels: usize,
    contacts_median: f64,
    threshold: f64,
    levels: u16,
    actuators: u16,
    blur_px: f64,
    rows: Vec<TaskRow>,
    curves: Vec<TaskPoint>,
}

pub(super) fn run(args: &Args, csv: Option<OutputFile>, figure: Option<OutputFile>) -> anyhow::Result<()> {
    let what = format!("{}, frames with labels", args.offline.input.path.display());
    args.offline.input.refuse_file_options_but("--array", &what)?;
    let labelled = Labelled::open(&args.offline.input.path, args.offline.input.array())?;
    let config = match (args.offline.input.named_layout()?, labelled.image_shape) {
        (None, Some((height, width))) => {
            let size =
                |n: usize| u16::try_from(n).with_context(|| format!("{}: {height} x {width}", labelled.name));
            args.offline
                .configure_hand(Layout::grid(size(width)?, size(height)?)?)?
        }
        (Some(layout), _) => args.offline.configure_hand(layout)?,
        (None, None) => bail!("{}: say with --layout where the taxels are", labelled.name),
    };
    let threshold = args.offline.threshold.unwrap_or(0.0);
    let task = Task::new(
        config.layout.clone(),
        &labelled.frames,
        &labelled.labels,
        threshold,
    )
    .with_context(|| labelled.name.clone())?;
    let base = &config.profile;
    let (levels, actuators) = (base.level_count(), base.actuators);
    let shown = args.shown(base, &config.layout)?;
    let progress = Progress::new(
        (1 + 2 * SIZES.len() as u64) * shown.len() as u64,
        "ways to show it",
    );
    let mut rows = Vec::new();
    for (name, shown) in &shown {
        rows.push(task.judge(name, shown).with_context(|| name.clone())?);
        progress.advance(1);
    }
    let sizes = SIZES.map(|size| (levels, size)).into_iter();
    let mut curves = Vec::new();
    for (levels, actuators) in sizes.chain(SIZES.map(|size| (size, actuators))) {
        let base = Profile {
            levels,
            actuators,
            jnd: None,
            ..base.clone()
        };
        for (name, shown) in &args.shown(&base, &config.layout)?[2..] {
            curves.push(
                task.point(name, shown, levels, actuators)
                    .with_context(|| name.clone())?,
            );
            progress.advance(1);
        }
    }
    drop(progress);
    let report = Report {
        input: labelled.name,
        frames: task.len(),
        classes: task.classes(),
        taxels: config.layout.len(),
        contacts_median: task.contacts_median(),
        threshold,
        levels,
        actuators,
        blur_px: BLUR_PX,
        rows,
        curves,
    };
    let tables = [(csv, points(&report)), (figure, drawing(&report)?)];
    for (file, text) in tables {
        if let Some(mut file) = file {
            std::fs::write(file.path(), text).with_context(|| file.path().display().to_string())?;
            file.finish()?;
        }
    }
    let text = if args.json {
        serde_json::to_string(&report)? + "\n"
    } else {
        human(&report)
    };
    let mut out = io::stdout().lock();
    out.write_all(text.as_bytes())
        .and_then(|()| out.flush())
        .context("stdout")
}

impl Args {
    /// The controls first: every force, and the contacts' forces. Then what a display shows.
    fn shown(&self, base: &Profile, layout: &Layout) -> anyhow::Result<Vec<(String, Shown)>> {
        let (levels, cells) = (base.level_count(), base.actuators);
        let mut shown = vec![
            ("raw".into(), Shown::Raw),
            ("raw, contacts only".into(), Shown::Contacts),
            (
                "greatest of each cell of a grid".into(),
                Shown::Blocks { levels, cells },
            ),
        ];
        let mut add = |name: String, profile: Profile| {
            let method = Method {
                name: name.clone(),
                profile,
                learned: false,
            };
            shown.push((name, Shown::Method(Box::new(method))));
        };
        if !self.method.is_empty() {
            for method in self.methods(base)? {
                if method.learned {
                    bail!(
                        "`{}`: frames of a task are compressed one by one; leave codebook=learned out",
                        method.name
                    );
                }
                add(method.name, method.profile);
            }
            return Ok(shown);
        }
        for text in METHODS {
            let method = Method::parse(text, base)?;
            add(method.name, method.profile);
        }
        if cells <= 256 {
            let profile = Profile {
                fixed: grid_places(layout, cells),
                coordinates: Coordinates::Pixels,
                actuator_force: Some(ActuatorForce::Max),
                ..base.clone()
            };
            profile.check()?;
            add("fixed places in a grid, actuator_force=max".into(), profile);
        }
        Ok(shown)
    }
}

fn human(report: &Report) -> String {
    let Report {
        input,
        frames,
        classes,
        taxels,
        contacts_median,
        threshold,
        levels,
        actuators,
        rows,
        curves,
        ..
    } = report;
    let mut text = format!(
        "{input}: {frames} frames of {taxels} taxels, {classes} classes; a contact is above {threshold}, median \
         {contacts_median:.0} contacts\n\nrecognised of one frame, K_D = {levels}, K_A = {actuators}\n"
    );
    let width = rows.iter().map(|row| row.name.len()).max().unwrap_or(0);
    let mut line = |name: &str, cells: &[String]| {
        let _ = write!(text, "{name:width$}");
        cells.iter().for_each(|cell| {
            let _ = write!(text, " {cell:>8}");
        });
        text.push('\n');
    };
    let head = [
        "nearest", "logistic", "moved", "logistic", "bits", "levels", "bits", "us",
    ];
    line("", &head.map(String::from));
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let or = |value: Option<String>| value.unwrap_or_else(|| "-".into());
    for row in rows {
        line(
            &row.name,
            &[
                percent(row.nearest),
                percent(row.logistic),
                percent(row.moved_nearest),
                percent(row.moved_logistic),
                format!("{:.0}", row.bits),
                or(row.level_nearest.map(percent)),
                or(row.level_bits.map(|bits| format!("{bits:.0}"))),
                or(row.compress_us_p50.map(|us| format!("{us:.1}"))),
            ],
        );
    }
    line("", &[]);
    for (what, varied) in [
        ("K_A", &curves[..curves.len() / 2]),
        ("K_D", &curves[curves.len() / 2..]),
    ] {
        line(
            &format!("nearest, and bits, by {what}"),
            &SIZES.map(|size| size.to_string()),
        );
        let mut names: Vec<&str> = varied.iter().map(|point| &*point.name).collect();
        names.truncate(varied.len() / SIZES.len());
        for name in names {
            let points: Vec<&TaskPoint> = varied.iter().filter(|point| point.name == name).collect();
            line(
                name,
                &points
                    .iter()
                    .map(|point| percent(point.nearest))
                    .collect::<Vec<_>>(),
            );
            line(
                "",
                &points
                    .iter()
                    .map(|point| format!("{:.0}", point.bits))
                    .collect::<Vec<_>>(),
            );
        }
        line("", &[]);
    }
    text + "nearest, logistic: by the nearest of two examples a class, by logistic regression on them; moved: everything \
            moved\nby up to 3 pixels, ten examples. Examples are of the first half of each class's frames, what is \
            recognised of the\nsecond. levels: from the levels' numbers without their forces. us: median of both stages, \
            each frame the first.\n"
}

fn points(report: &Report) -> String {
    let mut text = String::from("name,levels,actuators,nearest,bits\n");
    for point in &report.curves {
        let TaskPoint {
            name,
            levels,
            actuators,
            nearest,
            bits,
        } = point;
        let _ = writeln!(
            text,
            "\"{}\",{levels},{actuators},{nearest},{bits}",
            name.replace('"', "\"\"")
        );
    }
    text
}

/// The share recognised against the number of actuators, and against the bits that these take.
fn drawing(report: &Report) -> anyhow::Result<String> {
    let share = || Axis::new("recognised, %").range(0.0, 100.0);
    let mut by_actuators = Chart::new("", Axis::new("actuators").log(), share());
    let mut by_bits = Chart::new("", Axis::new("bits a frame").log(), share());
    let points = &report.curves[..report.curves.len() / 2];
    for name in points[..points.len() / SIZES.len()]
        .iter()
        .map(|point| &*point.name)
    {
        let curve = || points.iter().filter(move |point| point.name == name);
        by_actuators = by_actuators.line(name, curve().map(|p| (f64::from(p.actuators), 100.0 * p.nearest)));
        by_bits = by_bits.line(name, curve().map(|p| (p.bits, 100.0 * p.nearest)));
    }
    let title = format!("Objects told apart from one image, {} levels", report.levels);
    Ok(Sheet::new(title).chart(by_actuators).chart(by_bits).svg()?)
}
