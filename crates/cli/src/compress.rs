//! `taxel compress`: the daemon's compression, offline.

use crate::image_output::{ImageOutput, OutputFormat};
use crate::input::{DEFAULT_LAYOUT, Input, InputArgs, interfaces_of_buses, pair};
use crate::progress::Progress;
use crate::sweep::Sweeps;
use anyhow::{Context, bail};
use std::path::PathBuf;
use taxel_can::{CanSource, LogSource, Playback, Received};
use taxel_compress::{Compressor, Method, Profile, learn_codebook};
use taxel_record::Recording;
use taxel_skin::{ForceFrame, Layout};
use taxeld::Config;
use taxeld::config::TickMode;
use taxeld::pipeline::{Outputs, run_recorded};

/// Compress a recording offline, with the same core as the daemon and the same bytes as its result.
///
/// CAN traffic (candump .log) and raw counts go the daemon's whole way: decoding, sweep assembly, baseline, contact
/// threshold, faults, compression. Magnitudes go straight to the compression; a taxel is in contact where its value
/// exceeds --threshold.
///
/// A candump log gives images at the configuration's tick (30 Hz unless --config says otherwise), raw counts one
/// image per recorded frame. Both begin with the calibration window (conditioning.calibration_ms), in which images
/// are empty.
///
/// OUT tells the format: .npz (images T x H x W u8, levels, actuators, seq, t_ns, contacts, faulty, missing), .npy
/// and .csv (images alone), .jsonl (the objects of `taxel watch --json`, latency null), .bin (the IMAGE messages of
/// the daemon's socket, one after another).
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  taxel compress grasp.log --out images.npz
  taxel compress grasps.npz --array WOOD_1 --layout grid:27x18 --threshold 150 --out images.npy
  taxel compress module.npz --array LOG7 --columns xyz-interleaved --tile --out images.jsonl
  taxel compress day.log --levels 8 --learn-codebook codebook.toml --out day.npz")]
pub(crate) struct Args {
    #[command(flatten)]
    input: InputArgs,
    /// Where the images go: .npz, .npy, .csv, .jsonl or .bin
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Force levels of the display, K_D [default: 8, or the configuration's]
    #[arg(long, value_name = "K_D")]
    levels: Option<u16>,
    /// Actuators of the display, K_A [default: 16, or the configuration's]
    #[arg(long, value_name = "K_A")]
    actuators: Option<u16>,
    #[arg(long, value_name = "METHOD", value_parser = method, help = format!("How frames are compressed: {}", methods()))]
    method: Option<Method>,
    /// The daemon's configuration, for everything else
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Magnitudes only: a taxel is in contact above this [default: 0]
    #[arg(long, value_name = "FORCE")]
    threshold: Option<f64>,
    /// Candump only: an interface of the log and the bus of the layout that it is, such as vcan0=can0
    #[arg(long, value_name = "NAME=BUS", value_parser = pair)]
    interface: Vec<(String, String)>,
    /// Writes the force levels of the whole recording here, to be kept constant as profile.codebook
    #[arg(long, value_name = "FILE")]
    learn_codebook: Option<PathBuf>,
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

/// A method by its name in the configuration.
pub(crate) fn method(name: &str) -> Result<Method, String> {
    parse_method(name).ok_or_else(|| format!("there is no method {name:?}; there is {}", methods()))
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let format = OutputFormat::of(&args.out)?;
    if args.out == args.input.path {
        bail!("{}: the output would overwrite the input", args.out.display());
    }
    let input = args.input.open()?;
    let config = args.configure(&input)?;
    config.profile.check()?;
    let mut run = Run {
        output: ImageOutput::create(&args.out, format, &config.layout, &config.profile)?,
        frames: args.learn_codebook.as_ref().map(|_| Vec::new()),
        images: 0,
        calibrating: 0,
        with_contact: 0,
        with_missing: 0,
    };
    match &input {
        Input::Frames(recording) if !recording.has_counts() => {
            args.magnitudes(recording, &config, &mut run)?
        }
        Input::Frames(recording) => {
            let sweeps = Sweeps::new(recording, &config.layout, args.input.tile)?;
            let per_sweep = config.layout.len() as u64;
            let progress = Progress::new(recording.len() as u64 * per_sweep, "frames");
            run.pipeline(&config, sweeps.frames().inspect(|_| progress.advance(1)))?;
        }
        Input::Log(path) => {
            let interfaces = interfaces_of_buses(path, &config.layout, &args.interface)?;
            let open = |name: &String| LogSource::open(path, Some(name), Playback::default());
            let sources = interfaces.iter().map(open).collect::<Result<Vec<_>, _>>()?;
            let progress = Progress::counting("CAN frames");
            let mut bus_frames = BusFrames::new(sources);
            run.pipeline(&config, bus_frames.by_ref().inspect(|_| progress.advance(1)))?;
            bus_frames.check(path)?;
        }
    }
    run.finish(args, &config)
}

impl Args {
    /// The configuration named, or the defaults, for the hand that the recording is of.
    fn configure(&self, input: &Input) -> anyhow::Result<Config> {
        let configured = self.config.as_deref().map(Config::load).transpose()?;
        let named = self.input.named_layout()?;
        let layout = match (named, &configured, input) {
            (Some(layout), _, _) => layout,
            (None, _, Input::Frames(r)) if r.image_shape().is_some() && !r.has_counts() => grid_of(r)?,
            (None, Some(config), _) => config.layout.clone(),
            (None, None, _) => Layout::resolve(DEFAULT_LAYOUT)?,
        };
        let mut config = match configured {
            Some(config) => Config { layout, ..config },
            None => {
                let mut config = Config::new(layout, Vec::new());
                if let Input::Frames(recording) = input {
                    config.tick.mode = TickMode::Sweep;
                    // Recorded frames are all meant; boards that come up are thrown away when live.
                    config.sweep.settle_ms = 0.0;
                    config.sweep.board_period_ms = (recording.period_ns() as f64 / 1e6).clamp(1.0, 10_000.0);
                }
                config
            }
        };
        let profile = &mut config.profile;
        profile.levels = self.levels.unwrap_or(profile.levels);
        profile.actuators = self.actuators.unwrap_or(profile.actuators);
        profile.method = self.method.unwrap_or(profile.method);
        if matches!(input, Input::Log(_)) {
            if let Some(threshold) = self.threshold {
                bail!(
                    "--threshold {threshold} is for magnitudes; CAN traffic has its threshold measured in calibration"
                );
            }
        } else if !self.interface.is_empty() {
            bail!(
                "--interface is for candump logs; {} has no interfaces",
                self.input.path.display()
            );
        }
        Ok(config)
    }

    /// Magnitudes have been through sweep assembly and conditioning, whatever these were.
    fn magnitudes(&self, recording: &Recording, config: &Config, run: &mut Run) -> anyhow::Result<()> {
        let (name, taxels, layout) = (recording.name(), recording.taxels(), &config.layout);
        if self.input.tile {
            bail!("--tile repeats the counts of one module; {name} holds magnitudes");
        }
        if layout.len() != taxels {
            bail!(
                "{name} has {taxels} taxels and layout {} has {}; place them with --layout grid:HxW{}",
                layout.name,
                layout.len(),
                if taxels % 3 == 0 {
                    ", or say with --columns that they are x y z counts"
                } else {
                    ""
                }
            );
        }
        let threshold = self.threshold.unwrap_or(0.0);
        if !(threshold.is_finite() && threshold >= 0.0) {
            bail!("--threshold {threshold} is no force; it is a number from 0 on");
        }
        let mut compressor = Compressor::new(config.profile.clone(), layout)?;
        let mut image = compressor.new_image();
        let mut force = ForceFrame::new(taxels);
        force.threshold = threshold;
        let progress = Progress::new(recording.len() as u64, "frames");
        for index in 0..recording.len() {
            let magnitudes = recording.magnitudes(index).unwrap_or_default();
            force.seq = index as u64;
            force.t_ns = recording.t_ns(index);
            for ((magnitude, force), contact) in
                magnitudes.iter().zip(&mut force.force).zip(&mut force.contact)
            {
                *contact = *magnitude > threshold;
                *force = magnitude.max(0.0);
            }
            compressor.compress(&force, &mut image);
            run.take(&force, &image)?;
            progress.advance(1);
        }
        Ok(())
    }
}

fn grid_of(recording: &Recording) -> anyhow::Result<Layout> {
    let (height, width) = recording.image_shape().unwrap_or_default();
    let too_large = || {
        format!(
            "{}: {height} x {width} is more than an image can be",
            recording.name()
        )
    };
    let width_px = u16::try_from(width).with_context(too_large)?;
    let height_px = u16::try_from(height).with_context(too_large)?;
    Layout::grid(width_px, height_px).with_context(too_large)
}

/// What is made of a recording.
struct Run {
    output: ImageOutput,
    /// Every frame's forces, where a codebook is to be learned.
    frames: Option<Vec<ForceFrame>>,
    images: u64,
    calibrating: u64,
    with_contact: u64,
    /// Images, calibration over, in which a taxel had no value of its time.
    with_missing: u64,
}

impl Run {
    fn pipeline(
        &mut self,
        config: &Config,
        frames: impl Iterator<Item = (u8, Received)>,
    ) -> anyhow::Result<()> {
        let mut failure = None;
        run_recorded(config, frames, None, |_, outputs: &Outputs| {
            if failure.is_none() {
                failure = self.take(&outputs.force, &outputs.image).err();
            }
        })?;
        failure.map_or(Ok(()), Err)
    }

    fn take(&mut self, force: &ForceFrame, image: &taxel_compress::TactileImage) -> anyhow::Result<()> {
        self.images += 1;
        self.calibrating += u64::from(image.calibrating);
        self.with_contact += u64::from(image.contacts > 0);
        self.with_missing += u64::from(image.missing > 0 && !image.calibrating);
        if let Some(frames) = &mut self.frames {
            frames.push(force.clone());
        }
        self.output.push(image)
    }

    fn finish(mut self, args: &Args, config: &Config) -> anyhow::Result<()> {
        self.output.finish()?;
        let Self {
            images,
            calibrating,
            with_contact,
            with_missing,
            ..
        } = self;
        eprintln!(
            "{}: {images} images of {}x{}, {with_contact} with contact{}",
            args.out.display(),
            config.layout.width,
            config.layout.height,
            if calibrating > 0 {
                format!(", {calibrating} while calibrating")
            } else {
                String::new()
            },
        );
        if images == 0 {
            eprintln!("taxel: no image: the recording ends before its first tick or sweep is complete");
        } else if calibrating == images {
            eprintln!(
                "taxel: every image is empty, since the recording ends within the calibration of {} ms; shorten it \
                 with conditioning.calibration_ms in a file for --config",
                config.conditioning.calibration_ms
            );
        } else if with_missing > 0 {
            eprintln!(
                "taxel: taxels are missing in {with_missing} images; if boards send less often than every {} ms, say so \
                 with sweep.board_period_ms in a file for --config",
                config.sweep.board_period_ms
            );
        }
        if let (Some(path), Some(frames)) = (&args.learn_codebook, self.frames) {
            let codebook = learn_codebook(&frames, config.profile.levels);
            if codebook.is_empty() {
                bail!("no codebook: nothing in the recording is in contact");
            }
            let profile = Profile {
                codebook,
                ..config.profile.clone()
            };
            profile.check()?;
            write_codebook(path, args, &profile)?;
            eprintln!("{}: {} levels learned", path.display(), profile.codebook.len());
        }
        Ok(())
    }
}

fn write_codebook(path: &std::path::Path, args: &Args, profile: &Profile) -> anyhow::Result<()> {
    let levels: Vec<String> = profile
        .codebook
        .iter()
        .map(|force| format!("{force:?}"))
        .collect();
    let text = format!(
        "# Force levels learned from {}; put them into the daemon's configuration.\n[profile]\nlevels = {}\n\
         codebook = [{}]\n",
        args.input.path.display(),
        profile.levels,
        levels.join(", "),
    );
    std::fs::write(path, text).with_context(|| path.display().to_string())
}

/// The frames of several recorded buses in the order of their times, as the daemon takes them.
struct BusFrames {
    sources: Vec<LogSource>,
    batches: Vec<Vec<Received>>,
}

impl BusFrames {
    fn new(sources: Vec<LogSource>) -> Self {
        let batches = sources.iter().map(|_| Vec::with_capacity(1)).collect();
        Self { sources, batches }
    }

    /// Whether every source came to its end.
    fn check(&self, path: &std::path::Path) -> anyhow::Result<()> {
        match self.sources.iter().find_map(LogSource::failure) {
            Some(failure) => bail!("{}: {failure}; what came before was compressed", path.display()),
            None => {
                let undecodable: u64 = self
                    .sources
                    .iter()
                    .map(|s| s.counters().undecodable)
                    .max()
                    .unwrap_or(0);
                if undecodable > 0 {
                    eprintln!(
                        "taxel: {}: {undecodable} lines are not classic CAN frames",
                        path.display()
                    );
                }
                Ok(())
            }
        }
    }
}

impl Iterator for BusFrames {
    type Item = (u8, Received);

    fn next(&mut self) -> Option<Self::Item> {
        for (source, batch) in self.sources.iter_mut().zip(&mut self.batches) {
            if batch.is_empty() {
                source.receive(u64::MAX, batch);
            }
        }
        let heads = self
            .batches
            .iter()
            .enumerate()
            .filter_map(|(bus, batch)| Some((batch.first()?.t_ns, bus)));
        let (_, bus) = heads.min()?;
        Some((bus as u8, self.batches[bus].pop()?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn methods_are_known_by_their_names() {
        assert_eq!(method("paper"), Ok(Method::Paper));
        assert!(methods().starts_with("paper"));
        assert!(method("best").unwrap_err().contains("paper"));
    }
}
