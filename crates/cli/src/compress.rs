//! `taxel compress`: the daemon's compression, offline.

use crate::errors::wrong_use;
use crate::offered::offering;
use crate::recordings::frame_output::{FrameFormat, FrameOutput};
use crate::recordings::input::Input;
use crate::recordings::offline::{OfflineArgs, ends_within_calibration};
use crate::recordings::out_of_use::OutOfUse;
use anyhow::bail;
use clap::builder::{PathBufValueParser, TypedValueParser};
use serde::Serialize;
use serde_json::json;
use std::path::{Path, PathBuf};
use taxel_compress::learn_codebook;
use taxel_diagnose::ANY_CHANGE_IS_CONTACT;
use taxel_engine::Display;
use taxel_hand::{ForceFrame, LevelSteps, Method, Profile, TactileImage, did_you_mean, plural};
use taxel_playback::image_output::{ImageOutput, OutputFormat};
use taxel_playback::interrupt::Interrupt;
use taxel_playback::output_file::{OutputFile, refuse_overlap};
use taxel_playback::pipeline::Felt;
use taxel_playback::progress::Progress;
use taxel_record::ending_of;
use taxel_skin::{Layout, Movement};
use taxeld::Config;
use taxeld::stdout;

/// Compress a recording offline, with the same core as the daemon and the same bytes as its result.
///
/// CAN traffic (candump .log, or a scene's, sim:SCENE) and raw counts go the daemon's whole way: decoding, sweep assembly,
/// baseline, contact threshold, faults, compression. Magnitudes go straight to the compression; a
/// taxel is in contact where its value exceeds --threshold.
///
/// A candump log gives images at the configuration's tick (30 Hz unless --config says otherwise), raw counts one image
/// per recorded frame; with --config, those of a hand with boards are sampled at its tick, unless that has mode =
/// "sweep". All begin with the calibration window (--calibration-ms), in which images are empty.
///
/// OUT tells the format: .npz (images T x H x W u8, levels, actuators, seq, t_ns, contacts, faulty,
/// missing, and joints where any are read; a row of actuators is id, x, y, level, force, and NaN where none presses), .npy and .csv (images alone), .jsonl (the objects of `taxel watch --json`,
/// latency null), .bin (the IMAGE messages of the daemon's socket, one after another).
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  taxel compress grasp.log --out images.npz
  taxel compress grasps.npz --array WOOD_1 --layout schunk-sdh --threshold 150 --out images.npy
  taxel compress module.npz --array LOG7 --columns xyz-interleaved --tile --out images.jsonl
  taxel compress sim:ball-grasp --out images.npz --frames grasp.csv
  taxel compress grasp.csv --out images.csv --method paper
  taxel compress day.log --levels 8 --learn-codebook codebook.toml --out day.npz")]
pub(crate) struct Args {
    #[command(flatten)]
    offline: OfflineArgs,
    /// Where the images go: .npz, .npy, .csv, .jsonl or .bin; - for JSON lines on stdout
    #[arg(long, value_name = "FILE", value_parser = image_file_parser())]
    out: PathBuf,
    #[arg(long, value_name = "METHOD", value_parser = method_parser(), hide_possible_values = true, help = format!("How frames are compressed: {}; paper has the publication's conditioning too, unless told otherwise", methods()))]
    method: Option<Method>,
    /// Writes the frames that the images are made of, from the first in which a taxel has a value: .csv, with time, x y
    /// z of each taxel and joint angles a line, where cells of a taxel without a value are empty; .npz or .parquet, as
    /// `taxel convert` writes them
    #[arg(long, value_name = "FILE")]
    frames: Option<PathBuf>,
    /// Writes the force levels of the whole recording here, to be kept constant as profile.codebook
    #[arg(long, value_name = "FILE")]
    learn_codebook: Option<PathBuf>,
    /// One JSON object on stdout in the end: how many images there are, and of which kinds; of counts also the contact
    /// threshold that was measured, and whether the hand, or taxels of it, moved meanwhile (moved); both are null of magnitudes
    #[arg(long)]
    json: bool,
}

/// Reads the path of a file of images, whose ending tells the format.
fn image_file_parser() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| {
        OutputFormat::of(&path)
            .map(|_| path)
            .map_err(|error| error.to_string())
    })
}

/// The names of the methods, those that the compression has.
pub(crate) fn methods() -> String {
    let names = ["paper", "optimal"]
        .into_iter()
        .filter(|name| parse_method(name).is_some());
    names.collect::<Vec<_>>().join(" or ")
}

fn parse_method(name: &str) -> Option<Method> {
    serde_json::from_value(serde_json::Value::from(name)).ok()
}

/// Reads a method by its name in the configuration.
pub(crate) fn method_parser() -> impl TypedValueParser<Value = Method> {
    offering(["paper", "optimal"], method)
}

fn method(name: &str) -> Result<Method, String> {
    parse_method(name).ok_or_else(|| {
        let meant = did_you_mean(name, ["paper", "optimal"]);
        format!("there is no method {name:?}; there is {}{meant}", methods())
    })
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let format = OutputFormat::of(&args.out)?;
    if args.json && args.out.as_os_str() == "-" {
        return Err(wrong_use(
            "--json: the images go to stdout already; give --out a file",
        ));
    }
    let frames = args.frames.as_deref().map(frame_format).transpose()?;
    let outputs: Vec<&Path> = [&args.out]
        .into_iter()
        .chain(&args.learn_codebook)
        .chain(&args.frames)
        .map(PathBuf::as_path)
        .collect();
    refuse_overlap(&outputs, &args.offline.inputs())?;
    let input = args.offline.open_whole()?;
    let mut config = args.offline.configure(&input)?;
    if let Some(method) = args.method {
        config.set_method(method, None);
    }
    config.profile.check()?;
    if let (Some(path), Input::Frames(recording)) = (&args.frames, &input)
        && !recording.has_counts()
    {
        bail!(
            "--frames {}: {} holds magnitudes, and no counts to be written",
            path.display(),
            recording.name()
        );
    }
    let interrupt = Interrupt::install()?;
    let mut run = Run {
        raw: (args.frames.as_deref().zip(frames))
            .map(|(path, format)| RawFrames::create(path, format, &config.layout, input.image_shape()))
            .transpose()?,
        output: ImageOutput::create(&args.out, format, &config.layout, &config.profile)?,
        frames: args.learn_codebook.as_ref().map(|_| Vec::new()),
        counts: Counts::default(),
        out_of_use: OutOfUse::default(),
        of_counts: false,
        threshold: None,
        moved: None,
        has_gaps: matches!(&input, Input::Frames(recording) if recording.missing() > 0),
    };
    let mut display = Display::new(config.profile.clone(), None, &config.layout)?;
    args.offline.run(&input, &config, &mut |felt| {
        if interrupt.is_set() {
            bail!("stopped; {} was not written", args.out.display());
        }
        run.take(felt, display.image_of(felt.force, felt.joints))
    })?;
    run.finish(args, &config)
}

/// What is made of a recording.
struct Run {
    output: ImageOutput,
    /// The frames themselves, where they are wanted.
    raw: Option<RawFrames>,
    /// Every frame's forces, where a codebook is to be learned.
    frames: Option<Vec<ForceFrame>>,
    counts: Counts,
    out_of_use: OutOfUse,
    /// Whether it holds what boards sent, and not magnitudes.
    of_counts: bool,
    /// The contact threshold that was measured last, counts, or counts squared.
    threshold: Option<f64>,
    /// Whether the hand, or some of its taxels, moved in any calibration.
    moved: Option<bool>,
    /// Whether the recording itself says that values are not there.
    has_gaps: bool,
}

/// How many images there are, and of which kinds.
#[derive(Default, Serialize)]
struct Counts {
    images: u64,
    calibrating: u64,
    with_contact: u64,
    /// Calibration over, in which a taxel had no value of its time.
    with_missing: u64,
    /// Calibration over, in which a taxel was out of use.
    with_faulty: u64,
}

impl Counts {
    fn take(&mut self, image: &TactileImage) {
        self.images += 1;
        self.calibrating += u64::from(image.calibrating);
        self.with_contact += u64::from(image.contacts > 0);
        self.with_missing += u64::from(image.missing > 0 && !image.calibrating);
        self.with_faulty += u64::from(image.faulty > 0 && !image.calibrating);
    }
}

impl Run {
    fn take(&mut self, felt: &Felt<'_>, image: &TactileImage) -> anyhow::Result<()> {
        let Felt { measured, force, .. } = *felt;
        self.counts.take(image);
        self.of_counts = measured.is_some();
        let moves = measured.map(|measured| measured.moved != Movement::None);
        self.moved = self.moved.max(moves);
        if self.of_counts && !force.calibrating {
            self.threshold = Some(force.threshold);
        }
        self.out_of_use.take(force);
        if let Some(frames) = &mut self.frames {
            frames.push(force.clone());
        }
        if let (Some(raw), Some(tactile)) = (&mut self.raw, measured) {
            raw.output.put(&raw.layout, &tactile)?;
        }
        self.output.push(image)
    }

    fn finish(mut self, args: &Args, config: &Config) -> anyhow::Result<()> {
        let levels = config.profile.level_count();
        let learned = self.frames.take();
        let learned = learned.map(|frames| learn_codebook(&frames, levels));
        if learned.as_ref().is_some_and(Vec::is_empty) {
            let written = match args.out.as_os_str() == "-" {
                true => "the images are out",
                false => "nothing was written",
            };
            bail!("no codebook: nothing in the recording is in contact; {written}");
        }
        let writing = Progress::busy(format!("writing {}", args.out.display()));
        self.output.finish()?;
        drop(writing);
        if let (Some(raw), Some(path)) = (self.raw.take(), &args.frames) {
            raw.finish(path)?;
        }
        self.tell(args, config);
        if let (Some(path), Some(codebook)) = (&args.learn_codebook, learned) {
            let profile = Profile {
                levels,
                jnd: None,
                level_steps: LevelSteps::Fitted,
                codebook_learning: None,
                codebook,
                ..config.profile.clone()
            };
            profile.check()?;
            write_codebook(path, args, &profile, &other_levels(&config.profile))?;
            remark!(
                "{}: {} learned",
                path.display(),
                plural(profile.codebook.len(), "level")
            );
        }
        if args.json {
            let mut object = json!(self.counts);
            object["threshold"] = json!(self.threshold);
            object["moved"] = json!(self.moved);
            object["out"] = args.out.display().to_string().into();
            object["width"] = config.layout.width.into();
            object["height"] = config.layout.height.into();
            stdout::print(&format!("{object}\n"))?;
        }
        Ok(())
    }

    /// Says what images there are, and what is odd about them.
    fn tell(&self, args: &Args, config: &Config) {
        let Counts {
            images,
            calibrating,
            with_contact,
            with_missing,
            ..
        } = self.counts;
        let while_calibrating = match calibrating {
            0 => String::new(),
            _ => format!(", {calibrating} while calibrating"),
        };
        let unit = match config.conditioning.magnitude.is_squared() {
            true => "counts squared",
            false => "counts",
        };
        let threshold = self.threshold.map_or_else(String::new, |threshold| {
            format!(", contact above {threshold:.0} {unit}")
        });
        remark!(
            "{}: {} of {}x{}, {with_contact} with contact{while_calibrating}{threshold}",
            args.out.display(),
            plural(images, "image"),
            config.layout.height,
            config.layout.width,
        );
        if images == 0 {
            remark!("taxel: no image: the recording ends before its first tick or sweep is complete");
        } else if calibrating == images {
            let why = ends_within_calibration(&config.conditioning);
            remark!("taxel: every image is empty, since {why}");
        } else if with_missing > 0 {
            let period_ms = config
                .sweep
                .board_period_ms
                .filter(|_| self.of_counts && !self.has_gaps);
            let hint = period_ms.map_or_else(String::new, |ms| {
                format!("; sweep.board_period_ms says that boards send every {ms} ms: do they?")
            });
            remark!(
                "taxel: taxels are missing in {}{hint}",
                plural(with_missing, "image")
            );
        }
        self.out_of_use.tell("image");
        if self.threshold == Some(0.0) {
            remark!(
                "taxel: the contact threshold is 0: {ANY_CHANGE_IS_CONTACT}; --conditioning robust measures it over a longer time"
            );
        }
    }
}

/// The format of a file for --frames.
fn frame_format(path: &Path) -> anyhow::Result<FrameFormat> {
    let format = FrameFormat::of_ending(&ending_of(path)).ok_or_else(|| {
        wrong_use(format!(
            "--frames {}: frames are written as .csv, .npz or .parquet",
            path.display()
        ))
    })?;
    format.check(path)?;
    Ok(format)
}

/// A file of tactile frames.
struct RawFrames {
    whole: OutputFile,
    layout: Layout,
    output: FrameOutput,
}

impl RawFrames {
    fn create(
        path: &Path,
        format: FrameFormat,
        layout: &Layout,
        image: Option<(usize, usize)>,
    ) -> anyhow::Result<Self> {
        let whole = OutputFile::begin(path)?;
        Ok(Self {
            output: FrameOutput::create(whole.path(), format, image),
            layout: layout.clone(),
            whole,
        })
    }

    fn finish(mut self, path: &Path) -> anyhow::Result<()> {
        let [frames, _] = self.output.finish()?;
        if frames == 0 {
            remark!(
                "taxel: {}: not written, since no taxel has a value in any frame",
                path.display()
            );
            return Ok(());
        }
        self.whole.finish()
    }
}

/// The keys of a profile that say how many levels there are and which, and that a codebook takes the place of.
fn other_levels(profile: &Profile) -> Vec<&'static str> {
    let keys = [
        ("jnd", profile.jnd.is_some()),
        ("level_steps", profile.level_steps != LevelSteps::Fitted),
        ("codebook_learning", profile.codebook_learning.is_some()),
        ("codebook", !profile.codebook.is_empty()),
    ];
    keys.into_iter()
        .filter(|(_, set)| *set)
        .map(|(key, _)| key)
        .collect()
}

/// Writes the levels of a profile as a piece of a configuration, which takes the place of these keys of it.
fn write_codebook(path: &Path, args: &Args, profile: &Profile, replaced: &[&str]) -> anyhow::Result<()> {
    let levels: Vec<String> = profile
        .codebook
        .iter()
        .map(|force| format!("{force:?}"))
        .collect();
    let place = match replaced {
        [] => String::new(),
        keys => format!(" in place of {}", keys.join(" and ")),
    };
    let text = format!(
        "# Force levels learned from {}; put them into the daemon's configuration{place}.\n[profile]\nlevels = {}\n\
         codebook = [{}]\n",
        args.offline.input.name(),
        profile.levels,
        levels.join(", "),
    );
    OutputFile::write(path, text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn methods_are_known_by_their_names() {
        assert_eq!(method("paper"), Ok(Method::Paper));
        assert!(methods().starts_with("paper"));
        assert!(method("best").unwrap_err().contains("paper"));
        assert!(method("papper").unwrap_err().ends_with("did you mean `paper`?"));
    }
}
