//! Arrays of an `.npz` whose meaning another program knows.

use crate::error::RecordError;
use crate::npz::Npz;
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
        let array = npz.array(array)?;
        let (name, shape) = (array.at.clone(), array.shape().to_vec());
        let values = array.numbers()?;
        Ok(Some(Self { name, shape, values }))
    }
}
