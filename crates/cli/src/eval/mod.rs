//! `taxel eval`: how good and how fast every method is, on the same frames.

mod cell;
mod every_figure;
mod export;
mod scaling;
mod scene;
mod spreadsheet;
mod table;
mod task;

use crate::allocations::COUNTER;
use crate::errors::wrong_use;
use crate::piped_file;
use crate::recordings::offline::{Held, OfflineArgs, ends_within_calibration};
use crate::recordings::out_of_use::OutOfUse;
use crate::sim::recorded_scene_parser;
use anyhow::{Context, bail};
use serde::Serialize;
use std::path::{Path, PathBuf};
use taxel_eval::{
    ContactTruth, EvalReport, Method, MethodError, MethodReport, Offered, References, ScalingReport,
    Sequence, Timings, judge, main_methods, quantile, standard_methods, time,
};
use taxel_hand::{FORCE_MAX, FORCE_MIN};
use taxel_playback::interrupt::Ending;
use taxel_playback::output_file::{OutputFile, refuse_overlap};
use taxel_playback::pipeline::Emit;
use taxel_playback::progress::Progress;
use taxel_skin::{ConditionConfig, Preset};
use taxeld::Config;
use taxeld::stdout;

/// Measure speed against error: every method, on the same frames.
///
/// Errors are against the least that is possible: for force levels the exact optimum of each frame, for actuators
/// the best of 64 runs of k-means++. Ratios of 1 are optimal. A jump is an actuator (same id) that moves more than
/// 2 pixels between consecutive images, or on a skin of more than 256 taxels more than an eighth of the side of a
/// square of them. With coordinates = "hand" in the profile, places and jumps are of the hand laid flat,
/// millimetres, and two distances of neighbouring taxels take the place of 2 pixels. What a display shows is judged
/// by both stages together: the force of each taxel in contact against that with which its actuator presses. A tick
/// is conditioning and compression where the recording holds counts, compression alone where it holds magnitudes;
/// times are medians over --passes, per frame.
///
/// INPUT is any recording that `taxel compress` takes, or sim:SCENE, where contacts are compared
/// with the truth too.
///
/// With --task, INPUT is an .npz with the array `frames` and either `labels`, one whole number a frame, or
/// class and trial (and moment, of which the first is taken) as the first axes of `frames`. What is measured
/// then is how many of the things touched can be told from one image, by the nearest example and by logistic
/// regression, as shown by every method, and from the raw forces. Each frame has a compressor of its own that
/// has seen none before. A row "running" is of one that runs on as a daemon does: it sees all frames, in ten
/// shuffled orders with an empty frame between any two. Methods that show the same then have no such row.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  taxel eval module.npz --array debug_0B0Z_raw --columns xyz-interleaved --tile
  taxel eval grasps.npz --array WOOD_1 --layout schunk-sdh --threshold 150 --json
  taxel eval sim:ball-grasp --method paper --method 'optimal history=0.2'
  taxel eval grasp.log --sweep-k --csv sweep.csv
  taxel eval objects.npz --task")]
pub(crate) struct Args {
    #[command(flatten)]
    offline: OfflineArgs,
    /// A method to judge: paper or optimal, then settings of the profile as key=value; may be
    /// repeated [default: paper, optimal and the switches between them, but for those that the
    /// configuration excludes]; codebook=learned is the best constant codebook for the frames
    #[arg(long, value_name = "METHOD [KEY=VALUE]..")]
    method: Vec<String>,
    /// Judge every switch, and print every figure, in tables of up to 231 columns; --json has every switch and figure anyway
    #[arg(long, conflicts_with = "method")]
    all: bool,
    /// A scene to judge on besides INPUT: built-in or a file; may be repeated
    #[arg(long, value_name = "SCENE", value_parser = recorded_scene_parser(), hide_possible_values = true)]
    scene: Vec<String>,
    /// Also judge the first two methods with 2, 4, 8, 16 and 32 levels and actuators
    #[arg(long)]
    sweep_k: bool,
    /// Also time both stages on made-up skins of 16 to 65,280 taxels, all in contact
    #[arg(long)]
    scaling: bool,
    /// Measure what can be told from one image: INPUT is an .npz of labelled frames
    #[arg(long, conflicts_with_all = OF_COMPRESSION)]
    task: bool,
    /// With --task: draw the share recognised against actuators, levels and bits, as SVG
    #[arg(long, value_name = "FILE", requires = "task", conflicts_with_all = OF_COMPRESSION)]
    figure: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// Runs of k-means++ per frame that positions are compared with
    #[arg(long, value_name = "N", default_value_t = taxel_eval::RESTARTS, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    restarts: u32,
    /// Passes over the frames that times are medians of [default: enough for about 20,000 ticks, 5 to 101]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    passes: Option<u32>,
    /// Write every number as a table, one line per input, size and method; with --task the curves
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write the conditioned frames of INPUT as .npz: force and contact (T x N), x, y (N), t_ns
    /// (T), and the least errors, level_error and place_error (T)
    #[arg(long, value_name = "FILE.npz", value_parser = npz)]
    export: Option<PathBuf>,
    /// Write every time of INPUT as .npz: condition_us and compress_us (methods x frames with
    /// contact x passes)
    #[arg(long, value_name = "FILE.npz", value_parser = npz)]
    times: Option<PathBuf>,
}

/// What says nothing of a task. An option of the task excludes it, too: clap does not miss `--task` beside what excludes it.
const OF_COMPRESSION: [&str; 7] = [
    "scene", "sweep_k", "scaling", "restarts", "passes", "export", "times",
];

/// A file that is written as .npz whatever its name says.
fn npz(text: &str) -> Result<PathBuf, String> {
    match Path::new(text).extension() {
        Some(extension) if extension == "npz" => Ok(text.into()),
        _ => Err("only .npz is written; name it so".into()),
    }
}

/// Levels and actuators of `--sweep-k`.
const SIZES: [u16; 5] = [2, 4, 8, 16, 32];

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct Output {
    #[serde(flatten)]
    input: EvalReport,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    scenes: Vec<EvalReport>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    sweep: Vec<EvalReport>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    scaling: Vec<ScalingReport>,
}

impl Output {
    /// All but the times by size.
    fn reports(&self) -> impl Iterator<Item = &EvalReport> {
        std::iter::once(&self.input)
            .chain(&self.scenes)
            .chain(&self.sweep)
    }

    /// What is printed.
    fn text(&self, args: &Args) -> anyhow::Result<String> {
        if args.json {
            return Ok(serde_json::to_string(self)? + "\n");
        }
        let table = match args.all {
            true => every_figure::every_figure,
            false => table::main_figures,
        };
        let tables: String = self.reports().map(table).collect();
        Ok(tables + &table::scaling(&self.scaling))
    }
}

/// Frames, what they are called, and how their contacts compare with the truth if that is known.
struct Frames {
    name: String,
    sequence: Sequence,
    truth: Option<ContactTruth>,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    // A method that is none is told before the recording is read, which may take long.
    args.methods(&args.offline.profile()?)?;
    let outputs = [&args.csv, &args.export, &args.times, &args.figure];
    let outputs: Vec<&Path> = outputs.into_iter().flatten().map(PathBuf::as_path).collect();
    refuse_overlap(&outputs, &args.offline.inputs())?;
    let ending = Ending::catch()?;
    // Before the work, which is long, shows that they cannot be written.
    let begin = |path: &Option<PathBuf>| path.as_deref().map(OutputFile::begin).transpose();
    let (mut csv, mut export, mut times) = (begin(&args.csv)?, begin(&args.export)?, begin(&args.times)?);
    let figure = if args.task { begin(&args.figure)? } else { None };
    let parts = [&csv, &export, &times, &figure].into_iter().flatten();
    ending.remove(parts.filter_map(OutputFile::part).collect(), piped_file::remove)?;
    if args.task {
        return task::run(args, csv, figure);
    }
    let path = args.offline.input.path.display().to_string();
    let (frames, config) = match path.strip_prefix("sim:") {
        Some(scene) => {
            args.offline.input.refuse_file_options(&path)?;
            args.offline.refuse_beside(Held::Counts)?;
            scene::frames(scene, args)?
        }
        None => recorded(args)?,
    };
    OutOfUse::of(&frames.sequence.force).tell("frame");
    if frames.sequence.is_empty() {
        bail!("{path}: no frame: it ends before its first tick or sweep is complete");
    }
    let base = config.profile;
    let Offered { methods, left_out } = args.methods(&base)?;
    tell(&left_out);
    let (methods, same) = told_apart(methods);
    for (name, other) in same {
        remark!("taxel: `{name}` is judged as `{other}`, which this configuration makes it the same as");
    }
    // It is refused at once, or not at all.
    let scaling = match args.scaling {
        true => scaling::scaling(&methods)?,
        false => Vec::new(),
    };
    let (input, references, timings) = args.report(&frames, &methods)?;
    if let Some(file) = &mut export {
        export::write(file.path(), &frames.sequence, &references)
            .with_context(|| file.path().display().to_string())?;
        file.finish()?;
    }
    if let Some(file) = &mut times {
        export::write_times(file.path(), &timings).with_context(|| file.path().display().to_string())?;
        file.finish()?;
    }
    let output = Output {
        input,
        scenes: args.scenes()?,
        sweep: if args.sweep_k {
            args.sweep(&frames, &methods)?
        } else {
            Vec::new()
        },
        scaling,
    };
    if let Some(file) = &mut csv {
        file.fill(spreadsheet::csv(output.reports())?)?;
    }
    let text = output.text(args)?;
    stdout::print(&text)
}

/// Says which of the usual methods the configuration excludes.
fn tell(left_out: &[MethodError]) {
    for excluded in left_out {
        remark!("taxel: left out, since the configuration excludes it: {excluded}");
    }
}

/// Each way to compress once, and the names of the others with that of the method that each is.
fn told_apart(methods: Vec<Method>) -> (Vec<Method>, Vec<(String, String)>) {
    let way = |method: &Method| (method.learned, method.profile.canonical());
    let (mut apart, mut same) = (Vec::<Method>::new(), Vec::new());
    for method in methods {
        match apart.iter().find(|other| way(other) == way(&method)) {
            Some(other) => same.push((method.name, other.name.clone())),
            None => apart.push(method),
        }
    }
    (apart, same)
}

/// The methods with the codebooks that they learn from the frames.
fn learned(methods: &[Method], sequence: &Sequence) -> Vec<Method> {
    let mut methods = methods.to_vec();
    for method in &mut methods {
        method.learn_from(&sequence.force);
    }
    methods
}

/// The frames of a recording as the daemon conditions them.
fn recorded(args: &Args) -> anyhow::Result<(Frames, Config)> {
    let offline = &args.offline;
    let input = offline.open_whole()?;
    let mut config = offline.configure(&input)?;
    args.condition(&mut config);
    let mut sequence = gathered(&config, |emit| offline.run(&input, &config, emit))?;
    if sequence.tactile.is_empty() {
        sequence.conditioning = None;
    }
    let name = offline.input.name();
    Ok((
        Frames {
            name,
            sequence,
            truth: None,
        },
        config,
    ))
}

/// The frames of a configured hand that something plays.
fn gathered(
    config: &Config,
    play: impl FnOnce(&mut Emit<'_>) -> anyhow::Result<()>,
) -> anyhow::Result<Sequence> {
    let (mut force, mut tactile) = (Vec::new(), Vec::new());
    play(&mut |felt| {
        tactile.extend(felt.measured.map(|measured| measured.tactile.clone()));
        force.push(felt.force.clone());
        Ok(())
    })?;
    Ok(Sequence {
        layout: config.layout.clone(),
        force,
        tactile,
        conditioning: Some(config.conditioning.clone()),
    })
}

/// The preset that settings are, by its name.
fn preset_name(settings: &ConditionConfig) -> String {
    let preset = [("robust", Preset::Robust), ("paper", Preset::Paper)];
    let found = preset.iter().find(|(_, preset)| preset.config() == *settings);
    found.map_or("as configured", |(name, _)| name).into()
}

/// What to do where nothing is in contact.
fn advice(sequence: &Sequence) -> String {
    if let Some(conditioning) = &sequence.conditioning {
        if sequence.force.iter().all(|frame| frame.calibrating) {
            return ends_within_calibration(conditioning);
        }
        return "the recording has to begin with the hand at rest, for its baseline, and be touched later"
            .into();
    }
    let threshold = sequence.force.first().map_or(0.0, |frame| frame.threshold);
    advice_on_forces(sequence.force.iter().map(|frame| &frame.force[..]), threshold)
}

/// What to do where none of these forces, frame by frame, is one above the threshold that an image can carry.
fn advice_on_forces<'a>(frames: impl Iterator<Item = &'a [f64]> + Clone, threshold: f64) -> String {
    let forces =
        || (frames.clone().enumerate()).flat_map(|(n, forces)| forces.iter().map(move |force| (n, *force)));
    let usable = FORCE_MIN..=FORCE_MAX;
    let unusable = forces().find(|(_, force)| *force > threshold && !usable.contains(force));
    if let Some((frame, force)) = unusable {
        return format!(
            "forces that an image can carry are numbers from {FORCE_MIN:e} to {FORCE_MAX:e}, and frame {frame} has \
             {force:e}; give them in another unit"
        );
    }
    let greatest = forces().map(|(_, force)| force).fold(0.0, f64::max);
    if threshold == 0.0 {
        return "no force is above 0".into();
    }
    format!("the greatest force is {greatest}, and --threshold {threshold} is not below it; give a lower one")
}

/// Refuses methods that cannot be judged side by side.
fn refuse_unlike(methods: &[Method]) -> anyhow::Result<()> {
    let size = |method: &Method| (method.profile.level_count(), method.profile.actuators);
    let Some(first) = methods.first() else {
        return Ok(());
    };
    if let Some(other) = methods.iter().find(|method| size(method) != size(first)) {
        return Err(wrong_use(format!(
            "`{}`: every method has the same levels and actuators here; give them with --levels and --actuators",
            other.name
        )));
    }
    let coordinates = first.profile.coordinates;
    if let Some(other) = methods.iter().find(|m| m.profile.coordinates != coordinates) {
        return Err(wrong_use(format!(
            "`{}`: every method places actuators in the same coordinates here, and `{}` has others; judge them one by one",
            other.name, first.name
        )));
    }
    Ok(())
}

impl Args {
    /// Conditions frames as `paper` does, unless told otherwise, where that is the only method named. Methods that are
    /// compared have the same frames.
    fn condition(&self, config: &mut Config) {
        let is_paper = |text: &String| text.split_whitespace().next() == Some("paper");
        if !self.method.is_empty() && self.method.iter().all(is_paper) {
            config.set_method(taxel_hand::Method::Paper, None);
        }
    }

    /// Those named, or those of the usual ones that the configuration does not exclude.
    fn methods(&self, base: &taxel_hand::Profile) -> anyhow::Result<Offered> {
        base.check()?;
        if self.method.is_empty() {
            let every = self.all || self.json;
            return Ok(if every {
                standard_methods(base)?
            } else {
                main_methods(base)?
            });
        }
        let parsed = self.method.iter().map(|text| Method::parse(text, base));
        let methods: Vec<_> = parsed.collect::<Result<_, _>>().map_err(wrong_use)?;
        match self.task {
            true => task::refuse_learned(&methods)?,
            false => refuse_unlike(&methods)?,
        }
        Ok(Offered {
            methods,
            left_out: Vec::new(),
        })
    }

    /// The methods on each of the scenes.
    fn scenes(&self) -> anyhow::Result<Vec<EvalReport>> {
        let report = |scene: &String| {
            let (frames, config) = scene::frames(scene, self)?;
            let (methods, _) = told_apart(self.methods(&config.profile)?.methods);
            Ok(self.report(&frames, &methods)?.0)
        };
        self.scene.iter().map(report).collect()
    }

    /// The first two methods with every number of levels and actuators.
    fn sweep(&self, frames: &Frames, methods: &[Method]) -> anyhow::Result<Vec<EvalReport>> {
        let report = |size| {
            let mut methods = methods[..methods.len().min(2)].to_vec();
            for method in &mut methods {
                (method.profile.levels, method.profile.actuators) = (size, size);
                method.profile.jnd = None;
            }
            Ok(self.report(frames, &methods)?.0)
        };
        SIZES.into_iter().map(report).collect()
    }

    fn report(
        &self,
        frames: &Frames,
        methods: &[Method],
    ) -> anyhow::Result<(EvalReport, References, Vec<Timings>)> {
        let sequence = &frames.sequence;
        let profile = &methods.first().context("no method to judge")?.profile;
        let (levels, actuators) = (profile.level_count(), profile.actuators);
        let coordinates = profile.coordinates;
        let methods = &learned(methods, sequence)[..];
        let passes = self.passes.map_or(20_000 / sequence.len().max(1), |n| n as usize);
        let passes = if self.passes.is_some() {
            passes
        } else {
            passes.clamp(5, 101) | 1
        };
        let progress = Progress::new(sequence.len() as u64, "frames, best possible");
        let references = References::find(sequence, levels, actuators, coordinates, self.restarts, || {
            progress.advance(1)
        })?;
        drop(progress);
        if references.contact_frames() == 0 {
            bail!(
                "{}: nothing is in contact in any of {} frames, so there is nothing to judge; {}",
                frames.name,
                sequence.len(),
                advice(sequence)
            );
        }
        let progress = Progress::new((methods.len() * (passes + 2)) as u64, "passes");
        let mut errors = Vec::with_capacity(methods.len());
        for method in methods {
            errors.push(judge(sequence, &references, method).with_context(|| method.name.clone())?);
            progress.advance(1);
        }
        let timings = time(sequence, methods, passes, Some(COUNTER), || progress.advance(1));
        let reports = methods.iter().zip(errors).zip(&timings);
        let reports = reports.map(|((m, errors), timings)| MethodReport::new(m, errors, timings.cost()));
        let mut contacts: Vec<f64> = references.frames.iter().map(|f| f.force.len() as f64).collect();
        contacts.retain(|n| *n > 0.0);
        let words = if sequence.conditioning.is_some() { 3.0 } else { 1.0 };
        let report = EvalReport {
            input: frames.name.clone(),
            frames: sequence.len(),
            taxels: sequence.layout.len(),
            contact_frames: references.contact_frames(),
            contacts_median: quantile(&mut contacts, 0.5),
            rate_hz: sequence.rate_hz(),
            levels,
            actuators,
            raw_bits_per_s: sequence.rate_hz() * sequence.layout.len() as f64 * words * 16.0,
            restarts: self.restarts,
            jump_bound_fraction: references.jump_bound,
            place_unit: references.plane.unit().into(),
            jump_distance: references.plane.jump,
            passes,
            conditioning: sequence.conditioning.as_ref().map(preset_name),
            conditioning_timed: sequence.conditioning.is_some(),
            contact_truth: frames.truth,
            methods: reports.collect(),
        };
        Ok((report, references, timings))
    }
}
