//! What was seen in the whole time, for whoever has no terminal.

use crate::figures::no_image_for;
use serde::Serialize;
use std::fmt;
use taxel_hand::plural;
use taxel_wire::status::ProblemStatus;

/// The figures of the whole time: as text a few lines, in JSON one object.
#[derive(Debug, Clone, Serialize)]
pub struct Summary {
    /// Images made from the first to the last that came.
    pub images: u64,
    /// How long that was, seconds.
    pub seconds: f64,
    /// Images made per second; `None` where one came alone, or all at one time.
    pub hz: Option<f64>,
    /// The longest between two images that came, seconds; `None` where one came alone.
    pub longest_gap_s: Option<f64>,
    /// How long ago the newest came at the end, seconds; `None` where nothing was waited for, as in a recording.
    pub age_s: Option<f64>,
    /// Images that came.
    pub received: u64,
    /// The most images in a second that were asked for; `None` where that was all of them.
    pub max_rate_hz: Option<f64>,
    /// Images that did not come though all were asked for.
    pub skipped: Option<u64>,
    /// Median age of images at their arrival, microseconds; `None` where their clock is not that of this machine.
    pub latency_p50_us: Option<f64>,
    /// What 99 of 100 do not exceed.
    pub latency_p99_us: Option<f64>,
    /// The greatest.
    pub latency_max_us: Option<f64>,
    /// Images in which a taxel was in contact, of those that came.
    pub contact_ratio: f64,
    /// The most taxels in contact in one image.
    pub most_contacts: u32,
    /// The most actuators that press in one image.
    pub most_actuators: usize,
    /// Whether forces are above a baseline that is measured: not where they are magnitudes.
    #[serde(skip)]
    pub(crate) has_baseline: bool,
    /// Whether the baseline is measured still.
    pub calibrating: bool,
    /// When that was done, seconds from the start, below 0 before it; `None` while it is measured, and where it was before
    /// the first image.
    pub calibrated_s: Option<f64>,
    /// Whether no contact is shown at the end, since displays were told to let go; `None` where nobody has told.
    pub paused: Option<bool>,
    /// Why there is no daemon at the end, if so.
    pub gone: Option<String>,
    /// Taxels without a value in the last image.
    pub missing: u32,
    /// Taxels out of use in the last image.
    pub faulty: u32,
    /// Joints that are read.
    pub joints: usize,
    /// Those whose angle is known in the last image.
    pub joints_known: usize,
    /// Images in which all angles were known, of those that came; `None` where no joints are read.
    pub joints_known_ratio: Option<f64>,
    /// What is wrong, errors first; `None` where nobody has told.
    pub problems: Option<Vec<ProblemStatus>>,
    /// Why there are none, in words.
    #[serde(skip)]
    pub(crate) unlooked: Option<&'static str>,
    /// Which taxels are out of use at the end and why, a sentence each.
    pub out_of_use: Vec<String>,
    /// The raw counts, bits per second; `None` where `hz` is.
    pub raw_bits_per_s: Option<f64>,
    /// What tells a display as much as its actuators can render, bits per second, likewise.
    pub image_bits_per_s: Option<f64>,
    /// How much less that is.
    pub compression_ratio: f64,
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ms = |us: f64| us / 1e3;
        write!(f, "images     {} in {:.1} s, ", self.images, self.seconds)?;
        if let Some(hz) = self.hz {
            write!(f, "{hz:.1} Hz, ")?;
        }
        match self.max_rate_hz {
            Some(hz) => writeln!(f, "{} of them asked for: at most {hz:.0} a second", self.received)?,
            None => writeln!(f, "{} of them skipped", self.skipped.unwrap_or_default())?,
        }
        let gap = self
            .longest_gap_s
            .map(|s| format!("{s:.2} s at most between two"));
        let gaps: Vec<String> = gap.into_iter().chain(no_image_for(self.age_s)).collect();
        if !gaps.is_empty() {
            writeln!(f, "gaps       {}", gaps.join("; "))?;
        }
        if let (Some(p50), Some(p99), Some(max)) =
            (self.latency_p50_us, self.latency_p99_us, self.latency_max_us)
        {
            writeln!(
                f,
                "latency    p50 {:.2} ms, p99 {:.2} ms, max {:.2} ms, from a sweep's last frame to this subscriber",
                ms(p50),
                ms(p99),
                ms(max),
            )?;
        }
        writeln!(
            f,
            "contact    in {:.0} % of images, up to {} and {}{}",
            100.0 * self.contact_ratio,
            plural(self.most_contacts, "taxel"),
            plural(self.most_actuators, "actuator"),
            match self.paused {
                Some(true) => "; paused at the end, when none is shown",
                _ => "",
            }
        )?;
        let calibrated = match self.calibrated_s {
            _ if !self.has_baseline => String::new(),
            _ if self.calibrating => "still calibrating; ".into(),
            Some(s) if s >= 0.0 => format!("calibrated {s:.1} s after the start; "),
            _ => "calibrated before the start; ".into(),
        };
        writeln!(
            f,
            "taxels     {calibrated}{} missing and {} faulty at the end",
            self.missing, self.faulty
        )?;
        if let Some(known_ratio) = self.joints_known_ratio {
            writeln!(
                f,
                "joints     {} of {} known at the end, all of them in {:.1} % of images",
                self.joints_known,
                self.joints,
                100.0 * known_ratio
            )?;
        }
        if let Some(unlooked) = self.unlooked {
            writeln!(f, "problems   {unlooked}")?;
        }
        for problem in self.problems.iter().flatten() {
            writeln!(f, "problem    {}", problem.sentence)?;
        }
        for sentence in &self.out_of_use {
            writeln!(f, "out of use {sentence}")?;
        }
        let (Some(raw), Some(image)) = (self.raw_bits_per_s, self.image_bits_per_s) else {
            return Ok(());
        };
        let (raw, image) = (bits_per_s(raw), bits_per_s(image));
        writeln!(
            f,
            "data       {raw} raw, {image} to the display, {:.0}:1",
            self.compression_ratio
        )
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
