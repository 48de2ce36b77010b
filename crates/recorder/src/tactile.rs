//! Tactile frames and images.

use crate::cdr::{CdrReader, CdrWriter, Cells};
use crate::standard::freshness_number;
use taxel_hand::{Actuator, Faults, Freshness, TactileImage};
use taxel_wire::{Flags, Header, ImageView, RawView};

/// A tactile frame from taxeld's RAW message.
pub fn frame_message(header: &Header, raw: &RawView<'_>) -> Vec<u8> {
    let (taxels, joints) = (raw.taxels().len(), raw.joints().len());
    let mut cdr = CdrWriter::with_capacity(128 + 32 * taxels + 16 * joints);
    put_head(&mut cdr, header);
    cdr.f32(raw.threshold);
    let counts: Vec<u16> = raw.taxels().flat_map(|taxel| taxel.counts).collect();
    cdr.u16s(counts.into_iter());
    cdr.u16s(raw.taxels().map(|taxel| taxel.faults));
    cdr.f32s(raw.taxels().map(|taxel| taxel.force));
    cdr.u32s(raw.taxels().map(|taxel| taxel.age_us));
    cdr.u8s(raw.taxels().map(|taxel| freshness_number(taxel.freshness)));
    cdr.u8s(raw.taxels().map(|taxel| taxel.status));
    cdr.u8s(
        raw.taxels()
            .map(|taxel| u8::from(taxel.contact) | u8::from(taxel.repaired) << 1),
    );
    cdr.f32s(raw.joints());
    match raw.joint_ages_us() {
        Some(ages) => cdr.u32s(ages),
        None => cdr.u32(0),
    }
    match raw.joint_velocities_rad_s() {
        Some(velocities) => cdr.f32s(velocities),
        None => cdr.u32(0),
    }
    match raw.joint_currents_a() {
        Some(currents) => cdr.f32s(currents),
        None => cdr.u32(0),
    }
    match raw.baselines() {
        Some(baselines) => cdr.f32s(baselines.flatten().collect::<Vec<_>>().into_iter()),
        None => cdr.u32(0),
    }
    cdr.finish()
}

fn put_head(cdr: &mut CdrWriter, header: &Header) {
    cdr.u64(header.seq);
    cdr.u64(header.t_ns);
    cdr.u16(header.flags.bits());
    cdr.u32(header.skipped);
}

/// What an analysis takes of a recorded tactile frame.
#[derive(Debug, Clone)]
pub struct RecordedFrame<'a> {
    /// Number of the frame since the daemon started.
    pub seq: u64,
    /// Time of validity, nanoseconds on the daemon's clock.
    pub t_ns: u64,
    /// Whether the baseline was being measured.
    pub is_calibrating: bool,
    /// Contact threshold, in the daemon's unit of force.
    pub threshold: f32,
    counts: Cells<'a, 2>,
    faults: Cells<'a, 2>,
    ages: Cells<'a, 4>,
    freshness: &'a [u8],
    marks: &'a [u8],
    joints: Cells<'a, 4>,
    baselines: Cells<'a, 4>,
}

impl<'a> RecordedFrame<'a> {
    /// Reads a message; none where it is none.
    pub fn read(message: &'a [u8]) -> Option<Self> {
        let mut cdr = CdrReader::new(message)?;
        let (seq, t_ns) = (cdr.u64()?, cdr.u64()?);
        let (flags, _skipped, threshold) = (cdr.u16()?, cdr.u32()?, cdr.f32()?);
        let counts = cdr.list()?;
        let (faults, _force, ages) = (cdr.list()?, cdr.list::<4>()?, cdr.list()?);
        let (freshness, _status, marks) = (cdr.bytes()?, cdr.bytes()?, cdr.bytes()?);
        let joints = cdr.list()?;
        let (_joint_ages, _velocities, _currents) = (cdr.list::<4>()?, cdr.list::<4>()?, cdr.list::<4>()?);
        let baselines = cdr.list()?;
        let taxels = freshness.len();
        let fit = [counts.len(), 3 * faults.len(), 3 * ages.len(), 3 * marks.len()] == [3 * taxels; 4];
        (fit && [0, 3 * taxels].contains(&baselines.len())).then_some(Self {
            seq,
            t_ns,
            is_calibrating: Flags::from_bits(flags).contains(Flags::CALIBRATING),
            threshold,
            counts,
            faults,
            ages,
            freshness,
            marks,
            joints,
            baselines,
        })
    }

    /// Why each taxel was not used.
    pub fn faults(&self) -> impl ExactSizeIterator<Item = Faults> + use<'a> {
        (self.faults.iter()).map(|bits| Faults::from_bits(u16::from_le_bytes(*bits)))
    }

    /// Whether each taxel was in contact.
    pub fn contacts(&self) -> impl ExactSizeIterator<Item = bool> + use<'a> {
        self.marks.iter().map(|marks| marks & 1 != 0)
    }

    /// Baseline x, y, z of each taxel, counts, not a number where it had none; none of any where none was known, or the
    /// hand has so many taxels that they are not sent.
    pub fn baselines(&self) -> impl ExactSizeIterator<Item = [f32; 3]> + use<'a> {
        let baselines = self.baselines.as_chunks::<3>().0.iter();
        baselines.map(|xyz| xyz.map(f32::from_le_bytes))
    }

    /// Counts x, y, z of each taxel; none where it had no value of the frame's time.
    pub fn counts(&self) -> impl ExactSizeIterator<Item = Option<[u16; 3]>> + use<'a> {
        let counts = self.counts.as_chunks::<3>().0.iter();
        counts.zip(self.freshness).map(|(xyz, freshness)| {
            let is_fresh = *freshness == freshness_number(Freshness::Fresh);
            is_fresh.then(|| xyz.map(u16::from_le_bytes))
        })
    }

    /// Age of each taxel's value at the frame's time, microseconds; `u32::MAX` where it never had one.
    pub fn ages_us(&self) -> impl ExactSizeIterator<Item = u32> + use<'a> {
        self.ages.iter().map(|age| u32::from_le_bytes(*age))
    }

    /// Whether any taxel has a value of the frame's time.
    pub fn has_values(&self) -> bool {
        self.counts().any(|counts| counts.is_some())
    }

    /// Joint angles, radians; not a number where unknown.
    pub fn joints(&self) -> impl ExactSizeIterator<Item = f32> + use<'a> {
        self.joints.iter().map(|angle| f32::from_le_bytes(*angle))
    }
}

/// A tactile image from taxeld's IMAGE message.
pub fn image_message(header: &Header, image: &ImageView<'_>) -> Vec<u8> {
    let mut cdr = CdrWriter::with_capacity(
        96 + image.pixels().len()
            + 12 * image.actuators().len()
            + 4 * (image.levels().len() + image.joints().len()),
    );
    put_head(&mut cdr, header);
    cdr.u16(image.width);
    cdr.u16(image.height);
    cdr.u32(image.contacts);
    cdr.u32(image.faulty);
    cdr.u32(image.missing);
    cdr.f32s(image.levels());
    cdr.u16s(image.actuators().map(|actuator| actuator.id));
    cdr.u16s(image.actuators().map(|actuator| actuator.x));
    cdr.u16s(image.actuators().map(|actuator| actuator.y));
    cdr.u16s(image.actuators().map(|actuator| actuator.level));
    cdr.f32s(image.actuators().map(|actuator| actuator.force));
    cdr.f32s(image.joints());
    cdr.bytes(image.pixels());
    cdr.finish()
}

/// Reads a tactile image; none where the message is none.
pub fn read_image(message: &[u8]) -> Option<TactileImage> {
    let mut cdr = CdrReader::new(message)?;
    let (seq, t_ns, flags, _skipped) = (cdr.u64()?, cdr.u64()?, cdr.u16()?, cdr.u32()?);
    let (width, height) = (cdr.u16()?, cdr.u16()?);
    let mut count = || Some(u16::try_from(cdr.u32()?).unwrap_or(u16::MAX));
    let (contacts, faulty, missing) = (count()?, count()?, count()?);
    let floats =
        |cells: Cells<'_, 4>| -> Vec<f32> { cells.iter().map(|cell| f32::from_le_bytes(*cell)).collect() };
    let levels = floats(cdr.list()?);
    let [id, x, y, level]: [Cells<'_, 2>; 4] = [cdr.list()?, cdr.list()?, cdr.list()?, cdr.list()?];
    let force = floats(cdr.list()?);
    let joints = floats(cdr.list()?);
    let pixels = cdr.bytes()?;
    let flags = Flags::from_bits(flags);
    let fit = [id, x, y, level].iter().all(|list| list.len() == force.len());
    if !fit || pixels.len() != usize::from(width) * usize::from(height) {
        return None;
    }
    let actuators = (0..force.len()).map(|i| {
        let [id, x, y, level] = [id[i], x[i], y[i], level[i]].map(u16::from_le_bytes);
        Actuator {
            id,
            x,
            y,
            level,
            force: force[i].into(),
        }
    });
    Some(TactileImage {
        seq,
        t_ns,
        width,
        height,
        pixels: pixels.to_vec(),
        levels: levels.into_iter().map(f64::from).collect(),
        actuators: actuators.collect(),
        contacts,
        faulty,
        missing,
        calibrating: flags.contains(Flags::CALIBRATING),
        repaired: flags.contains(Flags::REPAIRED),
        saturated: flags.contains(Flags::SATURATED),
        joints,
    })
}
