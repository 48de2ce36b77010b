//! Recorded counts as the CAN traffic that would have carried them.

use super::fitted::{IN_ORDER_OF_CHIPS, recorded_taxels};
use super::pauses::without_pauses;
use anyhow::bail;
use taxel_can::{CanFrame, Received};
use taxel_record::Recording;
use taxel_skin::Layout;

/// Time from one frame on a bus to the next: 8,000 frames/s, what a bus of 1 Mbit/s carries
/// (docs/protocols.md, "Bus timing").
const FRAME_NS: u64 = 125_000;
/// Status of a sensor that streams and has no error: burst mode, eight reply bytes (docs/protocols.md,
/// "MLX90393 status").
const STATUS: u8 = 0x83;

/// Whether counts can be sent as CAN frames of a hand: every taxel has one of its own. Boards that put several taxels into
/// a frame, pressure arrays and skins in a file have none.
pub(crate) fn can_carry_counts(layout: &Layout) -> bool {
    (0..layout.len()).all(|taxel| layout.can_id(taxel).is_some())
}

/// Turns each frame of a recording into one sweep of every board of a hand.
#[derive(Debug)]
pub struct Sweeps<'a> {
    recording: &'a Recording,
    layout: &'a Layout,
    /// For each place in the sweep, one taxel per bus as long as the bus has any: bus, taxel, recorded taxel.
    order: Vec<(u8, usize, usize)>,
    /// When each sweep begins, nanoseconds after the first.
    begins_ns: Vec<u64>,
    /// Frames that one sweep puts on the fullest bus.
    longest: usize,
}

impl<'a> Sweeps<'a> {
    /// What they are made of.
    pub(crate) fn recording(&self) -> &'a Recording {
        self.recording
    }

    /// The hand that they are of.
    pub(crate) fn layout(&self) -> &'a Layout {
        self.layout
    }

    /// Refuses a recording that does not fit the hand. With `tile`, the recording is of one module
    /// and is repeated on each.
    pub fn new(recording: &'a Recording, layout: &'a Layout, tile: bool) -> anyhow::Result<Self> {
        let name = recording.name();
        if layout.buses.is_empty() {
            let of_xela = match recording.is_of_xela() && recording.taxels() == 16 {
                true => format!(
                    ", of one 4x4 module uskin-module, and put the taxels into its order: {IN_ORDER_OF_CHIPS}"
                ),
                false => String::new(),
            };
            bail!(
                "layout {} has no buses, so there is no board to play {name} as; name the layout of a hand with boards \
                 with --layout{of_xela}",
                layout.name
            );
        }
        let recorded = recorded_taxels(recording, layout, tile)?;
        let mut buses: Vec<Vec<(u8, usize, usize)>> = vec![Vec::new(); layout.buses.len()];
        for (taxel, recorded) in recorded.into_iter().enumerate() {
            let module = layout.module_of(taxel);
            if layout.can_id(taxel).is_none() {
                bail!(
                    "module {} of layout {} has no CAN frame for each taxel, so {name} cannot be sent as CAN; its frames \
                     can be read as they are, and written as .npz or .csv",
                    module.name,
                    layout.name
                );
            }
            let bus = layout.wiring_of(taxel).bus;
            buses[usize::from(bus)].push((bus, taxel, recorded));
        }
        let longest = buses.iter().map(Vec::len).max().unwrap_or(0);
        let order = (0..longest)
            .flat_map(|i| buses.iter().filter_map(move |bus| bus.get(i).copied()))
            .collect();
        Ok(Self {
            recording,
            layout,
            order,
            begins_ns: begins_ns(recording, longest),
            longest,
        })
    }

    /// Time between two frames of a bus during sweep `index`: as close as a bus allows, and closer
    /// where the next sweep would otherwise begin before this one ends.
    fn spacing_ns(&self, index: usize) -> u64 {
        let begins = &self.begins_ns;
        let period = match begins.len() {
            1 => return FRAME_NS,
            len if index + 1 < len => begins[index + 1] - begins[index],
            _ => begins[index] - begins[index - 1],
        };
        FRAME_NS.min(period / self.longest as u64)
    }

    /// Every frame of every sweep in the order of their times, which begin at zero: bus, time, frame.
    pub(crate) fn frames(&self) -> impl Iterator<Item = (u8, Received)> + '_ {
        (0..self.recording.len()).flat_map(move |index| self.sweep(index))
    }

    /// The sweep that has begun last at this time.
    pub(crate) fn index_at(&self, t_ns: u64) -> usize {
        self.begins_ns
            .partition_point(|begin| *begin <= t_ns)
            .saturating_sub(1)
    }

    /// Where the zero of the times played is on the clock of the recording, nanoseconds: the time of a frame is that of its
    /// newest reading, with which its sweep ends. No sweep begins before the clock's own zero.
    pub(crate) fn origin_ns(&self) -> u64 {
        self.recording.t_ns(0).saturating_sub(self.end_ns(0))
    }

    /// When a sweep ends, on the times played, nanoseconds: where its last frame on the fullest bus is, sent or not.
    pub(crate) fn end_ns(&self, index: usize) -> u64 {
        self.begins_ns[index] + (self.longest as u64 - 1) * self.spacing_ns(index)
    }

    /// The time of a recorded frame on the clock of the recording, nanoseconds: its own, however fast its sweep is sent,
    /// but for what [`Sweeps::origin_ns`] lacks and the pauses that are left out.
    pub(crate) fn time_ns(&self, index: usize) -> u64 {
        self.origin_ns() + self.end_ns(0) + self.begins_ns[index]
    }

    /// The frames of one sweep; none of a taxel that had no value.
    pub fn sweep(&self, index: usize) -> impl Iterator<Item = (u8, Received)> + '_ {
        let counts = self.recording.counts(index).unwrap_or_default();
        let begin_ns = self.begins_ns[index];
        let spacing_ns = self.spacing_ns(index);
        let mut sent = vec![0u64; self.layout.buses.len()];
        self.order.iter().filter_map(move |&(bus, taxel, recorded)| {
            let place = &mut sent[usize::from(bus)];
            let t_ns = begin_ns + *place * spacing_ns;
            *place += 1;
            let frame = self.frame(taxel, counts[recorded]?);
            Some((bus, Received { t_ns, frame }))
        })
    }

    fn frame(&self, taxel: usize, counts: [u16; 3]) -> CanFrame {
        let wiring = self.layout.wiring_of(taxel);
        let frame = wiring
            .protocol
            .frame(wiring.board, self.layout.k[taxel], counts, STATUS);
        frame.expect("every taxel was found to have an id")
    }
}

/// When each sweep begins, `longest` frames on the fullest bus: as recorded, but for pauses that are too long
/// ([`without_pauses`]).
pub(crate) fn begins_ns(recording: &Recording, longest: usize) -> Vec<u64> {
    without_pauses(recording, FRAME_NS * longest as u64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array3;
    use taxel_record::ReadOptions;
    use taxel_skin::{Decoded, Decoder, Readings};

    fn recording(frames: usize, taxels: usize, rate_hz: f64) -> Recording {
        let dir = tempfile::TempDir::new().unwrap();
        let path = dir.path().join("counts.npy");
        let array = Array3::from_shape_fn((frames, taxels, 3), |(t, n, axis)| {
            (t * 1000 + n * 3 + axis) as u16
        });
        ndarray_npy::write_npy(&path, &array).unwrap();
        Recording::open(
            &path,
            &ReadOptions {
                rate_hz: Some(rate_hz),
                ..Default::default()
            },
        )
        .unwrap()
    }

    fn hand() -> Layout {
        Layout::builtin("allegro-uskin-15").unwrap()
    }

    #[test]
    fn the_frames_of_a_sweep_decode_to_the_recorded_counts() {
        let (layout, recording) = (hand(), recording(2, 240, 30.0));
        let sweeps = Sweeps::new(&recording, &layout, false).unwrap();
        let mut decoders: Vec<Decoder> = (0..2).map(|bus| Decoder::new(&layout, bus)).collect();
        let mut decoded = vec![None; 240];
        let mut readings = Readings::new();
        for (bus, received) in sweeps.sweep(1) {
            let what = decoders[usize::from(bus)].decode(&received.frame, &mut readings);
            assert!(matches!(what, Decoded::Readings), "{:?}", received.frame);
            for reading in readings.iter() {
                assert_eq!(decoded[usize::from(reading.taxel)].replace(reading.counts), None);
            }
        }
        for (taxel, counts) in decoded.into_iter().enumerate() {
            assert_eq!(counts, recording.counts(1).unwrap()[taxel], "taxel {taxel}");
        }
    }

    #[test]
    fn times_begin_at_zero_and_rise_and_no_sweep_runs_into_the_next() {
        let layout = hand();
        for rate_hz in [1.0, 30.0, 200.0] {
            let recording = recording(3, 240, rate_hz);
            let sweeps = Sweeps::new(&recording, &layout, false).unwrap();
            let times: Vec<u64> = sweeps.frames().map(|(_, r)| r.t_ns).collect();
            assert_eq!((times.len(), times[0]), (720, 0));
            assert!(times.is_sorted(), "{rate_hz} Hz");
            assert_eq!(times[240], recording.t_ns(1));
            assert!(times[239] < times[240]);
        }
    }

    #[test]
    fn sweeps_go_on_where_the_recorder_s_clock_was_set() {
        const YEAR_NS: u64 = 365 * 24 * 3600 * 1_000_000_000;
        for (times_ns, begins_ns) in [
            (
                vec![0, 10_000_000, 20_000_000, 61_020_000_000, 61_030_000_000],
                vec![0, 10_000_000, 20_000_000, 30_000_000, 40_000_000],
            ),
            (vec![5, YEAR_NS], vec![0, 16 * FRAME_NS]),
        ] {
            let dir = tempfile::TempDir::new().unwrap();
            let path = dir.path().join("counts.npz");
            let mut npz = ndarray_npy::NpzWriter::new(std::fs::File::create(&path).unwrap());
            npz.add_array("counts", &Array3::<u16>::zeros((times_ns.len(), 16, 3)))
                .unwrap();
            npz.add_array("t_ns", &ndarray::Array1::from(times_ns)).unwrap();
            npz.finish().unwrap();
            let recording = Recording::open(&path, &ReadOptions::default()).unwrap();
            let layout = Layout::builtin("uskin-module").unwrap();
            let sweeps = Sweeps::new(&recording, &layout, false).unwrap();
            assert_eq!(sweeps.begins_ns, begins_ns);
        }
    }

    #[test]
    fn one_module_is_repeated_on_every_module() {
        let (layout, recording) = (hand(), recording(1, 16, 30.0));
        let sweeps = Sweeps::new(&recording, &layout, true).unwrap();
        assert_eq!(sweeps.sweep(0).count(), 240);
        for (_, taxel, recorded) in &sweeps.order {
            assert_eq!(taxel % 16, *recorded);
        }
    }

    #[test]
    fn a_recording_that_does_not_fit_says_what_to_do() {
        let layout = hand();
        for (taxels, tile, wanted) in [
            (16, false, "--tile"),
            (8, false, "--layout"),
            (8, true, "--tile needs"),
        ] {
            let message = Sweeps::new(&recording(1, taxels, 30.0), &layout, tile)
                .unwrap_err()
                .to_string();
            assert!(message.contains(wanted), "{message}");
        }
        let grid = Layout::grid(4, 4).unwrap();
        let message = Sweeps::new(&recording(1, 16, 30.0), &grid, false)
            .unwrap_err()
            .to_string();
        assert!(message.contains("no buses"), "{message}");
    }
}
