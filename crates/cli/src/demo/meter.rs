//! What the demo's subscriber has seen: the newest picture, and the figures of the whole run.

use super::palpation::Palpation;
use hdrhistogram::Histogram;
use std::collections::VecDeque;
use std::fmt::Write;
use taxel_hand::Freshness;
use taxel_sim::Scene;
use taxel_skin::Layout;
use taxel_wire::{Event, EventKind, Flags, Header, Hello, ImageView, RawView, WireActuator};

/// The rate is measured over this time.
const RATE_WINDOW_NS: u64 = 1_000_000_000;
/// The brightest colour stands for the greatest force of late; it halves in this time without one.
const SCALE_HALVES_NS: f64 = 10e9;
/// The latencies shown are those of so many images; the summary's are those of all.
const RECENT_IMAGES: usize = 500;
/// Bits of one taxel's raw counts: three axes of 16.
const RAW_TAXEL_BITS: f64 = 48.0;

/// Everything seen so far.
pub(super) struct Meter {
    scene: String,
    about: String,
    scene_seconds: f64,
    scene_began_ns: u64,
    layout: Layout,
    hello: Option<Hello>,
    latency_ns: Histogram<u64>,
    recent_latency_ns: VecDeque<u64>,
    arrivals_ns: VecDeque<u64>,
    first_ns: u64,
    last_ns: u64,
    images: u64,
    skipped: u64,
    in_contact: u64,
    /// Images in which every joint's angle was known.
    joints_known: u64,
    most_contacts: u32,
    most_actuators: usize,
    calibrated_ns: Option<u64>,
    scale: f64,
    newest: Newest,
    /// Whether the displays were told to let go.
    pub(super) paused: bool,
    /// Where touches fell, where a phantom is palpated.
    pub(super) palpation: Option<Palpation>,
    /// Something the user should read.
    pub(super) note: String,
    /// The daemon has closed the connection.
    pub(super) closed: bool,
    /// Why the connection failed, if it did.
    pub(super) failure: Option<String>,
}

/// The newest image and raw frame.
#[derive(Debug, Default, Clone)]
struct Newest {
    t_ns: u64,
    contacts: u32,
    missing: u32,
    faulty: u32,
    calibrating: bool,
    threshold: f64,
    levels: usize,
    actuators: Vec<WireActuator>,
    cells: Vec<Cell>,
    /// Radians; not a number where unknown.
    joints: Vec<f32>,
}

/// One taxel as the raw panel shows it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Cell {
    /// Force above baseline.
    Force(f64),
    /// Out of use.
    Faulty,
    /// No value of late.
    Missing,
}

/// One picture of the demo: all that the view needs.
#[derive(Debug, Clone)]
pub(super) struct Picture {
    pub(super) layout: Layout,
    /// By taxel; empty before the first raw frame.
    pub(super) cells: Vec<Cell>,
    pub(super) actuators: Vec<WireActuator>,
    /// Names of the joints and their angles, radians; `None` where unknown.
    pub(super) joints: Vec<(String, Option<f32>)>,
    /// The force that the brightest colour stands for.
    pub(super) scale: f64,
    pub(super) unit: String,
    pub(super) levels: u16,
    pub(super) max_actuators: u16,
    pub(super) method: String,
    pub(super) scene: String,
    pub(super) about: String,
    pub(super) scene_at_s: f64,
    pub(super) scene_seconds: f64,
    pub(super) rate_hz: f64,
    pub(super) latency_p50_ms: f64,
    pub(super) latency_p99_ms: f64,
    pub(super) contacts: u32,
    pub(super) missing: u32,
    pub(super) faulty: u32,
    pub(super) skipped: u64,
    pub(super) raw_bits_per_s: f64,
    pub(super) image_bits_per_s: f64,
    pub(super) calibrating: bool,
    pub(super) paused: bool,
    pub(super) palpation: Option<Palpation>,
    pub(super) note: String,
}

impl Meter {
    /// Of a hand on which the scene began at this time on the images' clock, nanoseconds.
    pub(super) fn new(layout: Layout, scene_began_ns: u64, scene: &Scene) -> Self {
        Self {
            scene: scene.name().into(),
            about: scene.about().into(),
            scene_seconds: scene.seconds(),
            scene_began_ns,
            layout,
            hello: None,
            latency_ns: Histogram::new_with_bounds(1, 10_000_000_000, 2).expect("bounds of a histogram"),
            recent_latency_ns: VecDeque::with_capacity(RECENT_IMAGES),
            arrivals_ns: VecDeque::new(),
            first_ns: 0,
            last_ns: 0,
            images: 0,
            skipped: 0,
            in_contact: 0,
            joints_known: 0,
            most_contacts: 0,
            most_actuators: 0,
            calibrated_ns: None,
            scale: 0.0,
            newest: Newest::default(),
            paused: false,
            palpation: None,
            note: String::new(),
            closed: false,
            failure: None,
        }
    }

    /// Images received.
    pub(super) fn images(&self) -> u64 {
        self.images
    }

    pub(super) fn hello(&mut self, hello: &Hello) {
        self.hello = Some(hello.clone());
    }

    pub(super) fn event(&mut self, event: Event) {
        match event.event {
            EventKind::Paused => self.paused = true,
            EventKind::Resumed => self.paused = false,
            EventKind::Calibrating | EventKind::Calibrated | EventKind::Disconnect | EventKind::Mark => {}
            _ => self.note = event.message,
        }
    }

    pub(super) fn image(&mut self, header: &Header, image: &ImageView<'_>, now_ns: u64) {
        if self.images == 0 {
            self.first_ns = now_ns;
        }
        self.last_ns = now_ns;
        self.images += 1;
        self.skipped += u64::from(header.skipped);
        let latency_ns = now_ns.saturating_sub(header.t_ns).max(1);
        self.latency_ns.saturating_record(latency_ns);
        if self.recent_latency_ns.len() == RECENT_IMAGES {
            self.recent_latency_ns.pop_front();
        }
        self.recent_latency_ns.push_back(latency_ns);
        self.arrivals_ns.push_back(now_ns);
        self.in_contact += u64::from(image.contacts > 0);
        self.most_contacts = self.most_contacts.max(image.contacts);
        self.most_actuators = self.most_actuators.max(image.actuators().len());
        let newest = &mut self.newest;
        let elapsed_ns = header.t_ns.saturating_sub(newest.t_ns) as f64;
        newest.t_ns = header.t_ns;
        newest.contacts = image.contacts;
        newest.missing = image.missing;
        newest.faulty = image.faulty;
        newest.calibrating = header.flags.contains(Flags::CALIBRATING);
        newest.levels = image.levels().len();
        newest.actuators.clear();
        newest.actuators.extend(image.actuators());
        newest.joints.clear();
        newest.joints.extend(image.joints());
        let joints = newest.joints.len();
        self.joints_known += u64::from(joints > 0 && newest.joints.iter().all(|angle| angle.is_finite()));
        if !newest.calibrating && self.calibrated_ns.is_none() {
            self.calibrated_ns = Some(header.t_ns);
        }
        let greatest = newest
            .actuators
            .iter()
            .map(|a| f64::from(a.force))
            .fold(0.0, f64::max);
        self.scale = (self.scale * 0.5f64.powf(elapsed_ns / SCALE_HALVES_NS)).max(greatest);
    }

    pub(super) fn raw(&mut self, _header: &Header, raw: &RawView<'_>) {
        self.newest.threshold = f64::from(raw.threshold);
        self.newest.cells.clear();
        self.newest
            .cells
            .extend(raw.taxels().map(|t| match (t.freshness, t.faults) {
                (Freshness::Fresh, 0) => Cell::Force(f64::from(t.force)),
                (Freshness::Fresh, _) => Cell::Faulty,
                _ => Cell::Missing,
            }));
    }

    /// Images per second over the last second.
    fn rate_hz(&mut self, now_ns: u64) -> f64 {
        while self
            .arrivals_ns
            .front()
            .is_some_and(|at| now_ns.saturating_sub(*at) > RATE_WINDOW_NS)
        {
            self.arrivals_ns.pop_front();
        }
        match (self.arrivals_ns.front(), self.arrivals_ns.back()) {
            (Some(first), Some(last)) if last > first => {
                (self.arrivals_ns.len() - 1) as f64 * 1e9 / (last - first) as f64
            }
            _ => 0.0,
        }
    }

    /// Bits of one raw frame, and of what tells a display as much as its actuators can render: for each the
    /// pixel and the level (docs/algorithm.md, "Figures from elsewhere").
    fn bits_per_frame(&self) -> (f64, f64) {
        let raw = self.layout.len() as f64 * RAW_TAXEL_BITS;
        let image = self.hello.as_ref().map_or(0.0, |hello| {
            let pixels = f64::from(hello.width) * f64::from(hello.height);
            let levels = f64::from(hello.profile.levels);
            f64::from(hello.profile.actuators) * (pixels.log2().ceil() + levels.log2().ceil())
        });
        (raw, image)
    }

    /// The newest picture.
    pub(super) fn picture(&mut self, now_ns: u64) -> Picture {
        let rate_hz = self.rate_hz(now_ns);
        let (raw_bits, image_bits) = self.bits_per_frame();
        let scene_at_s = self.newest.t_ns.saturating_sub(self.scene_began_ns) as f64 / 1e9;
        let mut latency_ns: Vec<u64> = self.recent_latency_ns.iter().copied().collect();
        latency_ns.sort_unstable();
        let quantile_ms = |q: f64| {
            let place = (latency_ns.len() as f64 * q) as usize;
            latency_ns
                .get(place.min(latency_ns.len().saturating_sub(1)))
                .map_or(0.0, |ns| *ns as f64 / 1e6)
        };
        let hello = self.hello.as_ref();
        Picture {
            layout: self.layout.clone(),
            cells: self.newest.cells.clone(),
            actuators: self.newest.actuators.clone(),
            joints: (hello.map(|h| h.joints.clone()).unwrap_or_default().into_iter())
                .zip(&self.newest.joints)
                .map(|(name, angle)| (name, angle.is_finite().then_some(*angle)))
                .collect(),
            scale: self.scale.max(4.0 * self.newest.threshold),
            unit: hello.map_or_else(|| "counts".into(), |h| h.force_unit.clone()),
            levels: hello.map_or(0, |h| h.profile.levels),
            max_actuators: hello.map_or(0, |h| h.profile.actuators),
            method: hello.map_or_else(String::new, |h| h.profile.method.clone()),
            scene: self.scene.clone(),
            about: self.about.clone(),
            scene_at_s: scene_at_s % self.scene_seconds,
            scene_seconds: self.scene_seconds,
            rate_hz,
            latency_p50_ms: quantile_ms(0.5),
            latency_p99_ms: quantile_ms(0.99),
            contacts: self.newest.contacts,
            missing: self.newest.missing,
            faulty: self.newest.faulty,
            skipped: self.skipped,
            raw_bits_per_s: raw_bits * rate_hz,
            image_bits_per_s: image_bits * rate_hz,
            calibrating: self.newest.calibrating,
            paused: self.paused,
            palpation: self.palpation.clone(),
            note: self.note.clone(),
        }
    }

    /// The whole run in a few lines.
    pub(super) fn summary(&self) -> String {
        let mut text = String::new();
        let seconds = self.last_ns.saturating_sub(self.first_ns) as f64 / 1e9;
        let rate_hz = if seconds > 0.0 {
            (self.images - 1) as f64 / seconds
        } else {
            0.0
        };
        let ms = |ns: u64| ns as f64 / 1e6;
        let (levels, actuators, method) = match &self.hello {
            Some(h) => (h.profile.levels, h.profile.actuators, h.profile.method.as_str()),
            None => (0, 0, "unknown"),
        };
        let (name, buses) = (&self.layout.name, &self.layout.buses);
        let (raw_bits, image_bits) = self.bits_per_frame();
        let _ = writeln!(
            text,
            "{}: {name}, {} taxels on {} {}; method {method}, {levels} levels, {actuators} actuators",
            self.scene,
            self.layout.len(),
            buses.len(),
            if buses.len() == 1 { "bus" } else { "buses" },
        );
        let _ = writeln!(
            text,
            "images     {} in {seconds:.1} s, {rate_hz:.1} Hz, {} skipped",
            self.images, self.skipped
        );
        let latency = |q: f64| ms(self.latency_ns.value_at_quantile(q));
        let _ = writeln!(
            text,
            "latency    p50 {:.2} ms, p99 {:.2} ms, max {:.2} ms, from a sweep's last frame to this subscriber",
            latency(0.5),
            latency(0.99),
            ms(self.latency_ns.max()),
        );
        let share = 100.0 * self.in_contact as f64 / self.images.max(1) as f64;
        let _ = writeln!(
            text,
            "contact    in {share:.0} % of images, up to {} taxels and {} actuators",
            self.most_contacts, self.most_actuators
        );
        let calibrated = match self.calibrated_ns {
            Some(at) => format!(
                "calibrated {:.1} s after the start",
                ms(at - self.scene_began_ns) / 1e3
            ),
            None => "still calibrating".into(),
        };
        let _ = writeln!(
            text,
            "taxels     {calibrated}; {} missing and {} faulty at the end",
            self.newest.missing, self.newest.faulty
        );
        if !self.newest.joints.is_empty() {
            let known = self
                .newest
                .joints
                .iter()
                .filter(|angle| angle.is_finite())
                .count();
            let share = 100.0 * self.joints_known as f64 / self.images.max(1) as f64;
            let _ = writeln!(
                text,
                "joints     {known} of {} known at the end, all of them in {share:.1} % of images",
                self.newest.joints.len()
            );
        }
        text += &self
            .palpation
            .as_ref()
            .map(Palpation::summary)
            .unwrap_or_default();
        let _ = writeln!(
            text,
            "data       {} raw, {} to the display, {:.0}:1",
            bits_per_s(raw_bits * rate_hz),
            bits_per_s(image_bits * rate_hz),
            raw_bits / image_bits.max(1.0),
        );
        text
    }
}

/// A rate of data as people say it.
fn bits_per_s(bits: f64) -> String {
    match bits {
        b if b >= 1e6 => format!("{:.2} Mbit/s", b / 1e6),
        b if b >= 1e3 => format!("{:.1} kbit/s", b / 1e3),
        b => format!("{b:.0} bit/s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_hand::{Actuator, TactileImage};
    use taxel_wire::encode_image_payload;

    const SECOND_NS: u64 = 1_000_000_000;

    fn meter() -> Meter {
        let layout = Layout::builtin("allegro-uskin-15").unwrap();
        Meter::new(layout, SECOND_NS, &Scene::builtin("tap").unwrap())
    }

    fn see(meter: &mut Meter, index: u64, force: f64) {
        let image = TactileImage {
            seq: index,
            t_ns: SECOND_NS + index * 20_000_000,
            width: 2,
            height: 1,
            pixels: vec![0, 255],
            levels: vec![force],
            actuators: vec![Actuator {
                id: 0,
                x: 1,
                y: 0,
                level: 1,
                force,
            }],
            contacts: 1,
            ..TactileImage::default()
        };
        let mut payload = Vec::new();
        encode_image_payload(&image, &mut payload).unwrap();
        let header = Header::of_image(&image, payload.len());
        meter.image(
            &header,
            &ImageView::decode(&payload).unwrap(),
            image.t_ns + 250_000,
        );
    }

    #[test]
    fn rate_latency_and_scene_time_are_those_of_the_images() {
        let mut meter = meter();
        for index in 0..200 {
            see(&mut meter, index, 10.0);
        }
        let picture = meter.picture(SECOND_NS + 199 * 20_000_000 + 300_000);
        assert!((picture.rate_hz - 50.0).abs() < 0.01, "{}", picture.rate_hz);
        assert_eq!((picture.latency_p50_ms, picture.latency_p99_ms), (0.25, 0.25));
        assert!(
            (picture.scene_at_s - 3.98).abs() < 0.001,
            "{}",
            picture.scene_at_s
        );
        let summary = meter.summary();
        for part in [
            "images     200 in 4.0 s, 50.0 Hz",
            "p50 0.25 ms",
            "in 100 % of images, up to 1 taxels",
        ] {
            assert!(summary.contains(part), "{part}: {summary}");
        }
    }

    #[test]
    fn the_rate_falls_to_zero_when_images_stay_away() {
        let mut meter = meter();
        for index in 0..20 {
            see(&mut meter, index, 10.0);
        }
        assert_eq!(meter.picture(10 * SECOND_NS).rate_hz, 0.0);
    }

    #[test]
    fn the_scale_keeps_the_greatest_force_for_a_while() {
        let mut meter = meter();
        see(&mut meter, 0, 1000.0);
        see(&mut meter, 1, 10.0);
        let scale = meter.picture(SECOND_NS).scale;
        assert!((900.0..1000.0).contains(&scale), "{scale}");
        see(&mut meter, 1500, 10.0);
        let scale = meter.picture(SECOND_NS).scale;
        assert!((100.0..200.0).contains(&scale), "{scale}");
    }
}
