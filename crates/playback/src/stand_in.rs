//! Files that stand in for what a person named: a recording that came through a pipe, a result that is not whole yet. What
//! is said of them is said with the name that the person knows.

use std::path::Path;
use std::sync::Mutex;

/// What stands in, and what for.
static NAMES: Mutex<Vec<[String; 2]>> = Mutex::new(Vec::new());

/// From now on `file` is called `name`.
pub fn call(file: &Path, name: &str) {
    let mut names = NAMES.lock().unwrap_or_else(|e| e.into_inner());
    names.push([file.display().to_string(), name.to_owned()]);
}

/// There is no such file any more, and nothing more is said of it.
pub fn forget(file: &Path) {
    let mut names = NAMES.lock().unwrap_or_else(|e| e.into_inner());
    let file = file.display().to_string();
    names.retain(|[known, _]| *known != file);
}

/// A text in which files have the names that people know.
pub fn as_named(text: String) -> String {
    let names = NAMES.lock().unwrap_or_else(|e| e.into_inner());
    let of_name = |text: String, [file, name]: &[String; 2]| match text.contains(file) {
        true => text.replace(file, name),
        false => text,
    };
    names.iter().fold(text, of_name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_called_by_the_name_that_it_stands_in_for() {
        call(Path::new("/tmp/x/1-stand-in.csv"), "stdin");
        call(Path::new("out/a.npz.Qx7.part"), "out/a.npz");
        for (said, wanted) in [
            ("/tmp/x/1-stand-in.csv:3: no number", "stdin:3: no number"),
            ("out/a.npz.Qx7.part: full", "out/a.npz: full"),
            ("b.npz.Qx8.part: full", "b.npz.Qx8.part: full"),
        ] {
            assert_eq!(as_named(said.into()), wanted);
        }
        forget(Path::new("out/a.npz.Qx7.part"));
        assert_eq!(as_named("out/a.npz.Qx7.part".into()), "out/a.npz.Qx7.part");
    }
}
