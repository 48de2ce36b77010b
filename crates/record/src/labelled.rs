//! Frames that say what was touched: for judging what of it can still be told from a tactile image.

use crate::error::{RecordError, SOMETHING};
use crate::numpy::npy::Array;
use crate::numpy::npz::Npz;
use std::io::Read;
use std::path::Path;

const FRAMES: &str = "frames";
const LABELS: &str = "labels";
const EXPECTED: &str = "frames of T x H x W or T x N magnitudes with an array `labels` of T numbers, or without one \
                        class x trial x H x W or class x trial x moment x H x W, whose first moment is taken";

/// Frames of magnitudes, and the class that each is of.
#[derive(Debug, Clone, PartialEq)]
pub struct Labelled {
    /// The file and its array, for messages.
    pub name: String,
    /// Forces of each frame, one per taxel, finite.
    pub frames: Vec<Vec<f64>>,
    /// Class of each frame; the same numbers are the same class.
    pub labels: Vec<usize>,
    /// How many trials each class has, where the first axes of the array say which is which.
    pub trials: Option<usize>,
    /// Height and width of the image, where the array has them.
    pub image_shape: Option<(usize, usize)>,
}

impl Labelled {
    /// Reads the array `frames` (or the one named) of a `.npz`, with the array `labels`, T whole numbers.
    /// Without labels the first two axes are class and trial, and a third before height and width is the
    /// moment, of which the first is taken; whole numbers of four axes whose last is 3 are counts, and none of that, unless
    /// they are images of the height and width that are told.
    ///
    /// # Errors
    ///
    /// Any [`RecordError`], with the file and the array.
    pub fn open(path: &Path, array: Option<&str>, image: Option<[usize; 2]>) -> Result<Self, RecordError> {
        let mut npz = Npz::open(path)?;
        let array = array.unwrap_or(FRAMES);
        if !npz.has(array) {
            let holds = format!(
                "has no array {array:?}; name one with --array; it holds:\n{}",
                npz.list()
            );
            return Err(RecordError::unfit(path.display(), holds));
        }
        let frames = npz.array(array)?;
        let (at, shape) = (frames.at.clone(), frames.shape().to_vec());
        let are_counts = frames.has_whole_numbers();
        let values = frames.numbers()?;
        let labels = npz.has(LABELS).then(|| labels(npz.array(LABELS)?)).transpose()?;
        if let (&[_, _, height, 3], None, true) = (&shape[..], &labels, are_counts)
            && image != Some([height, 3])
        {
            let reason = format!(
                "{shape:?} whole numbers are x y z counts of each taxel, and nothing says what was touched; expected \
                 {EXPECTED}; --layout grid:{height}x3 says that they are class x trial x {height} x 3"
            );
            return Err(RecordError::unreadable(at, reason));
        }
        Self::new(at, &shape, &values, labels)
    }

    fn new(
        name: String,
        shape: &[usize],
        values: &[f64],
        labels: Option<Vec<usize>>,
    ) -> Result<Self, RecordError> {
        if let Some(value) = values.iter().find(|v| !v.is_finite()) {
            return Err(RecordError::unreadable(
                name,
                format!("{value} is no force; a magnitude is a finite number"),
            ));
        }
        if shape.contains(&0) {
            return Err(RecordError::shape(&name, shape, SOMETHING));
        }
        // Frames that follow each other in the array, of which one in so many is taken.
        let (every, image_shape) = match (shape, &labels) {
            (&[_, _], Some(_)) => (1, None),
            (&[_, h, w], Some(_)) | (&[_, _, h, w], None) => (1, Some((h, w))),
            (&[_, _, moments, h, w], None) => (moments, Some((h, w))),
            _ => return Err(RecordError::shape(&name, shape, EXPECTED)),
        };
        let taxels = image_shape.map_or(shape[shape.len() - 1], |(h, w)| h * w);
        let frames: Vec<Vec<f64>> = values
            .chunks_exact(taxels)
            .step_by(every)
            .map(<[f64]>::to_vec)
            .collect();
        let trials = labels.is_none().then(|| shape[1]);
        let labels = labels.unwrap_or_else(|| (0..frames.len()).map(|n| n / shape[1]).collect());
        if labels.len() != frames.len() {
            let reason = format!("{} labels for {} frames", labels.len(), frames.len());
            return Err(RecordError::unreadable(name, reason));
        }
        Ok(Self {
            name,
            frames,
            labels,
            trials,
            image_shape,
        })
    }
}

fn labels(array: Array<impl Read>) -> Result<Vec<usize>, RecordError> {
    let at = array.at.clone();
    if !array.has_numbers() {
        let reason = format!(
            "elements are {}; a label is a whole number from 0 on: numpy.unique(labels, return_inverse=True)[1] makes such",
            array.dtype()
        );
        return Err(RecordError::unreadable(at, reason));
    }
    let label = |v: f64| (v >= 0.0 && v.fract() == 0.0).then_some(v as usize);
    let labels: Option<Vec<usize>> = array.numbers()?.into_iter().map(label).collect();
    labels.ok_or_else(|| RecordError::unreadable(at, "a label is a whole number from 0 on"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(shape: &[usize], labels: Option<Vec<usize>>) -> Result<Labelled, String> {
        let values: Vec<f64> = (0..shape.iter().product::<usize>()).map(|v| v as f64).collect();
        Labelled::new("objects".into(), shape, &values, labels).map_err(|e| e.to_string())
    }

    #[test]
    fn classes_are_named_by_labels_or_by_the_first_axis() {
        let flat = of(&[3, 4], Some(vec![7, 7, 2])).unwrap();
        assert_eq!((&flat.labels[..], flat.image_shape), (&[7, 7, 2][..], None));
        assert_eq!(flat.frames[2], [8.0, 9.0, 10.0, 11.0]);
        let image = of(&[2, 1, 2], Some(vec![0, 1])).unwrap();
        assert_eq!((image.frames.len(), image.image_shape), (2, Some((1, 2))));
        let trials = of(&[2, 3, 1, 2], None).unwrap();
        assert_eq!(trials.labels, [0, 0, 0, 1, 1, 1]);
        assert_eq!((image.trials, trials.trials), (None, Some(3)));
        let moments = of(&[2, 2, 3, 1, 2], None).unwrap();
        assert_eq!(moments.labels, [0, 0, 1, 1]);
        assert_eq!(
            moments.frames,
            [[0.0, 1.0], [6.0, 7.0], [12.0, 13.0], [18.0, 19.0]]
        );
    }

    #[test]
    fn what_is_not_labelled_is_refused_with_what_would_be() {
        for (shape, labels, wanted) in [
            (&[3, 4][..], None, "labels"),
            (&[3, 0], Some(vec![1, 1, 1]), "at least one"),
            (&[3, 4], Some(vec![1]), "1 labels for 3 frames"),
            (&[2, 2, 2, 2], Some(vec![1, 1]), "expected frames of"),
        ] {
            let message = of(shape, labels).unwrap_err();
            assert!(
                message.contains(wanted) && message.starts_with("objects"),
                "{message}"
            );
        }
    }

    #[test]
    fn labels_that_are_text_are_refused_with_what_they_should_be() {
        let text = "{'descr': '<U4', 'fortran_order': False, 'shape': (2,)}";
        let bytes = [
            b"\x93NUMPY\x01\x00\x76\x00",
            format!("{text:117}\n").as_bytes(),
            &[0; 32],
        ]
        .concat();
        let message = labels(Array::open("labels".into(), &bytes[..]).unwrap())
            .unwrap_err()
            .to_string();
        assert!(
            message.contains("elements are U4; a label is a whole number"),
            "{message}"
        );
    }

    #[test]
    fn counts_without_labels_are_no_trials() {
        let dir = tempfile::TempDir::new().unwrap();
        let path = dir.path().join("counts.npz");
        let mut npz = ndarray_npy::NpzWriter::new(std::fs::File::create(&path).unwrap());
        npz.add_array("frames", &ndarray::Array4::<u16>::ones((20, 4, 2, 3)))
            .unwrap();
        npz.add_array("moments", &ndarray::Array5::<u16>::ones((5, 4, 2, 2, 3)))
            .unwrap();
        npz.add_array("forces", &ndarray::Array4::<f64>::ones((20, 4, 2, 3)))
            .unwrap();
        npz.finish().unwrap();
        let message = Labelled::open(&path, None, None).unwrap_err().to_string();
        assert!(
            message.contains("[20, 4, 2, 3] whole numbers are x y z counts") && message.contains("`labels`"),
            "{message}"
        );
        assert!(message.contains("--layout grid:2x3 says"), "{message}");
        let open = |array, image| Labelled::open(&path, Some(array), image);
        assert_eq!(open("forces", None).unwrap().trials, Some(4));
        let image = open("frames", Some([2, 3])).unwrap();
        assert_eq!((image.trials, image.image_shape), (Some(4), Some((2, 3))));
        assert!(open("frames", Some([3, 2])).is_err());
        assert_eq!(open("moments", None).unwrap().image_shape, Some((2, 3)));
    }

    #[test]
    fn labels_are_whole_numbers_of_any_type() {
        let dir = tempfile::TempDir::new().unwrap();
        let path = dir.path().join("objects.npz");
        let mut npz = ndarray_npy::NpzWriter::new(std::fs::File::create(&path).unwrap());
        npz.add_array("frames", &ndarray::Array2::<u16>::ones((2, 3)))
            .unwrap();
        npz.add_array("labels", &ndarray::arr1(&[4_i64, 9])).unwrap();
        npz.finish().unwrap();
        assert_eq!(Labelled::open(&path, None, None).unwrap().labels, [4, 9]);
        let missing = Labelled::open(&path, Some("other"), None)
            .unwrap_err()
            .to_string();
        assert!(
            missing.contains("\"other\"") && missing.contains("labels"),
            "{missing}"
        );
    }
}
