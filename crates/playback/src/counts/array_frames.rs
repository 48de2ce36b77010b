//! Recorded counts as the frames that pressure arrays would have sent.

use super::sweep::begins_ns;
use anyhow::bail;
use taxel_can::{Received, pressure_frames};
use taxel_record::Recording;
use taxel_skin::Layout;

/// The hand that is meant where a recording goes to a pressure array and no other is named.
pub const ARRAY_LAYOUT: &str = "tekscan-6077";

/// Whether a hand is pressure arrays and nothing else.
pub fn is_of_arrays(layout: &Layout) -> bool {
    !layout.wiring.is_empty() && layout.wiring.iter().all(|wiring| wiring.array.is_some())
}

/// Turns each frame of a recording into one message of every array of a hand, cut as their source cuts them.
#[derive(Debug)]
pub struct ArrayFrames<'a> {
    recording: &'a Recording,
    layout: &'a Layout,
    /// When each message is sent, nanoseconds after the first.
    begins_ns: Vec<u64>,
}

impl<'a> ArrayFrames<'a> {
    /// Refuses a recording that is not of such a hand, and magnitudes that are no counts.
    pub fn new(recording: &'a Recording, layout: &'a Layout) -> anyhow::Result<Self> {
        let (name, taxels) = (recording.name(), recording.taxels());
        let is_other_image = match (&layout.wiring[..], recording.image_shape()) {
            ([one], Some((height, width))) => {
                one.array.map(|size| size.map(usize::from)) != Some([height, width])
            }
            _ => false,
        };
        if layout.len() != taxels || is_other_image {
            let frame = recording
                .image_shape()
                .map_or(format!("{taxels} taxels"), |(height, width)| {
                    format!("{height} x {width} taxels")
                });
            let modules = layout.modules.iter().zip(&layout.wiring);
            let arrays: Vec<String> = modules
                .map(|(module, wiring)| {
                    let [rows, columns] = wiring.array.unwrap_or_default();
                    format!("{} {rows} x {columns}", module.name)
                })
                .collect();
            bail!(
                "{name} has frames of {frame}, and layout {} has {}; name the layout file of its array with --layout",
                layout.name,
                arrays.join(", ")
            );
        }
        let fits = |value: &&f64| (0.0..=f64::from(u16::MAX)).contains(*value) && value.fract() == 0.0;
        for index in 0..recording.len() {
            let magnitudes = recording.magnitudes(index).unwrap_or_default();
            if let Some(value) = magnitudes.iter().find(|value| !fits(value)) {
                bail!(
                    "{name}: frame {index} holds {value}; an array sends counts, whole numbers from 0 to 65535"
                );
            }
        }
        Ok(Self {
            recording,
            layout,
            begins_ns: begins_ns(recording, 1),
        })
    }

    /// The hand that they are of.
    pub(crate) fn layout(&self) -> &'a Layout {
        self.layout
    }

    /// Every frame of every message in the order of their times, which begin at zero: bus, time, frame.
    pub(crate) fn frames(&self) -> impl Iterator<Item = (u8, Received)> + '_ {
        (0..self.recording.len()).flat_map(move |index| self.messages(index))
    }

    fn messages(&self, index: usize) -> impl Iterator<Item = (u8, Received)> + '_ {
        let t_ns = self.begins_ns[index];
        let counts: Vec<u16> = match self.recording.counts(index) {
            Some(counts) => counts
                .iter()
                .map(|counts| counts.map_or(0, |[_, _, z]| z))
                .collect(),
            None => {
                let magnitudes = self.recording.magnitudes(index).unwrap_or_default();
                magnitudes.iter().map(|value| *value as u16).collect()
            }
        };
        let modules = self.layout.modules.iter().zip(&self.layout.wiring);
        modules.flat_map(move |(module, wiring)| {
            let first = usize::from(module.first_taxel);
            let counts = &counts[first..first + usize::from(module.taxels)];
            let frames = pressure_frames(wiring.array.unwrap_or_default(), index as u32, counts);
            let bus = wiring.bus;
            frames
                .into_iter()
                .map(move |frame| (bus, Received { t_ns, frame }))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array3, ArrayD, IxDyn};
    use taxel_record::ReadOptions;
    use taxel_skin::{Decoded, Decoder, Readings};

    fn opened(write: impl Fn(&std::path::Path), rate_hz: f64) -> Recording {
        let dir = tempfile::TempDir::new().unwrap();
        let path = dir.path().join("counts.npy");
        write(&path);
        let options = ReadOptions {
            rate_hz: Some(rate_hz),
            ..Default::default()
        };
        Recording::open(&path, &options).unwrap()
    }

    fn finger() -> Layout {
        Layout::builtin(ARRAY_LAYOUT).unwrap()
    }

    #[test]
    fn the_frames_of_a_message_decode_to_the_recorded_counts() {
        let value = |t: usize, n: usize| (10_000 * t + n) as u16;
        let images = Array3::from_shape_fn((2, 28, 50), |(t, row, column)| value(t, 50 * row + column));
        let counts = Array3::from_shape_fn((2, 1400, 3), |(t, n, axis)| match axis {
            2 => value(t, n),
            _ => 7,
        });
        let layout = finger();
        for recording in [
            opened(|path| ndarray_npy::write_npy(path, &images).unwrap(), 10.0),
            opened(|path| ndarray_npy::write_npy(path, &counts).unwrap(), 10.0),
        ] {
            let played = ArrayFrames::new(&recording, &layout).unwrap();
            let mut decoder = Decoder::new(&layout, 0);
            let mut readings = Readings::new();
            let mut felt = Vec::new();
            for (bus, received) in played.frames() {
                let decoded = decoder.decode(&received.frame, &mut readings);
                assert_eq!(bus, 0);
                assert!(matches!(decoded, Decoded::Readings), "{decoded:?}");
                let message = received.t_ns / 100_000_000;
                assert_eq!(received.t_ns, message * 100_000_000);
                felt.extend(
                    readings
                        .iter()
                        .map(|r| (message as usize, usize::from(r.taxel), r.counts[2])),
                );
            }
            let expected = (0..2).flat_map(|t| (0..1400).map(move |n| (t, n, value(t, n))));
            assert!(felt.into_iter().eq(expected), "{}", recording.name());
        }
    }

    #[test]
    fn what_no_array_of_the_hand_sends_is_refused() {
        let layout = finger();
        for (shape, value, wanted) in [
            (
                &[2, 50, 28][..],
                1.0,
                "has frames of 50 x 28 taxels, and layout tekscan-6077 has touch 28 x 50",
            ),
            (&[2, 240], 1.0, "has frames of 240 taxels"),
            (&[2, 28, 50], -1.0, "frame 0 holds -1"),
            (&[2, 28, 50], 65536.0, "frame 0 holds 65536"),
            (&[2, 28, 50], 0.3, "frame 0 holds 0.3; an array sends counts"),
        ] {
            let values = ArrayD::from_elem(IxDyn(shape), value);
            let recording = opened(|path| ndarray_npy::write_npy(path, &values).unwrap(), 30.0);
            let message = ArrayFrames::new(&recording, &layout).unwrap_err().to_string();
            assert!(message.contains(wanted), "{message}");
        }
        assert!(is_of_arrays(&layout));
        assert!(!is_of_arrays(&Layout::builtin("allegro-uskin-15").unwrap()));
    }
}
