//! The real recordings, where they are: in `$TAXEL_DATA`, or in `shared/data` beside the repository.
//!
//! They belong to others and are not part of the repository. A test that finds none says so with a
//! line that begins with `SKIPPED:`, which `tests/run` counts, and returns.

use ndarray::Array2;
use ndarray_npy::NpzReader;
use std::fs::File;
use std::path::{Path, PathBuf};

/// Counts x, y, z of one module's sixteen taxels.
pub type Counts = [[u16; 3]; 16];

/// A recording of several arrays.
pub type Npz = NpzReader<File>;

/// Where a recording is, or `None` after a loud line where it is not on this machine.
pub fn find(file: &str) -> Option<PathBuf> {
    // This crate is three folders deep in the repository.
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(4);
    let folder = match std::env::var_os("TAXEL_DATA") {
        Some(folder) => folder.into(),
        None => beside.unwrap_or(Path::new("/")).join("shared/data"),
    };
    let path = folder.join(file);
    if !path.is_file() {
        println!(
            "SKIPPED: {} is absent; set TAXEL_DATA to the folder of recordings",
            path.display()
        );
        return None;
    }
    Some(path)
}

/// The arrays of a recording, or `None` after a loud line.
///
/// # Panics
///
/// If the file is there and is no npz file.
pub fn open(file: &str) -> Option<Npz> {
    let path = find(file)?;
    let opened = File::open(&path).map_err(|error| error.to_string());
    let npz = opened.and_then(|file| NpzReader::new(file).map_err(|error| error.to_string()));
    Some(npz.unwrap_or_else(|error| panic!("{}: {error}", path.display())))
}

/// An array of a recording, frame by column.
///
/// # Panics
///
/// If there is no such array, or it is of another kind.
pub fn array(npz: &mut Npz, name: &str) -> Array2<u16> {
    npz.by_name(&format!("{name}.npy"))
        .unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// The frames of an array with columns x1, y1, z1, x2, ...
pub fn interleaved(array: &Array2<u16>) -> Vec<Counts> {
    frames(array, |taxel, axis| 3 * taxel + axis)
}

/// The frames of an array with columns 16 x, 16 y, 16 z.
pub fn by_axis(array: &Array2<u16>) -> Vec<Counts> {
    frames(array, |taxel, axis| 16 * axis + taxel)
}

fn frames(array: &Array2<u16>, column: impl Fn(usize, usize) -> usize) -> Vec<Counts> {
    let frame = |row: ndarray::ArrayView1<'_, u16>| -> Counts {
        std::array::from_fn(|taxel| std::array::from_fn(|axis| row[column(taxel, axis)]))
    };
    array.rows().into_iter().map(frame).collect()
}

/// The arrays of the Schunk hand's grasps, frame by cell, without its joints; by name.
pub fn schunk_grasps() -> Option<Vec<(String, Array2<u16>)>> {
    let mut npz = open("schunk_sdh_grasps.npz")?;
    let mut names = npz.names().expect("a readable npz file");
    names.retain(|name| !name.contains("_joints"));
    names.sort_unstable();
    let grasps = names.into_iter().map(|name| {
        let name = name.trim_end_matches(".npy");
        (name.to_string(), array(&mut npz, name))
    });
    Some(grasps.collect())
}
