//! `taxel convert --images`: what a display was shown, out of an MCAP recording.

use crate::recorded_hands::put_hand;
use crate::succeeds;
use ndarray::{Array2, Array3};
use ndarray_npy::NpzReader;
use std::fs::File;
use taxel_hand::{Actuator, Profile, TactileImage};
use taxel_recorder::{Entry, Preamble, RecordingWriter, Topic, image_message};
use taxel_wire::{Header, ImageView, encode_image_payload};
use tempfile::TempDir;

#[test]
fn images_of_one_display_have_one_shape_however_few_of_its_actuators_press() {
    let dir = TempDir::new().unwrap();
    for (file, pressing) in [("two.mcap", 2), ("none.mcap", 0)] {
        let path = dir.path().join(file);
        let mut writer =
            RecordingWriter::begin(File::create(path).unwrap(), &Preamble::default(), 0).unwrap();
        put_hand(&mut writer, "uskin-module", 1_000_000_000, 0);
        let actuator = |id| Actuator {
            id,
            x: id,
            y: 0,
            level: 1,
            force: 9.0,
        };
        let image = TactileImage {
            width: 4,
            height: 4,
            pixels: vec![0; 16],
            levels: vec![9.0],
            actuators: (0..pressing).map(actuator).collect(),
            ..TactileImage::default()
        };
        let mut payload = Vec::new();
        encode_image_payload(&image, &mut payload).unwrap();
        let header = Header::of_image(&image, payload.len());
        let data = image_message(&header, &ImageView::decode(&payload).unwrap());
        let (topic, wall_ns) = (Topic::Images, 1_100_000_000);
        writer.put(&Entry { topic, wall_ns, data }).unwrap();
        // The hand that is described next is not shown in this file.
        put_hand(&mut writer, "allegro-uskin-15", 1_200_000_000, 0);
        writer.finish().unwrap();
        succeeds(&dir, &["convert", file, "images.npz", "--images"]);
        let mut npz = NpzReader::new(File::open(dir.path().join("images.npz")).unwrap()).unwrap();
        let display = Profile::default();
        let actuators: Array3<f64> = npz.by_name("actuators").unwrap();
        assert_eq!(actuators.dim(), (1, display.actuators.into(), 5), "{file}");
        let press = actuators.outer_iter().flat_map(|image| image.column(0).to_vec());
        assert_eq!(press.filter(|id| !id.is_nan()).count(), usize::from(pressing));
        let levels: Array2<f64> = npz.by_name("levels").unwrap();
        assert_eq!(levels.dim(), (1, display.levels.into()), "{file}");
    }
}
