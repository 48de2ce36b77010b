//! What a subscriber has seen: the newest image and raw frame, and the figures of the whole time.

use crate::figures::{Arrivals, Figures};
use crate::flat::Hand;
use crate::history::History;
use crate::out_of_use::out_of_use;
use crate::picture::{Joint, Picture, TaxelNow, Trace, unlooked};
use crate::scale::{Scale, greatest_of_most};
use crate::screen::Screen;
use crate::summary::Summary;
use hdrhistogram::Histogram;
use std::ops::Deref;
use std::sync::Arc;
use taxel_hand::Profile;
use taxel_wire::status::ProblemStatus;
use taxel_wire::{
    Clock, Event, EventKind, Flags, Header, Hello, ImageView, RawView, Received, Status, WireActuator,
};

/// A sentence of the daemon or about a key stays for so long.
const NOTE_NS: u64 = 6_000_000_000;
/// Bits of one taxel's magnitude, or of its counts on one of three axes.
const RAW_BITS: f64 = 16.0;

/// Everything seen so far.
#[derive(Debug)]
pub struct Seen {
    hello: Option<Hello>,
    hand: Option<Arc<Hand>>,
    status: Option<Status>,
    /// What whoever plays a recording has found to be wrong, and since when.
    found: Option<(ProblemStatus, u64)>,
    latency_ns: Histogram<u64>,
    arrivals: Arrivals,
    first_ns: u64,
    last_ns: u64,
    /// The longest between two images.
    gap_ns: Option<u64>,
    images: u64,
    skipped: u64,
    in_contact: u64,
    joints_known: u64,
    most_contacts: u32,
    most_actuators: usize,
    /// Since when the baseline in use is measured, where that was seen.
    calibrated_ns: Option<u64>,
    scale: Scale,
    history: History,
    newest: Newest,
    paused: bool,
    gone: Option<String>,
    /// What became of a key, and since when it is said.
    answer: Option<(String, u64)>,
    /// What happened by itself, likewise.
    told: Option<(String, u64)>,
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
    actuators: Vec<WireActuator>,
    taxels: Vec<TaxelNow>,
    /// Radians; not a number where unknown.
    joints: Vec<f32>,
}

impl Default for Seen {
    fn default() -> Self {
        Self::new()
    }
}

impl Seen {
    /// Nothing yet.
    pub fn new() -> Self {
        Self {
            hello: None,
            hand: None,
            status: None,
            found: None,
            latency_ns: Histogram::new_with_bounds(1, 10_000_000_000, 2).expect("bounds of a histogram"),
            arrivals: Arrivals::default(),
            first_ns: 0,
            last_ns: 0,
            gap_ns: None,
            images: 0,
            skipped: 0,
            in_contact: 0,
            joints_known: 0,
            most_contacts: 0,
            most_actuators: 0,
            calibrated_ns: None,
            scale: Scale::default(),
            history: History::default(),
            newest: Newest::default(),
            paused: false,
            gone: None,
            answer: None,
            told: None,
        }
    }

    /// Images received.
    pub fn images(&self) -> u64 {
        self.images
    }

    /// Time of validity of the newest image, nanoseconds.
    pub fn t_ns(&self) -> u64 {
        self.newest.t_ns
    }

    /// The hand, once its description has come.
    pub fn hand(&self) -> Option<&Arc<Hand>> {
        self.hand.as_ref()
    }

    /// The newest description of hand and display.
    pub fn hello(&self) -> Option<&Hello> {
        self.hello.as_ref()
    }

    /// The newest status report.
    pub fn status(&self) -> Option<&Status> {
        self.status.as_ref()
    }

    /// The force that the brightest colour stands for, unless somebody holds another, in the unit of the forces.
    pub(crate) fn scale(&self) -> f64 {
        self.scale
            .force(4.0 * self.newest.threshold)
            .max(f64::MIN_POSITIVE)
    }

    /// The profile of the images shown: the daemon's own as its status has it, with what HELLO says of this
    /// subscriber's.
    pub(crate) fn profile(&self) -> Profile {
        let own = self.status.as_ref().map(|status| status.profile.clone());
        let mut profile = own.unwrap_or_default();
        if let Some(hello) = &self.hello {
            let method = serde_json::from_value(hello.profile.method.clone().into());
            profile.method = method.unwrap_or(profile.method);
            profile.levels = hello.profile.levels;
            profile.actuators = hello.profile.actuators;
        }
        profile
    }

    /// Whether displays were told to let go.
    pub fn is_paused(&self) -> bool {
        self.paused
    }

    /// Whether displays were told to let go, where no event says so.
    pub fn set_paused(&mut self, paused: bool) {
        self.paused = paused;
    }

    /// Says to whoever is looking what became of a key, for a few seconds from now on.
    pub fn say(&mut self, answer: impl Into<String>, now_ns: u64) {
        self.answer = Some((answer.into(), now_ns));
    }

    /// Tells whoever is looking what happened by itself, for a few seconds from now on. While it is said what became
    /// of a key, that stays.
    pub fn tell(&mut self, news: impl Into<String>, now_ns: u64) {
        self.told = Some((news.into(), now_ns));
    }

    /// Says no more what was said.
    pub fn hush(&mut self) {
        (self.answer, self.told) = (None, None);
    }

    /// What is said now.
    fn note(&self, now_ns: u64) -> Option<String> {
        let is_new = |(_, at_ns): &&(String, u64)| now_ns.saturating_sub(*at_ns) <= NOTE_NS;
        let said = [&self.answer, &self.told].map(|said| said.as_ref().filter(is_new));
        said.into_iter().flatten().next().map(|(words, _)| words.clone())
    }

    /// The connection ended, and why; what was seen of the hand is true no more.
    pub fn set_gone(&mut self, why: impl Into<String>) {
        self.gone = Some(why.into());
        self.arrivals.end();
        self.newest.actuators.clear();
        self.newest.taxels.clear();
    }

    /// Why there is no daemon, if so.
    pub fn gone(&self) -> Option<&str> {
        self.gone.as_deref()
    }

    /// A message, and when it came on the clock of the images' times, nanoseconds.
    pub fn see(&mut self, received: Received<'_>, now_ns: u64) {
        match received {
            Received::Hello(hello) => self.see_hello(hello, now_ns),
            Received::Image(header, image) => self.see_image(&header, &image, now_ns),
            Received::Raw(header, raw) => self.see_raw(&header, &raw),
            Received::Status(_, status) => self.see_status(status),
            Received::Event(_, event) => self.see_event(event, now_ns),
            Received::Touch(..) | Received::Estimate(..) | Received::Other(_) => {}
        }
    }

    /// A description of hand and display. One that describes no hand is told as a note; one without a unit of forces is of
    /// magnitudes, which no counts belong to.
    pub fn see_hello(&mut self, hello: &Hello, now_ns: u64) {
        match hello.geometry() {
            Ok(hand) if self.hand.as_deref().map(Deref::deref) != Some(&hand) => {
                self.hand = Some(Arc::new(Hand::new(hand)))
            }
            Ok(_) => {}
            Err(error) => self.tell(format!("the hand cannot be drawn: {error}"), now_ns),
        }
        self.gone = None;
        self.hello = Some(hello.clone());
    }

    /// A status report.
    pub(crate) fn see_status(&mut self, status: serde_json::Value) {
        if let Ok(status) = Status::try_from(status) {
            self.paused = status.paused;
            self.status = Some(status);
        }
    }

    /// What is wrong from this time on, found by whoever plays a recording, in which no daemon looks; `None` where it is over.
    pub fn set_problem(&mut self, problem: Option<ProblemStatus>, t_ns: u64) {
        self.found = problem.map(|problem| (problem, t_ns));
    }

    /// Something that the daemon tells people.
    pub(crate) fn see_event(&mut self, event: Event, now_ns: u64) {
        match event.event {
            EventKind::Paused => self.paused = true,
            EventKind::Resumed => self.paused = false,
            EventKind::Calibrating | EventKind::Calibrated => {}
            EventKind::Mark => self.tell(format!("mark: {}", event.message), now_ns),
            _ => self.tell(event.message, now_ns),
        }
    }

    /// An image, and when it came on the clock of its times, nanoseconds.
    pub fn see_image(&mut self, header: &Header, image: &ImageView<'_>, now_ns: u64) {
        match self.images {
            0 => self.first_ns = now_ns,
            _ => self.gap_ns = self.gap_ns.max(Some(now_ns.saturating_sub(self.last_ns))),
        }
        self.last_ns = now_ns;
        self.images += 1;
        self.skipped += u64::from(header.skipped);
        let latency_ns = now_ns.saturating_sub(header.t_ns).max(1);
        self.latency_ns.saturating_record(latency_ns);
        self.arrivals
            .see(now_ns, 1 + u64::from(header.skipped), latency_ns);
        self.in_contact += u64::from(image.contacts > 0);
        self.most_contacts = self.most_contacts.max(image.contacts);
        self.most_actuators = self.most_actuators.max(image.actuators().len());
        let newest = &mut self.newest;
        newest.t_ns = header.t_ns;
        newest.contacts = image.contacts;
        newest.missing = image.missing;
        newest.faulty = image.faulty;
        let was_calibrating = newest.calibrating;
        newest.calibrating = header.flags.contains(Flags::CALIBRATING);
        match newest.calibrating {
            true => self.calibrated_ns = None,
            false if was_calibrating => self.calibrated_ns = Some(header.t_ns),
            false => {}
        }
        newest.actuators.clear();
        newest.actuators.extend(image.actuators());
        newest.joints.clear();
        newest.joints.extend(image.joints());
        let known = !newest.joints.is_empty() && newest.joints.iter().all(|angle| angle.is_finite());
        self.joints_known += u64::from(known);
        let forces = newest.actuators.iter().map(|a| f64::from(a.force));
        self.scale.see(greatest_of_most(forces), header.t_ns);
    }

    /// A raw frame.
    pub fn see_raw(&mut self, header: &Header, raw: &RawView<'_>) {
        let newest = &mut self.newest;
        newest.threshold = f64::from(raw.threshold);
        newest.taxels.clear();
        let taxels = raw.taxels();
        newest.taxels.extend(taxels.map(|taxel| TaxelNow {
            raw: taxel,
            press: None,
        }));
        if let Some(baselines) = raw.baselines() {
            for (taxel, baseline) in newest.taxels.iter_mut().zip(baselines) {
                let press = taxel.raw.press(baseline);
                taxel.press = press.iter().all(|axis| axis.is_finite()).then_some(press);
            }
        }
        let forces = self.newest.taxels.iter().map(|taxel| taxel.raw.force);
        self.history.see(header.t_ns, forces, self.strongest());
    }

    /// Whether forces were made of counts: magnitudes have no unit that anybody knows.
    fn has_counts(&self) -> bool {
        let unit = self.hello.as_ref().map(|hello| &hello.force_unit);
        unit.is_some_and(|unit| !unit.is_empty())
    }

    /// Bits of one raw frame, and of what its image tells a display.
    fn bits_per_frame(&self) -> (f64, f64) {
        let axes = if self.has_counts() { 3.0 } else { 1.0 };
        let taxels = self.hand.as_ref().map_or(0, |hand| hand.len());
        let raw = taxels as f64 * axes * RAW_BITS;
        let image = self.hello.as_ref().map_or(0.0, |hello| {
            let pixels = f64::from(hello.width) * f64::from(hello.height);
            let levels = f64::from(hello.profile.levels);
            f64::from(hello.profile.actuators) * (pixels.log2().ceil() + levels.log2().ceil())
        });
        (raw, image)
    }

    /// How long ago the newest image came, nanoseconds; `None` before the first.
    fn age_ns(&self, now_ns: u64) -> Option<u64> {
        (self.images > 0).then(|| now_ns.saturating_sub(self.last_ns))
    }

    /// Rates and latencies of late, made anew twice a second.
    pub fn figures(&mut self, now_ns: u64) -> Figures {
        let (raw, image) = self.bits_per_frame();
        let tells_age = |hello: &Hello| matches!(hello.clock, Clock::Monotonic | Clock::Realtime);
        let tells_age = self.hello.as_ref().is_some_and(tells_age);
        self.arrivals.figures(now_ns, tells_age, [raw, image])
    }

    /// All that is drawn now; `None` before the hand is known.
    pub fn picture(&mut self, screen: &Screen, now_ns: u64) -> Option<Picture> {
        let hand = self.hand.clone()?;
        let figures = self.figures(now_ns);
        let (hello, newest) = (self.hello.as_ref()?, &self.newest);
        let traced = |taxel: usize| Trace {
            taxel,
            points: self.history.of(taxel),
        };
        let cursor = screen
            .cursor
            .or_else(|| self.strongest())
            .filter(|taxel| *taxel < hand.len());
        let scale = screen.held.unwrap_or_else(|| self.scale());
        Some(Picture {
            taxels: newest.taxels.clone(),
            actuators: newest.actuators.clone(),
            joints: (hello.joints.iter().zip(&newest.joints))
                .map(|(name, angle)| Joint {
                    name: name.clone(),
                    angle_rad: angle.is_finite().then_some(*angle),
                })
                .collect(),
            scale,
            held: screen.held.is_some(),
            threshold: newest.threshold,
            unit: hello.force_unit.clone(),
            levels: hello.profile.levels,
            max_actuators: hello.profile.actuators,
            method: hello.profile.method.clone(),
            figures,
            contacts: newest.contacts,
            missing: newest.missing,
            faulty: newest.faulty,
            skipped: self.most_hz().is_none().then_some(self.skipped),
            calibrating: newest.calibrating,
            paused: self.paused,
            gone: self.gone.clone(),
            age_s: self.age_ns(now_ns).map(seconds),
            note: self.note(now_ns),
            problems: self.problems(),
            recorded: hello.clock == Clock::Recording,
            traces: match screen.chosen.is_empty() {
                true => (cursor.or(self.history.touched()).into_iter())
                    .map(traced)
                    .collect(),
                false => screen
                    .chosen
                    .iter()
                    .copied()
                    .filter(|taxel| *taxel < hand.len())
                    .map(traced)
                    .collect(),
            },
            cursor,
            hand,
        })
    }

    /// Errors before warnings; none before somebody has told of any.
    fn problems(&self) -> Option<Vec<ProblemStatus>> {
        let found = self.found.as_ref().map(|(problem, t_ns)| ProblemStatus {
            since_s: seconds(self.newest.t_ns.saturating_sub(*t_ns)),
            ..problem.clone()
        });
        let told = self.status.as_ref().map(|status| status.problems.clone());
        let mut problems = match (told, found) {
            (None, None) => return None,
            (told, found) => told.into_iter().flatten().chain(found).collect::<Vec<_>>(),
        };
        problems.sort_by_key(|problem| !problem.severe);
        Some(problems)
    }

    /// The taxel with the greatest force, if any has one.
    pub fn strongest(&self) -> Option<usize> {
        let forces = self.newest.taxels.iter().map(|taxel| taxel.raw.force).enumerate();
        let touched = forces.filter(|(taxel, force)| *force > 0.0 && self.newest.taxels[*taxel].raw.contact);
        touched.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(taxel, _)| taxel)
    }

    /// The most images in a second that were asked for, if that is fewer than all.
    fn most_hz(&self) -> Option<f64> {
        let subscription = self.hello.as_ref().and_then(|hello| hello.subscription.as_ref());
        subscription.and_then(|s| s.max_rate_hz)
    }

    /// The figures of the whole time. When it began, and now where that goes on without images, are on the clock of the
    /// images' times, nanoseconds.
    pub fn summary(&self, began_ns: u64, now_ns: Option<u64>) -> Summary {
        let took_s = seconds(self.last_ns.saturating_sub(self.first_ns));
        let made = self.images + self.skipped;
        let hz = (took_s > 0.0).then(|| made.saturating_sub(1) as f64 / took_s);
        let of_images = |images: u64| images as f64 / self.images.max(1) as f64;
        let clock = self.hello.as_ref().map(|hello| hello.clock);
        let us = |ns: u64| (clock == Some(Clock::Monotonic)).then_some(ns as f64 / 1e3);
        let latency_us = |q: f64| us(self.latency_ns.value_at_quantile(q));
        let since_began_s = |at: u64| (i128::from(at) - i128::from(began_ns)) as f64 / 1e9;
        let (raw_bits, image_bits) = self.bits_per_frame();
        let (max_rate_hz, problems) = (self.most_hz(), self.problems());
        let hand = self.hand.as_ref();
        Summary {
            images: made,
            seconds: took_s,
            hz,
            longest_gap_s: self.gap_ns.map(seconds),
            age_s: now_ns.and_then(|now_ns| self.age_ns(now_ns)).map(seconds),
            received: self.images,
            max_rate_hz,
            skipped: max_rate_hz.is_none().then_some(self.skipped),
            latency_p50_us: latency_us(0.5),
            latency_p99_us: latency_us(0.99),
            latency_max_us: us(self.latency_ns.max()),
            contact_ratio: of_images(self.in_contact),
            most_contacts: self.most_contacts,
            most_actuators: self.most_actuators,
            has_baseline: self.has_counts(),
            calibrating: self.newest.calibrating,
            calibrated_s: self.calibrated_ns.map(since_began_s),
            paused: self.status.as_ref().map(|_| self.paused),
            gone: self.gone.clone(),
            missing: self.newest.missing,
            faulty: self.newest.faulty,
            joints: self.newest.joints.len(),
            joints_known: self
                .newest
                .joints
                .iter()
                .filter(|angle| angle.is_finite())
                .count(),
            joints_known_ratio: (!self.newest.joints.is_empty()).then(|| of_images(self.joints_known)),
            unlooked: clock
                .filter(|_| problems.is_none())
                .map(|clock| unlooked(clock == Clock::Recording)),
            problems,
            out_of_use: hand.map_or_else(Vec::new, |hand| out_of_use(hand, &self.newest.taxels)),
            raw_bits_per_s: hz.map(|hz| raw_bits * hz),
            image_bits_per_s: hz.map(|hz| image_bits * hz),
            compression_ratio: raw_bits / image_bits.max(1.0),
        }
    }
}

fn seconds(ns: u64) -> f64 {
    ns as f64 / 1e9
}

#[cfg(test)]
mod tests;
