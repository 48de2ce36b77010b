//! Files that people write and programs leave behind.

use std::path::{Path, PathBuf};
use taxel_forearm::{Matrix, read_mat, write_mat};
use taxel_record::{Columns, ReadOptions, Recording, TimeUnit};
use taxel_recorder::{
    CanFrames, CanReader, RecordedFrame, RecordingReader, Topic, read_event, read_image, read_text,
};
use taxel_sim::Scene;
use taxel_skin::{Decoder, Layout};
use taxeld::Config;

/// The text of a layout file: a layout that can be used, or an error that can be printed.
pub fn layout_file(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else {
        return;
    };
    match Layout::parse(text, "fuzz.toml") {
        Ok(layout) => {
            for bus in 0..layout.buses.len() {
                Decoder::new(&layout, bus as u8);
            }
            for (n, taxel) in layout.taxels.iter().enumerate() {
                assert_eq!(layout.taxel_at(taxel.x, taxel.y), Some(n));
            }
            for pose in layout.modules.iter().filter_map(|module| module.pose) {
                let length: f32 = pose.orientation.iter().map(|v| v * v).sum();
                assert!((length - 1.0).abs() < 1e-5, "{pose:?}");
                assert!(pose.position_mm.iter().all(|v| v.is_finite()), "{pose:?}");
            }
        }
        Err(error) => assert!(error.to_string().starts_with("fuzz.toml:")),
    }
}

/// The text of the daemon's configuration: one that is complete, or an error with a line. Layouts
/// are looked for in an empty place.
pub fn configuration(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else {
        return;
    };
    match Config::parse(text, Path::new("fuzz-has-no-such-folder/fuzz.toml")) {
        Ok(config) => assert_eq!(config.sources.len(), config.layout.buses.len()),
        Err(error) => assert!(error.to_string().contains("fuzz.toml"), "{error}"),
    }
}

/// The text of a scene: one with a length, or an error with a line.
pub fn scene_file(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else {
        return;
    };
    match Scene::parse(text, "fuzz.toml") {
        Ok(scene) => assert!(scene.length_ns() > 0),
        Err(error) => assert!(error.to_string().starts_with("fuzz.toml:"), "{error}"),
    }
}

/// The first byte says whether the rest is a `.npy` or a `.npz`, and what its columns are.
pub fn array_file(data: &[u8]) {
    let Some((choice, bytes)) = data.split_first() else {
        return;
    };
    let options = ReadOptions {
        columns: columns(*choice),
        ..ReadOptions::default()
    };
    check_recording(if choice & 1 == 0 { "npy" } else { "npz" }, bytes, &options);
}

/// The first byte says what the columns of the `.csv` are.
pub fn csv_file(data: &[u8]) {
    let Some((choice, bytes)) = data.split_first() else {
        return;
    };
    let options = ReadOptions {
        columns: columns(*choice),
        time_column: (choice & 8 != 0).then_some(TimeUnit::Ms),
        ..ReadOptions::default()
    };
    check_recording("csv", bytes, &options);
}

/// A MATLAB file: a matrix of whole columns, or an error with a byte of the file.
pub fn mat_file(data: &[u8]) {
    match read_mat(data, "datos") {
        Ok(matrix) => {
            assert!(matrix.rows == 0 || matrix.values.len() % matrix.rows == 0);
            let again = read_mat(
                &write_mat(&Matrix {
                    name: "datos".into(),
                    ..matrix.clone()
                }),
                "datos",
            )
            .expect("what was written");
            assert_eq!(again.values.len(), matrix.values.len());
        }
        Err(torn) => assert!(!torn.reason.is_empty()),
    }
}

/// The first byte says whether the rest is an `.mcap` or a message of one.
pub fn recording_file(data: &[u8]) {
    let Some((choice, bytes)) = data.split_first() else {
        return;
    };
    match choice % 4 {
        0 => {
            let path = put("mcap", bytes);
            let mut reader = RecordingReader::open(&path, &Topic::ALL).expect("the file is there");
            while let Ok(Some(_)) = reader.next_item() {}
            assert!(reader.position() <= bytes.len() as u64);
            let mut frames = CanReader::open(&path).expect("the file is there");
            while let Ok(Some((bus, received))) = frames.next_frame() {
                assert!(bus < frames.names().len() && received.frame.data().len() <= 8);
            }
            std::fs::remove_file(&path).expect("the file is there");
        }
        1 => {
            if let Some(frames) = CanFrames::read(bytes) {
                assert_eq!(
                    frames
                        .iter()
                        .filter(|(bus, _)| usize::from(*bus) < frames.buses.len())
                        .count(),
                    frames.len()
                );
            }
        }
        2 => {
            if let Some(frame) = RecordedFrame::read(bytes) {
                assert!(frame.counts().count() + frame.joints().count() <= bytes.len());
            }
            if let Some(image) = read_image(bytes) {
                assert_eq!(
                    image.pixels.len(),
                    usize::from(image.width) * usize::from(image.height)
                );
            }
        }
        _ => {
            let texts = [read_text(bytes), read_event(bytes).map(|(_, text)| text)];
            assert!(texts.into_iter().flatten().all(|text| text.len() < bytes.len()));
        }
    }
}

fn columns(choice: u8) -> Option<Columns> {
    match choice >> 1 & 3 {
        1 => Some(Columns::XyzInterleaved),
        2 => Some(Columns::XyzBlocks),
        _ => None,
    }
}

/// The bytes as a file in memory, one for each process: the readers take paths.
fn put(extension: &str, bytes: &[u8]) -> PathBuf {
    let folder = if Path::new("/dev/shm").is_dir() {
        "/dev/shm".into()
    } else {
        std::env::temp_dir()
    };
    let path = folder.join(format!("taxel-fuzz-{}.{extension}", std::process::id()));
    std::fs::write(&path, bytes).expect("a place for files");
    path
}

/// A recording whose every frame is as large as it says, or an error that can be printed.
fn check_recording(extension: &str, bytes: &[u8], options: &ReadOptions) {
    let path = put(extension, bytes);
    let read = Recording::open(&path, options);
    std::fs::remove_file(&path).expect("the file is there");
    match read {
        Ok(recording) => {
            assert!(!recording.is_empty() && recording.taxels() > 0);
            let last = recording.len() - 1;
            for frame in [0, last] {
                let magnitudes = recording.magnitudes(frame).map(<[f64]>::len);
                let counts = recording.counts(frame).map(<[_]>::len);
                assert_eq!(magnitudes.or(counts), Some(recording.taxels()));
            }
            assert!(recording.t_ns(0) <= recording.t_ns(last));
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
}
