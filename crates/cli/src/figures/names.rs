//! What recordings are called in figures and in the names of their files.

use std::collections::{HashMap, HashSet};
use std::path::{Component, Path, PathBuf};
use taxel_record::FileKind;

/// The name without folder and ending, that of an .npz with its array where one is named. Where several of these recordings
/// are called the same, as much of their folders as tells them apart stands before it, and their endings behind it where it
/// takes these; one that is named twice is numbered. A recording alone has no folder in its name.
pub(super) fn names(paths: &[PathBuf], array: Option<&str>) -> Vec<String> {
    let recordings: Vec<Named> = paths.iter().map(|path| Named::of(path, array)).collect();
    let mut alike: HashMap<&str, Vec<&Named>> = HashMap::new();
    for recording in &recordings {
        alike.entry(&recording.short).or_default().push(recording);
    }
    let alike: HashMap<&str, _> = alike
        .iter()
        .map(|(short, alike)| (*short, told_apart(alike)))
        .collect();
    let mut taken = HashSet::new();
    let unique = |recording: &Named| {
        let (folders, ending) = alike[recording.short.as_str()];
        let mut name = recording.name(folders, ending);
        let stem = name.clone();
        for number in 2.. {
            if taken.insert(name.clone()) {
                break;
            }
            name = format!("{stem}-{number}");
        }
        name
    };
    recordings.iter().map(unique).collect()
}

/// How many folders it takes to tell these apart, and whether their endings, or else what tells most of them apart.
fn told_apart(alike: &[&Named]) -> (usize, bool) {
    let deepest = alike.iter().map(|one| one.folders.len()).max().unwrap_or(0);
    let mut best = ((0, false), 1);
    for ending in [false, true] {
        for folders in 0..=deepest {
            if best.1 == alike.len() {
                return best.0;
            }
            let names: HashSet<String> = alike.iter().map(|one| one.name(folders, ending)).collect();
            if names.len() > best.1 {
                best = ((folders, ending), names.len());
            }
        }
    }
    best.0
}

/// A recording's path, in parts of a name.
struct Named {
    /// The outermost first.
    folders: Vec<String>,
    stem: String,
    /// With its point.
    ending: String,
    /// What stands behind the name, as an array of an .npz.
    array: String,
    /// The name where no other recording has it.
    short: String,
}

impl Named {
    fn of(path: &Path, array: Option<&str>) -> Self {
        let text = path.to_str().unwrap_or("recording");
        let path = Path::new(text.strip_prefix("sim:").unwrap_or(text));
        let is_npz = FileKind::of(path) == Some(FileKind::Npz);
        let folder = path.parent().unwrap_or(Path::new("")).components();
        let mut named = Self {
            folders: folder
                .filter(|part| matches!(part, Component::Normal(_) | Component::ParentDir))
                .map(|part| part.as_os_str().to_string_lossy().into_owned())
                .collect(),
            stem: path
                .file_stem()
                .map_or("recording".into(), |stem| stem.to_string_lossy().into_owned()),
            ending: path
                .extension()
                .map_or(String::new(), |end| format!(".{}", end.to_string_lossy())),
            // An array may be in a folder of the archive.
            array: array
                .filter(|_| is_npz)
                .map_or(String::new(), |array| format!("-{}", array.replace('/', "-"))),
            short: String::new(),
        };
        named.short = named.name(0, false);
        named
    }

    fn name(&self, folders: usize, ending: bool) -> String {
        let first = self.folders.len().saturating_sub(folders);
        let folders: String = self.folders[first..]
            .iter()
            .map(|folder| format!("{folder}/"))
            .collect();
        let ending = if ending { self.ending.as_str() } else { "" };
        format!("{folders}{}{ending}{}", self.stem, self.array)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_recording_has_a_name_of_its_own() {
        let cases: [(&[&str], &[&str]); 8] = [
            (
                &["a/grasp.csv", "sim:tap", "sim:scenes/own.toml"],
                &["grasp", "tap", "own"],
            ),
            (
                &["a/grasp.csv", "sim:tap", "b/grasp.npz"],
                &["a/grasp", "tap", "b/grasp"],
            ),
            (&["a/3/tof.csv", "a/83/tof.csv"], &["3/tof", "83/tof"]),
            (
                &["a/3/tof.csv", "b/3/tof.csv", "/b/4/tof.csv"],
                &["a/3/tof", "b/3/tof", "b/4/tof"],
            ),
            (
                &["tof.csv", "../tof.csv", "./3/tof.csv"],
                &["tof", "../tof", "3/tof"],
            ),
            (&["a/tof.csv", "a/tof.npz"], &["tof.csv", "tof.npz"]),
            (
                &["a/tof.csv", "a/tof.npz", "b/tof.csv"],
                &["a/tof.csv", "a/tof.npz", "b/tof.csv"],
            ),
            (
                &["a/tof.csv", "a/tof.csv", "tof-2.csv"],
                &["tof", "tof-2", "tof-2-2"],
            ),
        ];
        for (paths, expected) in cases {
            let paths: Vec<PathBuf> = paths.iter().map(PathBuf::from).collect();
            assert_eq!(names(&paths, None), expected);
        }
    }

    #[test]
    fn an_array_is_in_the_name_of_its_npz() {
        let paths = ["a/grasp.csv", "b/grasp.npz", "c/grasp.npz"].map(PathBuf::from);
        let expected = ["grasp", "b/grasp-BALL-1", "c/grasp-BALL-1"];
        assert_eq!(names(&paths, Some("BALL/1")), expected);
    }
}
