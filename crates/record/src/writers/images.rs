//! Tactile images as `.npy`, `.npz` and `.csv`.

use crate::error::RecordError;
use crate::numpy::npz_writer::{NpzWriter, write_column};
use crate::numpy::spool::Column;
use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use taxel_hand::TactileImage;

/// Fields of one actuator in the `actuators` array: id, x, y, level, force.
const ACTUATOR_FIELDS: usize = 5;

/// Tactile images of one shape, collected to be written together. They are put aside on the disk, beside the file.
#[derive(Debug)]
pub struct ImageStack {
    path: PathBuf,
    width: usize,
    height: usize,
    max_levels: usize,
    max_actuators: usize,
    pixels: Column<u8>,
    levels: Column<f64>,
    actuators: Column<f64>,
    seq: Column<u64>,
    t_ns: Column<u64>,
    contacts: Column<u16>,
    faulty: Column<u16>,
    missing: Column<u16>,
    /// Of every image as many as of the first.
    joints: Column<f32>,
}

impl ImageStack {
    /// An empty stack for this file, of images `height x width` with at most `max_levels` force levels (`K_D`) and
    /// `max_actuators` actuators (`K_A`).
    pub fn new(path: &Path, width: u16, height: u16, max_levels: u16, max_actuators: u16) -> Self {
        Self {
            path: path.into(),
            width: width.into(),
            height: height.into(),
            max_levels: max_levels.into(),
            max_actuators: max_actuators.into(),
            pixels: Column::beside(path),
            levels: Column::beside(path),
            actuators: Column::beside(path),
            seq: Column::beside(path),
            t_ns: Column::beside(path),
            contacts: Column::beside(path),
            faulty: Column::beside(path),
            missing: Column::beside(path),
            joints: Column::beside(path),
        }
    }

    /// Number of images.
    pub fn len(&self) -> usize {
        self.seq.len()
    }

    /// Whether there is no image yet.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Adds an image.
    ///
    /// # Errors
    /// Where the disk does not take it.
    ///
    /// # Panics
    /// When it has another shape, or more levels or actuators, than the stack was made for, or
    /// another number of joints than the image before.
    pub fn push(&mut self, image: &TactileImage) -> Result<(), RecordError> {
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
        self.put(image).map_err(RecordError::io(&self.path))?;
        assert_eq!(
            self.joints.len(),
            self.len() * image.joints.len(),
            "number of joints"
        );
        Ok(())
    }

    fn put(&mut self, image: &TactileImage) -> io::Result<()> {
        let filled = |count: usize| std::iter::repeat_n(f64::NAN, count);
        let levels = image.levels.iter().copied();
        let actuators = (image.actuators.iter())
            .flat_map(|a| [a.id.into(), a.x.into(), a.y.into(), a.level.into(), a.force]);
        let lacking = self.max_actuators - image.actuators.len();
        self.pixels.extend(image.pixels.iter().copied())?;
        self.levels
            .extend(levels.chain(filled(self.max_levels - image.levels.len())))?;
        self.actuators
            .extend(actuators.chain(filled(lacking * ACTUATOR_FIELDS)))?;
        self.seq.extend([image.seq])?;
        self.t_ns.extend([image.t_ns])?;
        self.contacts.extend([image.contacts])?;
        self.faulty.extend([image.faulty])?;
        self.missing.extend([image.missing])?;
        self.joints.extend(image.joints.iter().copied())
    }

    /// Writes the images alone: `.npy`, `T x H x W` u8. Their pixels are there no longer then.
    pub fn write_npy(&mut self) -> Result<(), RecordError> {
        let shape = [self.len(), self.height, self.width];
        let written = File::create(&self.path).and_then(|file| write_column(file, &shape, &mut self.pixels));
        written.map_err(RecordError::io(&self.path))
    }

    /// Writes a compressed `.npz`: `images` `T x H x W` u8; `levels` `T x K_D` f64; `actuators` `T
    /// x K_A x 5` f64 (id, x, y, level, force); `seq` and `t_ns` u64; `contacts`, `faulty` and
    /// `missing` u16; where joints were read, `joints` `T x J` f32, radians. Levels and actuators
    /// that a frame does not have, and unknown angles, are NaN. There is none left then.
    pub fn write_npz(&mut self) -> Result<(), RecordError> {
        let frames = self.len();
        let mut npz = NpzWriter::compressed(&self.path);
        npz.add_column("images", &[frames, self.height, self.width], &mut self.pixels)?;
        npz.add_column("levels", &[frames, self.max_levels], &mut self.levels)?;
        let actuators = [frames, self.max_actuators, ACTUATOR_FIELDS];
        npz.add_column("actuators", &actuators, &mut self.actuators)?;
        npz.add_column("seq", &[frames], &mut self.seq)?;
        npz.add_column("t_ns", &[frames], &mut self.t_ns)?;
        npz.add_column("contacts", &[frames], &mut self.contacts)?;
        npz.add_column("faulty", &[frames], &mut self.faulty)?;
        npz.add_column("missing", &[frames], &mut self.missing)?;
        if self.joints.len() > 0 {
            let joints = [frames, self.joints.len() / frames];
            npz.add_column("joints", &joints, &mut self.joints)?;
        }
        npz.finish()
    }
}

/// Tactile images of one shape as `.csv`, image by image: a header, then `t_ns`, the pixels, row by row from the top left,
/// and, where joints were read, their angles, radians (`J0`, `J1`, ..), one image a line.
#[derive(Debug)]
pub struct ImageTable<W> {
    out: W,
    width: u16,
    height: u16,
    /// Of every image as many as of the first.
    joints: Option<usize>,
}

impl<W: Write> ImageTable<W> {
    /// A table of images `height x width`.
    pub fn new(out: W, width: u16, height: u16) -> Self {
        Self {
            out,
            width,
            height,
            joints: None,
        }
    }

    /// Writes an image.
    ///
    /// # Panics
    /// When it has another shape than the table was made for, or another number of joints than the image before.
    pub fn push(&mut self, image: &TactileImage) -> io::Result<()> {
        assert_eq!(
            (image.width, image.height),
            (self.width, self.height),
            "image shape"
        );
        let joints = self.begin(image.joints.len())?;
        assert_eq!(image.joints.len(), joints, "number of joints");
        write!(self.out, "{}", image.t_ns)?;
        for pixel in &image.pixels {
            write!(self.out, ",{pixel}")?;
        }
        for angle in &image.joints {
            write!(self.out, ",{angle}")?;
        }
        writeln!(self.out)
    }

    /// Writes what is left.
    pub fn finish(&mut self) -> io::Result<()> {
        self.begin(0)?;
        self.out.flush()
    }

    /// Writes the header where there is none yet; the number of joints in it.
    fn begin(&mut self, joints: usize) -> io::Result<usize> {
        if let Some(joints) = self.joints {
            return Ok(joints);
        }
        write!(self.out, "t_ns")?;
        for y in 0..self.height {
            for x in 0..self.width {
                write!(self.out, ",y{y}x{x}")?;
            }
        }
        for joint in 0..joints {
            write!(self.out, ",J{joint}")?;
        }
        writeln!(self.out)?;
        Ok(*self.joints.insert(joints))
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

    fn images() -> [TactileImage; 2] {
        let empty = TactileImage {
            width: 2,
            height: 3,
            pixels: vec![0; 6],
            ..Default::default()
        };
        let full = TactileImage {
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
            ..empty.clone()
        };
        [empty, full]
    }

    fn stack(path: &Path) -> ImageStack {
        let mut stack = ImageStack::new(path, 2, 3, 2, 2);
        images().iter().for_each(|image| stack.push(image).unwrap());
        stack
    }

    #[test]
    fn what_npz_holds_is_what_was_pushed() {
        let dir = TempDir::new().unwrap();
        let path = dir.path().join("images.npz");
        stack(&path).write_npz().unwrap();
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
        let mut table = ImageTable::new(File::create(&path).unwrap(), 1, 2);
        let image = TactileImage {
            width: 1,
            height: 2,
            pixels: vec![7, 9],
            joints: vec![0.25, -1.0],
            ..Default::default()
        };
        table.push(&image).unwrap();
        table.finish().unwrap();
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
        stack(&path("images.npy")).write_npy().unwrap();
        stack(&path("images.npz")).write_npz().unwrap();
        let mut table = ImageTable::new(File::create(path("images.csv")).unwrap(), 2, 3);
        images().iter().for_each(|image| table.push(image).unwrap());
        table.finish().unwrap();
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

    #[test]
    fn many_images_are_not_in_memory_and_come_out_as_they_were() {
        let dir = TempDir::new().unwrap();
        let path = dir.path().join("images.npz");
        let mut stack = ImageStack::new(&path, 32, 32, 1, 1);
        let mut image = TactileImage {
            width: 32,
            height: 32,
            pixels: vec![0; 1024],
            ..Default::default()
        };
        for n in 0..2000_u64 {
            (image.seq, image.pixels[1000]) = (n, n as u8);
            stack.push(&image).unwrap();
        }
        assert!(stack.pixels.is_on_disk() && !stack.seq.is_on_disk());
        // Whatever ends the process now leaves nothing.
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
        stack.write_npz().unwrap();
        let mut npz = NpzReader::new(File::open(&path).unwrap()).unwrap();
        let images: Array3<u8> = npz.by_name("images").unwrap();
        assert_eq!(images.dim(), (2000, 32, 32));
        assert!((0..2000).all(|n| images[[n, 31, 8]] == n as u8));
        let seq: ndarray::Array1<u64> = npz.by_name("seq").unwrap();
        assert!(seq.iter().copied().eq(0..2000));
    }
}
