//! Squeezes with the places they were made at, in and out of files.

use crate::error::ForearmError;
use crate::folder::{Folder, SqueezeFile, numbers};
use crate::mat::{Matrix, read_mat, write_mat};
use crate::places::location_percent;
use crate::squeeze::{COLUMNS, Squeeze, TACTELS, TACTILE_COLUMNS, TACTILE_ROWS};
use serde::Deserialize;
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::fs;
use std::path::{Path, PathBuf};
use taxel_record::{NpzWriter, NumberArray, write_npy};

/// The variable of the publication's `.mat` files: "data" in Spanish.
const VARIABLE: &str = "datos";
/// The array of an `.npz` that is 1 where its squeezes are simulated.
const SIMULATED: &str = "simulated";
/// What `taxel forearm record` keeps beside the folders of a session.
const SETTINGS: &str = "session.json";

/// The file beside a squeeze's that has its tactile images; repetitions are numbered from 1.
pub fn touch_file(place: usize, repetition: usize) -> String {
    format!("tactile{place}_{repetition}.npy")
}

/// A squeeze and where it was made.
#[derive(Debug, Clone, PartialEq)]
pub struct Trial {
    /// From 0 (wrist) to 100 (elbow).
    pub location_percent: f64,
    /// Which squeeze at this place, from 0.
    pub repetition: usize,
    /// The squeeze.
    pub squeeze: Squeeze,
}

impl Trial {
    /// What people call it, numbered from 1 as files are: `squeeze 1 at 8.3 %`.
    pub fn name(&self) -> String {
        name(self.location_percent, self.repetition)
    }

    /// Which squeeze at this place, from 1 as files are numbered.
    pub fn number(&self) -> usize {
        self.repetition + 1
    }
}

fn name(location_percent: f64, repetition: usize) -> String {
    format!("squeeze {} at {location_percent:.1} %", repetition + 1)
}

/// Squeezes of one arm and gripper.
#[derive(Debug, Clone, PartialEq)]
pub struct Session {
    /// File or folder, for messages.
    pub name: String,
    /// Whether its file says that its squeezes are of a simulated forearm; one that says nothing may be of either.
    pub simulated: bool,
    /// In the order of places and repetitions.
    pub trials: Vec<Trial>,
    /// The `.mat` files in its folder that are no squeezes of it, by their places or their names: they were not read.
    pub passed_over: Vec<PathBuf>,
}

impl Squeeze {
    /// Reads one of the publication's files: `datos`, n x 10.
    ///
    /// # Errors
    /// A file that cannot be read, is torn, or holds something else.
    pub fn read_mat(path: &Path) -> Result<Self, ForearmError> {
        let bytes = fs::read(path).map_err(ForearmError::io(path))?;
        let matrix = read_mat(&bytes, VARIABLE).map_err(|torn| ForearmError::Mat {
            path: path.into(),
            torn,
        })?;
        let (rows, columns) = (matrix.rows, matrix.values.len() / matrix.rows.max(1));
        if rows == 0 || columns != COLUMNS {
            let what = format!(
                "{} is {rows} x {columns}; a squeeze has a row for each sample and 10 columns",
                matrix.name
            );
            return Err(ForearmError::Unfit {
                path: path.into(),
                what,
            });
        }
        let mut columns = matrix.values.chunks_exact(rows);
        let columns = std::array::from_fn(|_| columns.next().unwrap_or_default().to_vec());
        Self::from_columns(columns).map_err(within(path.display()))
    }

    /// Reads one of the publication's files, and the tactile images of its samples where their file is beside it.
    ///
    /// # Errors
    /// As [`Squeeze::read_mat`]; images that are not of its samples.
    pub fn open(path: &Path) -> Result<Self, ForearmError> {
        let mut squeeze = Self::read_mat(path)?;
        if let Some((place, repetition)) = numbers(path) {
            let touch = path.with_file_name(touch_file(place, repetition));
            if touch.exists() {
                squeeze.read_npy(&touch)?;
            }
        }
        Ok(squeeze)
    }

    /// The bytes of a `.npy` with its tactile images, samples x 28 x 50 counts; `None` without touch.
    pub fn to_npy(&self) -> Option<Vec<u8>> {
        let shape = [self.len(), TACTILE_ROWS, TACTILE_COLUMNS];
        let mut bytes = Vec::new();
        write_npy(&mut bytes, &shape, self.tactile.clone()?).ok()?;
        Some(bytes)
    }

    /// Reads the tactile images of its samples from what [`Squeeze::to_npy`] writes.
    fn read_npy(&mut self, path: &Path) -> Result<(), ForearmError> {
        let images = NumberArray::of_npy(path)?;
        if images.shape != [self.len(), TACTILE_ROWS, TACTILE_COLUMNS] || !images.values.iter().all(is_count)
        {
            let what = format!(
                "its shape is {:?}; its squeeze has {} samples, each with an image of 28 x 50 whole numbers from 0 to 65535",
                images.shape,
                self.len()
            );
            return Err(ForearmError::Unfit {
                path: path.into(),
                what,
            });
        }
        self.tactile = Some(images.values.into_iter().map(|count| count as u16).collect());
        Ok(())
    }

    /// The bytes of such a file, without touch, which the publication keeps elsewhere.
    pub fn to_mat(&self) -> Vec<u8> {
        write_mat(&Matrix {
            name: VARIABLE.into(),
            rows: self.len(),
            values: self.columns().concat(),
        })
    }
}

impl Session {
    /// Reads a session: an `.npz` (`data`, places x repetitions x samples x 10, and `location_percent`), or a folder of the
    /// publication's, `PLACE/distancePLACE_REPETITION.mat` with places 0 to 12, and beside them, where there is touch,
    /// `tactilePLACE_REPETITION.npy`. What is simulated says so: `simulated` is 1 in an `.npz`, true in a folder's
    /// `session.json`.
    ///
    /// Such files right in the folder are taken too. A folder that has none may hold one session in a folder of its own;
    /// what lies in further folders is no part of it.
    ///
    /// # Errors
    /// What cannot be read, with its file; a folder without any such file, or with the sessions of several folders; a squeeze
    /// that is there twice, or lies in the folder of another place.
    pub fn open(path: &Path) -> Result<Self, ForearmError> {
        let is_mat = path
            .extension()
            .is_some_and(|ending| ending.eq_ignore_ascii_case("mat"));
        let mut passed_over = Vec::new();
        let (trials, simulated) = if path.is_dir() {
            let folder = Folder::look(path)?;
            let simulated = is_simulated_folder(path)? || is_simulated_folder(&folder.path)?;
            let trials = read_folder(&folder)?;
            passed_over = folder.passed_over;
            (trials, simulated)
        } else if is_mat && path.exists() {
            return Err(ForearmError::Unfit {
                path: path.into(),
                what: "a .mat is one squeeze, and a session has those of several places; name the folder of the places \
                       (PLACE/distancePLACE_REPETITION.mat)"
                    .into(),
            });
        } else {
            (read_npz(path)?, is_simulated_npz(path)?)
        };
        Ok(Self {
            name: path.display().to_string(),
            simulated,
            trials,
            passed_over,
        })
    }

    /// Where its squeezes were made, ascending, each place once.
    pub fn locations(&self) -> Vec<f64> {
        let mut places: Vec<f64> = self.trials.iter().map(|trial| trial.location_percent).collect();
        places.sort_by(f64::total_cmp);
        places.dedup();
        places
    }

    /// Squeezes that are the same in all samples as one before them, which stands first: no gripper makes one twice.
    pub fn copies(&self) -> Vec<(&Trial, &Trial)> {
        let bits = |trial: &Trial| -> Vec<u64> {
            let columns = trial.squeeze.columns();
            columns.iter().flatten().map(|number| number.to_bits()).collect()
        };
        let mut seen: HashMap<Vec<u64>, &Trial> = HashMap::new();
        let mut copies = Vec::new();
        for trial in &self.trials {
            match seen.entry(bits(trial)) {
                Entry::Occupied(first) => copies.push((*first.get(), trial)),
                Entry::Vacant(place) => drop(place.insert(trial)),
            }
        }
        copies
    }

    /// Whether every squeeze has touch.
    pub fn has_touch(&self) -> bool {
        !self.trials.is_empty() && self.trials.iter().all(|trial| trial.squeeze.tactile.is_some())
    }

    /// Whether this is the publication's own data: every squeeze has its tenth column, of which nothing is known, so that
    /// neither a simulation nor a recording has it.
    pub fn is_published(&self) -> bool {
        let is_there = |trial: &Trial| {
            let angles = &trial.squeeze.undocumented_deg;
            angles.iter().all(|angle| angle.is_finite()) && angles.windows(2).any(|pair| pair[0] != pair[1])
        };
        !self.trials.is_empty() && self.trials.iter().all(is_there)
    }

    /// Writes an `.npz` that [`Session::open`] reads: shorter squeezes are filled up with rows that are not numbers, and
    /// squeezes that were not made are nothing else. With `tactile`, places x repetitions x samples x 28 x 50, where every
    /// squeeze has touch.
    ///
    /// # Errors
    /// A file that cannot be written; a squeeze without touch among others that have it.
    pub fn write_npz(&self, path: &Path) -> Result<(), ForearmError> {
        let touched = self.trials.iter().any(|trial| trial.squeeze.tactile.is_some());
        let without = (self.trials.iter()).find(|trial| trial.squeeze.tactile.is_none());
        if let Some(trial) = without.filter(|_| touched) {
            return Err(within(trial.name())(ForearmError::TouchOnce));
        }
        let places = self.locations();
        let repetitions = 1 + self.trials.iter().map(|t| t.repetition).max().unwrap_or(0);
        let samples = self.trials.iter().map(|t| t.squeeze.len()).max().unwrap_or(0);
        let mut data = vec![f64::NAN; places.len() * repetitions * samples * COLUMNS];
        let tactels = if touched { TACTELS } else { 0 };
        let mut tactile = vec![0; data.len() / COLUMNS * tactels];
        for trial in &self.trials {
            let is_here = |place: &f64| *place == trial.location_percent;
            let place = places.iter().position(is_here).unwrap_or_default();
            let first = (place * repetitions + trial.repetition) * samples;
            for (column, values) in trial.squeeze.columns().iter().enumerate() {
                for (row, value) in values.iter().enumerate() {
                    data[(first + row) * COLUMNS + column] = *value;
                }
            }
            if let Some(counts) = &trial.squeeze.tactile {
                tactile[first * TACTELS..][..counts.len()].copy_from_slice(counts);
            }
        }
        let squeezes = [places.len(), repetitions, samples];
        let mut npz = NpzWriter::compressed(path);
        npz.add("data", &[&squeezes[..], &[COLUMNS]].concat(), data)?;
        npz.add("location_percent", &[places.len()], places)?;
        if self.simulated {
            npz.add(SIMULATED, &[1], [1u8])?;
        }
        if touched {
            let shape = [&squeezes[..], &[TACTILE_ROWS, TACTILE_COLUMNS]].concat();
            npz.add("tactile", &shape, tactile)?;
        }
        Ok(npz.finish()?)
    }
}

fn is_count(number: &f64) -> bool {
    (0.0..=f64::from(u16::MAX)).contains(number) && number.fract() == 0.0
}

fn within(at: impl std::fmt::Display) -> impl Fn(ForearmError) -> ForearmError {
    let at = at.to_string();
    move |source| ForearmError::In {
        at: at.clone(),
        source: Box::new(source),
    }
}

fn read_folder(folder: &Folder) -> Result<Vec<Trial>, ForearmError> {
    let trial = |file: &SqueezeFile| {
        Ok(Trial {
            location_percent: location_percent(file.place),
            repetition: file.repetition - 1,
            squeeze: Squeeze::open(&file.path)?,
        })
    };
    folder.squeezes.iter().map(trial).collect()
}

fn is_simulated_npz(path: &Path) -> Result<bool, ForearmError> {
    let Some(array) = NumberArray::of_npz(path, SIMULATED)? else {
        return Ok(false);
    };
    match array.values.as_slice() {
        [0.0] => Ok(false),
        [1.0] => Ok(true),
        _ => Err(ForearmError::Unfit {
            path: path.into(),
            what: format!("{SIMULATED} must be one number, 0 or 1"),
        }),
    }
}

/// Whether the settings of a folder say so; one that somebody else filled has none.
fn is_simulated_folder(path: &Path) -> Result<bool, ForearmError> {
    #[derive(Deserialize)]
    struct Settings {
        #[serde(default)]
        simulated: bool,
    }
    let path = path.join(SETTINGS);
    if !path.exists() {
        return Ok(false);
    }
    let text = fs::read(&path).map_err(ForearmError::io(&path))?;
    match serde_json::from_slice(&text) {
        Ok(Settings { simulated }) => Ok(simulated),
        Err(error) => Err(ForearmError::Unfit {
            path,
            what: error.to_string(),
        }),
    }
}

fn read_npz(path: &Path) -> Result<Vec<Trial>, ForearmError> {
    let unfit = |what: String| ForearmError::Unfit {
        path: path.into(),
        what,
    };
    let array = |name: &str| NumberArray::of_npz(path, name);
    let data = array("data")?
        .ok_or_else(|| unfit("no array data; a session has data and location_percent".into()))?;
    let &[places, repetitions, samples, COLUMNS] = data.shape.as_slice() else {
        let found = data.shape;
        return Err(unfit(format!(
            "data has shape {found:?}; expected places x repetitions x samples x 10"
        )));
    };
    let at = array("location_percent")?.ok_or_else(|| unfit("no array location_percent".into()))?;
    if at.shape != [places] || at.values.iter().any(|p| !(0.0..=100.0).contains(p)) {
        return Err(unfit(format!(
            "location_percent must be {places} numbers from 0 to 100"
        )));
    }
    let furthest = at.values.iter().copied().fold(0.0, f64::max);
    if places > 1 && furthest > 0.0 && furthest <= 1.0 {
        return Err(unfit(format!(
            "location_percent goes to {furthest}, and the elbow is 100; multiply shares of the forearm by 100"
        )));
    }
    let touch = array("tactile")?;
    if let Some(touch) = &touch {
        let expected = [places, repetitions, samples, TACTILE_ROWS, TACTILE_COLUMNS];
        if touch.shape != expected || !touch.values.iter().all(is_count) {
            return Err(unfit(format!(
                "tactile must be {expected:?} whole numbers from 0 to 65535"
            )));
        }
    }
    let mut trials = Vec::with_capacity(places * repetitions);
    for (n, rows) in data.values.chunks_exact(samples * COLUMNS).enumerate() {
        let (place, repetition) = (n / repetitions, n % repetitions);
        // A row that is empty before others is none that was filled up: its time is refused.
        let is_filled = |row: &[f64]| row.iter().any(|value| !value.is_nan());
        let Some(last) = rows.chunks_exact(COLUMNS).rposition(is_filled) else {
            continue;
        };
        let filled = last + 1;
        let column = |c: usize| {
            rows.chunks_exact(COLUMNS)
                .take(filled)
                .map(|row| row[c])
                .collect()
        };
        let location_percent = at.values[place];
        let in_file = format!("{}, {}", path.display(), name(location_percent, repetition));
        let mut squeeze = Squeeze::from_columns(std::array::from_fn(column)).map_err(within(in_file))?;
        squeeze.tactile = touch.as_ref().map(|touch| {
            let counts = &touch.values[n * samples * TACTELS..][..filled * TACTELS];
            counts.iter().map(|count| *count as u16).collect()
        });
        trials.push(Trial {
            location_percent,
            repetition,
            squeeze,
        });
    }
    if trials.is_empty() {
        return Err(unfit("data has no squeeze; every row is empty".into()));
    }
    Ok(trials)
}
