//! `taxel categorize`: categories of touches.

mod counts;
mod figures;
mod labels;
mod live;
mod manifest;
mod map_file;
mod phantom_map;
mod probe;
mod report;
mod sweep;
mod touches;
mod trial;
mod values;
mod waiting_marks;
mod whole;

use crate::errors::wrong_use;
use crate::piped_file::recording_parser;
use crate::recordings::input::number;
use anyhow::{Context, bail};
use clap::ValueEnum;
use clap::builder::TypedValueParser;
pub(crate) use live::{Categorised, Listener, Live, Source, Untold, follow};
use map_file::MapFile;
pub(crate) use phantom_map::PhantomMap;
use report::{Report, human, report};
use std::path::{Path, PathBuf};
use taxel_palpation::{Classifier, Matrix, Pca, Solver, clusters_by_silhouette, optimal, paper};
use taxel_record::{Columns, FileKind, RATES_HZ, ReadOptions};
use taxel_sequence::{Aligned, Motion};
use taxel_skin::Layout;
use taxeld::stdout;
pub(crate) use touches::label_of;
use touches::{Cutting, Set};

/// Find categories of what a probe touches, without being told what it is.
///
/// INPUT is a manifest (a .csv with a column `file`; docs/palpation.md), a recording that --marks or --contact cuts into
/// touches, or sim:SCENE with a phantom. Touches are put side by side by depth, angle or time, reduced to their principal
/// components, and clustered. Where the classes of touches are known, the categories are compared with them.
///
/// Silhouettes come in three readings that differ by much: per category as the publication prints it, averaged per
/// category (macro), and over touches (standard, scikit-learn's). Where classes are known, they have one too: how well the
/// map keeps them apart.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  taxel categorize sim:phantom-1 --classes 5
  taxel categorize sim:phantom-2 --depth 9.5 --radius 12 --classes 2-6 --json
  taxel categorize touches.csv --classes 3
  taxel categorize probe.npz --marks marks.csv --until away --classes 5
  taxel categorize touches.csv --classes 3 --save map.json
  taxel categorize --live map.json --publish /tmp/touches.sock
  taxel categorize --sweep examples/palpation/phantoms.csv --figures figures")]
pub(crate) struct Args {
    /// A manifest, a recording, or sim:SCENE; - for a recording on stdin
    #[arg(value_name = "INPUT", value_parser = recording_parser().map(|path| path.to_string_lossy().into_owned()), required_unless_present_any = ["sweep", "live"])]
    input: Option<String>,
    /// How many categories; a range such as 2-6 takes the number of greatest standard silhouette
    #[arg(long, value_name = "K", required_unless_present_any = ["sweep", "live"], value_parser = clusters)]
    classes: Option<(usize, usize)>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// paper: three random starts, discarded unless they agree; optimal: the best there is, proved for few touches
    #[arg(long, value_enum, default_value_t = Rule::Optimal)]
    rule: Rule,
    /// Components of the map
    #[arg(long, value_name = "C", default_value_t = 2, value_parser = clap::value_parser!(u16).range(1..=1000))]
    components: u16,
    /// How components are computed
    #[arg(long, value_enum, default_value_t = Solvers::Auto)]
    solver: Solvers,
    /// Touches that the components come from, as numbers from 0; all are judged [default: all]
    #[arg(long, value_name = "N,N,..", value_delimiter = ',')]
    basis: Vec<usize>,
    /// Depth of the motion, mm: of a scene, or of a recording with a frame for each step
    #[arg(long, value_name = "MM")]
    depth: Option<f64>,
    /// Radius of the motion, mm; 0 is straight down
    #[arg(long, value_name = "MM", default_value_t = 0.0)]
    radius: f64,
    /// Only the last so many mm of motions straight down [default: all of them]. The publication's own program takes 6.5
    #[arg(long, value_name = "MM", conflicts_with = "live", value_parser = number("window", 0.5..=40.0))]
    window: Option<f64>,
    /// From one step to the next: mm, degrees or s [default: the motion's, or the time between frames; where some came late, up to
    /// four times that]
    #[arg(long, value_name = "STEP", value_parser = number("step", 1e-6..=1e6))]
    step: Option<f64>,
    /// Marks that cut a recording into touches: SECONDS,TEXT a line; the last word of a text is the class [default: the marks in
    /// the recording, where it is an .mcap]
    #[arg(long, value_name = "FILE", conflicts_with = "contact")]
    marks: Option<PathBuf>,
    /// The text of marks that end a touch and begin none [default: away]
    #[arg(long, value_name = "TEXT", conflicts_with = "contact")]
    until: Option<String>,
    /// Cut a recording where a taxel is above this; for motions that begin and end with contact
    #[arg(long, value_name = "COUNTS")]
    contact: Option<f64>,
    /// With --contact: fewest frames of a touch, and of the rest that ends one
    #[arg(long, value_name = "N", default_value_t = 5, requires = "contact", conflicts_with_all = ["marks", "until", "sweep"])]
    least: usize,
    /// Which array of an .npz
    #[arg(long, value_name = "NAME")]
    array: Option<String>,
    /// The columns of recordings without times or names are raw counts, in this order: xyz-interleaved (x1,y1,z1,x2,..) or
    /// xyz-blocks (x1,x2,..,y1,..,z1,..); they are taken from the mean before each touch
    #[arg(long, value_name = "ORDER", conflicts_with = "live")]
    columns: Option<Columns>,
    /// Frames per second of recordings, in place of the times in them [default: their times; 30 where there are none]
    #[arg(long, value_name = "HZ", conflicts_with = "live", value_parser = number("rate of frames", RATES_HZ))]
    rate: Option<f64>,
    /// Frames are magnitudes of this height and width, also where the last of the axes is 3 and would be x y z
    #[arg(long, value_name = "grid:HxW", conflicts_with = "live", value_parser = grid)]
    layout: Option<(usize, usize)>,
    /// Random numbers: the same seed, the same categories
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Keep the map and its categories, for --live
    #[arg(long, value_name = "MAP", conflicts_with_all = ["sweep", "live"])]
    save: Option<PathBuf>,
    /// Put every touch that a running daemon's hand makes into a category of this map: one JSON object a line
    #[arg(long, value_name = "MAP", conflicts_with_all = NOT_LIVE)]
    live: Option<PathBuf>,
    /// With --live: the daemon's image socket [default: where the daemon of this user, or of the system, puts it]
    #[arg(long, value_name = "PATH", requires = "live", conflicts_with_all = NOT_LIVE)]
    socket: Option<PathBuf>,
    /// With --live: wait for the daemon, at the start and whenever it is gone, instead of ending
    #[arg(long, requires = "live", conflicts_with_all = NOT_LIVE)]
    reconnect: bool,
    /// With --live: also publish touches on a socket of this name, as TOUCH messages
    #[arg(long, value_name = "PATH", requires = "live", conflicts_with_all = NOT_LIVE)]
    publish: Option<PathBuf>,
    /// Judge every phantom and motion of a manifest, and say which motion tells the classes apart best
    #[arg(long, value_name = "MANIFEST", conflicts_with_all = NOT_OF_A_SWEEP)]
    sweep: Option<PathBuf>,
    /// With --sweep: draw the publication's figures 6 to 17 here, every number as CSV beside them
    #[arg(long, value_name = "DIR", requires = "sweep", conflicts_with_all = NOT_OF_A_SWEEP, conflicts_with = "live")]
    figures: Option<PathBuf>,
}

/// What excludes `--live`, and its options, too: clap does not miss `--live` beside what excludes it.
const NOT_LIVE: [&str; 3] = ["input", "classes", "sweep"];

/// What excludes `--sweep`, and its options, too.
const NOT_OF_A_SWEEP: [&str; 7] = ["input", "classes", "marks", "contact", "until", "array", "basis"];

/// Whose rule makes categories.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Rule {
    Paper,
    Optimal,
}

/// How components are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Solvers {
    Auto,
    Exact,
    Truncated,
}

fn clusters(text: &str) -> Result<(usize, usize), String> {
    let (from, to) = text.split_once('-').unwrap_or((text, text));
    match (from.trim().parse(), to.trim().parse()) {
        (Ok(from), Ok(to)) if 2 <= from && from <= to => Ok((from, to)),
        _ => Err(format!(
            "{text:?} is neither a number of categories from 2 on nor a range such as 2-6"
        )),
    }
}

/// Height and width of a grid.
fn grid(text: &str) -> Result<(usize, usize), String> {
    if !text.starts_with("grid:") {
        return Err(format!("{text:?} is no grid such as grid:4x3"));
    }
    let grid = Layout::resolve(text).map_err(|error| error.to_string())?;
    Ok((grid.height.into(), grid.width.into()))
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    if let Some(map) = &args.live {
        let source = live::Source {
            socket: args.socket.as_deref(),
            reconnect: args.reconnect,
        };
        return live::run(map, source, args.publish.as_deref(), args.until());
    }
    let text = match &args.sweep {
        Some(manifest) => sweep::run(
            manifest,
            &args.of_recordings(),
            args.window,
            args.figures.as_deref(),
            args.seed,
            args.json,
        )?,
        None => {
            let (set, report) = categorize(args)?;
            if args.json {
                serde_json::to_string(&report)? + "\n"
            } else {
                human(&set, &report)
            }
        }
    };
    stdout::print(&text)
}

impl Args {
    /// The text of marks that end a touch.
    fn until(&self) -> &str {
        self.until.as_deref().unwrap_or("away")
    }

    /// What is said of every recording.
    fn of_recordings(&self) -> ReadOptions {
        ReadOptions {
            columns: self.columns,
            rate_hz: self.rate,
            image: self.layout,
            ..ReadOptions::default()
        }
    }
}

/// The touches of INPUT.
fn read(args: &Args) -> anyhow::Result<Set> {
    let input = args.input.as_deref().unwrap_or_default();
    let motion = args.depth.map(|depth| Motion::new(depth, args.radius));
    let motion = motion.transpose().map_err(wrong_use)?;
    if motion.is_none() && args.radius != 0.0 {
        return Err(wrong_use(format!("--radius {} needs --depth", args.radius)));
    }
    let knows_itself = input.starts_with("sim:") || FileKind::of(Path::new(input)) == Some(FileKind::Mcap);
    let of_frames = [
        ("--columns", args.columns.is_some()),
        ("--rate", args.rate.is_some()),
        ("--layout", args.layout.is_some()),
    ];
    let array = ("--array", args.array.is_some());
    let of_cuts = [
        ("--marks", args.marks.is_some()),
        ("--contact", args.contact.is_some()),
        ("--until", args.until.is_some()),
    ];
    let refuse = |options: &[(&str, bool)]| match options.iter().find(|(_, is_given)| *is_given) {
        Some((option, _)) => bail!("{input}: {option} says nothing about it; leave it out"),
        None => Ok(()),
    };
    if knows_itself {
        refuse(&of_frames)?;
        refuse(&[array])?;
    }
    if let Some(scene) = input.strip_prefix("sim:") {
        refuse(&of_cuts)?;
        return touches::of_scene(scene, motion);
    }
    let path = Path::new(input);
    if args.marks.is_none() && args.contact.is_none() && manifest::is_manifest(path)? {
        refuse(&of_cuts)?;
        refuse(&[array])?;
        let mut jobs = manifest::read_manifest(path, &args.of_recordings())?;
        let has_depths = jobs.iter().any(|job| job.motion().is_some());
        let not_one = if has_depths {
            ""
        } else {
            ": none has a depth; leave --depth out"
        };
        if motion.is_some() {
            jobs.retain(|job| job.motion() == motion);
        }
        return match jobs.as_slice() {
            [job] => job.read(),
            [] => bail!("{input}: no touch of the motion that --depth and --radius name{not_one}"),
            jobs => bail!("{input}: {}", manifest::what_chooses(jobs)),
        };
    }
    let options = ReadOptions {
        array: args.array.clone(),
        ..args.of_recordings()
    };
    let cutting = Cutting {
        marks: args.marks.clone(),
        until: args.until().to_owned(),
        contact: args.contact,
        least: args.least,
    };
    touches::of_recording(path, &options, &cutting, motion)
}

/// Touches as the columns of a matrix.
fn matrix(aligned: &Aligned) -> Matrix {
    let touches = aligned.values.len() / aligned.features().max(1);
    Matrix::new(aligned.features(), touches, aligned.values.clone())
}

fn categorize(args: &Args) -> anyhow::Result<(Set, Report)> {
    if let (Rule::Paper, Some((from, to))) = (args.rule, args.classes)
        && from != to
    {
        return Err(wrong_use(format!(
            "--rule paper has no way of choosing --classes {from}-{to}; give one number"
        )));
    }
    let set = read(args)?.last_mm(args.window)?;
    let aligned = set.align(args.step)?;
    let touches = matrix(&aligned);
    let solver = match args.solver {
        Solvers::Auto => Solver::Auto,
        Solvers::Exact => Solver::Exact,
        Solvers::Truncated => Solver::Truncated,
    };
    if let Some(beyond) = args.basis.iter().find(|touch| **touch >= touches.ncols()) {
        bail!("--basis {beyond}: there are touches 0 to {}", touches.ncols() - 1);
    }
    let basis = if args.basis.is_empty() {
        touches.clone()
    } else {
        touches.select_columns(&args.basis)
    };
    let map = || -> Result<_, taxel_palpation::PalpationError> {
        let pca = Pca::fit(&basis, args.components.into(), solver)?;
        let map = pca.project(&touches)?;
        let explained_variance = pca.kept_variance(&touches)?;
        Ok((pca, map, explained_variance))
    };
    let what = || match set.frames_left_out(aligned.left_out) {
        Some(left_out) => format!("{}: {left_out}", set.name),
        None => set.name.clone(),
    };
    let (pca, map, explained_variance) = map().with_context(what)?;
    let (from, to) = args.classes.unwrap_or((2, 2));
    let categories = match args.rule {
        Rule::Optimal if from == to => optimal(&map, from, args.seed),
        Rule::Optimal => clusters_by_silhouette(&map, from..=to, args.seed),
        Rule::Paper => paper(&map, from, args.seed),
    };
    let categories = categories.with_context(what)?;
    let classifier = Classifier::new(&pca, &touches, &categories)?;
    let report = report(&set, &aligned, &map, explained_variance, categories, args.seed)?;
    if let Some(path) = &args.save {
        let mut labels = report.class_of_label.clone();
        labels.resize(classifier.categories(), None);
        MapFile::new(&set, &aligned, labels, classifier).save(path)?;
    }
    Ok((set, report))
}
