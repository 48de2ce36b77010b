//! Recordings as the frames that the daemon would have made of them.

use super::held_to_the_end::HeldToTheEnd;
use super::input::{DEFAULT_LAYOUT, Input, InputArgs, number, pair};
use super::{magnitudes, movement};
use crate::errors::wrong_use;
use crate::offered::offering;
use crate::piped_file::text_parser;
use anyhow::{Context, bail};
use clap::builder::TypedValueParser;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use taxel_can::SourceAddress;
use taxel_engine::TickMode;
use taxel_hand::{Profile, did_you_mean};
use taxel_playback::calibrated::at_the_beginning;
use taxel_playback::daemon_changes::DaemonChanges;
use taxel_playback::log_interfaces::interfaces_of_buses;
use taxel_playback::pipeline::{Emit, Felt, run_counts, run_magnitudes, run_traffic};
use taxel_playback::recorded;
use taxel_playback::scene_input;
use taxel_playback::traffic::Traffic;
use taxel_record::Recording;
use taxel_sim::{Scene, with_stand_in_boards};
use taxel_skin::{BaselineSource, ConditionConfig, Layout, Movement, Preset, ThresholdSource};
use taxeld::Config;

/// Forces that an option may name.
const FORCES: RangeInclusive<f64> = 0.0..=f64::MAX;

/// A recording, and how its frames are conditioned and compressed.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct OfflineArgs {
    #[command(flatten)]
    pub(crate) input: InputArgs,
    /// Force levels of the display, K_D [default: 8, or the configuration's]
    #[arg(long, value_name = "K_D", value_parser = clap::value_parser!(u16).range(1..=255))]
    levels: Option<u16>,
    /// Actuators of the display, K_A [default: 16, or the configuration's]
    #[arg(long, value_name = "K_A", value_parser = clap::value_parser!(u16).range(1..=1024))]
    actuators: Option<u16>,
    /// The daemon's configuration, for everything else; it needs no `[[bus]]` here; - for stdin
    #[arg(long, value_name = "FILE", value_parser = text_parser())]
    config: Option<PathBuf>,
    /// Magnitudes only: a taxel is in contact above this [default: 0]
    #[arg(long, value_name = "FORCE", value_parser = number("force", FORCES))]
    pub(crate) threshold: Option<f64>,
    /// Magnitudes only: a taxel in contact stays in contact down to this, so that one at the
    /// threshold does not flicker [default: the threshold]
    #[arg(long, value_name = "FORCE", value_parser = number("force", FORCES))]
    pub(crate) release: Option<f64>,
    /// Counts only: how they become forces, robust or paper, the publication's equations (1) and (2) [default: the
    /// configuration's, or else that of the method]
    #[arg(long, value_name = "PRESET", value_parser = preset_parser(), hide_possible_values = true)]
    pub(crate) conditioning: Option<Preset>,
    /// Counts only: so much of the beginning is taken for a hand at rest, milliseconds [default: conditioning.calibration_ms
    /// of the configuration, or else 1500]
    #[arg(long, value_name = "MS", value_parser = clap::value_parser!(u64).range(1..=600_000))]
    calibration_ms: Option<u64>,
    /// CAN traffic only: an interface of the recording and the bus of the layout that it is, such as vcan0=can0; the
    /// bus of an Allegro hand is called joints
    #[arg(long, value_name = "NAME=BUS", value_parser = pair)]
    interface: Vec<(String, String)>,
}

/// What a recording holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Held {
    Traffic,
    Counts,
    Magnitudes,
}

impl Held {
    fn of(input: &Input) -> Self {
        match input {
            Input::Log(_) => Self::Traffic,
            Input::Frames(recording) if !recording.has_counts() => Self::Magnitudes,
            Input::Frames(_) | Input::Scene(_) => Self::Counts,
        }
    }
}

const PRESETS: [&str; 2] = ["robust", "paper"];

/// Reads a preset of the conditioning by its name in the configuration.
pub(crate) fn preset_parser() -> impl TypedValueParser<Value = Preset> {
    offering(PRESETS, preset)
}

fn preset(name: &str) -> Result<Preset, String> {
    serde_json::from_value(name.into()).map_err(|_| {
        let meant = did_you_mean(name, PRESETS);
        format!("there is no conditioning {name:?}{meant}; there is robust or paper")
    })
}

impl OfflineArgs {
    /// The files that are read, as they were named.
    pub(crate) fn inputs(&self) -> Vec<&Path> {
        let layout = self.input.layout.as_deref().map(Path::new);
        let recording = Some(self.input.path.as_path());
        [recording, self.config.as_deref(), layout]
            .into_iter()
            .flatten()
            .collect()
    }

    /// The configuration named, or that of the recording.
    fn configured(&self) -> anyhow::Result<Option<Config>> {
        match (&self.config, self.input.head()?) {
            (Some(path), _) => Ok(Some(Config::load_for_recordings(path)?)),
            (None, Some(head)) => head.config(),
            (None, None) => Ok(None),
        }
    }

    /// The display of the configuration named, or of the defaults, with what is said of it here.
    pub(crate) fn profile(&self) -> anyhow::Result<Profile> {
        let profile = self.configured()?.map(|config| config.profile);
        Ok(self.fitted(profile.unwrap_or_default()))
    }

    fn fitted(&self, profile: Profile) -> Profile {
        Profile {
            levels: self.levels.unwrap_or(profile.levels),
            actuators: self.actuators.unwrap_or(profile.actuators),
            ..profile
        }
    }

    /// The configuration named, or the defaults, for the hand that plays a scene: simulated boards stand in where it has
    /// none.
    pub(crate) fn configure_scene(&self, scene: &Scene) -> anyhow::Result<Config> {
        self.configure_hand(with_stand_in_boards(&self.hand(scene.layout())?)?)
    }

    /// The hand of the configuration named, if one is.
    pub(crate) fn configured_layout(&self) -> anyhow::Result<Option<Layout>> {
        Ok(self.configured()?.map(|config| config.layout))
    }

    /// Opens the recording.
    pub(crate) fn open(&self) -> anyhow::Result<Input> {
        self.input.open_of(|| self.hand(DEFAULT_LAYOUT))
    }

    /// Opens the recording for all that its hand felt. Of an .mcap of boards beside a pressure array, whose messages are on no
    /// bus, that is in the frames of its daemon, and not in its CAN traffic.
    pub(crate) fn open_whole(&self) -> anyhow::Result<Input> {
        let input = self.open()?;
        let path = match &input {
            Input::Log(traffic) if !traffic.is_candump() => traffic.path(),
            _ => return Ok(input),
        };
        let hand = self.hand(DEFAULT_LAYOUT)?;
        let array = (0..hand.buses.len()).find(|bus| hand.array_on(*bus).is_some());
        let Some((array, frames)) = array.zip(recorded::frames(path).ok()) else {
            return Ok(input);
        };
        remark!(
            "taxel: {}: bus {} is a pressure array, whose messages are not in its CAN traffic; its frames are read",
            path.display(),
            hand.buses[array]
        );
        Ok(Input::Frames(frames))
    }

    /// The hand that the recording is of ([`InputArgs::hand`]).
    pub(crate) fn hand(&self, default: &str) -> anyhow::Result<Layout> {
        self.input.hand(self.configured()?.as_ref(), default)
    }

    /// The configuration named, or the defaults, for this hand.
    pub(crate) fn configure_hand(&self, layout: Layout) -> anyhow::Result<Config> {
        let configured = self.configured()?;
        let mut config = match configured {
            Some(config) => Config { layout, ..config },
            None => Config::new(layout, Vec::new()),
        };
        self.fit_display(&mut config);
        Ok(config)
    }

    fn fit_display(&self, config: &mut Config) {
        config.profile = self.fitted(std::mem::take(&mut config.profile));
        let stated = &mut config.stated_conditioning.calibration_ms;
        *stated = self.calibration_ms.or(*stated);
        config.set_method(config.profile.method, self.conditioning);
    }

    /// The configuration named, or the defaults, for the hand that the recording is of.
    pub(crate) fn configure(&self, input: &Input) -> anyhow::Result<Config> {
        let configured = self.configured()?;
        let is_placed = self.input.layout.is_some() && !self.input.is_grid();
        let layout = match input {
            Input::Frames(recording) if recording.image_shape().is_some() && !is_placed => {
                grid_of(recording)?
            }
            Input::Scene(scene) => {
                with_stand_in_boards(&self.input.hand(configured.as_ref(), scene.layout())?)?
            }
            _ => self.input.hand(configured.as_ref(), DEFAULT_LAYOUT)?,
        };
        let mut config = match configured {
            Some(config) => Config { layout, ..config },
            None => {
                let mut config = Config::new(layout, Vec::new());
                if let Input::Frames(recording) = input
                    && !config.layout.buses.is_empty()
                {
                    // A frame for each that was recorded.
                    config.tick.mode = TickMode::Sweep;
                    let period_ms = recording.period_ns() as f64 / 1e6;
                    config.sweep.board_period_ms = Some(period_ms.clamp(1.0, 10_000.0));
                }
                config
            }
        };
        self.fit_display(&mut config);
        self.refuse_beside(Held::of(input))?;
        Ok(config)
    }

    /// Refuses options that say nothing about a recording that holds this.
    pub(crate) fn refuse_beside(&self, held: Held) -> anyhow::Result<()> {
        if let Some(threshold) = self.threshold.filter(|_| held != Held::Magnitudes) {
            bail!(
                "--threshold {threshold} is for magnitudes; counts have their threshold measured in calibration"
            );
        }
        let of_counts = [
            (self.conditioning.is_some(), "--conditioning"),
            (self.calibration_ms.is_some(), "--calibration-ms"),
        ];
        if let Some((_, option)) = of_counts
            .iter()
            .find(|(given, _)| *given && held == Held::Magnitudes)
        {
            bail!(
                "{option} is for counts; {} holds magnitudes, which are forces already",
                self.input.path.display()
            );
        }
        if let Some(release) = self.release.filter(|_| held != Held::Magnitudes) {
            bail!(
                "--release {release} is for magnitudes; counts have conditioning.threshold_release in a file for --config"
            );
        }
        if held != Held::Traffic && !self.interface.is_empty() {
            bail!(
                "--interface is for CAN traffic; {} has no interfaces",
                self.input.path.display()
            );
        }
        Ok(())
    }

    /// Refuses options of a display, and with `as_it_is` those of conditioning, where `what` has neither.
    pub(crate) fn refuse_profile(&self, what: &str, as_it_is: bool) -> anyhow::Result<()> {
        let given = [
            (self.levels.is_some(), "--levels"),
            (self.actuators.is_some(), "--actuators"),
            (as_it_is && self.threshold.is_some(), "--threshold"),
            (as_it_is && self.release.is_some(), "--release"),
            (as_it_is && self.conditioning.is_some(), "--conditioning"),
            (as_it_is && self.calibration_ms.is_some(), "--calibration-ms"),
        ];
        match given.into_iter().find(|(is_given, _)| *is_given) {
            Some((_, option)) => bail!("{what}: {option} says nothing about it; leave it out"),
            None => Ok(()),
        }
    }

    /// What the joints of the recording are called, in the order of their angles: by the configuration or the scene; in an
    /// array of frames, which has no names, by their numbers.
    pub(crate) fn joint_names(&self, input: &Input, config: &Config) -> Vec<String> {
        match (input, &config.joints) {
            (Input::Scene(scene), _) => scene_input::joint_names(scene, config),
            (Input::Frames(recording), joints) => {
                let count = recording.joints(0).len();
                let named = joints.as_ref().map(|joints| joints.joint_names());
                let named = named.filter(|names| names.len() == count);
                named.unwrap_or_else(|| (0..count).map(|joint| format!("joint {joint}")).collect())
            }
            (Input::Log(_), joints) => joints.as_ref().map_or(Vec::new(), |joints| joints.joint_names()),
        }
    }

    /// Takes the recording through the daemon's pipeline, or magnitudes as they are, and shows what the skin feels.
    pub(crate) fn run(&self, input: &Input, config: &Config, emit: &mut Emit<'_>) -> anyhow::Result<()> {
        let mut engine = config.engine(false)?;
        let head = self.input.head()?;
        if let Some(head) = head {
            engine.calibrated = at_the_beginning(head, config)?;
        }
        let changes = head.map(|head| DaemonChanges::new(head, config)).transpose()?;
        let mut held = HeldToTheEnd::default();
        let (mut moved, mut threshold) = (Movement::None, 0.0);
        let mut emit_held = |felt: &Felt<'_>| {
            held.take(felt.force);
            if let Some(measured) = felt.measured.filter(|measured| measured.moved > moved) {
                (moved, threshold) = (measured.moved, felt.force.threshold);
            }
            emit(felt)
        };
        match input {
            Input::Frames(recording) if !recording.has_counts() => {
                return self.magnitudes(recording, config, emit);
            }
            Input::Scene(scene) => return scene_input::run(scene, config, emit),
            Input::Frames(recording) => {
                let changes = changes.zip(head).map(|(changes, head)| changes.of_frames(head));
                let changes = changes.transpose()?.unwrap_or_default();
                run_counts(recording, &engine, changes, self.input.tile, &mut emit_held)?;
            }
            Input::Log(traffic) => {
                let (joints, skin): (Vec<_>, Vec<_>) = self
                    .interface
                    .iter()
                    .cloned()
                    .partition(|(_, bus)| bus == JOINTS_BUS);
                let joints = interface_of_joints(traffic, config, &joints)?;
                let mut interfaces = interfaces_of_buses(traffic, config, &skin, joints.as_deref())?;
                interfaces.extend(joints);
                run_traffic(traffic, &interfaces, &engine, changes, &mut emit_held)?;
            }
        }
        if let Some(told) = movement::told(moved, threshold, config) {
            remark!("taxel: {}: {told}", self.input.name());
        }
        held.say(&self.input.name());
        Ok(())
    }

    /// Magnitudes have been through sweep assembly and conditioning, whatever these were.
    fn magnitudes(&self, recording: &Recording, config: &Config, emit: &mut Emit<'_>) -> anyhow::Result<()> {
        let (name, taxels, layout) = (recording.name(), recording.taxels(), &config.layout);
        if self.input.tile {
            bail!("--tile repeats the counts of one module; {name} holds magnitudes");
        }
        if layout.len() != taxels {
            return Err(magnitudes::of_another_size(recording, layout, &self.input));
        }
        let threshold = self.threshold.unwrap_or(0.0);
        let release = self.release.unwrap_or(threshold);
        if release > threshold {
            return Err(wrong_use(format!(
                "--release {release} is not within 0 and --threshold {threshold}"
            )));
        }
        magnitudes::tell(recording, threshold, self.input.idles());
        run_magnitudes(recording, [threshold, release], emit)
    }
}

/// Why nothing is in contact in counts that are all of a hand that is still calibrated, and what helps.
pub(crate) fn ends_within_calibration(conditioning: &ConditionConfig) -> String {
    let sources = (conditioning.baseline, conditioning.threshold);
    if sources == (BaselineSource::FirstFrame, ThresholdSource::FirstPair) {
        return "the recording ends with the two frames that calibration takes".into();
    }
    let window_ms = conditioning.calibration_ms;
    format!("the recording ends within the calibration of {window_ms} ms; shorten it with --calibration-ms")
}

/// What `--interface` calls the bus that joint angles come over.
const JOINTS_BUS: &str = "joints";

/// The interface of a log that joints were recorded on, where the configuration gives them a bus of
/// their own.
fn interface_of_joints(
    traffic: &Traffic,
    config: &Config,
    pairs: &[(String, String)],
) -> anyhow::Result<Option<String>> {
    let path = traffic.path();
    let source = config.joints.as_ref().map(|joints| joints.source.config());
    let own = config.joints_bus().filter(|bus| !bus.shared);
    let (Some(source), Some(bus)) = (source, own.map(|own| own.address)) else {
        if let Some((interface, _)) = pairs.first() {
            bail!(
                "--interface {interface}={JOINTS_BUS}: the configuration (--config) has no [joints] with an Allegro hand on a bus of its own"
            );
        }
        if let Some(source) = source.filter(|source| source.serial_device().is_some()) {
            remark!(
                "taxel: {}: {} on a serial port are not in a CAN recording; its images carry no joint angles",
                path.display(),
                source.device()
            );
        }
        return Ok(None);
    };
    let named = match (pairs.first(), &bus) {
        (Some((interface, _)), _) => Some(interface.clone()),
        (None, SourceAddress::Can { interface }) => Some(interface.clone()),
        (None, SourceAddress::Log { interface, .. }) => interface.clone(),
        _ => None,
    };
    let present = traffic.interfaces()?;
    match named.as_ref().filter(|named| present.contains(named)) {
        Some(_) => {}
        None if !pairs.is_empty() => bail!(
            "{}: no frame on interface {}; it has {}",
            path.display(),
            pairs[0].0,
            present.join(", ")
        ),
        None => remark!(
            "taxel: {}: nothing of the {} on {bus}; its angles will be unknown. --interface NAME={JOINTS_BUS} says where it is among {}",
            path.display(),
            source.device(),
            present.join(", ")
        ),
    }
    // A name that no interface has: the bus stays silent.
    Ok(Some(named.unwrap_or_else(|| JOINTS_BUS.into())))
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
    let is_taxel = |cell: usize| recording.cells().is_none_or(|cells| cells[cell]);
    Layout::grid_of_cells(width_px, height_px, is_taxel).with_context(too_large)
}
