//! Arrays of numpy's `.npz`: a zip archive of npy files.

use super::npy::{Array, FROM_0};
use crate::clock_name::ClockName;
use crate::error::{RecordError, show_shape};
use crate::meaning::Meaning;
use crate::table::{ColumnNames, ReadOptions, Table, TimeUnit, Void};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

/// The array that gives the time of each frame, nanoseconds.
const TIMES: &str = "t_ns";
/// The array that gives the joint angles of each frame, radians.
const JOINTS: &str = "joints";
/// The array that is not zero where a taxel had no value of the time of a frame.
pub(crate) const WITHOUT_VALUE: &str = "without_value";
/// Arrays that say something of each frame of another one, as times do.
const OF_FRAMES: [&str; 2] = [JOINTS, WITHOUT_VALUE];

/// Reads the named array of an npz file, or its only one, and what belongs to its frames.
pub(crate) fn read(path: &Path, options: &ReadOptions) -> Result<Table, RecordError> {
    let mut npz = Npz::open(path)?;
    let mask = match &options.void {
        Some(Void::Mask(mask)) => Some(mask),
        _ => None,
    };
    let times = npz.called_times(options.array.as_deref());
    let is_time = |name: &String| times.iter().any(|time| time.name == *name);
    let frames: Vec<&String> = (npz.names.iter())
        .filter(|n| !is_time(n) && Some(*n) != mask)
        .collect();
    let alone: Vec<&String> = (frames.iter().copied())
        .filter(|n| !OF_FRAMES.contains(&n.as_str()))
        .collect();
    let frames = if alone.is_empty() { frames } else { alone };
    let name = match (options.array.as_deref(), frames.as_slice()) {
        (Some(name), _) if npz.names.iter().any(|n| n == name) => name.to_owned(),
        (Some(name), _) => {
            let holds = format!("has no array {name:?}; it holds:\n{}", npz.list());
            return Err(RecordError::unfit(path.display(), holds));
        }
        (None, [only]) => (*only).clone(),
        (None, []) => {
            let but = times
                .first()
                .map_or_else(String::new, |time| format!(" but {}", time.name));
            return Err(unreadable(path, &format!("it holds no array{but}")));
        }
        (None, _) => {
            let holds = format!(
                "holds several arrays; name one with --array NAME:\n{}",
                npz.list()
            );
            return Err(RecordError::unfit(path.display(), holds));
        }
    };
    let array = npz.array(&name)?;
    array.check_numbers()?;
    let (at, shape) = (array.at.clone(), array.shape().to_vec());
    let meaning = Meaning::of(&at, &shape, None, options)?;
    let is_half = array.is_half();
    let values = array.numbers()?;
    let how_unfit = |time: &&CalledTime| (time.length != Some(shape[0]), !time.has_unit);
    let times_ns = match times.iter().min_by_key(how_unfit) {
        Some(CalledTime { name: time, .. }) if options.rate_hz.is_none() => {
            npz.times(time, &name, &shape, meaning)?
        }
        _ => None,
    };
    let joints = match name != JOINTS && npz.has(JOINTS) {
        true if npz.belongs(JOINTS, &name, &shape, meaning)? => Some(npz.array(JOINTS)?.numbers()?),
        _ => None,
    };
    let without_value = match name != WITHOUT_VALUE && npz.has(WITHOUT_VALUE) {
        true if npz.belongs(WITHOUT_VALUE, &name, &shape, meaning)? => {
            let cells = npz.array(WITHOUT_VALUE)?.numbers()?;
            Some(cells.into_iter().map(|cell| cell != 0.0).collect())
        }
        _ => None,
    };
    let void = mask
        .map(|mask| npz.mask(mask, &shape[1..], meaning))
        .transpose()?;
    Ok(Table {
        at,
        shape,
        values,
        times_ns,
        joints: joints.map(|angles| angles.into_iter().map(|angle| angle as f32).collect()),
        columns: None,
        unitless_time: None,
        names: ColumnNames::default(),
        void,
        without_value,
        is_half,
    })
}

/// The unit of the times that an array of this name gives, where the name says one; none where it gives no times.
fn time_of_name(name: &str) -> Option<Option<TimeUnit>> {
    let clock = ClockName::of(name).or_else(|| ClockName::of(name.strip_suffix('s')?))?;
    clock.is_plain.then_some(clock.unit)
}

fn unit_of_name(name: &str) -> Option<TimeUnit> {
    time_of_name(name).flatten()
}

/// How many numbers an array of one axis has, or of one beside axes of 1.
fn length(shape: &[usize]) -> Option<usize> {
    let is_list = !shape.is_empty() && shape.iter().filter(|axis| **axis != 1).count() <= 1;
    is_list.then(|| shape.iter().product())
}

fn unreadable(path: &Path, reason: &str) -> RecordError {
    RecordError::unreadable(path.display(), format!("not a readable npz (zip) file: {reason}"))
}

/// An array that by its name gives the time of each frame.
struct CalledTime {
    name: String,
    /// How many there are.
    length: Option<usize>,
    /// Whether its name or its elements say in which unit.
    has_unit: bool,
}

/// An npz file: a zip archive of npy members.
pub(crate) struct Npz<'a> {
    path: &'a Path,
    zip: zip::ZipArchive<BufReader<File>>,
    names: Vec<String>,
}

impl<'a> Npz<'a> {
    pub(crate) fn open(path: &'a Path) -> Result<Self, RecordError> {
        let file = File::open(path).map_err(RecordError::io(path))?;
        let zip = zip::ZipArchive::new(BufReader::new(file)).map_err(|e| unreadable(path, &e.to_string()))?;
        let names = zip
            .file_names()
            .map(|n| n.strip_suffix(".npy").unwrap_or(n).to_owned())
            .collect();
        Ok(Self { path, zip, names })
    }

    /// Whether it holds an array of this name.
    pub(crate) fn has(&self, array: &str) -> bool {
        self.names.iter().any(|name| name == array)
    }

    /// An array, of which no more than the header is unpacked.
    pub(crate) fn array(&mut self, name: &str) -> Result<Array<impl Read + '_>, RecordError> {
        let at = format!("{} [{name}]", self.path.display());
        let index = self
            .zip
            .index_for_name(&format!("{name}.npy"))
            .or_else(|| self.zip.index_for_name(name));
        let Some(index) = index else {
            return Err(RecordError::unreadable(at, "there is no array of this name"));
        };
        let member = self.zip.by_index(index);
        Array::open(
            at,
            member.map_err(|e| unreadable(self.path, &format!("array {name}: {e}")))?,
        )
    }

    /// The arrays that give the time of each frame, by their names: [`TIMES`] first, whatever its shape. The one of the frames is
    /// none.
    fn called_times(&mut self, frames: Option<&str>) -> Vec<CalledTime> {
        let names = self.names.clone().into_iter();
        let mut times: Vec<_> = names
            .filter(|name| Some(name.as_str()) != frames && time_of_name(name).is_some())
            .map(|name| {
                let array = self.array(&name).ok();
                CalledTime {
                    length: array.as_ref().and_then(|array| length(array.shape())),
                    has_unit: unit_of_name(&name).is_some()
                        || array.is_some_and(|array| array.has_datetimes()),
                    name,
                }
            })
            .filter(|time| time.name == TIMES || time.length.is_some())
            .collect();
        times.sort_by_key(|time| time.name != TIMES);
        times
    }

    /// The times of the frames of the array `name`, nanoseconds, where they are of that array.
    fn times(
        &mut self,
        time: &str,
        name: &str,
        shape: &[usize],
        meaning: Meaning,
    ) -> Result<Option<Vec<u64>>, RecordError> {
        let array = self.array(time)?;
        // It is what these are of, whatever the name says.
        let own = array.has_datetimes().then_some(TimeUnit::Ns);
        let Some(unit) = own.or(unit_of_name(time)) else {
            return match length(array.shape()) == Some(shape[0]) {
                true => Err(RecordError::unfit(
                    &array.at,
                    "is not read, since its name says no unit: call it t_s, t_ms, t_us or t_ns; --rate HZ ignores it",
                )),
                false => Ok(None),
            };
        };
        drop(array);
        if !self.belongs(time, name, shape, meaning)? {
            return Ok(None);
        }
        let array = self.array(time)?;
        if unit == TimeUnit::Ns || array.is_long() {
            return array.times(10u64.pow(unit.decimals() as u32)).map(Some);
        }
        let (at, ns) = (array.at.clone(), 10f64.powi(unit.decimals()));
        let in_ns = |time: f64| match (time * ns).round() {
            rounded if (0.0..u64::MAX as f64).contains(&rounded) => Ok(rounded as u64),
            _ => {
                let advice = if time < 0.0 { FROM_0 } else { "" };
                Err(RecordError::unreadable(&at, format!("{time} is no time{advice}")))
            }
        };
        array
            .numbers()?
            .into_iter()
            .map(in_ns)
            .collect::<Result<_, _>>()
            .map(Some)
    }

    /// Whether what an array says of each frame is said of those of the array `name`, which has this shape. What is of another
    /// length may be of another array, where the file has one of that length.
    fn belongs(
        &mut self,
        each: &str,
        name: &str,
        shape: &[usize],
        meaning: Meaning,
    ) -> Result<bool, RecordError> {
        let array = self.array(each)?;
        let (at, found) = (array.at.clone(), array.shape().to_vec());
        drop(array);
        let fits = match each {
            JOINTS => found.len() == 2 && found[0] == shape[0],
            WITHOUT_VALUE => found == [shape[0], meaning.taxels],
            _ => length(&found) == Some(shape[0]),
        };
        if fits {
            return Ok(true);
        }
        let frames = match each {
            JOINTS | WITHOUT_VALUE => found.first().copied(),
            _ => length(&found).or(found.first().copied()),
        };
        for other in self.names.clone() {
            let is_of_frames = OF_FRAMES.contains(&other.as_str()) || time_of_name(&other).is_some();
            let is_frames = other != name && other != each && !is_of_frames;
            if is_frames && frames.is_some() && self.array(&other)?.shape().first() == frames.as_ref() {
                return Ok(false);
            }
        }
        let (wanted, advice) = match each {
            JOINTS => (format!("{} x joints", shape[0]), ""),
            WITHOUT_VALUE => (format!("{} x {}", shape[0], meaning.taxels), ""),
            _ => (format!("{}", shape[0]), "; --rate HZ ignores the times"),
        };
        let expected = format!("{wanted}, since {name} has {} frames{advice}", shape[0]);
        Err(RecordError::shape(at, &found, &expected))
    }

    /// Which cells of a frame an array says are no taxels: those that are not zero in it.
    fn mask(&mut self, name: &str, frame: &[usize], meaning: Meaning) -> Result<Vec<bool>, RecordError> {
        if !self.has(name) {
            let holds = format!("has no array {name:?} for --void; it holds:\n{}", self.list());
            return Err(RecordError::unfit(self.path.display(), holds));
        }
        let array = self.array(name)?;
        if array.shape() != frame && array.shape() != [meaning.taxels] {
            let expected = format!("{}, a frame's, since --void names it", show_shape(frame));
            return Err(RecordError::shape(&array.at, array.shape(), &expected));
        }
        Ok(array.numbers()?.into_iter().map(|cell| cell != 0.0).collect())
    }

    /// The arrays, one a line, as error messages list them.
    pub(crate) fn list(&mut self) -> String {
        let names = self.names.clone();
        let width = names.iter().map(String::len).max().unwrap_or(0);
        let describe = |name: &String| {
            let what = match self.array(name) {
                Ok(array) => array.description(),
                Err(error) => format!("unreadable: {error}"),
            };
            format!("  {name:width$}  {what}")
        };
        let lines: Vec<String> = names.iter().map(describe).collect();
        lines.join("\n")
    }
}

#[cfg(test)]
mod tests;
