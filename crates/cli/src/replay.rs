//! `taxel replay`: a recording back onto a bus.

use crate::errors::wrong_use;
use crate::piped_file::text_parser;
use crate::recordings::input::{DEFAULT_LAYOUT, Input, InputArgs, TIMES_S, number, pair};
use crate::recordings::tell_joints;
use anyhow::{anyhow, bail};
use std::ops::Range;
use std::path::{Path, PathBuf};
use taxel_can::SourceAddress;
use taxel_hand::shell_word;
use taxel_playback::array_frames::{ARRAY_LAYOUT, ArrayFrames, is_of_arrays};
use taxel_playback::output_file::refuse_overlap;
use taxel_playback::player::{LEAST_SPEED, Played, Player};
use taxel_playback::sweep::Sweeps;
use taxel_playback::target::{TargetAddress, Targets, refuse_shared_ids};
use taxel_record::Recording;
use taxeld::Config;
use taxeld::stdout;

/// Put a recording back onto a bus, at the times at which it was recorded.
///
/// A candump log, or the raw CAN of an .mcap, is sent frame by frame; error frames and lines that hold no classic frame are
/// counted and left out. Counts (.npy, .npz, .csv) become what the boards of the hand would have
/// sent: one sweep of CAN frames per recorded frame, on each of the layout's buses. Images or counts for a pressure array
/// (.npy, .npz) become its messages.
///
/// Each frame has its own deadline from the start on, so that delays do not add up.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  taxel replay grasp.log --to can:vcan0
  taxel replay grasp.log --interface can0=udp::43113 --interface can1=udp::43114 --speed 2 --loop
  taxel replay module.npz --array LOG7 --columns xyz-interleaved --tile --interface can0=can:vcan0 \\
      --interface can1=can:vcan1
  taxel replay module.npz --array LOG7 --columns xyz-interleaved --layout uskin-module --to -
  taxel replay touch.npy --rate 10 --to pressure:/run/taxeld/touch.sock      T x 28 x 50
  taxel replay grasp.log --to log:part.log --start 12 --end 15      cut a piece out")]
pub(crate) struct Args {
    #[command(flatten)]
    input: InputArgs,
    /// The configuration of the daemon that read the hand, for its layout; - for stdin
    #[arg(long, value_name = "FILE", value_parser = text_parser())]
    config: Option<PathBuf>,
    /// Where to: can:INTERFACE, udp:GROUP:PORT, pressure:SOCKET (a pressure array's), log:FILE (candump, not waited
    /// for), or - for candump lines on stdout
    #[arg(long, value_name = "SOURCE")]
    to: Option<TargetAddress>,
    /// Where to for one interface of the recording, or one bus of the layout; --to is for the others
    #[arg(long, value_name = "NAME=SOURCE", value_parser = pair)]
    interface: Vec<(String, String)>,
    /// How fast: 2 is twice as fast, inf does not wait
    #[arg(long, value_name = "X", value_parser = speed, default_value_t = 1.0)]
    speed: f64,
    /// Again and again, until Ctrl-C
    #[arg(long = "loop")]
    looping: bool,
    /// Begin this far into the recording, seconds
    #[arg(long, value_name = "S", value_parser = number("time in a recording, seconds", TIMES_S), default_value_t = 0.0)]
    start: f64,
    /// End this far into the recording, seconds
    #[arg(long, value_name = "S", value_parser = number("time in a recording, seconds", TIMES_S))]
    end: Option<f64>,
    /// One JSON object: {"frames", "left_out", "passes", "seconds", "late_ms"}
    #[arg(long)]
    json: bool,
}

fn speed(text: &str) -> Result<f64, String> {
    let speed = text.parse().ok().filter(|speed| *speed >= LEAST_SPEED);
    speed.ok_or_else(|| {
        format!(
            "{text} is no speed; 1 is as recorded, {LEAST_SPEED} the least, inf as fast as the bus takes it"
        )
    })
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let is_stdout = |to: &TargetAddress| *to == TargetAddress::Stdout;
    if args.json && args.targets().any(|to| is_stdout(&to)) {
        return Err(wrong_use(
            "--json: the frames are on stdout; put them elsewhere, or leave it out",
        ));
    }
    let played = play(args)?;
    if args.json {
        stdout::print(&(serde_json::to_string(&played)? + "\n"))?;
    }
    Ok(())
}

fn play(args: &Args) -> anyhow::Result<Played> {
    let window = args.window()?;
    match args.input.open()? {
        Input::Log(traffic) => {
            // All to one place: it need not be known before which there are.
            if let (Some(to), true) = (&args.to, args.interface.is_empty()) {
                refuse_overlap(&logs([to]), &[traffic.path()])?;
                let player = args.player(window, Targets::open_one(to)?)?;
                return player.play_traffic(&traffic, None);
            }
            let names = traffic.interfaces()?;
            let named = args.route(&names, "interface of the recording")?;
            let player = args.player(window, args.open(&named, traffic.path())?)?;
            player.play_traffic(&traffic, Some(&names))
        }
        Input::Scene(scene) => bail!(
            "sim:{} is a scene, not a recording; `taxel sim {} --to SOURCE` plays it",
            scene.name(),
            shell_word(scene.name())
        ),
        Input::Frames(recording) => {
            tell_joints(&recording);
            play_frames(args, window, &recording)
        }
    }
}

/// Plays frames as the boards, or the pressure arrays, of a hand.
fn play_frames(args: &Args, window: Range<u64>, recording: &Recording) -> anyhow::Result<Played> {
    let default = match args.goes_to_an_array() {
        true => ARRAY_LAYOUT,
        false => DEFAULT_LAYOUT,
    };
    let configured = args
        .config
        .as_deref()
        .map(Config::load_for_recordings)
        .transpose()?;
    let layout = args.input.hand(configured.as_ref(), default)?;
    let named = || args.route(&layout.buses, "bus of the layout");
    if is_of_arrays(&layout) {
        args.input.refuse_tile_of_arrays(&layout)?;
        let frames = ArrayFrames::new(recording, &layout)?;
        let targets = args.open(&named()?, &args.input.path)?;
        return args.player(window, targets)?.play_arrays(&frames);
    }
    let sweeps = Sweeps::new(recording, &layout, args.input.tile)?;
    let named = named()?;
    if let Some((bus, target)) = named.iter().find(|(_, target)| is_array(target)) {
        bail!(
            "{target} takes the frames of an array, and {bus} of layout {} has boards",
            layout.name
        );
    }
    refuse_shared_ids(&named, &layout)?;
    let targets = args.open(&named, &args.input.path)?;
    args.player(window, targets)?.play_sweeps(&sweeps)
}

fn is_array(target: &TargetAddress) -> bool {
    matches!(target, TargetAddress::Bus(SourceAddress::Pressure { .. }))
}

impl Args {
    /// The part of the recording to play, nanoseconds from its beginning.
    fn window(&self) -> anyhow::Result<Range<u64>> {
        let nanoseconds = |seconds: f64| (seconds * 1e9).round() as u64;
        let start = nanoseconds(self.start);
        let end = self.end.map_or(u64::MAX, nanoseconds);
        if end <= start {
            return Err(wrong_use(format!(
                "--end {} is not after --start {}",
                self.end.unwrap_or_default(),
                self.start
            )));
        }
        Ok(start..end)
    }

    fn player(&self, window: Range<u64>, targets: Targets) -> anyhow::Result<Player> {
        Player::new(self.speed, self.looping, window, targets)
    }

    /// Opens where each name goes, none of it the recording itself.
    fn open(&self, named: &[(String, TargetAddress)], recording: &Path) -> anyhow::Result<Targets> {
        refuse_overlap(&logs(named.iter().map(|(_, target)| target)), &[recording])?;
        Targets::open(named)
    }

    /// Where any of it is to go.
    fn targets(&self) -> impl Iterator<Item = TargetAddress> + '_ {
        let named = self
            .interface
            .iter()
            .filter_map(|(_, target)| target.parse().ok());
        named.chain(self.to.clone())
    }

    /// Whether any of it is to go to a pressure array.
    fn goes_to_an_array(&self) -> bool {
        self.targets().any(|target| is_array(&target))
    }

    /// Where each of the names goes.
    fn route(&self, names: &[String], what: &str) -> anyhow::Result<Vec<(String, TargetAddress)>> {
        if let Some((name, _)) = self.interface.iter().find(|(name, _)| !names.contains(name)) {
            bail!(
                "--interface {name}: there is no {what} of that name; there is {}",
                names.join(", ")
            );
        }
        let target = |name: &String| {
            let own = self
                .interface
                .iter()
                .find(|(n, _)| n == name)
                .map(|(_, target)| target);
            match (own, &self.to) {
                (Some(target), _) => target.parse().map_err(|e: String| anyhow!(e)),
                (None, Some(to)) => Ok(to.clone()),
                (None, None) => bail!("nowhere to send {name}; say --to SOURCE or --interface {name}=SOURCE"),
            }
        };
        names
            .iter()
            .map(|name| Ok((name.clone(), target(name)?)))
            .collect()
    }
}

/// The logs that are written, each once.
fn logs<'a>(targets: impl IntoIterator<Item = &'a TargetAddress>) -> Vec<&'a Path> {
    let mut logs: Vec<&Path> = Vec::new();
    for target in targets {
        if let TargetAddress::Log(path) = target
            && !logs.contains(&path.as_path())
        {
            logs.push(path);
        }
    }
    logs
}
