//! INPUT: any recording the tool knows, and what to say about it where the file does not.

use super::{assumed, boards, implausible_times};
use crate::piped_file::{layout_parser, recording_parser};
use anyhow::{Context, bail};
use std::cell::OnceCell;
use std::ops::RangeInclusive;
use std::path::PathBuf;
use taxel_hand::plural;
use taxel_playback::head::Head;
use taxel_playback::recorded;
use taxel_playback::stand_in;
use taxel_playback::traffic::Traffic;
use taxel_record::{Columns, FileKind, RATES_HZ, ReadOptions, RecordError, Recording, TimeUnit, Void};
use taxel_sim::Scene;
use taxel_skin::Layout;
use taxeld::Config;

/// The hand that is meant where no other is named.
pub(crate) const DEFAULT_LAYOUT: &str = "allegro-uskin-15";

/// A recording, and what to say about it where the file does not.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct InputArgs {
    /// The recording: candump .log; .mcap as `taxel record` writes it; .csv, .npy, .npz of T x H x W or T x N magnitudes, or
    /// of T x N x 3 or T x H x W x 3 counts (a taxel without a value: not a number, in a .csv empty cells; of magnitudes with
    /// --void nan); or a scene, sim:SCENE; - for a recording on stdin
    #[arg(value_name = "INPUT", value_parser = recording_parser())]
    pub(crate) path: PathBuf,
    /// Which array of an .npz
    #[arg(long, value_name = "NAME")]
    array: Option<String>,
    /// The columns of a T x 3N array are raw counts, in this order: xyz-interleaved
    /// (x1,y1,z1,x2,..) or xyz-blocks (x1,x2,..,y1,..,z1,..)
    #[arg(long, value_name = "ORDER")]
    columns: Option<Columns>,
    /// So many of the last columns of a .csv that does not name them are joint angles, radians: 16 with
    /// --columns xyz-interleaved for rows of 240 readings x y z and 16 angles
    #[arg(long, value_name = "N", default_value_t = 0)]
    joint_columns: usize,
    /// Frames per second, in place of the times in the file [default: its times; 30 where there are none]
    #[arg(long, value_name = "HZ", value_parser = number("rate of frames", RATES_HZ))]
    rate: Option<f64>,
    /// The first column of a .csv, or the one that its header calls time, is in this unit: s, ms, us or ns; needed where no
    /// header calls it t_s, t_ms, t_us or t_ns
    #[arg(long, value_name = "UNIT")]
    time_column: Option<TimeUnit>,
    /// Places the taxels: a built-in hand (allegro-uskin-15, uskin-module), grid:HxW, or a layout file, - for stdin
    #[arg(long, value_name = "LAYOUT", value_parser = layout_parser())]
    pub(crate) layout: Option<String>,
    /// Cells of magnitudes that are no taxels: nan, where they are not a number in any frame (a taxel that is not a number
    /// now and then is missing there), or an array of the .npz of a frame's shape that is not zero there
    #[arg(long, value_name = "nan|NAME")]
    void: Option<Void>,
    /// Magnitudes only: nothing is touched in so many of the first frames, and forces are above each taxel's median there
    #[arg(long, value_name = "FRAMES")]
    idle: Option<usize>,
    /// Repeats the recording of one module on every module of the hand
    #[arg(long)]
    pub(crate) tile: bool,
    /// What the beginning of an .mcap tells, once it was looked at.
    #[arg(skip)]
    head: OnceCell<Head>,
}

/// A recording, opened.
#[derive(Debug)]
pub(crate) enum Input {
    /// CAN traffic.
    Log(Traffic),
    /// Tactile frames.
    Frames(Recording),
    /// What a simulated hand goes through.
    Scene(Box<Scene>),
}

impl Input {
    /// Height and width of its frames, where they are images.
    pub(crate) fn image_shape(&self) -> Option<(usize, usize)> {
        match self {
            Self::Frames(recording) => recording.image_shape(),
            Self::Log(_) | Self::Scene(_) => None,
        }
    }
}

impl InputArgs {
    /// Opens the recording.
    pub(crate) fn open(&self) -> anyhow::Result<Input> {
        self.open_of(|| self.hand(None, DEFAULT_LAYOUT))
    }

    /// Opens the recording of this hand.
    pub(crate) fn open_of(&self, hand: impl FnOnce() -> anyhow::Result<Layout>) -> anyhow::Result<Input> {
        if let Some(scene) = self.scene() {
            self.refuse_file_options(&format!("sim:{scene}"))?;
            return Ok(Input::Scene(Box::new(Scene::resolve(&scene)?)));
        }
        let path = &self.path;
        if FileKind::of(path) == Some(FileKind::Log) {
            self.refuse_file_options(&format!("{}, a candump log", path.display()))?;
            return Ok(Input::Log(Traffic::candump(path)));
        }
        if self.is_mcap() {
            self.refuse_file_options(&format!("{}, a recording", path.display()))?;
        }
        if let Some(head) = self.head()? {
            if let Some(why) = &head.unread_can {
                bail!("{}: nothing of it could be read: {why}", path.display());
            }
            return Ok(match head.has_can {
                true => Input::Log(Traffic::mcap(path)),
                false => Input::Frames(recorded::frames(path)?),
            });
        }
        let of_csv = [
            (self.joint_columns > 0, "--joint-columns"),
            (self.time_column.is_some(), "--time-column"),
        ];
        if let Some((_, option)) = of_csv.iter().find(|(given, _)| *given && !self.is_csv()) {
            bail!(
                "{}: {option} is of the columns of a .csv; leave it out",
                path.display()
            );
        }
        let options = ReadOptions {
            array: self.array.clone(),
            columns: self.columns,
            rate_hz: self.rate,
            time_column: self.time_column,
            joint_columns: self.joint_columns,
            image: self.grid()?,
            void: self.void.clone(),
            idle_frames: self.idle,
        };
        let mut recording = match Recording::open(&self.path, &options) {
            Ok(recording) => recording,
            Err(error) => return Err(self.advised(error, hand)),
        };
        let name = recording.name().to_owned();
        if let Some(sentence) = boards::place(&mut recording, hand)? {
            remark!("taxel: {name}: {sentence}");
        }
        let of_times = assumed::of_times(&recording, &options, "--time-column UNIT says otherwise");
        let of_steps = assumed::of_steps(&recording);
        let clock = implausible_times::told(&recording);
        let sentences = assumed::of_columns(&recording).chain(of_times);
        for sentence in sentences.chain(of_steps).chain(clock) {
            remark!("taxel: {name}: {sentence}");
        }
        tell_large_angle(&recording);
        Ok(Input::Frames(recording))
    }

    /// Says of cells that are not a number what they may be: of a taxel without counts, or without a magnitude.
    fn advised(&self, error: RecordError, hand: impl FnOnce() -> anyhow::Result<Layout>) -> anyhow::Error {
        let RecordError::NotFinite {
            value,
            cells,
            empty_at_end,
            ..
        } = error
        else {
            return error.into();
        };
        if !value.is_nan() {
            return anyhow::anyhow!(
                "{error}. Where it stands for none, write NaN instead (in a .csv an empty cell): with --void nan the taxel is \
                 then missing"
            );
        }
        let void = "with --void nan the taxel is missing in that frame, and cells that are NaN in all frames are no taxels";
        let Some(hand) = hand().ok().filter(|_| self.is_csv()) else {
            return anyhow::anyhow!("{error}; {void}");
        };
        let mut readings = vec![(cells, "")];
        if empty_at_end > 0 {
            readings.push((cells + 1, "with one behind the last separator, "));
        }
        // A taxel without counts is three of them.
        if !empty_at_end.is_multiple_of(3) {
            readings.reverse();
        }
        let counts = readings.into_iter().filter_map(|(columns, how)| {
            let counts = self.counts_of(columns, hand.len())?;
            Some(format!("{how}of these {columns} columns {counts}"))
        });
        let counts: Vec<String> = counts.collect();
        match counts[..] {
            [] => anyhow::anyhow!("{error}; {void}"),
            _ => anyhow::anyhow!("{error}; {}; {void}", counts.join("; or, ")),
        }
    }

    /// What says of so many columns, beside those that were named already, that they are the counts of a hand, and in a .csv its
    /// joint angles; none where they cannot be.
    pub(super) fn counts_of(&self, columns: usize, taxels: usize) -> Option<String> {
        let more = columns.checked_sub(3 * taxels)?;
        let [are_timed, is_csv] = [self.time_column.is_some(), self.is_csv()];
        match more + self.joint_columns {
            _ if more == 0 => {
                Some("say with --columns xyz-interleaved or xyz-blocks that they are x y z counts".into())
            }
            joints @ 1..=64 if are_timed => Some(format!(
                "say with --columns xyz-interleaved --joint-columns {joints} that they are x y z counts and, at the end, {}; what \
                 is neither is to be cut out",
                plural(joints, "joint angle")
            )),
            1 if is_csv => Some(
                "say with --columns xyz-interleaved --time-column UNIT that the first is time and the others x y z counts, or with \
                 --joint-columns 1 in place of --time-column that the last is a joint angle"
                    .into(),
            ),
            joints @ 1..=64 if is_csv => Some(format!(
                "say with --columns xyz-interleaved --joint-columns {joints} that they are x y z counts and {joints} joint \
                 angles, or {} where the first column is time, --time-column UNIT",
                joints - 1
            )),
            _ => None,
        }
    }

    /// Whether it is a table, whose last columns can be joint angles.
    fn is_csv(&self) -> bool {
        FileKind::of(&self.path) == Some(FileKind::Csv)
    }

    /// Whether its magnitudes are above the level at which their taxel idles.
    pub(crate) fn idles(&self) -> bool {
        self.idle.is_some()
    }

    /// Whether it is a recording of `taxel record`, which knows its own hand and configuration.
    pub(crate) fn is_mcap(&self) -> bool {
        FileKind::of(&self.path) == Some(FileKind::Mcap)
    }

    /// The name of the scene, where one is named.
    pub(crate) fn scene(&self) -> Option<String> {
        let path = self.path.to_str()?;
        path.strip_prefix("sim:").map(str::to_owned)
    }

    /// The array named, if one is.
    pub(crate) fn array(&self) -> Option<&str> {
        self.array.as_deref()
    }

    /// The recording's name, with that of the array.
    pub(crate) fn name(&self) -> String {
        let name = stand_in::as_named(self.path.display().to_string());
        match &self.array {
            Some(array) => format!("{name} [{array}]"),
            None => name,
        }
    }

    /// Refuses options that say something about a file, where there is none: `what` is a scene.
    pub(crate) fn refuse_file_options(&self, what: &str) -> anyhow::Result<()> {
        self.refuse_file_options_but("", what)
    }

    /// The same, where one option does say something.
    pub(crate) fn refuse_file_options_but(&self, known: &str, what: &str) -> anyhow::Result<()> {
        let mut given = self.file_options().into_iter().filter(|(given, _)| *given);
        match given.find(|(_, option)| *option != known) {
            Some((_, option)) => bail!("{what}: {option} says nothing about it; leave it out"),
            None => Ok(()),
        }
    }

    /// Refuses to repeat a module, where the hand has pressure arrays.
    pub(crate) fn refuse_tile_of_arrays(&self, layout: &Layout) -> anyhow::Result<()> {
        if self.tile {
            bail!(
                "--tile repeats a module of boards; layout {} has arrays",
                layout.name
            );
        }
        Ok(())
    }

    /// Options that describe a file of frames, and whether each is given.
    fn file_options(&self) -> [(bool, &'static str); 8] {
        [
            (self.array.is_some(), "--array"),
            (self.columns.is_some(), "--columns"),
            (self.joint_columns > 0, "--joint-columns"),
            (self.rate.is_some(), "--rate"),
            (self.time_column.is_some(), "--time-column"),
            (self.void.is_some(), "--void"),
            (self.idle.is_some(), "--idle"),
            (self.tile, "--tile"),
        ]
    }

    /// Height and width of the grid that the layout is, if it is one.
    fn grid(&self) -> anyhow::Result<Option<(usize, usize)>> {
        let layout = if self.is_grid() {
            self.named_layout()?
        } else {
            None
        };
        Ok(layout.map(|layout| (layout.height.into(), layout.width.into())))
    }

    /// The hand that the recording is of: the layout named, or that of the configuration, or that of an .mcap's daemon, or
    /// this one, where nothing says any.
    ///
    /// # Errors
    /// Where an .mcap is of a hand that is not here.
    pub(crate) fn hand(&self, configured: Option<&Config>, default: &str) -> anyhow::Result<Layout> {
        if let Some(layout) = self.named_layout()? {
            return Ok(layout);
        }
        if let Some(config) = configured {
            return Ok(config.layout.clone());
        }
        let recorded = self.head()?.map(Head::layout).transpose()?.flatten();
        Ok(recorded.map_or_else(|| Layout::resolve(default), Ok)?)
    }

    /// What the beginning of an .mcap tells; `None` of any other recording.
    pub(crate) fn head(&self) -> anyhow::Result<Option<&Head>> {
        if self.is_mcap() && self.head.get().is_none() {
            let _ = self.head.set(Head::read(&self.path)?);
        }
        Ok(self.head.get())
    }

    /// Whether the layout named is a plain grid.
    pub(crate) fn is_grid(&self) -> bool {
        self.layout.as_ref().is_some_and(|name| name.starts_with("grid:"))
    }

    /// The layout named, if one is.
    pub(crate) fn named_layout(&self) -> anyhow::Result<Option<Layout>> {
        self.layout
            .as_deref()
            .map(Layout::resolve)
            .transpose()
            .context("--layout")
    }
}

/// Says that joint angles cannot be radians.
fn tell_large_angle(recording: &Recording) {
    let angle = (0..recording.len()).flat_map(|index| recording.joints(index).iter().enumerate());
    if let Some((joint, angle)) = angle.into_iter().find(|(_, angle)| angle.abs() > LARGEST_ANGLE) {
        remark!(
            "taxel: {}: the angle of joint {joint} is {angle}; angles are radians",
            recording.name()
        );
    }
}

/// What no joint of a hand turns by, radians: two turns.
const LARGEST_ANGLE: f32 = 4.0 * std::f32::consts::PI;

/// Times in a recording that an option may name, seconds.
pub(crate) const TIMES_S: RangeInclusive<f64> = 0.0..=1e9;

/// Reads an option's number, which is `what`, within `range`.
pub(crate) fn number(
    what: &'static str,
    range: RangeInclusive<f64>,
) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync {
    move |text| {
        let number = text.trim().parse().ok().filter(|number| range.contains(number));
        number.ok_or_else(|| match range.clone().into_inner() {
            (least, f64::MAX) => format!("{text} is no {what}; it is a number from {least} on"),
            (least, most) => format!("{text} is no {what}; it is a number from {least} to {most}"),
        })
    }
}

/// Splits `NAME=VALUE`, as `--interface` takes it.
pub(crate) fn pair(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.is_empty() && !value.is_empty() => Ok((name.into(), value.into())),
        _ => Err(format!("{text:?} is not NAME=VALUE")),
    }
}
