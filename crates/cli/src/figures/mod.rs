//! `taxel figures`: the first publication's figures of one's own recordings.

mod instants;
mod names;
mod overview;
mod take;
mod time_course;

use crate::compress::method_parser;
use crate::errors::wrong_use;
use crate::recordings::input::{TIMES_S, number};
use crate::recordings::offline::OfflineArgs;
use anyhow::{Context, bail};
use serde_json::json;
use std::fs;
use std::path::{Path, PathBuf};
use take::Take;
use taxel_hand::{Method, Profile};
use taxel_playback::output_file::{OutputFile, refuse_overlap};
use taxel_plot::Sheet;
use taxel_record::FileKind;
use taxeld::stdout;

/// Draw what the first publication shows, from recordings: figures as SVG, their numbers as CSV beside them.
///
/// Of each INPUT: NAME-frame, a tactile frame as colours, x y z as red green blue (its Figure 3);
/// NAME-instants, raw beside compressed as a fingertip engages, when the hand holds tightest, and as the
/// fingertip disengages; NAME-time, the force that this fingertip feels and the force that a display
/// shows, under each codebook. Of several INPUTs, or a folder of them: `recordings`, a table and a sheet
/// with the tightest frame of each, raw beside compressed.
///
/// INPUT is any recording that `taxel compress` takes, sim:SCENE, or a folder of recordings; NAME is its name, and
/// that of the array where --array names one. Counts show colours; magnitudes have none. The fingertip is the module
/// that is touched first, unless --module says otherwise.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  taxel figures sim:ball-grasp --out figures
  taxel figures grasp.csv --out figures --at 2.2 --at 8.5 --at 4.0
  taxel figures grasps/ --out figures           a table and a sheet of all recordings of a folder
  taxel figures sim:objects --out figures       of the twenty simulated objects")]
pub(crate) struct Args {
    #[command(flatten)]
    offline: OfflineArgs,
    /// More recordings, or folders of them
    #[arg(value_name = "INPUT")]
    more: Vec<PathBuf>,
    /// The folder for the figures; it is made
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Show the frame of this time, in the seconds that the figures have; may be repeated [default: engaging, tightest,
    /// disengaging]
    #[arg(long, value_name = "S", value_parser = number("time in a recording, seconds", TIMES_S))]
    at: Vec<f64>,
    /// The module whose time course is drawn [default: the one that is touched first]
    #[arg(long, value_name = "NAME")]
    module: Option<String>,
    #[arg(long, value_name = "METHOD", value_parser = method_parser(), hide_possible_values = true, help = "The method of `recordings`; the others show both. Counts are conditioned as this method has it")]
    method: Option<Method>,
    /// One JSON object on stdout for each file that is written, a line each: {"file"}
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    if args.out.as_os_str() == "-" {
        return Err(wrong_use(
            "--out -: figures are several files; name a folder for them",
        ));
    }
    let paths = args.paths()?;
    let of_one = [("at", !args.at.is_empty()), ("module", args.module.is_some())];
    if let Some((option, _)) = of_one.iter().find(|(_, given)| *given && paths.len() > 1) {
        return Err(wrong_use(format!(
            "--{option} is for one recording, and these are {}; the sheet has the tightest frame of each",
            paths.len()
        )));
    }
    let names = names::names(&paths, args.offline.input.array());
    if let ([path], [name]) = (&paths[..], &names[..]) {
        let take = args.touched(path, name)?;
        let by_paper = args.by_paper(path, &take)?;
        return args.draw(&take, by_paper.as_ref());
    }
    let mut overview = overview::Overview::default();
    let mut named_left_out = 0;
    for (path, name) in paths.iter().zip(&names) {
        match args.touched(path, name) {
            Ok(take) => overview.add(&take)?,
            Err(error) if is_absent(path) => return Err(error),
            // A folder may hold other things.
            Err(error) => {
                named_left_out += usize::from(args.names(path));
                remark!("taxel: left out: {}", crate::errors::describe(&error));
            }
        }
    }
    if overview.is_empty() {
        bail!(
            "there is nothing to draw in any of these {} recordings",
            paths.len()
        );
    }
    args.write("recordings", &overview.sheet())?;
    args.write_text("recordings-table.csv", &overview.table())?;
    if !args.json {
        stdout::print(&overview.human())?;
    }
    anyhow::ensure!(
        named_left_out == 0,
        "of the recordings that were named, {named_left_out} could not be drawn"
    );
    Ok(())
}

/// Whether there is no such file.
fn is_absent(path: &Path) -> bool {
    !path.to_string_lossy().starts_with("sim:") && !path.exists()
}

impl Args {
    /// Whether the command line has this name.
    fn names(&self, path: &Path) -> bool {
        [&self.offline.input.path]
            .into_iter()
            .chain(&self.more)
            .any(|named| named == path)
    }

    /// Every recording that is named, those of a folder in the order of their names.
    fn paths(&self) -> anyhow::Result<Vec<PathBuf>> {
        let mut paths = Vec::new();
        for named in [&self.offline.input.path].into_iter().chain(&self.more) {
            if named.as_os_str() == "sim:objects" {
                paths.extend(taxel_sim::Scene::objects().map(|name| PathBuf::from(format!("sim:{name}"))));
            } else if named.is_dir() {
                paths.extend(recordings_of(named)?);
            } else {
                paths.push(named.clone());
            }
        }
        Ok(paths)
    }

    /// One recording, conditioned as this method asks for.
    fn take(&self, path: &Path, name: &str, method: Option<Method>) -> anyhow::Result<Take> {
        let mut offline = self.offline.clone();
        offline.input.path = path.into();
        Take::of(&offline, name, method)
    }

    /// The same under the publication's conditioning. None where the configuration excludes the publication's method,
    /// which is said.
    fn by_paper(&self, path: &Path, take: &Take) -> anyhow::Result<Option<Take>> {
        let profile = Profile {
            method: Method::Paper,
            ..take.profile.clone()
        };
        if let Err(error) = profile.check() {
            remark!("taxel: left out, since the configuration excludes it: paper: {error}");
            return Ok(None);
        }
        self.take(path, &take.name, Some(Method::Paper)).map(Some)
    }

    /// The same with the method as given, where anything is in contact. What is out of use is said.
    fn touched(&self, path: &Path, name: &str) -> anyhow::Result<Take> {
        let take = self.take(path, name, self.method)?;
        if let Some(sentence) = take.out_of_use.sentence("frame") {
            remark!("taxel: {name}: {sentence}");
        }
        if take.tightest().is_none() {
            let why = take
                .why_untouched()
                .map_or_else(String::new, |why| format!("; {why}"));
            bail!(
                "{}: nothing is in contact in any of its {} frames, so there is nothing to draw{why}",
                path.display(),
                take.force.len()
            );
        }
        Ok(take)
    }

    fn draw(&self, take: &Take, by_paper: Option<&Take>) -> anyhow::Result<()> {
        let module = match &self.module {
            Some(name) => take.module_named(name)?,
            None => take.touched_first().unwrap_or(0),
        };
        let instants = if self.at.is_empty() {
            take.usual_instants(module)
        } else {
            take.instants_at(&self.at)?
        };
        if let Some(sheet) = instants::frame(take) {
            self.write(&format!("{}-frame", take.name), &sheet)?;
        }
        self.write(
            &format!("{}-instants", take.name),
            &instants::sheet(take, by_paper, &instants)?,
        )?;
        self.write(&format!("{}-time", take.name), &time_course::sheet(take, module)?)
    }

    /// A figure, and its numbers beside it.
    fn write(&self, name: &str, sheet: &Sheet) -> anyhow::Result<()> {
        self.write_text(&format!("{name}.svg"), &sheet.svg()?)?;
        self.write_text(&format!("{name}.csv"), &sheet.csv())
    }

    fn write_text(&self, name: &str, text: &str) -> anyhow::Result<()> {
        let path = self.out.join(name);
        refuse_overlap(&[&path], &self.offline.inputs())?;
        fs::create_dir_all(&self.out).with_context(|| format!("--out {}", self.out.display()))?;
        OutputFile::write(&path, text)?;
        let file = path.display().to_string();
        say!("{file}");
        match self.json {
            true => stdout::print(&format!("{}\n", json!({ "file": file }))),
            false => Ok(()),
        }
    }
}

/// The recordings of a folder by their names.
fn recordings_of(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder).with_context(|| folder.display().to_string())?;
    let mut paths = Vec::new();
    for entry in entries {
        let path = entry.with_context(|| folder.display().to_string())?.path();
        if FileKind::of(&path).is_some() {
            paths.push(path);
        }
    }
    if paths.is_empty() {
        bail!("{}: no {} in this folder", folder.display(), FileKind::ENDINGS);
    }
    paths.sort();
    Ok(paths)
}
