//! `taxel convert`: a recording in another format.

use crate::errors::wrong_use;
use crate::recordings::frame_output::{FrameFormat, FrameOutput};
use crate::recordings::input::{DEFAULT_LAYOUT, Input};
use crate::recordings::offline::OfflineArgs;
use crate::recordings::{marks_file, tell_joints};
use anyhow::{Context, bail};
use serde_json::json;
use std::io::Write;
use std::path::PathBuf;
use taxel_engine::TickMode;
use taxel_hand::{Freshness, TactileFrame, shell_word};
use taxel_playback::array_frames::{ArrayFrames, is_of_arrays};
use taxel_playback::fitted;
use taxel_playback::image_output::{ImageOutput, OutputFormat};
use taxel_playback::interrupt::Interrupt;
use taxel_playback::output_file::{OutputFile, create_stream, refuse_overlap};
use taxel_playback::progress::Progress;
use taxel_playback::recorded;
use taxel_playback::sweep::Sweeps;
use taxel_playback::traffic_output::{Check, TrafficFormat, TrafficOutput};
use taxel_record::{Recording, ending_of};
use taxel_recorder::Topic;
use taxel_skin::Layout;
use taxeld::stdout;

/// Write a recording in another format.
///
/// Into .log (candump) and .mcap goes CAN traffic, frame by frame: that of a log or an .mcap, or what the boards or
/// pressure arrays of the hand would have sent for the counts of a .csv, .npy or .npz; what else is in an .mcap stays behind, which is said.
/// Into .npz, .csv and .parquet go tactile frames, counts, times and joint angles: those that the daemon made, where an
/// .mcap holds them, or else those that it would make of the traffic.
///
/// BLF, ASC and TRC are python-can's: `can_logconvert grasp.log grasp.blf`, and back. They keep of a bus's name the number
/// at its end alone, so that `left` and `right` become one. Images are made by `taxel compress`.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  taxel convert grasp.mcap grasp.log
  taxel convert grasp.mcap grasp.npz          counts T x N x 3, t_ns, joints
  taxel convert grasp.mcap grasp.csv          the publication's columns, a reading of the hand a line
  taxel convert grasp.mcap grasp.parquet      the same columns
  taxel convert grasp.mcap images.npz --images    images, levels and actuators as they were shown
  taxel convert grasp.mcap marks.csv --marks
  taxel convert grasp.log grasp.mcap")]
pub(crate) struct Args {
    #[command(flatten)]
    offline: OfflineArgs,
    /// Where it goes: .log, .mcap, .npz, .csv or .parquet; - for candump lines, or with --marks for these, on
    /// stdout
    #[arg(value_name = "OUT")]
    out: PathBuf,
    /// One JSON object on stdout in the end: the file, and how many CAN frames, frames, images or marks are in it
    #[arg(long)]
    json: bool,
    /// The images of an .mcap as they were shown, into .npz, .npy or .csv
    #[arg(long, conflicts_with = "marks")]
    images: bool,
    /// The marks of an .mcap, into a .csv: SECONDS,TEXT a line, from its first tactile frame
    #[arg(long)]
    marks: bool,
}

/// What is written.
enum Format {
    Traffic(TrafficFormat),
    Frames(FrameFormat),
}

impl Format {
    /// By what a name ends with, in small letters.
    fn of_ending(ending: &str) -> Option<Self> {
        let traffic = TrafficFormat::of_ending(ending).map(Self::Traffic);
        traffic.or_else(|| FrameFormat::of_ending(ending).map(Self::Frames))
    }
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let out = &args.out;
    let is_stdout = out.as_os_str() == "-";
    if args.json && is_stdout {
        return Err(wrong_use(
            "--json: the recording goes to stdout already; name a file",
        ));
    }
    let ending = match (is_stdout, args.marks) {
        (true, true) => "csv".into(),
        (true, false) => "log".into(),
        (false, _) => ending_of(out),
    };
    if args.images || args.marks {
        args.offline.refuse_profile(&out.display().to_string(), true)?;
        return extract(args, &ending);
    }
    let Some(format) = Format::of_ending(&ending) else {
        return Err(wrong_use(format!(
            "{}: a recording is written as .log, .mcap, .npz, .csv or .parquet, or as candump lines to -",
            out.display()
        )));
    };
    if let Format::Frames(format) = format {
        format.check(out)?;
    }
    let as_it_is = matches!(format, Format::Traffic(_));
    args.offline
        .refuse_profile(&out.display().to_string(), as_it_is)?;
    refuse_overlap(&[out], &args.offline.inputs())?;
    let input = args.offline.open()?;
    let interrupt = Interrupt::install()?;
    let check = || match interrupt.is_set() {
        true => bail!("stopped; {} was not written", out.display()),
        false => Ok(()),
    };
    let mut whole = OutputFile::stream(out)?;
    let (count, what) = match format {
        Format::Traffic(format) => {
            let mut output = TrafficOutput::create(whole.path(), format, "convert")?;
            traffic(args, &input, &mut output, &check)?;
            (output.finish()?, "CAN frames")
        }
        Format::Frames(format) => {
            let mut output = FrameOutput::create(whole.path(), format, input.image_shape());
            frames(args, &input, &mut |layout, frame| {
                check()?;
                output.put(layout, frame)
            })?;
            let name = args.offline.input.name();
            match output.finish()? {
                [0, 0] => bail!("{name}: there is no frame in it"),
                [0, before] => bail!("{name}: {}", recorded::silent(before)),
                [frames, _] => (frames, "frames"),
            }
        }
    };
    whole.finish()?;
    report(args, count, what)
}

/// Says what was written.
fn report(args: &Args, count: u64, what: &str) -> anyhow::Result<()> {
    let out = args.out.display();
    let one = what.strip_suffix('s').filter(|_| count == 1);
    say!("{out}: {count} {}", one.unwrap_or(what));
    if args.json {
        let key = what.to_ascii_lowercase().replace(' ', "_");
        let object = json!({ "out": out.to_string(), key: count });
        stdout::print(&format!("{object}\n"))?;
    }
    Ok(())
}

/// What the daemon showed, or people marked, out of a recording.
fn extract(args: &Args, ending: &str) -> anyhow::Result<()> {
    let (path, out) = (&args.offline.input.path, &args.out);
    let (what, endings): (_, &[&str]) = match args.images {
        true => ("images", &["npz", "npy", "csv"]),
        false => ("marks", &["csv"]),
    };
    if !endings.contains(&ending) {
        return Err(wrong_use(format!(
            "{}: {what} are written as .{}",
            out.display(),
            endings.join(", .")
        )));
    }
    if !args.offline.input.is_mcap() {
        bail!(
            "{}: --{what} is for an .mcap, which alone has them",
            path.display()
        );
    }
    refuse_overlap(&[out], &args.offline.inputs())?;
    let count = if args.images {
        let whole = OutputFile::begin(out)?;
        let shown = recorded::images(path)?;
        let mut output = ImageOutput::of_shown(whole, OutputFormat::of(out)?, &shown)?;
        for image in &shown.images {
            output.push(image)?;
        }
        output.finish()?;
        shown.images.len()
    } else {
        let mut whole = OutputFile::stream(out)?;
        let marks = recorded::marks(path)?;
        let text = marks_file::text(&marks)?;
        create_stream(whole.path())
            .and_then(|mut file| file.write_all(&text))
            .with_context(|| out.display().to_string())?;
        whole.finish()?;
        marks.len()
    };
    report(args, count as u64, what)
}

fn traffic(args: &Args, input: &Input, output: &mut TrafficOutput, check: &Check<'_>) -> anyhow::Result<()> {
    let path = &args.offline.input.path;
    let stays_behind = match input {
        Input::Log(traffic) => {
            output.take_traffic(traffic, check)?;
            &[Topic::Frames, Topic::Images, Topic::Events][..]
        }
        Input::Scene(scene) => bail!(
            "sim:{} is a scene, not a recording; `taxel sim {} --to {}` writes its traffic",
            scene.name(),
            shell_word(scene.name()),
            shell_word(format!("log:{}", args.out.with_extension("log").display()))
        ),
        Input::Frames(recording) => {
            let layout = args.offline.hand(DEFAULT_LAYOUT)?;
            tell_joints(recording);
            let tell = |senders: &str| {
                remark!(
                    "taxel: {}: its {} frames go as what {senders} send; who makes frames of that again samples it anew",
                    recording.name(),
                    recording.len()
                );
            };
            if is_of_arrays(&layout) {
                args.offline.input.refuse_tile_of_arrays(&layout)?;
                let frames = ArrayFrames::new(recording, &layout)?;
                tell("arrays");
                output.take_arrays(&frames, check)?;
            } else {
                let sweeps = Sweeps::new(recording, &layout, args.offline.input.tile)?;
                tell("boards");
                output.take_sweeps(&sweeps, check)?;
            }
            &[Topic::Images, Topic::Events]
        }
    };
    if args.offline.input.is_mcap()
        && let Some(counted) = recorded::counted(path, stays_behind)?
    {
        remark!(
            "taxel: {}: not taken along: {counted}; CAN traffic is all that goes there",
            path.display()
        );
    }
    Ok(())
}

/// What takes tactile frames.
type TakeFrame<'a> = dyn FnMut(&Layout, &TactileFrame) -> anyhow::Result<()> + 'a;

fn frames(args: &Args, input: &Input, take: &mut TakeFrame<'_>) -> anyhow::Result<()> {
    let config = args.offline.configure(input)?;
    let recorded = match input {
        Input::Log(traffic) if !traffic.is_candump() => recorded::frames(traffic.path()).ok(),
        _ => None,
    };
    match recorded
        .as_ref()
        .map(|recording| (recording, recording.taxels() == config.layout.len()))
    {
        Some((recording, true)) => copy_frames(recording, &config.layout, take),
        Some((recording, false)) => bail!(
            "{} has frames of {} taxels and layout {} has {}; name its hand with --layout",
            recording.name(),
            recording.taxels(),
            config.layout.name,
            config.layout.len()
        ),
        None => match input {
            Input::Frames(recording)
                if recording.has_counts() && recording.taxels() == config.layout.len() =>
            {
                fitted::tell_rows(recording, &config.layout);
                copy_frames(recording, &config.layout, take)
            }
            Input::Frames(recording) if !recording.has_counts() => bail!(
                "{} holds magnitudes, and no counts; `taxel compress` makes images of it",
                recording.name()
            ),
            _ => {
                if let Input::Log(traffic) = input {
                    let when = match config.tick.mode {
                        TickMode::Timer => format!("every {:.1} ms", 1e3 / config.tick.rate_hz),
                        TickMode::Sweep => "with every sweep".into(),
                    };
                    remark!(
                        "taxel: {}: the hand is read off its CAN traffic {when}, as a daemon does",
                        traffic.path().display()
                    );
                }
                args.offline.run(input, &config, &mut |felt| match felt.measured {
                    Some(measured) => take(&config.layout, measured.tactile),
                    None => Ok(()),
                })
            }
        },
    }
}

fn copy_frames(recording: &Recording, layout: &Layout, take: &mut TakeFrame<'_>) -> anyhow::Result<()> {
    let progress = Progress::new(recording.len() as u64, "frames");
    let mut frame = TactileFrame::new(recording.taxels());
    for index in 0..recording.len() {
        frame.t_ns = recording.t_ns(index);
        for (taxel, counts) in recording.counts(index).unwrap_or_default().iter().enumerate() {
            frame.counts[taxel] = counts.unwrap_or_default();
            frame.freshness[taxel] = match counts {
                Some(_) => Freshness::Fresh,
                None => Freshness::Missing,
            };
        }
        frame.joints.clear();
        frame.joints.extend_from_slice(recording.joints(index));
        take(layout, &frame)?;
        progress.advance(1);
    }
    Ok(())
}
