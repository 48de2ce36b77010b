//! Which files of a folder are the squeezes of its session.

use crate::error::ForearmError;
use crate::places::PLACES;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Squeezes at a place, at most: what is numbered beyond is no squeeze of a session, as a copy with a date for its number.
const MOST: usize = 1000;
/// Folders of folders that are looked through.
const DEPTH: usize = 2;
/// What a folder of one place may be called before its number.
const PLACE_NAMES: [&str; 3] = ["", "place", "distance"];

/// The squeezes of a folder that are one session, in the order of places and repetitions.
#[derive(Debug)]
pub(crate) struct Folder {
    /// The folder of the places: the one that was named, or the only one in it that has squeezes.
    pub(crate) path: PathBuf,
    pub(crate) squeezes: Vec<SqueezeFile>,
    /// Other `.mat` files.
    pub(crate) passed_over: Vec<PathBuf>,
}

/// `distancePLACE_REPETITION.mat`.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct SqueezeFile {
    pub(crate) place: usize,
    /// From 1.
    pub(crate) repetition: usize,
    pub(crate) path: PathBuf,
}

impl Folder {
    /// Finds them by their names; none is opened.
    pub(crate) fn look(path: &Path) -> Result<Self, ForearmError> {
        let mut mats = Vec::new();
        list(path, DEPTH, &mut mats)?;
        mats.sort();
        let sessions: BTreeSet<&Path> = mats
            .iter()
            .filter(|mat| numbers(mat).is_some())
            .filter_map(|mat| session_of(path, mat))
            .collect();
        let mut others = sessions.iter();
        let session = match (others.next(), others.next()) {
            (None, _) => return Err(none(path, &mats)),
            _ if sessions.contains(path) => path,
            (Some(one), None) => one,
            (Some(one), Some(other)) => {
                let more = match others.len() {
                    0 => String::new(),
                    more => format!(" (and {more} more)"),
                };
                let what = format!(
                    "there are squeezes in {} and in {}{more}, and a session is of one arm and gripper; name one of these folders",
                    one.display(),
                    other.display()
                );
                return Err(unfit(path, what));
            }
        };
        let session = session.to_owned();
        let mut squeezes = Vec::new();
        let mut passed_over = Vec::new();
        for mat in mats {
            match numbers(&mat) {
                Some((place, repetition)) if session_of(path, &mat) == Some(&session) => {
                    check(path, &mat, place, repetition)?;
                    squeezes.push(SqueezeFile {
                        place,
                        repetition,
                        path: mat,
                    });
                }
                _ => passed_over.push(mat),
            }
        }
        squeezes.sort();
        let is_twice = |pair: &&[SqueezeFile]| {
            (pair[0].place, pair[0].repetition) == (pair[1].place, pair[1].repetition)
        };
        if let Some([first, second]) = squeezes.windows(2).find(is_twice) {
            let what = format!(
                "squeeze {} of place {} is there twice, the other in {}; take one of them away",
                first.repetition,
                first.place,
                second.path.display()
            );
            return Err(unfit(&first.path, what));
        }
        Ok(Self {
            path: session,
            squeezes,
            passed_over,
        })
    }
}

fn unfit(path: &Path, what: String) -> ForearmError {
    ForearmError::Unfit {
        path: path.into(),
        what,
    }
}

fn none(path: &Path, mats: &[PathBuf]) -> ForearmError {
    let others = match mats {
        [] => String::new(),
        [one] => format!(" ({} is of another name)", one.display()),
        [one, ..] => format!(
            " ({} .mat files are of other names, as {})",
            mats.len(),
            one.display()
        ),
    };
    let what = format!(
        "no file such as 0/distance0_1.mat in it or its folders{others}; name the folder of the places 0 to 12"
    );
    unfit(path, what)
}

/// Every `.mat` file in a folder and in folders of it.
fn list(folder: &Path, depth: usize, mats: &mut Vec<PathBuf>) -> Result<(), ForearmError> {
    for entry in fs::read_dir(folder).map_err(ForearmError::io(folder))? {
        let path = entry.map_err(ForearmError::io(folder))?.path();
        if path.is_dir() {
            if depth > 0 {
                list(&path, depth - 1, mats)?;
            }
        } else if path
            .extension()
            .is_some_and(|ending| ending.eq_ignore_ascii_case("mat"))
        {
            mats.push(path);
        }
    }
    Ok(())
}

/// The folder of the session that a squeeze is of: the one that it is in, or where that is the folder of a place, the one
/// above it.
fn session_of<'a>(named: &Path, mat: &'a Path) -> Option<&'a Path> {
    let folder = mat.parent()?;
    match place_of_folder(named, mat) {
        Some(_) => folder.parent(),
        None => Some(folder),
    }
}

/// The place that the folder of a squeeze is called by; the folder that was named is called as people like.
fn place_of_folder(named: &Path, mat: &Path) -> Option<usize> {
    let folder = mat.parent().filter(|folder| *folder != named)?;
    let name = folder.file_name()?.to_str()?;
    let digits = name.trim_start_matches(|c: char| !c.is_ascii_digit());
    let before = name.strip_suffix(digits)?.trim_end_matches([' ', '_', '-']);
    let is_place = PLACE_NAMES.iter().any(|word| before.eq_ignore_ascii_case(word));
    digits.parse().ok().filter(|_| is_place)
}

/// Refuses a squeeze of a place or number that no session has, or in the folder of another place.
fn check(named: &Path, mat: &Path, place: usize, repetition: usize) -> Result<(), ForearmError> {
    if place >= PLACES || !(1..=MOST).contains(&repetition) {
        let what = format!("places are 0 to 12 and repetitions 1 to {MOST}; rename the file or take it away");
        return Err(unfit(mat, what));
    }
    match place_of_folder(named, mat) {
        Some(folder) if folder != place => {
            let what = format!(
                "its name is of place {place}, and its folder of place {folder}; move or rename it to what it is"
            );
            Err(unfit(mat, what))
        }
        _ => Ok(()),
    }
}

/// Place and repetition of `distancePLACE_REPETITION.mat`.
pub(crate) fn numbers(path: &Path) -> Option<(usize, usize)> {
    let name = path.file_name()?.to_str()?;
    let (place, repetition) = name
        .strip_prefix("distance")?
        .strip_suffix(".mat")?
        .split_once('_')?;
    Some((place.parse().ok()?, repetition.parse().ok()?))
}
