//! Arrays of an `.npy` or `.npz` whose meaning another program knows.

use super::npy::Array;
use super::npz::Npz;
use crate::error::RecordError;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

/// An array of numbers of any shape.
#[derive(Debug, Clone, PartialEq)]
pub struct NumberArray {
    /// The file and the array, for messages.
    pub name: String,
    /// Its shape.
    pub shape: Vec<usize>,
    /// Its numbers, row by row, as doubles.
    pub values: Vec<f64>,
}

impl NumberArray {
    /// Reads an array of an `.npz`; none where the file has no array of this name.
    ///
    /// # Errors
    /// A file that cannot be read or is no `.npz`; an array that is damaged, empty or not of numbers.
    pub fn of_npz(path: &Path, array: &str) -> Result<Option<Self>, RecordError> {
        let mut npz = Npz::open(path)?;
        if !npz.has(array) {
            return Ok(None);
        }
        Self::of(npz.array(array)?).map(Some)
    }

    /// Reads the array of an `.npy`.
    ///
    /// # Errors
    /// A file that cannot be read or is no `.npy`; an array that is damaged, empty or not of numbers.
    pub fn of_npy(path: &Path) -> Result<Self, RecordError> {
        let file = File::open(path).map_err(RecordError::io(path))?;
        Self::of(Array::open(path.display().to_string(), BufReader::new(file))?)
    }

    fn of(array: Array<impl Read>) -> Result<Self, RecordError> {
        let (name, shape) = (array.at.clone(), array.shape().to_vec());
        let values = array.numbers()?;
        Ok(Self { name, shape, values })
    }
}
