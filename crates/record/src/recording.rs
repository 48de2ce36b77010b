//! A sequence of tactile frames, read from a file.

use crate::error::{RecordError, SOMETHING};
use crate::table::{Columns, DEFAULT_RATE_HZ, ReadOptions, Table};

const SHAPES: &str = "T x H x W or T x N (magnitudes) or T x N x 3 (counts); a T x 3N array of counts needs \
                      --columns xyz-interleaved (x1,y1,z1,x2,..) or --columns xyz-blocks (x1,x2,..,y1,..,z1,..)";
const SHAPES_WITH_COLUMNS: &str =
    "T x 3N, since --columns was given: three columns, x y z, for each of N taxels";

/// The values of a recording, frame after frame.
#[derive(Debug, Clone, PartialEq)]
pub enum Frames {
    /// One finite number per taxel, in the recording's own unit.
    Magnitudes(Vec<f64>),
    /// Raw counts x, y, z per taxel.
    Counts(Vec<[u16; 3]>),
}

/// A sequence of tactile frames of equal size. Frames are numbered from 0, taxels `0..N` in the file's order.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    name: String,
    len: usize,
    taxels: usize,
    shape: Option<(usize, usize)>,
    frames: Frames,
    times_ns: Option<Vec<u64>>,
    rate_hz: f64,
}

impl Recording {
    /// Gives numbers their meaning by their shape and the options.
    pub(crate) fn from_table(table: Table, options: &ReadOptions) -> Result<Self, RecordError> {
        let Table {
            at,
            shape,
            values,
            times_ns,
            columns,
        } = table;
        let wrong_shape = |expected| RecordError::shape(&at, &shape, expected);
        if shape.contains(&0) {
            return Err(wrong_shape(SOMETHING));
        }
        let (taxels, image, frames) = match (shape.as_slice(), columns.or(options.columns)) {
            (&[_, n], None) => (n, None, magnitudes(&at, n, values)?),
            (&[_, n], Some(columns)) if n % 3 == 0 => (
                n / 3,
                None,
                Frames::Counts(counts_of_columns(&at, n / 3, columns, &values)?),
            ),
            (_, Some(_)) => return Err(wrong_shape(SHAPES_WITH_COLUMNS)),
            (&[_, n, 3], None) => (
                n,
                None,
                Frames::Counts(counts_of_columns(&at, n, Columns::XyzInterleaved, &values)?),
            ),
            (&[_, h, w], None) => (h * w, Some((h, w)), magnitudes(&at, h * w, values)?),
            _ => return Err(wrong_shape(SHAPES)),
        };
        let len = shape[0];
        let times_ns = if options.rate_hz.is_some() { None } else { times_ns };
        if let Some(times) = &times_ns {
            if times.len() != len {
                let reason = format!(
                    "{} times for {len} frames; give --rate HZ to ignore them",
                    times.len()
                );
                return Err(RecordError::unreadable(at, reason));
            }
            if let Some(i) = times.windows(2).position(|w| w[1] < w[0]) {
                let reason = format!(
                    "the time of frame {} is before that of the frame before it",
                    i + 1
                );
                return Err(RecordError::unreadable(at, reason));
            }
        }
        let rate_hz = options.rate_hz.unwrap_or(DEFAULT_RATE_HZ);
        Ok(Self {
            name: at,
            len,
            taxels,
            shape: image,
            frames,
            times_ns,
            rate_hz,
        })
    }

    /// The file, and the array where there is one, for messages: `FILE [ARRAY]`.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Number of frames, `T`; at least one.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Always false: a recording has at least one frame.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Number of taxels, `N`; at least one.
    pub fn taxels(&self) -> usize {
        self.taxels
    }

    /// Height and width of the image, where the array was `T x H x W`.
    pub fn image_shape(&self) -> Option<(usize, usize)> {
        self.shape
    }

    /// All frames at once.
    pub fn frames(&self) -> &Frames {
        &self.frames
    }

    /// Whether the frames are raw counts.
    pub fn has_counts(&self) -> bool {
        matches!(self.frames, Frames::Counts(_))
    }

    /// Whether the file recorded the time of each frame; otherwise the rate makes it.
    pub fn has_times(&self) -> bool {
        self.times_ns.is_some()
    }

    /// Time of frame `index`, nanoseconds: as recorded, or `index` divided by the rate.
    ///
    /// # Panics
    /// When the recorded times have no such frame.
    pub fn t_ns(&self, index: usize) -> u64 {
        match &self.times_ns {
            Some(times) => times[index],
            None => (index as f64 * 1e9 / self.rate_hz).round() as u64,
        }
    }

    /// The usual time from one frame to the next, nanoseconds: the median of the recorded ones, or
    /// of the rate.
    pub fn period_ns(&self) -> u64 {
        let Some(times) = self.times_ns.as_ref().filter(|times| times.len() > 1) else {
            return (1e9 / self.rate_hz).round() as u64;
        };
        let mut periods: Vec<u64> = times.windows(2).map(|w| w[1] - w[0]).collect();
        periods.sort_unstable();
        periods[periods.len() / 2]
    }

    /// The magnitudes of frame `index`, one per taxel; `None` for a recording of counts or past the end.
    pub fn magnitudes(&self, index: usize) -> Option<&[f64]> {
        match &self.frames {
            Frames::Magnitudes(values) => values.chunks_exact(self.taxels).nth(index),
            Frames::Counts(_) => None,
        }
    }

    /// The counts of frame `index`, x y z per taxel; `None` for a recording of magnitudes or past the end.
    pub fn counts(&self, index: usize) -> Option<&[[u16; 3]]> {
        match &self.frames {
            Frames::Counts(values) => values.chunks_exact(self.taxels).nth(index),
            Frames::Magnitudes(_) => None,
        }
    }
}

fn magnitudes(at: &str, taxels: usize, values: Vec<f64>) -> Result<Frames, RecordError> {
    match values.iter().position(|v| !v.is_finite()) {
        Some(i) => {
            let (frame, taxel, value) = (i / taxels, i % taxels, values[i]);
            let reason = format!("frame {frame}, taxel {taxel} is {value}; a magnitude is a finite number");
            Err(RecordError::unreadable(at, reason))
        }
        None => Ok(Frames::Magnitudes(values)),
    }
}

fn counts_of_columns(
    at: &str,
    taxels: usize,
    columns: Columns,
    values: &[f64],
) -> Result<Vec<[u16; 3]>, RecordError> {
    let mut counts = Vec::with_capacity(values.len() / 3);
    for (frame, row) in values.chunks_exact(taxels * 3).enumerate() {
        for taxel in 0..taxels {
            let mut xyz = [0; 3];
            for (axis, count) in xyz.iter_mut().enumerate() {
                let column = match columns {
                    Columns::XyzInterleaved => taxel * 3 + axis,
                    Columns::XyzBlocks => axis * taxels + taxel,
                };
                *count = count_of(row[column]).ok_or_else(|| {
                    let value = row[column];
                    let reason = format!(
                        "frame {frame}, value {column} is {value}; a raw count is a whole number from 0 to 65535"
                    );
                    RecordError::unreadable(at, reason)
                })?;
            }
            counts.push(xyz);
        }
    }
    Ok(counts)
}

fn count_of(value: f64) -> Option<u16> {
    ((0.0..=65535.0).contains(&value) && value.fract() == 0.0).then_some(value as u16)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(shape: &[usize], values: Vec<f64>) -> Table {
        assert_eq!(values.len(), shape.iter().product::<usize>());
        Table {
            at: "test".into(),
            shape: shape.into(),
            values,
            times_ns: None,
            columns: None,
        }
    }

    fn ramp(shape: &[usize]) -> Table {
        table(
            shape,
            (0..shape.iter().product::<usize>()).map(|v| v as f64).collect(),
        )
    }

    fn message(table: Table, options: &ReadOptions) -> String {
        Recording::from_table(table, options).unwrap_err().to_string()
    }

    #[test]
    fn the_shape_decides_what_the_numbers_are() {
        let none = ReadOptions::default();
        let image = Recording::from_table(ramp(&[2, 3, 4]), &none).unwrap();
        assert_eq!(
            (image.len(), image.taxels(), image.image_shape()),
            (2, 12, Some((3, 4)))
        );
        assert_eq!(image.magnitudes(1).unwrap()[0], 12.0);
        assert_eq!(image.counts(1), None);

        let flat = Recording::from_table(ramp(&[2, 6]), &none).unwrap();
        assert_eq!(
            (flat.taxels(), flat.image_shape(), flat.has_counts()),
            (6, None, false)
        );

        let counts = Recording::from_table(ramp(&[2, 4, 3]), &none).unwrap();
        assert_eq!((counts.taxels(), counts.has_counts()), (4, true));
        assert_eq!(counts.counts(1).unwrap()[0], [12, 13, 14]);
        assert_eq!(counts.counts(2), None);
    }

    #[test]
    fn columns_of_counts_are_read_in_the_order_given_and_only_when_given() {
        let read = |columns| {
            let options = ReadOptions {
                columns,
                ..Default::default()
            };
            Recording::from_table(ramp(&[2, 6]), &options).unwrap()
        };
        assert!(!read(None).has_counts());
        let interleaved = read(Some(Columns::XyzInterleaved));
        assert_eq!(interleaved.counts(1).unwrap(), [[6, 7, 8], [9, 10, 11]]);
        let blocks = read(Some(Columns::XyzBlocks));
        assert_eq!(blocks.counts(0).unwrap(), [[0, 2, 4], [1, 3, 5]]);
    }

    #[test]
    fn a_shape_that_fits_nothing_says_what_would() {
        let none = ReadOptions::default();
        let blocks = ReadOptions {
            columns: Some(Columns::XyzBlocks),
            ..Default::default()
        };
        for (shape, options, wanted) in [
            (vec![5], &none, "T x N x 3"),
            (vec![2, 2, 2, 2], &none, "T x N x 3"),
            (vec![2, 7], &blocks, "T x 3N"),
            (vec![2, 7, 3], &blocks, "T x 3N"),
            (vec![0, 7], &none, "at least one frame"),
        ] {
            let message = message(ramp(&shape), options);
            assert!(message.contains(wanted), "{message}");
        }
    }

    #[test]
    fn values_that_are_no_counts_or_no_numbers_are_named() {
        let blocks = ReadOptions {
            columns: Some(Columns::XyzBlocks),
            ..Default::default()
        };
        for bad in [-1.0, 65536.0, 0.5, f64::NAN] {
            let mut values = vec![0.0; 12];
            values[8] = bad;
            let message = message(table(&[2, 6], values), &blocks);
            assert!(
                message.contains(&format!("frame 1, value 2 is {bad};")),
                "{message}"
            );
        }
        let mut values = vec![0.0; 12];
        values[7] = f64::INFINITY;
        let message = message(table(&[2, 6], values), &ReadOptions::default());
        assert!(message.contains("frame 1, taxel 1 is inf;"), "{message}");
    }

    #[test]
    fn times_are_recorded_ones_unless_a_rate_is_given() {
        let mut timed = ramp(&[3, 2]);
        timed.times_ns = Some(vec![5, 5, 9]);
        let recording = Recording::from_table(timed, &ReadOptions::default()).unwrap();
        assert_eq!((recording.t_ns(1), recording.t_ns(2)), (5, 9));
        assert_eq!(recording.period_ns(), 4);

        let mut timed = ramp(&[3, 2]);
        timed.times_ns = Some(vec![5, 5, 9]);
        let at_1khz = ReadOptions {
            rate_hz: Some(1000.0),
            ..Default::default()
        };
        assert_eq!(Recording::from_table(timed, &at_1khz).unwrap().t_ns(2), 2_000_000);

        let untimed = Recording::from_table(ramp(&[3, 2]), &ReadOptions::default()).unwrap();
        assert_eq!((untimed.t_ns(1), untimed.period_ns()), (33_333_333, 33_333_333));
    }

    #[test]
    fn times_that_run_backwards_or_do_not_fit_are_refused() {
        for (times, wanted) in [(vec![5, 4, 9], "frame 1"), (vec![1, 2], "2 times for 3 frames")] {
            let mut timed = ramp(&[3, 2]);
            timed.times_ns = Some(times);
            let message = message(timed, &ReadOptions::default());
            assert!(message.contains(wanted), "{message}");
        }
    }
}
