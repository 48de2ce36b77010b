//! Tactile images as `.npy`, `.npz` and `.csv`.

use crate::error::RecordError;
use crate::npz_writer::{NpzWriter, write_npy};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use taxel_hand::TactileImage;

/// Fields of one actuator in the `actuators` array: id, x, y, level, force.
const ACTUATOR_FIELDS: usize = 5;

/// Tactile images of one shape, collected to be written together.
#[derive(Debug, Clone)]
pub struct ImageStack {
    width: usize,
    height: usize,
    max_levels: usize,
    max_actuators: usize,
    pixels: Vec<u8>,
    levels: Vec<f64>,
    actuators: Vec<f64>,
    seq: Vec<u64>,
    t_ns: Vec<u64>,
    contacts: Vec<u16>,
    faulty: Vec<u16>,
    missing: Vec<u16>,
    /// Of every image as many as of the first.
    joints: Vec<f32>,
}

impl ImageStack {
    /// An empty stack of images `height x width` with at most `max_levels` force levels (`K_D`) and
    /// `max_actuators` actuators (`K_A`).
    pub fn new(width: u16, height: u16, max_levels: u16, max_actuators: u16) -> Self {
        Self {
            width: width.into(),
            height: height.into(),
            max_levels: max_levels.into(),
            max_actuators: max_actuators.into(),
            pixels: Vec::new(),
            levels: Vec::new(),
            actuators: Vec::new(),
            seq: Vec::new(),
            t_ns: Vec::new(),
            contacts: Vec::new(),
            faulty: Vec::new(),
            missing: Vec::new(),
            joints: Vec::new(),
        }
    }

    /// Number of images.
    pub fn len(&self) -> usize {
        self.seq.len()
    }

    /// Whether there is no image yet.
    pub fn is_empty(&self) -> bool {
        self.seq.is_empty()
    }

    /// Adds an image.
    ///
    /// # Panics
    /// When it has another shape, or more levels or actuators, than the stack was made for, or
    /// another number of joints than the image before.
    pub fn push(&mut self, image: &TactileImage) {
        assert_eq!(
            (image.width as usize, image.height as usize),
            (self.width, self.height),
            "image shape"
        );
        assert!(
            image.levels.len() <= self.max_levels,
            "{} levels",
            image.levels.len()
        );
        assert!(
            image.actuators.len() <= self.max_actuators,
            "{} actuators",
            image.actuators.len()
        );
        self.pixels.extend_from_slice(&image.pixels);
        self.levels.extend_from_slice(&image.levels);
        for a in &image.actuators {
            self.actuators
                .extend([a.id.into(), a.x.into(), a.y.into(), a.level.into(), a.force]);
        }
        self.seq.push(image.seq);
        self.levels.resize(self.seq.len() * self.max_levels, f64::NAN);
        self.actuators
            .resize(self.seq.len() * self.max_actuators * ACTUATOR_FIELDS, f64::NAN);
        self.t_ns.push(image.t_ns);
        self.contacts.push(image.contacts);
        self.faulty.push(image.faulty);
        self.missing.push(image.missing);
        self.joints.extend_from_slice(&image.joints);
        assert_eq!(
            self.joints.len(),
            self.len() * image.joints.len(),
            "number of joints"
        );
    }

    fn shape(&self) -> [usize; 3] {
        [self.len(), self.height, self.width]
    }

    /// Writes the images alone: `.npy`, `T x H x W` u8.
    pub fn write_npy(&self, path: &Path) -> Result<(), RecordError> {
        let write = || write_npy(File::create(path)?, &self.shape(), self.pixels.iter().copied());
        write().map_err(RecordError::io(path))
    }

    /// Writes a compressed `.npz`: `images` `T x H x W` u8; `levels` `T x K_D` f64; `actuators` `T
    /// x K_A x 5` f64 (id, x, y, level, force); `seq` and `t_ns` u64; `contacts`, `faulty` and
    /// `missing` u16; where joints were read, `joints` `T x J` f32, radians. Levels and actuators
    /// that a frame does not have, and unknown angles, are NaN.
    pub fn write_npz(&self, path: &Path) -> Result<(), RecordError> {
        let frames = self.len();
        let mut npz = NpzWriter::compressed(path);
        npz.add("images", &self.shape(), self.pixels.iter().copied())?;
        let levels = [frames, self.max_levels];
        npz.add("levels", &levels, self.levels.iter().copied())?;
        let actuators = [frames, self.max_actuators, ACTUATOR_FIELDS];
        npz.add("actuators", &actuators, self.actuators.iter().copied())?;
        npz.add("seq", &[frames], self.seq.iter().copied())?;
        npz.add("t_ns", &[frames], self.t_ns.iter().copied())?;
        npz.add("contacts", &[frames], self.contacts.iter().copied())?;
        npz.add("faulty", &[frames], self.faulty.iter().copied())?;
        npz.add("missing", &[frames], self.missing.iter().copied())?;
        if !self.joints.is_empty() {
            let joints = [frames, self.joints.len() / frames];
            npz.add("joints", &joints, self.joints.iter().copied())?;
        }
        npz.finish()
    }

    /// Writes a `.csv`: a header, then `t_ns`, the pixels, row by row from the top left, and, where joints were read,
    /// their angles, radians (`J0`, `J1`, ..), one image a line.
    pub fn write_csv(&self, path: &Path) -> Result<(), RecordError> {
        let write = || {
            let mut file = BufWriter::new(File::create(path)?);
            write!(file, "t_ns")?;
            for y in 0..self.height {
                for x in 0..self.width {
                    write!(file, ",y{y}x{x}")?;
                }
            }
            let joints = self.joints.len() / self.len().max(1);
            for joint in 0..joints {
                write!(file, ",J{joint}")?;
            }
            writeln!(file)?;
            let images = self.pixels.chunks_exact(self.width * self.height);
            for (index, (t_ns, pixels)) in self.t_ns.iter().zip(images).enumerate() {
                write!(file, "{t_ns}")?;
                for pixel in pixels {
                    write!(file, ",{pixel}")?;
                }
                for angle in &self.joints[index * joints..(index + 1) * joints] {
                    write!(file, ",{angle}")?;
                }
                writeln!(file)?;
            }
            file.flush()
        };
        write().map_err(RecordError::io(path))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ReadOptions, Recording};
    use ndarray::{Array2, Array3};
    use ndarray_npy::NpzReader;
    use taxel_hand::Actuator;
    use tempfile::TempDir;

    fn stack() -> ImageStack {
        let mut stack = ImageStack::new(2, 3, 2, 2);
        let empty = TactileImage {
            width: 2,
            height: 3,
            pixels: vec![0; 6],
            ..Default::default()
        };
        stack.push(&empty);
        stack.push(&TactileImage {
            seq: 9,
            t_ns: 1000,
            pixels: vec![0, 255, 0, 0, 0, 128],
            levels: vec![40.0, 80.5],
            actuators: vec![Actuator {
                id: 1,
                x: 1,
                y: 0,
                level: 2,
                force: 80.5,
            }],
            contacts: 2,
            missing: 1,
            ..empty
        });
        stack
    }

    #[test]
    fn what_npz_holds_is_what_was_pushed() {
        let dir = TempDir::new().unwrap();
        let path = dir.path().join("images.npz");
        stack().write_npz(&path).unwrap();
        let mut npz = NpzReader::new(File::open(&path).unwrap()).unwrap();
        let images: Array3<u8> = npz.by_name("images").unwrap();
        assert_eq!(
            (images.dim(), images[[1, 0, 1]], images[[1, 2, 1]]),
            ((2, 3, 2), 255, 128)
        );
        let levels: Array2<f64> = npz.by_name("levels").unwrap();
        assert!(levels.row(0).iter().all(|v| v.is_nan()));
        assert_eq!(levels.row(1).to_vec(), [40.0, 80.5]);
        let actuators: Array3<f64> = npz.by_name("actuators").unwrap();
        assert_eq!(
            actuators.slice(ndarray::s![1, 0, ..]).to_vec(),
            [1.0, 1.0, 0.0, 2.0, 80.5]
        );
        assert!(actuators[[1, 1, 0]].is_nan());
    }

    #[test]
    fn joint_angles_stand_beside_the_pixels_in_csv_and_are_no_pixels() {
        let dir = TempDir::new().unwrap();
        let path = dir.path().join("images.csv");
        let mut stack = ImageStack::new(1, 2, 1, 1);
        stack.push(&TactileImage {
            width: 1,
            height: 2,
            pixels: vec![7, 9],
            joints: vec![0.25, -1.0],
            ..Default::default()
        });
        stack.write_csv(&path).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text, "t_ns,y0x0,y1x0,J0,J1\n0,7,9,0.25,-1\n");
        let recording = Recording::open(&path, &ReadOptions::default()).unwrap();
        assert_eq!(recording.magnitudes(0).unwrap(), [7.0, 9.0]);
        assert_eq!(recording.joints(0), [0.25, -1.0]);
    }

    #[test]
    fn every_format_reads_back_as_a_recording() {
        let dir = TempDir::new().unwrap();
        let path = |name: &str| dir.path().join(name);
        stack().write_npy(&path("images.npy")).unwrap();
        stack().write_npz(&path("images.npz")).unwrap();
        stack().write_csv(&path("images.csv")).unwrap();
        for (name, array) in [
            ("images.npy", None),
            ("images.npz", Some("images")),
            ("images.csv", None),
        ] {
            let options = ReadOptions {
                array: array.map(str::to_owned),
                ..Default::default()
            };
            let recording = Recording::open(&path(name), &options).unwrap();
            assert_eq!((recording.len(), recording.taxels()), (2, 6), "{name}");
            assert_eq!(
                recording.magnitudes(1).unwrap(),
                [0.0, 255.0, 0.0, 0.0, 0.0, 128.0],
                "{name}"
            );
            assert!(!recording.has_times() || recording.t_ns(1) == 1000, "{name}");
        }
    }
}
