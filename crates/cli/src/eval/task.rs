//! `taxel eval --task`: what can still be told from one image.

use super::table::{self, NAME, wrapped};
use super::{Args, advice_on_forces};
use crate::errors::wrong_use;
use crate::recordings::offline::Held;
use anyhow::{Context, bail};
use serde::Serialize;
use std::fmt::Write as _;
use taxel_compress::Compressor;
use taxel_eval::{
    BLUR_PX, EXAMPLES, Method, MethodError, Offered, Shown, Task, TaskPoint, TaskRow, grid_places,
};
use taxel_hand::{ActuatorForce, Coordinates, FORCE_MAX, FORCE_MIN, Profile};
use taxel_playback::output_file::OutputFile;
use taxel_playback::progress::Progress;
use taxel_plot::{Axis, Chart, Sheet};
use taxel_record::Labelled;
use taxel_skin::Layout;
use taxeld::Config;
use taxeld::stdout;

/// What is judged where no method is named; places in a regular grid besides.
const METHODS: [&str; 5] = [
    "paper",
    "optimal",
    "optimal actuator_force=max",
    "optimal force_weighted=true",
    "optimal force_weighted=true actuator_force=max",
];
/// What follows the name of a method in the row of a compressor that runs on.
const RUNNING: &str = ", running";
/// Width of a figure: eight of them fit beside the name.
const CELL: usize = 8;
/// Levels and actuators of the curves; each is varied while the other is as it is.
const SIZES: [u16; 5] = [2, 4, 8, 16, 32];
/// A curve over sizes is drawn so many times farther to the right than the one before it, since many lie at 100 %.
const ASIDE: f64 = 1.03;

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct Report {
    input: String,
    frames: usize,
    classes: usize,
    taxels: usize,
    contacts_median: f64,
    threshold: f64,
    /// Examples of a class.
    examples: usize,
    /// Least and most examples of a class where things are moved.
    moved_examples: [usize; 2],
    levels: u16,
    actuators: u16,
    blur_px: f64,
    rows: Vec<TaskRow>,
    curves: Vec<TaskPoint>,
    /// How many of these, the first, are by the number of actuators; the others are by that of levels.
    #[serde(skip)]
    by_actuators: usize,
}

/// The first controls, all forces and those of the contacts, are the same at every size.
const OF_NO_SIZE: usize = 2;

/// Ways to show a frame by their names, and the usual ones that the configuration excludes.
struct Ways {
    controls: Vec<(String, Shown)>,
    displays: Vec<(String, Shown)>,
    left_out: Vec<MethodError>,
}

/// What is asked, of which frames and of which hand.
struct Asked {
    input: String,
    config: Config,
    task: Task,
    threshold: f64,
}

fn asked(args: &Args) -> anyhow::Result<Asked> {
    let what = format!("{}, frames with labels", args.offline.input.path.display());
    args.offline.input.refuse_file_options_but("--array", &what)?;
    args.offline.refuse_beside(Held::Magnitudes)?;
    if args.offline.release.is_some() {
        bail!("{what}: --release says nothing about it; leave it out");
    }
    let layout = args.offline.input.named_layout()?;
    let image = layout
        .as_ref()
        .map(|layout| [layout.height, layout.width].map(usize::from));
    let labelled = Labelled::open(&args.offline.input.path, args.offline.input.array(), image)?;
    let taxels = labelled.frames.first().map_or(0, Vec::len);
    let layout = match (layout, labelled.image_shape) {
        (None, None) => (args.offline.configured_layout()?).filter(|layout| layout.len() == taxels),
        (named, _) => named,
    };
    let config = match (layout, labelled.image_shape) {
        (None, Some((height, width))) => {
            let size =
                |n: usize| u16::try_from(n).with_context(|| format!("{}: {height} x {width}", labelled.name));
            args.offline
                .configure_hand(Layout::grid(size(width)?, size(height)?)?)?
        }
        (Some(layout), _) => args.offline.configure_hand(layout)?,
        (None, None) => bail!(
            "{}: say with --layout where the {taxels} taxels are",
            labelled.name
        ),
    };
    let threshold = args.offline.threshold.unwrap_or(0.0);
    let task = Task::new(
        config.layout.clone(),
        &labelled.frames,
        &labelled.labels,
        threshold,
    )
    .with_context(|| labelled.name.clone())?;
    remark!(
        "taxel: {}: taken for {} classes of {}",
        labelled.name,
        task.classes(),
        match labelled.trials {
            Some(trials) => format!("{trials} trials"),
            None => format!("{} frames with labels", task.len()),
        }
    );
    let is_shown = |force: &f64| *force > threshold && (FORCE_MIN..=FORCE_MAX).contains(force);
    if !labelled.frames.iter().flatten().any(is_shown) {
        bail!(
            "{}: nothing is in contact in any of {} frames, so there is nothing to judge; {}",
            labelled.name,
            task.len(),
            advice_on_forces(labelled.frames.iter().map(Vec::as_slice), threshold)
        );
    }
    Ok(Asked {
        input: labelled.name,
        config,
        task,
        threshold,
    })
}

pub(super) fn run(args: &Args, csv: Option<OutputFile>, figure: Option<OutputFile>) -> anyhow::Result<()> {
    let Asked {
        input,
        config,
        task,
        threshold,
    } = asked(args)?;
    let base = &config.profile;
    let (levels, actuators) = (base.level_count(), base.actuators);
    Compressor::new(base.clone(), &config.layout)?;
    let ways = args.ways(base, &config.layout)?;
    match ways.left_out.first() {
        Some(error) if !args.method.is_empty() => bail!("{error}"),
        _ => super::tell(&ways.left_out),
    }
    let (controls, displays) = (ways.controls.len(), ways.displays.len());
    let progress = Progress::new(
        ((1 + 2 * SIZES.len()) * (controls + displays) + displays) as u64,
        "ways to show it",
    );
    // The first of many classes takes long.
    progress.advance_to(0);
    let mut rows = Vec::new();
    for (name, shown) in ways.controls.iter().chain(&ways.displays) {
        rows.push(task.judge(name, shown).with_context(|| name.clone())?);
        progress.advance(1);
        if matches!(shown, Shown::Method(_)) {
            let running = task.judge_running(&format!("{name}{RUNNING}"), shown);
            rows.extend(running.with_context(|| name.clone())?);
            progress.advance(1);
        }
    }
    let mut curves = curve(args, &task, &config, SIZES.map(|size| (levels, size)), &progress)?;
    let by_actuators = curves.len();
    curves.extend(curve(
        args,
        &task,
        &config,
        SIZES.map(|size| (size, actuators)),
        &progress,
    )?);
    drop(progress);
    let report = Report {
        input,
        frames: task.len(),
        classes: task.classes(),
        taxels: config.layout.len(),
        contacts_median: task.contacts_median(),
        examples: EXAMPLES,
        moved_examples: task.moved_examples(),
        threshold,
        levels,
        actuators,
        blur_px: BLUR_PX,
        rows,
        curves,
        by_actuators,
    };
    write(&report, csv, figure, args.json)
}

/// What each way to show a frame is worth at each of these levels and actuators.
fn curve(
    args: &Args,
    task: &Task,
    config: &Config,
    sizes: [(u16, u16); SIZES.len()],
    progress: &Progress,
) -> anyhow::Result<Vec<TaskPoint>> {
    let mut points = Vec::new();
    for (levels, actuators) in sizes {
        let base = Profile {
            levels,
            actuators,
            jnd: None,
            ..config.profile.clone()
        };
        // A size that the configuration excludes, such as another number of fixed places, has no point.
        let Ok(ways) = args.ways(&base, &config.layout) else {
            continue;
        };
        for (name, shown) in ways.controls[OF_NO_SIZE..].iter().chain(&ways.displays) {
            let point = task.point(name, shown, levels, actuators);
            points.push(point.with_context(|| name.clone())?);
            progress.advance(1);
        }
    }
    Ok(points)
}

fn write(
    report: &Report,
    csv: Option<OutputFile>,
    figure: Option<OutputFile>,
    json: bool,
) -> anyhow::Result<()> {
    let tables = [(csv, points(report)), (figure, drawing(report)?)];
    for (file, text) in tables {
        if let Some(mut file) = file {
            file.fill(text)?;
        }
    }
    let text = if json {
        serde_json::to_string(report)? + "\n"
    } else {
        human(report)
    };
    stdout::print(&text)
}

/// Refuses methods that would learn from all frames.
pub(super) fn refuse_learned(methods: &[Method]) -> anyhow::Result<()> {
    match methods.iter().find(|method| method.learned) {
        Some(method) => Err(wrong_use(format!(
            "`{}`: frames of a task are compressed one by one; leave codebook=learned out",
            method.name
        ))),
        None => Ok(()),
    }
}

impl Args {
    /// The controls are every force, the contacts' forces and a plain grid; then what a display shows.
    fn ways(&self, base: &Profile, layout: &Layout) -> anyhow::Result<Ways> {
        let (levels, cells) = (base.level_count(), base.actuators);
        let controls = vec![
            ("raw".into(), Shown::Raw),
            ("raw, contacts only".into(), Shown::Contacts),
            (
                "greatest of each cell of a grid".into(),
                Shown::Blocks { levels, cells },
            ),
        ];
        let Offered {
            mut methods,
            mut left_out,
        } = match self.method.is_empty() {
            true => Offered::of(&METHODS, base)?,
            false => self.methods(base)?,
        };
        if self.method.is_empty() && cells <= 256 {
            let profile = Profile {
                fixed: grid_places(layout, cells),
                coordinates: Coordinates::Pixels,
                actuator_force: Some(ActuatorForce::Max),
                ..base.clone()
            };
            methods.push(Method {
                name: "fixed places in a grid, actuator_force=max".into(),
                profile,
                learned: false,
            });
        }
        let mut displays = Vec::new();
        for method in methods {
            let text = method.name.clone();
            // Budgets and places are of the hand too.
            match Compressor::new(method.profile.clone(), layout) {
                Ok(_) => displays.push((text, Shown::Method(Box::new(method)))),
                Err(source) => left_out.push(MethodError::Profile { text, source }),
            }
        }
        Ok(Ways {
            controls,
            displays,
            left_out,
        })
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
        moved_examples: [least, most],
        levels,
        actuators,
        rows,
        curves,
        by_actuators,
        ..
    } = report;
    let mut text = wrapped(&format!(
        "{input}: {frames} frames of {taxels} taxels, {classes} classes; a contact is above {threshold}, median \
         {contacts_median:.0} contacts"
    ));
    let _ = writeln!(
        text,
        "\nrecognised of one frame, K_D = {levels}, K_A = {actuators}"
    );
    // It stands below that of its method.
    let label = |row: &TaskRow| match row.name.ends_with(RUNNING) {
        true => "  running".into(),
        false => row.name.clone(),
    };
    let head = [
        "nearest", "logistic", "moved", "logistic", "bits", "levels", "bits", "us",
    ];
    text += &line("", &head.map(String::from));
    for row in rows {
        text += &line(
            &label(row),
            &[
                percent(row.nearest),
                percent(row.logistic),
                percent(row.moved_nearest),
                percent(row.moved_logistic),
                format!("{:.0}", row.bits),
                or_dash(row.level_nearest.map(percent)),
                or_dash(row.level_bits.map(|bits| format!("{bits:.0}"))),
                or_dash(row.compress_us_p50.map(|us| format!("{us:.1}"))),
            ],
        );
    }
    text.push('\n');
    let (by_actuators, by_levels) = curves.split_at(*by_actuators);
    text += &curve_table("K_A", by_actuators, |point| point.actuators);
    text += &curve_table("K_D", by_levels, |point| point.levels);
    let examples = match least == most {
        true => least.to_string(),
        false => format!("{least} to {most}"),
    };
    text + &wrapped(&format!(
        "nearest, logistic: by the nearest of two examples a class, by logistic regression on them; moved: everything \
         moved by up to 3 pixels, {examples} examples. Examples are of the first half of each class's frames, what is \
         recognised of the second; frames are blurred by {BLUR_PX} pixels and divided by their sum, so that not how \
         hard something is pressed tells what it is. levels: from the levels' numbers without their forces. us: median of both stages. \
         A compressor starts anew with each frame; running: one sees all of them in a shuffled order and an empty \
         frame between, ten orders. Without that row it shows the same. The curves are of fresh starts."
    ))
}

/// Curves by levels or actuators, two lines each.
fn curve_table(what: &str, varied: &[TaskPoint], size_of: fn(&TaskPoint) -> u16) -> String {
    let mut text = line(
        &format!("nearest, and bits, by {what}"),
        &SIZES.map(|size| size.to_string()),
    );
    for name in names(varied) {
        let of_size = |size| (varied.iter()).find(|point| point.name == name && size_of(point) == size);
        let points = SIZES.map(of_size);
        text += &line(
            name,
            &points.map(|point| or_dash(point.map(|p| percent(p.nearest)))),
        );
        text += &line(
            "",
            &points.map(|point| or_dash(point.map(|p| format!("{:.0}", p.bits)))),
        );
    }
    text + "\n"
}

fn line(name: &str, cells: &[String]) -> String {
    table::line(name, NAME, cells, CELL)
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

fn or_dash(value: Option<String>) -> String {
    value.unwrap_or_else(|| "-".into())
}

/// The names of curves in the order in which they begin.
fn names(points: &[TaskPoint]) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for point in points {
        if !names.contains(&&*point.name) {
            names.push(&point.name);
        }
    }
    names
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

/// The share recognised against the numbers of actuators and of levels, and against the bits that the actuators take.
fn drawing(report: &Report) -> anyhow::Result<String> {
    let (by_actuators, by_levels) = report.curves.split_at(report.by_actuators);
    let chart = |x: Axis, points: &[TaskPoint], aside: f64, size_of: fn(&TaskPoint) -> f64| {
        let names = names(points);
        let middle = (names.len() as f64 - 1.0) / 2.0;
        let chart = Chart::new("", x, Axis::new("recognised, %").range(0.0, 100.0));
        names.iter().enumerate().fold(chart, |chart, (n, name)| {
            let aside = aside.powf(n as f64 - middle);
            let curve = points.iter().filter(|point| point.name == *name);
            let curve: Vec<_> = curve.map(|p| (size_of(p) * aside, 100.0 * p.nearest)).collect();
            chart.line(*name, curve.iter().copied()).points(*name, curve)
        })
    };
    let sizes = |what: String| Axis::new(what).log().ticks(SIZES.map(f64::from));
    let Report {
        levels, actuators, ..
    } = report;
    let of_actuators = sizes(format!("actuators ({levels} levels)"));
    let of_levels = sizes(format!("levels ({actuators} actuators)"));
    let bits = Axis::new(format!("bits a frame ({levels} levels)")).log();
    let sheet = Sheet::new("Objects told apart from one image")
        .chart(chart(of_actuators, by_actuators, ASIDE, |p| p.actuators.into()))
        .chart(chart(of_levels, by_levels, ASIDE, |p| p.levels.into()))
        .chart(chart(bits, by_actuators, 1.0, |p| p.bits));
    Ok(sheet.svg()?)
}
