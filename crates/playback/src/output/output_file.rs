//! Files that hold a result: written whole or not at all, and never over what the result is made of.

use crate::stand_in;
use anyhow::{Context, bail};
use std::fs::{self, File, OpenOptions, Permissions};
use std::io;
use std::os::fd::AsFd;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use taxel_recorder::parts;
use tempfile::{NamedTempFile, PersistError};

/// Refuses outputs that would overwrite one of the inputs, or each other.
pub fn refuse_overlap(outputs: &[&Path], inputs: &[&Path]) -> anyhow::Result<()> {
    for (n, output) in outputs.iter().enumerate() {
        let mut inputs = inputs.iter().flat_map(|input| parts(input));
        if let Some(input) = inputs.find(|input| is_same(output, input)) {
            bail!(
                "{}: the output would overwrite the input {}",
                output.display(),
                input.display()
            );
        }
        if let Some(other) = outputs[..n].iter().find(|other| is_same(output, other)) {
            bail!(
                "{} and {} are the same file; give each output its own",
                other.display(),
                output.display()
            );
        }
    }
    Ok(())
}

/// Refuses to write over a file that people edit, unless they say so.
pub fn refuse_existing(path: &Path, force: bool) -> anyhow::Result<()> {
    let is_file = fs::metadata(path).is_ok_and(|file| file.is_file());
    if is_file && !force && path.as_os_str() != "-" {
        bail!(
            "{} exists; --force writes over it, another name leaves it alone",
            path.display()
        );
    }
    Ok(())
}

/// Whether two names, of which one or both may not exist yet, are those of one regular file.
fn is_same(a: &Path, b: &Path) -> bool {
    match (fs::metadata(a), fs::metadata(b)) {
        (Ok(a), Ok(b)) => a.is_file() && (a.dev(), a.ino()) == (b.dev(), b.ino()),
        (Err(_), Err(_)) => place(a).is_some_and(|place| Some(place) == self::place(b)),
        _ => false,
    }
}

/// Opens a file that is written from its beginning to its end, and nowhere else; `-` is stdout.
pub fn create_stream(path: &Path) -> io::Result<File> {
    match path.as_os_str() == "-" {
        true => io::stdout().as_fd().try_clone_to_owned().map(File::from),
        false => File::create(path),
    }
}

/// Where a file is or will be: its folder without links and dots, and its name. `None` where there is no such folder.
pub fn place(path: &Path) -> Option<PathBuf> {
    Some(folder(path).canonicalize().ok()?.join(path.file_name()?))
}

fn folder(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// A file that has its name only once it is whole. Until then it is called `NAME.XXXXXX.part` in
/// the same folder; what is given up is removed, and a file of that name from before stays.
///
/// What is no regular file, such as a device or a pipe, is written as it is; `-` is for [`OutputFile::stream`] alone.
#[derive(Debug)]
pub struct OutputFile {
    path: PathBuf,
    part: Option<NamedTempFile>,
}

/// How a temporary file gets its name.
type Persist = fn(NamedTempFile, PathBuf) -> Result<File, PersistError>;

impl OutputFile {
    /// Makes sure that the file can be written, before there is anything to write.
    ///
    /// # Errors
    /// One that cannot be written; `-`.
    pub fn begin(path: &Path) -> anyhow::Result<Self> {
        if path.as_os_str() == "-" {
            bail!("- is stdout for streams alone; name a file, or /dev/stdout");
        }
        Self::stream(path)
    }

    /// The same of what is written with [`create_stream`], where `-` is stdout.
    pub fn stream(path: &Path) -> anyhow::Result<Self> {
        Self::prepare(path).with_context(|| path.display().to_string())
    }

    fn prepare(path: &Path) -> io::Result<Self> {
        if path.as_os_str() == "-" {
            let path = path.into();
            return Ok(Self { path, part: None });
        }
        let before = match fs::metadata(path) {
            Ok(before) if before.is_dir() => return Err(io::ErrorKind::IsADirectory.into()),
            Ok(before) if !before.is_file() => {
                let path = path.into();
                return Ok(Self { path, part: None });
            }
            Ok(before) => {
                OpenOptions::new().write(true).open(path)?;
                Some(before)
            }
            Err(_) => None,
        };
        let name = path.display().to_string();
        // Behind a link is the file that is meant.
        let path = path.canonicalize().unwrap_or_else(|_| path.into());
        let mut prefix = path.file_name().unwrap_or_default().to_owned();
        prefix.push(".");
        let part = tempfile::Builder::new()
            .prefix(&prefix)
            .suffix(".part")
            // What the umask leaves of it, as for any file that is made.
            .permissions(Permissions::from_mode(0o666))
            .tempfile_in(folder(&path));
        let part = match (part, before) {
            (Ok(part), Some(before)) => {
                part.as_file().set_permissions(before.permissions())?;
                Some(part)
            }
            (Ok(part), None) => Some(part),
            // A folder of others, and a file of one's own in it.
            (Err(_), Some(_)) => None,
            (Err(error), None) => return Err(error),
        };
        if let Some(part) = &part {
            stand_in::call(part.path(), &name);
        }
        Ok(Self { path, part })
    }

    /// Writes a file whose content is known.
    pub fn write(path: &Path, content: impl AsRef<[u8]>) -> anyhow::Result<()> {
        Self::begin(path)?.fill(content)
    }

    /// Writes a file whose content is known and that is not there yet. One that has come meanwhile stays as it is.
    ///
    /// # Errors
    /// As all of these have; a file that is there.
    pub fn write_new(path: &Path, content: impl AsRef<[u8]>) -> anyhow::Result<()> {
        let mut file = Self::begin(path)?;
        fs::write(file.path(), content).with_context(|| path.display().to_string())?;
        file.name(NamedTempFile::persist_noclobber)
    }

    /// The file that it is called until it is whole, where it is called otherwise.
    pub fn part(&self) -> Option<PathBuf> {
        self.part.as_ref().map(|part| part.path().into())
    }

    /// Where to write.
    pub fn path(&self) -> &Path {
        self.part.as_ref().map_or(&self.path, |part| part.path())
    }

    /// Writes all of it, and gives it its name.
    pub fn fill(&mut self, content: impl AsRef<[u8]>) -> anyhow::Result<()> {
        fs::write(self.path(), content).with_context(|| self.path().display().to_string())?;
        self.finish()
    }

    /// The file is whole: gives it its name.
    pub fn finish(&mut self) -> anyhow::Result<()> {
        self.name(NamedTempFile::persist)
    }

    fn name(&mut self, persist: Persist) -> anyhow::Result<()> {
        let Some(part) = self.part.take() else {
            return Ok(());
        };
        let before = part.path().to_owned();
        let synced = part.as_file().sync_all();
        let named = synced.and_then(|()| Ok(persist(part, self.path.clone()).map(drop)?));
        named.with_context(|| self.path.display().to_string())?;
        stand_in::forget(&before);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;
    use tempfile::TempDir;

    #[test]
    fn a_file_that_is_no_stream_is_not_called_by_the_sign_for_stdout() {
        let stdout = Path::new("-");
        for refused in [
            OutputFile::write(stdout, "model"),
            OutputFile::begin(stdout).map(drop),
        ] {
            let error = refused.unwrap_err().to_string();
            assert!(error.contains("name a file") && !stdout.exists(), "{error}");
        }
        let stream = OutputFile::stream(stdout).unwrap();
        assert_eq!((stream.path(), stream.part()), (stdout, None));
    }

    #[test]
    fn a_file_has_its_name_only_once_it_is_whole() {
        let dir = TempDir::new().unwrap();
        let path = dir.path().join("images.bin");
        let names = || fs::read_dir(dir.path()).unwrap().count();
        fs::write(&path, "before").unwrap();
        let given_up = OutputFile::begin(&path).unwrap();
        fs::write(given_up.path(), "half").unwrap();
        drop(given_up);
        assert_eq!((fs::read(&path).unwrap(), names()), (b"before".to_vec(), 1));
        let mut whole = OutputFile::begin(&path).unwrap();
        fs::write(whole.path(), "whole").unwrap();
        let part = whole.part().unwrap().display().to_string();
        let said = || stand_in::as_named(part.clone());
        assert_eq!(said(), path.display().to_string());
        whole.finish().unwrap();
        drop(whole);
        assert_eq!((fs::read(&path).unwrap(), names()), (b"whole".to_vec(), 1));
        // Whoever writes a file again and again for months keeps no name of each.
        assert_eq!(said(), part);
    }

    #[test]
    fn a_file_that_is_to_be_new_takes_no_other_s_place() {
        let dir = TempDir::new().unwrap();
        let path = dir.path().join("squeeze.mat");
        OutputFile::write_new(&path, "first").unwrap();
        let error = format!("{:#}", OutputFile::write_new(&path, "second").unwrap_err());
        assert!(
            error.contains("squeeze.mat: ") && error.contains("File exists"),
            "{error}"
        );
        assert_eq!(fs::read(&path).unwrap(), b"first");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_file_has_the_permissions_that_it_had_or_those_of_any_new_file() {
        let dir = TempDir::new().unwrap();
        let path = |name: &str| dir.path().join(name);
        let mode = |name: &str| fs::metadata(path(name)).unwrap().permissions().mode() & 0o777;
        fs::write(path("any"), "").unwrap();
        fs::write(path("before"), "").unwrap();
        fs::set_permissions(path("before"), Permissions::from_mode(0o640)).unwrap();
        for name in ["before", "new"] {
            OutputFile::begin(&path(name)).unwrap().finish().unwrap();
        }
        assert_eq!((mode("new"), mode("before")), (mode("any"), 0o640));
    }

    #[test]
    fn links_and_devices_stay_what_they_are() {
        let dir = TempDir::new().unwrap();
        let (file, link) = (dir.path().join("file"), dir.path().join("link"));
        fs::write(&file, "before").unwrap();
        symlink(&file, &link).unwrap();
        let mut output = OutputFile::begin(&link).unwrap();
        fs::write(output.path(), "after").unwrap();
        output.finish().unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&file).unwrap(), b"after");
        let device = OutputFile::begin(Path::new("/dev/null")).unwrap();
        assert_eq!(device.path(), Path::new("/dev/null"));
        assert!(OutputFile::begin(dir.path()).is_err());
        assert!(OutputFile::begin(&dir.path().join("none/file")).is_err());
    }

    #[test]
    fn one_file_is_known_by_all_its_names() {
        let dir = TempDir::new().unwrap();
        let path = |name: &str| dir.path().join(name);
        fs::write(path("a"), "").unwrap();
        symlink(path("a"), path("link")).unwrap();
        let overlap = |outputs: &[&str], inputs: &[&str]| {
            let [outputs, inputs] =
                [outputs, inputs].map(|names| names.iter().map(|n| path(n)).collect::<Vec<_>>());
            let outputs: Vec<&Path> = outputs.iter().map(PathBuf::as_path).collect();
            let inputs: Vec<&Path> = inputs.iter().map(PathBuf::as_path).collect();
            refuse_overlap(&outputs, &inputs).is_err()
        };
        assert!(overlap(&["a"], &["./a"]));
        assert!(overlap(&["link"], &["a"]));
        assert!(overlap(&["new", "./new"], &["a"]));
        assert!(!overlap(&["b", "c"], &["a"]));
        assert!(refuse_overlap(&[Path::new("/dev/null"); 2], &[Path::new("/dev/null")]).is_ok());
    }
}
